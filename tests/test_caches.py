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
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "photo.jpg").write_bytes(b"1234")
    (tmp_path / "panoramas").symlink_to(tmp_path / "elsewhere")
    for path in (old, foreign, tmp_path / "elsewhere" / "photo.jpg"):
        os.utime(path, (long_ago, long_ago))
    assert main(["cache", "--cache", str(tmp_path), "--prune", "30"]) == 0
    assert not old.exists() and new.exists() and foreign.exists()
    assert (tmp_path / "elsewhere" / "photo.jpg").exists(), "behind a link"
    assert "in 1 files" in capsys.readouterr().out
    assert main(["cache", "--cache", str(tmp_path), "--clear", "light"]) == 0
    assert not new.exists() and foreign.exists()


def test_shared_caches_that_lead_back_or_are_not_there_do_no_harm(tmp_path, monkeypatch, caplog):
    shared, mine = tmp_path / "shared", tmp_path / "shared" / "mine"
    (shared / "light").mkdir(parents=True)
    (shared / "light" / "a.npz").write_bytes(b"a")
    (shared / "light" / "back").symlink_to(shared)
    monkeypatch.setenv("EMBODIED_CACHE", os.pathsep.join(map(str, (mine, tmp_path / "nowhere", shared))))
    for _ in range(2):
        assert assets.cache.default_cache() == mine
        assert [p.relative_to(mine).as_posix() for p in sorted(mine.rglob("*"))] == ["light", "light/a.npz"]
    assert f"EMBODIED_CACHE names {tmp_path / 'nowhere'}, which is left out: " in caplog.text
