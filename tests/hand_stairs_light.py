"""Measures baked pictures on stairs, on galleries and under roofs against the path tracer; not collected by pytest.

python tests/hand_stairs_light.py FIRST LAST OUT.json      # seeds of houses of two storeys with attic and gallery
"""

import math
import sys
from pathlib import Path

import numpy as np

from embodied.assets.cache import default_cache, write_json
from embodied.assets.catalogue import load_catalogue
from embodied.bench import light
from embodied.bench.light import VIEW_ANGLE, psnr
from embodied.generate import HouseConfig, generate_house
from embodied.house.house import House
from embodied.light.baking.house import bake
from embodied.light.tracing.reference import Tracer
from embodied.navigation.graph import build_graph, stair_ends, stair_points
from embodied.render.camera import camera_at
from embodied.render.classic import Renderer

SIZE, RAYS = (100, 150), 64


def views(house: House) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Kind of place, eye and what it looks at, (3,) metres each."""
    stair, graph, up = house.stairs[0], build_graph(house), np.array((0, 0, 1.5))
    foot, head = (p + up for p in stair_ends(stair))
    turns, middle = stair_points(stair) + up, np.mean(stair.path, axis=0) + up
    opening = np.append(np.mean(stair.void or stair.well, axis=0), head[2] - 0.5)
    shown = [
        ("stairs", foot, turns[0]),
        ("stairs", turns[-1], head),
        ("stairs", turns[0], foot),
        ("stairs", head, foot),
    ]
    shown += [
        ("gallery" if stair.void else "stairs", *pair) for pair in ((head, opening), (foot, middle), (head, middle))
    ]
    for name, eye, yaw in light.viewpoints(house, ("stairwell",) * 9):
        room = house.room_by_id[name]
        ahead = eye + (math.cos(yaw), math.sin(yaw), -0.1)
        shown += [("under the roof" if room.slopes else "other rooms", eye, ahead)] * (room.kind != "stairwell")
    for o in (o for o in house.openings if o.kind == "roof_window"):
        nodes = [p for p, r in zip(graph.positions, graph.room_of_node, strict=True) if r == o.rooms[0]]
        middle = np.mean([o.a, o.b], axis=0)
        eye = max(nodes, key=lambda p: math.dist(p[:2], middle))
        shown.append(("roof windows", eye, np.append(middle, eye[2])))
    return [v for v in shown if math.dist(v[1][:2], v[2][:2]) > 0.3]


def main(first: int, last: int, out: str) -> None:
    catalogue, rows, light.ROOMS_SHOWN = load_catalogue(), [], 20
    for seed in range(first, last):
        config = HouseConfig(area=(112, 122), storeys=2, special=("gallery", "attic"), hour=13, weather="clear")
        house = generate_house(seed, config, catalogue)
        baked = bake(house, catalogue, default_cache(), "fast")
        tracer = Tracer(baked, house, quality="diffuse", rays=RAYS)
        with Renderer(house, catalogue, lit=baked.lit) as renderer:
            for k, (place, eye, to) in enumerate(views(house)):
                d = to - eye
                yaw, pitch = math.atan2(d[1], d[0]), math.atan2(d[2], math.hypot(d[0], d[1]))
                camera = camera_at(eye, yaw, pitch, VIEW_ANGLE)
                look = (tuple(eye), camera.forward, camera.up, VIEW_ANGLE, SIZE)
                truth, plain = tracer.picture(*look)[0], tracer.plain(*look)
                rgb = renderer.view(eye, yaw, pitch, VIEW_ANGLE, SIZE).rgb
                rows.append({"seed": seed, "place": place, "psnr": psnr(rgb, truth, plain)})
                print(k, rows[-1], flush=True)
        write_json(Path(out), rows)


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
