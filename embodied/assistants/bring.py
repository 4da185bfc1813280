"""The person who asked for a thing to be brought: Ask-v0's answers, on where the thing is now and where they are."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from embodied.assistants.ask import AskAssistant, described_goal
from embodied.interface import Intention, Reply, Situation

BRING_QUESTIONS = (Intention.REGION, Intention.APPEARANCE, Intention.ROUTE, Intention.CONFIRM)


@dataclass(frozen=True)
class BringTruth:
    """Knowledge of the person besides the situation."""

    possible: tuple[str, ...]
    """Placements that the request fits."""
    held: str
    """The thing that the robot holds; '' for none."""
    inside: str
    """Class of the furniture whose closed door hides the thing; '' where it lies in the open."""
    room: str
    """In which the person is now."""


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
        if question is Intention.APPEARANCE and truth.inside:
            return dataclasses.replace(reply, text=f"{reply.text} It is inside the {truth.inside}.")
        return reply
