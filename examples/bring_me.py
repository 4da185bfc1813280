"""Bring me the blue mug: a robot looks for a thing, may ask, opens what is closed, and brings it to the person.

python examples/bring_me.py                                      # who plays how well, in three flats
python examples/bring_me.py --houses 50 --episodes 1 --out bring.json
python examples/bring_me.py --model qwen3 --base-url http://localhost:8000/v1
python examples/bring_me.py --players expert --pictures fast-matte --lerobot brought
"""

from __future__ import annotations

import argparse
import json
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from skills import Skills

from embodied.agents.language_models.agent import LanguageModelAgent
from embodied.agents.language_models.client import AnswerCache, Client, ServerSettings
from embodied.datasets.lerobot import STEP_COLUMNS, Writer, whole_folder
from embodied.gym.bring import BringEnv
from embodied.gym.drive import chosen_worlds
from embodied.gym.robot import CONTROL, OPENED, RobotSettings
from embodied.interface import Action, Actions, Ask, Intention, Move, Observation, Observations, Policy, Rngs, Stop
from embodied.seeds import stream

TRIES = 2
"""Times that the same is tried."""
IN_ROOM = re.compile(r"(?:It is|I am) in (?:the|one of the) ([^.]*)\.")
INSIDE = re.compile(r"It is inside the ([^.]*)\.")


@dataclass
class Search:
    """Memory of what was chosen and how often, of what is not meant, and of replies while nothing, or this, is held."""

    done: Counter[tuple[str, str]] = field(default_factory=Counter)
    denied: set[str] = field(default_factory=set)
    told: set[str] = field(default_factory=set)
    held: str = ""
    confirming: bool = False

    def notice(self, o: Observation) -> None:
        """Take in what was said since."""
        reply = o.instruction.partition(" . ")[2]
        if self.confirming and reply.startswith("No,"):
            self.denied.add(self.held)
        self.told = {*self.told, reply} if o.extras.holds == self.held else set()
        self.held, self.confirming = o.extras.holds, False

    def choose(self, o: Observation, word: str) -> Action:
        """The action of a word, or of 'ask QUESTION'."""
        self.done[word, self.held] += 1
        verb, _, what = word.partition(" ")
        self.confirming = word == f"ask {Intention.CONFIRM.value}"
        return Ask(Intention(what)) if verb == "ask" else Move(o.candidates.words.index(word))


class Searcher:
    """Goes through the rooms until something that the request fits is in sight, takes it, and looks for the person; in
    a room that was named it opens what is closed."""

    def __init__(self, *questions: Intention, sees: bool = True) -> None:
        """
        Args:
          questions: asked as soon as they can be, once for the thing and once for the person.
          sees: without, that something is there, not what.
        """
        self._questions, self._sees = questions, sees

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        memory = memory or [Search() for _ in observations]
        return [None if o is None else self._act(o, m, r) for o, m, r in zip(observations, memory, rngs)], memory

    def _act(self, o: Observation, m: Search, rng: np.random.Generator) -> Action:
        m.notice(o)
        left = self.choices(o, m)
        return m.choose(o, left[int(rng.integers(len(left)))])

    def choices(self, o: Observation, m: Search) -> list[str]:
        """Words that are equally good now."""
        for question in self._questions:
            wanted, word = (
                question is Intention.REGION or (question is Intention.CONFIRM) == bool(m.held),
                question.value,
            )
            if wanted and question in o.can_ask and not m.done[f"ask {word}", m.held]:
                return [f"ask {word}"]
        return self._words(o, m, o.instruction.partition(" . ")[0].removeprefix("bring me the "))

    def _words(self, o: Observation, m: Search, noun: str) -> list[str]:
        words, seen, holds, told = o.candidates.words, o.extras.sees, o.extras.holds, " ".join(sorted(m.told))
        rooms, furniture = IN_ROOM.findall(told), [f" of the {x}," for x in INSIDE.findall(told)]
        fits = lambda name: not self._sees or seen[name].startswith(f"{noun},")
        places = [w for w in words if w.startswith("go ")]
        named = [w for w in places if re.sub(r"_\d+$", "", w[3:]).replace("_", " ") in rooms]
        opens = [w for w in words if w.startswith("open ")]
        here = f"go {o.extras.room}"
        for choices in (
            ["leave"] * (holds in m.denied),
            [w for w in words if w == "give"],
            [w for w in words if w.startswith("take ") and fits(w[5:]) and w[5:] not in m.denied],
            [w for w in opens if any(x in seen[w[5:]] for x in furniture)],
            opens * (here in named and m.done[here, holds] > TRIES),
        ):
            if left := [w for w in choices if m.done[w, holds] < TRIES]:
                break
        else:
            left = [w for w in named if m.done[w, holds] < 2 * TRIES] or places
            least = min(m.done[w, holds] for w in left)
            left = [w for w in left if m.done[w, holds] == least]
        return left


class AnyWord:
    """Chooses one of the verbs that there are, then one of its things; it never asks."""

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        return [None if o is None else self._act(o, rng) for o, rng in zip(observations, rngs)], None

    def _act(self, o: Observation, rng: np.random.Generator) -> Action:
        verbs = sorted({w.split()[0] for w in o.candidates.words})
        verb = verbs[int(rng.integers(len(verbs)))]
        choices = [k for k, w in enumerate(o.candidates.words) if w.split()[0] == verb]
        return Move(choices[int(rng.integers(len(choices)))])


