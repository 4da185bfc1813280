"""A study: who does what with whom, how often, and what people are told, from a STUDY.toml; addresses of its page."""

import ipaddress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, urlsplit

from embodied.assets.json_file import read_toml
from embodied.assets.people import people
from embodied.records import RecordError, from_plain

PART_KINDS = ("play", "rate", "describe")
MOVES = ("viewpoints", "drive")
PERSON = "person"
LONGEST_TEXT = 2000
"""Characters that a person may send at once."""


class StudyError(ValueError):
    """A STUDY.toml that cannot be run."""


@dataclass(frozen=True)
class Question:
    """A question that the agent may choose."""

    text: str
    price: float = 0.0
    """The cost, in points of the study; written down as the cost of the step."""


@dataclass(frozen=True)
class StudyPart:
    """One kind of thing that people are asked to do."""

    name: str
    kind: str = "play"
    """'play' an episode, 'rate' one with stars, or 'describe' in words what was done in it."""
    split: str = "val_seen"
    """Of the data set: whose tasks are played."""
    tasks: int = 5
    """The first so many tasks of the split."""
    answers: int = 1
    """Finished episodes, or judgements, that are wanted of each."""
    per_person: int = 3
    """Most that one person does of this part."""
    agent: str = PERSON
    """Who acts: 'person', a policy that the server knows ('shortest', 'shipped', 'llm', ...) or 'module:Class'."""
    assistant: str = PERSON
    """Who answers: 'person', 'simulated', 'llm', 'none' or 'module:Class'."""
    moves: str = "viewpoints"
    """How a person who acts moves: from one of the 'viewpoints' to the next, or 'drive', with live pictures."""
    figure: str = ""
    """Who is steered by a person who drives, and seen from behind, in lit pictures: somebody of docs/people.md."""
    questions: tuple[Question, ...] = ()
    """Questions that a person may choose; with `free_question`, own words besides."""
    free_question: bool = True
    budget: int | None = None
    """Most questions in an episode; None leaves it to the task."""
    show_way: bool = True
    """The assistant sees the shortest way on the plan."""
    way: int = 0
    """Only so many steps of it, which answers then speak of; 0 is all."""
    show_goal: bool = True
    """The assistant sees the goal on the plan."""
    send_pictures: bool = True
    """The assistant may show the view of a viewpoint, chosen on the plan."""
    of: str = ""
    """The episodes that are judged: those of this part of the study; or, with `episodes`, of a file."""
    episodes: str = ""
    """A file episodes*.jsonl that `embodied evaluate` or a study wrote."""
    ask: str = ""
    """The question to raters and describers."""
    advice: str = ""
    """Shown to everybody in this part, before it begins."""

    def __post_init__(self) -> None:
        numbers = {"tasks": self.tasks, "answers": self.answers, "per_person": self.per_person}
        if low := [n for n, v in numbers.items() if v < 1]:
            raise ValueError(f"{low[0]} should be at least 1")
        if self.kind not in PART_KINDS:
            raise ValueError(f"kind should be one of {list(PART_KINDS)}, got {self.kind!r}")
        if self.kind == "play" and not self.roles:
            raise ValueError("agent or assistant should be 'person'; nobody would take part")
        if self.moves not in MOVES or (self.moves == "drive" and (self.kind != "play" or self.agent != PERSON)):
            raise ValueError(f"moves should be one of {list(MOVES)}, and only people drive; got {self.moves!r}")
        if self.figure and (self.figure not in people() or self.moves != "drive"):
            raise ValueError(f"figure should be one of {sorted(people())} where moves is 'drive', got {self.figure!r}")
        if self.kind != "play" and bool(self.of) == bool(self.episodes):
            raise ValueError("a part that judges needs either `of`, a part of this study, or `episodes`, a file")
        if PERSON in (self.agent,) and self.assistant != "none" and not (self.questions or self.free_question):
            raise ValueError("nothing can be asked: give `questions`, or leave `free_question` true")

    @property
    def roles(self) -> tuple[str, ...]:
        """Roles that people fill: 'agent', 'assistant', or 'rater', 'describer'."""
        if self.kind != "play":
            return ("rater" if self.kind == "rate" else "describer",)
        return tuple(r for r, who in (("agent", self.agent), ("assistant", self.assistant)) if who == PERSON)


