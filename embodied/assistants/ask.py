"""Ask-v0's assistant: true answers to typed questions about the object that is meant, in plain words."""

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from embodied.assistants.descriptions import side
from embodied.house.house import Placement
from embodied.interface import FindDescribed, Intention, Place, Reply, Situation, Subtask
from embodied.language.plain_language import PlainLanguage, floors_away
from embodied.language.templates import intention_of
from embodied.navigation.graph import nearest
from embodied.tasks.ask import Look
from embodied.tasks.goals import footprint_distance

QUESTIONS = (
    *(Intention.CONFIRM, Intention.APPEARANCE, Intention.REGION),
    *(Intention.ROUTE, Intention.DISAMBIGUATE, Intention.FREE),
)
CONFIRM_DISTANCE = 2.0
"""Metres within which one is at a thing."""
SIGHT_DISTANCE = 6.0
"""Metres within which a thing is seen."""
ROUTE_NODES = 6
"""Nodes of a route that one answer tells."""
UNKNOWN = "I do not know."


def in_view(world: Place, node: int, goal: FindDescribed) -> list[tuple[str, float, float]]:
    """Things of the goal's class in the room and within SIGHT_DISTANCE, nearest first: (placement, yaw, metres)."""
    eye, room = np.asarray(world.graph.positions)[node], world.graph.room_of_node[node]
    things = []
    for name in (*goal.fitting, *goal.similar):
        p = world.house.placement_by_id[name]
        if p.room != room:
            continue
        distance = float(np.round(footprint_distance(p, eye[None])[0], 6))
        if distance <= SIGHT_DISTANCE:
            things.append((name, math.atan2(p.position[1] - eye[1], p.position[0] - eye[0]), distance))
    return sorted(things, key=lambda x: (x[2], x[0]))


