"""Words of simulated speakers as people write them. Learners read the words themselves, never these."""

from __future__ import annotations

import re


def detokenized(text: str) -> str:
    """'go into the hall . turn left' becomes 'go into the hall. turn left': no blanks before punctuation."""
    return re.sub(r" +([.,;:?!]+)(?=\s|$)", r"\1", text)
