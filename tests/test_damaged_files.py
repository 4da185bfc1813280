"""Every kind of file we read, damaged in seeded ways: none ends in a traceback, none is believed against itself.

What is damaged is refused by an error that the command line shows as one line, or is a whole file of its kind, which
nothing with a checksum may be. Small files that unpack to much, or nest deeply, are refused before they are unpacked.
"""

from __future__ import annotations

import dataclasses
import functools
import gzip
import itertools
import json
import re
import shutil
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import deflate
import numpy as np
import pytest
import torch
import trimesh
from conftest import two_rooms
from hand_data import built, random_encoder
from handmade_models import CUBE, write_own, write_pack
from PIL import Image

from embodied.agents.bandit.network import TRANSLATOR_REMEDY, BanditAbout
from embodied.agents.common.session import Session
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.common.weights import WEIGHTS_FORMAT, load_weights, restore, save_tensors
from embodied.agents.hanna.agent import HannaAbout, HannaAgent
from embodied.agents.hari import networks as hari
from embodied.agents.iliad.nav.run import load_follower
from embodied.agents.iliad.regex.run import load_student
from embodied.agents.learners.hanna import HANNA_SCALES
from embodied.agents.vision.config import PLAIN
from embodied.agents.vision.features import HouseStrips, load_features, save_features
from embodied.assets.closure import ROOT
from embodied.assets.decoding import load_record, open_arrays, read_picture, save_record
from embodied.assets.importing.own import import_own, read_own
from embodied.assets.json_file import RecordError, read_json, read_toml
from embodied.assets.rows import DATA
from embodied.datasets import habitat
from embodied.datasets.store import Dataset
from embodied.errors import UnableError
from embodied.evaluation.evaluate import play
from embodied.generate.furnish.tables import tables as furniture_tables
from embodied.generate.plan_file import load_plan
from embodied.house.house import House
from embodied.interface import Episode
from embodied.light.pages import colours
from embodied.mattersim import pictures
from embodied.mattersim.graphs import load_graphs
from embodied.navigation.connectivity import from_matterport
from embodied.policies.baselines import PrivilegedAsking, Shortest, ask_every_5
from embodied.records import load_lines, save_lines, to_json
from embodied.render import panorama_file
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import PanoramaFile, PanoramaFileError, write_panoramas
from embodied.render.sightings import SightingTable, sightings_table
from embodied.scene import model
from embodied.seeds import stream
from embodied.serve.store import Event, Store
from embodied.serve.study import load_study

MUTATIONS = 36
"""Of each kind; together some 1,000."""
CLEAR = (ValueError, OSError, UnableError)
"""What the command line shows as one line."""
VALUES = (None, True, False, 0, -1, 10**30, 1e300, -0.5, "", "nope", "../../etc", [], {}, [[]], "9" * 5000)
"""What takes the place of a value of JSON."""
NUMBERS = (b"-1", b"0", b"1e308", b"NaN", b"9" * 30, b"null", b"[]", b'"x"', b"1e-300", b"99999999", b"1.2.3")
"""What takes the place of a number in other texts."""
NONE = (b"", b"[" * 100_000, b"\x00" * 64, b'{"version": 1}', b"null")
"""What is no file of any kind."""


# How it is damaged ------------------------------------------------------------------------------


def flipped(body: bytes, rng: np.random.Generator) -> bytes:
    out = bytearray(body)
    out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    return bytes(out)


def cut(body: bytes, rng: np.random.Generator) -> bytes:
    return body[: int(rng.integers(len(body)))]


def filled(body: bytes, rng: np.random.Generator) -> bytes:
    at, n = int(rng.integers(len(body))), int(rng.integers(1, 64))
    return body[:at] + bytes([int(rng.integers(256))]) * n + body[at + n :]


def repeated(body: bytes, rng: np.random.Generator) -> bytes:
    """A piece twice, or left out."""
    a, b = (int(x) for x in rng.integers(len(body), size=2))
    return body[:b] + body[a:]


def renumbered(body: bytes, rng: np.random.Generator) -> bytes:
    """Another number, or what is none, in the place of a number."""
    places = list(re.finditer(rb"-?\d+(\.\d+)?", body))
    at = places[int(rng.integers(len(places)))]
    return body[: at.start()] + NUMBERS[int(rng.integers(len(NUMBERS)))] + body[at.end() :]


