"""Deeds of people, as a log of events in SQLite: whatever was acknowledged is on disk."""

import asyncio
import contextlib
import json
import sqlite3
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from embodied.errors import UnableError

EVENT_TABLES = """
PRAGMA journal_mode = WAL;
PRAGMA synchronous = FULL;
CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS events (
  number INTEGER PRIMARY KEY, time REAL NOT NULL, kind TEXT NOT NULL, person TEXT, message TEXT, body TEXT NOT NULL,
  UNIQUE (person, message));
"""


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened."""

    kind: str
    time: float
    """Seconds since 1970."""
    person: str | None = None
    """Who did it; None for bots and the server."""
    message: str | None = None
    """The browser's own name of the message, so that it counts once however often it is sent."""
    body: dict[str, Any] = field(default_factory=dict)


class Store:
    """One SQLite file in WAL mode, written by a thread of its own."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._readable():
            self._db = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
            self._db.executescript(EVENT_TABLES)
        self._thread = ThreadPoolExecutor(1, "store")
        self._failed = False

    def about(self, name: str, default: str) -> str:
        """A fact that is kept with the events; `default` is written down where there is none."""
        self._db.execute("INSERT OR IGNORE INTO about VALUES (?, ?)", (name, default))
        return self._db.execute("SELECT value FROM about WHERE name = ?", (name,)).fetchone()[0]

    def events(self) -> Iterator[Event]:
        """All events, in their order."""
        with self._readable():
            for kind, time, person, message, body in self._db.execute(
                "SELECT kind, time, person, message, body FROM events ORDER BY number"
            ):
                yield Event(kind, time, person, message, json.loads(body))

    @contextlib.contextmanager
    def _readable(self) -> Iterator[None]:
        """Say of which file it is that it is damaged."""
        try:
            yield
        except (sqlite3.DatabaseError, UnicodeDecodeError, json.JSONDecodeError, TypeError) as e:
            raise UnableError(f"{self._path} is damaged ({e}); put a copy of it back, or name another folder") from e

    async def append(self, event: Event) -> None:
        """Returns when the event is on disk; events are kept in the order of the calls."""
        await asyncio.shield(asyncio.get_running_loop().run_in_executor(self._thread, self._write, event))

    async def flush(self) -> None:
        """Returns when all events so far are on disk."""
        await asyncio.get_running_loop().run_in_executor(self._thread, int)

    def close(self) -> None:
        self._thread.shutdown()
        self._db.close()

    def _write(self, event: Event) -> None:
        if self._failed:
            raise sqlite3.OperationalError("an earlier event could not be written")
        row = (event.time, event.kind, event.person, event.message, json.dumps(event.body))
        self._failed = True  # until it is written: nothing may follow a gap
        with self._db:
            self._db.execute("BEGIN IMMEDIATE")
            self._db.execute("INSERT INTO events (time, kind, person, message, body) VALUES (?, ?, ?, ?, ?)", row)
        self._failed = False
