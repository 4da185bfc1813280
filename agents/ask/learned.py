"""The oracle of asking, and a learned asker: a small network that imitates it by what each answer would have saved.

The oracle plays every question to the end in its head, and asks what pays most. It is privileged: it knows where
everything is, and its own luck. It does not know the way: between questions it explores like the baselines. One that
doubts does not know which thing is meant and weighs all that fit what was said: what it does can be imitated.

Imitation is by DAgger with costs (Ross & Bagnell 2014): the learner plays, the oracle says of some decisions what each
choice would be worth, and the network's choices should be worth as much as the best ones. What the oracle knows and the
agent does not, such as where things are, averages out over houses.
"""

import copy
import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from embodied.agents.common.weights import load_weights, seeded
from embodied.agents.learners.ask import AskerConfig
from embodied.assistants.ask import CONFIRM_DISTANCE, QUESTIONS, in_view
from embodied.envs.ask import AskEnv
from embodied.envs.base import HelpEnv
from embodied.evaluation.evaluate import play
from embodied.interface import (
    Action,
    Actions,
    Detection,
    FindDescribed,
    Intention,
    Observation,
    Observations,
    Rngs,
    Situation,
    Situations,
    Stop,
    Task,
)
from embodied.kinds.metrics import success
from embodied.kinds.shipped.ask import price
from embodied.policies.ask import LIKELY, REACH, Asker, EpisodeMemory, confirm_on_sight, onward, reached
from embodied.policies.baselines import PerEpisodePolicy

EVERY = 4
"""Steps between two moments at which it thinks about asking; it also does whenever a thing was reached."""
LABELLED = 0.5
"""Of a learner's decisions, how many the oracle thinks about."""
IMAGINED = 3
"""Things that one who doubts weighs at a time."""
SLOW = 0.0003
"""The worth of a step: of two ways that succeed alike, the shorter one."""
Choice = Intention | str
"""A question, 'go' or 'stop'."""
TYPED = tuple(q for q in QUESTIONS if q is not Intention.FREE)
CHOICES: tuple[Choice, ...] = ("go", "stop", *TYPED)
ONCE = (Intention.APPEARANCE, Intention.REGION)
"""Questions whose answers stay the same."""
HERE = (Intention.CONFIRM, Intention.DISAMBIGUATE)
"""Questions whose answers stay the same where one stands."""


def possible(o: Observation, trail: EpisodeMemory) -> list[Choice]:
    """The choices that can be made; no question twice whose answer is known."""
    known = [q for q in ONCE if trail.asked.get(q)] + [q for q in HERE if trail.asked_at.get(q) == trail.moment]
    questions = [q for q in TYPED if q in o.can_ask and q not in known]
    return ["go", *(["stop"] if reached(o) else []), *questions]


def thinks(o: Observation, trail: EpisodeMemory) -> bool:
    """True if this is a moment to decide; between them, and on a route, one goes on."""
    return o.extras.advised is None and (reached(o) is not None or o.time % EVERY == 0)


class Foresight:
    """Asks what pays most in the end, if afterwards one only confirms on sight."""

    def __init__(
        self,
        make_env: Callable[[], HelpEnv],
        note: Callable[[Observation, EpisodeMemory, np.ndarray], None] | None = None,
        doubts: bool = False,
        learner: Callable[[Observation, EpisodeMemory], Choice] | None = None,
    ) -> None:
        """
        Args:
          make_env: of the same houses and rules, to play in the head.
          note: is told at a decision what each of CHOICES is worth, (7,) float64, NaN for those that cannot be.
          doubts: whether which thing is meant is not known.
          learner: who decides instead, while the oracle says of some decisions what they are worth (DAgger).
        """
        self._make_env, self._note, self._doubts, self._learner = make_env, note, doubts, learner

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Rngs
    ) -> tuple[Actions, Any]:
        if memory is None:
            memory = []
            for s in situations:
                assert s is not None, "episodes of a batch begin together"
                env = self._make_env()
                env.reset(s.task)
                memory.append((env, EpisodeMemory()))
        actions: Actions = [None] * len(observations)
        for i, (o, s) in enumerate(zip(observations, situations, strict=True)):
            if o is not None and s is not None:
                env, trail = memory[i]
                actions[i] = self._one(env, o, trail, rngs[i])
                env.step(actions[i])
        return actions, memory

    def _one(self, env: HelpEnv, o: Observation, trail: EpisodeMemory, rng: np.random.Generator) -> Action:
        choice = CHOICES[0]
        if thinks(o, trail) and self._learner and copy.deepcopy(rng).random() > LABELLED:
            choice = self._learner(o, trail)
        elif thinks(o, trail):
            minds = imagined(env, rng) if self._doubts else [env]
            values = np.full(len(CHOICES), np.nan)
            for c in possible(o, trail):
                values[CHOICES.index(c)] = np.mean([self._value(e, o, trail, c, rng) for e in minds])
            if self._note:
                self._note(o, trail, values)
            choice = self._learner(o, trail) if self._learner else CHOICES[int(np.nanargmax(values))]
        return carried_out(choice, env.situation, o, trail, rng)

    def _value(
        self, env: HelpEnv, o: Observation, trail: EpisodeMemory, choice: Choice, rng: np.random.Generator
    ) -> float:
        """Success less price in the end, after this choice, with the draws that will come."""
        ahead, mind, rng = _copy(env), copy.deepcopy(trail), copy.deepcopy(rng)
        seen = ahead.step(carried_out(choice, ahead.situation, o, mind, rng))
        asker = Asker(confirm_on_sight)
        while seen is not None:
            seen = ahead.step(asker.act_one(seen, ahead.situation, mind, rng))
        episode = ahead.episode()
        graph = env.world.graph
        return success(episode, graph) - price(episode, graph) - SLOW * len(episode.steps)


