"""Who words an assistant's answer: its own template, a language model, or a person; all through `Assistant`.

Whoever words it is told what the assistant would say and, where it told a route, the walk in plain words; nothing else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np

from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import object_schema
from embodied.agents.language_models.prompts import read_prompt
from embodied.assistants.ask import AskAssistant
from embodied.interface import Assistant, Intention, Reply, Situation
from embodied.kinds.plugins import assistant_of
from embodied.language import PlainLanguage

ASSISTANT_ANSWER = object_schema(answer={"type": "string", "maxLength": 600})
QUESTION_WORDS = {
    Intention.HELP: "Can you help me? Where should I go?",
    Intention.CONFIRM: "Is this the one?",
    Intention.APPEARANCE: "What does it look like?",
    Intention.REGION: "Which room is it in?",
    Intention.ROUTE: "How do I get there?",
    Intention.DISAMBIGUATE: "Which of those that I see is it?",
}


def facts_of(base: Assistant, s: Situation, reply: Reply, *, rng: np.random.Generator) -> tuple[str, ...]:
    """The facts for whoever words a reply: the answer of the assistant itself, and the walk that it means."""
    if isinstance(base, AskAssistant):
        return base.facts(s, reply.intention, rng=rng)
    facts = (reply.text,) if reply.text else ()
    path = reply.subtask.path if reply.subtask else ()
    start = reply.subtask.start if reply.subtask and reply.subtask.start else s.pose
    if len(path) < 2 or (reply.subtask and reply.subtask.words):
        return facts
    return (*facts, PlainLanguage().route(s.world, path, start.yaw, rng=rng))


def question_of(s: Situation, question: Intention) -> str:
    """A request for help in words."""
    return s.question if question is Intention.FREE else QUESTION_WORDS.get(question, question.value)


class WordedAssistant:
    """Says the replies of another assistant in other words; who derives from it says `worded`."""

    def __init__(self, base: Assistant) -> None:
        """`base`: who knows the answer."""
        self._base = base

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        return self._base.intentions(situation)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        reply = self._base.answer(situation, question, rng=rng)
        if reply.text is None:  # HARI's descriptions are no words
            return reply
        return self.worded(reply, facts_of(self._base, situation, reply, rng=rng), situation, question)

    def worded(self, reply: Reply, facts: tuple[str, ...], situation: Situation, question: Intention) -> Reply:
        """The reply in other words, by the facts that whoever words it is told."""
        raise NotImplementedError


class ModelAssistant(WordedAssistant):
    """Words the replies by a language model; where its answer is none, the template stands."""

    def __init__(self, base: Assistant, client: Client, prompts: Path | None = None) -> None:
        """`prompts`: folder with an assistant.md of one's own."""
        super().__init__(base)
        self._client, self._prompt = client, read_prompt("assistant", ("facts", "question", "request"), prompts)

    def worded(self, reply: Reply, facts: tuple[str, ...], situation: Situation, question: Intention) -> Reply:
        messages = self._prompt.messages(
            facts="\n".join(f"- {f}" for f in facts),
            question=question_of(situation, question),
            request=situation.task.request,
        )
        answer = self._client.ask(messages, ASSISTANT_ANSWER)
        text = reply.text if answer.value is None else str(answer.value["answer"])
        return dataclasses.replace(reply, text=text, usage=self._client.usage(answer))


class PersonAssistant(WordedAssistant):
    """Somebody at the keyboard words the replies."""

    def __init__(self, base: Assistant, read: Callable[[str], str] = input) -> None:
        """`read`: shows a text and gives what was written; an empty line leaves the template's words."""
        super().__init__(base)
        self._read = read

    def worded(self, reply: Reply, facts: tuple[str, ...], situation: Situation, question: Intention) -> Reply:
        known = "\n".join(f"  - {f}" for f in facts)
        words = self._read(f"\nYou know:\n{known}\nThe agent asks: {question_of(situation, question)}\n> ").strip()
        return dataclasses.replace(reply, text=words or reply.text)


def assistant_maker(name: str, client: Callable[[], Client], prompts: Path | None) -> Callable[[Assistant], Assistant]:
    """How the assistant of an environment is replaced: 'template' (not at all), 'llm', 'person', or 'module:Class'.

    Raises:
      ValueError: no such class.
    """
    if name == "template":
        return lambda base: base
    if name == "llm":
        return lambda base: ModelAssistant(base, client(), prompts)
    if name == "person":
        return PersonAssistant
    own = assistant_of(name)
    return lambda base: own or base
