"""A bake that is killed, wherever it stands, goes on when it is asked for again and ends in the same files."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import two_rooms
from hand_light import TINY
from handmade import HandCatalogue, furnished

from embodied.house.house import Light, Sky
from embodied.light import bake
from embodied.seeds import stream

pytestmark = [pytest.mark.slow, pytest.mark.gl]


def lit(cache: Path):
    lamp = Light("l1", "living_room_1", None, (2.5, 2.0, 2.2), (1.0, 0.8, 0.6), 1100.0)
    house = dataclasses.replace(furnished(two_rooms()), lights=(lamp,), sky=Sky(11.0, "overcast"))
    return bake(house, HandCatalogue(), cache, TINY)


def digest_of(path: Path) -> str:
    """Of what a file holds; of a manifest without the time that the bake took."""
    if path.name != "manifest.json":
        return hashlib.sha256(path.read_bytes()).hexdigest()
    told = json.loads(path.read_text())
    return json.dumps({k: v for k, v in told.items() if not k.endswith("seconds")}, sort_keys=True)


def contents(cache: Path) -> dict[str, str]:
    """What the files of a cache hold, by name; hidden ones are locks and drafts."""
    named = {p.relative_to(cache).as_posix(): p for p in sorted((cache / "light").rglob("*")) if p.is_file()}
    return {n: digest_of(p) for n, p in named.items() if "/." not in n}


def test_a_bake_that_is_killed_twice_ends_as_one_that_was_not(tmp_path):
    lit(tmp_path / "whole")
    script = "from pathlib import Path; from test_kills import lit; lit(Path({!r}))".format(str(tmp_path / "killed"))
    paths = os.pathsep.join([str(Path(__file__).parent), str(Path(__file__).parent.parent)])
    env, rng = {**os.environ, "PYTHONPATH": paths, "OMP_NUM_THREADS": "1"}, stream(0, "kills")
    killed = 0
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-c", script], env=env, stderr=subprocess.DEVNULL)
        try:
            process.wait(timeout=float(rng.uniform(1.5, 4.0)))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            killed += process.wait() == -signal.SIGKILL
    lit(tmp_path / "killed")
    assert killed, "every bake ended before it was killed; shorten the waits"
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")
    assert not list((tmp_path / "killed").rglob(".embodied-unfinished-*"))