@dataclass(frozen=True)
class Study:
    title: str
    data: str
    """The data set that tasks and houses come from; relative to the file."""
    consent: str
    """The text that people agree to, in paragraphs."""
    parts: tuple[StudyPart, ...]
    contact: str = ""
    thanks: str = "Thank you for taking part."
    seed: int = 0
    practice: bool = True
    """Everybody plays one episode that does not count before their first in a role."""
    people: int = 500
    """Most people that may join."""
    wait_seconds: float = 180.0
    """How long somebody waits for a partner; afterwards they go on without, or are thanked."""
    absent_seconds: float = 60.0
    """How long a partner waits for somebody who lost the connection."""
    idle_seconds: float = 180.0
    """How long a partner waits for somebody who does nothing."""
    pace: float = 1.0
    """Seconds between the steps of a bot that a person watches."""
    pictures: str = "unlit"
    """How panoramas are drawn that the data set does not hold: unlit, fast, normal, ..."""
    size: int = 768
    """Side of a panorama's face, pixels. Where the data set's are smaller, a page would show them blurred, and sharper
    ones are drawn."""

    def __post_init__(self) -> None:
        names = [p.name for p in self.parts]
        if not names or len(set(names)) < len(names):
            raise ValueError(f"parts should be at least one, each with a name of its own, got {names}")
        for part in self.parts:
            if part.of and part.of not in [p.name for p in self.parts if p.kind == "play"]:
                raise ValueError(f"part {part.name!r} judges {part.of!r}, which is no part that is played")


def load_study(path: Path) -> Study:
    """The study of a STUDY.toml.

    Raises:
      StudyError: no TOML, or not a study; says where.
    """
    try:
        return from_plain(Study, read_toml(path), "study")
    except RecordError as e:
        raise StudyError(str(e) if str(e).startswith(str(path)) else f"{path}: {e}") from e


DEFAULT_PORTS = {"http": 80, "https": 443}
"""Ports that browsers leave out, by scheme."""


def page_address(text: str) -> str:
    """An address as a browser spells it, without a slash at its end: 'https://study.example.org/kitchen'.

    Raises:
      ValueError: not the address of a page.
    """
    if "://" not in text:
        raise ValueError(f"should begin with https:// or http://, got {text!r}; write https://{text.lstrip('/')}")
    try:
        parts = urlsplit(text.strip())
        host, port = _host(parts.hostname or ""), parts.port
    except ValueError as e:
        raise ValueError(f"should be an address such as https://study.example.org, got {text!r} ({e})") from e
    if parts.scheme not in DEFAULT_PORTS or not host or "@" in parts.netloc or parts.query or parts.fragment:
        raise ValueError(f"should be an address such as https://study.example.org, got {text!r}")
    shown = "" if port in (None, DEFAULT_PORTS[parts.scheme]) else f":{port}"
    return f"{parts.scheme}://{host}{shown}{quote(parts.path, safe='/%:@!$&()*+,;=~')}".rstrip("/")


def origin_of(address: str) -> str:
    """Scheme, host and port of an address, as browsers send them in the header Origin.

    Raises:
      ValueError: not the address of a page.
    """
    parts = urlsplit(page_address(address))
    return f"{parts.scheme}://{parts.netloc}"


def _host(name: str) -> str:
    """A host's name or number as browsers send it: IPv6 in brackets, other letters than English ones in Punycode."""
    if ":" in name:
        return f"[{ipaddress.IPv6Address(name).compressed}]"
    return name.encode("idna").decode().lower()
