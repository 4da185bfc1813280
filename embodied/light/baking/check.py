"""The bake against the path tracer at random luxels of walls, floors and ceilings."""

import numpy as np

from embodied.light.backend import LightError, array
from embodied.light.baking.compose import LightSolution
from embodied.light.tracing import paths, radiosity
from embodied.light.tracing.emitters import portals_of
from embodied.light.tracing.luxels import AMBIENT, subset
from embodied.seeds import stream

LUXELS, PATHS = 20, 2400
FEW = 3
"""More than so many of the first luxels that are off call for a verdict by `AGAIN`."""
AGAIN, AGAIN_PATHS = 100, 1200
"""Luxels, and paths for each, of that verdict."""
LIMIT = 0.10
"""Largest relative difference that passes: for the median of the signed differences (a bias) always, and luxel by
luxel, beyond twice the path tracer's own standard error, where the settings allow no more (`Settings.tolerance`)."""
MOST_BEYOND = 0.25
"""Share of luxels that may differ by more than that.

Why not none: light is interpolated and smoothed along surfaces, which is what makes it quick and takes the noise out,
so that one in ten of a good bake, in the narrow shadow below a shelf or behind a wardrobe, differs by more. A third of
all luxels at fault pass the first twenty one time in seventeen, and a hundred one time in thirty.
"""


def compare(
    solution: LightSolution, *, luxels: int = LUXELS, paths_each: int = PATHS, name: str = "first"
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Brightness of baked and path-traced e at random luxels, the latter's standard error, and positions: (k,) and
    (k, 3).

    Rooms that get less than a twentieth of the house's middle light are left out: there the
    difference is far below what a picture shows. Single dark luxels are not: they may be the fault.
    """
    s = solution
    y = np.array([0.2126, 0.7152, 0.0722])
    whole = s.light.soft + AMBIENT + s.light.sun[:, None] * s.outdoors.sun * radiosity.GLAZING
    bright = whole @ y
    level = {u: np.median(bright[s.lux.shell & (s.lux.unit == u)]) for u in np.unique(s.lux.unit[s.lux.shell])}
    middle = np.median(bright[s.lux.shell])
    lit = np.array([level.get(u, 0.0) for u in range(int(s.lux.unit.max()) + 1)]) > 0.05 * middle
    fit = s.lux.shell & s.light.good & lit[s.lux.unit]
    # beside a shadow's edge a luxel's mean and its centre differ by nature
    fit &= (s.light.sun < 1e-3) | (s.light.sun > 0.98 * np.clip(s.lux.normal @ s.outdoors.sun_direction, 0, 1))
    rng = stream(s.house.seed, "light", "check", name)
    pick = rng.choice(np.nonzero(fit)[0], min(luxels, int(fit.sum())), replace=False)
    lights = paths.lights_of(s.space.scene, s.without, portals_of(s.house), s.lamps, s.outdoors)
    p = subset(s.lux, np.repeat(pick, paths_each))
    e = array(paths.irradiance(s.space, lights, paths.surfaces_of(s.lux), p, rng=rng))
    traced = np.nan_to_num(e).reshape(len(pick), paths_each, 3) @ y
    return whole[pick] @ y, traced.mean(1), traced.std(1) / np.sqrt(paths_each), s.lux.position[pick]


def check(solution: LightSolution, tolerance: float = LIMIT) -> dict:
    """How far the bake is off: {'luxels', 'bias', 'beyond'}, the last being the share of luxels that differ too much.

    Twenty random luxels tell most bakes; where the bias is over `LIMIT` or more than `FEW` of them are off, a hundred
    others decide.

    Args:
      tolerance: largest relative difference of a luxel.

    Raises:
      LightError: their bias is over `LIMIT` or the share that is off over `MOST_BEYOND`.
    """
    if not solution.lux.shell.any():
        return {"luxels": 0}
    first = compare(solution, luxels=LUXELS)
    result, complaint = judge(*first, tolerance)
    if not complaint and result["beyond"] * len(first[0]) <= FEW:
        return result
    result, complaint = judge(*compare(solution, luxels=AGAIN, paths_each=AGAIN_PATHS, name="again"), tolerance)
    if complaint:
        raise LightError(
            f"the bake of house {solution.house.name!r} disagrees with the path tracer at {result['luxels']} luxels: "
            f"bias {result['bias']:+.1%} (at most {LIMIT:.0%}), {result['beyond']:.0%} of them by more than "
            f"{tolerance:.0%} (at most {MOST_BEYOND:.0%}); {complaint}; raise the settings' rays, or report the "
            "house's seed"
        )
    return result


def judge(
    baked: np.ndarray, traced: np.ndarray, error: np.ndarray, position: np.ndarray, tolerance: float = LIMIT
) -> tuple[dict, str]:
    """The verdict on what `compare` returns: numbers, and the worst luxel in words; no words if the bake passes."""
    off = (baked - traced) / np.maximum(traced, 1e-6)
    beyond = np.abs(off) - 2 * error / np.maximum(traced, 1e-6) - tolerance
    result = {
        "luxels": len(off),
        "bias": round(float(np.median(off)), 4),
        "beyond": round(float(np.mean(beyond > 0)), 4),
    }
    if abs(result["bias"]) <= LIMIT and result["beyond"] <= MOST_BEYOND:
        return result, ""
    worst = int(np.argmax(beyond))
    return result, f"worst at {position[worst].round(2).tolist()}: baked {baked[worst]:.3g}, traced {traced[worst]:.3g}"
