"""A house as a scene graph, and as semantic maps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from embodied.cli.common import Printed, show
from embodied.cli.exports import Export, register_export
from embodied.options import HouseFolder, Option, OutputFolder, file_ending_in


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


register_export(Export("scene-graph", SceneGraphOptions, run_scene_graph))
register_export(Export("semantic-map", SemanticMapOptions, run_semantic_map))
