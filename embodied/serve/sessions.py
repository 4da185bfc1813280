"""Who takes part, what each does next, and with whom: a state that follows from the log of events.

`Sessions.apply` is the only way to change it, for events as they happen and for those of the log after a restart. What
is not in the log, who is connected and who is ready, begins anew then.
"""

import secrets
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from embodied.envs.base import ActionError
from embodied.interface import Episode
from embodied.kinds.metrics import strict_success
from embodied.serve.game import Game, Table
from embodied.serve.store import Event
from embodied.serve.study import LONGEST_TEXT, Study, StudyPart

GONE_SECONDS = 1800.0
"""After which a task is given to others when somebody who plays alone does not come back."""
STARS = 5


@dataclass(eq=False)
class Person:
    """Somebody who takes part, known by a random id."""

    id: str
    key: str
    """Digest of the token in their link."""
    consented: bool = False
    ended: str | None = None
    """'done', 'left': asked to stop, 'nothing': no task was left."""
    roles: dict[str, str] = field(default_factory=dict)
    """StudyPart to role."""
    practised: set[str] = field(default_factory=set)
    """Roles."""
    done: Counter[str] = field(default_factory=Counter)
    """By part."""
    units: set[tuple[str, str]] = field(default_factory=set)
    """(part, unit) that they have begun, and do not do again."""
    without: set[str] = field(default_factory=set)
    """Parts for which no partner was found."""
    game: str | None = None
    viewing: tuple[str, str] | None = None
    """(part, unit) that they judge."""
    messages: set[str] = field(default_factory=set)
    last: str | None = None
    """How the last episode ended: 'found', 'missed', 'broken', 'judged'."""
    # Not in the log:
    connected: int = 0
    away_since: float = 0.0
    ready: bool = False
    waiting: tuple[str, float] | None = None
    """For a partner: the part, and since when."""


