"""Pictures of the people of lit houses, as those see them who meet them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.bench.moments import MOVING_HOURS
from embodied.generate import HouseConfig, generate_house
from embodied.generate.people import add_people, place_people
from embodied.navigation.graph import build_graph
from embodied.world import open_world

PEOPLE_HOUSES, PEOPLE_AREA = 6, (44.0, 60.0)
"""Houses, and their square metres."""
CROP, CROP_ANGLE = (400, 300), math.radians(66)
"""Height and width of a picture, pixels, and its vertical field of view."""
ROW = 6


def people_pictures(
    catalogue: Catalogue, cache: Path, out: Path, *, seed: int, progress: Callable[[str], None]
) -> dict[str, object]:
    """Draws everybody whom one meets in six houses from where one meets them: out/people/K_ID.png, and a sheet."""
    folder, crops = out / "people", []
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(PEOPLE_HOUSES):
        hour, weather = MOVING_HOURS[k]
        house = generate_house(seed + k, HouseConfig(area=PEOPLE_AREA, hour=hour, weather=weather), catalogue)
        graph = build_graph(house)
        met = place_people(house, graph, catalogue, seed=seed)
        house = add_people(house, met, met)
        with open_world(house, catalogue, cache, pictures="fast") as world:
            for person in (p for p in house.placements if p.object_class == "person"):
                node = next(n for n in met if met[n].position == person.position)
                eye = graph.positions[node]
                x, y, z = np.array([*person.position[:2], person.position[2] + 0.72 * person.size[2]]) - eye
                yaw, pitch = math.atan2(y, x), math.atan2(z, math.hypot(x, y))
                rgb = world.renderer.view(eye, yaw, pitch, CROP_ANGLE, CROP).rgb
                cv2.imwrite(str(folder / f"{k}_{person.id}.png"), rgb[..., ::-1])
                crops.append(rgb)
        progress(f"house {k + 1} of {PEOPLE_HOUSES}: {len(crops)} people so far")
    crops += [np.zeros_like(crops[0])] * (-len(crops) % ROW)
    sheet = np.vstack([np.hstack(crops[i : i + ROW]) for i in range(0, len(crops), ROW)])
    cv2.imwrite(str(out / "people.png"), sheet[..., ::-1])
    return {"sheet": str(out / "people.png"), "people": len(list(folder.glob("*.png")))}
