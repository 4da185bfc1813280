"""Generate a flat from a seed, write its plan, and look around from one of its viewpoints.

    python examples/generate_and_look.py --seed 7 --out out/look

With `--pictures normal` the flat is lit first, which takes a few minutes once.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2

import embodied
from embodied.house.floor_plan import save_plan


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--out", type=Path, default=Path("out/look"))
    parser.add_argument("--pictures", default="unlit", choices=("unlit", "fast", "normal"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)

    catalogue = embodied.load_catalogue()
    house = embodied.generate_house(args.seed, embodied.HouseConfig(area=(38.0, 46.0)), catalogue)
    house.save(args.out / "house.json")
    print(f"{house.name}: {len(house.rooms)} rooms, {len(house.placements)} objects, digest {house.digest[:12]}")

    with embodied.open_world(house, catalogue, embodied.default_cache(), size=256, pictures=args.pictures) as world:
        save_plan(house, args.out / "plan.png", graph=world.graph)
        node = len(world.graph.ids) // 2
        panorama = world.panorama(node)
        cv2.imwrite(str(args.out / "panorama.png"), panorama.equirect(512)[..., ::-1])  # OpenCV writes BGR
        largest = max(world.sightings(node), key=lambda s: s.pixels)
        view = panorama.view_rgb(yaw=largest.yaw, pitch=largest.pitch, size=(480, 640))
        cv2.imwrite(str(args.out / "view.png"), view[..., ::-1])
        seen = sorted({s.object_class for s in world.sightings(node)})
        print(f"viewpoint {node} in {world.graph.room_of_node[node]} sees: {', '.join(seen)}")
    print(f"written: {', '.join(str(p) for p in sorted(args.out.iterdir()))}")


if __name__ == "__main__":
    main()
