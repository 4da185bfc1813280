"""A learned asker: a small network that imitates the oracle by what each answer would have saved.

Imitation is by DAgger with costs (Ross & Bagnell 2014): the learner plays, the oracle says of some decisions what each
choice would be worth, and the network's choices should be worth as much as the best ones. What the oracle knows and the
agent does not, such as where things are, averages out over houses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from embodied.agents.ask.config import AskerConfig
from embodied.agents.ask.foresight import CHOICES, Choice, Foresight, carried_out, possible, thinks
from embodied.agents.common.weights import load_weights, seeded
from embodied.envs.base import HelpEnv
from embodied.evaluation.evaluate import play
from embodied.interface import Action, Detection, Intention, Observation, Situation, Task
from embodied.policies.ask import LIKELY, REACH, EpisodeMemory, reached
from embodied.policies.baselines import PerEpisodePolicy

QUESTIONS = tuple(c for c in CHOICES if isinstance(c, Intention))
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
    asked = [min(trail.asked.get(q, 0), 3) / 3 for q in QUESTIONS]
    can = [float(q in o.can_ask) for q in QUESTIONS]
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