class AskAssistant:
    """Knows where everything is. `facts` is all that whoever words an answer is told."""

    def __init__(self, look: Look) -> None:
        """`look`: words of colour and material of things."""
        self._look, self._language = look, PlainLanguage()

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        """Confirm at a thing of the class, disambiguate where several are seen that may be it, all others always."""
        seen = in_view(situation.world, situation.pose.node, described_goal(situation))
        possible = [name for name, _, _ in seen if name in situation.extras.possible]
        cannot = set()
        if not seen or seen[0][2] > CONFIRM_DISTANCE:
            cannot.add(Intention.CONFIRM)
        if len(possible) < 2:
            cannot.add(Intention.DISAMBIGUATE)
        return tuple(q for q in QUESTIONS if q not in cannot)

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        """The truth, and which placements it rules out."""
        if question is Intention.FREE:
            meant = intention_of(situation.question)
            if meant is None or meant not in self.intentions(situation):
                return Reply(text=UNKNOWN, intention=question)
        else:
            meant = question
        goal, subtask = described_goal(situation), None
        if meant is Intention.CONFIRM:
            this = in_view(situation.world, situation.pose.node, goal)[0][0]
            yes = this == goal.placement
            text = "Yes, it is this one." if yes else "No, it is not this one."
            kept = {this} if yes else {*goal.fitting, *goal.similar} - {this}
        elif meant is Intention.APPEARANCE:
            text, kept = self._appearance(situation)
        elif meant is Intention.REGION:
            text, kept = _region(situation)
        elif meant is Intention.DISAMBIGUATE:
            text, kept = _which(situation)
        else:
            text, subtask = self._route(situation, rng)
            kept = {*goal.fitting, *goal.similar}
        out = tuple(p for p in (*goal.fitting, *goal.similar) if p not in kept)
        return Reply(text=text, intention=question, subtask=subtask, ruled_out=out)

    def facts(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> tuple[str, ...]:
        """Facts for a model or a person who words the answer: the answer itself, or for a free question, all."""
        if question is not Intention.FREE:
            return (self.answer(situation, question, rng=rng).text or "",)
        intentions = (Intention.REGION, Intention.APPEARANCE, Intention.ROUTE)
        return tuple(self.answer(situation, q, rng=rng).text or "" for q in intentions)

    def _appearance(self, s: Situation) -> tuple[str, set[str]]:
        goal, of = described_goal(s), s.world.house.placement_by_id
        thing, appearance = of[goal.placement], self._look(of[goal.placement])
        width = f"about {max(thing.size[0], 0.05):.1f} m wide"
        text = f"It is {', '.join([*appearance, width])}{_beside(s.world, thing)}."
        return text, {p for p in (*goal.fitting, *goal.similar) if self._look(of[p]) == appearance}

    def _route(self, s: Situation, rng: np.random.Generator) -> tuple[str, Subtask]:
        graph = s.world.graph
        whole = graph.path(s.pose.node, nearest(graph, s.pose.node, s.task.goal_nodes))
        nodes = whole[:ROUTE_NODES]
        subtask = Subtask("route", nodes[-1], path=nodes)
        if len(nodes) < 2:
            return "You are there.", subtask
        text = self._language.route(s.world, nodes, s.pose.yaw, rng=rng)
        return text + ("" if nodes == whole else " From there it is further."), subtask


BRING_QUESTIONS = (Intention.REGION, Intention.APPEARANCE, Intention.ROUTE, Intention.CONFIRM)


@dataclass(frozen=True)
class BringTruth:
    """Knowledge of who asked for a thing to be brought, besides the situation: placements that the request fits, the
    thing that the robot holds and the class of the furniture that is shut around the thing, '' for none, and the room
    in which the person is by now."""

    possible: tuple[str, ...]
    held: str
    furniture: str
    room: str


class Requester(AskAssistant):
    """Knows the house as it is now. Of a robot that holds something, the question of the room is about the person."""

    def intentions(self, situation: Situation) -> tuple[Intention, ...]:
        """Confirm what is held, all others always."""
        return BRING_QUESTIONS if situation.extras.held else BRING_QUESTIONS[:-1]

    def answer(self, situation: Situation, question: Intention, *, rng: np.random.Generator) -> Reply:
        truth: BringTruth = situation.extras
        if question is Intention.CONFIRM:
            yes = truth.held == described_goal(situation).placement
            text = "Yes, it is this one." if yes else "No, it is not this one."
            return Reply(text=text, intention=question, ruled_out=() if yes else (truth.held,))
        if question is Intention.REGION and truth.held:
            room = situation.world.house.room_by_id[truth.room].kind.replace("_", " ")
            return Reply(text=f"I am in the {room}.", intention=question)
        reply = super().answer(situation, question, rng=rng)
        inside = f" It is inside the {truth.furniture}." if truth.furniture else ""
        return dataclasses.replace(reply, text=f"{reply.text}{inside}") if question is Intention.APPEARANCE else reply


def described_goal(s: Situation) -> FindDescribed:
    if not isinstance(s.task.goal, FindDescribed):
        raise TypeError(f"this assistant answers in Ask-v0 only, {s.task.id!r} is of kind {s.task.kind!r}")
    return s.task.goal


def _region(s: Situation) -> tuple[str, set[str]]:
    goal, house = described_goal(s), s.world.house
    room_of = {p: house.room_by_id[house.placement_by_id[p].room] for p in (*goal.fitting, *goal.similar)}
    room = room_of[goal.placement]
    same, kind = [r.id for r in house.rooms if (r.kind, r.storey) == (room.kind, room.storey)], room.kind
    several, floor = len(same) > 1, floors_away(house, s.world.graph.room_of_node[s.pose.node], room.id)
    name = kind.replace("_", " ")
    text = f"It is in {'one of the ' + name + 's' if several else 'the ' + name}{floor}."
    return text, {p for p, r in room_of.items() if r.id in same}


def _which(s: Situation) -> tuple[str, set[str]]:
    goal = described_goal(s)
    seen = {name: (yaw, d) for name, yaw, d in in_view(s.world, s.pose.node, goal)}
    if goal.placement not in seen:
        return "None of those that you see.", {*goal.fitting, *goal.similar} - set(seen)
    yaw, distance = seen[goal.placement]
    where = side(yaw - s.pose.yaw).replace("to the", "to your")
    return f"The one {where}, {distance:.1f} m from you.", {goal.placement}


def _beside(world: Place, thing: Placement) -> str:
    """', next to the bed': the nearest larger thing of another class in the room, within 1.5 m."""
    others: Sequence[Placement] = [
        p
        for p in world.house.placements
        if p.room == thing.room and p.object_class != thing.object_class and p.size[0] * p.size[1] > 0.15
    ]
    at = np.asarray([thing.position])
    neighbours = sorted((float(footprint_distance(p, at)[0]), p.id, p.object_class) for p in others)
    return f", next to the {neighbours[0][2]}" if neighbours and neighbours[0][0] < 1.5 else ""
