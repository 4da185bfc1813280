"""One episode that people take part in: an environment, whose turn it is, and what was said."""

import dataclasses
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from embodied import interface
from embodied.action_spaces import PanoramicMoves
from embodied.datasets.store import Dataset, SplitData
from embodied.envs.base import ActionError, HelpEnv
from embodied.envs.continuous import NavMeshCache
from embodied.kinds.plugins import made_by_name
from embodied.policies.baselines import WITHOUT_LEARNING
from embodied.records import from_plain, parse, to_json
from embodied.seeds import stream
from embodied.serve.driving import ACTIONS, BrowserBody
from embodied.serve.store import Event
from embodied.serve.study import LONGEST_TEXT, PERSON, StudyPart
from embodied.serve.talk import Overheard, PathSpeaker, Relay, TalkEnv, practice_agent

AgentMaker = Callable[[SplitData], interface.Agent]
AssistantMaker = Callable[[interface.Assistant], interface.Assistant]
"""Puts an assistant in the place of the simulated one, which it is given."""
POLICIES: Mapping[str, AgentMaker] = {
    name: functools.partial(lambda make, split: make(), make) for name, make in WITHOUT_LEARNING.items()
}

ACTS: Mapping[str, Any] = {"moved": interface.Move, "opened": interface.Open, "closed": interface.Close}
"""Actions of an agent that name a candidate, by the kind of their events."""


@dataclass(frozen=True, eq=False)
class Table:
    """All that the games of a part share: the places, the tasks, and who plays where no person does."""

    part: StudyPart
    places: Mapping[str, interface.Place]
    tasks: Mapping[str, interface.Task]
    practice: interface.Task
    """Played before the first that counts; none of `tasks` where there are more."""
    make_env: Callable[[], tuple[HelpEnv, Relay]]
    agent: interface.Agent | None
    assistant: Any
    grounds: NavMeshCache = field(default_factory=NavMeshCache)
    """The floors to drive on."""


def set_table(
    part: StudyPart,
    data: Dataset,
    agents: Mapping[str, AgentMaker] = POLICIES,
    assistants: Mapping[str, AssistantMaker] = MappingProxyType({}),
) -> Table:
    """Everything that a part that is played needs.

    Args:
      agents: policies by name.
      assistants: by name, besides 'simulated'.

    Raises:
      ValueError: an unknown agent or assistant, or tasks of HARI, which is not played in free words.
    """
    kind = data.task_kind
    if kind.help == "descriptions":
        raise ValueError(f"{data.folder} is of kind {kind.title}, whose help is not put into words; take another kind")
    split = data.split(part.split)
    tasks = [t if part.budget is None else dataclasses.replace(t, budget=part.budget) for t in split.tasks]
    if not tasks:
        raise ValueError(f"part {part.name!r}: the split {part.split!r} has no tasks")
    agent: interface.Agent | None = None
    if part.agent != PERSON:
        agent = agents[part.agent](split) if part.agent in agents else made_by_name(part.agent)
    moves, prices = PanoramicMoves(), {q.text: q.price for q in part.questions}
    assistant: Any = None
    if part.assistant == "simulated" or part.assistant in assistants:
        simulated = split.make_env().assistant or PathSpeaker()
        assistant = assistants.get(part.assistant, lambda base: base)(simulated)
    elif part.assistant not in (PERSON, "none"):
        assistant = made_by_name(part.assistant)
    simulated_help = part.assistant in ("simulated", *assistants)
    unhelped = kind.help == "none" and part.assistant == "none" and part.moves != "drive"
    by_own_rule = unhelped or kind.help == "words" and (simulated_help or part.agent not in (PERSON, *POLICIES))
    if by_own_rule and part.moves == "drive":
        raise ValueError(
            f"part {part.name!r}: nobody drives by the rules of {data.kind!r}; let a person assist, or use viewpoints"
        )

    def make_env() -> tuple[HelpEnv, Relay]:
        relay = Relay() if assistant is None else Overheard(assistant)
        if by_own_rule:
            env = split.make_env()
            env.assistant = None if unhelped else relay
            return env, relay
        return TalkEnv(split.worlds, None if part.assistant == "none" else relay, moves, prices), relay

    known = {t.id: t for t in tasks[: part.tasks]}
    spare = next((t for t in tasks[part.tasks :]), tasks[-1])
    return Table(part, split.worlds, known, spare, make_env, agent, assistant)


