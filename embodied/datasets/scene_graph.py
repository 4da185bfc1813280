"""A house as a 3D scene graph, and as a semantic map of each storey, for programs that reason about places."""

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import shapely

from embodied.assets.cache import atomic_path, write_bytes, write_json
from embodied.errors import UnableError
from embodied.house.house import House
from embodied.house.moment import WIDEST
from embodied.house.shapes import footprint, opening_of
from embodied.navigation.graph import NavGraph

NEXT_TO = 0.3
"""Metres between the footprints of two pieces of furniture up to which they stand next to each other."""
MAP_STEP = 0.05
"""Side of a pixel of the semantic map, metres."""
MAP_MARGIN = 0.5
"""Metres around the rooms on the semantic map."""


def scene_graph(house: House, graph: NavGraph) -> dict[str, Any]:
    """The house as nodes and edges, ready for JSON.

    Nodes have an `id`, a `layer` ('building', 'storey', 'room', 'furniture', 'object' or 'place'), what they are
    (`kind` or `class`), their `position` (x, y, z, metres, world; of things the middle of the box, `size` its sides and
    `yaw` its turn in radians). Edges have a `relation`: 'contains' goes down the layers, a thing is 'on' or 'in' what
    carries it, furniture is 'next to' furniture, a 'door' joins two rooms (with its `opening`, `kind` and `openness`),
    'walk' joins two places (with its `length`).
    """
    nodes = [{"id": "building", "layer": "building", "kind": "house", "name": house.name, "position": _middle(house)}]
    for k, storey in enumerate(house.storeys):
        nodes.append({"id": f"storey_{k}", "layer": "storey", "position": [*_middle(house)[:2], storey.elevation]})
    for room in house.rooms:
        floor = shapely.Polygon(room.polygon)
        middle = [*floor.centroid.coords[0], house.storey_of(room).elevation]
        facts = {"kind": room.kind, "position": middle, "polygon": [list(c) for c in room.polygon], "area": floor.area}
        nodes.append({"id": room.id, "layer": "room", **facts})
    for p in house.placements:
        x, y, z = p.position
        facts = {"class": p.object_class, "position": [x, y, z + p.size[2] / 2], "size": list(p.size), "yaw": p.yaw}
        nodes.append({"id": p.id, "layer": "furniture" if p.parent is None else "object", **facts})
    for name, position in zip(graph.ids, graph.positions.tolist(), strict=True):
        nodes.append({"id": name, "layer": "place", "position": position})
    about = {"house": house.name, "seed": house.seed, "digest": house.digest}
    return {**about, "nodes": nodes, "edges": [*_edges(house, graph)]}


def _middle(house: House) -> list[float]:
    corners = np.array([c for r in house.rooms for c in r.polygon])
    return [*((corners.min(0) + corners.max(0)) / 2).tolist(), house.storeys[0].elevation]


def _edges(house: House, graph: NavGraph) -> Iterator[dict[str, Any]]:
    edge = lambda a, b, relation, **facts: {"from": a, "to": b, "relation": relation, **facts}
    for k in range(len(house.storeys)):
        yield edge("building", f"storey_{k}", "contains")
    for room in house.rooms:
        yield edge(f"storey_{room.storey}", room.id, "contains")
    for p in house.placements:
        if p.parent is None:
            yield edge(p.room, p.id, "contains")
        else:  # in is what lies inside, as books on a shelf below the top
            carrier = house.placement_by_id[p.parent]
            on_top = p.position[2] >= carrier.position[2] + 0.9 * carrier.size[2]
            yield edge(p.id, p.parent, "on" if on_top else "in")
    standing = [p for p in house.placements if p.parent is None and p.size[2] > 0.03]
    outlines = {p.id: footprint(p) for p in standing}
    for a, b in itertools.combinations(standing, 2):
        if a.room == b.room and outlines[a.id].distance(outlines[b.id]) <= NEXT_TO:
            yield edge(a.id, b.id, "next to")
    for o in house.openings:
        if None not in o.rooms:
            openness = 1.0 if o.leaf_finish is None else min(o.angle / WIDEST, 1.0)
            yield edge(*o.rooms, "door", opening=o.id, kind=o.kind, openness=openness)
    for name, room_id in zip(graph.ids, graph.room_of_node, strict=True):
        yield edge(room_id, name, "contains")
    for (a, b), length in zip(graph.edges.tolist(), graph.lengths.tolist(), strict=True):
        yield edge(graph.ids[a], graph.ids[b], "walk", length=length)


