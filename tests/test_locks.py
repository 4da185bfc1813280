"""One writer per folder, and nothing of killed processes stays."""

from __future__ import annotations

import errno
import os
import signal
import socket
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from conftest import two_rooms
from hand_data import built, content

from embodied import cli
from embodied.assets.cache import DRAFTS, MARK, abandoned, atomic_path, sweep, write_bytes
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


def killed_draft(folder) -> None:
    """What a process leaves in `folder` that is killed while it writes."""
    code = """
import os, signal, sys
from pathlib import Path
from embodied.assets.cache import atomic_path
with atomic_path(Path(sys.argv[1]) / "weights.safetensors") as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code, str(folder)]).returncode == -signal.SIGKILL
    (left,) = folder.glob(f"{DRAFTS}*")
    assert (left / "weights.safetensors").read_text() == "half"


def own_files(folder) -> set[Path]:
    """Files and folders of names that look like drafts, locks or marks, and none is."""
    for name in (".lock", ".mark", f"{DRAFTS}notes.txt", f".a.{socket.gethostname()}-99999999.x.json", "weights.tmp"):
        (folder / name).write_text("mine")
    for name in (f"{DRAFTS}holidays", f"{DRAFTS}"):
        (folder / name).mkdir()
        (folder / name / "one.jpg").write_text("mine")
        (folder / name / MARK).write_text("unfinished files of the program embodied, 7\n")
    (folder / f"{DRAFTS}link").symlink_to(folder / f"{DRAFTS}holidays")
    return set(folder.rglob("*"))


def test_what_a_killed_process_left_is_swept_and_what_others_write_or_own_stays(tmp_path):
    killed_draft(tmp_path)
    mine = own_files(tmp_path) - set(tmp_path.glob(f"{DRAFTS}*/weights.safetensors"))
    swept = {p for p in mine if abandoned(p) or abandoned(p.parent)}
    with atomic_path(tmp_path / "live") as temporary:
        sweep.cache_clear()
        write_bytes(tmp_path / "b.json", b"{}")
        temporary.write_text("")
        assert temporary.exists(), "a draft that somebody writes stays"
    assert swept and set(tmp_path.rglob("*")) == mine - swept | {tmp_path / "b.json", tmp_path / "live"}


def test_a_file_that_cannot_be_written_leaves_nothing_unfinished_and_the_error_names_it(tmp_path):
    (tmp_path / "house" / "c").mkdir(parents=True)
    with pytest.raises(OSError) as error:
        write_bytes(tmp_path / "house" / "c", b"56")
    assert Path(error.value.filename) == tmp_path / "house" / "c"
    assert {p.name for p in (tmp_path / "house").iterdir()} == {"c"}


def test_whoever_takes_a_folder_finds_nothing_that_a_killed_process_left_in_it(tmp_path):
    with locked(tmp_path):
        pass  # it has been swept once in this process
    killed_draft(tmp_path)
    with locked(tmp_path):
        assert [p.name for p in tmp_path.iterdir()] == [LOCK]


ORDERS = {
    "evaluate": ["evaluate", "hanna", "--agent", "shortest", "--data", "{data}", "--out", "{out}"],
    "export hanna": ["export", "hanna", "--data", "{data}", "--out", "{out}"],
    "export parquet": ["export", "parquet", "--data", "{data}", "--out", "{out}"],
    "export mjcf": ["export", "mjcf", "--house", "{out}", "--light", "none", "--out", "{out}"],
    "light": ["light", "{out}", "--hour", "9"],
    "light more": ["light", "{out}", "--lights", "2"],
}


@pytest.mark.parametrize("name", ORDERS)
def test_no_command_writes_where_another_process_does(name, tmp_path, capsys):
    data, out = tmp_path / "data", tmp_path / "out"
    if "{data}" in ORDERS[name]:
        built(data, "hanna")
    out.mkdir()
    two_rooms().save(out / "house.json")
    with locked(out):
        there = content(out)
        assert cli.main([word.format(data=data, out=out) for word in ORDERS[name]]) == 2
        said = capsys.readouterr().err
        assert f"{out} is being written by process {os.getpid()} on " in said and content(out) == there


def test_files_and_folders_are_made_as_the_umask_says(tmp_path):
    before = os.umask(0o027)
    try:
        write_bytes(tmp_path / "a" / "b.json", b"")
        os.umask(0o002)
        write_bytes(tmp_path / "c.json", b"")
    finally:
        os.umask(before)
    modes = [stat.S_IMODE((tmp_path / p).stat().st_mode) for p in ("a", "a/b.json", "c.json")]
    assert modes == [0o750, 0o640, 0o664]


def test_whoever_waits_for_a_folder_gets_it_when_its_holder_is_done(tmp_path):
    first = holder(tmp_path / "run")
    threading.Timer(0.3, first.kill).start()
    with locked(tmp_path / "run", wait=True):
        assert first.wait() == -signal.SIGKILL


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


@pytest.mark.parametrize("name", ["file/x.json", "folder"])
def test_a_place_that_cannot_be_written_is_named(name, tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError) as caught:
        write_bytes(tmp_path / name, b"")
    assert name.split("/")[0] in str(caught.value.filename)
