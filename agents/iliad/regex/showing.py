"""One episode of REGEX in words: what was asked, what the student did, what was said of it, what it learned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from embodied.agents.iliad.showing import learned_from
from embodied.agents.iliad.showing import lines_of as learned_lines
from embodied.seeds import stream

if TYPE_CHECKING:
    from embodied.agents.iliad.protocol import DescribingTeacher
    from embodied.agents.iliad.regex.data import WordTask
    from embodied.agents.iliad.regex.world import RegexStudent


@dataclass(frozen=True)
class Told:
    """An episode, and how it changes a student."""

    request: str
    words: tuple[str, ...]
    wanted: tuple[str, ...]
    rule: str
    """What the student wrote."""
    outputs: tuple[str, ...] | None
    """What it makes of the words; None where it cannot be carried out."""
    success: bool
    description: str | None
    """What the teacher said of it."""
    before: float | None
    after: float | None
    """Probability of the rule, given the description, before and after learning from this episode alone."""


def tell(student: RegexStudent, teacher: DescribingTeacher, item: WordTask, *, seed: int, sample: bool = True) -> Told:
    """Play one episode with an item; the student itself stays as it is.

    Args:
      sample: as in training; False writes the likeliest rule.
    """
    rng = stream(seed, "regex", "shown", item.rule, item.words[0])
    request = item.requests[0]
    (done,) = student.sample([item], [request], rng=rng) if sample else student.greedy([item], [request])
    (said,) = teacher.describe([item], [done], rng=rng)
    before, after = learned_from(student, item, said, done)
    success = done.outputs is not None and done.outputs[0] == item.outputs[0]
    return Told(request, item.words, item.outputs, done.rule, done.outputs, success, said, before, after)


def lines_of(told: Told) -> list[str]:
    """The episode for people to read."""
    width = max(map(len, told.words)) + 2
    found = [f"request       {told.request}", f"student       {told.rule}"]
    outputs: Sequence[str] = told.outputs or ("(no rule)",) * len(told.words)
    widest = max(map(len, outputs)) + 2
    for k, (word, out, wanted) in enumerate(zip(told.words, outputs, told.wanted, strict=True)):
        mark = "right" if out == wanted else f"wanted {wanted}"
        found.append(f"{'word' if k == 0 else '':<14}{word:<{width}}-> {out:<{widest}}{mark}")
    found.append(f"fulfilled     {'yes' if told.success else 'no'}")
    return [*found, *learned_lines(told.description, told.before, told.after)]
