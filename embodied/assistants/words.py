"""HARI's descriptions as sentences, for people and for data sets of words."""

from __future__ import annotations

from collections.abc import Sequence

from embodied.interface import TURNS, Description, Feature, Pose

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
"""Where something is, by its direction in steps of 30 degrees counter-clockwise from the gaze."""


def described(description: Description, pose: Pose | None = None, most: int = 6) -> str:
    """HARI's bag of features as a sentence.

    Args:
      pose: whose surroundings it describes; sides are named then. Directions of other places are left out.
      most: objects to name.
    """
    actions = [f for f in description if f.kind == "action"]
    if actions:
        return "You are there." if actions[0].name == "stop" else "It is the next step from where you are."
    rooms = [f.name.replace("_", " ") for f in description if f.kind == "room"]
    things = [_thing(f, pose) for f in description if f.kind == "object"][:most]
    place = f"{'You are in' if pose else 'Go to a place in'} the {rooms[0]}" if rooms else "There is no room to name"
    return f"{place}, with {_listed(things)}." if things else f"{place}."


def _thing(feature: Feature, pose: Pose | None) -> str:
    name = feature.name.replace("_", " ")
    if pose is None:
        return f"{name} ({feature.distance} m)"
    return f"{name} ({feature.distance} m, {SIDES[(feature.horizontal - pose.turn) % TURNS]})"


def _listed(words: Sequence[str]) -> str:
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]
