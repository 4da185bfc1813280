"""HARI's bag-of-features descriptions of places (dissertation 4.3.5 and appendix E), as arrays and in words."""

import bisect
import functools
import math
from collections import Counter
from collections.abc import Collection, Iterable

import numpy as np

from embodied.assets.catalogue import load_catalogue
from embodied.assets.records import ROOM_KINDS
from embodied.geometry import wrap
from embodied.house.house import Placement
from embodied.interface import STEP, TURNS, Description, Feature, Place, Pose
from embodied.tasks.goals import NOT_OBJECTS

FREQUENT_SHARE = 0.1
"""Share of the object classes that sparse descriptions keep: the text's 100 of about 1,000 (4.3.5)."""
FARTHEST_BIN = 4
"""Largest distance bin: five values, metres rounded down (appendix E)."""


STATE_RADIUS, GOAL_RADIUS = 5.0, 3.0
"""Metres within which objects are described, of where the agent is and of a goal (docs/sources.md, S56)."""
MOST_OBJECTS = 20
"""Table E.2."""


class Describer:
    """rho and rho_A of one or several worlds; what it says depends on the place only.

    Directions are absolute (steps of 30 degrees counter-clockwise from +x, as turns are), because
    a description must mean the same wherever the listener looks (docs/sources.md, S55).
    """

    def __init__(self, frequent: Collection[str]) -> None:
        """`frequent`: the object classes that sparse descriptions keep (the most frequent ones)."""
        self._frequent = frozenset(frequent)
        self._objects: dict[tuple[str, int, float], Description] = {}
        self._said: dict[tuple[str, str, int, int], Description] = {}

    def dense(self, world: Place, node: int, *, goal: bool = False) -> Description:
        """The room's name and at most 20 objects within 5 m (3 m of a goal), nearest first; always the same tuple."""
        key = ("dense", world.house.name, node, goal)
        if key not in self._said:
            self._said[key] = (self._room(world, node), *self._near(world, node, goal))
        return self._said[key]

    def sparse(self, world: Place, node: int, *, goal: bool = False) -> Description:
        """Only frequent objects; the room's name for goals only (4.3.5). Always the same tuple."""
        key = ("sparse", world.house.name, node, goal)
        if key not in self._said:
            objects = tuple(f for f in self._near(world, node, goal) if f.name in self._frequent)
            self._said[key] = (self._room(world, node), *objects) if goal else objects
        return self._said[key]

    def step(self, world: Place, node: int, target: int) -> Description:
        """The next optimal navigation action towards `target`: 'go' with its direction, or 'stop'; always the same
        tuple."""
        after = int(world.graph.next_hop[node, target])
        key = ("step", world.house.name, node, after)
        if key not in self._said:
            offset = np.asarray(world.graph.positions)[after] - np.asarray(world.graph.positions)[node]
            go = Feature("action", "stop") if node == target else Feature("action", "go", *_bins(offset))
            self._said[key] = (go,)
        return self._said[key]

    def pretraining_goal(
        self, world: Place, node: int, start: int, object_class: str, *, rng: np.random.Generator
    ) -> Description:
        """The goal description of a pre-training task (appendix E, second "For d_t^s"; docs/sources.md, S57).

        Dense, or the target object and the room's name, each with probability 1/2; next to the goal
        or at it, the next action is a third possibility of 1/3.
        """
        target = tuple(f for f in self._near(world, node, True) if f.name == object_class)[:1]
        choices = [self.dense(world, node, goal=True), (self._room(world, node), *target)]
        if start == node or int(world.graph.next_hop[start, node]) == node:
            choices.append(self.step(world, start, node))
        return choices[int(rng.integers(len(choices)))]

    def _room(self, world: Place, node: int) -> Feature:
        room = world.house.room_by_id[world.graph.room_of_node[node]]
        return Feature("room", room.kind, vertical=int(room.storey > 0))

    def _near(self, world: Place, node: int, goal: bool) -> Description:
        radius = GOAL_RADIUS if goal else STATE_RADIUS
        key = (world.house.name, node, radius)
        if key not in self._objects:
            self._objects[key] = tuple(f for f, _ in near_placements(world, node, radius))
        return self._objects[key]


def dropped(description: Description, *, rng: np.random.Generator) -> Description:
    """A dense state description with feature sets dropped for pre-training (appendix E).

    Of its M + 1 feature sets (M objects and the room) m are kept, m ~ Uniform(min(5, M + 1), M + 1),
    both ends included, in their order.
    """
    n = len(description)
    m = int(rng.integers(min(5, n), n + 1))
    return tuple(description[i] for i in sorted(rng.choice(n, m, replace=False)))


