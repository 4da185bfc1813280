"""Our distribution's name, the processors and threads that we use, and libraries that `embodied doctor --fix` brings
to machines where nobody may install packages of the system.

The wheel lavavu-osmesa (Linux, x86-64) carries software OpenGL (OSMesa) and LLVM; nothing of LavaVu itself is used.
libatomic, which Dr.Jit's wheel expects of the system, is unpacked from Debian's package into the environment; so are
the furniture libraries where pip finds no wheel of them.
"""

import contextlib
import ctypes
import ctypes.util
import functools
import importlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from embodied.assets.cache import atomic_path

ATOMIC = "libatomic.so.1"
FOLDER = "lavavu_osmesa.libs"
WHEEL = "lavavu"


@functools.cache
def bundled(stem: str) -> Path | None:
    """The library 'OSMesa' or 'LLVM' of the wheel, loaded with all it needs; None where the wheel is not installed or
    does not fit this machine."""
    spec = importlib.util.find_spec(WHEEL)
    if spec is None or spec.origin is None:
        return None
    folder = Path(spec.origin).parent.parent / FOLDER
    load_triton_first()
    libraries = sorted(folder.glob(f"lib{stem}-*.so*"))
    return libraries[0] if libraries and _loaded(folder, libraries[0]) else None


def _loaded(folder: Path, wanted: Path) -> bool:
    """Load the libraries of `folder` until `wanted` is among them: each needs others by names that only this finds."""
    waiting = sorted(folder.glob("*.so*"))
    while waiting:
        left = [path for path in waiting if not _try(path)]
        if wanted not in left:
            return True
        if left == waiting:
            return False
        waiting = left
    return False


def _try(path: Path) -> bool:
    try:
        ctypes.CDLL(str(path))
    except OSError:
        return False
    return True


@functools.cache
def load_triton_first() -> None:
    """Load the library of triton, which comes with PyTorch's CUDA build, before Mesa's drivers or the wheel's LLVM.

    All contain LLVM, and Mesa before 24.1 makes its own visible to all that is loaded later: loading triton
    afterwards, as PyTorch's optimisers do, ends in a segmentation fault.
    """
    spec = importlib.util.find_spec("triton")
    for folder in (spec.submodule_search_locations or ()) if spec else ():
        _try(Path(folder) / "_C" / "libtriton.so")  # or it cannot be loaded at all


def bind_osmesa() -> None:
    """Let PyOpenGL, and so MuJoCo, use the wheel's OSMesa where the system has none; call it before importing them."""
    library, load = bundled("OSMesa"), ctypes.CDLL
    if library is None or ctypes.util.find_library("OSMesa") is not None:
        return
    loader: Any = ctypes.cdll  # what PyOpenGL loads libraries with, by names that the linker does not find
    loader._dlltype = lambda name, mode: load(str(library) if "OSMesa" in str(name) else name, mode)
    try:
        importlib.import_module("OpenGL.platform")
    finally:
        loader._dlltype = load


def load_atomic(folder: Path = Path(sys.prefix, "lib")) -> bool:
    """Load libatomic, the system's or the one in `folder`, for libraries that are loaded later; whether it is there."""
    return sys.platform != "linux" or _try(Path(ATOMIC)) or _try(folder / ATOMIC)


def bring_atomic(folder: Path = Path(sys.prefix, "lib")) -> bool:
    """Unpack libatomic of the Debian or Ubuntu package into `folder`, without root; whether it is there then."""
    return unpack("libatomic1", ATOMIC, folder) and load_atomic(folder)


def unpack(package: str, pattern: str, folder: Path) -> bool:
    """Copy the files of a Debian or Ubuntu package whose names match into `folder`, without root; whether any did."""
    with tempfile.TemporaryDirectory() as place, contextlib.suppress(OSError, subprocess.SubprocessError):
        Path(place, "lists", "partial").mkdir(parents=True)
        lists = ["-o", f"Dir::State::lists={place}/lists", "-o", f"Dir::Cache={place}"]
        for order in (["apt-get", *lists, "update"], ["apt-get", *lists, "download", package]):
            subprocess.run(order, cwd=place, check=True, capture_output=True)
        (file,) = Path(place).glob(f"{package}_*.deb")
        subprocess.run(["dpkg-deb", "-x", file.name, "whole"], cwd=place, check=True, capture_output=True)
        files = list(Path(place, "whole").rglob(pattern))
        folder.mkdir(parents=True, exist_ok=True)
        for path in files:  # where a name links to another file, that file
            with atomic_path(folder / path.name) as draft:
                shutil.copyfile(path, draft)
        return bool(files)
    return False


def processors() -> int:
    """Processors that this process may run on; all there are on systems that do not tell, such as macOS."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads_allowed() -> int | None:
    """Threads that this process should use, as OMP_NUM_THREADS has it but no more than there are processors; None where
    nobody says.

    The workers of joblib and of Ray get it as their share of the machine. Without it every process takes all
    processors, and threads that wait for work do so awake (docs/scaling.md).
    """
    first = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()  # a list is for nested loops
    return min(int(first), processors()) if first.isdecimal() and int(first) > 0 else None


def keep_drawing_to_threads() -> None:
    """Have Mesa's software OpenGL, which is not open yet, and OpenCV draw with as many threads as are allowed."""
    threads = threads_allowed()
    if threads is None:
        return
    import cv2

    os.environ.setdefault("LP_NUM_THREADS", str(threads if threads > 1 else 0))  # 0: in the thread that draws
    cv2.setNumThreads(threads)


DISTRIBUTION = "embodied-houses"
"""The distribution's name for pip; `embodied` on PyPI is another project's."""
