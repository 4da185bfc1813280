"""Your own furniture: a model file and one line about it, and it stands in generated houses.

    python examples/own_furniture.py --out out/furniture

A coffee table is modelled here with trimesh; any .glb, .obj or .sh3f file does. docs/assets.md lists the fields.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import cv2
import numpy as np
import trimesh

import embodied


def model(path: Path) -> None:
    """A red board on four legs, in metres; in a .glb y is up and the front looks along +z."""
    parts = [((1.0, 0.05, 0.6), (0.0, 0.40, 0.0)), ((0.9, 0.03, 0.5), (0.0, 0.14, 0.0))]
    parts += [((0.06, 0.40, 0.06), (x, 0.20, z)) for x in (-0.44, 0.44) for z in (-0.24, 0.24)]
    boxes = [trimesh.creation.box(size, trimesh.transformations.translation_matrix(at)) for size, at in parts]
    mesh = trimesh.util.concatenate(boxes)
    paint = trimesh.visual.material.PBRMaterial("paint", baseColorFactor=(200, 30, 25, 255), roughnessFactor=0.4)
    mesh.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(mesh.vertices), 2)), material=paint)
    mesh.export(path)


def describe(folder: Path) -> None:
    """catalogue.json: whose it is, and what it is; the class says where such a thing stands."""
    table = {"file": "table.glb", "class": "coffee table", "name": "red coffee table", "colours": ["red"]}
    table |= {"size": [1.0, 0.6, 0.43], "rooms": {"living_room": 100}}  # a hundred times as welcome as others
    about = {"pack": "mine", "creator": "Jane Doe", "licence": "CC0-1.0", "models": {"table": table}}
    (folder / "catalogue.json").write_text(json.dumps(about, indent=2))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/furniture"))
    parser.add_argument("--seed", type=int, default=0, help="the first house to try")
    args = parser.parse_args()
    models = args.out / "models"
    models.mkdir(parents=True, exist_ok=True)
    model(models / "table.glb")
    describe(models)

    catalogue = embodied.load_catalogue(own=[models])
    for seed in range(args.seed, args.seed + 20):
        house = embodied.generate_house(seed, embodied.HouseConfig(area=(38.0, 46.0)), catalogue)
        mine = [p for p in house.placements if p.asset == "mine/table"]
        if mine:
            break
    else:
        raise SystemExit("no table in 20 houses; is there something in front of it in the catalogue?")
    table = mine[0]
    print(f"house {seed}: {table.id} in {table.room}, at {np.round(table.position, 2).tolist()}")

    with embodied.open_world(house, catalogue, embodied.default_cache(), size=384) as world:
        nodes = range(len(world.graph.ids))
        seeing = [(s.distance, n, s) for n in nodes for s in world.sightings(n) if s.placement == table.id]
        if not seeing:
            raise SystemExit("it stands where no viewpoint sees it; try another --seed")
        _, node, sight = min(seeing, key=lambda x: x[:2])
        picture = world.panorama(node).view_rgb(yaw=sight.yaw, pitch=sight.pitch, vfov=math.pi / 3, size=(480, 640))
        cv2.imwrite(str(args.out / "table.png"), picture[..., ::-1])
    print(f"seen from viewpoint {node}: {args.out / 'table.png'}")


if __name__ == "__main__":
    main()