def near_placements(world: Place, node: int, radius: float) -> list[tuple[Feature, Placement]]:
    """Objects of the node's own room within `radius` metres (3-D, from eye to the middle of the object), nearest first,
    with what each feature set is said of. Nobody describes what is behind a wall."""
    eye, room = np.asarray(world.graph.positions)[node], world.graph.room_of_node[node]
    features = []
    for p in world.house.placements:
        if p.object_class in NOT_OBJECTS or p.room != room:
            continue
        offset = np.asarray(p.position) + [0.0, 0.0, p.size[2] / 2] - eye
        distance = float(np.linalg.norm(offset))
        if distance <= radius:
            features.append((round(distance, 6), p.id, Feature("object", p.object_class, *_bins(offset)), p))
    return [(feature, p) for _, _, feature, p in sorted(features, key=lambda x: x[:2])[:MOST_OBJECTS]]


def frequent_classes(worlds: Iterable[Place], share: float = FREQUENT_SHARE) -> tuple[str, ...]:
    """A share of the object classes of some (training) houses, the most frequent ones, most frequent first."""
    counts = Counter(p.object_class for w in worlds for p in w.house.placements if p.object_class not in NOT_OBJECTS)
    return tuple(
        name for name, _ in sorted(counts.items(), key=lambda x: (-x[1], x[0]))[: math.ceil(share * len(counts))]
    )


def _bins(offset: np.ndarray) -> tuple[int, int, int]:
    """(turn 0..11, tilt -1..1, distance 0..4) of an offset in metres."""
    flat = math.hypot(offset[0], offset[1])
    turn = round(math.atan2(offset[1], offset[0]) / STEP) % TURNS
    tilt = max(-1, min(1, round(math.atan2(offset[2], flat) / STEP)))
    return turn, tilt, min(FARTHEST_BIN, int(np.linalg.norm(offset)))


FEATURE_KINDS = ("object", "room", "action")
ACTION_WORDS = ("go", "stop")
"""Names of features of kind 'action'."""
OWN_WORDS = 4096
"""Numbers for object classes of people's own."""
DESCRIPTION_ROWS = MOST_OBJECTS + 1
"""Most feature sets of a description: a room and its objects."""


def description_rows(description: Description) -> np.ndarray:
    """(ROWS, 5) float32: kind + 1 (0 is padding), name by `word_number`, horizontal, vertical + 1, distance."""
    rows = np.zeros((DESCRIPTION_ROWS, 5), dtype=np.float32)
    for i, f in enumerate(description[:DESCRIPTION_ROWS]):
        rows[i] = FEATURE_KINDS.index(f.kind) + 1, word_number(f.name), f.horizontal, f.vertical + 1, f.distance
    return rows


@functools.cache
def words() -> tuple[str, ...]:
    """The words of descriptions, sorted: actions, room kinds and the catalogue's object classes."""
    return tuple(sorted({*ACTION_WORDS, *ROOM_KINDS, *load_catalogue().classes}))


@functools.cache
def word_number(word: str) -> int:
    """The number of a word, from 1, the same in every process.

    Object classes of people's own models are not in the catalogue; they get a number above all
    others, which two of them may share.
    """
    known = words()
    place = bisect.bisect_left(known, word)
    if place < len(known) and known[place] == word:
        return place + 1
    return len(known) + 1 + _stable(word) % OWN_WORDS


def _stable(word: str) -> int:
    total = 0
    for c in word:
        total = (total * 131 + ord(c)) % 2_147_483_647
    return total


SIDES = (
    *("ahead", "ahead on the left", *3 * ("left",), "behind on the left"),
    *("behind", "behind on the right", *3 * ("right",), "ahead on the right"),
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
    rooms = [f.name.replace("_", " ") + " upstairs" * f.vertical for f in description if f.kind == "room"]
    things = [_thing(f, pose) for f in description if f.kind == "object"][:6]
    place = f"{'You are in' if pose else 'Go to a place in'} the {rooms[0]}" if rooms else "There is no room to name"
    listed = " and ".join([", ".join(things[:-1]), *things[-1:]] if len(things) > 1 else things)
    return f"{place}, with {listed}." if things else f"{place}."


def _thing(feature: Feature, pose: Pose | None) -> str:
    name = feature.name.replace("_", " ")
    if pose is None:
        return f"{name} ({feature.distance} m)"
    return f"{name} ({feature.distance} m, {SIDES[(feature.horizontal - pose.turn) % TURNS]})"


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
            parts.append(f.name.replace("_", " ") + " upstairs" * f.vertical)
        elif f.name == "stop":
            parts.append("you are there")
        else:
            where = side((f.horizontal - turn) * STEP)
            steep = (" down", "", " up")[f.vertical + 1]
            parts.append(f"go{steep} {where}" if f.kind == "action" else f"{f.name} ({where}, {f.distance} m)")
    return ", ".join(parts)
