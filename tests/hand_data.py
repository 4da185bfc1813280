"""A tiny data set over houses made by hand, built in a second; and the bytes of a folder."""

from __future__ import annotations

import base64
import contextlib
import dataclasses
import itertools
import os
import shutil
import tempfile
from pathlib import Path

import numpy as np
from conftest import two_rooms
from hand_worlds import grid_world, thing
from handmade import HandCatalogue, furnished

from embodied.agents.common.settings import WEIGHTS
from embodied.datasets.build import DatasetConfig, build_dataset, units
from embodied.datasets.store import Dataset
from embodied.kinds.plugins import shipped_kinds
from embodied.kinds.task_kind import kind_named
from embodied.mattersim.pictures import in_matterport_order
from embodied.navigation.graph import build_graph
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import write_panoramas
from embodied.render.pictures import recorded
from embodied.scene.house_meshes import owners
from embodied.seeds import stream

COMPACT = WEIGHTS / "encoder_compact.safetensors"
DATA_KINDS = tuple(name for name in shipped_kinds() if kind_named(name).splits and name != "stored")
"""Kinds of tasks with data sets, but that which needs furniture that opens."""


def hand_house(seed, name, config, catalogue):
    """The grid world with forty more things, one of each class, ten to a room."""
    world = grid_world(8, name=name)
    rooms = {r.id: r.polygon[0] for r in world.house.rooms}
    more = tuple(
        thing(f"thing{k}", 1, room, x + 1 + (k * 1.7) % 6.5, y + 1 + (k * 2.3) % 6.5)
        for k, (room, (x, y)) in ((k, sorted(rooms.items())[k % 4]) for k in range(40))
    )
    return dataclasses.replace(world.house, placements=world.house.placements + more), world.graph


def small_house(seed, name, config, catalogue):
    """Sixteen nodes and few things: quickly drawn."""
    world = grid_world(4, name=name)
    return world.house, world.graph


def drawn_house(*facts):
    """`small_house` with things that can be drawn."""
    house, graph = small_house(*facts)
    things = tuple(dataclasses.replace(p, asset="built/mug_black") for p in house.placements)
    return dataclasses.replace(house, placements=things), graph


def boxes_house(seed, name, config, catalogue):
    """The furnished two rooms, which the catalogue made by hand can draw."""
    house = dataclasses.replace(furnished(two_rooms()), name=name)
    return house, build_graph(house)


def live_among_boxes(monkeypatch) -> None:
    """Let commands and examples find `boxes_house` wherever they would generate one, and its catalogue."""
    for module in ("gym.playground", "datasets.build"):  # the first one takes its names from the second
        monkeypatch.setattr(f"embodied.{module}.make_dataset_house", boxes_house)
    for module in ("gym.playground", "assets.catalogue", "datasets.build", "gym.drive"):
        monkeypatch.setattr(f"embodied.{module}.load_catalogue", lambda *_, **__: HandCatalogue())


def build(folder, cache, kind="hanna", workers=1, size="tiny", make_house=hand_house, **options):
    config = DatasetConfig(kind, size, seed=4, language="plain", **options)
    build_dataset(config, folder, cache, workers=workers, make_house=make_house)
    return Dataset(folder)


def built(folder, kind="hanna", size="tiny", make_house=hand_house, **options):
    """What `build` makes, copied into `folder` if any worker of this test run has built it before."""
    name = "_".join(map(str, (kind, size, make_house.__name__, *itertools.chain(*options.items())))).replace("/", "_")
    whole = Path(os.environ["EMBODIED_TESTS_SHARED"], "built", name)
    if not whole.exists():
        whole.parent.mkdir(exist_ok=True)
        home = Path(tempfile.mkdtemp(dir=whole.parent))
        build(home / "data", home / "cache", kind, size=size, make_house=make_house, **options)
        with contextlib.suppress(OSError):  # another worker was faster
            (home / "data").rename(whole)
    return Dataset(shutil.copytree(whole, folder))


def content(folder):
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def painted_panorama(node, owners, size=8):
    """Faces that tell the node: red is three times it, ids go round the owners from it; depth is 1 + face."""
    rgb = np.zeros((6, size, size, 3), np.uint8)
    rgb[..., 0], rgb[..., 1] = 3 * node, 40 * np.arange(6)[:, None, None]
    depth = np.broadcast_to(1.0 + np.arange(6, dtype=np.float32)[:, None, None], (6, size, size)).copy()
    ids = np.broadcast_to((node + np.arange(6)[:, None, None]) % owners + 1, (6, size, size)).astype(np.int32)
    return Panorama(rgb, depth, ids)


def paint(data, pictures, names=None):
    """Panoramas that nobody drew into the folders of a data set's houses."""
    for name in names or [u.name for u in units(data.scale)]:
        place = data.place(name)
        many = len(owners(place.house))
        nodes = [painted_panorama(k, many, pictures.size) for k in range(len(place.graph.ids))]
        meta = {"house": place.house.digest, **recorded(pictures)}
        write_panoramas(data.folder / "houses" / name / "panoramas.pano", nodes, meta)


def noise_features(data, encoder=None, seed=0):
    """Features of nothing for all houses of a data set, as an encoder makes them, or that of COMPACT; returns it."""
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.features import feature_path, save_features
    from embodied.agents.vision.run import pictures_of

    encoder = encoder or load_encoder(COMPACT)
    for name in dict.fromkeys(n for split in data.splits for n in data.names(split)):
        place, pictures = data.place(name), pictures_of(data, name)
        noise = stream(seed, "noise", name).normal(size=(len(place.graph.ids), 36, encoder.size)).astype(np.float16)
        path = feature_path(data.folder / "features", encoder.digest, name, pictures)
        save_features(path, noise, encoder, place.house.digest, pictures)
    return encoder


def random_encoder(name="compact", *, seed):
    """An untrained encoder."""
    from embodied.agents.common.weights import seeded
    from embodied.agents.vision.encoder import ENCODER_NETWORKS, Encoder

    with seeded(seed):
        return Encoder(ENCODER_NETWORKS[name]().eval(), name)


def validations_of(folder):
    """(update, measure, value) of all validations of a run."""
    from embodied.agents.common.weights import read_checkpoint

    history = read_checkpoint(folder / "checkpoint.pt")["history"]
    return [(int(entry["update"]), name, value) for entry in history for name, value in entry.items()]


def read_features(path):
    """(scan, viewpoint) -> (36, D) float32 in our order, from the feature file of Matterport3DSimulator."""
    table = {}
    for line in path.read_text(encoding="ascii").splitlines():
        scan, viewpoint, _, _, _, code = line.split("\t")
        features = np.frombuffer(base64.b64decode(code), dtype="<f4").reshape(36, -1)
        table[scan, viewpoint] = in_matterport_order(features)
    return table
