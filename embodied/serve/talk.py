"""Help in free words: the rule of play when people talk, who answers, and who plays with people who practise."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from embodied.action_spaces import Moves
from embodied.envs.base import HelpEnv, required
from embodied.interface import Action, Ask, Intention, Place, Reply, Situation, Subtask, Viewpoint
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.graph import nearest
from embodied.policies.baselines import PrivilegedAsking, Shortest

ASK_EVERY = 3
"""Steps after which somebody to practise with asks."""
PERSON_SUBTASK = "said "
"""How the ids of sub-tasks begin that people put into words."""


class Relay:
    """The assistant of an environment whose answers come from elsewhere: they are known before the environment asks."""

    def __init__(self) -> None:
        self.reply: Reply | None = None

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        """Help, everywhere; the environment takes it away when the budget is spent."""
        return (Intention.HELP,)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        """The reply that was handed over."""
        reply, self.reply = self.reply, None
        assert reply is not None, "whoever steps with a question has handed over the reply"
        return reply


class Overheard(Relay):
    """A relay that asks where, and only where, another assistant would answer."""

    def __init__(self, assistant: Any) -> None:
        super().__init__()
        self.assistant = assistant

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        return self.assistant.intentions(situation)


class TalkEnv(HelpEnv):
    """Help in free words: the answer is the instruction until the next one, and the agent goes on from where it stands.

    A question costs no step; stopping ends the episode.
    """

    asking_takes_time = False

    def __init__(
        self,
        worlds: Mapping[str, Place],
        assistant: Relay | None = None,
        moves: Moves | None = None,
        prices: Mapping[str, float] | None = None,
    ) -> None:
        """`prices`: of questions, by their words; others are free."""
        super().__init__(worlds, assistant, moves)
        self._prices = prices or {}

    def _replied(self, reply: Reply) -> None:
        self.instruction = reply.text or self.instruction
        self.target = reply.image
        self.subtask = reply.subtask
        self.time_on_task = 0

    def _cost(self, action: Action) -> float:
        return self._prices.get(action.question or "", 0.0) if isinstance(action, Ask) else 0.0


def spoken_reply(situation: Situation, text: str, picture: int | None, number: int, way: int = 0) -> Reply:
    """The meaning of a person's words to an environment: the way to what they show, or else the one they were shown.

    Args:
      picture: the node whose view they show, if any.
      number: of the question in its episode.
      way: as in `way_to_goal`.
    """
    graph, pose = situation.world.graph, situation.pose
    path = way_to_goal(situation, way) if picture is None else graph.path(pose.node, picture)
    goal = nearest(graph, path[-1], situation.task.goal_nodes)
    subtask = Subtask(f"{PERSON_SUBTASK}{number}", path[-1], start=pose, goal=goal, path=path)
    return Reply(text, None if picture is None else Viewpoint(situation.task.world, picture), subtask=subtask)


def way_to_goal(situation: Situation, steps: int = 0) -> tuple[int, ...]:
    """The shortest way to the nearest goal, only its first `steps` edges unless that is 0. Nodes."""
    graph, node = situation.world.graph, situation.pose.node
    way = graph.path(node, nearest(graph, node, situation.task.goal_nodes))
    return way[: steps + 1] if steps else way


class PathSpeaker:
    """The simulated assistant where a data set has none: says the shortest way in plain words."""

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        return (Intention.HELP,)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        path = way_to_goal(situation)
        words = PlainLanguage().route(situation.world, path, situation.pose.yaw, rng=rng) if len(path) > 1 else None
        reply = spoken_reply(situation, words or "You are there.", None, 0)
        return dataclasses.replace(reply, subtask=dataclasses.replace(required(reply.subtask, "way"), id="way"))


def practice_agent() -> PrivilegedAsking:
    """Takes the shortest way and asks every few steps: somebody to practise answering with."""
    asks = lambda o, last, *, rng: last < 0 or o.time - last >= ASK_EVERY
    return PrivilegedAsking(Shortest(), asks, "Where do I go from here?")
