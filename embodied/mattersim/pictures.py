"""Matterport's conventions: the fields of the files that the field's programs read, its skyboxes, and pictures of them,
drawn as the Matterport3D simulator does.

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

A viewpoint's skybox is one picture of six square tiles beside each other. `TILES` says which of our cube faces each
tile is and how often it is turned; nothing is resampled, so that a face survives the way out and back. The simulator of
today reads `<id>_skybox_small.jpg` and `<id>_skybox_depth_small.png` (16 bits, quarters of a millimetre along the ray),
its first release `<id>_skybox{0..5}_sami.jpg`.
"""

from __future__ import annotations

import base64
import functools
import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from embodied.action_spaces import bearing_order, directions, nearest_views
from embodied.assets.cache import atomic_path, write_bytes
from embodied.assets.decoding import MOST_PIXELS, colours, numbers, size_of
from embodied.assets.json_file import read_toml
from embodied.errors import UnableError
from embodied.geometry import heading_of_yaw, wrap, yaw_of_heading
from embodied.interface import STEP, TURNS, VIEW_PITCHES, VIEW_YAWS, VIEWS, Pose
from embodied.render.panorama import (
    Panorama,
    PixelGrid,
    checked,
    padded_plane,
    padded_rgba,
    perspective_grid,
    ray_stretch,
    resampled_rgb,
)
from embodied.render.panorama_file import PanoramaFile

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


TILES = ((3, 0), (5, 1), (2, 3), (4, 1), (0, 1), (1, 2))
"""Face and quarter turns (counter-clockwise) of each tile."""
WHERE = {face: (tile, turns) for tile, (face, turns) in enumerate(TILES)}
"""Tile and quarter turns of each face."""
DEPTH_UNITS = 4000.0
"""Depth along the ray is kept in quarters of a millimetre; 0 where nothing is."""
BGRA = functools.partial(colours, order="BGRA")
RGB, DEPTH = "{}_skybox_small.jpg", "{}_skybox_depth_small.png"


def skybox_folder(dataset: str, scan: str) -> Path:
    return Path(dataset) / scan / "matterport_skybox_images"


def tiles_of(faces: np.ndarray) -> np.ndarray:
    """(6, s, s, ...) tiles of a skybox from our faces."""
    return np.stack([np.rot90(faces[face], turns) for face, turns in TILES])


def write_face(strip: np.ndarray, face: int, to: np.ndarray) -> None:
    """Write one of our faces, (s, s, ...), from its tile of a skybox, whose tiles lie beside each other.

    Raises:
      ValueError: the tiles are not square.
    """
    (height, width), (tile, turns) = strip.shape[:2], WHERE[face]
    if width != 6 * height:
        raise ValueError(f"MatterSim: a skybox is six squares beside each other, got {width} x {height} pixels")
    to[...] = np.rot90(strip[:, tile * height : (tile + 1) * height], -turns)


class Skyboxes:
    """The skyboxes of a folder, the last used of them in memory."""

    def __init__(self, dataset: str, kept: int) -> None:
        """Args:
        dataset: folder of `<scan>/matterport_skybox_images`.
        kept: how many to keep in memory.
        """
        self.dataset = dataset
        self.colours = functools.lru_cache(maxsize=max(1, kept))(self._colours)
        self.distances = functools.lru_cache(maxsize=max(1, kept))(self._distances)

    def _colours(self, scan: str, viewpoint: str) -> np.ndarray:
        """`padded_rgba` of a skybox's colours, blue, green, red.

        Raises:
          ValueError: a picture is missing, or cannot be read.
        """
        strip = _pixels(skybox_folder(self.dataset, scan) / RGB.format(viewpoint), BGRA)
        return padded_rgba(len(strip), functools.partial(write_face, strip))

    def _distances(self, scan: str, viewpoint: str) -> np.ndarray:
        """`padded_plane` of a skybox's depth along the ray, uint16 DEPTH_UNITS.

        Raises:
          ValueError: the picture is missing.
        """
        units = _pixels(skybox_folder(self.dataset, scan) / DEPTH.format(viewpoint), numbers)
        return padded_plane(len(units), functools.partial(write_face, units), kind=np.uint16)

    def rgb(
        self, scan: str, viewpoint: str, heading: float, elevation: float, vfov: float, size: tuple[int, int]
    ) -> np.ndarray:
        """(h, w, 3) uint8, blue, green, red: the picture of a pose; size is (height, width)."""
        padded = self.colours(scan, viewpoint)
        return resampled_rgb(padded, _grid(padded.shape[1] - 2, heading, elevation, vfov, size))

    def metres(
        self, scan: str, viewpoint: str, heading: float, elevation: float, vfov: float, size: tuple[int, int]
    ) -> np.ndarray:
        """(h, w, 1) uint16, quarters of a millimetre along the optical axis; 0 where nothing is.

        Distances along the ray are mixed linearly before they are shortened, also across edges, as in that simulator
        (its src/lib/fragment.sh).
        """
        padded = self.distances(scan, viewpoint)
        _, x, y = _grid(padded.shape[1] - 2, heading, elevation, vfov, size).maps
        along_rays = cv2.remap(padded, x, y, cv2.INTER_LINEAR)
        return cv2.multiply(along_rays, _ray_shortening(vfov, *size), dtype=cv2.CV_16U)[..., None]


