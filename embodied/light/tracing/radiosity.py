"""Light transport between luxels: direct light from sky, lamps and sun, then bounces.

For every luxel we keep e = E / pi, so that a diffuse surface shows albedo * e. The luxel positions
and all rays live in Mitsuba; no BSDF is ever evaluated, which is where the speed comes from.

Source: steps 6 to 11 of the bake prototype's recipe; the last gather is final gathering over a
radiosity solution (Reichert 1992).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from embodied.geometry import r2
from embodied.light.backend import (
    Array,
    LightingCache,
    Ray,
    RayScene,
    accumulate,
    array,
    bilinear,
    booleans,
    dr,
    floats,
    fraction,
    mi,
    opaque_float,
    opaque_uint,
    scene_of,
    unsigned,
    vector,
)
from embodied.light.pages.atlas import Atlas
from embodied.light.pages.cover import Texels, sources
from embodied.light.pages.unwrap import face_normals
from embodied.light.tracing.emitters import GLAZING, Lamp, Portal

LIFT = 2e-3
"""Metres by which rays start above their surface."""
ENV_ROWS = 32


@dataclass(frozen=True, eq=False)
class Points:
    """Surface points on the device; n of them, Dr.Jit arrays."""

    n: int
    position: Array
    normal: Array
    face_normal: Array
    thin: Array
    turn0: Array
    turn1: Array
    """Per-point rotation of the sample sequences (Cranley and Patterson 1976)."""

    def sample(self, k: Array) -> Array:
        """Two numbers in [0, 1) for every point (a Point2f), the k-th of its sequence."""
        a, b = r2(mi.Float(k) + 1)
        return fraction(mi.Point2f(self.turn0 + a, self.turn1 + b))


def points_of(
    position: np.ndarray, normal: np.ndarray, face_normal: np.ndarray, thin: np.ndarray, turn: np.ndarray | None = None
) -> Points:
    """Upload points; all arrays (n, 3) but `thin` (n,). `turn`: (2, n) float32 in [0, 1), random by default."""
    turn = np.random.default_rng(0).random((2, len(position)), np.float32) if turn is None else turn
    p = Points(
        len(position),
        mi.Point3f(vector(position)),
        vector(normal),
        vector(face_normal),
        booleans(thin),
        floats(turn[0]),
        floats(turn[1]),
    )
    dr.eval(p.position, p.normal, p.face_normal, p.thin, p.turn0, p.turn1)
    return p


def woven(index: np.ndarray, width: int, rays: int) -> np.ndarray:
    """(2, n) float32 turns for the texels at flat positions `index` of a page: any five by five of them have
    consecutive parts, of `rays` points each, of one R2 sequence, and what is smoothed over them has less noise.

    Source: A. Keller and W. Heidrich, Interleaved sampling (2001).
    """
    row, column = np.divmod(index, width)
    return np.stack([x % 1.0 for x in r2((5.0 * row + column) * rays)]).astype(np.float32)


def only(p: Points, which: np.ndarray) -> Points:
    """Some of the points, by their numbers."""
    if len(which) == p.n:
        return p
    numbers = unsigned(which)
    fields = (p.position, p.normal, p.face_normal, p.thin, p.turn0, p.turn1)
    some = Points(len(which), *(dr.gather(type(a), a, numbers) for a in fields))
    dr.eval(some.position, some.normal, some.face_normal, some.thin, some.turn0, some.turn1)
    return some


@dataclass(frozen=True, eq=False)
class Space:
    """The house as something rays can hit; faces in page order."""

    scene: RayScene
    opaque_faces: np.ndarray
    """(f,) int, position in page order of each face of `scene`; glass is left out."""
    page: Array
    """Page of each face (device), then the same for:"""
    luxel_xy: Array
    normal: Array
    thin: Array
    width: Array
    height: Array
    base: Array
    luxel_of: Array
    """Per page pixel the luxel to read: the pixel's own or the nearest one that is covered."""
    env: Array
    """Outdoor radiance (ENV_ROWS x 2 ENV_ROWS pixels, flat RGB)."""


