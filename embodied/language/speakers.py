"""People have habits of speech: who names landmarks, who counts metres, who chats, who hedges (speakers.toml).

Some people are kept from learning (embodied.novelty): who speaks formally, and templates and words that
`novel_templates` and the lexicon choose.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from embodied.assets.json_file import from_plain, read_toml
from embodied.novelty import FAMILIAR


@dataclass(frozen=True)
class Speaker:
    """Habits as probabilities."""

    share: float
    """Of all people."""
    habit: str
    """'terse', 'chatty', 'formal' or '': which templates, links and openings it likes."""
    landmarks: float = 0.8
    """Naming a thing to walk to or past where one can be seen."""
    metres: float = 0.2
    """Giving a distance where no thing is named."""
    colours: float = 0.3
    """Adding a colour or material that is not needed."""
    ornament: float = 0.08
    """Adding an adjective of size or praise."""
    remarks: float = 0.08
    """Mentioning something that one sees on the way."""
    avoids: float = 0.05
    """Saying where not to go."""
    counts: float = 0.3
    """Counting doors where there are several on one side."""
    joining: float = 0.4
    """Saying two clauses in one breath."""
    clauses: int = 4
    """About how many clauses it takes for a route; the next try of a misunderstood route takes one more."""
    clauses_per_sentence: int = 2
    openings: float = 0.1
    hedges: float = 0.03
    slips: float = 0.01
    """Per word that can be misspelt."""
    plainness: float = 0.7
    """Using the plainest noun for a room."""
    novelty: str | None = None
    """'familiar' or 'novel': which templates and words it knows; None: all."""


SPEAKERS = from_plain(tuple[Speaker, ...], read_toml(Path(__file__).with_name("speakers.toml"))["speakers"])
"""Everyday, terse, chatty, formal, landmark-minded, direction-minded."""
NOVEL_HABIT = "formal"
"""Who is never heard in learning where some people are kept from it; novel people are formal or without a habit."""


def draw_speaker(rng: np.random.Generator, novelty: str | None = None) -> Speaker:
    """One of the speakers of a novelty by their shares."""
    kept = lambda s: s.habit != NOVEL_HABIT if novelty == FAMILIAR else s.habit in ("", NOVEL_HABIT)
    known = [s for s in SPEAKERS if novelty is None or kept(s)]
    shares = np.array([s.share for s in known])
    speaker = known[int(rng.choice(len(known), p=shares / shares.sum()))]
    return dataclasses.replace(speaker, novelty=novelty)
