"""The bake against the path tracer at random luxels of walls, floors and ceilings."""

from __future__ import annotations

import numpy as np

from embodied.light import paths, radiosity
from embodied.light.backend import LightError, array
from embodied.light.emitters import portals_of
from embodied.light.solve import AMBIENT, subset
from embodied.seeds import stream

LUXELS, PATHS = 20, 6000
LIMIT = 0.10
"""Largest relative difference that passes, for the median of the signed differences (a bias) and for the
median of their sizes less twice the path tracer's own standard error (a scatter). Medians, because a
luxel at a shadow's edge or behind a wardrobe may well differ more: it is smoothed with its neighbours."""


def compare(solved, *, luxels: int = LUXELS, paths_each: int = PATHS) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Brightness of baked and path-traced e at random luxels, the latter's standard error, and positions: (k,) and (k, 3).

    Luxels that get less than a twentieth of the house's middle light are left out: there the
    difference is far below what a picture shows.
    """
    s = solved
    y = np.array([0.2126, 0.7152, 0.0722])
    whole = s.light.soft + AMBIENT + s.light.sun[:, None] * s.outdoors.sun * radiosity.GLASS
    fit = s.lux.shell & s.light.good & (whole @ y > 0.05 * np.median(whole[s.lux.shell] @ y))
    # beside a shadow's edge a luxel's mean and its centre differ by nature
    fit &= (s.light.sun < 1e-3) | (s.light.sun > 0.98 * np.clip(s.lux.normal @ s.outdoors.sun_direction, 0, 1))
    rng = stream(s.house.seed, "light", "check")
    pick = rng.choice(np.nonzero(fit)[0], min(luxels, int(fit.sum())), replace=False)
    space = radiosity.space_of(s.atlas, s.lux.texels, s.outdoors.picture)
    lights = paths.lights_of(s.atlas, s.lux, space, portals_of(s.house), s.lamps, s.outdoors)
    p = subset(s.lux, np.repeat(pick, paths_each))
    e = array(paths.irradiance(space, lights, paths.surfaces_of(s.lux), p, rng=rng))
    traced = np.nan_to_num(e).reshape(len(pick), paths_each, 3) @ y
    return whole[pick] @ y, traced.mean(1), traced.std(1) / np.sqrt(paths_each), s.lux.position[pick]


def check(solved) -> dict:
    """How far the bake is off: {'luxels', 'bias', 'scatter'}.

    Raises:
      LightError: either is over `LIMIT`.
    """
    if not solved.lux.shell.any():
        return {"luxels": 0}
    baked, traced, error, position = compare(solved)
    off = (baked - traced) / np.maximum(traced, 1e-6)
    beyond = np.maximum(np.abs(off) - 2 * error / np.maximum(traced, 1e-6), 0.0)
    result = {"luxels": len(off), "bias": round(float(np.median(off)), 4), "scatter": round(float(np.median(beyond)), 4)}
    if abs(result["bias"]) > LIMIT or result["scatter"] > LIMIT:
        worst = int(np.argmax(beyond))
        raise LightError(
            f"the bake of house {solved.house.name!r} disagrees with the path tracer at {len(off)} luxels: bias {result['bias']:+.1%}, "
            f"scatter {result['scatter']:.1%} (at most {LIMIT:.0%} each); worst at {position[worst].round(2).tolist()}: "
            f"baked {baked[worst]:.3g}, traced {traced[worst]:.3g}; raise the settings' rays, or report the house's seed"
        )
    return result
