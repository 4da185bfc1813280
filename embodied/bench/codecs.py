"""What storing panoramas costs: bytes, decibels and milliseconds of JPEG, WebP, AVIF and PNG, on a lit flat's own."""

from __future__ import annotations

import functools
import io
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import PIL.features
import PIL.Image

from assets.catalogue import Catalogue
from embodied.generate import HouseConfig, generate_house
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import CHANNELS, beside, encode
from embodied.world import open_world

FLAT = HouseConfig(area=(60.0, 70.0))
"""The flat whose panoramas are stored."""
NODES = 12
"""Viewpoints of it, evenly chosen."""
WAYS: Sequence[tuple[str, str, dict[str, Any]]] = (
    *((f"JPEG {q}", "JPEG", {"quality": q, "subsampling": 0, "optimize": True}) for q in (75, 85, 90, 95)),
    *((f"JPEG {q}, chroma halved", "JPEG", {"quality": q, "subsampling": 2, "optimize": True}) for q in (85, 95)),
    *((f"WebP {q}", "WEBP", {"quality": q, "method": 4}) for q in (75, 85, 90, 95)),
    *((f"AVIF {q}", "AVIF", {"quality": q, "subsampling": "4:4:4", "speed": 8}) for q in (60, 75, 85, 90)),
    ("WebP lossless", "WEBP", {"lossless": True, "quality": 50, "method": 2}),
    ("PNG", "PNG", {"compress_level": 6}),
)
"""Name, Pillow's format and what it is told. WebP with loss always halves the resolution of colours."""


@dataclass(frozen=True)
class Cost:
    """What one way of storing the colours of a panorama costs, per panorama."""

    way: str
    kilobytes: float
    decibels: float
    """PSNR over all pixels of all panoramas; inf without loss."""
    worst: float
    """PSNR of the worst panorama."""
    encoding: float
    """Processor milliseconds, median."""
    decoding: float


@dataclass(frozen=True)
class Report:
    facts: dict[str, Any]
    text: str
    """Markdown."""


def compare(catalogue: Catalogue, cache: Path, seed: int, quality: str) -> Report:
    """The costs of all WAYS that are installed, on panoramas of one generated flat, and of what our own files hold."""
    with open_world(generate_house(seed, FLAT, catalogue), catalogue, cache, quality=quality) as world:
        positions = world.graph.positions
        chosen = np.linspace(0, len(positions) - 1, min(NODES, len(positions))).round().astype(int)
        panoramas = [world.renderer.panorama(positions[i]) for i in chosen]
        facts: dict[str, Any] = {"seed": seed, "area": float(world.house.area), "viewpoints": len(positions)}
    facts |= {"quality": quality, "size": panoramas[0].size, "panoramas": len(panoramas)}
    have = [w for w in WAYS if w[1] in ("JPEG", "PNG") or PIL.features.check(w[1].lower())]
    facts["costs"] = [vars(cost(name, kind, options, panoramas)) for name, kind, options in have]
    facts["file"] = our_file(panoramas)
    return Report(facts, text(facts))


def cost(name: str, kind: str, options: dict[str, Any], panoramas: Sequence[Panorama]) -> Cost:
    """Store the colours of `panoramas` one way and read them back."""
    sizes, errors, coding, reading = [], [], [], []
    for panorama in panoramas:
        picture = beside(panorama.rgb)
        data, seconds = timed(functools.partial(stored, picture, kind, options))
        coding.append(seconds)
        again, seconds = timed(functools.partial(restored, data))
        reading.append(seconds)
        sizes.append(len(data))
        errors.append(float(np.mean((again.astype(np.float64) - picture) ** 2)))
    took = [1e3 * float(np.median(seconds)) for seconds in (coding, reading)]
    return Cost(name, float(np.mean(sizes)) / 1e3, psnr(float(np.mean(errors))), psnr(max(errors)), *took)


def our_file(panoramas: Sequence[Panorama]) -> dict[str, float]:
    """Kilobytes a panorama of each channel of a PanoramaFile, and the PSNR of its colours."""
    files = [encode(p) for p in panoramas]
    errors = [
        float(np.mean((restored(f[0]).astype(np.float64) - beside(p.rgb)) ** 2)) for f, p in zip(files, panoramas)
    ]
    sizes = {c: sum(len(f[k]) for f in files) / len(files) / 1e3 for k, c in enumerate(CHANNELS)}
    return {**sizes, "decibels": psnr(float(np.mean(errors)))}


def stored(picture: np.ndarray, kind: str, options: dict[str, Any]) -> bytes:
    """(h, w, 3) uint8 as a file."""
    out = io.BytesIO()
    PIL.Image.fromarray(picture).save(out, kind, **options)
    return out.getvalue()


def restored(data: bytes) -> np.ndarray:
    """(h, w, 3) uint8 of a file."""
    return np.asarray(PIL.Image.open(io.BytesIO(data)).convert("RGB"))


def timed(job: Callable[[], Any]) -> tuple[Any, float]:
    """What a job returns, and the processor seconds that all threads took for it."""
    start = time.process_time()
    found = job()
    return found, time.process_time() - start


def psnr(error: float) -> float:
    """Decibels of a mean squared error of 8-bit values; inf for none."""
    return 10 * math.log10(255**2 / error) if error else math.inf


def text(facts: dict[str, Any]) -> str:
    """The report as Markdown."""
    lines = [
        "A flat of {area:.0f} m² (seed {seed}, {quality}, {viewpoints} viewpoints, {panoramas} of them here), "
        "six faces of {size} pixels each:".format(**facts),
        "",
        "| colours as | kB | PSNR, dB | of the worst | encoding, ms | decoding, ms |",
        "|---|---|---|---|---|---|",
    ]
    row = "| {way} | {kilobytes:.0f} | {decibels:.1f} | {worst:.1f} | {encoding:.0f} | {decoding:.1f} |"
    lines += [row.format(**cost) for cost in facts["costs"]]
    file, total = facts["file"], sum(facts["file"][c] for c in CHANNELS)
    ours = "In a panorama file: rgb {rgb:.1f} kB ({decibels:.1f} dB), depth {depth:.1f} kB, ids {ids:.1f} kB".format(
        **file
    )
    return "\n".join([*lines, "", f"{ours}; {facts['viewpoints'] * total / 1e3:.1f} MB for the flat."])
