"""What this package asks of Mitsuba's and Dr.Jit's arrays, in NumPy: for machines with neither CUDA nor LLVM.

Mitsuba's scalar variant follows one ray at a time and has no arrays. Here numbers of many rays are
NumPy arrays, and the rays are put to it one by one. Names and meanings are Mitsuba's and Dr.Jit's,
so that the rest of the package is written once: `backend.mitsuba()` and `backend.drjit()` both
return this module then. As there, arrays of one entry fit all others, also in `a += b`; unlike there that
leaves other names of `a` alone, so that no code may count on either.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import Any

import numpy as np

from embodied.light.arrays import Array, RayScene

two_pi = 2 * pi


class Values(np.ndarray):
    """(n,) numbers, or (c, n) vectors of c components; single precision, silent about entries that nobody reads."""

    x = property(lambda self: self[0])
    y = property(lambda self: self[1])
    z = property(lambda self: self[2])

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Values:
        with np.errstate(all="ignore"):
            return _values(getattr(ufunc, method)(*(_bare(a) for a in inputs), **options))

    __iadd__ = lambda self, other: self + other
    __isub__ = lambda self, other: self - other
    __imul__ = lambda self, other: self * other
    __itruediv__ = lambda self, other: self / other
    __iand__ = lambda self, other: self & other
    __ior__ = lambda self, other: self | other


def _bare(a: Array) -> Any:
    return a.view(np.ndarray) if isinstance(a, Values) else a


def _values(a: Array, dtype: Any = None) -> Values:
    if dtype is None:
        dtype = np.float32 if a.dtype == np.float64 else a.dtype
    return np.asarray(a).astype(dtype, copy=False).view(Values)


@dataclass(frozen=True)
class Type:
    """Makes arrays of one kind, as Mitsuba's classes do."""

    dtype: type
    size: int = 0
    """Components of a vector; 0 for numbers."""

    def __call__(self, *parts: Array) -> Values:
        with np.errstate(all="ignore"):
            arrays: list[np.ndarray] = [np.atleast_1d(_bare(p)).astype(self.dtype) for p in parts]
        if len(arrays) > 1:
            return np.stack(np.broadcast_arrays(*arrays)).view(Values)
        only = arrays[0]
        if self.size and only.ndim == 1:
            only = np.broadcast_to(only, (self.size, len(only)))
        return only.view(Values)


Float, UInt32, Int32, Bool = Type(np.float32), Type(np.uint32), Type(np.int32), Type(np.bool_)
Point2f, Vector3f = Type(np.float32, 2), Type(np.float32, 3)
Point3f = Normal3f = Color3f = Vector3f


def zeros(kind: Type, n: int) -> Values:
    return np.zeros((kind.size, n) if kind.size else n, kind.dtype).view(Values)


def arange(kind: Type, n: int) -> Values:
    return np.arange(n, dtype=kind.dtype).view(Values)


def opaque(kind: Type, value: float) -> Values:
    return kind(value)


def eval(*arrays: Array) -> None:
    """Nothing: these arrays are always computed."""


def flush_malloc_cache() -> None:
    """Nothing: NumPy keeps no freed arrays."""


def while_loop(
    state: tuple[Any, ...], cond: Callable[..., Any], body: Callable[..., tuple[Any, ...]]
) -> tuple[Any, ...]:
    """`body` from state to state as long as `cond` holds; all entries loop equally long."""
    while np.all(cond(*state)):
        state = body(*state)
    return state


def scatter(target: np.ndarray, value: Array, index: np.ndarray) -> None:
    """Entries of a flat array written."""
    _bare(target)[_bare(index)] = _bare(value)


def select(mask: Array, a: Array, b: Array) -> Values:
    dtype = next((x.dtype for x in (a, b) if isinstance(x, np.ndarray)), np.float32)
    return _values(np.where(_bare(mask), _bare(a), _bare(b)), dtype)


def gather(kind: Type, source: np.ndarray, index: np.ndarray, active: Array = True) -> Values:
    """Entries of a flat array, or vectors of entries that follow each other; zero where not active."""
    source, index, active = _bare(source), _bare(index), _bare(active)
    if active is not True:
        index = np.where(active, index, 0)
    found = (source.reshape(-1, kind.size)[index].T if kind.size else source[index]).astype(kind.dtype, copy=False)
    return (found if active is True else np.where(active, found, kind.dtype(0))).view(Values)


minimum, maximum, square, floor, exp, log, sqrt, abs, sin, cos, acos, atan2, isinf, power = (
    np.minimum,
    np.maximum,
    np.square,
    np.floor,
    np.exp,
    np.log,
    np.sqrt,
    np.abs,
    np.sin,
    np.cos,
    np.arccos,
    np.arctan2,
    np.isinf,
    np.power,
)


def clip(a: Array, low: Array, high: Array) -> Array:
    return np.minimum(np.maximum(a, low), high)


def sign(a: Array) -> Array:
    return np.copysign(np.float32(1), a)


def any(mask: Array) -> bool:
    return bool(np.any(mask))


