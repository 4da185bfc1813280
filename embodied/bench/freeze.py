"""Digests of what must not change by accident: houses, a lit flat, data sets, episodes, tables, features.

Taken before and after a change that should alter nothing, on one machine with one set of libraries
(floating-point results, and so these digests, may differ between machines). A file of them may say
which parts are meant to differ from then on, and why; `docs/freeze.json` is the one of this project.
"""

from __future__ import annotations

import fnmatch
import hashlib
import json
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from assets.cache import digest, write_json
from assets.catalogue import Catalogue
from embodied.datasets.scale import KINDS
from embodied.generate import HouseConfig, generate_house
from embodied.records import load_json

AREAS = ((38.0, 46.0), (56.0, 70.0), (90.0, 200.0), (150.0, 420.0))
"""Bands of floor area, square metres; ten houses are taken from each."""
HOUSES_OF_A_BAND = 10
FLAT = HouseConfig(area=(38.0, 46.0))
"""What is lit."""
CODE = ("code", "program", "version", "commit", "digest", "libraries", "seconds", "cache", "data", "folder")
"""Fields of JSON files that name the program or the place rather than the product."""
JUDGED = ("eval/hanna", "eval/hari", "judge/hanna")
"""Folders of episodes and tables."""
INTERVAL = "half_width_95"
"""Field of a table's numbers that says how wide its interval is."""


@dataclass(frozen=True)
class Frozen:
    """What was found at some commit, and what is meant to differ since."""

    digests: Mapping[str, str]
    """Name of a part to its hex digest."""
    commit: str = ""
    meant: Mapping[str, str] | None = None
    """Pattern of names ('light/*') to the reason why they differ since."""


@dataclass(frozen=True)
class Verdict:
    """One part, compared."""

    part: str
    says: str
    """'same', 'differs', 'only before' or 'only now'."""
    because: str = ""
    """Why a difference is meant; empty where none is."""

    @property
    def wrong(self) -> bool:
        return self.says != "same" and not self.because

    def __str__(self) -> str:
        expected = f", expected because {self.because}" if self.because and self.says != "same" else ""
        return f"{self.part}: {self.says}{expected}"


def load_frozen(path: Path) -> Frozen:
    """Digests in a file.

    Raises:
      RecordError: it is no such file.
    """
    return load_json(path, Frozen)


def compare(before: Frozen, found: Mapping[str, str]) -> tuple[Verdict, ...]:
    """A verdict on every part of either side, in the order of `found`."""
    reasons = before.meant or {}
    out = []
    for name in (*found, *(n for n in before.digests if n not in found)):
        old, new = before.digests.get(name), found.get(name)
        says = "same" if old == new else "only now" if old is None else "only before" if new is None else "differs"
        because = next((why for pattern, why in reasons.items() if fnmatch.fnmatchcase(name, pattern)), "")
        out.append(Verdict(name, says, because))
    return tuple(out)


def summary(verdicts: Iterable[Verdict]) -> str:
    """Parts that are the same counted by kind, the others one by one."""
    same: dict[str, int] = {}
    lines = []
    for v in verdicts:
        if v.says == "same":
            kind = v.part.split("/")[0]
            same[kind] = same.get(kind, 0) + 1
        else:
            lines.append(str(v))
    counts = ", ".join(f"{n} of {kind}" for kind, n in same.items()) or "nothing"
    return "\n".join([f"same: {counts}", *lines])


# Making the products -----------------------------------------------------------------------------


