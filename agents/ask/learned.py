"""A learned asker: a small network that imitates the oracle's decisions from what the agent itself knows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import nn

from agents.ask.foresight import CHOICES, thinks
from embodied.interface import Action, Actions, Ask, Intention, Observation, Observations, Situations, Stop
from embodied.policies.ask import Mind, onward, reached

HIDDEN, EPOCHS, RATE, DECAY = 32, 300, 1e-2, 1e-3
QUESTIONS = tuple(c for c in CHOICES if isinstance(c, Intention))


def facts(o: Observation, trail: Mind) -> np.ndarray:
    """(22,) float32: time, what is seen, what was reached, what was asked. Nothing of it names a place."""
    scores = [d.score for d in o.detections][:3]
    scores += [0.0] * (3 - len(scores))
    thing = reached(o)
    asked = [min(trail.asked.get(q, 0), 3) / 3 for q in QUESTIONS]
    can = [float(q in o.can_ask) for q in QUESTIONS]
    seen = [len(o.detections) / 8, sum(d.score > 0.5 for d in o.detections) / 4]
    here = [float(thing is not None), thing.score if thing else 0.0, thing.distance / 2 if thing else 0.0]
    plain = [o.time / 60, len(trail.visits) / 40, len(o.instruction.split()) / 10, float(" in the " in o.instruction)]
    return np.array([*plain, *seen, *scores, *here, *asked, *can], dtype=np.float32)


def train(inputs: np.ndarray, labels: np.ndarray, *, seed: int) -> nn.Module:
    """A network that predicts the oracle's choice; rare choices count as much as common ones do by the root.

    Args:
      inputs: (n, d) float32; `labels` (n,) indices into CHOICES.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        net = nn.Sequential(nn.Linear(inputs.shape[1], HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, len(CHOICES)))
        optimizer = torch.optim.AdamW(net.parameters(), lr=RATE, weight_decay=DECAY)
        counts = np.bincount(labels, minlength=len(CHOICES))
        weight = torch.tensor(1.0 / np.sqrt(np.maximum(counts, 1)), dtype=torch.float32)
        x, y = torch.from_numpy(inputs), torch.from_numpy(labels)
        for _ in range(EPOCHS):
            optimizer.zero_grad()
            nn.functional.cross_entropy(net(x), y, weight=weight).backward()
            optimizer.step()
    return net.eval()


class LearnedAsker:
    """Explores as the baselines do and decides by the network."""

    def __init__(self, net: nn.Module, reserve: float = 0.0) -> None:
        """`reserve`: taken off the logits of questions; more of it asks less."""
        self._net, self._reserve = net, reserve

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[Actions, Any]:
        trails = memory or [Mind() for _ in observations]
        actions: Actions = [None] * len(observations)
        for i, (o, s) in enumerate(zip(observations, situations, strict=True)):
            if o is None or s is None:
                continue
            action = self._decided(o, trails[i])
            if action is None:
                trails[i].visits[s.pose.node] = trails[i].visits.get(s.pose.node, 0) + 1
                action = onward(o, s, trails[i], rngs[i])
            actions[i] = action
        return actions, trails

    def _decided(self, o: Observation, trail: Mind) -> Action | None:
        if not thinks(o, trail):
            return None
        with torch.no_grad():
            logits = self._net(torch.from_numpy(facts(o, trail))[None])[0].numpy().copy()
        for k, choice in enumerate(CHOICES):
            if isinstance(choice, Intention):
                logits[k] = logits[k] - self._reserve if choice in o.can_ask else -np.inf
        if reached(o) is None:
            logits[CHOICES.index("stop")] = -np.inf
        choice = CHOICES[int(np.argmax(logits))]
        if isinstance(choice, Intention):
            trail.asked[choice] = trail.asked.get(choice, 0) + 1
            return Ask(choice)
        return Stop() if choice == "stop" else None
