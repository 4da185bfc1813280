"""connectivity.json: navigation graphs as Matterport3DSimulator's programs read them, written and read."""

import json
import logging
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components

from embodied.assets.cache import write_bytes
from embodied.assets.json_file import RecordError, parse_file, shown
from embodied.house.house import House, HouseError
from embodied.navigation.free_space import EYE
from embodied.navigation.graph import NavGraph, graph_of, sight_lines

log = logging.getLogger(__name__)


def to_matterport(graph: NavGraph, house: House, path: Path) -> None:
    """Write the graph as Matterport3DSimulator's `<scan>_connectivity.json`.

    Per viewpoint: image_id, pose (16 floats, row-major camera-to-world, translation at 3, 7, 11), included,
    visible (a line of sight, however far), unobstructed (an edge), height; 'room' is ours and ignored by the
    programs that read the format.
    """
    n = len(graph.ids)
    open_ = np.zeros((n, n), bool)
    open_[graph.edges[:, 0], graph.edges[:, 1]] = open_[graph.edges[:, 1], graph.edges[:, 0]] = True
    seen = sight_lines(graph, house)
    items = []
    for k, (x, y, z) in enumerate(graph.positions.tolist()):
        pose = [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0]
        here = {"image_id": graph.ids[k], "pose": pose, "included": True, "visible": seen[k].tolist()}
        items.append({**here, "unobstructed": open_[k].tolist(), "height": EYE, "room": graph.room_of_node[k]})
    write_bytes(Path(path), json.dumps(items).encode())


def from_matterport(path: Path) -> NavGraph:
    """Read a connectivity file; viewpoints that are not included are left out, unknown rooms are ''.

    Of real scans, some of which have a viewpoint that no edge reaches, the largest piece is taken, and the log says
    what is left out. Files that name rooms are of our own houses, whose graphs have one piece.

    Raises:
      HouseError: not such a file, an asymmetric matrix, viewpoints of one name, or a house's graph in several pieces.
    """
    items = viewpoints_of(path)
    keep = np.array([k for k, i in enumerate(items) if i["included"]], dtype=np.int64)
    names = Counter(items[k]["image_id"] for k in keep)
    if twice := [name for name, count in names.items() if count > 1]:
        raise HouseError(f"{path} has the viewpoint {twice[0]!r} twice; each needs an image_id of its own")
    if not len(keep):
        raise HouseError(f"{path} includes no viewpoint; set 'included' of those that can be walked to")
    matrix = np.array([[items[k]["unobstructed"][j] for j in keep] for k in keep], dtype=bool)
    if (matrix != matrix.T).any():
        a, b = (items[keep[k]]["image_id"] for k in np.argwhere(matrix != matrix.T)[0])
        raise HouseError(
            f"{path}: 'unobstructed' should be symmetric, but says otherwise from {a!r} to {b!r} than back; correct one"
        )
    count, piece = connected_components(csr_matrix(matrix), directed=False)
    if count > 1:
        main = piece == np.argmax(np.bincount(piece))
        apart = [items[k]["image_id"] for k in keep[~main]]
        if any("room" in items[k] for k in keep):
            raise HouseError(
                f"{path}: no edge leads from {apart[0]!r} to the rest of the house; export the house again"
            )
        log.warning(
            "%s is in %s pieces; %s of %s viewpoints that cannot be reached are left out: %s",
            *(path, count, len(apart), len(keep), ", ".join(apart[:5])),
        )
        keep, matrix = keep[main], matrix[np.ix_(main, main)]
    positions = np.array([[items[k]["pose"][at] for at in (3, 7, 11)] for k in keep], dtype=float)
    edges = np.argwhere(np.triu(matrix, 1))
    return graph_of(
        positions, edges, tuple(items[k]["image_id"] for k in keep), tuple(items[k].get("room", "") for k in keep)
    )


def viewpoints_of(path: Path) -> list[dict[str, Any]]:
    """The viewpoints of a connectivity file as it lists them, each with what the format asks for.

    Raises:
      HouseError: not such a file; says which viewpoint is not one.
    """
    try:
        items = parse_file(path, "a Matterport connectivity file")
    except RecordError as e:
        raise HouseError(f"{e}; write one with to_matterport") from e
    if not isinstance(items, list) or not items:
        raise HouseError(f"{path} should hold a list of viewpoints, got {shown(items)}; write one with to_matterport")
    wrong = next((k for k, i in enumerate(items) if not _is_viewpoint(i, len(items))), None)
    if wrong is not None:
        raise HouseError(
            f"{path} is not a Matterport connectivity file: viewpoint {_named(items, wrong)} should have an image_id, "
            f"a pose of 16 finite numbers, 'included', and {len(items)} booleans 'unobstructed'; write one with "
            "to_matterport"
        )
    return items


def _named(items: list[Any], k: int) -> str:
    """A viewpoint that is none, as an error names it: by its number, and by its id where it has one."""
    name = items[k].get("image_id") if isinstance(items[k], dict) else None
    return f"{k} ({name[:40]!r})" if isinstance(name, str) else f"{k}"


def _is_viewpoint(item: object, count: int) -> bool:
    """True if `item` is one of the `count` viewpoints of a connectivity file."""
    if not isinstance(item, dict):
        return False
    pose, open_ = item.get("pose"), item.get("unobstructed")
    return (
        isinstance(item.get("image_id"), str)
        and isinstance(item.get("included"), bool)
        and isinstance(item.get("room", ""), str)
        and isinstance(pose, list)
        and len(pose) == 16
        and all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= 1e6 for x in pose)
        and isinstance(open_, list)
        and len(open_) == count
        and all(isinstance(x, bool) for x in open_)
    )
