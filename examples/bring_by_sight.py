"""Bring by sight: a network imitates a searcher who reads the names of things, and sees pictures of them instead.

python examples/bring_by_sight.py --out sight.json  # trains in ten lit flats, judges in ten others, with a blind twin

Rooms and furniture are on the robot's map; loose things it has to see. Its head turns to each and looks closer, and the
shipped encoder makes features of that. What is right is learned from the searcher's choices, also from those that it
would make if it were asked for something else in sight.
"""

from __future__ import annotations

import argparse
import copy
import dataclasses
import json
import math
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import torch
from bring_me import Search, Searcher, chosen_worlds, episode
from skills import Skills
from torch import nn

from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.common.weights import seeded
from embodied.agents.vision.encoder import Encoder, load_encoder
from embodied.gym.bring import BringEnv
from embodied.gym.robot import RobotSettings
from embodied.interface import Intention, Observation
from embodied.render.camera import camera_at
from embodied.seeds import stream

QUESTIONS = (Intention.REGION, Intention.APPEARANCE, Intention.CONFIRM)
VERBS = ("go", "open", "take", "give", "leave", *(f"ask {q.value}" for q in QUESTIONS))
PIXELS, CLOSER, WORDS, FACTS, PLACES = 96, math.radians(14), 1024, 23, 40
"""Side of a picture; its field of view; rows of the table of words; numbers that `facts` gives of a choice; and places
of a house at which the teacher is asked for what is in sight, besides its episodes."""


