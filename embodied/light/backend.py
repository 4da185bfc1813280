"""Finds and starts Mitsuba, and holds the few helpers that all of `embodied.light` shares.

Mitsuba's variants compile kernels: `cuda_ad_rgb` where a GPU is, else `llvm_ad_rgb`, which
needs a shared libLLVM of version 15 or later (`embodied doctor --fix`, or Debian: `apt install libllvm19`).
"""

import ctypes
import ctypes.util
import functools
import glob
import os
import re
import types
import warnings
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from embodied.errors import UnableError
from embodied.software import bundled, load_atomic, threads_allowed

# What Mitsuba and Dr.Jit compute with has no static types: names for what signatures hold.
Array: TypeAlias = Any
"""Numbers of n rays or points, or (c, n) vectors; a Python number or True fits all of them."""
Ray: TypeAlias = Any
"""n rays: origins and directions (3, n)."""
RayScene: TypeAlias = Any
"""Triangles that rays can be put to."""
Triple: TypeAlias = Sequence[float] | np.ndarray
"""(3,) numbers: a place in metres or a direction, world."""


_LLVM_PLACES = (
    "/usr/lib/*/libLLVM*.so*",
    "/usr/lib64/libLLVM*.so*",
    "/usr/lib/llvm-*/lib/libLLVM*.so*",
    "/usr/local/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib",
)
OLDEST_LLVM = 15
VARIANTS = (("cuda_ad_rgb", "CUDA"), ("llvm_ad_rgb", "LLVM"))
"""Mitsuba's variants with arrays, best first, and what Dr.Jit needs for each."""
LLVM_REMEDY = (
    "run `embodied doctor --fix` on Linux on x86-64, elsewhere install LLVM (Debian: apt install libllvm19, macOS: "
    "brew install llvm) or name it in DRJIT_LIBLLVM_PATH"
)


class LightError(UnableError):
    """Light cannot be computed: says what was expected, what came and what to do."""


def find_llvm() -> str | None:
    """Path of the newest libLLVM on this machine that Dr.Jit can use; None if there is none."""
    versions = []
    for place in _LLVM_PLACES:
        for path in sorted(glob.glob(place)):
            version = re.search(r"libLLVM(?:[-.]so[-.]|[-.])?(?:so\.)?(\d+)", os.path.basename(path))
            if version and OLDEST_LLVM <= int(version[1]) < 40:
                versions.append((int(version[1]), path))
    return max(versions)[1] if versions else ctypes.util.find_library("LLVM") or (str(bundled("LLVM") or "") or None)


@functools.cache
def mitsuba() -> types.ModuleType:
    """Mitsuba with its best variant switched on.

    Raises:
      LightError: Mitsuba is not installed, or there is neither CUDA nor LLVM.
    """
    if "DRJIT_LIBLLVM_PATH" not in os.environ and (llvm := find_llvm()):
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm  # Dr.Jit reads it once, when it is imported
    load_atomic()
    try:
        import drjit as dr
        import mitsuba as mi
    except (ImportError, NameError) as e:  # NameError: Dr.Jit's own, where a library of the system is missing
        why = str(e.__context__ or e)
        remedy = "pip install mitsuba"
        if "libatomic" in why:
            remedy = "apt-get install libatomic1 or, without root on Debian and Ubuntu, embodied doctor --fix"
        raise LightError(f"light needs mitsuba ({why}); {remedy}, or look at houses without light (unlit)") from e

    mi.set_variant(variant_of(lambda name: bool(dr.has_backend(getattr(dr.JitBackend, name)))))
    if (threads := threads_allowed()) is not None:
        dr.set_thread_count(threads)
    return mi


def variant_of(has_backend: Callable[[str], bool]) -> str:
    """The Mitsuba variant to use: CUDA's before LLVM's.

    Args:
      has_backend: whether Dr.Jit can use 'CUDA' or 'LLVM' here.

    Raises:
      LightError: it can use neither.
    """
    for variant, name in VARIANTS:
        if has_backend(name):
            return variant
    raise LightError(
        f"light needs LLVM {OLDEST_LLVM} or later, or CUDA, and neither works here; {LLVM_REMEDY}, or look at houses "
        "without light (unlit)"
    )


def drjit() -> types.ModuleType:
    """Dr.Jit, for what can be done with Mitsuba's arrays; raises LightError as `mitsuba`."""
    mitsuba()
    import drjit as dr

    return dr


class _Late:
    """A module that is found when something of it is used."""

    def __init__(self, find: Callable[[], types.ModuleType]) -> None:
        self._find = find

    def __getattr__(self, name: str) -> Any:
        return getattr(self._find(), name)


mi, dr = _Late(mitsuba), _Late(drjit)


def device() -> str:
    """'cuda' or 'llvm': what the light is computed on, for fingerprints and tables; raises LightError as `mitsuba`."""
    return mitsuba().variant().split("_")[0]


def scene_of(corners: np.ndarray) -> RayScene:
    """A scene of bare triangles, for ray tests only. `corners`: (m, 3, 3) metres; triangle i is primitive i."""
    m = len(corners)
    mesh = mi.Mesh("triangles", 3 * m, m)
    params = mi.traverse(mesh)
    params["vertex_positions"] = np.ascontiguousarray(corners, np.float32).ravel()
    params["faces"] = np.arange(3 * m, dtype=np.uint32)
    params.update()
    scene = mi.load_dict({"type": "scene", "triangles": mesh})
    return Apart(scene) if _one_scene_per_kernel() else scene


def _one_scene_per_kernel() -> bool:
    """True where rays are traced by OptiX, which meets nothing where one kernel traces rays in two scenes."""
    return device() == "cuda"