def write_spark_dsg(facts: dict[str, Any], path: Path) -> None:
    """Write a `scene_graph` as Hydra's DynamicSceneGraph: objects and furniture, places, rooms, one building.

    Raises:
      UnableError: the package spark-dsg is not installed.
    """
    try:
        import spark_dsg as dsg  # type: ignore[import-not-found,unused-ignore]
    except ImportError as e:
        raise UnableError(f"--form spark needs spark-dsg ({e}); pip install spark-dsg, or write --form json") from e

    layers = dsg.DsgLayers
    forms = {
        "building": (layers.BUILDINGS, "B", dsg.SemanticNodeAttributes),
        "room": (layers.ROOMS, "R", dsg.RoomNodeAttributes),
        "place": (layers.PLACES, "p", dsg.PlaceNodeAttributes),
        "furniture": (layers.OBJECTS, "O", dsg.ObjectNodeAttributes),
        "object": (layers.OBJECTS, "O", dsg.ObjectNodeAttributes),
    }
    classes = sorted({n.get("class") or n.get("kind", n["layer"]) for n in facts["nodes"]})
    out, symbols, count = dsg.DynamicSceneGraph(), {}, itertools.count()
    for node in facts["nodes"]:
        if node["layer"] not in forms:
            continue
        layer, letter, kind = forms[node["layer"]]
        attributes = kind()
        attributes.position, attributes.name = np.array(node["position"], float), node["id"]
        attributes.semantic_label = classes.index(node.get("class") or node.get("kind", node["layer"]))
        if "size" in node:
            place = np.array(node["position"], np.float32)
            attributes.bounding_box = dsg.BoundingBox(np.array(node["size"], np.float32), place, node["yaw"])
        symbols[node["id"]] = symbol = dsg.NodeSymbol(letter, next(count))
        out.add_node(layer, symbol, attributes)
    carriers = {e["from"]: e["to"] for e in facts["edges"] if e["relation"] in ("on", "in")}
    room_of = {e["to"]: e["from"] for e in facts["edges"] if e["relation"] == "contains"}
    for node in facts["nodes"]:
        name = node["id"]
        while name in carriers:
            name = carriers[name]
        if node["id"] in symbols and node["layer"] in ("furniture", "object", "place"):
            out.insert_edge(symbols[room_of[name]], symbols[node["id"]])
        elif node["layer"] == "room":
            out.insert_edge(symbols["building"], symbols[node["id"]])
    for edge in facts["edges"]:
        if edge["relation"] in ("door", "walk", "on", "in", "next to"):
            out.insert_edge(symbols[edge["from"]], symbols[edge["to"]])
    out.metadata.set({"labels": classes})
    with atomic_path(path) as temporary:
        out.save(str(temporary.with_suffix(".json")), include_mesh=False)
        temporary.with_suffix(".json").replace(temporary)


def write_semantic_maps(house: House, folder: Path) -> int:
    """Write map_<storey>.png and .json for every storey, and return how many there are.

    The picture has a class in each pixel of MAP_STEP: 0 outside and where the floor is open over stairs, then what
    `classes` of the JSON lists; floors are named by the kind of their room, and what stands highest covers what is
    below. Row 0 is the largest y; the JSON has `origin` (x, y of the lower left corner, metres) and `step`.
    """
    names = ["outside", *sorted({r.kind for r in house.rooms} | {p.object_class for p in house.placements})]
    number = {name: i for i, name in enumerate(names)}
    for k in range(len(house.storeys)):
        rooms = [r for r in house.rooms if r.storey == k]
        corners = np.array([c for r in rooms for c in r.polygon])
        low, high = corners.min(0) - MAP_MARGIN, corners.max(0) + MAP_MARGIN
        width, height = np.ceil((high - low) / MAP_STEP).astype(int)
        picture = np.zeros((height, width), np.uint16)

        def fill(shape: shapely.Polygon, value: int, into: np.ndarray = picture, low: np.ndarray = low) -> None:
            at = (np.array(shape.exterior.coords) - low) / MAP_STEP - 0.5
            cv2.fillPoly(into, [np.rint(at).astype(np.int32)], value)

        for room in rooms:
            fill(house.floor(room), number[room.kind])
        of_storey = {r.id for r in rooms}
        for stair in house.stairs:
            if stair.rooms[1] in of_storey:
                fill(opening_of(stair), 0)
        for p in sorted(house.placements, key=lambda p: p.position[2] + p.size[2]):
            if p.room in of_storey:
                fill(footprint(p), number[p.object_class])
        write_bytes(folder / f"map_{k}.png", cv2.imencode(".png", picture[::-1])[1].tobytes())
        facts = {"storey": k, "origin": low.tolist(), "step": MAP_STEP, "classes": names, "house": house.digest}
        write_json(folder / f"map_{k}.json", facts)
    return len(house.storeys)
