"""The pictures of a data set as a torch Dataset: what is seen, how far, of what, from where, in which room.

    pictures = ViewpointPictures(Dataset(Path("data/hanna")), "train", view=ViewSettings("view", 96, 128))
    for batch in torch.utils.data.DataLoader(pictures, batch_size=32, shuffle=True, num_workers=2):
        batch["rgb"], batch["depth"], batch["visible"]

Nothing is drawn here: the data set must hold panoramas.
"""

import dataclasses
import functools
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from embodied.agents.vision.features import VISIBLE, ids_to_labels
from embodied.assets.records import ROOM_KINDS
from embodied.datasets.store import Dataset
from embodied.gym.playground import pictures_of
from embodied.gym.sensors import FAR, PIXELS, ViewSettings, framed
from embodied.interface import VIEW_PITCHES, VIEW_YAWS, VIEWS
from embodied.render.panorama_file import PanoramaFile
from embodied.render.photograph import check_camera
from embodied.seeds import stream

OPEN = 16
"""Panorama files that a process holds open."""


@dataclass(frozen=True, eq=False)
class _House:
    """Facts about a house beside its pictures; n viewpoints."""

    positions: np.ndarray
    """(n, 3) float32, metres, world."""
    room: np.ndarray
    """(n,) int64 into ROOM_KINDS."""
    class_of_id: np.ndarray
    """(m + 1,) class of each instance id, -1 for none."""


