"""Several caches at once: read from all, written to the first; and room is made in the program's own files only."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time

import pytest

from embodied.assets import cache as caches
from embodied.cli import main


def test_a_shared_cache_is_read_and_never_written(tmp_path, monkeypatch):
    mine, shared = tmp_path / "mine", tmp_path / "shared"
    (shared / "light" / "house").mkdir(parents=True)
    (shared / "light" / "house" / "page.png").write_bytes(b"shared")
    monkeypatch.setenv("EMBODIED_CACHE", f"{mine}{os.pathsep}{shared}")
    assert caches.default_cache() == mine
    page = mine / "light" / "house" / "page.png"
    assert page.read_bytes() == b"shared"
    caches.write_bytes(page, b"mine")
    caches.default_cache()
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
        assert caches.default_cache() == mine
        assert [p.relative_to(mine).as_posix() for p in sorted(mine.rglob("*"))] == ["light", "light/a.npz"]
    assert f"EMBODIED_CACHE names {tmp_path / 'nowhere'}, which is left out: " in caplog.text


UNPRIVILEGED = ["setpriv", "--bounding-set", "-all", "--inh-caps", "-all"] if os.geteuid() == 0 else []
"""Before a command: root obeys the modes of files, and may not change what somebody else owns."""


@pytest.fixture
def order(tmp_path) -> list[str]:
    """The command that makes a house of one small room."""
    hall = {"kind": "hall", "polygon": [[0, 0], [3, 0], [3, 3], [0, 3]]}
    (tmp_path / "plan.json").write_text(json.dumps({"rooms": [hall]}))
    return ["house", "--plan", str(tmp_path / "plan.json")]


@pytest.fixture
def filled(tmp_path, shared_cache, order):
    """A cache that holds what the house needs; nobody may write there, and root's folders are somebody else's."""
    folder = tmp_path / "cache"
    for name in ("assets", "collision", "landscapes", "materials"):
        (shared_cache / name).mkdir(parents=True, exist_ok=True)
        caches.link(shared_cache / name, folder / name)
    assert main([*order, "--out", str(tmp_path / "first"), "--cache", str(folder)]) == 0
    others = [tmp_path / "empty", tmp_path / "closed"]
    for path in others:
        path.mkdir()
    folders = [*others, folder, *(p for p in folder.rglob("*") if p.is_dir())]
    for path in folders:
        if os.geteuid() == 0:
            os.chown(path, 65534, 65534)
        path.chmod(0 if path.name == "closed" else 0o555)
    yield folder
    for path in folders:
        path.chmod(0o755)


@pytest.mark.slow
@pytest.mark.skipif(os.geteuid() == 0 and not shutil.which("setpriv"), reason="root may write everywhere")
def test_somebody_who_may_only_read_the_cache_reads_it_or_is_told_and_puts_their_own_before_it(filled, tmp_path, order):
    def ran(*words: str, cache: str) -> subprocess.CompletedProcess[str]:
        env = os.environ | {"EMBODIED_CACHE": cache, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        command = [*UNPRIVILEGED, sys.executable, *words]
        return subprocess.run(command, capture_output=True, text=True, env=env, cwd=tmp_path)

    held = {p: p.lstat().st_mtime_ns for p in sorted(filled.rglob("*"))}
    behind = ran("-m", "embodied", *order, "--out", "behind", cache=f"{tmp_path / 'mine'}{os.pathsep}{filled}")
    assert behind.returncode == 0, behind.stderr
    tried = [filled, tmp_path / "closed", tmp_path / "empty"]
    orders = [[*order, "--out", cache.name + "_house", "--cache", str(cache)] for cache in tried]
    code = f"from embodied.cli import main\nstatus = [main(order) for order in {orders}]\nprint(status)"
    alone = ran("-c", code, cache=str(filled))
    assert alone.stdout.endswith("[0, 2, 2]\n") and "Traceback" not in alone.stderr, alone.stderr
    assert all(str(cache) in alone.stderr for cache in tried[1:])
    for out in ("behind", "cache_house"):
        assert (tmp_path / out / "house.json").read_bytes() == (tmp_path / "first" / "house.json").read_bytes()
    assert {p: p.lstat().st_mtime_ns for p in sorted(filled.rglob("*"))} == held
