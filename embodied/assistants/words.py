"""HARI's descriptions as sentences, for people and for data sets of words."""

from __future__ import annotations

from collections.abc import Sequence

from embodied.geometry import wrap
from embodied.interface import STEP, TURNS, Description, Feature, Pose

SIDES = (
    "ahead",
    "ahead on the left",
    "left",
    "left",
    "left",
    "behind on the left",
    "behind",
    "behind on the right",
    "right",
    "right",
    "right",
    "ahead on the right",
)
"""Side on which something is, by its direction in steps of 30 degrees counter-clockwise from the gaze."""


def described(description: Description, pose: Pose | None = None) -> str:
    """HARI's bag of features as a sentence.

    Args:
      pose: whose surroundings it describes; sides are named then. Directions of other places are left out.
    """
    actions = [f for f in description if f.kind == "action"]
    if actions:
        return "You are there." if actions[0].name == "stop" else "It is the next step from where you are."
    rooms = [f.name.replace("_", " ") for f in description if f.kind == "room"]
    things = [_thing(f, pose) for f in description if f.kind == "object"][:6]
    place = f"{'You are in' if pose else 'Go to a place in'} the {rooms[0]}" if rooms else "There is no room to name"
    return f"{place}, with {_listed(things)}." if things else f"{place}."


def _thing(feature: Feature, pose: Pose | None) -> str:
    name = feature.name.replace("_", " ")
    if pose is None:
        return f"{name} ({feature.distance} m)"
    return f"{name} ({feature.distance} m, {SIDES[(feature.horizontal - pose.turn) % TURNS]})"


def _listed(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]


def side(bearing: float) -> str:
    """A direction relative to the gaze (radians, left positive) in words, to 30 degrees."""
    steps = round(float(wrap(bearing)) / STEP)
    if steps == 0:
        return "straight ahead"
    if abs(steps) >= 6:
        return "behind you"
    return f"{30 * abs(steps)} degrees to the {'left' if steps > 0 else 'right'}"


def features_in_words(description: Description, turn: int) -> str:
    """A bag of features in words, directions relative to the gaze."""
    parts = []
    for f in description:
        if f.kind == "room":
            parts.append(f.name.replace("_", " "))
        elif f.name == "stop":
            parts.append("you are there")
        else:
            where = side((f.horizontal - turn) * STEP)
            parts.append(f"go {where}" if f.kind == "action" else f"{f.name} ({where}, {f.distance} m)")
    return ", ".join(parts)
