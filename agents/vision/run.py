"""The work of the encoder's commands: train it, train a detector on it, and make features with it, where they are
missing: the pictures of a data set's houses as encoders look at them, how they are drawn, and strips with labels;
and goal images that were taken at another time than the agent is there.

In place recognition these are changes of appearance (hour, weather, lamps), of the scene (people, things) and of the
camera.
"""

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import joblib
import numpy as np

from embodied.agents.common.session import Note
from embodied.agents.common.tensors import check_device, use_threads
from embodied.agents.vision import features as feature_files
from embodied.agents.vision.config import LATER_CAMERA, RENDER_PRESETS, SAME_TIME, StripTraining, VisionConfig, drawing
from embodied.agents.vision.detector import labelled, read, train_detector
from embodied.agents.vision.encoder import Encoder, load_encoder, save_encoder
from embodied.agents.vision.training import train_encoder, whitened
from embodied.assets.cache import digest, write_json
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.assets.json_file import read_json
from embodied.datasets.build import for_each_unit
from embodied.datasets.store import Dataset
from embodied.generate.people import rearranged
from embodied.house.house import House
from embodied.interface import Route
from embodied.light import lightings_of
from embodied.locks import locked
from embodied.records import Identity, identity_of, load_lines
from embodied.render.photograph import PhotoCamera
from embodied.render.pictures import PictureSettings, Traced
from embodied.world import World, open_world


def pictures_of(data: Dataset, name: str, picture_kind: str | None = None) -> PictureSettings:
    """How the pictures of a house are drawn that features are made from.

    Args:
      picture_kind: one of RENDER_PRESETS; None takes the panoramas that the data set holds, and plain ones where it
        holds none.
    """
    drawn = data.drawn_pictures(name)
    if drawn is None or picture_kind not in (None, drawn.word):
        return RENDER_PRESETS[picture_kind or "unlit"]
    return drawn


def drawings_of(data: Dataset, names: Sequence[str], picture_kind: str | None = None) -> str:
    """How the pictures of some houses are drawn, in words: 'unlit_192', or several of them."""
    return ", ".join(sorted({drawing(pictures_of(data, name, picture_kind)) for name in names}))


def drawn_world(data: Dataset, name: str, cache: Path, pictures: PictureSettings, lit: House | None = None) -> World:
    """A house drawn so: the panoramas that the data set holds, if they are, else new ones, and those are left alone.

    Args:
      lit: the house in another light than its own.
    """
    place, catalogue = data.place(name), load_catalogue(cache)
    if lit in (None, place.house) and pictures == data.drawn_pictures(name):
        return data.open_world(name, catalogue, cache, pictures)
    return open_world(lit or place.house, catalogue, cache, pictures, graph=place.graph)


@dataclass(frozen=True)
class StripSource:
    """The strips of a data set's houses, drawn so, kept in a folder."""

    data: Path
    """Folder of the data set."""
    folder: Path
    cache: Path
    picture_kind: str | None = None
    """As `pictures_of` takes it."""
    lit: int = 0
    """So many training houses are seen in light ('fast')."""
    workers: int = 1
    """Houses drawn side by side."""

    def training_strips(self, names: Sequence[str], note: Callable[[str], None]) -> list[feature_files.HouseStrips]:
        """The strips of training houses, the first `lit` of them in light."""
        in_light = dataclasses.replace(self, picture_kind="fast")
        return [*in_light.strips(names[: self.lit], note), *self.strips(names[self.lit :], note)]

    def strips(self, names: Sequence[str], note: Callable[[str], None]) -> list[feature_files.HouseStrips]:
        """The strips of houses, drawn where they are missing."""
        data = Dataset(self.data)
        jobs = (joblib.delayed(self._draw)(n) for n in names if not self._path(data, n).exists())
        for name in joblib.Parallel(n_jobs=self.workers, return_as="generator_unordered")(jobs):
            note(f"drawn: {name}")
        return [feature_files.HouseStrips.load(self._path(data, n)) for n in names]

    def _path(self, data: Dataset, name: str) -> Path:
        """The file in which the strips of a house are."""
        return self.folder / drawing(pictures_of(data, name, self.picture_kind)) / f"{name}.npz"

    def _draw(self, name: str) -> str:
        data = Dataset(self.data)
        pictures, classes = (
            pictures_of(data, name, self.picture_kind),
            feature_files.all_classes(load_catalogue(self.cache)),
        )
        with drawn_world(data, name, self.cache, pictures) as world:
            feature_files.look(world, classes).save(self._path(data, name))
        return name


