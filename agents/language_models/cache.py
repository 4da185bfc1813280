"""Every answer of a language model, kept in one SQLite file: what was asked before is never asked again."""

from __future__ import annotations

import sqlite3
import threading
from pathlib import Path

APPLICATION = 0x456D4C4D
"""Marks the file as ours ('EmLM')."""
PATIENCE = 60.0
"""Seconds that a process waits for another one that writes."""


class AnswerCache:
    """Owns the open file. Threads may share it, and so may processes, each with its own.

    An answer is written as soon as it comes, so that a run that is cut short goes on where it stopped. The file holds
    no key and no address of a server; pictures stand in it as digests.
    """

    def __init__(self, path: Path) -> None:
        """
        Args:
          path: the file; made where there is none.

        Raises:
          ValueError: another file stands there.
        """
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        try:
            self._file = sqlite3.connect(self.path, timeout=PATIENCE, isolation_level=None, check_same_thread=False)
            (mark,) = self._file.execute("PRAGMA application_id").fetchone()
            (tables,) = self._file.execute("SELECT count(*) FROM sqlite_master").fetchone()
            if mark != APPLICATION and tables:
                raise ValueError(f"{path} is a data base, but not of answers; choose another file")
            if mark != APPLICATION:
                self._file.execute(f"PRAGMA application_id = {APPLICATION}")
            self._file.execute(
                "CREATE TABLE IF NOT EXISTS answers (key TEXT PRIMARY KEY, request TEXT NOT NULL, answer TEXT NOT NULL)"
                " WITHOUT ROWID"
            )
        except sqlite3.DatabaseError as e:
            raise ValueError(f"{path} cannot be used to keep answers ({e}); choose another file") from e

    def get(self, key: str) -> str | None:
        """The answer that is kept under a key, as JSON."""
        with self._lock:
            row = self._file.execute("SELECT answer FROM answers WHERE key = ?", (key,)).fetchone()
        return row[0] if row else None

    def put(self, key: str, request: str, answer: str) -> str:
        """Keep an answer; returns what is kept from now on: whoever was first."""
        with self._lock:
            self._file.execute("INSERT OR IGNORE INTO answers VALUES (?, ?, ?)", (key, request, answer))
            (kept,) = self._file.execute("SELECT answer FROM answers WHERE key = ?", (key,)).fetchone()
        return kept

    def __len__(self) -> int:
        with self._lock:
            return int(self._file.execute("SELECT count(*) FROM answers").fetchone()[0])

    def close(self) -> None:
        with self._lock:
            self._file.close()
