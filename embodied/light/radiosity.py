"""Light transport between luxels: direct light from sky, lamps and sun, then bounces.

For every luxel we keep e = E / pi, so that a diffuse surface shows albedo * e. The luxel positions
and all rays live in Mitsuba; no BSDF is ever evaluated, which is where the speed comes from.

Source: steps 6 to 11 of the bake prototype's recipe; the last gather is final gathering over a
radiosity solution (Reichert 1992).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from embodied.light.atlas import Atlas, Texels, nearest
from embodied.light.backend import array, constant, drjit, mitsuba, r2, scene_of, vector
from embodied.light.emitters import GLASS, Lamp, Portal
from embodied.light.unwrap import face_normals

LIFT = 2e-3
"""Metres by which rays start above their surface."""
ENV_ROWS = 32


@dataclass(frozen=True, eq=False)
class Points:
    """Surface points on the device; n of them, Dr.Jit arrays."""

    n: int
    position: object
    normal: object
    face_normal: object
    thin: object
    turn0: object
    turn1: object
    """Per-point rotation of the sample sequences (Cranley and Patterson 1976)."""


def points_of(
    position: np.ndarray, normal: np.ndarray, face_normal: np.ndarray, thin: np.ndarray, seed: int = 0
) -> Points:
    """Upload points; all arrays (n, 3) but `thin` (n,)."""
    mi, dr = mitsuba(), drjit()
    turn = np.random.default_rng(seed).random((2, len(position)), np.float32)
    p = Points(
        len(position),
        mi.Point3f(vector(position)),
        vector(normal),
        vector(face_normal),
        mi.Bool(np.ascontiguousarray(thin)),
        mi.Float(turn[0]),
        mi.Float(turn[1]),
    )
    dr.eval(p.position, p.normal, p.face_normal, p.thin, p.turn0, p.turn1)
    return p


@dataclass(frozen=True, eq=False)
class Space:
    """The house as something rays can hit; faces in page order."""

    scene: object
    opaque_faces: np.ndarray
    """(f,) int, position in page order of each face of `scene`; glass is left out."""
    page: object
    """Page of each face (device), then the same for:"""
    luxel_xy: object
    normal: object
    thin: object
    width: object
    height: object
    base: object
    luxel_of: object
    """Per page pixel the luxel to read: the pixel's own or the nearest one that is covered."""
    env: object
    """Outdoor radiance (ENV_ROWS x 2 ENV_ROWS pixels, flat RGB)."""


def space_of(atlas: Atlas, luxels: Sequence[Texels], env: np.ndarray) -> Space:
    """Upload the house.

    Args:
      luxels: what lies under each page at fineness 1.
      env: outdoor radiance picture (h, 2h, 3).
    """
    mi = mitsuba()
    corners = np.concatenate([p.corners for p in atlas.pages])
    page = np.concatenate([np.full(len(p.corners), i) for i, p in enumerate(atlas.pages)])
    keep = np.nonzero(~np.array([p.glass for p in atlas.pages])[page])[0]
    xy = np.concatenate([p.luxels for p in atlas.pages])[keep]
    thin = np.concatenate([p.thin for p in atlas.pages])[keep]
    sizes = np.array([p.width * p.height for p in atlas.pages])
    u32 = lambda a: mi.UInt32(np.ascontiguousarray(a, np.uint32))
    flat = lambda a: mi.Float(np.ascontiguousarray(a, np.float32).ravel())
    return Space(
        scene_of(corners[keep]),
        keep,
        u32(page[keep]),
        flat(xy),
        flat(face_normals(corners[keep])),
        mi.Bool(np.ascontiguousarray(thin)),
        u32([p.width for p in atlas.pages]),
        u32([p.height for p in atlas.pages]),
        u32(np.cumsum(sizes) - sizes),
        u32(nearest_luxel(atlas, luxels)),
        flat(_small(env)),
    )


def without(space: Space, atlas: Atlas, owner: str) -> Space:
    """The same space for shadow rays that pass through everything of `owner`."""
    if owner not in atlas.owners:
        return space
    corners = np.concatenate([p.corners for p in atlas.pages])[space.opaque_faces]
    owners = np.concatenate([p.owner for p in atlas.pages])[space.opaque_faces]
    return replace(space, scene=scene_of(corners[owners != atlas.owners.index(owner)]))