def space_of(atlas: Atlas, luxels: Sequence[Texels]) -> Space:
    """Upload the house, below a black sky. `luxels`: what lies under each page at fineness 1."""
    corners = np.concatenate([p.corners for p in atlas.pages])
    page = np.concatenate([np.full(len(p.corners), i) for i, p in enumerate(atlas.pages)])
    keep = np.nonzero(~np.array([p.glass for p in atlas.pages])[page])[0]
    xy = np.concatenate([p.luxels for p in atlas.pages])[keep]
    thin = np.concatenate([p.thin for p in atlas.pages])[keep]
    sizes = np.array([p.width * p.height for p in atlas.pages])
    return Space(
        scene_of(corners[keep]),
        keep,
        unsigned(page[keep]),
        floats(xy),
        floats(face_normals(corners[keep])),
        booleans(thin),
        unsigned([p.width for p in atlas.pages]),
        unsigned([p.height for p in atlas.pages]),
        unsigned(np.cumsum(sizes) - sizes),
        unsigned(_nearest_luxel(luxels)),
        floats(np.zeros((ENV_ROWS, 2 * ENV_ROWS, 3))),
    )


def with_env(space: Space, env: np.ndarray) -> Space:
    """The same space below another sky (h, 2h, 3)."""
    return replace(space, env=floats(small_sky(env)))


@dataclass(frozen=True)
class Together:
    """Several scenes as one, for shadow rays."""

    scenes: tuple[RayScene, ...]

    def ray_test(self, ray: Ray, active: Array = True) -> Array:
        """True for rays that meet anything."""
        blocked = self.scenes[0].ray_test(ray, active)
        for scene in self.scenes[1:]:
            blocked |= scene.ray_test(ray, active)
        return blocked


def scenes_without(space: Space, atlas: Atlas, owners: Sequence[str]) -> dict[str, RayScene]:
    """For each of some owners of faces, the same house for shadow rays that pass through everything of it."""
    corners = np.concatenate([p.corners for p in atlas.pages])[space.opaque_faces]
    whose = np.concatenate([p.owner for p in atlas.pages])[space.opaque_faces]
    numbers = {o: atlas.owners.index(o) for o in owners}
    theirs = np.isin(whose, list(numbers.values()))
    rest = scene_of(corners[~theirs]) if numbers else None
    others = {o: corners[theirs & (whose != k)] for o, k in numbers.items()}
    return {o: Together((rest, scene_of(c))) if len(c) else rest for o, c in others.items()}


def _nearest_luxel(luxels: Sequence[Texels]) -> np.ndarray:
    """For every pixel of every page, in order, the number of the luxel to read there: its own or the nearest; 0 on a
    page without any."""
    counts = [len(t.index) for t in luxels]
    starts = np.where(counts, np.cumsum(counts) - counts, 0)
    return np.concatenate([start + sources(t.index, t.shape) for start, t in zip(starts, luxels)])


def env_lookup(env: Array, d: Array, active: Array = True) -> Array:
    """Radiance in direction `d` of `Space.env`, bilinear."""
    h, w = ENV_ROWS, 2 * ENV_ROWS
    x = (dr.pi - dr.atan2(d.y, d.x)) / dr.two_pi * w - 0.5
    y = dr.clip(dr.acos(dr.clip(d.z, -1, 1)) / dr.pi * h - 0.5, 0, h - 1.001)
    x0, y0, around = bilinear(x, y)
    xi = mi.UInt32(mi.Int32(x0) + w)
    out = mi.Color3f(0.0)
    for dx, dy, weight in around:
        out += dr.gather(mi.Color3f, env, (mi.UInt32(y0) + dy) * w + (xi + dx) % w, active) * weight
    return out