class Eye:
    """Features of what a robot's head sees of things, one picture each."""

    def __init__(self, env: BringEnv, encoder: Encoder) -> None:
        self._env, self._encoder, self.size = env, encoder, encoder.size + 3

    def features(self, names: list[str]) -> np.ndarray:
        """(n, size) float32: the encoder's features, and the colour of the middle, 0 to 1."""
        if not names:
            return np.zeros((0, self.size), np.float32)
        body, world = self._env.body, self._env.world
        world.follow(body.model, body.data, slack=0.3)
        eye, pictures = body.data.cam_xpos[body.model.camera("robot/head").id].copy(), []
        for name in names:
            x, y, z = body.thing(name) - eye
            camera = camera_at(eye, math.atan2(y, x), math.atan2(z, math.hypot(x, y)), CLOSER)
            pictures.append(world.renderer.rgb(camera, (PIXELS, PIXELS)))
        whole, third = np.stack(pictures), slice(PIXELS // 3, 2 * PIXELS // 3)
        colours = whole[:, third, third].mean((1, 2)) / 255
        return np.concatenate([self._encoder.encode_views(whole[None])[0], colours], 1).astype(np.float32)


def options(o: Observation, m: Search) -> list[str]:
    """What can be chosen."""
    return [*o.candidates.words, *(f"ask {q.value}" for q in QUESTIONS if q in o.can_ask)]


def facts(o: Observation, m: Search, choice: str) -> list[float]:
    """(FACTS,) numbers of a choice: its verb, whether its place was named, how often it was chosen, what is held."""
    verb, _, what = choice.partition(" ")
    told = " ".join(sorted(m.told)).lower()
    is_named = lambda name: re.sub(r"_\d+.*", "", name).replace("_", " ") in told
    times = lambda c: [float(m.done[c, m.held] >= n) for n in (1, 2, 4)]
    kind = [float(choice == v or verb == v) for v in VERBS]
    here, named_here = f"go {o.extras.room}", is_named(o.extras.room)
    named = verb in ("go", "open") and is_named(what)
    now = [
        bool(m.held),
        bool(told),
        m.held in m.denied,
        named,
        named_here,
        named_here and verb == "open",
        choice == here,
    ]
    more = [named and verb == "open", what in m.denied]
    return [*kind, *map(float, now), *times(choice), *times(here), *map(float, more)]


def codes(words: str) -> list[int]:
    return [zlib.crc32(w.encode()) % WORDS for w in words.split()] or [0]


@dataclasses.dataclass(frozen=True)
class Example:
    """A moment: what could be chosen, what was seen of it, what was asked for, and what was right."""

    facts: torch.Tensor
    """(n, FACTS)"""
    seen: torch.Tensor
    """(n, D), zeros for what is no thing."""
    request: torch.Tensor
    """(words,) int64."""
    right: torch.Tensor
    """(n,) bool."""


class Chooser(nn.Module):
    """Scores of choices: by their facts, and by how well what is seen fits what is asked for."""

    def __init__(self, seen: torch.Tensor) -> None:
        """`seen`: (n, D) of things, whose mean and deviation become 0 and 1."""
        super().__init__()
        self.mean, self.deviation = seen.mean(0), seen.std(0) + 1e-6
        self.words = nn.EmbeddingBag(WORDS, 48)
        self.sight = nn.Sequential(nn.Dropout(0.3), nn.Linear(seen.shape[1], 48))
        self.choice = nn.Sequential(nn.Linear(FACTS + 1, 64), nn.ReLU(), nn.Linear(64, 1))

    def forward(self, e: Example) -> torch.Tensor:
        """(n,)"""
        fit = (self.sight((e.seen - self.mean) / self.deviation) @ self.words(e.request[None])[0]) * e.facts[
            :, VERBS.index("take")
        ]
        return self.choice(torch.cat([e.facts, fit[:, None]], 1))[:, 0]


def moment(o: Observation, m: Search, request: str, seen: dict[str, np.ndarray], size: int) -> Example:
    """What a chooser is shown; nothing is right yet."""
    choices = options(o, m)
    features = [seen.get(c.removeprefix("take "), np.zeros(size, np.float32)) for c in choices]
    rows = torch.tensor([facts(o, m, c) for c in choices])
    return Example(
        rows, torch.from_numpy(np.stack(features)), torch.tensor(codes(request)), torch.zeros(len(choices)) > 0
    )


def request_of(o: Observation) -> str:
    return o.instruction.partition(" . ")[0].removeprefix("bring me the ")


class Teacher(Searcher):
    """A searcher who reads names; keeps what was right at each moment, and what would be for other requests."""

    def __init__(self, eye: Eye, rng: np.random.Generator) -> None:
        super().__init__(*QUESTIONS)
        self.examples, self._eye, self._rng = list[Example](), eye, rng

    def choices(self, o: Observation, m: Search) -> list[str]:
        left, names = super().choices(o, m), [w[5:] for w in o.candidates.words if w.startswith("take ")]
        seen = dict(zip(names, self._eye.features(names), strict=True))
        self._keep(o, m, left, seen)
        for name in self._rng.permutation(names)[:8]:
            other = o.extras.sees[name].partition(",")[0]
            mind = copy.deepcopy(m)
            mind.done.update({(f"ask {q.value}", m.held): 1 for q in QUESTIONS})
            asked = dataclasses.replace(o, instruction=f"bring me the {other}")
            self._keep(asked, mind, super().choices(asked, mind), seen)
        return left

    def _keep(self, o: Observation, m: Search, left: list[str], seen: dict[str, np.ndarray]) -> None:
        e = moment(o, m, request_of(o), seen, self._eye.size)
        self.examples.append(dataclasses.replace(e, right=torch.tensor([c in left for c in options(o, m)])))


class Sighted(Searcher):
    """Chooses by a trained network the likeliest verb, and of its words what nearly the best is; the blind twin sees
    nothing."""

    def __init__(self, network: Chooser, eye: Eye, blind: bool) -> None:
        super().__init__()
        self._network, self._eye, self._blind = network.eval(), eye, blind

    @torch.no_grad()
    def choices(self, o: Observation, m: Search) -> list[str]:
        names = [w[5:] for w in o.candidates.words if w.startswith("take ")] if not self._blind else []
        seen = dict(zip(names, self._eye.features(names), strict=True))
        e = moment(o, m, request_of(o), seen, self._eye.size)
        return [c for c, near in zip(options(o, m), chosen(self._network(e), e)) if near]


def chosen(scores: torch.Tensor, e: Example) -> torch.Tensor:
    """(n,) bool of choices with (n,) scores: of the likeliest verb, those that are nearly the best."""
    verbs = e.facts[:, : len(VERBS)]
    own = verbs[:, (torch.softmax(scores, 0) @ verbs).argmax()] > 0
    return own & (scores > scores[own].max() - 0.3)


def train(examples: list[Example], blind: bool, passes: int, seed: int) -> Chooser:
    """A network under which what was right is likely."""
    seen = [dataclasses.replace(e, seen=torch.zeros_like(e.seen)) for e in examples] if blind else examples
    rng, takes = stream(seed, "bring by sight"), [bool(e.facts[e.right, VERBS.index("take")].any()) for e in seen]
    rare = (len(takes) / max(sum(takes), 1) - 1) / 2  # in play, what is meant is seldom in sight
    with seeded(seed):
        network = Chooser(torch.cat([e.seen[e.facts[:, VERBS.index("take")] > 0] for e in seen]))
        optimizer = torch.optim.AdamW(network.parameters(), 1e-3, weight_decay=1e-2)
        for _ in range(passes):
            order = rng.permutation(len(seen))
            for k in range(0, len(order), 16):
                optimizer.zero_grad()
                for i in order[k : k + 16]:
                    likely = torch.log_softmax(network(seen[i]), 0)
                    (-torch.logsumexp(likely[seen[i].right], 0) * (rare if takes[i] else 1.0) / 16).backward()
                optimizer.step()
    return network


def judged(network: Chooser, examples: list[Example], blind: bool) -> tuple[list[float], list[float]]:
    """Of moments at which one of several things in sight is meant, whether it scores best; of all, whether a choice is
    right."""
    things, choices = list[float](), list[float]()
    for e in examples:
        shown = dataclasses.replace(e, seen=torch.zeros_like(e.seen)) if blind else e
        with torch.no_grad():
            scores = network.eval()(shown)
        left, take = chosen(scores, e), e.facts[:, VERBS.index("take")] > 0
        choices.append(float(e.right[left].float().mean()))
        if take.sum() > 1 and e.right[take].any():
            things.append(float(e.right[take][scores[take].argmax()]))
    return things, choices


def opened(house: int, encoder: Encoder, pictures: str) -> tuple[BringEnv, Eye]:
    worlds, _ = chosen_worlds(seed=house, pictures=pictures)
    env = BringEnv(worlds, RobotSettings(task="bring", observations=()))
    return env, Eye(env, encoder)


def taught(house: int, encoder: Encoder, pictures: str, episodes: int, seed: int) -> list[Example]:
    """Moments of a teacher's episodes in a house, and of PLACES of it."""
    env, eye = opened(house, encoder, pictures)
    rng = stream(seed, "taught", house)
    teacher, skills = Teacher(eye, rng), Skills(env)
    for k in range(episodes):
        print("train", house, k, episode(skills, teacher, 1000 * house + k)["success"], flush=True)
    skills.reset(1000 * house)
    for cell in rng.choice(len(env.ground.xy), PLACES):
        env.body.stand(env.ground.xy[cell], 0.0)
        teacher.choices(skills.look("you begin"), Search())
    env.close()
    return teacher.examples


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--train", type=int, nargs=2, default=(700, 710), metavar="SEED")
    parser.add_argument("--judge", type=int, nargs=2, default=(500, 510), metavar="SEED")
    parser.add_argument("--episodes", type=int, default=3)
    parser.add_argument("--passes", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pictures", default="fast-matte")
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    torch.set_num_threads(1)
    encoder, examples, rows = load_encoder(SHIPPED_ENCODER), list[Example](), list[dict[str, Any]]()
    for house in range(*args.train):
        examples += taught(house, encoder, args.pictures, args.episodes, args.seed)
    sighted, blind = (train(examples, x, args.passes, args.seed) for x in (False, True))
    print(len(examples), "moments", flush=True)
    for house in range(*args.judge):
        moments = taught(house, encoder, args.pictures, 1, args.seed)
        for name, network in (("sees", sighted), ("blind twin", blind)):
            things, choices = judged(network, moments, name == "blind twin")
            print(f"{house} {name:12} things {np.mean(things):.3f} choices {np.mean(choices):.3f}", flush=True)
        env, eye = opened(house, encoder, args.pictures)
        players = {"reads names": Searcher(*QUESTIONS), "sees": Sighted(sighted, eye, False)}
        players["blind twin"] = Sighted(blind, eye, True)
        for k in range(args.episodes):
            for name, player in players.items():
                rows.append({"player": name, "house": house, **episode(Skills(env), player, 1000 * house + k)})
                print(json.dumps(rows[-1]), flush=True)
        env.close()
        if args.out:
            args.out.write_text(json.dumps(rows))
    for name in ("reads names", "sees", "blind twin"):
        won = [r["success"] for r in rows if r["player"] == name]
        print(f"{name:12} n {len(won)} success {np.mean(won):.3f} ± {1.96 * np.std(won, ddof=1) / len(won) ** 0.5:.3f}")
