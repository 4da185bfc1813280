"""Check that this machine can do the main job, and say what it will use.

Prints the renderer (vendor, device, software or hardware), the asset packs found, library
versions and free disk. Exits 1, with the remedy, when houses cannot be generated or rendered.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import platform
import shutil
import tempfile
import warnings
from dataclasses import asdict, dataclass

from embodied.cli import message_of
from embodied.cli.common import add_cache, add_json, add_packs, catalogue_of, show
from embodied.cli.origins import REMEDY, strangers
from embodied.distribution import DISTRIBUTION

LIBRARIES = (
    DISTRIBUTION,
    "mujoco",
    "trimesh",
    "torch",
    "opencv-python-headless",
    "rerun-sdk",
    "gymnasium",
    "mitsuba",
    "numpy",
    "shapely",
)
FREE_DISK = 2.0
"""GiB below which rendering houses will soon fail."""


@dataclass(frozen=True)
class Finding:
    """One line of the report."""

    name: str
    ok: bool
    text: str
    remedy: str = ""
    needed: bool = True
    """Whether the main job fails without it."""


def add(parser: argparse.ArgumentParser) -> None:
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    findings = []
    for look in (versions, packages, renderer, packs, path_tracer, vulkan, body, disk):
        findings.append(look(args))
        if not args.json:
            print(line(findings[-1]), flush=True)
    ok = all(f.ok for f in findings if f.needed)
    show(
        args,
        {"ok": ok, "findings": [asdict(f) for f in findings]},
        "Ready." if ok else "Not ready: mend what is marked FAIL, then run `embodied doctor` again.",
    )
    return 0 if ok else 1


def line(f: Finding) -> str:
    """What is shown of a finding, with the remedy below it."""
    mark = "ok  " if f.ok else ("FAIL" if f.needed else "note")
    return f"[{mark}] {f.name:<12} {f.text}" + ("" if f.ok else f"\n       {'':<12} -> {f.remedy}")


def versions(_: argparse.Namespace) -> Finding:
    """Python and library versions; every one listed is needed."""
    found, missing = [f"Python {platform.python_version()}"], []
    for name in LIBRARIES:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            missing.append(name)
    text = ", ".join(found) + (f"; missing: {', '.join(missing)}" if missing else "")
    return Finding("versions", not missing, text, "run `make setup`, or pip install -e . -c constraints.txt")


def packages(_: argparse.Namespace) -> Finding:
    """Whether embodied, agents, assets and viz are ours wherever Python is started."""
    found = strangers()
    return Finding("packages", not found, "; ".join(found) or "embodied, agents, assets and viz are ours", REMEDY)


def renderer(_: argparse.Namespace) -> Finding:
    """The off-screen renderer that MuJoCo gets."""
    from embodied import gl

    try:
        device = gl.info()
    except gl.GLError as e:
        return Finding("renderer", False, str(e), gl.REMEDY)
    return Finding("renderer", True, str(device))


def packs(args: argparse.Namespace) -> Finding:
    """The furniture libraries, and whether they hold every model of the catalogue."""
    from assets.importing.packs import find_packs

    remedy = (
        "apt-get install sweethome3d-furniture (version 1.8 or later), or name existing files with --pack and "
        "folders with --own"
    )
    try:
        found, missing = find_packs(tuple(args.pack)), catalogue_of(args).missing()
    except (ValueError, OSError) as e:
        return Finding("furniture", False, message_of(e), remedy)
    text = ", ".join(f"{p.name} ({p.stat().st_size / 2**20:.0f} MiB)" for p in found) or "no furniture library found"
    if missing:
        text += f"; {len(missing)} models of the catalogue are in none of them, e.g. {', '.join(missing[:3])}"
    return Finding("furniture", not missing, text, remedy)


def path_tracer(_: argparse.Namespace) -> Finding:
    """Mitsuba's back end: CUDA or LLVM; slow without them; houses are drawn unlit without Mitsuba."""
    from embodied.light.backend import SLOWER, LightError, device

    try:
        with warnings.catch_warnings(action="ignore"):
            found = device()
    except LightError as e:
        return Finding("path tracer", False, str(e), "pip install mitsuba; until then use --quality unlit", False)
    if found == "scalar":
        return Finding(
            "path tracer", False, f"Mitsuba without CUDA and LLVM, {SLOWER}", "apt-get install libllvm19", False
        )
    return Finding("path tracer", True, f"Mitsuba on {found}", needed=False)


def vulkan(_: argparse.Namespace) -> Finding:
    """The loader that the Filament back end needs."""
    import ctypes.util

    found = ctypes.util.find_library("vulkan")
    return Finding(
        "Vulkan",
        found is not None,
        found or "no Vulkan loader",
        "only --backend filament needs it: apt-get install libvulkan1 mesa-vulkan-drivers",
        False,
    )


def body(_: argparse.Namespace) -> Finding:
    """dm-control, which the driven body needs; its dependency labmaze has no wheel for Python 3.13."""
    try:
        text, found = f"dm-control {importlib.metadata.version('dm-control')}", True
    except importlib.metadata.PackageNotFoundError:
        text, found = "no dm-control", False
    return Finding(
        "driven body",
        found,
        text,
        "only environments with wheels=True need it: pip install --no-deps dm-control",
        False,
    )


def disk(args: argparse.Namespace) -> Finding:
    """Free space where the cache lives, and whether it can be written."""
    place = args.cache.absolute()
    while not place.exists():
        place = place.parent
    try:
        tempfile.TemporaryFile(dir=place).close()
    except OSError as e:
        text = f"{args.cache} cannot be written ({e.strerror}), where meshes, light and pictures go"
        return Finding("cache", False, text, "set EMBODIED_CACHE or --cache to a folder that you may write")
    free = shutil.disk_usage(place).free / 2**30
    return Finding(
        "disk",
        free >= FREE_DISK,
        f"{free:.0f} GiB free for {args.cache}",
        f"free {FREE_DISK} GiB or choose another --cache",
    )