LATER_DAY, LATER_LIGHTING = 1, 1
"""Of pictures taken later: the day of embodied.generate.people, and the number in embodied.light.lightings_of."""
FEATURE_ENDINGS = {SAME_TIME: "", LATER_CAMERA: f"+light{LATER_LIGHTING}+day{LATER_DAY}+robot"}
"""Of the names of files with features, after the house."""
CAMERAS_OF = {SAME_TIME: PhotoCamera(), LATER_CAMERA: PhotoCamera("robot", seed=LATER_DAY)}


def house_at(data: Dataset, name: str, goal_image: str, cache: Path) -> House:
    """A house of a data set as goal images show it."""
    place = data.place(name)
    if goal_image == SAME_TIME:
        return place.house
    starts = [route.path[0] for route in load_lines(data.folder / "houses" / name / "routes.jsonl", Route)]
    house = rearranged(place.house, place.graph, load_catalogue(cache), starts, day=LATER_DAY)
    return lightings_of(house, LATER_LIGHTING + 1)[-1]


def digest_at(data: Dataset, name: str, goal_image: str, cache: Path) -> str:
    """The digest of that house, kept in the cache: another day takes a second to make."""
    if goal_image == SAME_TIME:
        return data.place(name).house.digest
    key = digest([data.digest, name, LATER_LIGHTING, LATER_DAY, code_digest("embodied.agents.vision.run")])
    path = cache / "days" / f"{key[:32]}.json"
    if not path.exists():
        write_json(path, {"house": house_at(data, name, goal_image, cache).digest})
    return str(read_json(path)["house"])


def captured_path(data: Dataset, name: str, goal_image: str, encoder: str, pictures: PictureSettings) -> Path:
    """The file with the features of goal images of a house; `encoder` is a digest."""
    return feature_files.feature_path(data.folder / "features", encoder, name + FEATURE_ENDINGS[goal_image], pictures)


def house_features(
    data: Dataset,
    names: Sequence[str],
    encoder: str,
    picture_kind: str | None,
    cache: Path,
    goal_image: str = SAME_TIME,
) -> dict[str, np.ndarray]:
    """(n, 36, D) features of some houses, as goal images show them; `encoder` is a digest.

    Raises:
      FileNotFoundError: features are missing.
      ValueError: they are damaged, or another house's.
    """
    features = {}
    for name in sorted(names):
        pictures = pictures_of(data, name, picture_kind)
        path = captured_path(data, name, goal_image, encoder, pictures)
        source = digest_at(data, name, goal_image, cache)
        features[name] = feature_files.load_features(path, encoder=encoder, source=source, pictures=pictures)
    return features


def features_of(world: World, encoder: Encoder, goal_image: str = SAME_TIME) -> np.ndarray:
    """(n, 36, D) float16 features of the panoramas of a house, as the camera of such goal images takes them."""
    if isinstance(world.pictures, Traced) or goal_image != SAME_TIME:
        world.render_all()  # kept: they cost minutes a house
    camera, house = CAMERAS_OF[goal_image], world.house.name
    seen = (world.panorama(node).equirect(feature_files.EQUIRECT) for node in range(len(world.graph.positions)))
    photographs = (camera.photographed(picture, None, house, node) for node, picture in enumerate(seen))
    return feature_files.encode_strips(encoder, (photograph[feature_files.margin()] for photograph in photographs))


@dataclass(frozen=True)
class Extractor:
    """Extracts the features of one house after the other; small, so that it can be sent to other processes."""

    data: Path
    """Folder of the data set, which keeps the features."""
    encoder: Encoder
    cache: Path
    picture_kind: str | None = None
    """Of the pictures, as embodied.agents.vision.run.pictures_of takes it."""
    goal_images: tuple[str, ...] = (SAME_TIME,)
    """Some of embodied.agents.vision.config.GOAL_IMAGES."""
    threads: int = 1

    def missing(self, name: str) -> list[str]:
        """The goal images of which a house has no features."""
        data, encoder = Dataset(self.data), self.encoder
        pictures = pictures_of(data, name, self.picture_kind)

        def is_there(goal_image: str) -> bool:
            path = captured_path(data, name, goal_image, encoder.digest, pictures)
            return feature_files.has_features(path, encoder, digest_at(data, name, goal_image, self.cache), pictures)

        return [goal_image for goal_image in dict.fromkeys(self.goal_images) if not is_there(goal_image)]

    def __call__(self, name: str) -> str:
        """Extract the missing features of a house; returns a line about it."""
        use_threads(self.threads)
        data, missing = Dataset(self.data), self.missing(name)
        pictures = pictures_of(data, name, self.picture_kind)
        for goal_image in missing:
            house = house_at(data, name, goal_image, self.cache)
            with drawn_world(data, name, self.cache, pictures, house) as world:
                path = captured_path(data, name, goal_image, self.encoder.digest, pictures)
                feature_files.save_features(
                    path, features_of(world, self.encoder, goal_image), self.encoder, house.digest, pictures
                )
        return f"{name}: {', '.join(missing)}; {pictures.word} pictures of {pictures.size} pixels"


