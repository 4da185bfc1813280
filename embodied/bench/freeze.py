"""Digests of what must not change by accident: houses, a lit flat, data sets, episodes and tables.

Taken before and after a change that should alter nothing, on one machine with one set of libraries
(floating-point results, and so these digests, may differ between machines).
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from assets.cache import digest
from assets.catalogue import Catalogue
from embodied.datasets.scale import KINDS
from embodied.generate import HouseConfig, generate_house

AREAS = ((38.0, 46.0), (56.0, 70.0), (90.0, 200.0), (150.0, 420.0))
"""Bands of floor area, square metres; ten houses are taken from each."""
HOUSES_OF_A_BAND = 10
FLAT = HouseConfig(area=(38.0, 46.0))
"""What is lit."""
CODE = ("code", "program", "version", "commit", "digest", "libraries", "seconds", "cache", "data", "folder")
"""Fields of JSON files that name the program or the place rather than the product."""


def digests(
    catalogue: Catalogue, cache: Path, *, lit: bool = True, progress: Callable[[str], None] = print
) -> dict[str, str]:
    """Name of a product to its hex digest, in a fixed order.

    Args:
      lit: also light a flat, which takes minutes.
      progress: told each name as it is done.
    """
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, value in _all(catalogue, cache, Path(folder), lit):
            found[name] = value
            progress(f"{name} {value[:16]}")
    return found


def changes(before: dict[str, str], after: dict[str, str]) -> list[str]:
    """One line for each product that differs or stands on one side only."""
    names = [*before, *(n for n in after if n not in before)]
    words = {True: "changed", False: "only on one side"}
    return [f"{n}: {words[n in before and n in after]}" for n in names if before.get(n) != after.get(n)]


def _all(catalogue: Catalogue, cache: Path, folder: Path, lit: bool) -> Iterator[tuple[str, str]]:
    yield from _houses(catalogue)
    if lit:
        yield "light/flat", _light(catalogue, cache)
    for kind in KINDS:
        data = folder / kind
        small = ("--scale", "tiny", "--area", "60", "110", "--panoramas", "none")
        _run("dataset", kind, "--out", data, *small, "--cache", cache)
        yield f"dataset/{kind}", folder_digest(data)
    yield "eval/hanna", _judged(folder, "eval", "hanna", "--data", folder / "hanna", "--tasks", "12", "--cache", cache)
    yield (
        "eval/hari",
        _judged(
            folder,
            "eval",
            "hari",
            "--data",
            folder / "hari",
            "--split",
            "test_unseen_env",
            "--tasks",
            "12",
            "--cache",
            cache,
        ),
    )
    _run("features", "--data", folder / "hanna", "--cache", cache)
    yield "judge/hanna", _judged(folder, "judge", "--data", folder / "hanna", "--tasks", "12", "--cache", cache)


def _houses(catalogue: Catalogue) -> Iterator[tuple[str, str]]:
    for area in AREAS:
        for seed in range(HOUSES_OF_A_BAND):
            house = generate_house(seed, HouseConfig(area=area), catalogue=catalogue)
            yield f"house/{area[0]:.0f}-{area[1]:.0f}/{seed}", house.digest


def _light(catalogue: Catalogue, cache: Path) -> str:
    from embodied import light  # loads the path tracer

    with tempfile.TemporaryDirectory() as fresh:  # lit anew, whatever the cache holds
        house = generate_house(7, FLAT, catalogue=catalogue)
        lit = light.bake(house, catalogue, Path(fresh), next(iter(light.QUALITIES))).lit
    meshes = [(m.owner, m.page, m.vertices.tobytes(), m.faces.tobytes(), m.uv.tobytes()) for m in lit.meshes]
    return digest(
        [hashlib.sha256(p.tobytes()).hexdigest() for p in lit.pages],
        [(o, p, *(hashlib.sha256(b).hexdigest() for b in rest)) for o, p, *rest in meshes],
    )


def _judged(folder: Path, *words: object) -> str:
    out = Path(tempfile.mkdtemp(dir=folder))
    _run(*words, "--out", out)
    return folder_digest(out)


def _run(*words: object) -> None:
    command = [sys.executable, "-m", "embodied", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr[-2000:]}")


def folder_digest(folder: Path) -> str:
    """Digest of all files below a folder by relative path; JSON without what names program or place (`CODE`)."""
    entries = []
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        content = path.read_bytes()
        if path.suffix == ".json":
            content = json.dumps(_without_code(json.loads(content)), sort_keys=True).encode()
        elif path.suffix == ".jsonl":  # the first line of a file of episodes names the program
            lines = [_without_code(json.loads(line)) for line in content.splitlines()]
            content = json.dumps(lines, sort_keys=True).encode()
        entries.append((path.relative_to(folder).as_posix(), hashlib.sha256(content).hexdigest()))
    return digest(entries)


def _without_code(value: object) -> object:
    if isinstance(value, dict):
        return {k: _without_code(v) for k, v in value.items() if k not in CODE}
    return [_without_code(v) for v in value] if isinstance(value, list) else value
