"""Prompts are files: what the model is (above a line of three dashes), and what it is told each time (below)."""

from __future__ import annotations

import string
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.language_models.client import Message
from embodied.assets.json_file import read_text

FOLDER = Path(__file__).parent / "prompts"


@dataclass(frozen=True)
class Prompt:
    """A system message and a template with `$names`."""

    system: str
    template: string.Template

    def messages(self, pictures: tuple[str, ...] = (), **facts: str) -> list[Message]:
        """The messages of one request.

        Args:
          pictures: data URLs, shown after the text.
          facts: what the names of the template stand for.
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
      names: what its template may name.

    Raises:
      ValueError: no line of three dashes, or a name that is not among `names`.
    """
    own = None if folder is None else Path(folder) / f"{name}.md"
    path = own if own is not None and own.exists() else FOLDER / f"{name}.md"
    system, dashes, template = read_text(path).partition("\n---\n")
    found = string.Template(template)
    if not dashes or not found.is_valid():
        raise ValueError(f"{path} should hold a system message, a line of three dashes, and a template with $names")
    if unknown := sorted(set(found.get_identifiers()) - set(names)):
        raise ValueError(f"{path} names {['$' + n for n in unknown]}; it may name {['$' + n for n in names]}")
    return Prompt(" ".join(system.split()), found)