def edited(body: bytes, rng: np.random.Generator) -> bytes:
    """One value of a JSON file, or of one line of a JSON Lines file, replaced or taken away."""
    lines = body.decode().splitlines()
    whole = len(lines) == 1 or not lines[0].endswith("}")
    number = 0 if whole else int(rng.integers(len(lines)))
    tree = json.loads(body if whole else lines[number])
    _edit(tree, rng)
    text = json.dumps(tree)
    return (text if whole else "\n".join([*lines[:number], text, *lines[number + 1 :]])).encode()


def _edit(tree: object, rng: np.random.Generator) -> None:
    inner = list(tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ())
    if not inner:
        return
    key, value = inner[int(rng.integers(len(inner)))]
    if isinstance(value, (dict, list)) and value and rng.random() < 0.8:
        _edit(value, rng)
    elif isinstance(tree, dict) and rng.random() < 0.2:
        del tree[key]
    else:
        tree[key] = VALUES[int(rng.integers(len(VALUES)))]


MORE = {".json": edited, ".jsonl": edited, ".obj": renumbered, ".mtl": renumbered, ".glb": renumbered}
"""What most damage to a file with this suffix is."""


# What is damaged ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """One kind of file."""

    path: Path
    read: Callable[[Path], object]
    """Its content, to compare; raises one of CLEAR."""
    guarded: bool = False
    """Whether a checksum or digest covers it: what differs must be refused."""
    lenient: bool = False
    """Whether most damage, or anything at all, is a file of this kind."""


KINDS: dict[str, Callable[[Path, Dataset], Kind]] = {}
"""What makes a file of each kind in an empty folder; some lie in a data set."""


def kind(make: Callable[[Path, Dataset], Kind]) -> Callable[[Path, Dataset], Kind]:
    KINDS[make.__name__] = make
    return make


def written(path: Path, body: str) -> Path:
    path.write_text(body)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Callable[[str], Kind]:
    data = built(tmp_path_factory.mktemp("damaged") / "data")
    return lambda name: KINDS[name](tmp_path_factory.mktemp(re.sub(r"\W", "_", name)), data)


@kind
def house(folder: Path, data: Dataset) -> Kind:
    return Kind(written(folder / "house.json", two_rooms().to_json()), lambda p: House.load(p).to_json())


@kind
def connectivity(folder: Path, data: Dataset) -> Kind:
    path = shutil.copy(data.folder / "houses/test_0000/connectivity.json", folder / "graph.json")
    return Kind(path, lambda p: from_matterport(p).positions.tolist())


@kind
def graph_of_the_simulator(folder: Path, data: Dataset) -> Kind:
    def read(path: Path) -> object:
        load_graphs.cache_clear()
        graphs = load_graphs(str(path.parent), ("scan",))
        assert np.isfinite(graphs.positions).all()
        return graphs.positions.tolist(), graphs.neighbours.tolist()

    path = shutil.copy(data.folder / "houses/test_0000/connectivity.json", folder / "scan_connectivity.json")
    return Kind(path, read)


def _data_set(name: str, guarded: bool) -> Callable[[Path, Dataset], Kind]:
    def read(folder: Path) -> object:
        data = Dataset(folder)
        tasks, routes, place = data.tasks("test_unseen"), data.routes("test_0000"), data.place("test_0000")
        return (
            data.digest,
            place.house.digest,
            place.graph.ids,
            [to_json(t) for t in tasks],
            [to_json(r) for r in routes],
        )

    return lambda folder, data: Kind(data.folder / name, lambda _: read(data.folder), guarded)


KINDS |= {name: _data_set(name, False) for name in ("config.json", "dataset.json")}
KINDS |= {
    f"houses/{name}": _data_set(f"houses/test_0000/{name}", True)
    for name in ("house.json", "connectivity.json", "routes.jsonl", "tasks_test_unseen.jsonl")
}


@kind
def episodes(folder: Path, data: Dataset) -> Kind:
    split = data.split("test_unseen")
    played = play(split.make_env, PrivilegedAsking(Shortest(), ask_every_5), split.tasks[:3], seed=0)
    save_lines(folder / "episodes.jsonl", played)
    return Kind(folder / "episodes.jsonl", lambda p: [to_json(e) for e in load_lines(p, Episode)])