def open_sky(scene: RayScene, env: Array, p: Points, samples: int, hidden: Array) -> np.ndarray:
    """(n, 3) e from the sky `env` on the points' front, by so many ways each; `hidden` (a Color3f) where things are."""

    def one(k: Array) -> tuple[Array, ...]:
        d = mi.Frame3f(p.normal).to_world(mi.warp.square_to_cosine_hemisphere(p.sample(k)))
        free = ~scene.ray_test(mi.Ray3f(p.position + p.face_normal * LIFT, d))
        return (dr.select(free, env_lookup(env, d, free), hidden),)

    return array(accumulate(samples, one, dr.zeros(mi.Color3f, p.n))[0]) / samples


def sky_light(space: Space, p: Points, portal: Portal, samples: int, memory: LightingCache | None = None) -> Array:
    """e (a Color3f) from the outdoors through one portal, by area sampling.

    Args:
      memory: keeps which ways are free, for the same points below another sky.

    One sample is clamped at 10 / samples and the sum at full view of the portal: without it, things
    a few centimetres from the glass turn into fireflies.
    """
    sides = portal.corner, portal.along, portal.up, portal.normal
    corner, along, up, n = (mi.Vector3f(*(opaque_float(x) for x in a)) for a in sides)
    area, share = opaque_float(portal.area / np.pi / samples * GLAZING), opaque_float(10.0 / samples)

    def one(k: Array) -> tuple[Array, ...]:
        u = p.sample(k)
        d, far, cos, side, active = towards(p, corner + along * u.x + up * u.y)
        leaving = -dr.dot(n, d)
        active &= leaving > 0
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d, far - 4 * LIFT, 0.0, [])
        free = active & (~space.scene.ray_test(ray, active) if ways is None else ((ways >> k) & 1) == 1)
        g = dr.minimum(dr.select(free, cos * leaving / dr.maximum(dr.square(far), 1e-4) * area, 0.0), share)
        arriving = env_lookup(space.env, d, free) * g, g
        return arriving if ways is not None or memory is None else (*arriving, dr.select(free, mi.UInt32(1) << k, 0))

    nothing = dr.zeros(mi.Color3f, p.n), dr.zeros(mi.Float, p.n)
    memory = memory if samples <= WAYS else None
    ways = None if memory is None else memory.get(("ways", portal.id))
    if memory is None or ways is not None:
        total, seen = accumulate(samples, one, *nothing)
    else:
        total, seen, met = accumulate(samples, one, *nothing, dr.zeros(mi.UInt32, p.n))
        memory["ways", portal.id] = met
    return total * dr.select(seen > 1, 1 / seen, 1)


def lamp_light(scene: RayScene, p: Points, lamp: Lamp, samples: int) -> Array:
    """e (a Color3f) from one lamp."""
    bare, count = not lamp.normals.any(), opaque_uint(len(lamp.points))
    at = floats(lamp.points)
    out = floats(lamp.normals)
    weights = floats(lamp.weights)
    strength, most = opaque_float(lamp.area / np.pi / samples), opaque_float((400.0 if bare else 4.0) / samples)

    def one(k: Array) -> tuple[Array, ...]:
        i = dr.minimum(mi.UInt32(p.sample(k).x * mi.Float(count)), count - 1)
        d, far, cos, side, active = towards(p, dr.gather(mi.Point3f, at, i))
        if bare:
            g = cos / dr.maximum(dr.square(far), 0.06)
        else:
            leaving = -dr.dot(dr.gather(mi.Vector3f, out, i), d)
            active &= leaving > 0
            g = cos * leaving / dr.maximum(dr.square(far), 1e-4)
        g *= dr.gather(mi.Float, weights, i)
        reach = far - (0.06 if bare else 4 * LIFT)
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d, reach, 0.0, [])
        active &= reach > 0
        return (dr.minimum(dr.select(active & ~scene.ray_test(ray, active), g * strength, 0.0), most),)

    (total,) = accumulate(samples, one, dr.zeros(mi.Float, p.n))
    return mi.Color3f(*(opaque_float(x) for x in lamp.radiance)) * (total if bare else dr.minimum(total, 1.0))


