"""Baselines of 'bring' that read what a robot sees and what it can do: who looks for a thing, asks or not, or is blind;
and one that does anything."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from embodied.interface import Action, Actions, Ask, Intention, Move, Observation, Observations, Rngs

TRIES = 2
"""Times that a thing is reached for."""


IN_ROOM = re.compile(r"(?:It is|I am) in (?:the|one of the) ([^.]*)\.")
INSIDE = re.compile(r"It is inside the ([^.]*)\.")


@dataclass
class _Search:
    """Memory of what was chosen and how often, of what is not meant, and of replies while nothing, or this, is held."""

    done: Counter[tuple[str, str]] = field(default_factory=Counter)
    denied: set[str] = field(default_factory=set)
    told: Counter[str] = field(default_factory=Counter)
    held: str = ""


class BringSearcher:
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
        memory = memory or [_Search() for _ in observations]
        return [None if o is None else self._act(o, m, r) for o, m, r in zip(observations, memory, rngs)], memory

    def _act(self, o: Observation, m: _Search, rng: np.random.Generator) -> Action:
        words, seen, holds = o.candidates.words, o.extras.sees, o.extras.holds
        request, _, told = o.instruction.partition(" . ")
        if told.startswith("No,"):
            m.denied.add(m.held)
        elif holds == m.held:
            m.told[told] += 1
        else:
            m.told = Counter()
        m.held = holds
        for question in self._questions:
            wanted = question is Intention.REGION or (question is Intention.CONFIRM) == bool(holds)
            if wanted and question in o.can_ask and not m.done[question.value, holds]:
                m.done[question.value, holds] += 1
                return Ask(question)
        whole = " ".join(m.told)
        rooms, inside = IN_ROOM.findall(whole), INSIDE.findall(whole)
        noun, of = request.removeprefix("bring me the "), [f" of the {x}," for x in inside]
        fits = lambda name: not self._sees or seen.get(name, "").startswith(f"{noun},")
        places = [w for w in words if w.startswith("go ")]
        named = [w for w in places if re.sub(r"_\d+$", "", w[3:]).replace("_", " ") in rooms]
        opens = [w for w in words if w.startswith("open ")]
        told_opens = [w for w in opens if any(x in seen[w[5:]] for x in of)]
        here = f"go {o.extras.room}" in named and m.done[f"go {o.extras.room}", holds] > TRIES
        for choices in (
            ["leave"] * (holds in m.denied),
            [w for w in words if w == "give"],
            [w for w in words if w.startswith("take ") and fits(w[5:]) and w[5:] not in m.denied],
            told_opens,
            opens * here,
        ):
            if left := [w for w in choices if m.done[w, holds] < TRIES]:
                break
        else:
            left = [w for w in named if m.done[w, holds] < 2 * TRIES] or places
            least = min(m.done[w, holds] for w in left)
            left = [w for w in left if m.done[w, holds] == least]
        word = left[int(rng.integers(len(left)))]
        m.done[word, holds] += 1
        return Move(words.index(word))


class AnyWord:
    """Chooses one of the verbs that there are, then one of its things; it never asks."""

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        return [None if o is None else self._act(o, rng) for o, rng in zip(observations, rngs)], None

    def _act(self, o: Observation, rng: np.random.Generator) -> Action:
        verbs = sorted({w.split()[0] for w in o.candidates.words})
        verb = verbs[int(rng.integers(len(verbs)))]
        choices = [k for k, w in enumerate(o.candidates.words) if w.split()[0] == verb]
        return Move(choices[int(rng.integers(len(choices)))])
