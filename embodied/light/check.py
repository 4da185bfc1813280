"""The bake against the path tracer at random luxels of walls, floors and ceilings."""

from __future__ import annotations

import numpy as np

from embodied.light import paths, radiosity
from embodied.light.backend import LightError, array
from embodied.light.compose import Solved
from embodied.light.emitters import portals_of
from embodied.light.solve import AMBIENT, subset
from embodied.seeds import stream

LUXELS, PATHS = 20, 6000
LIMIT = 0.10
"""Largest relative difference that passes, for the median of the signed differences (a bias) and, luxel by
luxel, beyond twice the path tracer's own standard error."""
MOST = 0.25
"""Share of luxels that may differ by more than `LIMIT`.

Why not none: a luxel is smoothed with its neighbours, which is what takes the noise out, so that one in ten of a
good bake, in the narrow shadow below a shelf or behind a wardrobe, differs by more (measured on 60 luxels of a
flat of 46 m2 with 16,000 paths each: 10 % of them by more than 10 % beyond two standard errors, 5 % by more than 25 %).
"""
AGAIN = 5
"""A bake that seems wrong is judged by this many times more luxels before it is refused."""


def compare(
    solved: Solved, *, luxels: int = LUXELS, paths_each: int = PATHS, name: str = "first"
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Brightness of baked and path-traced e at random luxels, the latter's standard error, and positions: (k,) and (k, 3).

    Rooms that get less than a twentieth of the house's middle light are left out: there the
    difference is far below what a picture shows. Single dark luxels are not: they may be the fault.
    """
    s = solved
    y = np.array([0.2126, 0.7152, 0.0722])
    whole = s.light.soft + AMBIENT + s.light.sun[:, None] * s.outdoors.sun * radiosity.GLASS
    bright = whole @ y
    level = {u: np.median(bright[s.lux.shell & (s.lux.unit == u)]) for u in np.unique(s.lux.unit[s.lux.shell])}
    lit = np.array([level.get(u, 0.0) for u in range(int(s.lux.unit.max()) + 1)]) > 0.05 * np.median(
        bright[s.lux.shell]
    )
    fit = s.lux.shell & s.light.good & lit[s.lux.unit]
    # beside a shadow's edge a luxel's mean and its centre differ by nature
    fit &= (s.light.sun < 1e-3) | (s.light.sun > 0.98 * np.clip(s.lux.normal @ s.outdoors.sun_direction, 0, 1))
    rng = stream(s.house.seed, "light", "check", name)
    pick = rng.choice(np.nonzero(fit)[0], min(luxels, int(fit.sum())), replace=False)
    space = radiosity.space_of(s.atlas, s.lux.texels, s.outdoors.picture)
    lights = paths.lights_of(
        space, lambda o: radiosity.without(space, s.atlas, o), portals_of(s.house), s.lamps, s.outdoors
    )
    p = subset(s.lux, np.repeat(pick, paths_each))
    e = array(paths.irradiance(space, lights, paths.surfaces_of(s.lux), p, rng=rng))
    traced = np.nan_to_num(e).reshape(len(pick), paths_each, 3) @ y
    return whole[pick] @ y, traced.mean(1), traced.std(1) / np.sqrt(paths_each), s.lux.position[pick]


def check(solved: Solved) -> dict:
    """How far the bake is off: {'luxels', 'bias', 'beyond'}, the last being the share of luxels that differ too much.

    Raises:
      LightError: the bias is over `LIMIT` or that share over `MOST`, at `LUXELS` random luxels and again at `AGAIN` times as many.
    """
    if not solved.lux.shell.any():
        return {"luxels": 0}
    result, told = judge(*compare(solved))
    if told:
        result, told = judge(*compare(solved, luxels=AGAIN * LUXELS, name="again"))
    if told:
        raise LightError(
            f"the bake of house {solved.house.name!r} disagrees with the path tracer at {result['luxels']} luxels: bias {result['bias']:+.1%} "
            f"(at most {LIMIT:.0%}), {result['beyond']:.0%} of them by more than {LIMIT:.0%} (at most {MOST:.0%}); {told}; "
            "raise the settings' rays, or report the house's seed"
        )
    return result


def judge(baked: np.ndarray, traced: np.ndarray, error: np.ndarray, position: np.ndarray) -> tuple[dict, str]:
    """The verdict on what `compare` returns: numbers, and the worst luxel in words; no words if the bake passes."""
    off = (baked - traced) / np.maximum(traced, 1e-6)
    beyond = np.abs(off) - 2 * error / np.maximum(traced, 1e-6) - LIMIT
    result = {
        "luxels": len(off),
        "bias": round(float(np.median(off)), 4),
        "beyond": round(float(np.mean(beyond > 0)), 4),
    }
    if abs(result["bias"]) <= LIMIT and result["beyond"] <= MOST:
        return result, ""
    worst = int(np.argmax(beyond))
    return result, f"worst at {position[worst].round(2).tolist()}: baked {baked[worst]:.3g}, traced {traced[worst]:.3g}"