EVERY = (Intention.REGION, Intention.APPEARANCE, Intention.ROUTE, Intention.CONFIRM)
PLAYERS: dict[str, Policy | None] = {
    "expert": None,
    "never asks": Searcher(),
    "asks for the room": Searcher(Intention.REGION),
    "asks for room and looks": Searcher(Intention.REGION, Intention.APPEARANCE),
    "always asks": Searcher(*EVERY),
    "blind, never asks": Searcher(sees=False),
    "blind, always asks": Searcher(*EVERY, sees=False),
    "random": AnyWord(),
}
"""None is who knows where everything is."""


def episode(skills: Skills, agent: Policy | None, seed: int) -> dict[str, Any]:
    """Facts of an episode."""
    o, memory = skills.reset(seed), None
    goal = skills.env.goal
    while agent is None and not skills.over:
        if goal.part and skills.env.openness[goal.part] < OPENED:
            skills.do(f"open {goal.part}")
        skills.do("give" if skills.env.holds or skills.do(f"take {goal.thing}").startswith("you hold") else "leave")
    while agent is not None and o is not None:
        [action], memory = agent.act([o], memory, rngs=[stream(seed, "skills", skills.time)])
        o = skills.step(action or Stop())
    facts = {name: skills.info[name] for name in ("success", "spl", "metres", "seconds", "price")}
    asked = Counter(r.intention.value for r in skills.env.replies)
    return {**facts, "hidden": bool(goal.part), "asked": dict(asked), "fallen": len(skills.info["fallen"])}


def play(env: BringEnv, house: int, episodes: int, players: dict[str, Policy | None]) -> Iterator[dict[str, Any]]:
    """Facts of the episodes of each player."""
    for k in range(episodes):
        for name, agent in players.items():
            yield {"player": name, "house": house, "episode": k, **episode(Skills(env), agent, 1000 * house + k)}


def record(env: BringEnv, folder: Path, seeds: range, agent: Policy | None) -> int:
    """Write episodes as LeRobot data, with the request and the replies; returns how many steps they have."""
    vector = lambda names: (pa.list_(pa.float32(), len(names)), tuple(names))
    columns = {**STEP_COLUMNS, "observation.state": vector(env.body.feels), "action": vector(env.commands)}
    with whole_folder(folder) as draft:
        writer = Writer(draft, env.settings.size, columns, key="observation.images.head", fps=round(1 / CONTROL))
        for seed in seeds:
            steps: list[tuple[dict[str, Any], np.ndarray, str, int]] = []
            skills = Skills(env, lambda o, a: steps.append((o, a, env.heard, len(env.replies))))  # noqa: B023
            facts = episode(skills, agent, seed)
            seen, actions, words, said = zip(*steps)
            after = (*said[1:], len(env.replies))
            replies = [str(env.replies[b - 1].text) if b > a else "" for a, b in zip(said, after)]
            rows = {"observation.state": np.stack([o["proprio"] for o in seen])}
            rows["action"] = np.stack(actions).astype(np.float32)
            name = f"{env.world.name}_{seed}"
            about = {"embodied/task": name, "embodied/house": env.world.name, "embodied/agent": "expert"}
            frames = [o["head_rgb"] for o in seen]
            writer.add(rows, frames, [], words, replies, facts["success"] > 0, about)
        return writer.finish("embodied robot", "lerobot_drive")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=500)
    parser.add_argument("--houses", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--players", nargs="*", default=list(PLAYERS), choices=list(PLAYERS))
    parser.add_argument("--pictures", default="unlit")
    parser.add_argument("--model")
    parser.add_argument("--base-url", default="https://api.openai.com/v1")
    parser.add_argument("--answers", type=Path, default=Path("answers.sqlite"))
    parser.add_argument("--lerobot", type=Path, help="folder for episodes of the first player in the first house")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    players, rows = {name: PLAYERS[name] for name in options.players}, []
    if options.model:
        client = Client(ServerSettings(model=options.model, base_url=options.base_url), AnswerCache(options.answers))
        players = {options.model: LanguageModelAgent(client)}
    for house in range(options.seed, options.seed + options.houses):
        worlds, _ = chosen_worlds(seed=house, pictures=options.pictures)
        env = BringEnv(worlds, RobotSettings(task="bring", observations=("rgb",) if options.lerobot else ()))
        if options.lerobot:
            print(record(env, options.lerobot, range(options.episodes), next(iter(players.values()))), "steps")
            break
        for row in play(env, house, options.episodes, players):
            rows.append(row)
            print(json.dumps(row), flush=True)
        env.close()
        if options.out:
            options.out.write_text(json.dumps(rows))
    for name in players if rows else ():
        own = [r for r in rows if r["player"] == name]
        means = {f: float(np.mean([r[f] for r in own])) for f in ("success", "spl", "price", "seconds")}
        print(f"{name:28} n {len(own)} " + " ".join(f"{f} {x:.2f}" for f, x in means.items()))
