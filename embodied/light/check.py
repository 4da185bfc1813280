"""The bake against the path tracer at random luxels of walls, floors and ceilings."""

from __future__ import annotations

import numpy as np

from embodied.light import paths, radiosity
from embodied.light.backend import LightError, array
from embodied.light.emitters import portals_of
from embodied.light.solve import AMBIENT, subset
from embodied.seeds import stream

LUXELS, PATHS = 24, 12000
LIMIT = 0.10
"""Largest median relative difference that passes."""
WORST = 0.35
"""Largest 80th percentile that passes: sharp shadows are smoothed a little, so single luxels may differ more."""


def compare(solved, *, luxels: int = LUXELS, paths_each: int = PATHS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Brightness of baked and path-traced e at random luxels, and their positions: (k,), (k,), (k, 3).

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
    traced = np.nan_to_num(e).reshape(len(pick), paths_each, 3).mean(1)
    return whole[pick] @ y, traced @ y, s.lux.position[pick]


def check(solved) -> dict:
    """Median and 80th percentile of the relative difference.

    Raises:
      LightError: the bake is off by more than `LIMIT` in the middle or `WORST` at the 80th percentile.
    """
    if not solved.lux.shell.any():
        return {"luxels": 0}
    baked, traced, position = compare(solved)
    off = np.abs(baked - traced) / np.maximum(traced, 1e-6)
    result = {"luxels": len(off), "median": round(float(np.median(off)), 4), "p80": round(float(np.percentile(off, 80)), 4)}
    if result["median"] > LIMIT or result["p80"] > WORST:
        worst = int(np.argmax(off))
        raise LightError(
            f"the bake of house {solved.house.name!r} disagrees with the path tracer: median {result['median']:.1%} (at most "
            f"{LIMIT:.0%}), 80th percentile {result['p80']:.1%} (at most {WORST:.0%}); worst at {position[worst].round(2).tolist()}: "
            f"baked {baked[worst]:.3g}, traced {traced[worst]:.3g}; raise the settings' rays, or report the house's seed"
        )
    return result