def nearest_luxel(atlas: Atlas, luxels: Sequence[Texels], good: np.ndarray | None = None) -> np.ndarray:
    """For every pixel of every page, in order, the number of the luxel to read there: its own or the nearest.

    Args:
      good: (n,) bool, luxels that may be read; all by default. A page without any keeps its own.
    """
    out, start = [], 0
    for page, t in zip(atlas.pages, luxels):
        n = len(t.index)
        number = np.zeros(page.width * page.height, np.int64)
        number[t.index] = start + np.arange(n)
        mask = np.zeros(page.width * page.height, bool)
        chosen = np.ones(n, bool) if good is None or not good[start : start + n].any() else good[start : start + n]
        mask[t.index[chosen]] = True
        mask = mask.reshape(page.height, page.width)
        if mask.any():
            number = number[nearest(mask).ravel()]
        out.append(number)
        start += n
    return np.concatenate(out)


def env_lookup(space: Space, d, active=True):
    """Outdoor radiance in direction `d`, bilinear in yaw and nearest in the few rows of the small picture."""
    mi, dr = mitsuba(), drjit()
    h, w = ENV_ROWS, 2 * ENV_ROWS
    x = (dr.pi - dr.atan2(d.y, d.x)) / dr.two_pi * w - 0.5
    y = dr.clip(dr.acos(dr.clip(d.z, -1, 1)) / dr.pi * h - 0.5, 0, h - 1.001)
    x0, y0 = dr.floor(x), dr.floor(y)
    fx, fy = x - x0, y - y0
    xi = mi.UInt32(mi.Int32(x0) + w)
    out = mi.Color3f(0.0)
    for dx, wx in ((0, 1 - fx), (1, fx)):
        for dy, wy in ((0, 1 - fy), (1, fy)):
            out += dr.gather(mi.Color3f, space.env, (mi.UInt32(y0) + dy) * w + (xi + dx) % w, active) * (wx * wy)
    return out


def sky_light(space: Space, p: Points, portal: Portal, samples: int):
    """e (a Color3f) from the outdoors through one portal, by area sampling.

    One sample is clamped at 10 / samples and the sum at full view of the portal: without it, things
    a few centimetres from the glass turn into fireflies.
    """
    mi, dr = mitsuba(), drjit()
    corner, along, up, n = (
        mi.Vector3f(*(constant(x) for x in a)) for a in (portal.corner, portal.along, portal.up, portal.normal)
    )
    area, share = constant(portal.area / np.pi / samples * GLASS), constant(10.0 / samples)
    total, seen = dr.zeros(mi.Color3f, p.n), dr.zeros(mi.Float, p.n)
    for k in range(samples):
        a, b = (constant(x) for x in r2(k))
        a, b = p.turn0 + a, p.turn1 + b
        q = corner + along * (a - dr.floor(a)) + up * (b - dr.floor(b))
        d = q - p.position
        far = dr.norm(d)
        d /= dr.maximum(far, 1e-6)
        cos, side, active = facing(p, d)
        leaving = -dr.dot(n, d)
        active &= leaving > 0
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d, far - 4 * LIFT, 0.0, [])
        blocked = space.scene.ray_test(ray, active)
        g = dr.select(active & ~blocked, cos * leaving / dr.maximum(dr.square(far), 1e-4) * area, 0.0)
        g = dr.minimum(g, share)
        total += env_lookup(space, d, active) * g
        seen += g
        dr.eval(total, seen)
    return total * dr.select(seen > 1, 1 / seen, 1)


def lamp_light(space: Space, p: Points, lamp: Lamp, samples: int):
    """e (a Color3f) from one lamp."""
    mi, dr = mitsuba(), drjit()
    bare = not lamp.normals.any()
    count = len(lamp.points)
    at = mi.Float(np.ascontiguousarray(lamp.points, np.float32).ravel())
    out = mi.Float(np.ascontiguousarray(lamp.normals, np.float32).ravel())
    weights = mi.Float(np.ascontiguousarray(lamp.weights, np.float32))
    strength = constant(lamp.area / np.pi / samples)
    total = dr.zeros(mi.Float, p.n)
    for k in range(samples):
        pick = p.turn0 + constant(r2(k)[0])
        i = dr.minimum(mi.UInt32((pick - dr.floor(pick)) * count), count - 1)
        d = dr.gather(mi.Point3f, at, i) - p.position
        far = dr.norm(d)
        d /= dr.maximum(far, 1e-6)
        cos, side, active = facing(p, d)
        if bare:
            g = cos / dr.maximum(dr.square(far), 0.06)
        else:
            leaving = -dr.dot(dr.gather(mi.Vector3f, out, i), d)
            active &= leaving > 0
            g = cos * leaving / dr.maximum(dr.square(far), 1e-4)
        g *= dr.gather(mi.Float, weights, i)
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d, far - (4 * LIFT if not bare else 0.06), 0.0, [])
        active &= ray.maxt > 0
        total += dr.minimum(
            dr.select(active & ~space.scene.ray_test(ray, active), g * strength, 0.0),
            constant((4.0 if not bare else 400.0) / samples),
        )
        dr.eval(total)
    return mi.Color3f(*(constant(x) for x in lamp.radiance)) * (total if bare else dr.minimum(total, 1.0))


