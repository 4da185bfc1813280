"""The plainest voice: requests, turns and room names, without landmarks or style; articles, plurals and blanks."""

import itertools
import math
import re
from collections.abc import Sequence

import numpy as np

from embodied.geometry import wrap
from embodied.house.house import House
from embodied.interface import FindObject, Place

LEVEL = 0.1
"""Metres up or down from which a step is one on stairs."""


def floors_away(house: House, here: str, there: str) -> str:
    """' upstairs', ' two floors down', ' on this floor' of one room seen from another; '' in houses of one storey."""
    apart = house.room_by_id[there].storey - house.room_by_id[here].storey
    if len(house.storeys) == 1 or not apart:
        return " on this floor" * (len(house.storeys) > 1)
    way = "up" if apart > 0 else "down"
    return f" {way}stairs" if abs(apart) == 1 else f" two floors {way}"


class PlainLanguage:
    """A `Language` that says the same thing in the same words; draws nothing."""

    def request(self, goal: FindObject, *, rng: np.random.Generator) -> str:
        """'find a mug', 'find a towel in one of the bathrooms'."""
        where = f" in a {goal.room_kind.replace('_', ' ')}" if goal.room_kind else ""
        return f"find {with_article(goal.object_class)}{where}"

    def route(self, world: Place, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        """'turn left and go to the hall . go straight . stop .'; `yaw` is the walker's first direction, radians."""
        positions = np.asarray(world.graph.positions)
        parts = []
        for a, b in itertools.pairwise(path):
            offset = positions[b] - positions[a]
            direction = math.atan2(offset[1], offset[0])
            room = world.graph.room_of_node[b]
            words = turn_words(float(wrap(direction - yaw)))
            if room != world.graph.room_of_node[a]:
                kind = world.house.room_by_id[room].kind
                if world.graph.barred(a, b, world.graph.closed):
                    words += " . open the door and go"
                words += f" into the {kind.replace('_', ' ')}"
            if abs(offset[2]) > LEVEL:
                words += f" {'up' if offset[2] > 0 else 'down'} the stairs"
            parts.append(words)
            yaw = direction
        return " . ".join([*parts, "stop"]) + " ."

    def subgoal(self, words: Sequence[str]) -> str:
        """VNLA's 'hard' sub-goal language (docs/sources.md, S47): 'turn 60 degrees left , go forward 2 steps'.

        Differs from the authors' program in one thing: repeated 'look up' or 'look down' becomes
        'look 60 degrees up' instead of being dropped in silence.
        """
        return " , ".join(_say(word, len(list(group))) for word, group in itertools.groupby(words))


def _say(word: str, times: int) -> str:
    if word == "stop":
        return word
    if word == "forward":
        return "go forward" if times == 1 else f"go forward {times} steps"
    verb = "turn" if word in ("left", "right") else "look"
    return f"{verb} {word}" if times == 1 else f"{verb} {30 * times} degrees {word}"


def heard_subgoal(text: str) -> tuple[str, ...]:
    """The primitive actions in the first sentence of a VNLA instruction; inverse of `subgoal`.

    A plain request ('find a mug') gives ().
    """
    words: list[str] = []
    for phrase in text.split(" . ")[0].split(" , "):
        parts = phrase.split()
        if parts[:2] == ["go", "forward"]:
            words += ["forward"] * (int(parts[2]) if len(parts) > 2 else 1)
        elif parts[:1] in (["turn"], ["look"]):
            words += [parts[-1]] * (int(parts[1]) // 30 if len(parts) > 2 else 1)
        elif parts == ["stop"]:
            words.append("stop")
    return tuple(words)


def turn_words(angle: float) -> str:
    """A turn by `angle` radians (left positive) in words."""
    degrees = math.degrees(angle)
    side = "left" if degrees > 0 else "right"
    if abs(degrees) <= 20:
        return "go straight"
    if abs(degrees) <= 60:
        return f"turn slightly {side} and go"
    if abs(degrees) <= 120:
        return f"turn {side} and go"
    return f"turn around to your {side} and go"


MASSES = ("bread", "butter", "firewood", "tape")
"""Last words of nouns that are not counted."""
SINGULARS = ("atlas", "canvas", "christmas", "cosmos", "gas", "lens", "thermos")
PLURALS = ("bikinis", "chilis", "emus", "kiwis", "menus", "saris", "skis", "taxis", "zucchinis")
"""Last words that end like the others do: in -s, not counted as one; in -us or -is, of more than one."""
SILENT_H = ("heir", "honest", "hono", "hour")
SPOKEN_YOU_OR_WON = re.compile(r"eu|ewe|one\b|once\b|u\b|u[bfkrv][aeiou]|us[aeu]|ut[eio]|uni(?!n|mp|d|r)|usb|uv")
"""Beginnings in a vowel that are spoken with a consonant."""
SPELLED = re.compile(r"[fhlmnrsx]([^aeiouy\s]*$|[^aeiouy]*[\s\d-])|led\b|hdmi\b")
"""Beginnings that are spelled out, and whose first letter is spoken with a vowel: 'an lcd monitor', 'an x-ray'."""


def with_article(noun: str) -> str:
    """'a mug', 'an armchair', 'a row of books'; nouns that are plural in form or not counted get 'some'."""
    head, start = noun.split(" of ")[0].lower().split()[-1], noun.lower()
    singular = head in SINGULARS or head.endswith(("ss", "us", "is")) and head not in PLURALS
    if head in MASSES or head.endswith("s") and not singular:
        return f"some {noun}"
    vowel = start[0] in "aeiou" and not SPOKEN_YOU_OR_WON.match(start)
    return f"an {noun}" if vowel or start.startswith(SILENT_H) or SPELLED.match(start) else f"a {noun}"


IRREGULAR_PLURALS = {"knife": "knives", "loaf": "loaves", "person": "people", "mouse": "mice", "child": "children"}
"""By the end of the word, as are -shelf and -man; others follow the rules of -s, -es and -ies."""
UNCOUNTED = "art artwork bedding earthenware foliage laundry liquid luggage mail milk money paperwork pottery salt soap"
"""Last words of nouns, beside MASSES, that have no plural."""


def plural(noun: str) -> str:
    """'mugs', 'boxes', 'bookshelves', 'rows of books'; nouns that are plural in form or not counted stay."""
    parts = re.fullmatch(r"(.*?)(\w+)((?: (?:of|on|with|in) .*)?)", noun)
    if parts is None or with_article(noun).startswith("some ") or parts[2] in UNCOUNTED.split():
        return noun
    before, last, after = parts.groups()
    if last in IRREGULAR_PLURALS:
        last = IRREGULAR_PLURALS[last]
    elif last.endswith(("shelf", "scarf")):
        last = last[:-1] + "ves"
    elif last in ("man", "woman"):
        last = last[:-2] + "en"
    elif last.endswith(("s", "x", "z", "ch", "sh")):
        last += "es"
    elif last.endswith("y") and last[-2:-1] not in tuple("aeiou"):
        last = last[:-1] + "ies"
    else:
        last += "s"
    return f"{before}{last}{after}"


def detokenized(text: str) -> str:
    """'go into the hall . turn left' becomes 'go into the hall. turn left': no blanks before punctuation.

    So people write; learners read the words themselves, never these.
    """
    return re.sub(r" +([.,;:?!]+)(?=\s|$)", r"\1", text)