@dataclass(eq=False)
class Game:
    """One episode. Its state follows from the events that were applied."""

    id: str
    table: Table
    people: Mapping[str, str]
    """Role to person."""
    practice: bool
    begun: float
    """Seconds since 1970."""
    task: interface.Task
    seed: int
    said: list[dict[str, Any]] = field(default_factory=list)
    """The conversation: who ('agent', 'assistant'), text, picture (node or None)."""
    question: str | None = None
    """A question of the agent that nobody has answered yet."""
    broken: str | None = None
    """Why it ended without an episode."""
    turn: int = 0
    """Events so far: what a browser saw when somebody acted."""

    def __post_init__(self) -> None:
        if self.practice:
            self.relay = Relay()
            helped = self.table.part.assistant != "none"
            self.env: HelpEnv = TalkEnv(self.table.places, self.relay if helped else None, PanoramicMoves())
            self.agent: interface.Agent | None = None if "agent" in self.people else practice_agent()
            self.assistant: Any = None if "assistant" in self.people else PathSpeaker()
        else:
            self.env, self.relay = self.table.make_env()
            self.agent, self.assistant = self.table.agent, self.table.assistant
        self.observation: interface.Observation | None = self.env.reset(self.task, seed=self.seed)
        drives = self.table.part.moves == "drive" and "agent" in self.people
        where = self.env.world, self.task.start, self.table.grounds
        self.drive = BrowserBody(*where, self.table.part.figure) if drives else None
        self.last_change = self.begun
        self._steps: list[interface.Step] = []
        self._asked_at = 0.0
        self._asking: interface.Thought | None = None
        self._seen: list[tuple[interface.Observation, interface.Situation]] = [(self.observation, self.env.situation)]
        self._memory: Any = None
        self._thought = 0
        self._rng = stream(self.seed, "policy", self.task.id)

    @property
    def over(self) -> bool:
        return self.observation is None or self.broken is not None

    @property
    def mover(self) -> str | None:
        """The role whose turn it is: 'agent', 'assistant', or nobody's."""
        return None if self.over else "assistant" if self.question is not None else "agent"

    @property
    def bot_moves(self) -> bool:
        return self.mover is not None and self.mover not in self.people

    @property
    def episode(self) -> interface.Episode:
        """The finished episode, with the seconds of its steps."""
        part = self.table.part
        names = [self.people.get("agent", part.agent), self.people.get("assistant", part.assistant)]
        return dataclasses.replace(self.env.episode(" with ".join(names)), steps=tuple(self._steps))

    @property
    def situation(self) -> interface.Situation:
        return self.env.situation

    def apply(self, event: Event) -> None:
        """Take in one event.

        Raises:
          ActionError: not possible now; nothing has changed.
        """
        if self.over:
            raise ActionError("the episode is over")
        if event.kind == "broken":
            self.broken = str(event.body["why"])
        elif event.kind == "asked":
            self._ask(str(event.body["question"]), event.time)
            self._asking = _thought_of(event)
        elif event.kind == "answered":
            if self.question is None:
                raise ActionError("nothing was asked")
            reply = from_plain(interface.Reply, event.body["reply"])
            self.relay.reply = reply
            question, self.question = self.question, None
            self._step(interface.Ask(question=question, thought=self._asking), self._asked_at)
            picture = None if reply.image is None else reply.image.node
            seconds = event.time - self._asked_at
            self.said.append({"who": "assistant", "text": reply.text or "", "picture": picture, "seconds": seconds})
        else:
            if self.question is not None:
                raise ActionError("the assistant has not answered yet")
            thought = _thought_of(event)
            if event.kind not in ACTS:
                self._step(interface.Stop(thought), event.time)
            elif self.drive is None:
                self._step(ACTS[event.kind](int(event.body["candidate"]), thought), event.time)
            else:
                self._drive(self.drive, int(event.body["candidate"]), event.time)
        self.turn += 1
        self.last_change = event.time

    def think(self) -> tuple[str, dict[str, Any]]:
        """The action of the bot whose turn it is: the kind and the body of its event. May take its time."""
        if self.question is not None:
            return "answered", {"reply": self._answer(self.question)}
        assert self.agent is not None, "a bot acts"
        action: interface.Action | None = None
        for seen, situation in self._seen[self._thought :]:
            (action,), self._memory = interface.act(self.agent, [seen], [situation], self._memory, rngs=[self._rng])
        self._thought = len(self._seen)
        assert action is not None, "something new was seen"
        body = {} if action.thought is None else {"thought": parse(to_json(action.thought))}
        for kind, act in ACTS.items():
            if isinstance(action, act):
                return kind, {"candidate": action.candidate, **body}
        if isinstance(action, interface.Ask):
            return "asked", {"question": action.question or "Can you help me?", **body}
        return "stopped", body

    def _answer(self, question: str) -> Any:
        rng = stream(self.seed, "assistant", self.task.id, self.env.time)
        asked = dataclasses.replace(self.env.situation, question=question)
        reply = self.assistant.answer(asked, interface.Intention.FREE, rng=rng)
        return parse(to_json(reply))

    def _ask(self, question: str, time: float) -> None:
        now = self.observation
        if self.question is not None or now is None or not now.can_ask:
            raise ActionError("nothing can be asked now")
        if not 0 < len(question) <= LONGEST_TEXT:
            raise ActionError(f"a question has 1 to {LONGEST_TEXT} characters")
        self.question, self._asked_at = question, time
        self.said.append({"who": "agent", "text": question, "picture": None})

    def _drive(self, drive: BrowserBody, action: int, time: float) -> None:
        """One action of whoever drives; moves along the graph when another viewpoint is the nearest."""
        if action not in range(len(ACTIONS)):
            raise ActionError(f"there are {len(ACTIONS)} actions, counted from 0")
        here = drive.act(action)
        for node in self.situation.world.graph.path(self.env.pose.node, here)[1:]:
            if self.over:
                break
            self._step(interface.Move(self.situation.candidate_nodes.index(node)), time)

    def _step(self, action: interface.Action, time: float) -> None:
        self.observation = self.env.step(action)
        self._steps.append(dataclasses.replace(self.env.last_step, seconds=round(time - self.begun, 3)))
        if self.observation is not None:
            self._seen.append((self.observation, self.env.situation))


def _thought_of(event: Event) -> interface.Thought | None:
    """The thought of a bot when it acted; nothing where it did not say, and of people."""
    thought = event.body.get("thought")
    return None if thought is None else from_plain(interface.Thought, thought)
