"""Several caches at once: read from all, written to the first; and room is made in the program's own files only."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

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


def as_somebody(words: list[str], **more: str) -> subprocess.CompletedProcess[str]:
    """A command line run by a user who owns nothing here."""
    who = {"user": 65534, "group": 65534, "extra_groups": []} if os.geteuid() == 0 else {}
    env = {"PATH": os.environ["PATH"], "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), **more}
    return subprocess.run([sys.executable, *words], capture_output=True, text=True, env=env, cwd="/", **who)


@pytest.fixture
def lent():
    """A folder that everybody may enter, where a user who owns nothing may write to `out` only."""
    try:
        as_somebody(["-c", "import embodied"]).check_returncode()
    except (PermissionError, subprocess.CalledProcessError):
        pytest.skip("this Python may not be run by other users")
    folder = Path(tempfile.mkdtemp())
    folder.chmod(0o755)
    (folder / "out").mkdir()
    (folder / "out").chmod(0o777)
    yield folder
    for path in folder.rglob("*"):
        path.chmod(0o700)
    shutil.rmtree(folder)


@pytest.mark.slow
def test_somebody_who_may_only_read_the_cache_is_told_or_reads_it_behind_one_of_their_own(lent):
    filled = lent / "cache"
    order = ["house", "--seed", "1", "--area", "38", "46", "--cache"]
    assert main([*order, str(filled), "--out", str(lent / "first")]) == 0
    before = sorted((p, p.stat().st_mtime_ns) for p in filled.rglob("*"))
    for path in (filled, *filled.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)
    alone = as_somebody(["-m", "embodied", *order, str(filled), "--out", str(lent / "out" / "alone")])
    assert alone.returncode == 0 or (alone.returncode == 2 and "--cache" in alone.stderr), alone.stderr
    assert "Traceback" not in alone.stderr
    both = os.pathsep.join((str(lent / "out" / "mine"), str(filled)))
    behind = as_somebody(["-m", "embodied", *order[:-1], "--out", str(lent / "out" / "h")], EMBODIED_CACHE=both)
    assert behind.returncode == 0, behind.stderr
    assert (lent / "out" / "h" / "house.json").read_bytes() == (lent / "first" / "house.json").read_bytes()
    assert sorted((p, p.stat().st_mtime_ns) for p in filled.rglob("*")) == before
    filled.chmod(0o000)
    closed = as_somebody(["-m", "embodied", *order, str(filled), "--out", str(lent / "out" / "closed")])
    assert closed.returncode == 2 and str(filled) in closed.stderr and "Traceback" not in closed.stderr, closed.stderr