def make_products(
    folder: Path, catalogue: Catalogue, cache: Path, *, progress: Callable[[str], None] = print
) -> dict[str, str]:
    """Make everything that is compared anew in `folder`, which is emptied first; returns its digests.

    Args:
      progress: told each product before it is made.
    """
    if folder.exists() and any(folder.iterdir()) and not (folder / "houses.json").exists():
        raise ValueError(f"{folder} holds other things than freeze makes; choose another --out")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    progress("houses")
    write_json(folder / "houses.json", dict(_houses(catalogue)), indent=1)
    progress("a lit flat")
    _light(catalogue, folder / "light")
    for kind in KINDS:
        progress(f"a tiny data set: {kind}")
        _run("dataset", kind, "--out", folder / kind, *TINY, "--cache", cache)
    for words in (
        ("eval", "hanna", "--data", folder / "hanna", "--tasks", "12", "--cache", cache),
        ("eval", "hari", "--data", folder / "hari", "--split", "test_unseen_env", "--tasks", "12", "--cache", cache),
        ("features", "--data", folder / "hanna", "--cache", cache),
        ("judge", "--data", folder / "hanna", "--tasks", "12", "--threads", "1"),
    ):
        progress(" ".join(map(str, words[:2])))
        kind = "hari" if "hari" in words else "hanna"
        _run(*words, *(() if words[0] == "features" else ("--out", folder / f"{words[0]}_{kind}")))
    return digests_of(folder)


TINY = ("--scale", "tiny", "--area", "60", "110", "--workers", "1", "--panoramas", "none")


def _houses(catalogue: Catalogue) -> Iterator[tuple[str, str]]:
    for area in AREAS:
        for seed in range(HOUSES_OF_A_BAND):
            house = generate_house(seed, HouseConfig(area=area), catalogue=catalogue)
            yield f"house/{area[0]:.0f}-{area[1]:.0f}/{seed}", house.digest


def _light(catalogue: Catalogue, fresh: Path) -> None:
    from embodied import light  # loads the path tracer

    light.bake(generate_house(7, FLAT, catalogue=catalogue), catalogue, fresh, "normal")


def _run(*words: object) -> None:
    command = [sys.executable, "-m", "embodied", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr[-2000:]}")


# Digests of products -----------------------------------------------------------------------------


def digests_of(folder: Path) -> dict[str, str]:
    """Name of each part to its hex digest, of products that `make_products`, or an older program, left in `folder`.

    A part whose files are not there is left out.
    """
    found: dict[str, str] = {}
    if (folder / "houses.json").exists():
        found |= json.loads((folder / "houses.json").read_text())
    pages = sorted((folder / "light").rglob("page_*.jpg"))
    if pages:
        found["light/flat"] = digest(*(p.read_bytes() for p in pages))
    for kind in KINDS:
        if (folder / kind).exists():
            found[f"dataset/{kind}"] = folder_digest(folder / kind, leave_out=("features",))
    if (folder / "hanna" / "features").exists():
        found["features/hanna"] = folder_digest(folder / "hanna" / "features")
    for name in JUDGED:
        if (home := folder / name.replace("/", "_")).exists():
            found |= {f"{name}/{part}": value for part, value in _judged(home)}
    return found


def _judged(folder: Path) -> Iterator[tuple[str, str]]:
    """Episodes, the means of the table, the widths of its intervals, what the episodes were like."""
    yield "episodes", digest(*(p.read_bytes() for p in sorted(folder.glob("episodes*.jsonl"))))
    table = json.loads((folder / "table.json").read_text())
    widths = [{name: value.pop(INTERVAL) for name, value in row["values"].items()} for row in table]
    yield "means", digest(table)
    yield "intervals", digest(widths)
    if (folder / "behaviour.json").exists():
        yield "behaviour", digest(json.loads((folder / "behaviour.json").read_text())["behaviour"])


def folder_digest(folder: Path, leave_out: tuple[str, ...] = ()) -> str:
    """Digest of all files below a folder by relative path; JSON without what names program or place (`CODE`).

    Args:
      leave_out: names of folders in it.
    """
    entries = []
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        name = path.relative_to(folder)
        if name.parts[0] in leave_out:
            continue
        content = path.read_bytes()
        if path.suffix == ".json":
            content = json.dumps(_without_code(json.loads(content)), sort_keys=True).encode()
        elif path.suffix == ".jsonl":  # the first line of a file of episodes names the program
            lines = [_without_code(json.loads(line)) for line in content.splitlines()]
            content = json.dumps(lines, sort_keys=True).encode()
        entries.append((name.as_posix(), hashlib.sha256(content).hexdigest()))
    return digest(entries)


def _without_code(value: object) -> object:
    if isinstance(value, dict):
        return {k: _without_code(v) for k, v in value.items() if k not in CODE}
    return [_without_code(v) for v in value] if isinstance(value, list) else value
