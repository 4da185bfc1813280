"""Generate a furnished house into a folder.

Writes house.json (the house as data), house.xml with its meshes and textures (opens in MuJoCo's viewer),
connectivity.json (the navigation graph in Matterport's format) and plan.png.
"""

from dataclasses import dataclass
from typing import Annotated

from embodied.cli.common import Furnished, Printed, catalogue_of, fetch, show
from embodied.generate import HouseConfig, generate_house
from embodied.generate.config import SHAPES, SPECIAL
from embodied.generate.plan_file import house_of_plan, load_plan
from embodied.house.house import LANDSCAPES, SEASONS, WEATHERS
from embodied.house.validation import STYLES
from embodied.options import InputPath, OutputFolder, Settings
from embodied.seeds import NOVELTIES

KIND = "kind of house (what is not given is drawn from the seed)"
HOUSE_WORDS = {"shape": SHAPES, "style": STYLES, "weather": WEATHERS, "landscape": LANDSCAPES, "season": SEASONS}
HOUSE_WORDS |= {"novelty": NOVELTIES, "special": SPECIAL}


@dataclass(frozen=True, kw_only=True)
class GenerateOptions(Furnished, Printed):
    out: OutputFolder
    """Folder to write, made if missing."""
    seed: int = 0
    """Random seed; the same seed gives the same house."""
    plan: InputPath | None = None
    """JSON file with the rooms of your own floor plan (docs/houses.md)."""
    no_mjcf: bool = False
    """Leave out house.xml and its files."""
    config: Annotated[HouseConfig, Settings(KIND, HouseConfig(), words=HOUSE_WORDS)]


def run(args: GenerateOptions) -> None:
    from embodied.house.floor_plan import save_plan
    from embodied.navigation.connectivity import to_matterport
    from embodied.navigation.graph import build_graph
    from embodied.scene.export import export_mjcf

    catalogue, config = catalogue_of(args), args.config
    if args.plan:
        house = house_of_plan(load_plan(args.plan), args.seed, config, catalogue)
    else:
        house = generate_house(args.seed, config, catalogue)
    graph = build_graph(house)
    args.out.mkdir(parents=True, exist_ok=True)
    house.save(args.out / "house.json")
    to_matterport(graph, house, args.out / "connectivity.json")
    save_plan(house, args.out / "plan.png", graph=graph)
    if not args.no_mjcf:
        fetch(catalogue, house)
        export_mjcf(house, catalogue, args.out)
    facts = {"seed": args.seed, "digest": house.digest, "area_m2": round(house.area, 1), "rooms": len(house.rooms)}
    facts |= {"objects": len(house.placements), "nodes": len(graph.ids), "out": str(args.out)}
    text = f"{house.name}: {facts['rooms']} rooms on {facts['area_m2']} m2, {facts['objects']} objects, "
    show(args, facts, text + f"{facts['nodes']} viewpoints -> {args.out}")
