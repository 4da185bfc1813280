"""A walk as somebody sees it who asks about it: what was seen and when, names that fit one thing only, and words."""

import copy
import dataclasses
import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assets.json_file import read_toml
from embodied.assets.people.figures import person_of
from embodied.datasets.vqa.scoring import VqaQuestion
from embodied.datasets.vqa.walks import GLIMPSE, Walk, WalkFrame, outline
from embodied.generate.people import CLASS
from embodied.geometry import facing_of, wrap
from embodied.house.contents import STORED
from embodied.house.house import House, Placement
from embodied.house.shapes import footprint
from embodied.language import templates
from embodied.language.clauses import Referent
from embodied.language.lexicon import ROOM_NOUNS, UNFIT, Word, lexicon_of, says
from embodied.language.plain_language import plural, with_article
from embodied.navigation.graph import NavGraph
from embodied.scene.model import loose, takeable

ASKING: Mapping[str, Any] = read_toml(Path(templates.__file__).with_name("vqa.toml"))
"""Type to habit to templates; and 'alike', groups of classes that people do not tell apart, 'unsaid', synonyms that
mislead, 'parts', classes that may be seen in others, and further classes that vqa.toml explains."""
ALIKE: Mapping[str, list[str]] = {
    name: list(dict.fromkeys(c for group in ASKING["alike"] if name in group for c in group))
    for name in itertools.chain(*ASKING["alike"])
}
SAME_COLOUR: Mapping[str, list[str]] = {name: group for group in ASKING["same_colour"] for name in group}
UNLIKE = {*ASKING["unlike"]}
"""Classes and assets that look like other things: nothing is asked about them."""
EASILY_MOVED = ("chair", "stool", "plant", "basket", "box", "bag", "table", "toy", "horse", "suitcase", "stand", " bin")
LEAST_MOVED = 0.3
"""Parts of the names of classes of what is moved between two visits, and its longest side at least, metres."""
FURNITURE, FURNITURE_SHARE, OUTLINE_SHARE = 0.5, 0.015, 0.25
"""Longest side of furniture, metres, and the shares of a frame and of its outline at which it is recognised."""
SMALL_SHARE, SMALL_OUTLINE, HEAD, HEAD_SHARE = 0.008, 0.5, 0.22, 0.7
FROM_BEHIND, OBLIQUE, HIGH = 120.0, 65.0, 1.15
"""Shares of a frame, or else of its outline, at which a small thing is recognised; height of a head with its hair,
metres, and the share of the box around it that a frame must not cut off; degrees off the front from which people, and
what hangs at a wall or is so high, metres, are not recognised."""
LARGER = 1.2
"""How many times larger than other bedrooms the main one is if people know it."""
SEEN_THROUGH = ("transparent", "clear", "coloured", "natural")
"""Colour words that tell nothing apart."""
FLOORS = {1: ("",), 2: ("ground", "upper"), 3: ("ground", "middle", "top")}
"""Storeys, by how many there are."""


