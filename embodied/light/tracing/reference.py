"""Panoramas by ray tracing: 'glossy' reads the bake and adds one reflection, 'reference' path-traces everything.

Both return an embodied.render.panorama.Panorama with the bake's exposure, so that pictures compare.
"""

import math
from collections.abc import Sequence

import cv2
import numpy as np

from embodied.house.house import House
from embodied.light.backend import Array, Ray, Triple, array, dr, floats, mi, opaque_float, vector
from embodied.light.pages.files import Bake
from embodied.light.pages.tone import develop
from embodied.light.tracing import paths, radiosity
from embodied.light.tracing.radiosity import Points
from embodied.light.tracing.scene import Hit, Panes, backdrop_at, look, picture_at, through, world_of
from embodied.render.camera import Pixels, Planes
from embodied.render.film import light_of, shown_of
from embodied.render.panorama import Panorama
from embodied.render.sampling import FACES
from embodied.seeds import stream

BRIGHTEST = 12.0
"""Reflected light is cut at this multiple of the exposure's white."""
SPARK = 12.0
"""One ray brings at most this multiple of the exposure's white, or what a white sheet in the sun sends: a lower limit
would take sunlit floors' and beds' colour off the walls."""
SHINY = 0.3
"""Metallic share from which on a surface shows its surroundings rather than its own colour."""
CLEAR = 0.1
"""Roughness up to which what shines is a mirror: its noise is that of what is seen in it."""
TRACED_QUALITIES = ("glossy", "reference", "diffuse")
"""'diffuse' is the reference without gloss but for mirrors and metals; pages should equal it on all else."""
RAYS = {"glossy": 16, "reference": 64, "diffuse": 64}
"""Rays per pixel."""
SPIKE = 0.4
"""Standard error of a pixel's brightness over its mean above which it must not outshine its neighbours."""
LANES = 2**19
"""Rays traced at once: to set a wave of them up costs as much for few as for many."""
Look = tuple[Triple, Triple]
"""Forward and up of a camera."""


