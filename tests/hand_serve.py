"""A study over the houses made by hand, its server in a process of its own, and people who are played by a script."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import urllib.request
import uuid
from pathlib import Path

import numpy as np
from hand_data import built, small_house
from websockets.sync.client import connect

from embodied.render.panorama import Panorama
from embodied.render.panorama_file import write_panoramas
from embodied.render.pictures import Unlit, recorded

ROOT = Path(__file__).resolve().parent.parent
HEAD = 'title = "Finding things"\ndata = "data"\nconsent = "I agree."\npractice = false\npace = 0.02\nsize = 64\n'
TOGETHER = '[[parts]]\nname = "together"\ntasks = 3\nper_person = 3\n'


def make_data(folder: Path, kind: str = "hanna", make_house=small_house):
    """A data set with small painted panoramas in folder/data."""
    data = built(folder / "data", kind, make_house=make_house)
    pictures = Unlit(size=64)
    for name in sorted({n for s in data.splits for n in data.names(s)}):
        place = data.place(name)
        meta = {"house": place.house.digest, **recorded(pictures)}
        nodes = [gradient(k) for k in range(len(place.graph.ids))]
        write_panoramas(data.folder / "houses" / name / "panoramas.pano", nodes, meta)
    return data


def gradient(node: int, side: int = 64) -> Panorama:
    """A panorama that tells face, row, column and node: faces in red, rows in green, columns in blue."""
    rgb = np.zeros((6, side, side, 3), np.uint8)
    rgb[..., 0] = (40 * np.arange(6) + node)[:, None, None]
    rgb[..., 1] = np.linspace(20, 235, side)[:, None]
    rgb[..., 2] = np.linspace(20, 235, side)
    return Panorama(rgb, np.ones((6, side, side), np.float32), np.ones((6, side, side), np.int32))


def write_study(folder: Path, parts: str = TOGETHER, head: str = HEAD, name: str = "study") -> Path:
    path = folder / f"{name}.toml"
    path.write_text(head + parts, encoding="utf-8")
    return path


class Served:
    """A server of a study; killed and started again at will. PORT in its options is its own."""

    def __init__(self, study: Path, *options: str) -> None:
        self.study = study
        self.people = study.with_suffix(".people")
        with socket.socket() as s:
            s.bind(("127.0.0.1", 0))
            self.port = s.getsockname()[1]
        self.address = f"http://127.0.0.1:{self.port}"
        self.options = [o.replace("PORT", str(self.port)) for o in options]
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "embodied", "serve", str(self.study), "--port", str(self.port), *self.options]
        env = {**os.environ, "PYTHONPATH": str(ROOT)}
        self.process = subprocess.Popen(command, cwd=ROOT, env=env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        for _ in range(1200):  # a busy machine is slow to start
            with contextlib.suppress(OSError), urllib.request.urlopen(self.address + "/health", timeout=5):
                break  # a bare connection could be one of the socket with itself
            assert self.process.poll() is None, self.process.stdout.read().decode()
            time.sleep(0.1)
        else:
            raise TimeoutError("the server did not start within two minutes")
        self.links = json.loads((self.people / "links.json").read_text())

    @property
    def word(self) -> str:
        """Of the link for everybody."""
        return self.links["join"][0].split("=")[1]

    def begun(self) -> list[dict]:
        """What the log says of the games that began."""
        with contextlib.closing(sqlite3.connect(self.people / "people.db")) as db:
            rows = db.execute("SELECT body FROM events WHERE kind = 'began' ORDER BY number").fetchall()
        return [json.loads(body) for (body,) in rows]

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self) -> None:
        self.process.terminate()
        self.process.wait(20)


class Human:
    """One browser without a page."""

    def __init__(self, server: Served, **hello: str) -> None:
        self.server, self.hello = server, hello or {"join": server.word}
        self.screen: dict = {}
        self.token = self.plan = None
        self.enter()

    def enter(self) -> None:
        """Connect, as at first or again."""
        address = f"ws://127.0.0.1:{self.server.port}/ws"
        self.stack = contextlib.ExitStack()
        self.socket = self.stack.enter_context(connect(address, origin=self.server.address, max_size=None))
        self.socket.send(json.dumps({"token": self.token} if self.token else self.hello))
        self.read(lambda m: m.get("screen"))

    def read(self, wanted, timeout: float = 600) -> dict:
        """Read until a message of which `wanted` is true; screens are remembered."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            message = json.loads(self.socket.recv(timeout=end - time.monotonic()))
            self.token = message.get("token", self.token)
            self.plan = message.get("plan", self.plan)
            if "screen" in message:
                self.screen = message
            if wanted(message):
                return message
        raise TimeoutError

    def until(self, screen: str, wanted=lambda s: True) -> dict:
        """Wait for a screen."""
        good = lambda s: s.get("screen") == screen and wanted(s)
        return self.screen if good(self.screen) else self.read(good)

    def say(self, do: str, **more: object) -> dict:
        """Send a message; returns its acknowledgement."""
        name = str(more.pop("id", uuid.uuid4().hex))
        self.socket.send(json.dumps({"id": name, "do": do, **more}))
        return self.read(lambda m: m.get("ack") == name)

    def play(self, do: str, **more: object) -> dict:
        return self.say(do, game=self.screen["game"], turn=self.screen["turn"], **more)

    def close(self) -> None:
        self.stack.close()


def pair(server: Served) -> tuple[Human, Human]:
    """An agent and an assistant who have begun."""
    one, two = Human(server), Human(server)
    for human in (one, two):
        assert "error" not in human.say("consent")
        assert human.until("ready")["role"] in ("agent", "assistant"), "people read what to do before they do it"
        assert "error" not in human.say("ready")
    return one, two