class WalkScene:
    """All that questions about a walk rest on, and who asks: `by` draws from `rng`.

    `clear`, `glimpsed`: what is seen clearly, and perhaps, to the first frame that shows it; `rooms`: those that kind
    and storey tell from all others; `elsewhere`: classes that walks through other houses show.
    """

    def __init__(self, walk: Walk, house: House, graph: NavGraph, catalogue: Catalogue) -> None:
        self.walk, self.house, self.graph = walk, house, graph
        self.elsewhere: list[str] = []
        self.lexicon, self.assets = lexicon_of(catalogue), {p.id: catalogue.assets[p.asset] for p in house.placements}
        self.kind, self.by, self.rng = "", templates.SPEAKERS[0], np.random.default_rng(0)
        self._called: dict[str, list[Placement]] = {}
        self._nouns: dict[str, str] = {}
        seen = lambda o, f: recognised(house.placement_by_id[o], f, self.assets[o].support)
        self.clear = _firsts([o for o in f.clear if seen(o, f)] for f in walk.frames)
        self.glimpsed = _firsts([o for o, share in f.shares.items() if share >= GLIMPSE] for f in walk.frames)
        self.movable = movable(house, catalogue)
        self.things = [p for p in house.placements if p.id in self.clear and p.object_class not in UNFIT]
        self.things = [p for p in self.things if not UNLIKE & {p.asset, p.object_class}]
        is_odd = lambda p: self.carrier_of(p).endswith(ASKING["out_of_place"].get(p.object_class, "-"))
        self.things = [p for p in self.things if not is_odd(p)]
        area = lambda kind: max((house.floor(r).area for r in house.rooms if r.kind == kind), default=0.0)
        is_main = area("main_bedroom") > LARGER * area("bedroom")
        same = {"corridor": "hall"} if is_main else {"corridor": "hall", "main_bedroom": "bedroom"}
        kinds = [(same.get(r.kind, r.kind), r.storey) for r in house.rooms]
        self.rooms = {r.id: (r.kind, r.storey) for r, kind in zip(house.rooms, kinds) if kinds.count(kind) == 1}
        self.looked_at = [r for r in dict.fromkeys(walk.rooms) if r in self.rooms]

    def asked(self, kind: str, rng: np.random.Generator) -> "WalkScene":
        """The scene for somebody drawn who asks questions of a type."""
        scene = copy.copy(self)
        scene.kind, scene.rng, scene.by = kind, rng, templates.draw_speaker(rng)
        scene._nouns = {}
        return scene

    def ask(self, answer: str, about: Iterable[str], others: Any = (), fact: str = "", **slots: str) -> VqaQuestion:
        """A question in words. `others` are wrong options, none for a number, or more than are asked (`narrowed`); if
        they have ids, those are last in `about`. `slots` fill the template."""
        templates = [*ASKING[self.kind][""], *ASKING[self.kind].get(self.by.habit, ())]
        text = templates[int(self.rng.integers(len(templates)))].format(**slots)
        options = (answer, *others) if others else ()
        text, about = text[0].upper() + text[1:], tuple(about)
        return VqaQuestion("", self.walk.name, self.kind, text, answer, options, about, fact)

    def shuffled(self, items: Sequence) -> list:
        return [items[i] for i in self.rng.permutation(len(items))]

    def carrier_of(self, p: Placement) -> str:
        """The class of what a thing rests on, and ' shelf' where it does on a shelf of it or lies in it."""
        shelf = " shelf" if (p.surface or "").startswith("shelf") or (p.group or "").startswith(STORED) else ""
        return (self.house.placement_by_id[p.parent].object_class if p.parent else "") + shelf

    def parts(self) -> set[str]:
        """Classes that may be seen as parts of what the walk shows."""
        return {
            c for p in self.house.placements if p.id in self.glimpsed for c in ASKING["parts"].get(p.object_class, ())
        }

    def in_room(self, room: str) -> list[Placement]:
        return [p for p in self.things if p.room == room]

    def room_name(self, room: str) -> str:
        """'kitchen', 'master bedroom', 'bathroom on the upper floor'."""
        (kind, storey), every = self.rooms[room], self.house.rooms
        nouns = ROOM_NOUNS[kind]
        drawn = nouns[0 if self.rng.random() < self.by.plainness else int(self.rng.integers(len(nouns)))]
        noun = self._nouns.setdefault(kind, drawn)  # one person says one word for it
        floor = FLOORS[len(self.house.storeys)][storey]
        return f"{noun} on the {floor} floor" if sum(r.kind == kind for r in every) > 1 else noun

    def noun(self, name: str) -> str:
        """A noun for a class, most often its own name, that stands for no other class and fits all such things of the
        house."""
        there = [self.assets[p.id].synonyms for p in self.house.placements if p.object_class == name]
        fits = lambda noun: (
            noun not in ASKING["unsaid"]
            and all(noun in (*map(str.lower, own), *templates.SPOKEN.things.get(name, ())) for own in there)
        )
        alone = [n for n in self.lexicon.nouns_of[name] if self.lexicon.classes_of[n] == (name,) and plural(n) != n]
        nouns = alone if self.rng.random() < 0.4 else []
        return nouns[int(self.rng.integers(len(nouns)))] if (nouns := [*filter(fits, nouns)]) else name

    def called(self, words: str) -> list[Placement]:
        """All of the house that somebody may take for what words mean."""
        if words not in self._called:
            thing, there = self.lexicon.heard(words.split()), self.house.placements
            self._called[words] = [p for p in there if thing and self._says(p, thing)]
        return self._called[words]

    def _says(self, p: Placement, thing: Referent) -> bool:
        alike = (c for name in thing.classes for c in ALIKE.get(name, ()))
        return says(self.assets[p.id], Referent((*thing.classes, *alike), thing.words))

    def named(self, things: Sequence[Placement]) -> list[tuple[Placement, str]]:
        """Things in a drawn order, with names that fit them alone; without those that have none."""
        return [(p, name) for p in self.shuffled(things) if (name := self.name(p))]

    def name(self, p: Placement) -> str | None:
        """'the red armchair', 'the bed in the guest room': words that a reader takes for this thing alone."""
        for adjectives in (int(self.rng.random() < self.by.colours), 1, 2):
            word = self.lexicon.words_for(self.assets[p.id], self.rng, adjectives=adjectives)
            plain = self.rng.random() < self.by.plainness or word.noun in ASKING["unsaid"]
            if plain or with_article(word.noun).startswith("some "):
                word = Word(p.object_class, tuple(w for w in word.adjectives if w not in p.object_class.split()))
            colours = () if p.object_class in ASKING["colourless"] else self.assets[p.id].colours
            word = Word(word.noun, tuple(w for w in word.adjectives if w in colours and w not in SEEN_THROUGH))
            like = [Word(word.noun, (c,)) for w in word.adjectives for c in SAME_COLOUR.get(w, ()) if c != w]
            meant = [q for k, w in enumerate((word, *like)) for q in self.meant(str(w)) if not k or q != p]
            if with_article(word.noun).startswith("some "):
                return None  # plural in form: no question agrees with it
            if meant == [p]:
                return f"the {word}"
            if p.room in self.rooms and [q for q in meant if q.room == p.room] == [p]:
                return f"the {word} in the {self.room_name(p.room)}"
        return None

    def people(self, anywhere: bool = False) -> list[tuple[Placement, str]]:
        """People who are seen clearly, with names that fit nobody else: 'the man', 'the sitting woman', 'the woman with
        curly black hair in a green dress', 'the man in the kitchen'.

        Args:
          anywhere: names do not say the room.
        """
        shown = [p for p in self.house.placements if p.object_class == CLASS and p.id in self.glimpsed]
        names, every = dict[str, list[str]](), Counter[str]()
        alike = {person_of(q.asset).id for q in shown} & {*ASKING["lookalikes"]}
        for p in shown:
            person, how = person_of(p.asset), "sitting" if "sitting" in self.assets[p.id].tags else "standing"
            words = [person.noun, f"{how} {person.noun}", person.words]
            words += [f"{person.noun} in the {self.room_name(p.room)}"] if p.room in self.rooms and not anywhere else []
            names[p.id], other = [f"the {w}" for w in words], ASKING["taken_for"].get(person.id)
            every.update(names[p.id])
            if other:
                every.update(name.replace(f" {person.noun}", f" {other}") for name in names[p.id])
                names[p.id] = names[p.id][2:]
            if person.id in alike and len(alike) > 1:
                names[p.id] = []
        alone = ((p, [n for n in names[p.id] if every[n] == 1]) for p in shown if p.id in self.clear)
        return self.shuffled([(p, of_one[0]) for p, of_one in alone if of_one])

    def meant(self, words: str) -> list[Placement]:
        """Placements that a reader takes words for, of all that the walk shows."""
        return [q for q in self.called(words) if q.id in self.glimpsed]


