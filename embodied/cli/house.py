"""Generate a furnished house into a folder.

Writes house.json (the house as data), house.xml with its meshes and textures (opens in MuJoCo's
own viewer), connectivity.json (the navigation graph in Matterport's format) and plan.png.
"""

from __future__ import annotations

import argparse
import importlib.util

from embodied.cli.common import Stages, add_cache, add_json, add_packs, catalogue_of, fetch, note, show
from embodied.cli.options import add_fields, any_path, chosen, folder_to_write
from embodied.generate import HouseConfig, generate_house
from embodied.generate.config import SHAPES
from embodied.generate.plan_file import house_of_plan, load_plan
from embodied.house.house import LANDSCAPES, SEASONS, WEATHERS
from embodied.house.validation import STYLES
from embodied.novelty import NOVELTIES


def add(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--seed", type=int, default=0, help="which house; the same seed gives the same house (default: %(default)s)"
    )
    parser.add_argument(
        "--out", type=folder_to_write, required=True, metavar="DIR", help="folder to write, made if missing"
    )
    parser.add_argument(
        "--plan", type=any_path, metavar="FILE", help="JSON file with the rooms of your own floor plan (docs/houses.md)"
    )
    parser.add_argument("--no-mjcf", action="store_true", help="leave out house.xml and its files")
    parser.add_argument("--glb", action="store_true", help="also write house.glb, for Blender and the web")
    group = parser.add_argument_group("what kind of house", "what is not given is drawn from the seed")
    words = {"shape": SHAPES, "style": STYLES, "weather": WEATHERS, "landscape": LANDSCAPES, "season": SEASONS}
    add_fields(group, HouseConfig, words=words | {"novelty": NOVELTIES})
    add_cache(parser)
    add_packs(parser)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    from embodied.navigation.graph import build_graph, to_matterport
    from embodied.scene.export import export_glb, export_mjcf

    catalogue, config = catalogue_of(args), chosen(args, HouseConfig())
    with Stages("layout and furniture", "viewpoints", "floor plan", "meshes", "house.xml", "house.glb") as stages:
        if args.plan:
            house = house_of_plan(load_plan(args.plan), args.seed, config, catalogue)
        else:
            house = generate_house(args.seed, config, catalogue)
        stages.next()
        graph = build_graph(house)
        stages.next()
        args.out.mkdir(parents=True, exist_ok=True)
        house.save(args.out / "house.json")
        to_matterport(graph, house, args.out / "connectivity.json")
        if drew_plan := importlib.util.find_spec("matplotlib") is not None:
            from embodied.house.floor_plan import save_plan

            save_plan(house, args.out / "plan.png", graph=graph)
        stages.next()
        if args.glb or not args.no_mjcf:
            fetch(catalogue, house)
        stages.next()
        if not args.no_mjcf:
            export_mjcf(house, catalogue, args.out)
        stages.next()
        if args.glb:
            export_glb(house, catalogue, args.out / "house.glb")
    if not drew_plan:
        note("plan.png is left out, because Matplotlib is not installed: pip install 'embodied-houses[viz]'")
    facts = {
        "seed": args.seed,
        "digest": house.digest,
        "area_m2": round(house.area, 1),
        "rooms": len(house.rooms),
        "objects": len(house.placements),
        "nodes": len(graph.ids),
        "out": str(args.out),
    }
    show(
        args,
        facts,
        f"{house.name}: {facts['rooms']} rooms on {facts['area_m2']} m2, {facts['objects']} objects, "
        f"{facts['nodes']} viewpoints -> {args.out}",
    )
    return 0