@functools.lru_cache(maxsize=8)
def _ray_shortening(vfov: float, height: int, width: int) -> np.ndarray:
    """(h, w) float32: distance along the optical axis per distance along each pixel's ray."""
    step = math.tan(vfov / 2) / height
    right, up = step * np.arange(1 - width, width, 2), step * np.arange(1 - height, height, 2)
    return (1 / np.sqrt(1 + right**2 + up[:, None] ** 2)).astype(np.float32)


def _grid(s: int, heading: float, elevation: float, vfov: float, size: tuple[int, int]) -> PixelGrid:
    return perspective_grid(s, float(yaw_of_heading(heading)), elevation, vfov, *checked(vfov, size))


def _pixels(path: Path, decode: Callable[[bytes], np.ndarray | None]) -> np.ndarray:
    """The pixels of a picture.

    Raises:
      ValueError: there is none, or too large a one.
    """
    data = path.read_bytes() if path.is_file() else b""
    width, height = size_of(data) or (0, 0)
    picture = decode(data) if 0 < width * height <= MOST_PIXELS else None
    if picture is None:
        raise ValueError(
            f"MatterSim: Could not open skybox files at: {path}; write them with `embodied export matterport`, "
            "or call setRenderingEnabled(False)"
        )
    return picture


FACES = "{}_skybox{}_sami.jpg"
"""The first release reads its tiles from six files."""
QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
"""About 47 dB for our pictures."""
PACKING = [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP]
"""Depth in differences from row to row is smaller, and read and written in two thirds of the time."""


def drawn(panoramas: Path) -> Path:
    """The panorama file of a house, which has to be there.

    Raises:
      ValueError: there are no panoramas.
    """
    if not Path(panoramas).exists():
        raise ValueError(
            f"{panoramas} does not exist; draw the panoramas first: run the command that built the data set "
            "once more, with --pictures fast"
        )
    return Path(panoramas)


def write_skyboxes(panoramas: Path, ids: Sequence[str], folder: Path) -> list[Path]:
    """Write the skyboxes of a house; returns their files.

    Args:
      panoramas: the house's panorama file, which has to be there (`drawn`).
      ids: viewpoint id of each node.
    """
    with PanoramaFile(panoramas) as file:
        return [path for node, key in enumerate(ids) for path in write_skybox(file.read(node), key, folder)]


def write_skybox(panorama: Panorama, viewpoint: str, folder: Path) -> list[Path]:
    """Write the skybox of one viewpoint; returns its files."""
    colours = tiles_of(panorama.rgb[..., ::-1])
    metres = np.where(np.isfinite(panorama.depth), panorama.depth * ray_stretch(panorama.size), 0)
    units = tiles_of(np.minimum(np.rint(metres * DEPTH_UNITS), 65535).astype(np.uint16))
    pictures = {
        RGB.format(viewpoint): (np.concatenate(list(colours), axis=1), QUALITY),
        DEPTH.format(viewpoint): (np.concatenate(list(units), axis=1), PACKING),
        **{FACES.format(viewpoint, k): (tile, QUALITY) for k, tile in enumerate(colours)},
    }
    files = []
    for name, (picture, options) in pictures.items():
        files.append(Path(folder) / name)
        write_bytes(files[-1], cv2.imencode(files[-1].suffix, np.ascontiguousarray(picture), options)[1].tobytes())
    return files
