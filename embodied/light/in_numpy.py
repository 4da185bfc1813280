"""What this package asks of Mitsuba's and Dr.Jit's arrays, in NumPy: for machines with neither CUDA nor LLVM.

Names and meanings are Mitsuba's and Dr.Jit's, so that the rest of the package is written once: `backend.mitsuba()` and
`backend.drjit()` both return this module then. Rays are Embree's where it is installed, else those of Mitsuba's scalar
variant, one by one. As there, arrays of one entry fit all others, also in `a += b`; unlike there that leaves other
names of `a` alone, so that no code may count on either.
"""

from __future__ import annotations

import importlib.util
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, pi
from typing import Any, TypeAlias

import numpy as np

from embodied.light.arrays import Array, RayScene

two_pi = 2 * pi


def variant() -> str:
    """As Mitsuba names what it computes with."""
    return "numpy"


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
            arrays: list[np.ndarray] = [np.atleast_1d(_bare(p)).astype(self.dtype, copy=False) for p in parts]
        if len(arrays) > 1:
            return np.stack(np.broadcast_arrays(*arrays)).view(Values)
        only = arrays[0]
        if self.size and only.ndim == 1:
            only = np.broadcast_to(only, (self.size, len(only)))
        return only.view(Values)


Float, UInt32, Int32, Bool = Type(np.float32), Type(np.uint32), Type(np.int32), Type(np.bool_)
Point2f, Vector3f, Vector4f = (Type(np.float32, size) for size in (2, 3, 4))
Point3f = Normal3f = Color3f = Vector3f


zeros = lambda kind, n: np.zeros((kind.size, n) if kind.size else n, kind.dtype).view(Values)
arange = lambda kind, n: np.arange(n, dtype=kind.dtype).view(Values)
opaque = lambda kind, value: kind(value)
eval = lambda *arrays: None
"""Nothing: these arrays are always computed."""
flush_malloc_cache = lambda: None
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


def gather(kind: Type | type, source: np.ndarray, index: np.ndarray, active: Array = True) -> Values:
    """Entries of a flat array, or vectors of entries that follow each other; zero where not active.

    Of the type of `source` itself they are entries of its components.
    """
    if not isinstance(kind, Type):
        return source[..., _bare(index)].view(Values)
    source, index, active = _bare(source), _bare(index), _bare(active)
    if active is not True:
        index = np.where(active, index, 0)
    found = (source.reshape(-1, kind.size)[index].T if kind.size else source[index]).astype(kind.dtype, copy=False)
    return (found if active is True else np.where(active, found, kind.dtype(0))).view(Values)


minimum, maximum, square, floor, power = np.minimum, np.maximum, np.square, np.floor, np.power
exp, log, sqrt, abs, isinf, isfinite = np.exp, np.log, np.sqrt, np.abs, np.isinf, np.isfinite
sin, cos, asin, acos, atan2 = np.sin, np.cos, np.arcsin, np.arccos, np.arctan2
clip = lambda a, low, high: np.minimum(np.maximum(a, low), high)
sign = lambda a: np.copysign(np.float32(1), a)
any = lambda mask: bool(np.any(mask))
max = lambda v: _values(_bare(v).max(0))
"""The largest component."""
dot = lambda a, b: sum((a[k] * b[k] for k in range(1, len(a))), start=a[0] * b[0])
squared_norm = lambda a: dot(a, a)
norm = lambda a: np.sqrt(dot(a, a))
normalize = lambda a: a / norm(a)


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


Met: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Triangle that each of k rays meets first, -1 for none, how far away, and where on it: (k,) each."""
Meet: TypeAlias = Callable[..., Met]
"""From origins and directions (k, 3) and how far to look (k,) to what is met."""


class Triangles:
    """Triangles that arrays of rays are put to."""

    def __init__(self, meet: Meet) -> None:
        self._meet = meet

    def ray_test(self, ray: Ray3f, active: Array = True) -> Values:
        """Whether rays meet anything; as in Mitsuba, those of negative length do."""
        return self.ray_intersect_preliminary(ray, False, active).is_valid() | (ray.maxt < 0)

    def ray_intersect_preliminary(self, ray: Ray3f, coherent: bool = False, active: Array = True) -> Found:
        o, d, far, on = np.broadcast_arrays(*(_bare(a) for a in (ray.o, ray.d, ray.maxt, active)))
        n, which = o.shape[1], np.flatnonzero(on[0])
        found = Found(Float(np.full(n, inf)), zeros(UInt32, n), zeros(Point2f, n))
        if len(which):
            start, onward = (np.ascontiguousarray(a[:, which].T) for a in (o, d))
            face, t, u, v = self._meet(start, onward, np.minimum(far[0, which], np.float32(1e9)))
            hit = face >= 0
            which = which[hit]
            found.t[which], found.prim_index[which] = t[hit], face[hit]
            found.prim_uv[:, which] = u[hit], v[hit]
        return found


def embree(corners: np.ndarray) -> Meet | None:
    """Embree's rays among triangles (m, 3, 3), on the thread that asks and as far as there is anything where `far` is
    left out; None where it is not installed."""
    if importlib.util.find_spec("embreex") is None:
        return None
    from embreex import mesh_construction, rtcore_scene  # late: not for every machine

    scene = rtcore_scene.EmbreeScene()
    mesh_construction.TriangleMesh(scene, np.ascontiguousarray(corners, np.float32))

    def meet(o: np.ndarray, d: np.ndarray, far: np.ndarray | None = None) -> Met:
        single = (np.ascontiguousarray(a, np.float32) for a in (o, d))
        found = scene.run(*single, dists=far, output=1)
        return found["primID"], found["tfar"], found["u"], found["v"]

    return meet


def one_by_one(scene: RayScene, mi: types.ModuleType) -> Meet:
    """The rays of a scene of `mi`, Mitsuba in its scalar variant."""
    kind = [("face", np.int32), ("t", np.float32), ("u", np.float32), ("v", np.float32)]

    def one(ox: float, oy: float, oz: float, dx: float, dy: float, dz: float, far: float) -> tuple:
        ray = mi.Ray3f(mi.Point3f(ox, oy, oz), mi.Vector3f(dx, dy, dz), far, 0.0, ())
        hit = scene.ray_intersect_preliminary(ray)
        return (hit.prim_index, hit.t, *hit.prim_uv) if hit.t < inf else (-1, inf, 0.0, 0.0)

    def meet(o: np.ndarray, d: np.ndarray, far: np.ndarray) -> Met:
        parts = [slice(k, k + 100_000) for k in range(0, len(o), 100_000)]  # Python's numbers take much memory
        rays = (row for p in parts for row in zip(*o[p].T.tolist(), *d[p].T.tolist(), far[p].tolist()))
        found = np.fromiter((one(*row) for row in rays), kind, len(o))
        return found["face"], found["t"], found["u"], found["v"]

    return meet