def own_folder(folder: Path) -> Path:
    """A user's models of every format, and as much said about them as can be."""
    thing = {"class": "mug", "size": [0.1, 0.1, 0.1]}
    gnome = {"file": "g.glb", "class": "gnome", "size": [0.1, 0.1, 0.2], "looks": {"m": "wood #ff0000"}, "yaw": 90}
    gnome |= {"surfaces": [["top", 0.2, -0.05, -0.05, 0.05, 0.05, 9]], "emits": [1, 1, 1]}
    models = {"box": {"file": "a.obj", **thing}, "g": gnome, "v": {"of": "g", "size": [0.2, 0.1, 0.2]}}
    models["s"] = {"file": "s.sh3f", "model": "mine/box", "class": "gnome"}
    classes = {"gnome": {"support": "floor", "rooms": {"hall": 1}, "tags": ["garden"]}}
    own = write_own(folder / "own", models, classes)
    textured = re.sub(r"f (\d) (\d) (\d) (\d)", r"f \1/1 \2/2 \3/3 \4/4", CUBE)
    written(own / "a.obj", f"mtllib a.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl paint\n{textured}")
    written(own / "a.mtl", "newmtl paint\nKd 0.2 0.4 0.6\nmap_Kd -s 1 2 1 a.png\n")
    Image.new("RGB", (8, 8), "red").save(own / "a.png")
    ball = trimesh.creation.icosphere(subdivisions=1)
    uv = np.random.default_rng(0).random((len(ball.vertices), 2))
    ball.visual = trimesh.visual.TextureVisuals(uv=uv, image=Image.new("RGB", (8, 8), "red"))
    ball.export(own / "g.glb")
    write_pack(own / "s.sh3f", {"mine/box/box.obj": CUBE})
    return own


def _own_model(name: str) -> Callable[[Path, Dataset], Kind]:
    numbers = itertools.count()

    def make(folder: Path, data: Dataset) -> Kind:
        own, classes = own_folder(folder), read_json(DATA / "classes.json")

        def read(_: Path) -> object:
            assets, recipes, models = read_own(own, classes)
            touched = [key for key in assets if name[0] in ("c", models[key].file.name[0])]
            cache = folder / str(next(numbers))
            meshes = [part for key in touched for part in import_own(models[key], recipes[key], cache)]
            for part in meshes:
                assert all(np.isfinite(a).all() for a in (part.vertices, part.normals, part.uv))
                assert part.faces.min() >= 0 and part.faces.max() < len(part.vertices)
            return [(p.vertices.tolist(), p.faces.tolist(), p.finish.color) for p in meshes]

        return Kind(own / name, read, lenient=name in ("a.obj", "a.mtl", "g.glb"))

    return make


KINDS |= {f"own {n}": _own_model(n) for n in ("catalogue.json", "a.obj", "a.mtl", "a.png", "g.glb", "s.sh3f")}


def _weights(network: torch.nn.Module) -> list[float]:
    return [float(p.double().sum()) for p in network.state_dict().values()]


def _agent() -> HannaAgent:
    small = {"hidden_size": 8, "navigation_embedding": 8, "ask_embedding": 4, "self_heads": 2, "text_heads": 2}
    words = build_vocabulary(["go to the red door"]).words
    config = dataclasses.replace(HANNA_SCALES["mini"], **small)
    return HannaAgent.new(HannaAbout(config=config, encoder="e" * 64, feature_size=4, words=words))


@kind
def hanna(folder: Path, data: Dataset) -> Kind:
    _agent().save(folder / "agent.safetensors")
    return Kind(folder / "agent.safetensors", lambda p: _weights(HannaAgent.load(p).network), True)


@kind
def checkpoint(folder: Path, data: Dataset) -> Kind:
    def parts() -> dict:
        network = _agent().network
        return {"network": network, "adam": torch.optim.Adam(network.parameters())}

    def read(path: Path) -> object:
        fresh = parts()
        return restore(path, {"settings": {"batch": 2}}, fresh)["progress"], _weights(fresh["network"])

    with Session(folder, {"settings": {"batch": 2}}, parts(), 5, note=str) as session:
        session.save()
    return Kind(folder / "checkpoint.pt", read, True)


@kind
def features(folder: Path, data: Dataset) -> Kind:
    encoder = random_encoder(seed=0)
    save_features(folder / "features.safetensors", np.ones((2, 36, 4)), encoder, "house")
    read = lambda p: load_features(p, encoder=encoder.digest, source="house", pictures=PLAIN).tolist()
    return Kind(folder / "features.safetensors", read, True)


FACES = Panorama(np.zeros((6, 8, 8, 3), np.uint8), np.ones((6, 8, 8), np.float32), np.zeros((6, 8, 8), np.int32))