SUN = 0.006
"""Radius of the sun's disc, radians; a little over the real 0.0047 for soft edges at texel size."""


def sun_share(scene: RayScene, p: Points, portals: RayScene, towards: np.ndarray, directions: int) -> Array:
    """Cosine-weighted share (a Float) of the sun's disc that a point sees through a portal.

    Args:
      directions: rays over the disc, the same for all points: ragged shadow edges come from random ones.
    """
    frame = mi.Frame3f(mi.Vector3f(*(opaque_float(x) for x in towards)))
    whole = opaque_float(directions)

    def one(k: Array) -> tuple[Array, ...]:
        r, turn = opaque_float(SUN * (directions > 1)) * dr.sqrt((mi.Float(k) + 0.5) / whole), mi.Float(k) * 2.399963
        d = dr.normalize(frame.n + frame.s * (r * dr.cos(turn)) + frame.t * (r * dr.sin(turn)))
        cos, side, active = facing(p, d)
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d)
        active &= portals.ray_test(ray, active)
        return (dr.select(active & ~scene.ray_test(ray, active), cos, 0.0),)

    (total,) = accumulate(directions, one, dr.zeros(mi.Float, p.n))
    return total / whole


@dataclass(frozen=True, eq=False)
class Patches:
    """Small disc lights that stand for sunlit patches; k of them."""

    position: np.ndarray
    normal: np.ndarray
    """(k, 3) each."""
    thin: np.ndarray
    """(k,) bool, shines to both sides."""
    flux: np.ndarray
    """(k, 3) radiosity times area."""
    extent: np.ndarray
    """(k,) area in square metres."""


def patch_light(scene: RayScene, p: Points, patches: Patches) -> np.ndarray:
    """(n, 3) e from sunlit patches, the same ones for all points and so free of noise."""
    lift = np.where(patches.thin[:, None], 0.0, LIFT)
    places, normals = floats(patches.position + patches.normal * lift), floats(patches.normal)
    both, flux, extent = booleans(patches.thin), floats(patches.flux), floats(patches.extent)

    def one(k: Array) -> tuple[Array, ...]:
        d, far, cos, side, active = towards(p, dr.gather(mi.Point3f, places, k), 1e-5)
        leaving = -dr.dot(dr.gather(mi.Vector3f, normals, k), d)
        leaving = dr.select(dr.gather(mi.Bool, both, k), dr.abs(leaving), leaving)
        active &= leaving > 0
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d, far - 3 * LIFT, 0.0, [])
        g = cos * leaving / (dr.pi * dr.square(far) + dr.gather(mi.Float, extent, k))
        return (dr.gather(mi.Color3f, flux, k) * dr.select(active & ~scene.ray_test(ray, active), g, 0.0),)

    return array(accumulate(len(patches.flux), one, dr.zeros(mi.Color3f, p.n))[0])


WAYS = 32
"""Rays of a point that one whole number remembers."""
NOTHING = 0xFFFFFFFF
"""In place of a luxel's number: the ray met nothing that shines."""


@dataclass(frozen=True, eq=False)
class Met:
    """Hits of cosine-distributed rays of n points, whatever shines there."""

    rays: int
    """Of each point."""
    luxels: Array
    """(rays * n) luxel numbers, ray by ray; `NOTHING` where a ray meets nothing that shines."""
    bad: np.ndarray
    """(n,) number of rays that met a back face or something nearer than 12 mm."""


def meet(space: Space, p: Points, rays: int, first: int = 0) -> Met:
    """Send rays from points.

    Args:
      first: index of the first point of the R2 sequence, so that later rays of the same points differ.
    """
    start = opaque_uint(first)

    def ray(k: Array) -> Ray:
        side = dr.select(p.thin & (((k + start) & 1) == 1), -1.0, 1.0)
        return cosine_ray(p, side, p.sample(k + start))

    return met_by(space, p.n, rays, ray)


