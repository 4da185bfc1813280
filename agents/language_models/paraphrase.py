"""Language as varied as people's for a data set: a model says every route again, and only what leads there is kept.

`embodied llm paraphrase` does this for a split.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.language_models.checking import arrives
from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import object_schema
from embodied.agents.language_models.prompts import read_prompt
from embodied.interface import STEP, Route, SeenPlace, Usage

STYLES = (
    "a friend on the phone, chatty",
    "very short, a few words",
    "a polite guide",
    "somebody who names furniture and colours",
    "a child",
    "a non-native speaker with simple words",
)
NAMES = ("text", "style")
"""What the template of prompts/paraphrase.md may name."""
SCHEMA = object_schema(instruction={"type": "string", "maxLength": 800})


@dataclass(frozen=True)
class Paraphrases:
    """What a model said, and how much of it was dropped."""

    routes: tuple[Route, ...]
    """Those that a listener follows to their end, one or none per route that was given."""
    asked: int
    invalid: int
    """Answers that were none."""
    unchanged: int
    """The same words again."""
    lost: int
    """Words with which the listener does not arrive."""
    usage: Usage

    @property
    def failing(self) -> float:
        """The share that was dropped."""
        return 1.0 - len(self.routes) / self.asked if self.asked else 0.0


def paraphrased(
    routes: Sequence[tuple[str, Route]], worlds: Mapping[str, SeenPlace], client: Client, prompts: Path | None = None
) -> Paraphrases:
    """Every route in other words.

    Args:
      routes: each with the name of its house.
      prompts: folder with a paraphrase.md of one's own.
    """
    prompt = read_prompt("paraphrase", NAMES, prompts)
    asked = [
        (prompt.messages(text=r.instruction, style=STYLES[i % len(STYLES)]), SCHEMA) for i, (_, r) in enumerate(routes)
    ]
    kept, invalid, unchanged, lost, usage = [], 0, 0, 0, Usage()
    for (house, route), answer in zip(routes, client.ask_all(asked), strict=True):
        usage += client.usage(answer)
        text = "" if answer.value is None else str(answer.value["instruction"]).strip()
        if not text:
            invalid += 1
        elif text.lower() == route.instruction.lower():
            unchanged += 1
        elif not arrives(worlds[house], text, route.path, route.turn * STEP):
            lost += 1
        else:
            kept.append(dataclasses.replace(route, id=f"{route.id}_said_again", instruction=text))
    return Paraphrases(tuple(kept), len(routes), invalid, unchanged, lost, usage)