def imagined(env: HelpEnv, rng: np.random.Generator) -> list[HelpEnv]:
    """The same moment in tasks in which other things that fit what was said are meant; at most IMAGINED of them."""
    task, world = env.task, env.world
    assert isinstance(task.goal, FindDescribed), "Ask-v0"
    possible = sorted(env.situation.extras.possible)
    chosen = copy.deepcopy(rng).permutation(len(possible))[:IMAGINED]
    minds = []
    for placement in (possible[i] for i in sorted(chosen)):
        near = ((node, in_view(world, node, task.goal)[:1]) for node in range(len(world.graph.positions)))
        nodes = tuple(v for v, seen in near if seen and seen[0][0] == placement and seen[0][2] <= CONFIRM_DISTANCE)
        if not nodes:
            continue
        other = _copy(env)
        goal = dataclasses.replace(task.goal, placement=placement)
        other.task = dataclasses.replace(task, goal=goal, goal_nodes=nodes)
        other.targets = nodes
        other.situation = dataclasses.replace(env.situation, task=other.task, targets=nodes)
        minds.append(other)
    return minds or [env]


def carried_out(choice: Choice, s: Situation, o: Observation, trail: EpisodeMemory, rng: np.random.Generator) -> Action:
    """The action of a choice; notes it in the trail."""
    if choice == "stop":
        return Stop()
    if isinstance(choice, Intention):
        return trail.ask(choice, reached(o))
    return onward(o, s, trail, rng)


def _copy(env: HelpEnv) -> HelpEnv:
    """The environment as it is; what happens in the copy stays there."""
    other = copy.copy(env)
    other._steps, other._trail = list(env._steps), list(env._trail)
    if isinstance(other, AskEnv) and isinstance(env, AskEnv):
        other._denied = set(env._denied)
    return other


SEEN = 3
"""Detections that are told one by one, the best first."""
ASKER_BATCH = 512
ENTROPY = 0.003
"""Weight of the entropy, which keeps choices of equal worth alike."""
LEAST = 1e-9
"""Probabilities below it count as it in the entropy."""
Decisions = tuple[np.ndarray, np.ndarray]
"""(n, d) float32 what was known; (n, 7) float64 what each of CHOICES was worth, NaN where it could not be."""
ASKER_REMEDY = "train it again: embodied study ask"


def facts(o: Observation, trail: EpisodeMemory) -> np.ndarray:
    """(37,) float32: time, the way so far, what is seen and reached, and what was asked. Nothing names a place."""
    seen, thing = o.extras.detections, reached(o)
    far = [d for d in seen if d.distance > REACH]
    visits, score = list(trail.visits.values()), thing.score if thing else 0.0
    confirmed = thing is not None and trail.asked_at.get(Intention.CONFIRM) == trail.moment
    plain = [o.time / 60, (o.time / 60) ** 2, len(visits) / 40, sum(visits) / max(len(visits), 1) - 1]
    words = [0.0 if trail.asked else len(o.instruction.split()) / 10, float(" in the " in o.instruction)]
    likely = [sum(d.score > LIKELY for d in some) / 4 for some in (seen, far)]
    view = [len(seen) / 8, *likely, max((d.score for d in far), default=0.0)]
    best: list[Detection | None] = [*seen[:SEEN], *[None] * (SEEN - len(seen))]
    each = [x for d in best for x in ((d.score, d.distance / 6) if d else (0.0, 0.0))]
    here = [float(thing is not None), score, thing.distance / REACH if thing else 0.0, float(score > LIKELY)]
    # after a yes the score stays, after a no it falls
    answer = [float(confirmed), trail.before - score if confirmed else 0.0, float(confirmed and score >= trail.before)]
    margin = [max(0.0, score - LIKELY), max(0.0, score - LIKELY - 0.2), float(score > LIKELY + 0.2)]
    asked = [min(trail.asked.get(q, 0), 3) / 3 for q in TYPED]
    can = [float(q in o.can_ask) for q in TYPED]
    return np.array([*plain, *words, *view, *each, *here, *answer, *margin, *asked, *can], dtype=np.float32)


