"""Prompts are files: what the model is (above a line of three dashes), and what it is told each time (below).

An agent's prompt is built from an observation; a schema holds the actions that it may answer with.
"""

from __future__ import annotations

import dataclasses
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from embodied.agents.language_models.client import Message
from embodied.agents.language_models.completions import object_schema
from embodied.agents.language_models.observations import (
    Names,
    actions_by_name,
    candidates_in_words,
    observation_in_words,
    pictures_for,
)
from embodied.assets.json_file import read_text
from embodied.assistants.descriptions import side
from embodied.gym.sensors import PanoramaStore
from embodied.interface import Action, Ask, Intention, Move, Observation, Open, Stop

PROMPTS = Path(__file__).parent / "prompts"
REMEMBERED_STEPS = 8
"""Past steps that the model is told of."""
AGENT_VARIABLES = ("instruction", "history", "sees", "ways", "actions", "time")
"""Names in the template of prompts/agent.md."""


@dataclass(frozen=True)
class Prompt:
    """A system message and a template with `$names`."""

    system: str
    template: string.Template

    def messages(self, pictures: tuple[str, ...] = (), **facts: str) -> list[Message]:
        """The messages of one request.

        Args:
          pictures: data URLs, shown after the text.
          facts: values of the template's variables.
        """
        text = self.template.substitute(facts)
        content: object = text
        if pictures:
            shown = [{"type": "image_url", "image_url": {"url": url}} for url in pictures]
            content = [{"type": "text", "text": text}, *shown]
        return [{"role": "system", "content": self.system}, {"role": "user", "content": content}]


def read_prompt(name: str, names: tuple[str, ...], folder: Path | None = None) -> Prompt:
    """The prompt `name`.md of a folder, or the shipped one where the folder has none.

    Args:
      names: variables that its template may hold.

    Raises:
      ValueError: no line of three dashes, or a name that is not among `names`.
    """
    own_path = None if folder is None else Path(folder) / f"{name}.md"
    path = own_path if own_path is not None and own_path.exists() else PROMPTS / f"{name}.md"
    system, dashes, template = read_text(path).partition("\n---\n")
    parsed = string.Template(template)
    if not dashes or not parsed.is_valid():
        raise ValueError(f"{path} should hold a system message, a line of three dashes, and a template with $names")
    if unknown := sorted(set(parsed.get_identifiers()) - set(names)):
        raise ValueError(f"{path} names {['$' + n for n in unknown]}; it may name {['$' + n for n in names]}")
    return Prompt(" ".join(system.split()), parsed)


@dataclass(frozen=True, eq=False)
class PromptBuilder:
    """Builds the prompt of an agent's model from an observation."""

    namer: Names | None = None
    """Names the things in sight; None for a model that is told only where it can go."""
    panoramas: PanoramaStore | None = None
    """Pictures for a model that sees; None for one that reads only."""
    pictures: str = "strip"
    """One of embodied.agents.language_models.observations.PICTURE_FORMS."""
    prompt: Prompt = dataclasses.field(default_factory=lambda: agent_prompt())

    def text(self, o: Observation, history: Sequence[str] = ()) -> str:
        """The observation in words.

        Args:
          history: what was done before, step by step.
        """
        return self.prompt.template.substitute(self._facts(o, history))

    def messages(self, o: Observation, history: Sequence[str] = ()) -> list[Message]:
        """The same as messages, with pictures where there are any."""
        pictures = () if self.panoramas is None else pictures_for(o, self.panoramas, self.pictures)
        return self.prompt.messages(pictures, **self._facts(o, history))

    def _facts(self, o: Observation, history: Sequence[str]) -> dict[str, str]:
        names = () if self.namer is None else self.namer(o.sight)
        return {
            "instruction": o.instruction,
            "history": " ".join(history[-REMEMBERED_STEPS:]) or "nothing yet",
            "sees": observation_in_words(o, names),
            "ways": candidates_in_words(o, names),
            "actions": ", ".join(actions_by_name(o)),
            "time": str(o.time),
        }


def agent_prompt(folder: Path | None = None) -> Prompt:
    """The prompt of an agent; `folder` may hold an agent.md of one's own."""
    return read_prompt("agent", AGENT_VARIABLES, folder)


def schema_of(o: Observation) -> dict[str, Any]:
    """A schema of the possible answers."""
    text = lambda most: {"type": "string", "maxLength": most}
    free = {"question": text(300)} if Intention.FREE in o.can_ask else {}
    return object_schema(reason=text(100), action={"type": "string", "enum": list(actions_by_name(o))}, **free)


def action_in(o: Observation, value: Mapping[str, Any]) -> Action:
    """The action that a valid answer names."""
    action = actions_by_name(o)[value["action"]]
    if isinstance(action, Ask) and action.intention is Intention.FREE:
        return dataclasses.replace(action, question=value["question"])
    return action


def action_in_words(o: Observation, action: Action) -> str:
    """An action that was taken, for the history."""
    if isinstance(action, Ask):
        return f"You asked: {action.question or action.intention.value}."
    if isinstance(action, Stop):
        return "You stopped."
    if o.candidates.words:
        return f"You did {o.candidates.words[action.candidate]}."
    where = side(float(o.candidates.bearing[action.candidate]))
    if isinstance(action, Move):
        return f"You went {where}."
    return f"You {'opened' if isinstance(action, Open) else 'closed'} the door {where}."
