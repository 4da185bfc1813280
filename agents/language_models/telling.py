"""What a model is told at a step and what it may answer: an observation as messages, a schema of the actions."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.language_models.client import Message
from embodied.agents.language_models.completions import object_schema
from embodied.agents.language_models.pictures import Panoramas, shown
from embodied.agents.language_models.prompts import Prompt, read_prompt
from embodied.agents.language_models.words import Namer, actions_of, sees, side, ways
from embodied.interface import Action, Ask, Intention, Observation, Stop

REMEMBERED = 8
"""Past steps that the model is told of."""
NAMES = ("instruction", "history", "sees", "ways", "actions", "time")
"""What the template of prompts/agent.md may name."""


@dataclass(frozen=True, eq=False)
class Teller:
    """How a model is told of what is there."""

    namer: Namer | None = None
    """Names what is seen; None for a model that is told nothing but where it can go."""
    panoramas: Panoramas | None = None
    """What is shown to a model that sees; None for one that reads only."""
    pictures: str = "strip"
    """One of embodied.agents.language_models.pictures.PICTURES."""
    prompt: Prompt = dataclasses.field(default_factory=lambda: agent_prompt())

    def text(self, o: Observation, said: Sequence[str] = ()) -> str:
        """The observation in words.

        Args:
          said: what was done before, step by step.
        """
        return self.prompt.template.substitute(self._facts(o, said))

    def messages(self, o: Observation, said: Sequence[str] = ()) -> list[Message]:
        """The same as messages, with pictures where there are any."""
        pictures = () if self.panoramas is None else shown(o, self.panoramas, self.pictures)
        return self.prompt.messages(pictures, **self._facts(o, said))

    def _facts(self, o: Observation, said: Sequence[str]) -> dict[str, str]:
        names = () if self.namer is None else self.namer.names(o.sight)
        return {
            "instruction": o.instruction,
            "history": " ".join(said[-REMEMBERED:]) or "nothing yet",
            "sees": sees(o, names),
            "ways": ways(o, names),
            "actions": ", ".join(actions_of(o)),
            "time": str(o.time),
        }


def agent_prompt(folder: Path | None = None) -> Prompt:
    """The prompt of an agent; `folder` may hold an agent.md of one's own."""
    return read_prompt("agent", NAMES, folder)


def schema_of(o: Observation) -> dict[str, Any]:
    """What the model may answer."""
    text = lambda most: {"type": "string", "maxLength": most}
    free = {"question": text(300)} if Intention.FREE in o.can_ask else {}
    return object_schema(reason=text(100), action={"type": "string", "enum": list(actions_of(o))}, **free)


def action_in(o: Observation, value: Mapping[str, Any]) -> Action:
    """The action that a valid answer names."""
    action = actions_of(o)[value["action"]]
    if isinstance(action, Ask) and action.intention is Intention.FREE:
        return dataclasses.replace(action, question=value["question"])
    return action


def told(o: Observation, action: Action) -> str:
    """What was done, for the history."""
    if isinstance(action, Ask):
        return f"You asked: {action.question or action.intention.value}."
    if isinstance(action, Stop):
        return "You stopped."
    if o.candidates.words:
        return f"You did {o.candidates.words[action.candidate]}."
    return f"You went {side(float(o.candidates.bearing[action.candidate]))}."
