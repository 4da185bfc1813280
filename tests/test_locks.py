"""One writer per folder, and nothing of killed processes stays."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time

import pytest

from assets.cache import _MACHINE, atomic_path, draft_prefix, sweep, write_bytes
from embodied.locks import LOCK, LockedError, locked

HOLD = """
import sys, time
from embodied.locks import locked
with locked(sys.argv[1]):
    print('held', flush=True)
    time.sleep(60)
"""


def holder(folder) -> subprocess.Popen:
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_writer_is_told_who_the_first_is_and_a_killed_one_holds_nothing(tmp_path):
    first = holder(tmp_path / "run")
    try:
        with (
            pytest.raises(LockedError, match=rf"written by process {first.pid} on .* since "),
            locked(tmp_path / "run"),
        ):
            pass
        first.send_signal(signal.SIGKILL)
        first.wait()
        assert (tmp_path / "run" / LOCK).exists(), "a kill leaves the file, not the lock"
        with locked(tmp_path / "run"):
            pass
    finally:
        first.kill()
    assert not list((tmp_path / "run").iterdir())


def test_the_same_process_cannot_hold_a_folder_twice(tmp_path):
    with locked(tmp_path):
        with pytest.raises(LockedError, match=f"process {os.getpid()}"), locked(tmp_path):
            pass
        assert (tmp_path / LOCK).exists()


def dead_pid() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_what_a_killed_process_left_is_swept_and_what_others_write_or_own_stays(tmp_path):
    mine, dead = tmp_path / f"{draft_prefix('a')}x.json", tmp_path / f".a.{_MACHINE}-{dead_pid()}.x.json"
    house = tmp_path / f".train_0001.{_MACHINE}-{dead_pid()}.y"
    house.mkdir()
    far, forgotten = tmp_path / ".a.elsewhere-1.x.json", tmp_path / ".a.elsewhere-2.x.json"
    others = [tmp_path / ".bashrc", tmp_path / ".my.settings", tmp_path / ".git-1.x"]
    for path in (mine, dead, far, forgotten, house / "house.json", *others):
        path.write_text("half")
    long_ago = time.time() - 3 * 86_400
    os.utime(forgotten, (long_ago, long_ago))
    sweep.cache_clear()
    write_bytes(tmp_path / "b.json", b"{}")
    assert set(tmp_path.iterdir()) == {mine, far, tmp_path / "b.json", *others}


def test_whoever_takes_a_folder_finds_nothing_that_a_killed_process_left_in_it(tmp_path):
    with locked(tmp_path):
        pass  # it has been swept once in this process
    left = tmp_path / f".weights.safetensors.{_MACHINE}-{dead_pid()}.x.safetensors"
    left.write_text("half")
    with locked(tmp_path):
        assert not left.exists()


@pytest.mark.parametrize("body", [lambda t: t.write_bytes(b"x"), lambda t: (t / "no").write_text(""), None])
def test_every_failed_write_names_the_file_that_was_wanted(body, tmp_path):
    path = tmp_path / "weights.safetensors"
    with pytest.raises(OSError) as caught, atomic_path(path) as temporary:
        if body is None:
            raise OSError(errno.ENOSPC, "No space left on device")
        body(temporary)
        raise OSError(errno.EIO, os.strerror(errno.EIO), str(temporary))
    assert caught.value.errno is not None
    assert str(caught.value.filename) == str(path) or "no" in str(caught.value.filename)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_may_not_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError) as caught:
        write_bytes(tmp_path / "file" / "x.json", b"")
    assert "file" in str(caught.value.filename)
    (tmp_path / "folder").mkdir()
    with pytest.raises(IsADirectoryError) as caught:
        write_bytes(tmp_path / "folder", b"")
    assert caught.value.filename == str(tmp_path / "folder")