class ViewpointPictures(torch.utils.data.Dataset[dict[str, torch.Tensor]]):
    """Every viewpoint of a split (with `view` of frame 'view': every one of its 36 views), house by house.

    An item is a dictionary; colours come before rows and columns, as torch has them:

      rgb      uint8 (6, 3, s, s), the faces of a panorama in their order; (3, h, w) view or equirect; (36, 3, h, h)
      depth    float32, the same without colours: metres along the optical axis (equirect: along the ray), 65.535
               where nothing is
      ids      int32, the same: i + 1 for parts.owners(house)[i], 0 where nothing is
      visible  bool (C,), whether objects of classes[k] cover more than 0.3 % of the picture
      pose     float32 (5,): x, y, z in metres, yaw and pitch in radians (0 where all directions are shown)
      room     int64, kind of the room that the viewpoint is in, into ROOM_KINDS
      house    int64, into `houses`
      node     int64

    With `cameras` every picture is taken by another device of one of these kinds, drawn anew for each item and epoch
    (`set_epoch`); depth, ids and what is visible follow its lens.

    Safe in a DataLoader's workers: each process opens the files for itself, when it first needs them.
    """

    def __init__(
        self,
        data: Dataset,
        split: str,
        *,
        view: ViewSettings | None = None,
        channels: Sequence[str] = PIXELS,
        classes: Sequence[str] | None = None,
        cameras: Sequence[str] = (),
        seed: int = 0,
    ) -> None:
        """
        Args:
          view: how the pictures are framed; the six faces as they are stored where not given.
          channels: some of 'rgb', 'depth', 'ids'; what is left out is not decoded. 'visible' comes with 'ids'.
          classes: what `visible` counts; the objects of the split's houses where not given.
          cameras: some of embodied.render.photograph.CAMERAS, drawn evenly, as augmentation; the view's own where
            none is given.
          seed: of what is drawn.

        Raises:
          ValueError: the data set has no such pictures, or no such channel; cameras for faces, which no camera takes.
        """
        if cameras and view is None:
            raise ValueError("cameras take views: give view=ViewSettings(...) with cameras=...")
        self._cameras, self._seed, self._epoch = tuple(map(check_camera, cameras)), seed, 0
        if not channels or set(channels) - set(PIXELS):
            raise ValueError(f"channels should be some of {PIXELS}, got {tuple(channels)!r}")
        names = data.names(split)
        self.pictures = pictures_of(data, names, wanted=True)
        self.houses: tuple[str, ...] = names
        self.classes = tuple(classes) if classes is not None else _objects(data, names)
        self._folder, self._view, self._channels = data.folder, view, tuple(channels)
        self._known = [_known(data, name, self.classes) for name in names]
        self._each = VIEWS if view is not None and view.frame == "view" else 1
        self._ends = np.cumsum([self._each * len(h.positions) for h in self._known])

    def set_epoch(self, epoch: int) -> None:
        """Other cameras for the same pictures; before a DataLoader starts its workers."""
        self._epoch = epoch

    def __len__(self) -> int:
        return int(self._ends[-1])

    def __getitem__(self, item: int) -> dict[str, torch.Tensor]:
        """
        Raises:
          IndexError: there are not so many.
          PanoramaFileError: damaged.
        """
        if not -len(self) <= item < len(self):
            raise IndexError(f"there are {len(self)} pictures, not {item}")
        item %= len(self)
        house = int(np.searchsorted(self._ends, item, side="right"))
        before = int(self._ends[house - 1]) if house else 0
        node, k = divmod(item - before, self._each)
        known = self._known[house]
        yaw, pitch = (float(VIEW_YAWS[k]), float(VIEW_PITCHES[k])) if self._each > 1 else (0.0, 0.0)
        pictures = self._seen(house, node, yaw, pitch, self._camera_of(item))
        colours_first = lambda name, a: np.moveaxis(a, -1, -3) if name == "rgb" else a
        out = {n: torch.from_numpy(np.ascontiguousarray(colours_first(n, a))) for n, a in pictures.items()}
        if "ids" in pictures:
            out["visible"] = torch.from_numpy(_visible(pictures["ids"], known.class_of_id, len(self.classes)))
        pose = np.array([*known.positions[node], yaw, pitch], np.float32)
        return {
            **out,
            "pose": torch.from_numpy(pose),
            "room": torch.tensor(int(known.room[node])),
            "house": torch.tensor(house),
            "node": torch.tensor(node),
        }

    def _camera_of(self, item: int) -> ViewSettings | None:
        """How item `item` is framed in this epoch, and by which device."""
        if not self._cameras or self._view is None:
            return self._view
        rng = stream(self._seed, "cameras", self._epoch, item)
        camera = self._cameras[int(rng.integers(len(self._cameras)))]
        return dataclasses.replace(self._view, camera=camera, device=int(rng.integers(2**31)))

    def _seen(
        self, house: int, node: int, yaw: float, pitch: float, view: ViewSettings | None
    ) -> dict[str, np.ndarray]:
        """The wanted channels of what is seen, colours last."""
        path = self._folder / "houses" / self.houses[house] / "panoramas.pano"
        panorama = _opened(path, path.stat().st_mtime_ns, os.getpid()).read(node)
        if view is None:
            faces = {"rgb": panorama.rgb, "depth": np.minimum(panorama.depth, np.float32(FAR)), "ids": panorama.ids}
            return {name: faces[name] for name in self._channels}
        place = self.houses[house], node
        return {name: framed(panorama, view, name, yaw, pitch, place=place) for name in self._channels}


@functools.lru_cache(maxsize=OPEN)
def _opened(path: Path, changed: int, process: int) -> PanoramaFile:
    """The panoramas of a file that was last changed then, opened by a process: what is forked opens it anew."""
    return PanoramaFile(path)


def _visible(ids: np.ndarray, class_of_id: np.ndarray, classes: int) -> np.ndarray:
    """(C,) bool: classes that cover more than VISIBLE of a picture of instance ids."""
    seen = class_of_id[ids.ravel()]
    return np.bincount(seen[seen >= 0], minlength=classes) > VISIBLE * ids.size


def _known(data: Dataset, name: str, classes: Sequence[str]) -> _House:
    place = data.place(name)
    rooms = [ROOM_KINDS.index(place.house.room_by_id[str(r)].kind) for r in place.graph.room_of_node]
    class_of_id, _ = ids_to_labels(place.house, classes)
    return _House(place.graph.positions.astype(np.float32), np.array(rooms, np.int64), class_of_id)


def _objects(data: Dataset, names: Sequence[str]) -> tuple[str, ...]:
    """The object classes of some houses, sorted."""
    return tuple(sorted({p.object_class for n in names for p in data.place(n).house.placements}))
