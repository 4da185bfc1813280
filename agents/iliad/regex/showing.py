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
    """The rule that the student wrote."""
    outputs: tuple[str, ...] | None
    """Its results on the words; None where it cannot be carried out."""
    success: bool
    description: str | None
    """The teacher's description of it."""
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
    (description,) = teacher.describe([item], [done], rng=rng)
    before, after = learned_from(student, item, description, done)
    success = done.outputs is not None and done.outputs[0] == item.outputs[0]
    return Told(request, item.words, item.outputs, done.rule, done.outputs, success, description, before, after)


def lines_of(shown: Told) -> list[str]:
    """The episode for people to read."""
    width = max(map(len, shown.words)) + 2
    lines = [f"request       {shown.request}", f"student       {shown.rule}"]
    outputs: Sequence[str] = shown.outputs or ("(no rule)",) * len(shown.words)
    widest = max(map(len, outputs)) + 2
    for k, (word, out, wanted) in enumerate(zip(shown.words, outputs, shown.wanted, strict=True)):
        mark = "right" if out == wanted else f"wanted {wanted}"
        lines.append(f"{'word' if k == 0 else '':<14}{word:<{width}}-> {out:<{widest}}{mark}")
    lines.append(f"fulfilled     {'yes' if shown.success else 'no'}")
    return [*lines, *learned_lines(shown.description, shown.before, shown.after)]
