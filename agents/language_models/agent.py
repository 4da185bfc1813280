"""A language model as an agent, which is told at every step what is there and names one of the actions; who words an
assistant's answer: its own template, a language model, or a person, all through `Assistant`; and a scripted listener
that follows what a language model said of a route.

Whoever words an answer is told what the assistant would say and, where it told a route, the walk in plain words;
nothing else.
"""

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from embodied.agents.language_models.client import Client
from embodied.agents.language_models.completions import Answer, object_schema
from embodied.agents.language_models.prompts import PromptBuilder, action_in, action_in_words, read_prompt, schema_of
from embodied.assistants.ask import AskAssistant
from embodied.interface import (
    Action,
    Actions,
    Assistant,
    Episode,
    Intention,
    Move,
    Observation,
    Observations,
    Reply,
    Rngs,
    SeenPlace,
    Situation,
    Stop,
    Thought,
)
from embodied.kinds.plugins import assistant_of
from embodied.language import PlainLanguage, follow
from embodied.language.people_language import ARRIVED
from embodied.language.plain_language import heard_subgoal

MOST_INVALID = 4
"""Invalid answers in a row after which the agent stops."""


@dataclass
class _EpisodeHistory:
    """The past of one episode."""

    actions: list[str] = field(default_factory=list)
    failures: int = 0


class LanguageModelAgent:
    """A `Policy`. An invalid answer moves on, straight ahead where that can be, and is counted."""

    def __init__(self, client: Client, builder: PromptBuilder | None = None) -> None:
        self._client, self._builder = client, builder or PromptBuilder()

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        histories = memory or [_EpisodeHistory() for _ in observations]
        playing = [(o, i) for i, o in enumerate(observations) if o is not None]
        asked = [(self._builder.messages(o, histories[i].actions), schema_of(o)) for o, i in playing]
        actions: Actions = [None] * len(observations)
        for (o, i), answer in zip(playing, self._client.ask_all(asked), strict=True):
            actions[i] = self._understood(o, answer, histories[i])
        return actions, histories

    def _understood(self, o: Observation, answer: Answer, history: _EpisodeHistory) -> Action:
        if answer.value is None:
            history.failures += 1
            action, words = (Stop() if history.failures >= MOST_INVALID else straight_on(o)), ""
        else:
            history.failures = 0
            action, words = action_in(o, answer.value), str(answer.value["reason"])
        history.actions.append(action_in_words(o, action))
        return dataclasses.replace(action, thought=Thought(usage=self._client.usage(answer), words=words))


def straight_on(o: Observation) -> Action:
    """The first candidate that is allowed, which is the one nearest to straight ahead; stop where there is none."""
    allowed = np.flatnonzero(o.candidates.allowed)
    return Move(int(allowed[0])) if len(allowed) else Stop()


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


def listener_arrives(world: SeenPlace, text: str, path: Sequence[int], yaw: float) -> bool:
    """True where somebody who only reads `text` comes within ARRIVED metres of the end of `path`.

    Args:
      yaw: direction at the beginning, radians.
    """
    try:
        walked = follow(world, text, path[0], yaw).path
    except ValueError:  # nothing in it is an instruction
        return False
    return float(world.graph.distance[walked[-1], path[-1]]) <= ARRIVED


def followed_replies(episodes: Iterable[Episode], worlds: Mapping[str, SeenPlace]) -> tuple[int, int]:
    """Of the replies that told a way: those that a listener carries out, and all."""
    right = total = 0
    for episode in episodes:
        for step in episode.steps:
            subtask = step.reply.subtask if step.reply else None
            if subtask is None or not step.reply or not step.reply.text or len(subtask.path) < 2:
                continue
            total += 1
            if subtask.words:  # VNLA: primitive actions
                right += _subgoal_in(step.reply.text) == subtask.words
            else:
                start = subtask.start or step.pose
                right += listener_arrives(worlds[episode.task.world], step.reply.text, subtask.path, start.yaw)
    return right, total


def _subgoal_in(text: str) -> tuple[str, ...]:
    try:
        return heard_subgoal(text)
    except (ValueError, IndexError):  # words that are no steps
        return ()
