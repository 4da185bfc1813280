"""A house as GLB, MJCF or USD, in its baked light or without, as a scene graph, and as semantic maps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.assets.json_file import load_json
from embodied.cli.common import Furnished, Printed, catalogue_of, show
from embodied.cli.exports import register_export
from embodied.house.moment import Moment
from embodied.options import HouseFolder, InputPath, Option, OutputFolder, file_ending_in

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import House
    from embodied.scene.lit_pages import LitPages

LIT_QUALITIES = ("fast", "normal", "high")


@dataclass(frozen=True, kw_only=True)
class HouseOptions(Furnished, Printed):
    """The house."""

    house: HouseFolder
    """Folder that `embodied house` wrote."""
    light: Annotated[str, Option(words=("none", *LIT_QUALITIES))] = "normal"
    """Quality of the baked light; none: export the unlit house."""
    moment: InputPath | None = None
    """Things moved, doors opened and lamps switched, as JSON (docs/moving.md)."""


@dataclass(frozen=True, kw_only=True)
class GlbOptions(HouseOptions):
    """A house as GLB, for web viewers and Blender."""

    out: Annotated[Path, Option(file_ending_in(".glb"), "FILE")]
    """File to write."""
    no_ceilings: bool = False
    """Leave ceilings and roof out, to look in from above."""
    sky: bool = False
    """Keep the backdrop of distant scenery, to look out of the windows."""


@dataclass(frozen=True, kw_only=True)
class MjcfOptions(HouseOptions):
    """A house as MJCF, for MuJoCo's viewer."""

    out: OutputFolder
    """Folder to write."""
    hinged: bool = False
    """Let doors, drawers and lids move; house_metadata.json names their bodies and joints."""
    loose: bool = False
    """Let small things fall, slide and be taken."""


@dataclass(frozen=True, kw_only=True)
class UsdOptions(HouseOptions):
    """A house as USDZ, for USD programs."""

    out: Annotated[Path, Option(file_ending_in(".usdz"), "FILE")]
    """File to write."""
    light: Annotated[str, Option(words=LIT_QUALITIES)] = "normal"
    """Quality of the baked light."""


def run_glb(args: GlbOptions) -> None:
    from embodied.scene.glb import export_glb

    house, catalogue, lit = lit_house(args)
    path = export_glb(house, catalogue, args.out, lit=lit, ceilings=not args.no_ceilings, sky=args.sky)
    show_written(args, "glb", house, lit, path)


def run_mjcf(args: MjcfOptions) -> None:
    from embodied.locks import locked
    from embodied.scene.export import export_mjcf
    from embodied.scene.model import takeable

    house, catalogue, lit = lit_house(args)
    free = takeable(house, catalogue) if args.loose else frozenset()
    with locked(args.out):
        path = export_mjcf(house, catalogue, args.out, lit=lit, hinged=args.hinged, free=free)
    show_written(args, "mjcf", house, lit, path)


def run_usd(args: UsdOptions) -> None:
    from embodied.scene.glb import check_usd, export_usd

    check_usd(args.out)
    house, _, lit = lit_house(args)
    assert lit is not None, "--light cannot be none"
    show_written(args, "usd", house, lit, export_usd(house, lit, args.out))


def lit_house(args: HouseOptions) -> tuple[House, Catalogue, LitPages | None]:
    """The house, its furniture and its baked light, from the cache where it is there; None for no light."""
    from embodied.house.validation import load_lit_house

    catalogue = catalogue_of(args)
    house = load_lit_house(args.house, catalogue)
    moment = Moment() if args.moment is None else load_json(args.moment, Moment)
    if moment.bodies:
        raise ValueError(f"--moment has bodies that are no part of the house: leave {sorted(moment.bodies)} out")
    if args.light == "none":
        return moment.applied(house), catalogue, None
    if not moment.is_rest:
        from embodied.world import open_world

        with open_world(house, catalogue, args.cache, args.light) as world:
            world.show(moment)
            return moment.applied(house), catalogue, world.lit
    from embodied.light import bake, progress_bar

    with progress_bar() as progress:
        return house, catalogue, bake(house, catalogue, args.cache, args.light, progress=progress).lit


def show_written(args: HouseOptions, form: str, house: House, lit: LitPages | None, path: Path) -> None:
    facts = {"house": house.digest, "format": form, "light": lit.digest if lit else None, "path": str(path)}
    show(args, facts, f"{house.name} as {form}: {path}, {path.stat().st_size / 1e6:.1f} MB")


register_export("glb", GlbOptions, run_glb)
register_export("mjcf", MjcfOptions, run_mjcf)
register_export("usd", UsdOptions, run_usd)


@dataclass(frozen=True, kw_only=True)
class SceneGraphOptions(Printed):
    """A house as a 3D scene graph: rooms, furniture and objects, what is on, in and next to what, doors and places."""

    house: HouseFolder
    """Folder that `embodied house` wrote."""
    out: Annotated[Path, Option(file_ending_in(".json"), "FILE")]
    """File to write."""
    form: Annotated[str, Option(words=("json", "spark"))] = "json"
    """Plain JSON, or the DynamicSceneGraph of spark-dsg, which Hydra reads."""


@dataclass(frozen=True, kw_only=True)
class SemanticMapOptions(Printed):
    """A semantic map of every storey: a PNG of classes, 5 cm a pixel, and its JSON."""

    house: HouseFolder
    """Folder that `embodied house` wrote."""
    out: OutputFolder
    """Folder to write."""


def run_scene_graph(args: SceneGraphOptions) -> None:
    from embodied.assets.cache import write_json
    from embodied.datasets.scene_graph import scene_graph, write_spark_dsg
    from embodied.house.house import House
    from embodied.navigation.graph import build_graph

    house = House.load(args.house / "house.json")
    facts = scene_graph(house, build_graph(house))
    (write_json if args.form == "json" else lambda path, facts: write_spark_dsg(facts, path))(args.out, facts)
    counts = {"nodes": len(facts["nodes"]), "edges": len(facts["edges"]), "path": str(args.out)}
    show(args, counts, f"{counts['nodes']} nodes and {counts['edges']} edges of {house.name}: {args.out}")


def run_semantic_map(args: SemanticMapOptions) -> None:
    from embodied.datasets.scene_graph import write_semantic_maps
    from embodied.house.house import House

    house = House.load(args.house / "house.json")
    count = write_semantic_maps(house, args.out)
    show(args, {"storeys": count, "out": str(args.out)}, f"{count} maps of {house.name} in {args.out}")


register_export("scene-graph", SceneGraphOptions, run_scene_graph)
register_export("semantic-map", SemanticMapOptions, run_semantic_map)
