"""Several caches at once: read from all, written to the first; and room is made in the program's own files only."""

from __future__ import annotations

import os
import time

import assets.cache
from embodied.cli import main


def test_a_shared_cache_is_read_and_never_written(tmp_path, monkeypatch):
    mine, shared = tmp_path / "mine", tmp_path / "shared"
    (shared / "light" / "house").mkdir(parents=True)
    (shared / "light" / "house" / "page.png").write_bytes(b"shared")
    monkeypatch.setenv("EMBODIED_CACHE", f"{mine}{os.pathsep}{shared}")
    assert assets.cache.default_cache() == mine
    page = mine / "light" / "house" / "page.png"
    assert page.read_bytes() == b"shared"
    assets.cache.write_bytes(page, b"mine")
    assets.cache.default_cache()
    assert page.read_bytes() == b"mine" and (shared / "light" / "house" / "page.png").read_bytes() == b"shared"


def test_pruning_removes_what_was_long_unread_and_nothing_of_the_users(tmp_path, capsys):
    old, new, foreign = tmp_path / "light" / "old.png", tmp_path / "light" / "new.png", tmp_path / "notes.txt"
    old.parent.mkdir()
    for path in (old, new, foreign):
        path.write_bytes(b"1234")
    long_ago = time.time() - 40 * 86_400
    for path in (old, foreign):
        os.utime(path, (long_ago, long_ago))
    assert main(["cache", "--cache", str(tmp_path), "--prune", "30"]) == 0
    assert not old.exists() and new.exists() and foreign.exists()
    assert "in 1 files" in capsys.readouterr().out
    assert main(["cache", "--cache", str(tmp_path), "--clear", "light"]) == 0
    assert not new.exists() and foreign.exists()
