"""Sensors: what an environment shows of a place, beside words, moves and clock.

Pixels (`CameraSensor`) are resampled from the panoramas of the viewpoints, which are drawn once and kept; features
(`FeatureSensor`) are an encoder's of the same panoramas, or an oracle's list of the visible objects.
"""

from __future__ import annotations

import dataclasses
import functools
import importlib.metadata
import math
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from gymnasium import spaces

from embodied.errors import UnableError
from embodied.interface import STEP, VIEWS, FeatureSource, Observation, Sight, Viewpoint, viewpoint
from embodied.navigation.doors import MARK, place_named
from embodied.people.strolls import PERSON_HEIGHT, PERSON_RADIUS, Crowd
from embodied.render.camera import Camera
from embodied.render.panorama import VFOV36, Panorama, equirect_grid, grid36, perspective_grid
from embodied.render.photograph import PhotoCamera, check_camera
from embodied.world import SLACK, World

OBSERVATIONS = ("rgb", "depth", "ids", "features", "oracle")
"""Names of observations: three kinds of pixels, an encoder's features, an oracle's list of visible objects."""
PIXELS = OBSERVATIONS[:3]
FRAMES = ("view", "views36", "equirect")
"""A perspective view straight ahead, the 36 views of the VLN literature, or all directions in one picture."""
LARGE = 1e6
"""Bound of what has no natural one (features, times, word numbers); Gymnasium wants it finite."""
FAR = 65.535
"""Depth where nothing is, and the largest there is, metres."""
MEMORY, HOUSES_CHANGED = 512 * 2**20, 3
"""Bytes of decoded panoramas that are kept; houses that are held open with other doors, or with people who live there:
a lit one takes a gigabyte."""
ENCODERS = "embodied.encoders"
"""Group of entry points under which encoders of pictures are found; 'default' is the one that ships."""


Arrays = dict[str, np.ndarray]


class Sensor(Protocol):
    """Turns the sights of an observation into arrays."""

    def spaces(self) -> dict[str, spaces.Space]:
        """The space of each array."""

    def look(self, o: Observation) -> Callable[[], Arrays]:
        """The arrays, in two halves: now, in this thread, places are drawn or read where nobody has them; what is
        returned makes the arrays, one for each space, and may be called in any thread."""


def pixel_spaces(shape: tuple[int, ...], observations: Sequence[str]) -> dict[str, spaces.Box]:
    """Of pictures: rgb uint8 (*shape, 3); depth float32 metres, FAR where nothing is; ids int32, 0 where nothing is."""
    kinds: dict[str, spaces.Box] = {
        "rgb": spaces.Box(0, 255, (*shape, 3), np.uint8),
        "depth": spaces.Box(0.0, FAR, shape, np.float32),
        "ids": spaces.Box(0, 2**31 - 1, shape, np.int32),
    }
    return {name: kinds[name] for name in observations}


def live_pixels(
    world: World, camera: Camera, size: tuple[int, int], observations: Sequence[str], people: np.ndarray | None = None
) -> Arrays:
    """Pictures of a camera, drawn now: depth in metres along the optical axis.

    Args:
      size: height and width, pixels.
      observations: some of PIXELS; of nothing, nothing is drawn.
      people: (n, 3+) places of people, who stand in the depth of unlit houses as cylinders.
    """
    if not observations:
        return {}
    if tuple(observations) == ("rgb",):
        return {"rgb": np.ascontiguousarray(world.renderer.rgb(camera, size))}
    whole: Arrays = {}
    if "rgb" in observations:
        view = world.renderer.through(camera, size)
        whole["rgb"], depth, whole["ids"] = view.rgb, view.depth, view.ids
    else:
        depth, whole["ids"] = world.renderer.depth_and_ids(camera, size)
    if people is not None and world.pictures.quality is None:
        depth = with_people(depth, camera, people)
    whole["depth"] = np.minimum(depth, np.float32(FAR))
    return {name: np.ascontiguousarray(whole[name]) for name in observations}