@dataclass(frozen=True)
class Apart:
    """A scene whose rays are traced by kernels of their own. No recorded loop can hold these: use `looped`."""

    scene: RayScene

    def ray_test(self, ray: Ray, active: Array = True) -> Array:
        return _evaluated(self.scene.ray_test(ray, active))

    def ray_intersect_preliminary(self, ray: Ray, coherent: bool = False, active: Array = True) -> Any:
        return _evaluated(self.scene.ray_intersect_preliminary(ray, coherent, active))


def _evaluated(hits: Any) -> Any:
    dr.eval(hits)
    return hits


def looped(
    state: tuple[Array, ...], cond: Callable[..., Array], body: Callable[..., tuple[Array, ...]]
) -> tuple[Array, ...]:
    """`while_loop` of Dr.Jit around rays: one kernel, or several for each round where `scene_of` keeps scenes apart."""
    if _one_scene_per_kernel():
        return dr.while_loop(state, cond, body, mode="evaluated")
    return dr.while_loop(state, cond, body)


ALIGNED = 64
"""Bytes: what Dr.Jit's widest loads want."""


def floats(a: ArrayLike) -> Array:
    """Numbers of any shape, flat on the device."""
    return mi.Float(_aligned(a, np.float32))


def unsigned(a: ArrayLike) -> Array:
    """`floats` for whole numbers from 0 to 2**32 - 1."""
    return mi.UInt32(_aligned(a, np.uint32))


def signed(a: ArrayLike) -> Array:
    """`floats` for whole numbers with a sign."""
    return mi.Int32(_aligned(a, np.int32))


def booleans(a: ArrayLike) -> Array:
    """`floats` for truth values."""
    return mi.Bool(_aligned(a, np.bool_))


def _aligned(a: ArrayLike, kind: type) -> np.ndarray:
    """The numbers (n,) at an address that is a multiple of `ALIGNED`.

    Dr.Jit computes with NumPy's memory where that lies, and compiles a kernel anew for each way in which its inputs
    are aligned or not: with chance addresses a bake compiled some eighty kernels that it had compiled before.
    """
    flat: np.ndarray = np.asarray(a).astype(kind, copy=False).ravel()
    if flat.ctypes.data % ALIGNED == 0:
        return flat
    room = np.empty(flat.nbytes + ALIGNED, np.uint8)
    out: np.ndarray = room[-room.ctypes.data % ALIGNED :][: flat.nbytes].view(kind)
    out[:] = flat
    return out


def vector(a: np.ndarray) -> Array:
    """(n, 3) array as mi.Vector3f."""
    return mi.Vector3f(*(floats(a[:, k]) for k in range(3)))


def array(v: Array) -> np.ndarray:
    """A Dr.Jit vector or colour as an (n, 3) float32 array."""
    dr.eval(v)
    return np.ascontiguousarray(np.stack([np.asarray(v[k]) for k in range(3)], axis=-1), np.float32)


def brightness(e: np.ndarray) -> np.ndarray:
    """(n,) float32 means of (n, 3) light."""
    return np.asarray(e, np.float32) @ np.full(3, 1 / 3, np.float32)


def opaque_float(x: float) -> Array:
    """A number that kernels read as data, so that changing it compiles nothing anew."""
    return dr.opaque(mi.Float, float(x))


def free_memory() -> None:
    """Give back the memory of finished stages: Dr.Jit keeps freed arrays, and the C library freed pages, for later."""
    dr.flush_malloc_cache()
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def fraction(u: Array) -> Array:
    """The part of device numbers or points behind the decimal point."""
    return u - dr.floor(u)


def bilinear(x: Array, y: Array) -> tuple[Array, Array, tuple[tuple[int, int, Array], ...]]:
    """Column and row of the first of the four pixels around places, and how far to the right and down each of the four
    lies, with its weight."""
    x0, y0 = dr.floor(x), dr.floor(y)
    fx, fy = x - x0, y - y0
    across, down = ((0, 1 - fx), (1, fx)), ((0, 1 - fy), (1, fy))
    return x0, y0, tuple((dx, dy, wx * wy) for dx, wx in across for dy, wy in down)


def opaque_uint(x: int) -> Array:
    """A whole number that kernels read as data, so that changing it compiles nothing anew."""
    return dr.opaque(mi.UInt32, int(x))


def accumulate(count: int, one: Callable[[Array], tuple[Array, ...]], *zeros: Array) -> tuple[Array, ...]:
    """Sums of what `one` returns for 0 to `count` - 1, in one kernel where rays allow it (`looped`).

    Args:
      one: from a device number k (UInt32) to as many arrays as there are `zeros`.
      zeros: device arrays to begin with.
    """
    last = opaque_uint(count)
    body = lambda k, *totals: (k + 1, *(t + x for t, x in zip(totals, one(k))))
    totals = looped((mi.UInt32(0), *zeros), lambda k, *_: k < last, body)[1:]
    dr.eval(*totals)
    return totals


def warn(message: str) -> None:
    """Tell the user about a fall-back."""
    warnings.warn(message, RuntimeWarning, stacklevel=3)


T = TypeVar("T")
LightingCache: TypeAlias = dict[Hashable, Any]
"""Results by name; owned by those who light a house several times."""


def get_or_compute(memory: LightingCache | None, key: Hashable, make: Callable[[], T]) -> T:
    """Result of `make` when `key` was first asked for; without a cache it is made each time."""
    if memory is None:
        return make()
    if key not in memory:
        memory[key] = make()
    known: T = memory[key]
    return known
