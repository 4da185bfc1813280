"""The words that rules are carried out on, made up by the seed."""

from __future__ import annotations

import numpy as np

from embodied.seeds import stream

_PARTS = {
    "start": "- - - - - a e i o u re un in de dis ex en over out",
    "onset": "b c d f g h j k l m n p r s t v w y z bl br ch cl cr dr fl fr gl gr pl pr qu sc sh sk sl sm sn sp st sw "
    "th tr tw wh",
    "nucleus": "a e i o u a e i o e i a ea ee ai ou oo ie au io",
    "coda": "- - - - b d g k l m n p r s t x ck ct ft ld ll mp nd ng nk nt pt rd rk rm rn rt sh sk ss st th",
    "ending": "- - - s ed er ing ly ness ment able al ous ive ion ist ful less ic y en",
}
PARTS = {name: text.split() for name, text in _PARTS.items()}
"""Parts of made-up words; '-' is none."""
SHORTEST, LONGEST_MADE_UP = 3, 10
"""Letters of a word."""


def made_up(count: int, *, seed: int) -> tuple[str, ...]:
    """So many different words that could be English ones; the same on every machine.

    The dissertation's words are the dictionary of an operating system, which differs from one to the
    next and is often missing (docs/sources.md, S90).
    """
    rng = stream(seed, "regex", "words")
    words: dict[str, None] = {}
    while len(words) < count:
        word = _word(rng=rng)
        if SHORTEST <= len(word) <= LONGEST_MADE_UP:
            words[word] = None
    return tuple(words)


def _word(*, rng: np.random.Generator) -> str:
    pick = lambda name: PARTS[name][int(rng.integers(len(PARTS[name])))]
    middle = "".join(pick("onset") + pick("nucleus") + pick("coda") for _ in range(int(rng.integers(1, 3))))
    return (pick("start") + middle + pick("ending")).replace("-", "")