def network(width: int) -> nn.Sequential:
    """Numbers for CHOICES from `facts`."""
    return nn.Sequential(
        nn.LazyLinear(width), nn.Tanh(), nn.Linear(width, width), nn.Tanh(), nn.Linear(width, len(CHOICES))
    )


def fit(decisions: Decisions, config: AskerConfig) -> nn.Sequential:
    """A network whose choices lose least of what the best ones were worth."""
    x, worth = torch.from_numpy(decisions[0]), torch.from_numpy(decisions[1].astype(np.float32))
    can = ~torch.isnan(worth)
    worth = torch.where(can, worth, -torch.inf)
    lost = torch.where(can, worth.max(1, keepdim=True).values - worth, 0.0)
    with seeded(config.seed):
        net = network(config.hidden_size)
        net(x[:1])
        optimizer = torch.optim.AdamW(net.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
        for _ in range(config.passes):
            for chosen in torch.randperm(len(x)).split(ASKER_BATCH):
                p = torch.softmax(torch.where(can[chosen], net(x[chosen]), -1e9), 1)
                entropy = -(p * p.clamp_min(LEAST).log()).sum(1).mean()
                loss = (p * lost[chosen]).sum(1).mean() - ENTROPY * entropy
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
    return net.eval()


class LearnedAsker(PerEpisodePolicy):
    """Explores as the baselines do and decides by the network."""

    def __init__(self, net: nn.Module) -> None:
        self._net = net

    @torch.inference_mode()
    def choose(self, o: Observation, trail: EpisodeMemory) -> Choice:
        """One of CHOICES that is possible."""
        logits = self._net(torch.from_numpy(facts(o, trail))[None])[0].numpy()
        worth = {c: float(logits[CHOICES.index(c)]) for c in possible(o, trail)}
        return max(worth, key=lambda c: worth[c])

    def new_memory(self) -> Any:
        return EpisodeMemory()

    def act_one(self, o: Observation, s: Situation, memory: Any, rng: np.random.Generator) -> Action:
        choice = self.choose(o, memory) if thinks(o, memory) else "go"
        return carried_out(choice, s, o, memory, rng)


def shown(
    make_env: Callable[[], HelpEnv], tasks: Sequence[Task], learner: LearnedAsker | None = None, *, seed: int
) -> Decisions:
    """The decisions of some episodes, played by the oracle that does not know which thing is meant, or by a learner."""
    known: list[np.ndarray] = []
    worth: list[np.ndarray] = []

    def note(o: Observation, trail: EpisodeMemory, values: np.ndarray) -> None:
        known.append(facts(o, trail))
        worth.append(values)

    player = Foresight(make_env, note, doubts=True, learner=learner.choose if learner else None)
    play(make_env, player, tasks, seed=seed)
    return np.stack(known), np.stack(worth)


def train(
    make_env: Callable[[], HelpEnv],
    first: Decisions,
    rounds: Sequence[Sequence[Task]],
    config: AskerConfig,
    note: Callable[[str], None] = print,
) -> nn.Sequential:
    """Imitate the oracle in decisions of its own, then in those of the learner while it plays the rounds."""
    recorded = [first]
    net = fit(first, config)
    for number, tasks in enumerate(rounds):
        recorded.append(shown(make_env, tasks, LearnedAsker(net), seed=config.seed))
        net = fit((np.concatenate([x for x, _ in recorded]), np.concatenate([v for _, v in recorded])), config)
        note(f"round {number + 1} of {len(rounds)}: {sum(len(x) for x, _ in recorded)} decisions")
    return net


def load_asker(path: Path) -> nn.Sequential:
    """
    Raises:
      FileNotFoundError, ValueError: missing, damaged, or something else.
    """
    tensors, config = load_weights(path, "asker", AskerConfig, ASKER_REMEDY)
    net = network(config.hidden_size)
    net.load_state_dict(tensors)
    return net.eval()