def photographed(world: World, camera: Camera, pixels: Arrays, name: str, device: int, *place: str | int) -> Arrays:
    """Live pictures of a camera as a device takes them: the lens bends all, the rest is the colours'.

    Args:
      name, device: as of ViewSettings.
      place: what tells these pictures from others, for the noise.
    """
    photo, vfov = _camera(name, device), camera.vfov
    light = world.darkness(camera.position) if "rgb" in pixels and photo.traits is not None else 1.0
    taken = lambda k, a: photo.photographed(a, vfov, *place, light=light) if k == "rgb" else photo.bent(a, vfov)
    return {k: taken(k, a) for k, a in pixels.items()}


def among(world: World, crowd: Crowd, ways: Mapping[str, float]) -> World:
    """The world with doors open as far as `ways` and people have them, to a tenth where it is unlit; where it is lit,
    people are drawn where they are now."""
    if world.pictures.quality is None:
        return world.with_doors({**ways, **{d: round(x, 1) for d, x in crowd.openness.items()}})
    world, now = world.with_doors(ways), crowd.moment
    if now.people or world.moment.people:
        now = dataclasses.replace(world.moment, openness={**ways, **now.openness}, people=now.people)
        world.show(now, slack=3 * SLACK)
    return world


def with_people(depth: np.ndarray, camera: Camera, places: np.ndarray) -> np.ndarray:
    """A depth picture (h, w), metres along the optical axis, in which people at (n, 3+) metres stand as cylinders."""
    h, w = depth.shape
    tall, depth = math.tan(camera.vfov / 2) / h, depth.copy()
    across, up = np.meshgrid(tall * (2 * np.arange(w) + 1 - w), tall * (h - 1 - 2 * np.arange(h)))
    rays = camera.forward + across[..., None] * camera.right + up[..., None] * np.array(camera.up)
    square, eye = (rays[..., :2] ** 2).sum(-1), np.array(camera.position)
    for x, y, floor in places[:, :3]:
        to = np.array([x, y]) - eye[:2]
        middle = rays[..., :2] @ to
        chord = middle**2 - square * (to @ to - PERSON_RADIUS**2)
        near = (middle - np.sqrt(np.maximum(chord, 0.0))) / square
        height = eye[2] + near * rays[..., 2] - floor
        hit = (chord > 0) & (near > 0) & (height > 0) & (height < PERSON_HEIGHT)
        depth[hit] = np.minimum(depth, near)[hit]
    return depth


def check_live(observations: Sequence[str], known: Sequence[str], height: int, width: int) -> None:
    """Raises ValueError for pixels that live pictures do not have, and for sides that they cannot have."""
    if any(name not in known for name in observations) or len(set(observations)) < len(observations):
        raise ValueError(f"observations should be some of {known}, each once, got {observations!r}")
    if not (8 <= height <= 2048 and 8 <= width <= 2048):
        raise ValueError(f"a view of {height} x {width} pixels; each side needs 8 to 2048")


@dataclass(frozen=True)
class ViewSettings:
    """How pixels are framed.

    Examples:
      >>> embodied.ViewSettings('views36', height=224).shape
      (36, 224, 224)
    """

    frame: str = "view"
    """One of FRAMES."""
    height: int = 128
    """Pixels of a picture (of each of the 36 views, which are square); an equirect is twice as wide as high."""
    width: int = 128
    """Pixels; of 'view' only."""
    vfov: float = math.radians(60.0)
    """Vertical field of 'view', radians; 60 degrees is the literature's (Anderson et al. 2018)."""
    camera: str = "ideal"
    """The camera, one of embodied.render.photograph.CAMERAS; 'ideal' shows what the renderer draws."""
    device: int = 0
    """Seed: which device of that kind."""

    def __post_init__(self) -> None:
        if self.frame not in FRAMES:
            raise ValueError(f"frame is {self.frame!r}; use one of {FRAMES}")
        if not (1 <= self.height <= 4096 and 1 <= self.width <= 4096):
            raise ValueError(f"a view of {self.height} x {self.width} pixels; each side needs 1 to 4096")
        if not 0 < self.vfov < math.pi:
            raise ValueError(f"vfov is {self.vfov} radians; a perspective picture needs more than 0 and less than pi")
        check_camera(self.camera)

    @property
    def shape(self) -> tuple[int, ...]:
        """Of a picture without its channels."""
        if self.frame == "views36":
            return (VIEWS, self.height, self.height)
        return (self.height, 2 * self.height if self.frame == "equirect" else self.width)