class Tracer:
    """Draws panoramas of one lit house by tracing rays; owns the house on Mitsuba's device."""

    def __init__(
        self, bake: Bake, house: House, *, quality: str = "glossy", size: int = 256, rays: int | None = None
    ) -> None:
        """Upload the bake.

        Args:
          quality: one of TRACED_QUALITIES.
          size: side of a cube face, pixels.
          rays: per pixel; RAYS[quality] if None.

        Raises:
          ValueError: unknown quality.
        """
        if quality not in TRACED_QUALITIES:
            raise ValueError(f"quality {quality!r} is unknown to the tracer; use one of {TRACED_QUALITIES}")
        self.quality, self.size, self.rays = quality, size, rays or RAYS[quality]
        self._world, self._seed = world_of(bake, house), house.seed

    def panorama(self, position: Triple, size: int | None = None) -> Panorama:
        """Six cube faces around `position` (x, y, z), traced together."""
        s = size or self.size
        rng = stream(self._seed, "light", "trace", self.quality, "panorama")
        return Panorama(*self._seen(position, FACES, np.pi / 2, (s, s), rng))

    def picture(
        self, position: Triple, forward: Triple, up: Triple, vfov: float, size: Pixels, *, name: int = 0
    ) -> Planes:
        """(h, w, 3) uint8, (h, w) float32 depth along the axis, (h, w) int32 ids of a pinhole camera."""
        rng = stream(self._seed, "light", "trace", self.quality, name)
        rgb, depth, ids = self._seen(position, [(forward, up)], vfov, size, rng)
        return rgb[0], depth[0], ids[0]

    def _seen(
        self, position: Triple, views: Sequence[Look], vfov: float, size: Pixels, rng: np.random.Generator
    ) -> Planes:
        """As `picture`, of several cameras in one place, (forward, up) each: (v, h, w, 3), (v, h, w) and (v, h, w)."""
        shape = (len(views), *size)
        n = math.prod(shape)
        centre = _camera_rays(position, views, vfov, size, 1, None)
        hit = look(self._world, centre)
        ok, t = np.asarray(hit.ok), np.asarray(hit.distance)
        ids = np.where(ok, self._world.owner[np.where(ok, np.asarray(hit.face), 0)], 0)
        ahead = np.repeat(np.asarray([forward for forward, _ in views], np.float32), size[0] * size[1], axis=0)
        along = np.einsum("nk,nk->n", array(centre.d), ahead)
        if self._world.panes is not None:
            _, _, first, face = through(self._world.panes, centre, hit.distance)
            pane = np.isfinite(np.asarray(first))
            ids = np.where(pane, self._world.panes.owner[np.asarray(face)], ids)
        sums: list[np.ndarray] = [np.zeros((n, k), np.float32) for k in (1, 3, 3, 3, 1)]
        inside, light, other, albedo, square = sums
        at_once = max(1, LANES // n)
        for start in range(0, self.rays, at_once):
            ray = _camera_rays(position, views, vfov, size, min(at_once, self.rays - start), rng)
            for total, part in zip(sums, self._samples(ray, rng)):
                total += part.reshape(-1, n, part.shape[1]).sum(0)
        share = np.maximum(inside, 1e-6)
        light, albedo, square = light / share, albedo / share, square / share
        if self.quality != "glossy":
            noise = np.sqrt(np.maximum(square[:, 0] / np.maximum(light.mean(1), 1e-4) ** 2 - 1, 0) / self.rays)
            facing, far = self._surface_seen(centre, hit)
            guide = np.concatenate([facing, 4 * np.log(np.where(ok, far, 1.0))[:, None]], axis=1).reshape(*shape, 4)
            white = np.maximum(albedo, 0.02)
            of_views = zip((light / white).reshape(*shape, 3), guide, noise.reshape(shape), strict=True)
            light = np.stack([_denoised(*one) for one in of_views]).reshape(-1, 3) * white
        shown = (develop(light, np.ones(3)) * inside + other) / self.rays
        rgb = (np.clip(shown, 0, 1) * 255 + 0.5).astype(np.uint8).reshape(*shape, 3)
        if self._world.panes is not None:
            ok, t = ok | pane, np.where(pane, np.asarray(first), t)
        depth = np.where(ok, t * along, np.inf).reshape(shape).astype(np.float32)
        return rgb, depth, ids.reshape(shape).astype(np.int32)

    def plain(self, position: Triple, forward: Triple, up: Triple, vfov: float, size: Pixels) -> np.ndarray:
        """(h, w) bool: pixels with no mirror or metal within two pixels."""
        hit = look(self._world, _camera_rays(position, [(forward, up)], vfov, size, 1, None))
        shiny = np.asarray(hit.ok & ~hit.outdoor & (hit.gloss.z > SHINY)).reshape(size)
        return ~cv2.dilate(shiny.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)

    def _samples(self, ray: Ray, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
        """Per ray: how much of it ends indoors (n, 1); exposed radiance there, shown colour elsewhere, albedo (n, 3
        each; in a mirror times that of what is seen in it); brightness squared (n, 1).

        Radiance is averaged before the film curve: the curve of a noisy mean is right, the mean of
        curved noise is too dark.
        """
        world = self._world
        hit = look(world, ray)
        inside = hit.ok & ~hit.outdoor
        e = hit.e if self.quality == "glossy" else self._traced(hit, inside & hit.front, rng)
        diffuse = hit.albedo * e
        diffuse, albedo = self._with_gloss(hit, ray, diffuse, inside, rng)
        radiance = dr.select(hit.front | ~inside, diffuse, hit.albedo * hit.e) + hit.glow
        shown = dr.select(hit.ok, hit.e, backdrop_at(world.dome, world.rows, ray.d))
        keep = np.asarray(inside)[:, None]
        there, seen = array(hit.position), np.nan_to_num(array(radiance), posinf=0.0)
        gain = world.exposure.at(np.where(keep, there, 0.0))
        most = np.maximum(SPARK, gain * (world.outdoors.sun * radiosity.GLAZING).astype(np.float32))
        x = np.where(keep, np.minimum(seen * gain, most), 0.0)
        elsewhere, share, square = (
            np.where(keep, 0.0, array(shown)),
            keep.astype(np.float32),
            np.square(x.mean(1, keepdims=True)),
        )
        if world.panes is None:
            return share, x, elsewhere, np.where(keep, array(albedo), 0.0), square
        colour, left, first, face = through(world.panes, ray, dr.select(hit.ok, hit.distance, dr.inf))
        t = np.broadcast_to(np.asarray(left).reshape(-1, 1), share.shape).astype(np.float32)
        elsewhere = elsewhere * t + array(colour)
        if self.quality != "diffuse":
            mirrors, mirrored = self._in_panes(world.panes, ray, first, face, rng)
            x = x * (1 - mirrors) + np.minimum(mirrored, most) * mirrors
            lit = light_of(255 * elsewhere) * (1 - mirrors) + mirrored * mirrors
            elsewhere = np.where(~keep & (mirrors > 0), shown_of(lit) / np.float32(255), elsewhere)
        return share * t, x * t, elsewhere, np.where(keep, array(albedo), 0.0) * t, square * t

    def _in_panes(
        self, panes: Panes, ray: Ray, first: Array, face: Array, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Share of the light (n, 1) that the first pane of glass on each ray mirrors, and what it mirrors, exposed (n,
        3): nothing rough, one bounce."""
        world = self._world
        there = dr.isfinite(first)
        normal = dr.gather(mi.Vector3f, panes.normal, face, there)
        surfaces = dr.gather(mi.Float, panes.surfaces, face, there)
        there &= surfaces > 0
        c = dr.dot(normal, ray.d)
        f = 0.04 + 0.96 * dr.power(1 - dr.minimum(dr.abs(c), 1), 5)
        mirrors = dr.select(there, surfaces * f / (1 + (surfaces - 1) * f), 0.0)
        at, d = ray.o + ray.d * dr.select(there, first, 0.0), ray.d - 2 * c * normal
        second = look(world, mi.Ray3f(at + d * radiosity.LIFT, d), there)
        far = picture_at(world.sky, world.rows, d, there) * radiosity.GLAZING
        e = second.e if self.quality == "glossy" else self._traced(second, second.ok & ~second.outdoor, rng)
        seen = dr.select(second.ok & ~second.outdoor, second.albedo * e + second.glow, far)
        points = np.where(np.asarray(there)[:, None], array(at), 0.0)
        return np.asarray(mirrors)[:, None], np.nan_to_num(array(seen), posinf=0.0) * world.exposure.at(points)

    def _traced(self, hit: Hit, where: Array, rng: np.random.Generator) -> Array:
        """e at first hits by path tracing, where that is wanted."""
        world = self._world
        n = len(np.asarray(hit.distance))
        zero = floats(np.zeros(n, np.float32))
        points = Points(n, hit.position, hit.normal, hit.normal, hit.thin, zero, zero)
        return paths.irradiance(world.space, world.lights, world.surfaces, points, rng=rng, active=where)

    def _with_gloss(
        self, hit: Hit, ray: Ray, diffuse: Array, inside: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """One GGX lobe above the diffuse light, seen by one reflected ray; and albedo, in a mirror times that of what
        the ray meets.

        Source: Walter et al. 2007 eq. 35 for the half vector, Schlick 1994 for F; F0 = 0.08 specular.
        """
        world = self._world
        rough, specular, metal = hit.gloss.x, hit.gloss.y, hit.gloss.z
        if self.quality == "diffuse":
            specular = mi.Float(0.0)
        n = len(np.asarray(hit.distance))
        u = rng.random((2, n), np.float32)
        a = dr.maximum(dr.square(rough), 1e-3)
        u0 = floats(u[0]) * 0.98  # the lobe's far tail is left out: one ray in fifty there is noise, not gloss
        cos = dr.sqrt((1 - u0) / (1 + (dr.square(a) - 1) * u0))
        sin = dr.sqrt(dr.maximum(1 - dr.square(cos), 0))
        phi = dr.two_pi * floats(u[1])
        half = mi.Frame3f(hit.normal).to_world(mi.Vector3f(sin * dr.cos(phi), sin * dr.sin(phi), cos))
        c = dr.maximum(-dr.dot(ray.d, half), 0)
        d = ray.d + 2 * c * half
        f0 = mi.Color3f(0.08 * specular) * (1 - metal) + hit.albedo * metal
        f = f0 + (1 - f0) * dr.power(1 - c, 5) * (1 - dr.square(rough) * 0.9)
        active = inside & (dr.max(f0) > 1e-3) & (dr.dot(d, hit.normal) > 0)
        if not dr.any(active):
            return diffuse, hit.albedo
        second = look(world, mi.Ray3f(hit.position + hit.normal * radiosity.LIFT, d), active)
        far = picture_at(world.sky, world.rows, d, active) * radiosity.GLAZING
        seen = dr.select(second.ok, second.albedo * second.e + second.glow, far)
        seen = dr.select(second.ok & second.outdoor, far * 0.3, seen)
        if self.quality != "glossy":
            indoors = second.ok & ~second.outdoor & second.front
            e = self._traced(second, indoors, rng)
            seen = dr.select(indoors, second.albedo * e + second.glow, seen)
        limit = BRIGHTEST * float(1 / np.median(world.exposure.gains))
        seen = dr.minimum(seen, limit)
        tinted = active & _is_mirror(hit) & second.ok & ~second.outdoor & second.front
        albedo = hit.albedo * dr.select(tinted, second.albedo, mi.Color3f(1.0))
        return dr.select(active, diffuse * (1 - metal) * (1 - f) + seen * f, diffuse), albedo

    def _surface_seen(self, ray: Ray, hit: Hit) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) normals and (n,) distances (m) of what rays show: where they meet a mirror, of what is seen in it, and
        the whole way there. Renderers guide Open Image Denoise so, too: by the first diffuse bounce."""
        mirror = hit.front & _is_mirror(hit)
        d = ray.d - 2 * dr.dot(ray.d, hit.normal) * hit.normal
        second = look(self._world, mi.Ray3f(hit.position + hit.normal * radiosity.LIFT, d), mirror)
        normal = dr.select(second.ok, second.normal, hit.normal)
        return array(normal), np.asarray(hit.distance + dr.select(second.ok, second.distance, 0.0))


def _is_mirror(hit: Hit) -> Array:
    return hit.ok & ~hit.outdoor & (hit.gloss.z > SHINY) & (hit.gloss.x < CLEAR)


def _denoised(light: np.ndarray, guide: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """`_smoothed`, but what a few lucky rays bring to a pixel alone is spread over its surface, and none of it lost.

    Args: as `_smoothed` takes them. Such a pixel is told by its own noise and by its neighbours, of which the third
    brightest is as bright as it may stay; filters that know noise by its neighbours: Jensen and Christensen 1995.
    """
    shade = light.mean(-1)
    around = np.stack([np.roll(shade, (j, i), (0, 1)) for j in (-1, 0, 1) for i in (-1, 0, 1) if i or j])
    most = np.sort(around, axis=0)[-3]
    calm = np.where(noise > SPIKE, np.minimum(1, most / np.maximum(shade, 1e-6)), 1.0)[..., None].astype(np.float32)
    return _smoothed(light * calm, guide, noise) + _smoothed(light * (1 - calm), guide, np.full_like(noise, 1e3))


def _smoothed(light: np.ndarray, guide: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(h, w, 3) light, smoothed where normal and distance (h, w, 4) agree: a-trous (Dammertz et al. 2010), four passes.

    Args:
      noise: (h, w) standard error of brightness over its mean; differences within it are smoothed away, as in SVGF
        (Schied et al. 2017, sec. 4.4).
    """
    kernel = (0.0625, 0.25, 0.375, 0.25, 0.0625)
    noise = cv2.blur(noise.astype(np.float32), (5, 5))
    for step, like in ((1, 0.3), (2, 0.2), (4, 0.15), (8, 0.1)):
        shade = np.log(cv2.blur(light.mean(-1), (3, 3)) + 1e-3)
        tight = 1 / (like**2 + np.square(2 * noise))
        total, weight, squares = (
            np.zeros_like(light),
            np.zeros(light.shape[:2], np.float32),
            np.zeros(light.shape[:2], np.float32),
        )
        for j in range(-2, 3):
            for i in range(-2, 3):
                moved = lambda a: np.roll(a, (j * step, i * step), axis=(0, 1))  # noqa: B023
                apart = np.square(moved(guide) - guide).sum(-1) / 0.02 + np.square(moved(shade) - shade) * tight
                w = kernel[i + 2] * kernel[j + 2] * np.exp(-0.5 * apart).astype(np.float32)
                total += moved(light) * w[..., None]
                weight += w
                squares += w * w
        light = total / weight[..., None]
        noise = noise * np.sqrt(squares) / weight
    return light


def _camera_rays(
    position: Triple, views: Sequence[Look], vfov: float, size: Pixels, each: int, rng: np.random.Generator | None
) -> Ray:
    """`each` rays per pixel, pixel by pixel and camera by camera within a round; through pixel centres without an
    rng."""
    h, w = size
    ahead, up = (np.asarray([v[k] for v in views], float) for k in (0, 1))
    of = (2, each, len(views), h * w)
    jitter = rng.random(of, np.float32) if rng is not None else np.full(of, 0.5, np.float32)
    y, x = np.divmod(np.arange(h * w), w)
    t = np.tan(vfov / 2)
    sx = (((x + jitter[0]) / w * 2 - 1) * t * w / h)[..., None]  # (each, views, h * w, 1)
    sy = ((1 - (y + jitter[1]) / h * 2) * t)[..., None]
    d = ahead[:, None] + np.cross(ahead, up)[:, None] * sx + up[:, None] * sy
    return mi.Ray3f(mi.Point3f(*(opaque_float(k) for k in position)), dr.normalize(vector(d.reshape(-1, 3))))