@kind
def panoramas(folder: Path, data: Dataset) -> Kind:
    def read(path: Path) -> object:
        with PanoramaFile(path) as file:
            faces = [file.read(node) for node in range(len(file))]
        return [(p.rgb.tolist(), p.depth.tolist(), p.ids.tolist()) for p in faces]

    write_panoramas(folder / "a.pano", [FACES, FACES], {"house": "x"})
    return Kind(folder / "a.pano", read, True)


@kind
def strips(folder: Path, data: Dataset) -> Kind:
    shapes = (1, 192, 576, 3), (1, 12, 36, 2), (1, 12, 36), (1, 12, 36), (1,)
    types = np.uint8, np.uint8, np.int8, np.float16, np.int8
    HouseStrips("a", ("door", "wall"), *(np.zeros(s, t) for s, t in zip(shapes, types))).save(folder / "strips.npz")
    return Kind(folder / "strips.npz", lambda p: HouseStrips.load(p).rgb.tolist(), True)


@kind
def sightings(folder: Path, data: Dataset) -> Kind:
    def read(path: Path) -> object:
        table = load_record(SightingTable, path)
        if table is None:
            raise ValueError("made anew")
        return {f.name: np.asarray(getattr(table, f.name)).tolist() for f in dataclasses.fields(table)}

    save_record(sightings_table([(np.ones((6, 4, 4)), np.full((6, 4, 4), 2))], 3), folder / "sightings.npz")
    return Kind(folder / "sightings.npz", read)


