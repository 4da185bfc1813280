"""How clauses sound. A template speaks for one or two clauses at once and is read back by the parser.

Slots: {side} left or right, {room} a room noun, {thing} 'the red sofa', {metres} 'three meters',
{steps} 'three big steps', {nth} 'second', {walk} a verb, {soon} an adverb. A slot is
filled by the first clause of the template that has such a field. Weights: how much each habit of
speech likes a template; a habit that is not named uses 1.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Template:
    kinds: tuple[str, ...]
    """Clause kinds in order: 'turn', 'slight', 'around', 'exit', 'enter', 'door', 'cross', 'forward', 'metres', 'to',
    'past', 'past_side', 'avoid', 'notice', 'stop_by', 'stop_in', 'stop_here'."""
    text: str
    habit: str = ""
    """'terse', 'chatty', 'formal', or '' for everybody."""


def _all(kinds: str, *lines: str) -> list[Template]:
    """Templates of one clause sequence; a line may begin with '<habit>: '."""
    found = []
    for line in lines:
        habit, _, text = line.rpartition(": ")
        found.append(Template(tuple(kinds.split()), text, habit))
    return found


TEMPLATES: tuple[Template, ...] = (
    *_all("turn", "turn {side}", "take a {side}", "turn to your {side}", "make a {side} turn", "terse: go {side}",
          "chatty: hang a {side}", "formal: rotate ninety degrees to the {side}", "face {side}", "turn to the {side}",
          "chatty: you want to turn {side}", "swing {side}", "chatty: make a {side}", "turn {side} {soon}",
          "turn {side} {soon}", "{soon} turn {side}", "go {side} {soon}",
          "chatty: hook a {side}", "take a hard {side}", "formal: make a quarter turn to the {side}",
          "formal: pivot to the {side}", "take the turning on the {side}"),
    *_all("slight", "turn slightly {side}", "bear {side}", "veer {side}", "keep {side}", "turn a little to the {side}",
          "chatty: turn just a bit to your {side}", "go slightly to the {side}",
          "formal: rotate slightly to the {side}",
          "angle {side}", "turn half {side}", "drift {side}",
          "chatty: ease over to the {side}", "curve to the {side}", "take a slight {side}", "lean {side}",
          "formal: adjust your heading a little to the {side}"),
    *_all("around", "turn around", "turn back", "turn all the way around", "chatty: do a complete turnaround",
          "face the other way", "terse: about face", "formal: rotate one hundred and eighty degrees",
          "chatty: do a full one eighty", "reverse direction", "turn right around", "make a u-turn",
          "spin around", "chatty: spin yourself round", "formal: reverse your heading", "double back"),
    *_all("exit", "leave the {room}", "exit the {room}", "{walk} out of the {room}", "go out of the {room}",
          "step out of the {room}",
          "head out of the {room}", "chatty: get out of the {room}", "terse: out of the {room}",
          "formal: depart from the {room}",
          "walk out the door of the {room}", "go through the door and out of the {room}", "come out of the {room}",
          "formal: vacate the {room}", "emerge from the {room}", "find your way out of the {room}",
          "slip out of the {room}",
          "chatty: get yourself out of the {room}"),
    *_all("enter", "enter the {room}", "{walk} into the {room}", "go into the {room}", "step into the {room}",
          "head into the {room}",
          "go through the doorway into the {room}", "walk through the door to the {room}", "terse: into the {room}",
          "continue into the {room}", "chatty: make your way into the {room}", "formal: proceed into the {room}",
          "move into the {room}", "walk straight into the {room}", "pass through the doorway to the {room}",
          "chatty: pop into the {room}", "cross the threshold into the {room}", "come into the {room}",
          "go through the opening to the {room}", "advance into the {room}", "chatty: wander into the {room}",
          "chatty: duck into the {room}", "slip into the {room}", "chatty: hop into the {room}",
          "cross over into the {room}",
          "go through the entrance to the {room}", "let yourself into the {room}"),
    *_all("door", "take the {nth} door on your {side} into the {room}",
          "go through the {nth} door on the {side} into the {room}",
          "enter the {room} through the {nth} door on your {side}",
          "go into the {room} which is the {nth} door on the {side}",
          "terse: {nth} door on the {side} into {room}",
          "walk through the {nth} doorway on your {side} to get to the {room}",
          "chatty: count the doors on your {side} and take the {nth} one into the {room}",
          "formal: proceed through the {nth} doorway on the {side} into the {room}"),
    *_all("cross", "{walk} through the {room}", "cross the {room}", "continue along the {room}", "go across the {room}",
          "keep walking through the {room}", "head down the {room}", "follow the {room}", "formal: traverse the {room}",
          "stay in the {room} and keep going", "walk the length of the {room}", "terse: along the {room}",
          "proceed along the {room}",
          "walk to the far end of the {room}", "go all the way down the {room}", "cut across the {room}",
          "formal: pass along the entire {room}", "cover the whole length of the {room}"),
    *_all("forward", "{walk} straight ahead", "go straight", "walk forward", "continue straight",
          "keep going straight", "move ahead",
          "head straight on", "terse: straight", "chatty: just keep going", "formal: proceed straight ahead",
          "carry on ahead",
          "continue forward", "go ahead", "walk on", "keep on walking", "chatty: keep heading the same way",
          "stride ahead",
          "walk a few paces", "go a little way", "continue a short distance", "take a few steps forward",
          "chatty: go on for a bit", "chatty: follow your nose", "formal: maintain your present direction",
          "formal: maintain this heading", "go on in the same direction", "push on ahead", "carry straight on",
          "take a couple of steps"),
    *_all("metres", "{walk} {metres}", "go forward about {metres}", "walk straight for {metres}", "move ahead {metres}",
          "take {steps} forward", "terse: {metres} ahead", "chatty: go on for maybe {metres} or so",
          "formal: proceed approximately {metres}", "continue for {metres}", "go roughly {metres}",
          "cover {metres}", "go another {metres}", "walk a distance of {metres}", "formal: advance by {metres}",
          "chatty: give it {metres} or thereabouts"),
    *_all("to", "{walk} to {thing}", "go to {thing}", "{walk} up to {thing}", "head for {thing}",
          "head towards {thing}", "{walk} toward {thing}",
          "continue until you reach {thing}", "go over to {thing}", "move to {thing}", "terse: to {thing}",
          "terse: toward {thing}", "go straight to {thing}",
          "chatty: make your way over to {thing}", "formal: proceed to {thing}", "keep going until you get to {thing}",
          "walk until you are beside {thing}", "approach {thing}", "aim for {thing}",
          "chatty: you will see {thing} so walk over to it",
          "go as far as {thing}", "walk straight to {thing}", "advance to {thing}", "step over to {thing}",
          "walk in the direction of {thing}", "chatty: look for {thing} and go there",
          "make for {thing}", "chatty: make a beeline for {thing}", "find {thing} and walk up to it",
          "formal: direct yourself to {thing}", "come up to {thing}", "set off for {thing}", "get to {thing}",
          "walk until {thing} is within reach", "chatty: bring yourself over to {thing}", "close in on {thing}"),
    *_all("past", "{walk} past {thing}", "go past {thing}", "pass {thing}", "continue past {thing}",
          "{walk} by {thing}", "pass by {thing}",
          "terse: past {thing}", "go around {thing}", "chatty: you will go past {thing}",
          "formal: proceed past {thing}",
          "move past {thing}", "walk alongside {thing}", "head past {thing}", "keep going beyond {thing}",
          "leave {thing} behind you", "skirt {thing}", "slip past {thing}", "chatty: squeeze by {thing}",
          "edge past {thing}",
          "formal: bypass {thing}"),
    *_all("past_side", "{walk} past {thing} on your {side}", "pass {thing} on the {side}",
          "go past {thing} on your {side}",
          "keep {thing} on your {side}", "walk along with {thing} to your {side}",
          "continue past {thing} on the {side}",
          "chatty: you will have {thing} on your {side} as you walk", "formal: proceed with {thing} on the {side}",
          "leave {thing} to your {side}", "terse: past {thing} on {side}", "stroll by {thing} on your {side}",
          "formal: ensure that {thing} remains on your {side}", "let {thing} pass on your {side}",
          "have {thing} beside you on the {side} as you go"),
    *_all("avoid", "do not go into the {room}", "don't enter the {room}", "chatty: don't go in the {room} though",
          "if you end up in the {room} you went too far", "ignore the {room}", "not the {room}",
          "formal: avoid the {room}",
          "skip the {room}", "steer clear of the {room}", "chatty: don't bother with the {room}",
          "formal: refrain from entering the {room}", "stay out of the {room}",
          "chatty: if you hit the {room} you overshot"),
    *_all("notice", "you will see {thing}", "you should see {thing}", "notice {thing}", "you can see {thing} ahead",
          "look out for {thing}",
          "{thing} will be in view", "chatty: you can't miss {thing}", "formal: observe {thing}", "terse: note {thing}",
          "chatty: you'll spot {thing}", "{thing} should be nearby", "mind {thing}",
          "chatty: watch out for {thing} by the way",
          "formal: {thing} is visible ahead", "chatty: I love {thing} over there",
          "keep an eye out for {thing}", "chatty: you'll catch sight of {thing}",
          "formal: {thing} serves as a landmark",
          "chatty: check out {thing}", "chatty: {thing} is pretty hard to miss"),
    *_all("stop_by", "stop next to {thing}", "stop by {thing}", "wait by {thing}", "stop in front of {thing}",
          "wait near {thing}",
          "stop beside {thing}", "stop at {thing}", "chatty: you are done when you are right by {thing}",
          "formal: halt beside {thing}", "stand next to {thing} and wait", "stop when you are near {thing}",
          "come to a stop at {thing}", "chatty: {thing} is where you want to stop", "stop once you reach {thing}",
          "your spot is beside {thing}", "pause at {thing}", "wait there at {thing}", "stop close to {thing}",
          "finish near {thing}",
          "halt by {thing}", "chatty: park yourself by {thing}", "come to rest by {thing}", "linger by {thing}",
          "chatty: hang out by {thing}", "stay put near {thing}", "formal: conclude your walk at {thing}",
          "formal: your journey ends at {thing}", "chatty: plant yourself beside {thing}", "remain near {thing}",
          "take up position by {thing}"),
    *_all("stop_in", "stop in the {room}", "wait in the {room}", "stop just inside the {room}",
          "wait once you are in the {room}",
          "formal: halt inside the {room}", "terse: stop inside {room}", "chatty: that's it once you are in the {room}",
          "stop when you are in the {room}", "your destination is in the {room}", "end up in the {room}",
          "remain in the {room}", "chatty: hang out in the {room}", "formal: your journey concludes in the {room}",
          "come to rest inside the {room}", "stay put in the {room}"),
    *_all("stop_here", "stop there", "wait there", "stop", "chatty: and that's your spot",
          "formal: halt at this spot", "wait here",
          "that is where you stop", "stay there", "chatty: you made it",
          "you have arrived", "stay put", "formal: remain at this position", "formal: this concludes the route",
          "chatty: and voila", "this is your destination", "chatty: bingo", "terse: done", "terse: halt",
          "chatty: end of the line"),
    *_all("turn enter", "turn {side} into the {room}", "take a {side} into the {room}", "go {side} into the {room}",
          "chatty: hang a {side} into the {room}", "terse: {side} into {room}", "enter the {room} on your {side}",
          "walk into the {room} to your {side}", "go through the door on the {side} into the {room}"),
    *_all("turn to", "turn {side} and walk to {thing}", "turn {side} toward {thing}", "go {side} to {thing}",
          "head {side} towards {thing}",
          "terse: {side} to {thing}", "walk to {thing} on your {side}"),
    *_all("slight to", "veer {side} toward {thing}", "bear {side} to {thing}"),
    *_all("turn past", "turn {side} past {thing}", "turn {side} at once and pass {thing}"),
    *_all("around exit", "turn around and leave the {room}", "turn back and walk out of the {room}"),
    *_all("exit turn", "leave the {room} and turn {side} at once", "exit the {room} and go {side}",
          "walk out of the {room} then turn {side}",
          "chatty: head out of the {room} and hang a {side}", "step out of the {room} and face {side}"),
    *_all("exit enter", "go from the {room} into the {other}", "leave the {room} and enter the {other}",
          "walk out of the {room} into the {other}",
          "formal: proceed from the {room} to the {other}"),
    *_all("to stop_here", "walk to {thing} and stop", "go to {thing} and wait there", "stop when you reach {thing}",
          "walk up to {thing} then stop",
          "go to {thing} and stop there"),
    *_all("enter stop_here", "enter the {room} and stop", "walk into the {room} and wait there",
          "step into the {room} and stop just inside"),
)
"""Every way of speaking. 'exit enter' names two rooms: {room} is left, {other} entered."""

FILLERS: dict[str, tuple[str, ...]] = {
    "chatty": ("okay so", "alright", "so", "basically", "well", "you know", "let's see", "hmm", "oh", "alrighty",
               "sure thing", "no problem", "no worries", "hey there", "happy to help", "let me think"),
    "formal": ("please", "from here", "from your current position", "to begin", "kindly", "certainly",
               "allow me to explain"),
    "terse": (),
    "": ("from where you are", "first", "starting here", "to start", "now"),
}
"""Openings by habit; they mean nothing."""
HEDGES = ("I think", "I believe", "if I remember correctly", "probably", "I guess", "as far as I recall",
"if I'm not mistaken", "I'm pretty sure",
          "as far as I know", "presumably", "unless I'm wrong", "from memory", "I reckon", "more or less",
          "I suppose", "perhaps",
          "off the top of my head")
"""Signs of doubt; they mean nothing."""
LINKS: dict[str, tuple[str, ...]] = {
    "chatty": ("and then", "and then", "then", "then", "and", "after that", "next"),
    "formal": ("then", "then", "and then", "next", "subsequently", "following that", "afterwards"),
    "terse": ("then", "and", ""),
    "": ("and", "and", "and", "then", "then", "and then", "and then", "next", "after that"),
}
"""What joins two clauses, by habit."""
ARRIVED_LINKS: dict[str, tuple[str, ...]] = {
    "chatty": ("once you've done that", "from there", "when you get there"), "formal": ("from this point",
    "upon arrival"),
    "terse": (), "": ("from there", "once there", "at that point"),
}
"""What may join them besides, where the first has led somewhere."""
SLIPS = {
    "straight": "strait", "until": "untill", "through": "thru", "hallway": "hall way", "towards": "torwards",
    "past": "passed",
    "beside": "besides", "corridor": "coridor", "kitchen": "kichen", "bedroom": "bed room", "bathroom": "bath room",
    "continue": "contine", "slightly": "slighty", "around": "arround", "doorway": "door way", "reach": "reech",
    "forward": "foward",
    "entrance": "enterance", "immediately": "immediatly", "table": "tabel", "chair": "chiar", "cabinet": "cabnet",
    "mirror": "miror",
}
"""Harmless slips of the keyboard."""
VERBS = (
    "walk", "go", "head", "continue", "move", "step", "proceed", "carry on", "stroll", "travel", "make your way",
    "keep walking", "press on", "advance",
)
"""What {walk} may be, the plainest first."""
PLAYFUL = ("wander", "amble", "saunter", "march", "stride", "mosey", "cruise", "scoot", "trot", "venture", "shuffle",
"hike", "journey", "drift",
           "waltz", "breeze", "glide", "plod", "trek", "zip", "trundle")
"""What it may be besides with chatty people."""
SOON = ("immediately", "at once", "straight away", "directly", "sharply", "instantly", "without delay",
"without hesitation", "promptly", "abruptly",
        "right away")
"""What {soon} may be."""
PRAISE = (
    "nice", "lovely", "pretty", "fancy", "stylish", "neat", "old", "modern", "simple", "elegant", "beautiful",
    "charming", "plain", "tidy",
    "funny", "interesting", "classy", "vintage", "handsome", "gorgeous", "ordinary", "cute", "rustic", "sleek",
    "quaint", "elaborate",
    "expensive", "cheap", "fashionable", "trendy", "contemporary", "traditional", "classic", "antique", "retro",
    "dusty", "spotless",
    "decorative", "typical", "unusual", "odd", "quirky", "weird", "amazing", "awesome", "wonderful", "splendid",
    "pleasant", "attractive",
    "basic", "standard", "regular", "well-kept", "brand-new", "designer", "handmade", "impressive", "eye-catching",
    "striking", "subtle",
    "minimalist", "ornate", "posh", "snazzy", "delightful", "exquisite", "familiar", "graceful",
    "swanky", "dated", "drab", "cheerful", "smart", "fine", "superb", "fabulous", "fantastic", "marvelous",
    "peculiar", "curious", "tasteful",
    "artsy", "scruffy", "shabby", "pristine", "immaculate", "adorable",
)
"""Adjectives that say nothing which could be checked; chatty people like them."""
SEAT_PRAISE = ("cozy", "comfy", "comfortable", "inviting", "homely", "soft", "padded", "plush")
"""More of them for what one sits or lies on."""
BODY_PRAISE = (
    "sturdy", "solid", "heavy", "bulky", "chunky", "boxy", "rounded", "slim", "slender", "imposing", "humble",
    "practical", "handy", "useful",
    "polished", "worn", "weathered", "shiny", "gleaming", "glossy", "dainty", "delicate", "angular", "curvy",
    "sizeable",
)
"""More of them for what stands on its own and has some depth."""
SIZES = ("large", "big", "huge", "massive", "small", "little", "compact", "tiny", "tall", "high", "long", "wide",
"low", "narrow", "thin")
"""Adjectives of size; they are true when said, and nobody relies on them."""
ORDINALS = ("zeroth", "first", "second", "third", "fourth", "fifth")
NUMBERS = ("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