def sun_share(space: Space, p: Points, portals_scene, towards: np.ndarray, directions: int, radius: float = 0.006):
    """Cosine-weighted share (a Float) of the sun's disc that a point sees through a portal.

    Args:
      directions: rays over the disc, the same for all points: ragged shadow edges come from random ones.
      radius: of the disc, radians; a little over the real 0.0047 for soft edges at texel size.
    """
    mi, dr = mitsuba(), drjit()
    total = dr.zeros(mi.Float, p.n)
    frame = mi.Frame3f(mi.Vector3f(*(float(x) for x in towards)))
    for k in range(directions):
        r, turn = (radius * np.sqrt((k + 0.5) / directions), k * 2.399963) if directions > 1 else (0.0, 0.0)
        d = dr.normalize(frame.n + frame.s * constant(r * np.cos(turn)) + frame.t * constant(r * np.sin(turn)))
        cos, side, active = facing(p, d)
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d)
        active &= portals_scene.ray_test(ray, active)
        total += dr.select(active & ~space.scene.ray_test(ray, active), cos, 0.0)
        dr.eval(total)
    return total / directions


def patch_light(
    space: Space,
    p: Points,
    position: np.ndarray,
    normal: np.ndarray,
    thin: np.ndarray,
    flux: np.ndarray,
    extent: np.ndarray,
) -> np.ndarray:
    """(n, 3) e from sunlit patches, each a small disc light, the same for all points and so free of noise.

    Args:
      position, normal: (k, 3). thin: (k,) bool, shines to both sides. flux: (k, 3) radiosity times area. extent: (k,) area in square metres.
    """
    mi, dr = mitsuba(), drjit()
    total = dr.zeros(mi.Color3f, p.n)
    for q, n, both, f, a in zip(
        np.where(thin[:, None], position, position + normal * LIFT), normal, thin, flux, extent
    ):
        d = mi.Point3f(*(constant(x) for x in q)) - p.position
        far = dr.norm(d)
        d /= dr.maximum(far, 1e-5)
        cos, side, active = facing(p, d)
        leaving = -dr.dot(mi.Vector3f(*(constant(x) for x in n)), d)
        leaving = dr.abs(leaving) if both else leaving
        active &= leaving > 0
        ray = mi.Ray3f(p.position + p.face_normal * side * LIFT, d, far - 3 * LIFT, 0.0, [])
        g = cos * leaving / (dr.pi * dr.square(far) + constant(a))
        total += mi.Color3f(*(constant(x) for x in f)) * dr.select(active & ~space.scene.ray_test(ray, active), g, 0.0)
        dr.eval(total)
    return array(total)


