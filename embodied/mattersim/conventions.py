"""Matterport's conventions, and the fields of the files that the field's programs read.

Only in this package and in exported files they apply: heading clockwise from +y, viewIndex
12 band + heading bin. Scans are named like our houses without underscores, because the programs join
and split ids at underscores. embodied.datasets.folders writes the files; their fields:

  connectivity/<scan>_connectivity.json, scans.txt   see navigation.connectivity.to_matterport
  R2R_<split>.json      path_id, scan, heading, path, distance, instructions (all wordings)
  hanna_<split>.json    path_id, scan, heading, paths (one shortest path per goal), instructions
  routes.json           scan -> [path_id (text), path, instruction, view_id, split]
  panoramic_action_space.json   '<scan>_<viewpoint>_<bin>' -> actions, see `action_list`
  vocab.txt, scan_split.json, accepted_objects.txt, region_label.txt    HANNA's side files
  asknav_<split>.json   as HANNA's, with trajectories (index, dHeading, dElevation), start_region_name,
                        end_region_name, object_name
  <scan>/house_segmentations/panorama_to_region.txt   number, viewpoint, number of the room, region letter (VNLA)
  *.tsv                 scanId, viewpointId, image_w, image_h, vfov, base64 float32 36 x D
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from embodied.action_spaces import bearing_order, directions, nearest_views
from embodied.assets.cache import atomic_path
from embodied.assets.json_file import read_toml
from embodied.errors import UnableError
from embodied.geometry import heading_of_yaw, wrap
from embodied.interface import STEP, TURNS, VIEW_PITCHES, VIEW_YAWS, VIEWS, Pose

if TYPE_CHECKING:
    from embodied.navigation.graph import NavGraph

_LETTERS = read_toml(Path(__file__).with_name("regions.toml"))
REGIONS = {kind: letter for letter, region in _LETTERS.items() for kind in region["kinds"]}
"""Our room kinds as Matterport's region letters; anything else is 'z', other room."""
REGION_NAMES = {letter: region["name"] for letter, region in _LETTERS.items()}
CAMERA = {
    "left": (0, -1, 0),
    "right": (0, 1, 0),
    "up": (0, 0, 1),
    "down": (0, 0, -1),
    "forward": (1, 0, 0),
    "stop": (0, 0, 0),
}
"""VNLA's words as MatterSim actions: index of the move, sign of the heading change (right is +), of the elevation's."""


def scan_name(world: str) -> str:
    return world.replace("_", "")


def view_index(view: int) -> int:
    """Matterport's viewIndex of our view, whose headings go clockwise from +y, ours counter-clockwise from +x; it is
    its own inverse."""
    return TURNS * (view // TURNS) + (TURNS // 4 - view) % TURNS


VIEW_OF_INDEX = np.array([view_index(v) for v in range(VIEWS)])
"""(36,) our view of each viewIndex, and the other way round."""


def in_matterport_order(features: np.ndarray) -> np.ndarray:
    """(..., 36, D) features with row k for viewIndex k, from rows in our order; its own inverse."""
    return features[..., VIEW_OF_INDEX, :]


def heading(pose: Pose) -> float:
    """Radians clockwise from +y."""
    return round(float(heading_of_yaw(pose.yaw)), 6)


def action_list(graph: NavGraph, node: int, bin_: int) -> list[dict[str, object]]:
    """HANNA's panoramic action list for a heading bin, in the order of our candidates.

    Element 0 stops: relViewIndex -1, absViewIndex the bin, nextViewpointId itself. Then every
    neighbour: relViewIndex (0 is the current heading looking down), absViewIndex, nextViewpointId,
    rel_heading (right is positive), rel_elevation (from the horizon), distance (angular, to the
    centre of its view). Sorted by |rel_heading|, as in the authors' program; a neighbour halfway between
    two views belongs to the one of the lower number, where theirs decides by rounding and by the heading.
    """
    nodes, yaw, pitch = directions(graph, node)
    views = nearest_views(yaw, pitch)
    relative = wrap(heading_of_yaw(yaw) - bin_ * STEP)
    offset = np.hypot(wrap(yaw - VIEW_YAWS[views]), pitch - VIEW_PITCHES[views])
    actions: list[dict[str, object]] = [{"relViewIndex": -1, "absViewIndex": bin_, "nextViewpointId": graph.ids[node]}]
    for k in bearing_order(relative, nodes):
        index = view_index(int(views[k]))
        turned = TURNS * (index // TURNS) + (index - bin_) % TURNS
        views_to = {"relViewIndex": turned, "absViewIndex": index, "nextViewpointId": graph.ids[int(nodes[k])]}
        angles = {"rel_heading": float(relative[k]), "rel_elevation": float(pitch[k]), "distance": float(offset[k])}
        actions.append({**views_to, **angles})
    return actions


def write_features(path: Path, rows: Iterable[tuple[str, str, np.ndarray]]) -> None:
    """The feature file of Matterport3DSimulator.

    Args:
      rows: (house name, viewpoint id, (36, D) features in our order).
    """
    with atomic_path(Path(path)) as temporary, open(temporary, "w", encoding="ascii", newline="") as f:
        for name, viewpoint, features in rows:
            code = base64.b64encode(in_matterport_order(features).astype("<f4").tobytes()).decode()
            f.write("\t".join([scan_name(name), viewpoint, "640", "480", "60", code]) + "\r\n")


def write_hdf5(path: Path, rows: Iterable[tuple[str, str, np.ndarray]]) -> None:
    """The feature file of HAMT and VLN-DUET: '<scan>_<viewpoint>' to (36, D) float32, row k for viewIndex k.

    Args:
      rows: as of `write_features`.

    Raises:
      UnableError: there is no h5py.
    """
    try:
        import h5py  # late: optional
    except ImportError as e:
        raise UnableError(f"features go into HDF5 ({e}); pip install embodied-houses[hdf5]") from e
    with atomic_path(Path(path)) as temporary, h5py.File(temporary, "w") as f:
        for name, viewpoint, features in rows:
            scan = scan_name(name)
            data = f.create_dataset(f"{scan}_{viewpoint}", data=in_matterport_order(features).astype(np.float32))
            facts = {"scanId": scan, "viewpointId": viewpoint, "image_w": 640, "image_h": 480, "vfov": 60}
            data.attrs.update(facts)


def tokenised(text: str) -> str:
    """Lower case, punctuation set apart by blanks."""
    return " ".join(re.findall(r"[a-z0-9'-]+|[^\sa-z0-9]", text.lower()))


def region_name(kind: str) -> str:
    """Matterport's name of a room of one of our kinds."""
    return REGION_NAMES[REGIONS.get(kind, "z")]


def region_lines() -> list[str]:
    """Lines of region_label.txt."""
    return [f"'{k}' = {v}" for k, v in REGION_NAMES.items()]