def max(v: Values) -> Values:
    """The largest component."""
    return _values(_bare(v).max(0))


def dot(a: Values, b: Values) -> Values:
    return sum((a[k] * b[k] for k in range(1, len(a))), start=a[0] * b[0])


def squared_norm(a: Values) -> Values:
    return dot(a, a)


def norm(a: Values) -> Array:
    return np.sqrt(dot(a, a))


def normalize(a: Values) -> Array:
    return a / norm(a)


class Frame3f:
    """Right-handed axes (s, t, n) around normals. Source: Duff et al. 2017, listing 3, as in Mitsuba."""

    def __init__(self, n: Values) -> None:
        up = np.copysign(np.float32(1), n.z)
        a = -1 / (up + n.z)
        b = n.x * n.y * a
        self.n = n
        self.s = Vector3f(np.square(n.x) * a * up + 1, b * up, -n.x * up)
        self.t = Vector3f(b, n.y * n.y * a + up, -n.y)

    def to_world(self, v: Values) -> Values:
        return self.s * v.x + self.t * v.y + self.n * v.z


def _disk(u: Values) -> tuple[Array, Array]:
    """The unit square on the unit disk. Source: Shirley and Chiu 1997, without branches as in Mitsuba."""
    x, y = 2 * u.x - 1, 2 * u.y - 1
    wide = np.abs(x) >= np.abs(y)
    r, other = select(wide, x, y), select(wide, y, x)
    turn = select(r == 0, 0.0, other / r) * (pi / 4)
    turn = select(wide, turn, pi / 2 - turn)
    return r * np.cos(turn), r * np.sin(turn)


def _cosine_hemisphere(u: Values) -> Values:
    x, y = _disk(u)
    return Vector3f(x, y, np.sqrt(np.maximum(1 - x * x - y * y, 0)))


def _uniform_sphere(u: Values) -> Values:
    z = 1 - 2 * u.y
    r = np.sqrt(np.maximum(1 - z * z, 0))
    return Vector3f(r * np.cos(two_pi * u.x), r * np.sin(two_pi * u.x), z)


warp = types.SimpleNamespace(square_to_cosine_hemisphere=_cosine_hemisphere, square_to_uniform_sphere=_uniform_sphere)


class Ray3f:
    """Origins and directions (3, n), and how far to look."""

    def __init__(
        self, o: Values, d: Values, maxt: Array = inf, time: float = 0.0, wavelengths: Sequence[float] = ()
    ) -> None:
        self.o, self.d, self.maxt = o, d, Float(maxt)


@dataclass(frozen=True, eq=False)
class Found:
    """What rays met first; t is infinite where they met nothing."""

    t: Values
    prim_index: Values
    prim_uv: Values

    def is_valid(self) -> Array:
        return self.t < inf


class ScalarScene:
    """A scene of Mitsuba's scalar variant that is asked about arrays of rays."""

    def __init__(self, scene: RayScene, variant: types.ModuleType) -> None:
        """Wrap `scene`; `variant` is the module of its variant."""
        self._scene, self._point, self._vector, self._ray = scene, variant.Point3f, variant.Vector3f, variant.Ray3f

    def ray_test(self, ray: Ray3f, active: Array = True) -> Values:
        n, which, rays = self._listed(ray, active)
        out = np.zeros(n, bool)
        out[which] = np.fromiter(map(self._scene.ray_test, rays), bool, len(which))
        return out.view(Values)

    def ray_intersect_preliminary(self, ray: Ray3f, coherent: bool = False, active: Array = True) -> Found:
        n, which, rays = self._listed(ray, active)
        found = np.zeros(n, [("t", np.float32), ("face", np.uint32), ("u", np.float32), ("v", np.float32)])
        found["t"] = inf
        hits = map(self._scene.ray_intersect_preliminary, rays)
        found[which] = np.fromiter(((h.t, h.prim_index, *h.prim_uv) for h in hits), found.dtype, len(which))
        t, face, u, v = (np.ascontiguousarray(found[name]).view(Values) for name in ("t", "face", "u", "v"))
        return Found(t, face, Point2f(u, v))

    def _listed(self, ray: Ray3f, active: Array) -> tuple[int, np.ndarray, Iterator]:
        """How many rays there are, which are active, and those as the variant's own."""
        o, d, far, on = np.broadcast_arrays(*(_bare(a) for a in (ray.o, ray.d, ray.maxt, active)))
        which = np.nonzero(on[0])[0]
        return o.shape[1], which, self._rays((*o, *d, far[0]), which)

    def _rays(self, numbers: Sequence[np.ndarray], which: np.ndarray) -> Iterator:
        point, vector, ray = self._point, self._vector, self._ray
        for start in range(0, len(which), 100_000):  # Python's numbers take eight times the memory of NumPy's
            part = which[start : start + 100_000]
            for ox, oy, oz, dx, dy, dz, far in zip(*(a[part].tolist() for a in numbers)):
                yield ray(point(ox, oy, oz), vector(dx, dy, dz), far, 0.0, ())