def framed(
    panorama: Panorama, view: ViewSettings, channel: str, yaw: float, pitch: float, *, place: Sequence[str | int] = ()
) -> np.ndarray:
    """One channel, 'rgb', 'depth' or 'ids', of what is seen: (*view.shape), rgb with three colours at the end.

    Args:
      yaw, pitch: where a 'view' looks, radians; the other frames show every direction.
      place: what tells this place from others, for the noise of a camera.
    """
    s = panorama.size
    if view.frame == "views36":
        picture = panorama.through(grid36(s, view.height), channel)
        picture = picture.reshape(*view.shape, *picture.shape[2:])
    elif view.frame == "equirect":
        picture = panorama.through(equirect_grid(s, view.height), channel)
    else:
        picture = panorama.through(perspective_grid(s, yaw, pitch, view.vfov, view.height, view.width), channel)
    if view.camera != "ideal":
        picture = _photographed(picture, view, channel, (*place, round(math.degrees(yaw)), round(math.degrees(pitch))))
    return np.minimum(picture, np.float32(FAR)) if channel == "depth" else picture


def _photographed(picture: np.ndarray, view: ViewSettings, channel: str, place: Sequence[str | int]) -> np.ndarray:
    """A framed channel as the view's camera has it: each of the 36 views is exposed by itself."""
    camera = _camera(view.camera, view.device)
    vfov = {"view": view.vfov, "views36": VFOV36}.get(view.frame)
    if channel != "rgb":
        bent = lambda one: camera.bent(one, vfov)
        return np.stack([bent(one) for one in picture]) if view.frame == "views36" else bent(picture)
    if view.frame == "views36":
        return np.stack([camera.photographed(one, vfov, *place, k) for k, one in enumerate(picture)])
    return camera.photographed(picture, vfov, *place)


@functools.lru_cache(maxsize=1024)
def _camera(name: str, device: int) -> PhotoCamera:
    return PhotoCamera(name, device)


class PanoramaStore:
    """Owns the decoded panoramas of some worlds, the latest used, within a budget of bytes."""

    def __init__(self, worlds: Mapping[str, World], budget: int = MEMORY) -> None:
        self._worlds, self._budget = worlds, budget
        self._kept: OrderedDict[Viewpoint, Panorama] = OrderedDict()
        self._changed = list[str]()

    def __reduce__(self) -> tuple[type[PanoramaStore], tuple[Mapping[str, World], int]]:
        """Pickled and copied without the panoramas, whose files are open here."""
        return PanoramaStore, (self._worlds, self._budget)

    def at(self, sight: Sight) -> Panorama:
        """The panorama of a sight; drawn, or read from the disk, when it is not in memory.

        Raises:
          KeyError: a sight of another world.
        """
        key = viewpoint(sight)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        sizes = [_bytes(kept) for kept in self._kept.values()]
        held = sum(sizes) + sum(sizes[-1:])  # the new one will need about as much as the latest
        for size in sizes:
            if held <= self._budget:
                break
            self._kept.popitem(last=False)
            held -= size
        house, changed, _ = key.world.partition(MARK)
        if changed:
            self._changed = [house, *(h for h in self._changed if h != house)]
            for other in self._changed[HOUSES_CHANGED:]:
                self._worlds[other].close_states()
            del self._changed[HOUSES_CHANGED:]
        self._kept[key] = place_named(self._worlds, key.world).panorama(key.node)
        return self._kept[key]


def _bytes(panorama: Panorama) -> int:
    """Of the channels that are decoded, with the padded copies that resampling makes."""
    return sum(a.nbytes for a in list(panorama.__dict__.values()) if isinstance(a, np.ndarray))