def gather(
    space: Space, p: Points, radiosity: np.ndarray, samples: int, first: int = 0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean of what cosine-distributed rays meet.

    Args:
      radiosity: (n luxels, 3) of the whole house.
      first: index of the first point of the R2 sequence, so that rounds differ.

    Returns:
      (n, 3) e, (n,) share of rays that met a back face or something nearer than 12 mm, and (n,)
      variance of the mean brightness.
    """
    mi, dr = mitsuba(), drjit()
    b = mi.Float(np.ascontiguousarray(radiosity, np.float32).ravel())
    total, bad, square = dr.zeros(mi.Color3f, p.n), dr.zeros(mi.Float, p.n), dr.zeros(mi.Float, p.n)
    for k in range(samples):
        u0, u1 = (constant(x) for x in r2(k + first))
        u = mi.Point2f(p.turn0 + u0, p.turn1 + u1)
        side = dr.select(p.thin & (constant(k % 2) > 0.5), -1.0, 1.0)
        d = mi.Frame3f(p.normal * side).to_world(mi.warp.square_to_cosine_hemisphere(u - dr.floor(u)))
        out = p.face_normal * side
        rise = dr.dot(d, out)
        d = dr.normalize(dr.select(rise < 0.01, d - out * (rise - 0.02), d))
        luxel, hit, front, near = hit_luxel(space, mi.Ray3f(p.position + out * LIFT, d))
        seen = dr.gather(mi.Color3f, b, luxel, hit & front)
        total += seen
        square += dr.square((seen.x + seen.y + seen.z) * (1.0 / 3.0))
        bad += dr.select(hit & (~front | near), 1.0, 0.0)
        dr.eval(total, bad, square)
    mean = array(total) / samples
    variance = np.maximum(np.asarray(square) / samples - mean.mean(1) ** 2, 0.0) / max(samples - 1, 1)
    return mean, np.asarray(bad) / samples, variance


def hit_luxel(space: Space, ray, active=True):
    """Luxel number where a ray hits, whether it hits, whether from the front, whether nearer than 12 mm."""
    mi, dr = mitsuba(), drjit()
    q, w, height, base, hit, front, near = _met(space, ray, active)
    x = mi.UInt32(dr.clip(q.x, 0.0, mi.Float(w) - 1))
    y = mi.UInt32(dr.clip(q.y, 0.0, mi.Float(height) - 1))
    return dr.gather(mi.UInt32, space.luxel_of, base + y * w + x, hit), hit, front, near


def hit_colour(space: Space, table, ray, active=True):
    """Colour of a flat table of luxels where a ray hits a front, bilinear, black elsewhere; and whether it hits anything."""
    mi, dr = mitsuba(), drjit()
    q, w, height, base, hit, front, _ = _met(space, ray, active)
    x, y = dr.clip(q.x - 0.5, 0.0, mi.Float(w) - 1), dr.clip(q.y - 0.5, 0.0, mi.Float(height) - 1)
    x0, y0 = mi.UInt32(x), mi.UInt32(y)
    fx, fy = x - mi.Float(x0), y - mi.Float(y0)
    out = mi.Color3f(0.0)
    for dx, wx in ((0, 1 - fx), (1, fx)):
        for dy, wy in ((0, 1 - fy), (1, fy)):
            spot = base + dr.minimum(y0 + dy, height - 1) * w + dr.minimum(x0 + dx, w - 1)
            out += dr.gather(mi.Color3f, table, dr.gather(mi.UInt32, space.luxel_of, spot, hit), hit & front) * (
                wx * wy
            )
    return out, hit


def _met(space: Space, ray, active):
    """Where on its page a ray hits, in luxels; the page's width, height and first luxel; whether it hits, from the front, within 12 mm."""
    mi, dr = mitsuba(), drjit()
    h = space.scene.ray_intersect_preliminary(ray, False, active)
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


def portal_scene(portals: Sequence[Portal]):
    """The portals alone, as something the sun's rays can be asked about."""
    quads = []
    for p in portals:
        a, b, c, d = p.corner, p.corner + p.along, p.corner + p.along + p.up, p.corner + p.up
        quads += [[a, b, c], [a, c, d]]
    return scene_of(np.array(quads))


def reached(units: np.ndarray, sees: Callable[[np.ndarray], np.ndarray], *, tries: int = 300) -> np.ndarray:
    """Which luxels a light may reach: whole units (rooms, openings), left out when no tried luxel of them is reached.

    Args:
      units: (n,) unit number of each luxel.
      sees: luxel numbers to whether each is reached.

    Returns:
      Luxel numbers in rising order.
    """
    rng = np.random.default_rng(0)
    order = np.argsort(units, kind="stable")
    groups = np.split(order, np.nonzero(np.diff(units[order]))[0] + 1)
    tried = [g if len(g) <= tries else rng.choice(g, tries, replace=False) for g in groups]
    hit = np.split(sees(np.concatenate(tried)), np.cumsum([len(t) for t in tried])[:-1])
    return np.sort(np.concatenate([g for g, h in zip(groups, hit) if h.any()] or [np.zeros(0, np.int64)]))


def facing(p: Points, d):
    """Cosine at the point (half for each side of a thin one), the side it leaves from, whether it faces `d`."""
    dr = drjit()

    cos, flat = dr.dot(p.normal, d), dr.dot(p.face_normal, d)
    cos = dr.select(p.thin, dr.abs(cos) * 0.5, cos)
    side = dr.select(p.thin, dr.sign(flat), 1.0)
    return cos, side, (cos > 0) & (p.thin | (flat > 0))


def _small(env: np.ndarray) -> np.ndarray:
    h = env.shape[0]
    k = h // ENV_ROWS
    return env[: k * ENV_ROWS, : 2 * k * ENV_ROWS].reshape(ENV_ROWS, k, 2 * ENV_ROWS, k, 3).mean((1, 3))