@kind
def answers_of_people(folder: Path, data: Dataset) -> Kind:
    def read(path: Path) -> object:
        store = Store(path)
        try:
            return [to_json(e) for e in store.events()]
        finally:
            store.close()

    store = Store(folder / "people.db")
    for _ in range(200):
        store._write(Event("came", 1.0, body={"a": "b"}))
    store.close()
    return Kind(folder / "people.db", read, lenient=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_a_damaged_file_is_refused_in_a_line_or_harmless(name, made):
    kind = made(name)
    before, good = kind.path.read_bytes(), kind.read(kind.path)
    assert kind.read(kind.path) == good, "reading tells the same twice"
    ways = (flipped, cut, filled, repeated, *[MORE.get(kind.path.suffix, flipped)] * 6)
    rngs = [stream(0, "fuzz", name, k) for k in range(MUTATIONS)]
    damaged = [ways[int(rng.integers(len(ways)))](before, rng) for rng in rngs]
    refused: set[int] = set()
    try:
        for k, body in enumerate([*NONE, *damaged]):
            kind.path.write_bytes(body)
            try:
                found = kind.read(kind.path)
            except CLEAR as e:
                refused.add(k)
                assert 0 < len(str(e).strip()) < 6000, (name, k)
            else:
                assert found == good or not kind.guarded or body == before, (name, k, "believed although changed")
    finally:
        kind.path.write_bytes(before)
    accepted = set(range(len(NONE))) - refused
    assert accepted <= ({0} if name == "episodes" else set()) or kind.lenient, "what is no such file is refused"
    assert len(refused) >= MUTATIONS // 4 or kind.lenient, "most damage is noticed"


# Weights beside settings that cannot be ------------------------------------------------------------


def _bandit(path: Path) -> object:
    return load_weights(path, "bandit", BanditAbout, TRANSLATOR_REMEDY)[1]


@pytest.mark.parametrize(
    ("read", "kind", "about", "match"),
    [
        (hari.load_agent, "hari", "{", "as JSON"),
        (hari.load_agent, "hari", '{"names": [1], "execution": {}}', r"names\[0\] should be"),
        (hari.load_agent, "hari", '{"names": [], "execution": {"heads": 0}}', "at least 1"),
        (hari.load_agent, "hari", '{"names": [], "execution": {}}', "execution policy alone"),
        (hari.load_agent, "vnla", "{}", "holds 'vnla', 'hari' is wanted"),
        (_bandit, "bandit", '{"config": {}}', "lacks the field"),
        (load_student, "regex", '{"config": {"stages": 3}, "words": []}', "unknown field"),
        (functools.partial(load_follower, eyes=None), "nav", '{"config": {}}', "lacks the field"),
    ],
)
def test_weights_beside_settings_that_cannot_be_are_refused(read, kind, about, match, tmp_path):
    meta = {"format": WEIGHTS_FORMAT, "kind": kind, "about": about}
    save_tensors(tmp_path / "a.safetensors", {"x": torch.zeros(1)}, meta)
    with pytest.raises(ValueError, match=match):
        read(tmp_path / "a.safetensors")


@pytest.mark.parametrize("read", [hari.load_agent, HannaAgent.load, _bandit])
def test_weights_that_are_not_there_say_how_they_are_made(read, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.safetensors does not exist; name another file, or .*train"):
        read(tmp_path / "none.safetensors")


# What unpacks to more than it seems ----------------------------------------------------------------


def test_archives_of_arrays_are_refused_by_the_size_they_declare(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as z:
        z.writestr("rgb.npy", bytes(1000))
        z.filelist[0].file_size = 5 * 2**30
    with pytest.raises(ValueError, match="unpacks to 5368709120 bytes"), open_arrays(path):
        pass
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(ValueError, match="is no .npz archive"), open_arrays(tmp_path / "a.npy"):
        pass


def test_episodes_are_unpacked_to_a_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(habitat, "LARGEST_FILE", 2**20)
    (tmp_path / "a.json.gz").write_bytes(gzip.compress(b"[" + bytes(2**23)))
    with pytest.raises(RecordError, match="a.json.gz unpacks to over 1048576 bytes"):
        habitat.read_vlnce(tmp_path / "a.json.gz")


def _wide(kind: str, size: tuple[int, int]) -> bytes:
    """A small picture that says to be of `size`; a PNG has the checksum of that."""
    data = cv2.imencode(kind, np.zeros((8, 48, 3), np.uint8))[1].tobytes()
    if kind == ".jpg":
        return data.replace(struct.pack(">HH", 8, 48), struct.pack(">HH", *size[::-1]))
    header = b"IHDR" + struct.pack(">II", *size) + data[24:29]
    return data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]


@pytest.mark.parametrize("kind", [".png", ".jpg"])
def test_no_picture_is_decoded_that_declares_another_size_or_to_be_huge(kind, tmp_path, monkeypatch):
    wide = _wide(kind, (60000, 30000))
    monkeypatch.setattr(panorama_file, "encode", lambda *_: (wide, wide, wide))
    write_panoramas(tmp_path / "a.pano", [FACES], {})
    (tmp_path / "a.png").write_bytes(_wide(".png", (12000, 12000)))
    decoders = (cv2, "imread"), (cv2, "imdecode"), (deflate, "zlib_decompress")
    for library, name in decoders:
        monkeypatch.setattr(library, name, lambda *_, **__: pytest.fail("it is decoded"))
    with PanoramaFile(tmp_path / "a.pano") as file:
        for channel in panorama_file.CHANNELS:
            with pytest.raises(PanoramaFileError, match="no picture of its size"):
                getattr(file.read(0), channel)
    assert read_picture(tmp_path / "a.png") is None
    pixels = lambda path: pictures._pixels(Path(path), pictures.BGRA)
    for read in (colours.read_colours, model.load_texture, pixels):
        with pytest.raises((ValueError, OSError), match=r"a\.png"):
            read(str(tmp_path / "a.png"))


def test_pictures_are_read_through_what_knows_their_size():
    files = (p for top in ("assets", "embodied", "agents", "viz") for p in (ROOT / top).rglob("*.py"))
    assert [p.name for p in files if "cv2.imread(" in p.read_text(encoding="utf-8")] == ["decoding.py"]


# Texts ---------------------------------------------------------------------------------------------

DEEP = "[" * 5000 + "]" * 5000
ROOM = '{"kind": "hall", "polygon": [[0, 0], [%s, 0], [%s, 6], [0, 6]]}'
TOML = [load_study, lambda path: furniture_tables((path,)), read_toml], r"a\.txt.*expected TOML"
PLAN = [load_plan], r"a\.txt"
WORDS = [read_toml], r"a\.txt:[12]: not UTF-8"
TEXTS = [
    *((TOML, f"a = {value}") for value in (DEEP, "[" * 60 + "]" * 60, "1\na = 2", "9" * 9000)),
    *(
        (PLAN, f'{{"rooms": [{r}]}}')
        for r in (DEEP, ROOM % (("1" + "0" * 400,) * 2), ", ".join([ROOM % (2, 2)] * 5000))
    ),
    *((WORDS, body) for body in (b"\xff\xfea\x00b\x00", b"abc\n\xe9t\xe9\n")),
]


@pytest.mark.parametrize(("kind", "body"), TEXTS)
def test_a_text_that_is_deep_huge_or_none_is_refused_by_name(kind, body, tmp_path):
    readers, message = kind
    (tmp_path / "a.txt").write_bytes(body if isinstance(body, bytes) else body.encode())
    for read in readers:
        with pytest.raises(ValueError, match=message):
            read(tmp_path / "a.txt")