class CameraSensor:
    """Pixels. The target image, where a task has one, is an equirect: where it was taken from is not told."""

    TARGET = 64
    """Height of the target image, pixels."""

    def __init__(self, store: PanoramaStore, channels: Sequence[str], view: ViewSettings) -> None:
        """
        Args:
          channels: some of PIXELS.
        """
        self._store, self._channels, self._view = store, tuple(channels), view

    def spaces(self) -> dict[str, spaces.Space]:
        channels: dict[str, spaces.Space] = {**pixel_spaces(self._view.shape, self._channels)}
        if "rgb" in self._channels:
            channels["target_rgb"] = spaces.Box(0, 255, (self.TARGET, 2 * self.TARGET, 3), np.uint8)
        return channels

    def look(self, o: Observation) -> Callable[[], Arrays]:
        target = self._store.at(o.target) if o.target is not None and "rgb" in self._channels else None
        return functools.partial(self._arrays, o, self._store.at(o.sight), target)

    def _arrays(self, o: Observation, panorama: Panorama, target: Panorama | None) -> Arrays:
        at, yaw, pitch = viewpoint(o.sight), o.turn * STEP, o.tilt * STEP
        look = functools.partial(framed, panorama, self._view, yaw=yaw, pitch=pitch, place=(at.world, at.node))
        arrays = {name: look(name) for name in self._channels}
        if "rgb" in self._channels:
            arrays["target_rgb"] = self._target(o.target, target)
        return arrays

    def _target(self, sight: Sight | None, panorama: Panorama | None) -> np.ndarray:
        if sight is None or panorama is None:
            return np.zeros((self.TARGET, 2 * self.TARGET, 3), np.uint8)
        camera = _camera(self._view.camera, self._view.device)
        at = viewpoint(sight)
        return camera.photographed(panorama.equirect(self.TARGET), None, at.world, at.node)


class FeatureSensor:
    """(36, D) features of the place, and of the target image (zeros without one); row k is view k."""

    def __init__(self, name: str, source: FeatureSource) -> None:
        """
        Args:
          name: what the arrays are called: 'features' or 'oracle'; the target's 'target_NAME'.
        """
        self._name, self._source = name, source

    def spaces(self) -> dict[str, spaces.Space]:
        box = spaces.Box(-LARGE, LARGE, (VIEWS, self._source.size), np.float32)
        return {self._name: box, f"target_{self._name}": box}

    def look(self, o: Observation) -> Callable[[], Arrays]:
        arrays = {self._name: self._of(o.sight), f"target_{self._name}": self._of(o.target)}
        return lambda: arrays

    def _of(self, sight: Sight | None) -> np.ndarray:
        if sight is None:
            return np.zeros((VIEWS, self._source.size), dtype=np.float32)
        return np.array(self._source.features(sight), dtype=np.float32)  # a copy: the source keeps its own


class SensorSuite:
    """Several sensors as one; without any, it sees nothing."""

    def __init__(self, sensors: Sequence[Sensor] = ()) -> None:
        self._sensors = tuple(sensors)

    def spaces(self) -> dict[str, spaces.Space]:
        return {name: space for sensor in self._sensors for name, space in sensor.spaces().items()}

    def look(self, o: Observation) -> Callable[[], Arrays]:
        looks = [sensor.look(o) for sensor in self._sensors]
        return lambda: {name: array for look in looks for name, array in look().items()}


@functools.cache
def encoder_entry(name: str = "default") -> importlib.metadata.EntryPoint:
    """Who makes an encoder's features: a function of a PanoramaStore that returns a FeatureSource.

    Raises:
      UnableError: no package offers one by this name.
    """
    entries = {e.name: e for e in importlib.metadata.entry_points(group=ENCODERS)}
    if name not in entries:
        raise UnableError(
            f"no encoder {name!r} is installed, only {sorted(entries)}: install this package with its `agents`, "
            "hand over features with source=..., or choose observations=('rgb',)"
        )
    return entries[name]


def checked_observations(observations: str | Sequence[str]) -> tuple[str, ...]:
    """`observations` as a tuple.

    Raises:
      ValueError: something that cannot be seen, nothing, or the same twice.
    """
    one = isinstance(observations, str) or not isinstance(observations, Sequence)
    chosen: tuple[Any, ...] = (observations,) if one else tuple(observations)
    if not chosen or any(name not in OBSERVATIONS for name in chosen) or len(set(chosen)) < len(chosen):
        raise ValueError(f"observations should be one or several of {OBSERVATIONS}, each once, got {observations!r}")
    return chosen
