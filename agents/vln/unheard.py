"""Words that no speaker of the corpus says, for those that all say: how well an agent reads what it never heard."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Collection, Mapping

from embodied.interface import Task

# fmt: off
UNHEARD: Mapping[str, tuple[str, ...]] = {
    "walk": ("tramp", "tread"), "go": ("betake",), "turn": ("rotate", "wheel"), "stop": ("cease", "quit"),
    "wait": ("tarry", "loiter"), "enter": ("penetrate", "infiltrate"), "cross": ("traverse", "span"),
    "head": ("steer", "aim"), "leave": ("depart", "quit"), "pass": ("skirt", "overtake"),
    "continue": ("persist", "persevere"), "face": ("confront",), "bedroom": ("bedchamber", "dormitory"),
    "bathroom": ("lavatory", "powder"), "kitchen": ("kitchenette", "galley"), "corridor": ("aisle", "walkway"),
    "hallway": ("aisle", "walkway"), "hall": ("aisle",), "living": ("sitting",), "door": ("doorframe", "portal"),
    "doorway": ("doorframe", "gateway"), "threshold": ("doorstep", "doorsill"), "rug": ("tapestry", "carpeting"),
    "table": ("tabletop",), "sofa": ("loveseat", "futon"), "bed": ("cot", "bunk"), "chair": ("rocker", "recliner"),
    "cabinet": ("credenza", "locker"), "cupboard": ("locker", "sideboard"), "wardrobe": ("chiffonier",),
    "bookcase": ("bookstand", "bookrack"), "desk": ("escritoire",), "toilet": ("urinal", "latrine"),
    "washbasin": ("handbasin",), "shower": ("sprinkler",), "bathtub": ("jacuzzi", "whirlpool"), "stove": ("hob",),
    "cooker": ("hob", "rangetop"), "fridge": ("freezer", "cooler"), "lamp": ("chandelier", "luminaire"),
    "curtain": ("valance", "drape"), "window": ("windowpane", "skylight"), "picture": ("portrait", "sketch"),
    "painting": ("mural", "fresco"), "plant": ("shrub", "fern"), "mirror": ("reflector",), "blue": ("azure", "navy"),
    "white": ("ivory", "snowy"), "brown": ("tan", "chestnut"), "red": ("crimson", "scarlet"),
    "green": ("lime", "jade"), "grey": ("gray", "ashen"), "black": ("ebony", "jet"), "beige": ("buff", "khaki"),
    "left": ("leftward", "leftwards"), "right": ("rightward", "rightwards"), "straight": ("forwards",),
    "forward": ("onward", "onwards"), "ahead": ("frontward",), "until": ("till",), "into": ("inward",),
    "through": ("thru",), "beside": ("adjacent",), "near": ("nigh",), "then": ("thereafter",), "after": ("upon",),
    "past": ("beyond",),
}
# fmt: on
"""Common words of instructions, and words of about the same meaning, written down before anything was evaluated."""


def unheard(task: Task, known: Collection[str]) -> Task:
    """The task with each common word of its instruction replaced by the first of its like that is not in `known`."""
    other = {word: new for word, many in UNHEARD.items() if (new := next((w for w in many if w not in known), None))}
    return dataclasses.replace(task, request=re.sub("[a-z]+", lambda m: other.get(m[0], m[0]), task.request.lower()))
