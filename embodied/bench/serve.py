"""People at once on `embodied serve`: how long a step takes from the browser to the disk and back."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import psutil

from embodied.bench.timing import Report
from embodied.datasets.build import DatasetConfig, build_dataset, draw_panoramas
from embodied.kinds.splits import DatasetSize
from embodied.render.pictures import Unlit
from embodied.seeds import stream
from embodied.threads import processors

THINKING = 1.0
"""Mean seconds that somebody looks before the next step; people take longer."""
ASKING = 4
"""Every so many steps the agent asks."""
MOST_STEPS = 12
"""Steps after which an agent stops."""
STUDY = """
title = "Load"
data = "data"
consent = "Load."
practice = false
people = 100000
absent_seconds = 600
idle_seconds = 600

[[parts]]
name = "pairs"
split = "train"
tasks = 1000
answers = 100000
per_person = 100000
"""


@dataclass
class Times:
    """Seconds, one per message or picture."""

    steps: list[float] = field(default_factory=list)
    """From sending an action to its acknowledgement, when it is on disk."""
    pictures: list[float] = field(default_factory=list)
    """From asking for a panorama to its last byte."""
    refused: int = 0
    """Messages that were answered by an error."""


async def load(address: str, word: str, people: int, seconds: float, *, seed: int = 0) -> Times:
    """Let so many people take part for so long, half of them agents, half assistants.

    Args:
      address: of the server, 'http://127.0.0.1:8080'.
      word: of the link for everybody.
    """
    times, end = Times(), time.monotonic() + seconds
    rngs = [stream(seed, "load", i) for i in range(people)]
    await asyncio.gather(*(_person(address, word, times, end, rng) for rng in rngs))
    return times


async def _person(address: str, word: str, times: Times, end: float, rng: np.random.Generator) -> None:
    import websockets

    where, seen = urlsplit(address), ""
    sent: dict[str, float] = {}
    await asyncio.sleep(float(rng.uniform(0, 3)))
    async with websockets.connect(f"ws://{where.netloc}/ws", origin=address) as ws:  # type: ignore[arg-type]
        await ws.send(json.dumps({"join": word}))
        while (left := end - time.monotonic()) > 0:
            try:
                message = json.loads(await asyncio.wait_for(ws.recv(), left))
            except TimeoutError:
                return
            if (name := message.get("ack")) in sent:
                times.steps.append(time.monotonic() - sent.pop(name))
                times.refused += "error" in message
            if "screen" not in message:
                continue
            if (pano := message.get("pano", seen)) != seen:
                begun, seen = time.monotonic(), pano
                await _fetch(where.hostname or "", where.port or 80, f"/pano/{pano}/large.jpg")
                times.pictures.append(time.monotonic() - begun)
            if (action := _next(message, rng)) is not None:
                await asyncio.sleep(float(rng.exponential(THINKING)))
                name = uuid.uuid4().hex
                sent[name] = time.monotonic()
                await ws.send(json.dumps({"id": name, **action}))


def _next(screen: dict[str, Any], rng: np.random.Generator) -> dict[str, Any] | None:
    """The next thing that somebody does on a screen."""
    if screen["screen"] in ("consent", "ready"):
        return {"do": "consent" if screen["screen"] == "consent" else "ready"}
    if not screen.get("yours"):
        return None
    common = {"game": screen["game"], "turn": screen["turn"]}
    if screen["screen"] == "assistant":
        return {"do": "answered", "text": "Go through the door and turn left.", "picture": None, **common}
    if screen["turn"] % ASKING == 0 and screen["canAsk"]:
        return {"do": "asked", "text": "Which way do I go?", **common}
    if screen["turn"] > MOST_STEPS or not screen["moves"]:
        return {"do": "stopped", **common}
    move = screen["moves"][int(rng.integers(len(screen["moves"])))]
    return {"do": "moved", "candidate": move["candidate"], **common}


async def _fetch(host: str, port: int, path: str) -> bytes:
    reader, writer = await asyncio.open_connection(host, port)
    try:
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n\r\n".encode())
        return await reader.read()
    finally:
        writer.close()


@contextlib.contextmanager
def served(study: Path) -> Iterator[tuple[str, str, psutil.Process]]:
    """A server of a study in a process of its own: its address, the word of its link, and the process."""
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    command = [sys.executable, "-m", "embodied", "serve", str(study), "--port", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        for _ in range(600):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 1):
                break
            if process.poll() is not None:
                raise RuntimeError("the server did not start; run `embodied serve` to see why")
            time.sleep(0.1)
        links = json.loads((study.with_suffix(".people") / "links.json").read_text())
        yield f"http://127.0.0.1:{port}", links["join"][0].split("=")[1], psutil.Process(process.pid)
    finally:
        process.terminate()
        process.wait(30)


def measure(
    out: Path, cache: Path, *, people: int, seconds: float, seed: int, progress: Callable[[str], None]
) -> Report:
    """Build a small study in `out`, serve it, and let people take part."""
    folder = out / "serve"
    config = DatasetConfig("hanna", DatasetSize(1, 40), seed, (80.0, 110.0), people=False)
    progress("a data set of three small houses")
    build_dataset(config, folder / "data", cache, workers=1)
    draw_panoramas(config, folder / "data", cache, pictures=Unlit(size=512), workers=1)
    study = folder / "study.toml"
    study.write_text(STUDY, encoding="utf-8")
    shutil.rmtree(study.with_suffix(".people"), ignore_errors=True)
    with served(study) as (address, word, server):
        progress(f"{people} people for {seconds:g} seconds")
        begun = sum(server.cpu_times()[:2])
        times = asyncio.run(load(address, word, people, seconds, seed=seed))
        busy = sum(server.cpu_times()[:2]) - begun
    return report(times, people, seconds, busy)


def report(times: Times, people: int, seconds: float, busy: float) -> Report:
    """Percentiles in milliseconds; `busy`: processor seconds of the server."""
    facts: dict[str, object] = {"people": people, "seconds": seconds, "refused": times.refused, "server busy s": busy}
    lines = [
        f"{people} people for {seconds:g} s, {processors()} processors, load {os.getloadavg()[0]:.1f}",
        f"server    {busy:.1f} processor seconds",
    ]
    for name, values in (("step", times.steps), ("panorama", times.pictures)):
        p50, p95 = (1000 * np.percentile(values, [50, 95])).tolist() if values else (float("nan"),) * 2
        facts |= {name: {"count": len(values), "p50 ms": p50, "p95 ms": p95}}
        lines.append(f"{name:9} {len(values):6} times, p50 {p50:6.1f} ms, p95 {p95:6.1f} ms")
    return Report(facts, "\n".join(lines))
