"""Questions in people's own words to the assistant of Ask-v0: the typed question that each amounts to."""

from __future__ import annotations

import re

from embodied.interface import Intention

LONG_WORDS = (
    *("which", "where", "route", "direction", "directions", "describe", "description", "correct", "colour", "color"),
    *("material", "kitchen", "bathroom", "bedroom", "hallway", "corridor", "living", "beside"),
)
"""Words that are read with one letter wrong, missing, too many or in its neighbour's place."""
SHORT_WORDS = {"teh": "the", "ths": "this", "tihs": "this", "hwo": "how", "waht": "what", "wat": "what", "taht": "that"}
"""Frequent slips in words that are too short for that."""
ROOM = (
    r"(?:(?:bath|bed|(?:living|dining|laundry|store|play|main bed) ?)?rooms?|kitchens?(?! (?:sink|cabinet|table|chair))"
    r"|hall(?:way)?s?|corridors?|toilets?|stud(?:y|ies)|offices?|pantry|closet|garage|workshop|entrance)"
)
COLOUR = (
    "(?:red|green|blue|black|white|gr[ea]y|brown|yellow|orange|pink|purple|beige|dark|light"
    "|wood(?:en)?|metal|leather|plastic|glass|stone|fabric|oak|steel)"
)
SIDE = "(?:left|right|straight(?: ahead| on)?|ahead|forwards?|back)"
PLACE = "(?:part|area|floor|storey|place)"
PATTERNS = (
    (
        Intention.ROUTE,
        r"(?<!by )the (?:\w+ )?way|(?:which|what) way|route|path|directions?|keep going|left or right(?! one)",
        r"how (?:to|(?:do|can|should|could|would) (?:i|we|you)) (?:(?:\w+ )?(?:get|go|reach)|\w+ there)",
        r"where (?:(?:do|should|must|can|shall) (?:i|we) (?:go|turn|head|walk)|(?:now|to|next)$)",
        f"(?:turn|go|walk|head) (?:{SIDE}|through|upstairs|downstairs)|^{SIDE}$|(?:guide|lead|take|bring|navigate) me",
        "which (?:door|exit|stairs|hall(?:way)?|corridor) (?:do|should|shall) i",
    ),
    (
        Intention.APPEARANCE,
        r"looks? like|does (?:it|the \w+) look|colou?r|material|made (?:of|from|out)|size|shape|describe|description",
        f"how (?:big|large|small|wide|tall|high|long)|recogni[sz]e|what (?:kind|type|sort) of(?! {ROOM})",
        rf"is (?:it|the \w+|the \w+ \w+) {COLOUR}$",
    ),
    (
        Intention.DISAMBIGUATE,
        f"which(?! (?:{ROOM}|{PLACE}|side|door|exit|stairs)\\b)",
        rf"what (?!kind\b|{ROOM})\w+ (?:do|did) you mean|(?:left|right) \w+ or|left or right one|first or",
        r"one\b.* or .*\bone|one (?:on (?:the|my|your) (?:left|right)|closer|nearer|closest|nearest)",
        "(?:left|near|closer|closest|nearest|far|farther|farthest|first|second|third|last|other) one",
    ),
    (Intention.REGION, f"(?:which|what|right|wrong|correct|same|kind of) {ROOM}"),
    (
        Intention.CONFIRM,
        "(?:is|was) (?:this|that)|(?:this|that) (?:is|be|one)|(?:it|mean|about) (?:this|that)|confirm|correct",
        "am i (?:there|at|in front|next to|standing|close)|stop (?:here|now)|the target|the one$",
        r"(?:did|have) i (?:\w+ )?(?:find|found|reach|reached|got)",
        "(?<!all )(?<!on the )(?<!on my )right",
    ),
    (
        Intention.REGION,
        f"where(?:s|abouts)?|(?:in|near|or)(?: the| a)? {ROOM}|(?:the|this|same|another|different|other) {ROOM}$",
        f"^{ROOM}(?: or {ROOM})?$|(?:this|same) {ROOM}|the room with|in here|location|upstairs|downstairs",
        f"(?:which|what) {PLACE}|{PLACE} (?:of|should)",
    ),
    (Intention.APPEARANCE, f"{COLOUR}|big|large|small|tall|wide|next to|near|beside|close to"),
)
"""By which words, and only whole ones, a question is understood; the first that fits counts."""


def intention_of(question: str) -> Intention | None:
    """The typed question that one in free words amounts to; None where it is understood as none."""
    words = (_spelt(w) for w in re.findall(r"[a-z]+", re.sub("['’]", "", question.lower())))
    text = re.sub(r"\bwere (?=(?:is|are|can|do|should)\b)", "where ", " ".join(words))
    return next((i for i, *some in PATTERNS if re.search(rf"\b(?:{'|'.join(some)})(?!\w)", text)), None)


def _spelt(word: str) -> str:
    """The word that somebody meant who typed `word`."""
    if word in SHORT_WORDS:
        return SHORT_WORDS[word]
    near = (w for w in LONG_WORDS if w[0] == word[0] and _is_near(word, w))
    return word if word == "were" else next(near, word)


def _is_near(a: str, b: str) -> bool:
    """Tells whether one letter added, dropped, replaced or swapped with the next makes `b` of `a`."""
    if abs(len(a) - len(b)) > 1:
        return False
    k = next((i for i, (x, y) in enumerate(zip(a, b)) if x != y), min(len(a), len(b)))
    swapped = a[k : k + 2] == b[k : k + 2][::-1] and a[k + 2 :] == b[k + 2 :]
    return swapped or b[k + 1 :] in (a[k:], a[k + 1 :]) or b[k:] == a[k + 1 :]
