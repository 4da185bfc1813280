"""Deeds of people, as a log of events in SQLite: whatever was acknowledged is on disk."""

from __future__ import annotations

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
    """One SQLite file in WAL mode. Events that come while a transaction is being written share the next one."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with self._readable():
            self._db = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
            self._db.executescript(EVENT_TABLES)
        self._thread = ThreadPoolExecutor(1, "store")
        self._waiting: list[tuple[Event, asyncio.Future[None]]] = []
        self._writing: asyncio.Task[None] | None = None

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
        written = asyncio.get_running_loop().create_future()
        self._waiting.append((event, written))
        if self._writing is None or self._writing.done():
            self._writing = asyncio.create_task(self._write_all())
        await written

    async def flush(self) -> None:
        """Returns when all events so far are on disk."""
        if self._writing is not None:
            await asyncio.shield(self._writing)

    def close(self) -> None:
        self._thread.shutdown()
        self._db.close()

    async def _write_all(self) -> None:
        while self._waiting:
            batch, self._waiting = self._waiting, []
            try:
                await asyncio.get_running_loop().run_in_executor(self._thread, self._write, [e for e, _ in batch])
            except sqlite3.Error as e:
                for _, written in batch + self._waiting:
                    if not written.done():
                        written.set_exception(e)
                self._waiting = []
                return
            for _, written in batch:
                if not written.done():  # whoever waited may have gone
                    written.set_result(None)

    def _write(self, events: list[Event]) -> None:
        rows = [(e.time, e.kind, e.person, e.message, json.dumps(e.body)) for e in events]
        with self._db:
            self._db.execute("BEGIN IMMEDIATE")
            self._db.executemany("INSERT INTO events (time, kind, person, message, body) VALUES (?, ?, ?, ?, ?)", rows)