def train_vision(
    source: StripSource, config: VisionConfig, out: Path, *, device: str = "cpu", note: Note = print
) -> None:
    """Train an encoder on the training houses, and measure in validation houses what linear readers of its features
    tell; training goes on from the last epoch that was finished. Where some houses are lit, readers are fitted in
    these, and judged with light and without.

    Raises:
      LockedError: another process writes to `out`.
    """
    check_device(device)
    data = Dataset(source.data)
    names, unseen = training_houses(data, config), data.names("val_unseen")
    with locked(out):
        seen = source.training_strips(names, note)
        encoder, classes = train_encoder(seen, config, out / "training", device=device, note=note)
        file = out / "encoder.safetensors"
        save_encoder(whitened(encoder, seen), file, _learned_in(source, config))
        encoder, readings = load_encoder(file), dict[str, Any]()
        for kind in dict.fromkeys((source.picture_kind, *["fast"][: source.lit])):
            drawn = dataclasses.replace(source, picture_kind=kind)
            first, other = (
                labelled(drawn.strips(houses, note), encoder, classes)
                for houses in (names[: source.lit or None], unseen)
            )
            reading = read(first, other, classes, seed=config.seed)
            readings[drawing(pictures_of(data, unseen[0], kind))] = reading
            note(", ".join(f"{k} {v:.3g}" for k, v in reading.items() if not isinstance(v, dict)))
        write_json(out / "readings.json", readings, indent=1)


def detector_for(
    encoder: Encoder, source: StripSource, config: StripTraining, out: Path, *, device: str = "cpu", note: Note = print
) -> None:
    """Train a detector on an encoder, in the training houses, and measure its precision in validation houses; training
    goes on from the last epoch that was finished.

    Raises:
      LockedError: another process writes to `out`.
    """
    check_device(device)
    data = Dataset(source.data)
    with locked(out):
        seen = source.training_strips(training_houses(data, config), note)
        unseen = source.strips(data.names("val_unseen"), note)
        detector = train_detector(seen, encoder, config, out / "training", device=device, note=note)
        learned = {**_learned_in(source, config), "encoder": encoder.digest}
        detector.save(out / "detector.safetensors", learned)
        precision = detector.precision(unseen)
        whole = float(np.mean(list(precision.values())))
        write_json(out / "readings.json", {"AP": whole, "AP by class": precision}, indent=1)
        note(f"average precision {whole:.3f}, {len(precision)} classes in validation houses")


def training_houses(data: Dataset, config: StripTraining) -> Sequence[str]:
    """Names of the houses to learn from."""
    return data.names("train")[: config.training_houses or None]


def _learned_in(source: StripSource, config: StripTraining) -> Identity:
    """The identity of what is trained on strips."""
    data = Dataset(source.data)
    pictures = drawings_of(data, training_houses(data, config), source.picture_kind)
    return identity_of(
        "embodied.agents.vision.run", settings=config, data=data.digest, pictures=pictures, lit=source.lit
    )


def make_features(extract: Extractor, names: Sequence[str], *, workers: int = 1, note: Note = print) -> None:
    """Extract the missing features of some houses."""

    def watch(lines: Iterable[str], total: int) -> Iterable[str]:
        for line in lines:
            note(line)
            yield line

    missing = [n for n in names if extract.missing(n)]
    for_each_unit(extract, missing, (), workers=workers, watch=watch)
    data = Dataset(extract.data)
    count = Counter(drawing(pictures_of(data, n, extract.picture_kind)) for n in names)
    ways = ", ".join(f"{n} {way}" for way, n in sorted(count.items()))
    note(f"{len(missing)} of {len(names)} houses made, pictures: {ways}, encoder {extract.encoder.digest[:16]}")