def movable(house: House, catalogue: Catalogue) -> frozenset[str]:
    """Things that may be moved or taken away between two visits: furniture that is easily moved and has no lamp, as a
    lamp would show it by its light, and small things."""
    lamps = {light.placement for light in house.lights}
    lamps |= {p.parent for p in house.placements if p.id in lamps}
    is_light = lambda p: any(word in f" {p.object_class}" for word in EASILY_MOVED) and p.parent is None
    easily = {p.id for p in house.placements if is_light(p) and max(p.size) > LEAST_MOVED} - lamps
    return loose(house, catalogue) & easily | takeable(house, catalogue)


def recognised(p: Placement, frame: WalkFrame, support: str = "") -> bool:
    """Tells whether a frame that shows a thing clearly shows enough of it to be known: of people the head, and not from
    behind; what hangs at a wall, or is high and stands there, not from the side."""
    area, share = outline(p, frame.position, frame.yaw, 9.0), frame.shares[p.id]
    aside = abs(bearing(middle(p), facing_of(p.yaw), np.array(frame.position[:2])))
    if p.object_class == CLASS:
        x, y, z = p.position
        head = dataclasses.replace(p, position=(x, y, z + p.size[2] - HEAD), size=(*p.size[:2], HEAD))
        inside, whole = (outline(head, frame.position, frame.yaw, edge) for edge in (1.0, 9.0))
        if inside < HEAD_SHARE * whole or aside > FROM_BEHIND:
            return False
    if aside > OBLIQUE and (support == "wall" or (support == "against_wall" and p.size[2] > HIGH)):
        return False
    if max(p.size) > FURNITURE:
        return share >= max(FURNITURE_SHARE, OUTLINE_SHARE * area)
    return share >= min(SMALL_SHARE, SMALL_OUTLINE * area)


def _firsts(frames: Iterable[Iterable[str]]) -> dict[str, int]:
    first: dict[str, int] = {}
    for k, owners in enumerate(frames):
        first = {**dict.fromkeys(owners, k), **first}
    return first


def gap(a: Placement, b: Placement) -> float:
    """Metres between the nearest points of two boxes."""
    low, high = sorted((a, b), key=lambda p: p.position[2])
    return math.hypot(footprint(a).distance(footprint(b)), max(high.position[2] - low.position[2] - low.size[2], 0.0))


def middle(p: Placement) -> np.ndarray:
    """(2,) metres, seen from above."""
    return np.array(p.position[:2])


def direction(here: np.ndarray, there: np.ndarray) -> float:
    """Radians."""
    return math.atan2(*(there - here)[1::-1])


def bearing(here: np.ndarray, ahead: float, there: np.ndarray) -> float:
    """Degrees to the left of `ahead` (radians) in which `there` lies from `here`, -180 to 180."""
    return math.degrees(wrap(direction(here, there) - ahead))
