"""Instructions in words that no speaker of the corpus says: how well an agent reads what it never heard."""

from __future__ import annotations

import dataclasses
import functools
import re
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from agents.common.paraphrases import Wordings
from assets.json_file import from_plain, read_toml
from embodied.interface import Actions, Agent, Observations, Policy, PrivilegedPolicy, Situations

UNHEARD = from_plain(Wordings, read_toml(Path(__file__).with_name("unheard.toml")))


def in_synonyms(known: Collection[str]) -> Callable[[str], str]:
    """What replaces each common word of a text by the first of its like that is not in `known`."""
    new = {word: next((w for w in many if w not in known), word) for word, many in UNHEARD.synonyms.items()}
    return functools.cache(lambda text: re.sub("[a-z]+", lambda m: new.get(m[0], m[0]), text.lower()))


def reworded(agent: Agent, say: Callable[[str], str]) -> Agent:
    """An agent to which everything is said in other words."""
    return RewordedPrivileged(agent, say) if isinstance(agent, PrivilegedPolicy) else Reworded(agent, say)


@dataclass(frozen=True)
class Reworded:
    """A policy to which everything is said in other words."""

    policy: Policy
    say: Callable[[str], str]

    def act(
        self, observations: Observations, memory: Any, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[Actions, Any]:
        return self.policy.act(_said(observations, self.say), memory, rngs=rngs)


@dataclass(frozen=True)
class RewordedPrivileged:
    """As Reworded, of a policy that is shown the situations; tasks in them stay as they are."""

    policy: PrivilegedPolicy
    say: Callable[[str], str]

    def act_privileged(
        self, observations: Observations, situations: Situations, memory: Any, *, rngs: Sequence[np.random.Generator]
    ) -> tuple[Actions, Any]:
        return self.policy.act_privileged(_said(observations, self.say), situations, memory, rngs=rngs)


def _said(observations: Observations, say: Callable[[str], str]) -> Observations:
    return [o if o is None else dataclasses.replace(o, instruction=say(o.instruction)) for o in observations]
