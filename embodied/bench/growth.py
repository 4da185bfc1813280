"""How the cost of light grows with a house: processor time and memory against area, on a log-log plot."""

from __future__ import annotations

import json
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import shapely

from assets.cache import write_bytes, write_json
from assets.catalogue import Catalogue
from embodied.bench.timing import Report
from embodied.generate import HouseConfig, generate_house
from embodied.light.baking.house import bake, forget
from embodied.light.settings import light_code
from embodied.scene.house_meshes import house_parts

AREAS = (40.0, 63.0, 100.0, 160.0, 250.0, 400.0)
"""Square metres of the houses, evenly apart in their logarithms; small ones first, see `Grown.memory`."""
AIM = 1.15
"""Steepest slope that the project promises: nearly in proportion."""
SKY = {"hour": 10.5, "weather": "clear"}


@dataclass(frozen=True)
class Grown:
    """What lighting one house cost."""

    area: float
    """Square metres of its rooms."""
    objects: int
    processor: float
    """Seconds of all cores, furniture imported and unwrapped."""
    unwrapping: float
    """Seconds besides for furniture that no earlier house had."""
    luxels: int
    memory: float
    """MiB, peak of the process so far."""
    disk: float
    """MB of the bake."""


def growth(
    catalogue: Catalogue,
    cache: Path,
    out: Path,
    *,
    seed: int,
    quality: str = "fast",
    areas: Sequence[float] = AREAS,
    progress: Callable[[str], None] = lambda text: None,
) -> Report:
    """Light a house of each area, write `out`/growth.json and `out`/growth.png.

    Houses that growth.json already holds, lit by the same code with the same seed and quality, are not lit again.

    Args:
      seed: of the smallest house; the others have the next ones.

    Returns:
      The facts are what growth.json holds: houses, slope of the logarithms and what they were measured with.
    """
    path = Path(out) / "growth.json"
    made = {"code": light_code(), "seed": seed, "quality": quality}
    houses = _known(path, made)
    for k, area in enumerate(areas):
        if str(area) not in houses:
            houses[str(area)] = asdict(grown(catalogue, cache, seed + k, area, quality))
            write_json(path, {**made, "houses": houses}, indent=1)
        progress(f"{area:g} m²: {houses[str(area)]}")
    found = [Grown(**houses[str(area)]) for area in areas]
    facts = {**made, "slope": slope(found), "aim": AIM, "houses": houses}
    write_json(path, facts, indent=1)
    write_bytes(Path(out) / "growth.png", figure(found, quality))
    return Report(facts, table(facts))


def _known(path: Path, made: dict) -> dict[str, dict]:
    """Houses by area of an earlier run; none if it was another."""
    try:
        before = json.loads(path.read_text())
        return dict(before["houses"]) if made.items() <= before.items() else {}
    except (OSError, ValueError, KeyError, AttributeError):
        return {}


def grown(catalogue: Catalogue, cache: Path, seed: int, area: float, quality: str) -> Grown:
    """Light one house of `area` square metres anew."""
    config = HouseConfig(area=(0.97 * area, 1.03 * area), **SKY)  # type: ignore[arg-type]  # of known names
    house = generate_house(seed, config, catalogue=catalogue)
    house_parts(house, catalogue)  # imports the furniture
    forget(cache, house, catalogue, quality)
    used = time.process_time()
    manifest = bake(house, catalogue, cache, quality).manifest
    used, unwrapping = time.process_time() - used, manifest["seconds"]["unwrap"]
    return Grown(
        round(sum(shapely.Polygon(r.polygon).area for r in house.rooms), 1),
        len(house.placements),
        round(used - unwrapping, 1),
        unwrapping,
        manifest["luxels"],
        round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, 0),
        round(sum(size for size, _ in manifest["files"].values()) / 1e6, 1),
    )


def slope(houses: Sequence[Grown]) -> float:
    """Exponent of processor time against area, by least squares of the logarithms; 1 is in proportion."""
    x, y = (np.log([getattr(h, name) for h in houses]) for name in ("area", "processor"))
    return float(np.polyfit(x, y, 1)[0])


def table(facts: dict) -> str:
    """The measures as Markdown."""
    lines = [
        "| m² | objects | luxels | processor, s | unwrapping, s | peak memory, MiB | disk, MB |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {h['area']:g} | {h['objects']} | {h['luxels']:,} | {h['processor']:g} | {h['unwrapping']:g} "
        f"| {h['memory']:,.0f} | {h['disk']:g} |"
        for h in facts["houses"].values()
    ]
    kept = "met" if facts["slope"] <= facts["aim"] else "MISSED"
    return "\n".join(
        [*lines, f"\nSlope {facts['slope']:.2f} (aim <= {facts['aim']:g}: {kept}), quality {facts['quality']}."]
    )


def figure(houses: Sequence[Grown], quality: str) -> bytes:
    """PNG of processor time and peak memory against area, both axes logarithmic."""
    import io

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(8, 3.6), layout="constrained")
    FigureCanvasAgg(drawn)
    left, right = drawn.subplots(1, 2)
    area = np.array([h.area for h in houses])
    for axes, values, label in (
        (left, [h.processor for h in houses], "processor time, s"),
        (right, [h.memory for h in houses], "peak memory, MiB"),
    ):
        axes.loglog(area, values, "o", color="#205080")
        axes.set_xticks(area, [f"{a:.0f}" for a in area])
        axes.minorticks_off()
        axes.set_xlabel("area, m²")
        axes.set_ylabel(label)
        axes.grid(True, which="major", alpha=0.3)
        low, high = min(values), max(values)
        ticks = [t for k in range(-1, 6) for t in (10**k, 2 * 10**k, 5 * 10**k) if low / 2 <= t <= high * 2]
        axes.set_yticks(ticks, [f"{t:g}" for t in ticks])
    steep, start = np.polyfit(np.log(area), np.log([h.processor for h in houses]), 1)
    left.plot(area, np.exp(start) * area**steep, "-", color="#205080", alpha=0.5, label=f"slope {steep:.2f}")
    left.plot(
        area, houses[0].processor * (area / area[0]) ** AIM, ":", color="#888888", label=f"slope {AIM:g}: the aim"
    )
    left.legend(frameon=False)
    drawn.suptitle(f"Light ({quality}) of one house each", fontsize=10)
    data = io.BytesIO()
    drawn.savefig(data, format="png", dpi=110)
    return data.getvalue()
