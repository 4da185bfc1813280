"""Options of a language model that takes part, and the client that asks it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from embodied.agents.language_models.client import FORMS, AnswerCache, Client, ServerSettings
from embodied.options import InputFolder, InputPath, Settings


@dataclass(frozen=True, kw_only=True)
class WithModel:
    """The language model."""

    server: Annotated[
        ServerSettings, Settings("the language model", ServerSettings(""), skip=("wait",), words={"form": FORMS})
    ]
    answers: InputPath = Path("answers.sqlite")
    """File that keeps every answer: the same question is not asked twice."""
    offline: bool = False
    """Use only stored answers; send nothing to a server."""
    prompts: InputFolder | None = None
    """Folder with prompts of your own (agent.md, ...)."""


def client_of(args: WithModel) -> Client:
    """The client that the options describe.

    Raises:
      ValueError: no model was named.
    """
    if not args.server.model:
        raise ValueError("a language model takes part: name it with --model NAME (and its server with --base-url URL)")
    return Client(args.server, AnswerCache(args.answers), offline=args.offline)