@dataclass(eq=False)
class Sessions:
    study: Study
    tables: Mapping[str, Table]
    """Of the parts that are played."""
    viewed: Mapping[str, Sequence[Episode]]
    """StudyPart that judges to the episodes of its file."""
    people: dict[str, Person] = field(default_factory=dict)
    by_key: dict[str, Person] = field(default_factory=dict)
    games: dict[str, Game] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    """Digests of invitations that were taken up."""
    judgements: list[Event] = field(default_factory=list)
    finished: Callable[[Game], None] = lambda game: None
    """Called with every game that ended as an episode."""
    judged: Callable[[Event], None] = lambda event: None
    """Called with every judgement."""
    _counts: defaultdict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    """StudyPart to how many have begun or done each unit."""
    _episodes: defaultdict[str, list[tuple[str, Game]]] = field(default_factory=lambda: defaultdict(list))

    # Changing ------------------------------------------------------------------------------------

    def apply(self, event: Event) -> None:
        """Take in one event.

        Raises:
          ActionError: not possible now; nothing has changed.
        """
        getattr(self, f"_{event.kind}", self._play)(event)
        if event.person and event.message:
            self.people[event.person].messages.add(event.message)

    def _joined(self, event: Event) -> None:
        person = Person(event.body["person"], event.body["key"])
        self.people[person.id] = self.by_key[person.key] = person
        if event.body.get("invitation"):
            self.used.add(event.body["invitation"])

    def _consented(self, event: Event) -> None:
        self.people[event.person or ""].consented = True

    def _ended(self, event: Event) -> None:
        person = self.people[event.body["person"]]
        person.ended, person.game = event.body["why"], None
        self._dropped(event)

    def _dropped(self, event: Event) -> None:
        """They do not judge what they were shown; others may."""
        person = self.people[event.body["person"]]
        if person.viewing is not None:
            self._counts[person.viewing[0]][person.viewing[1]] -= 1
            person.viewing = None

    def _role(self, event: Event) -> None:
        self.people[event.body["person"]].roles[event.body["part"]] = event.body["role"]

    def _alone(self, event: Event) -> None:
        self.people[event.body["person"]].without.add(event.body["part"])

    def _began(self, event: Event) -> None:
        body = event.body
        table = self.tables[body["part"]]
        task = table.practice if body["practice"] else table.tasks[body["task"]]
        game = Game(body["game"], table, body["people"], body["practice"], event.time, task, body["seed"])
        self.games[game.id] = game
        for pid in game.people.values():
            self.people[pid].game = game.id
            if not game.practice:
                self.people[pid].units.add((table.part.name, task.id))
        if not game.practice:
            self._counts[table.part.name][task.id] += 1

    def _viewing(self, event: Event) -> None:
        person, unit = self.people[event.body["person"]], (event.body["part"], event.body["unit"])
        person.viewing = unit
        person.units.add(unit)
        self._counts[unit[0]][unit[1]] += 1

    def _judged(self, event: Event) -> None:
        person = self.people[event.person or ""]
        if person.viewing is None:
            raise ActionError("there is nothing to judge now")
        part = self.part(person.viewing[0])
        stars, text = event.body.get("stars"), event.body.get("text", "")
        if part.kind == "rate" and (type(stars) is not int or not 1 <= stars <= STARS):  # True and 3.0 are no stars
            raise ActionError(f"stars are 1 to {STARS}")
        if not isinstance(text, str) or len(text) > LONGEST_TEXT or (part.kind == "describe" and not text.strip()):
            raise ActionError(f"a description has 1 to {LONGEST_TEXT} characters")
        event.body.update(part=part.name, unit=person.viewing[1], stars=stars if part.kind == "rate" else None)
        self.judgements.append(event)
        self.judged(event)
        person.done[part.name] += 1
        person.viewing, person.last, person.ready = None, "judged", False

    def _play(self, event: Event) -> None:
        game = self.games[event.body["game"]]
        game.apply(event)
        if game.over:
            self._over(game)

    def _over(self, game: Game) -> None:
        part = game.table.part
        for role, pid in game.people.items():
            person = self.people[pid]
            person.game, person.ready = None, False
            person.last = "broken" if game.broken is not None else "found" if is_success(game) else "missed"
            if game.practice:
                person.practised.add(role)
            elif game.broken is None:
                person.done[part.name] += 1
        if not game.practice:
            if game.broken is None:
                self._episodes[part.name].append((game.id, game))
                self.finished(game)
            else:
                self._counts[part.name][game.task.id] -= 1

    # Asking --------------------------------------------------------------------------------------

    def part(self, name: str) -> StudyPart:
        return next(p for p in self.study.parts if p.name == name)

    def episodes(self, part: StudyPart) -> list[tuple[str, Episode]]:
        """The episodes that a part judges: (unit, episode)."""
        if part.episodes:
            return [(str(i), e) for i, e in enumerate(self.viewed[part.name])]
        return [(unit, game.episode) for unit, game in self._episodes[part.of]]

    def episode_of(self, part: str, unit: str) -> Episode:
        """The episode that a part judges under the name `unit`."""
        return self.viewed[part][int(unit)] if self.part(part).episodes else self.games[unit].episode

    def wanted(self, part: StudyPart, *people: Person) -> str | None:
        """The unit of a part that lacks most and that none of `people` has had; None where there is none."""
        units: Iterable[str] = self.tables[part.name].tasks if part.kind == "play" else self._viewable(part, *people)
        counts = self._counts[part.name]
        open_units = [u for u in units if counts[u] < part.answers]
        open_units = [u for u in open_units if all((part.name, u) not in p.units for p in people)]
        return min(open_units, key=lambda u: counts[u], default=None)

    def _viewable(self, part: StudyPart, *people: Person) -> Iterator[str]:
        """Nobody judges what they took part in."""
        if part.episodes:
            yield from (str(i) for i in range(len(self.viewed[part.name])))
            return
        ids = {p.id for p in people}
        yield from (unit for unit, game in self._episodes[part.of] if not ids & set(game.people.values()))

    def next(self, person: Person, now: float) -> list[Event]:
        """Events by which something begins for somebody; none while they read or wait."""
        waited, person.waiting = person.waiting, None
        if person.ended or not person.consented or person.game or person.viewing:
            return []
        for part in self.study.parts:
            if person.done[part.name] >= part.per_person or part.name in person.without:
                continue
            if (unit := self.wanted(part, person)) is None:
                continue
            role = person.roles.get(part.name)
            if part.kind == "play" and role is None:  # before they are ready, who read what to do
                return [_event("role", now, person=person.id, part=part.name, role=self._scarce_role(part))]
            if not person.ready:
                return []
            if role is None:
                return [_event("viewing", now, person=person.id, part=part.name, unit=unit)]
            if self.study.practice and role not in person.practised:
                return [self._begin(part, {role: person}, None, now)]
            if len(part.roles) == 1:
                return [self._begin(part, {role: person}, unit, now)]
            for other in self._waiting(part, role):
                if (shared := self.wanted(part, person, other)) is not None:
                    return [self._begin(part, {role: person, other.roles[part.name]: other}, shared, now)]
            since = waited[1] if waited is not None and waited[0] == part.name else now
            if now - since > self.study.wait_seconds:
                return [_event("alone", now, person=person.id, part=part.name)]
            person.waiting = part.name, since
            return []
        if not person.ready:
            return []
        served = sum(person.done.values()) > 0 or person.without  # whoever waited in vain did their share
        return [_event("ended", now, person=person.id, why="done" if served else "nothing")]

    def late(self, now: float) -> list[Event]:
        """Games that end because somebody has gone or does nothing."""
        events = [
            _event("dropped", now, person=p.id)
            for p in self.people.values()
            if p.viewing and not p.connected and now - p.away_since > GONE_SECONDS
        ]
        for game in self.games.values():
            if game.over:
                continue
            people = [self.people[p] for p in game.people.values()]
            quiet, together = now - game.last_change, len(people) > 1
            limit = self.study.absent_seconds if together else GONE_SECONDS
            absent = [p for p in people if not p.connected and now - p.away_since > limit and quiet > limit]
            why = None
            if absent:
                why = "gone: " + absent[0].id
            elif together and quiet > self.study.idle_seconds:
                why = f"idle: {game.people[game.mover or 'agent']}"
            if any(p.ended for p in people):
                why = "left: " + next(p.id for p in people if p.ended)
            if why:
                events.append(_event("broken", now, game=game.id, why=why))
        return events

    def _scarce_role(self, part: StudyPart) -> str:
        """The role that fewer of those who are here have."""
        here = [p for p in self.people.values() if p.connected and not p.ended]
        taken = Counter(p.roles[part.name] for p in here if part.name in p.roles)
        return min(part.roles, key=lambda r: taken[r])

    def _waiting(self, part: StudyPart, role: str) -> list[Person]:
        """Those who wait for somebody in `role`, the longest first."""
        here = [(p.waiting, p) for p in self.people.values() if p.waiting and p.connected]
        here = [(w, p) for w, p in here if w[0] == part.name and p.roles[part.name] != role]
        return [p for _, p in sorted(here, key=lambda x: x[0])]

    def _begin(self, part: StudyPart, people: Mapping[str, Person], unit: str | None, now: float) -> Event:
        for person in people.values():
            person.waiting = None
        ids = {r: p.id for r, p in people.items()}
        seed = self.study.seed if unit is None else self.study.seed + 1 + self._counts[part.name][unit]
        name = secrets.token_hex(6)
        body = {"game": name, "part": part.name, "task": unit, "people": ids, "seed": seed}
        return Event("began", now, body={**body, "practice": unit is None})


def is_success(game: Game) -> bool:
    """Tells whether an episode ended with a stop within the task's radius of a goal."""
    return strict_success(game.episode, game.situation.world.graph) > 0


def _event(kind: str, now: float, **body: Any) -> Event:
    return Event(kind, now, body=body)