def met_by(space: Space, n: int, rays: int, ray: Callable[[Array], Ray]) -> Met:
    """Send so many rays from each of n points: the k-th of all of them is `ray` of k."""
    luxels, lane, count = dr.zeros(mi.UInt32, rays * n), dr.arange(mi.UInt32, n), opaque_uint(n)

    def one(k: Array) -> tuple[Array, ...]:
        luxel, hit, front, near = hit_luxel(space, ray(k))
        dr.scatter(luxels, dr.select(hit & front, luxel, NOTHING), k * count + lane)
        return (dr.select(hit & (~front | near), 1.0, 0.0),)

    (bad,) = accumulate(rays, one, dr.zeros(mi.Float, n))
    dr.eval(luxels)
    return Met(rays, luxels, np.array(bad))


def cosine_ray(p: Points, side: Array, u: Array) -> Ray:
    """Rays from points on a `side` (1 or -1) of them, as likely as their cosine, for numbers (a Point2f) in [0, 1)."""
    out = p.face_normal * side
    d = mi.Frame3f(p.normal * side).to_world(mi.warp.square_to_cosine_hemisphere(u))
    rise = dr.dot(d, out)
    d = dr.normalize(dr.select(rise < 0.01, d - out * (rise - 0.02), d))
    return mi.Ray3f(p.position + out * LIFT, d)


def gather(met: Met, table: Array) -> tuple[np.ndarray, np.ndarray]:
    """Sums over all rays of each of n points: (n, 3) radiosity that they meet, and (n,) its squared brightness.

    Args:
      table: flat (n luxels * 3), radiosity of the whole house on the device.
    """
    n = len(met.bad)
    lane, count = dr.arange(mi.UInt32, n), opaque_uint(n)

    def one(k: Array) -> tuple[Array, ...]:
        luxel = dr.gather(mi.UInt32, met.luxels, k * count + lane)
        colour = dr.gather(mi.Color3f, table, luxel, luxel != NOTHING)
        return colour, dr.square((colour.x + colour.y + colour.z) * (1.0 / 3.0))

    total, square = accumulate(met.rays, one, dr.zeros(mi.Color3f, n), dr.zeros(mi.Float, n))
    return array(total), np.array(square)


def hit_luxel(space: Space, ray: Ray, active: Array = True, met: Array = None) -> Array:
    """Luxel number where a ray hits, whether it hits, whether from the front, whether nearer than 12 mm.

    Args:
      met: what the scene said of the ray, where it was asked before.
    """
    q, w, height, base, hit, front, near = _met(space, ray, active, met)
    x = mi.UInt32(dr.clip(q.x, 0.0, mi.Float(w) - 1))
    y = mi.UInt32(dr.clip(q.y, 0.0, mi.Float(height) - 1))
    return dr.gather(mi.UInt32, space.luxel_of, base + y * w + x, hit), hit, front, near


def hit_colour(space: Space, table: Array, ray: Ray) -> Array:
    """Colour of a flat table of luxels where a ray hits a front, bilinear, black elsewhere; and whether it hits
    anything."""
    q, w, height, base, hit, front, _ = _met(space, ray, True)
    x, y = dr.clip(q.x - 0.5, 0.0, mi.Float(w) - 1), dr.clip(q.y - 0.5, 0.0, mi.Float(height) - 1)
    x0, y0, around = bilinear(x, y)
    out = mi.Color3f(0.0)
    for dx, dy, weight in around:
        spot = base + dr.minimum(mi.UInt32(y0) + dy, height - 1) * w + dr.minimum(mi.UInt32(x0) + dx, w - 1)
        out += dr.gather(mi.Color3f, table, dr.gather(mi.UInt32, space.luxel_of, spot, hit), hit & front) * weight
    return out, hit


def _met(space: Space, ray: Ray, active: Array, met: Array = None) -> Array:
    """Place on its page that a ray hits, in luxels; the page's width, height and first luxel; whether it hits, from the
    front, within 12 mm."""
    h = space.scene.ray_intersect_preliminary(ray, False, active) if met is None else met
    hit = h.is_valid() & active
    f = h.prim_index
    page = dr.gather(mi.UInt32, space.page, f, hit)
    b1, b2 = h.prim_uv.x, h.prim_uv.y
    at = lambda c: dr.gather(mi.Point2f, space.luxel_xy, f * 3 + c, hit)
    q = at(0) * (1 - b1 - b2) + at(1) * b1 + at(2) * b2
    w, height = dr.gather(mi.UInt32, space.width, page, hit), dr.gather(mi.UInt32, space.height, page, hit)
    n = dr.gather(mi.Normal3f, space.normal, f, hit)
    front = (dr.dot(n, ray.d) < 0) | dr.gather(mi.Bool, space.thin, f, hit)
    return q, w, height, dr.gather(mi.UInt32, space.base, page, hit), hit, front, h.t < 0.012


def portal_scene(portals: Sequence[Portal]) -> RayScene:
    """The portals alone, as something the sun's rays can be asked about."""
    quads = []
    for p in portals:
        a, b, c, d = p.corner, p.corner + p.along, p.corner + p.along + p.up, p.corner + p.up
        quads += [[a, b, c], [a, c, d]]
    return scene_of(np.array(quads))


def tried(units: np.ndarray, tries: int) -> np.ndarray:
    """Numbers of at most so many luxels of every unit (room, opening), drawn at random.

    Args:
      units: (n,) unit number of each luxel.
    """
    rng = np.random.default_rng(0)
    order = np.argsort(units, kind="stable")
    groups = np.split(order, np.nonzero(np.diff(units[order]))[0] + 1)
    return np.concatenate([g if len(g) <= tries else rng.choice(g, tries, replace=False) for g in groups])


def reached(units: np.ndarray, some: np.ndarray, sees: np.ndarray) -> np.ndarray:
    """Which luxels a light may reach, in rising order: those of units of which a tried luxel is reached.

    Args:
      units: (n,) unit number of each luxel.
      some: (k,) luxels that were `tried`, and (k,) bool whether each `sees` the light.
    """
    unit_is_reached = np.zeros(int(units.max(initial=0)) + 1, bool)
    unit_is_reached[units[some[sees]]] = True
    return np.flatnonzero(unit_is_reached[units])


def towards(p: Points, q: Array, least: float = 1e-6) -> tuple[Array, ...]:
    """Direction and distance from points to places `q`, and what `facing` says of that direction.

    Args:
      least: distance that is told from none, metres.
    """
    d = q - p.position
    far = dr.norm(d)
    d /= dr.maximum(far, least)
    return d, far, *facing(p, d)


def facing(p: Points, d: Array) -> Array:
    """Cosine at the point (half for each side of a thin one), the side it leaves from, whether it faces `d`."""
    cos, flat = dr.dot(p.normal, d), dr.dot(p.face_normal, d)
    cos = dr.select(p.thin, dr.abs(cos) * 0.5, cos)
    side = dr.select(p.thin, dr.sign(flat), 1.0)
    return cos, side, (cos > 0) & (p.thin | (flat > 0))


def small_sky(env: np.ndarray) -> np.ndarray:
    """(ENV_ROWS, 2 ENV_ROWS, 3) means of squares of an outdoor picture (h, 2h, 3)."""
    k = env.shape[0] // ENV_ROWS
    return env[: k * ENV_ROWS, : 2 * k * ENV_ROWS].reshape(ENV_ROWS, k, 2 * ENV_ROWS, k, 3).mean((1, 3))
