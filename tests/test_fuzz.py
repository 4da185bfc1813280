"""Every kind of file we read, damaged in seeded ways: none ends in a traceback, none is believed against itself.

A mutation either is refused by an error that the command line shows as one line (ValueError,
OSError, UnableError), or what is read is the same as before, or it is a whole and different file
of its kind. What carries a checksum may never be the last.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import io
import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
import torch
from conftest import two_rooms
from hand_data import built

from embodied.agents.bandit.config import BanditConfig
from embodied.agents.bandit.network import REMEDY, BanditAbout, Translator, load_network, save_network
from embodied.agents.bandit.training import NumberedCorpus
from embodied.agents.common.checkpoint import restore
from embodied.agents.common.session import Session
from embodied.agents.common.tensor_file import save_tensors
from embodied.agents.common.vocabulary import END, PAD, UNKNOWN, Vocabulary, build_vocabulary
from embodied.agents.common.weights import FORMAT, load_weights
from embodied.agents.hanna.agent import HannaAbout, HannaAgent
from embodied.agents.hanna.training_config import SCALES
from embodied.agents.hari import agent as hari
from embodied.agents.hari.config import ExecutionConfig, IntentionConfig
from embodied.agents.hari.words import FeatureWords
from embodied.agents.iliad.nav.stages import config_of
from embodied.agents.iliad.regex.run import load_student
from embodied.agents.vision.encoder import random_encoder
from embodied.agents.vision.features import load_features, save_features
from embodied.agents.vision.labels import HouseStrips
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.store import Dataset
from embodied.errors import UnableError
from embodied.evaluation import tables
from embodied.evaluation.rollout import play
from embodied.house.house import House
from embodied.interface import Episode
from embodied.mattersim.graphs import load_graphs
from embodied.navigation.graph import from_matterport
from embodied.policies.baselines import PrivilegedAsking, Shortest, ask_every_5
from embodied.records import load_lines, save_lines, to_json
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import MAGIC, TAIL, PanoramaFile, write_panoramas
from embodied.render.sightings import load_table, save_table, sightings_table
from embodied.seeds import stream
from embodied.viz.report import judged
from embodied.viz.sinks import Sinks, check_recording, open_recording

pytestmark = pytest.mark.slow

MUTATIONS = 36
"""Of each of the KINDS; together some 750."""
CLEAR = (ValueError, OSError, UnableError)
"""What the command line shows as one line."""
VALUES = (None, True, False, 0, -1, 10**30, 1e300, -0.5, "", "nope", "../../etc", [], {}, [[]], "9" * 5000)
"""What takes the place of a value of JSON."""


@dataclass(frozen=True)
class Kind:
    """One kind of file."""

    path: Path
    read: Callable[[Path], object]
    """Its content, to compare; raises one of CLEAR."""
    guarded: bool
    """Whether a checksum or digest covers it: what differs must be refused."""


# What is damaged ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def kinds(tmp_path_factory) -> dict[str, Kind]:
    folder = tmp_path_factory.mktemp("fuzz")
    data = built(folder / "data")
    home = data.folder / "houses" / "test_0000"
    (folder / "own").mkdir()
    (folder / "house.json").write_text(two_rooms().to_json())
    (folder / "own" / "catalogue.json").write_text(json.dumps(OWN))
    shutil.copy(home / "connectivity.json", folder / "graph.json")
    for name in ("routes.jsonl", "tasks_test_unseen.jsonl"):
        shutil.copy(home / name, folder / name)
    _write_episodes(data, folder / "episodes.jsonl")
    _write_learned(folder)
    _write_others(folder)
    _write_pictures(folder)
    _write_shown(folder)
    shutil.copy(home / "connectivity.json", folder / "scan_connectivity.json")
    whole = lambda _: _of(Dataset(data.folder))
    return {
        "house.json": Kind(folder / "house.json", lambda p: House.load(p).to_json(), False),
        "own catalogue.json": Kind(folder / "own" / "catalogue.json", lambda p: _own(folder, p), False),
        "connectivity": Kind(folder / "graph.json", lambda p: from_matterport(p).positions.tolist(), False),
        "config.json": Kind(data.folder / "config.json", whole, False),
        "dataset.json": Kind(data.folder / "dataset.json", whole, False),
        "houses/house.json": Kind(home / "house.json", whole, True),
        "houses/connectivity.json": Kind(home / "connectivity.json", whole, True),
        "houses/routes.jsonl": Kind(home / "routes.jsonl", whole, True),
        "houses/tasks.jsonl": Kind(home / "tasks_test_unseen.jsonl", whole, True),
        "episodes": Kind(folder / "episodes.jsonl", lambda p: [to_json(e) for e in load_lines(p, Episode)], False),
        "agent": Kind(folder / "agent.safetensors", lambda p: _weights(HannaAgent.load(p).network), True),
        "hari agent": Kind(folder / "hari.safetensors", lambda p: _weights(hari.load_agent(p).actor), True),
        "translator": Kind(folder / "translator.safetensors", lambda p: _weights(_translator(p)), True),
        "features": Kind(folder / "features.safetensors", lambda p: load_features(p)[0].tolist(), True),
        "checkpoint": Kind(folder / "checkpoint.pt", _resumed, True),
        "panoramas": Kind(folder / "a.pano", _pictures, True),
        "graph of the simulator": Kind(folder / "scan_connectivity.json", _simulated, False),
        "table.json": Kind(folder / "table.json", lambda p: judged(p.parent), False),
        "sightings": Kind(folder / "sightings.npz", _sighted, False),
        "recording": Kind(folder / "a.rrd", _recorded, False),
        "strips": Kind(folder / "strips.npz", lambda p: HouseStrips.load(p).rgb.tolist(), True),
    }


OWN = {
    "pack": "mine",
    "licence": "CC0-1.0",
    "creator": "me",
    "models": {"mug": {"file": "mug.obj", "class": "mug", "size": [0.1, 0.1, 0.1]}},
}
CUBE = (
    "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "f 1 2 4\nf 1 4 3\nf 5 7 8\nf 5 8 6\n"
)
TINY = dataclasses.replace(
    SCALES["mini"], hidden_size=8, navigation_embedding=8, ask_embedding=4, self_heads=2, text_heads=2
)


def _own(folder: Path, path: Path) -> object:
    (path.parent / "mug.obj").write_text(CUBE)
    return sorted(load_catalogue(folder / "cache", own=(path.parent,)).assets)


def _of(data: Dataset) -> object:
    split = "test_unseen"
    return data.digest, [to_json(t) for t in data.tasks(split)], [to_json(r) for r in data.routes("test_0000")]


def _write_episodes(data: Dataset, path: Path) -> None:
    split = data.split("test_unseen")
    save_lines(path, play(split.make_env, PrivilegedAsking(Shortest(), ask_every_5), split.tasks[:3], seed=0))


def _agent():
    words = build_vocabulary(["go to the red door"]).words
    return HannaAgent.new(HannaAbout(config=TINY, encoder="e" * 64, feature_size=4, words=words))


def _write_learned(folder: Path) -> None:
    agent = _agent()
    agent.save(folder / "agent.safetensors")
    parts = {"network": agent.network, "adam": torch.optim.Adam(agent.network.parameters())}
    with Session(folder, {"settings": {"batch": 2}}, parts, 5, note=str) as session:
        session.save()
    save_features(folder / "features.safetensors", np.ones((2, 36, 4)), random_encoder(seed=0), "house")


def _write_others(folder: Path) -> None:
    execution, intention = ExecutionConfig(hidden_size=8, heads=2), IntentionConfig(hidden_size=8)
    executor = hari.new_executor(execution, FeatureWords(("action/go", "action/stop", "room/hall")))
    hari.save_agent(hari.HariAgent(executor, hari.new_heads(intention, 8)[0], intention), folder / "hari.safetensors")
    words = Vocabulary((PAD, UNKNOWN, END, "door"))
    material = NumberedCorpus(BanditConfig(hidden_size=8), {}, (words, words), "", "")
    save_network(Translator(4, 4, 8), material.config, material.lexicons, folder / "translator.safetensors", {})


def _translator(path: Path) -> Translator:
    translator = Translator(4, 4, 8)
    load_network(translator, path)
    return translator


def _weights(network: torch.nn.Module) -> list[float]:
    return [float(p.double().sum()) for p in network.state_dict().values()]


def _resumed(path: Path) -> object:
    agent = _agent()
    parts = {"network": agent.network, "adam": torch.optim.Adam(agent.network.parameters())}
    return restore(path, {"settings": {"batch": 2}}, parts)["progress"], _weights(agent.network)


def _write_pictures(folder: Path) -> None:
    faces = Panorama(np.full((6, 8, 8, 3), 90, np.uint8), np.ones((6, 8, 8), np.float32), np.zeros((6, 8, 8), np.int32))
    write_panoramas(folder / "a.pano", [faces, faces], {"house": "x"})
    shapes = (1, 192, 576, 3), (1, 12, 36, 2), (1, 12, 36), (1, 12, 36), (1,)
    types = np.uint8, np.uint8, np.int8, np.float16, np.int8
    HouseStrips("a", ("door", "wall"), *(np.zeros(s, t) for s, t in zip(shapes, types))).save(folder / "strips.npz")


def _write_shown(folder: Path) -> None:
    """What is made to be looked at, and the sightings in a cache."""
    values = {"success": tables.Estimate(0.5, 0.1, 40)}
    (folder / "table.json").write_text(tables.as_json([tables.Row("shortest path", "val_seen", 0, 40, 4, values)]))
    save_table(folder / "sightings.npz", sightings_table([(np.ones((6, 4, 4)), np.full((6, 4, 4), 2))], 3))
    with open_recording(Sinks(folder / "a.rrd"), rrb.Blueprint(), name="fuzz", properties={}) as recording:
        recording.log("text", rr.TextDocument("a"))


def _simulated(path: Path) -> object:
    load_graphs.cache_clear()
    graphs = load_graphs(str(path.parent), ("scan",))
    assert np.isfinite(graphs.positions).all()
    return graphs.positions.tolist(), graphs.neighbours.tolist()


def _sighted(path: Path) -> object:
    table = load_table(path)
    if table is None:
        raise ValueError("made anew")
    return {f.name: np.asarray(getattr(table, f.name)).tolist() for f in dataclasses.fields(table)}


def _recorded(path: Path) -> object:
    """Only what is no recording at all is refused; what is inside is the viewer's to read."""
    with contextlib.redirect_stderr(io.StringIO()) as said:
        check_recording(path)
    if said.getvalue():
        raise ValueError(said.getvalue())
    return path.read_bytes()


def _pictures(path: Path) -> object:
    with PanoramaFile(path) as file:
        read = [file.read(node) for node in range(len(file))]
    return [(p.rgb.tolist(), p.depth.tolist(), p.ids.tolist()) for p in read]


# How it is damaged ------------------------------------------------------------------------------


def mutated(body: bytes, text: bool, rng: np.random.Generator) -> bytes:
    """`body`, damaged in one of several ways."""
    ways = (flipped, cut, filled, repeated, *([edited] * 6 if text else []))
    return ways[int(rng.integers(len(ways)))](body, rng)


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
    """A piece twice; of text, a line."""
    a, b = sorted(int(x) for x in rng.integers(len(body), size=2))
    return body[:b] + body[a:]


def edited(body: bytes, rng: np.random.Generator) -> bytes:
    """One value of a JSON file, or of one line of a JSON Lines file, replaced, taken away or given another name."""
    lines = body.decode().splitlines()
    whole = len(lines) == 1 or not lines[0].endswith("}")
    number = 0 if whole else int(rng.integers(len(lines)))
    tree = json.loads(body if whole else lines[number])
    _edit(tree, rng)
    text = json.dumps(tree)
    return (text if whole else "\n".join([*lines[:number], text, *lines[number + 1 :]])).encode()


def _edit(tree: object, rng: np.random.Generator) -> None:
    """Replace something somewhere in `tree`."""
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


KINDS = (
    "house.json",
    "own catalogue.json",
    "connectivity",
    "config.json",
    "dataset.json",
    "houses/house.json",
    "houses/connectivity.json",
    "houses/routes.jsonl",
    "houses/tasks.jsonl",
    "episodes",
    "agent",
    "hari agent",
    "translator",
    "features",
    "checkpoint",
    "panoramas",
    "graph of the simulator",
    "table.json",
    "sightings",
    "recording",
    "strips",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_a_damaged_file_is_refused_in_a_line_or_harmless(name, kinds):
    kind = kinds[name]
    before, good = kind.path.read_bytes(), kind.read(kind.path)
    assert kind.read(kind.path) == good, "reading tells the same twice"
    refused = 0
    try:
        for k in range(MUTATIONS):
            damage = mutated(before, kind.path.suffix in (".json", ".jsonl"), stream(0, "fuzz", name, k))
            kind.path.write_bytes(damage)
            try:
                found = kind.read(kind.path)
            except CLEAR as e:
                refused += 1
                assert str(e).strip(), (name, k)
            else:
                assert found == good or not kind.guarded or damage == before, (name, k, "believed although changed")
    finally:
        kind.path.write_bytes(before)
    assert refused >= MUTATIONS // 4 or name == "recording", "most damage is noticed"


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize(
    "body",
    [b"", b"[" * 100_000, b"\x00" * 64, b'{"version": 1}', b"null"],
    ids=["empty", "deep", "zeros", "one field", "null"],
)
def test_what_is_no_such_file_at_all_is_refused(name, body, kinds):
    kind = kinds[name]
    before = kind.path.read_bytes()
    try:
        kind.path.write_bytes(body)
        if name == "episodes" and not body:
            assert kind.read(kind.path) == []
            return
        with pytest.raises(CLEAR, match=r"\w"):
            kind.read(kind.path)
    finally:
        kind.path.write_bytes(before)


def _bandit(path: Path) -> object:
    return load_weights(path, "bandit", BanditAbout, REMEDY)[1]


BESIDE = [
    (hari.load_agent, "hari", "{}", "lacks the fields"),
    (hari.load_agent, "hari", "{", "as JSON"),
    (hari.load_agent, "hari", '{"names": [1], "execution": {}}', r"names\[0\] should be"),
    (hari.load_agent, "hari", '{"names": [], "execution": {"wings": 2}}', "unknown fields"),
    (hari.load_agent, "hari", '{"names": [], "execution": {"heads": 0}}', "at least 1"),
    (hari.load_agent, "hari", '{"names": [], "execution": {}}', "execution policy alone"),
    (hari.load_agent, "vnla", "{}", "holds 'vnla', 'hari' is wanted"),
    (_bandit, "bandit", '{"config": {}}', "lacks the fields"),
    (_bandit, "bandit", '{"config": [], "source": [], "target": []}', "should be an object"),
    (_bandit, "bandit", '{"config": {"batch": 0}, "source": [], "target": []}', "at least 1"),
    (_bandit, "bandit", '{"config": {}, "source": [1], "target": []}', r"source\[0\] should be"),
    (load_student, "regex", '{"config": {"stages": 3}, "words": []}', "unknown fields"),
    (config_of, "nav", '{"config": {}}', "lacks the fields"),
]


@pytest.mark.parametrize(("read", "kind", "about", "match"), BESIDE)
def test_weights_beside_settings_that_cannot_be_are_refused(read, kind, about, match, tmp_path):
    facts = {"format": FORMAT, "kind": kind, "about": about}
    save_tensors(tmp_path / "a.safetensors", {"x": torch.zeros(1)}, facts)
    with pytest.raises(ValueError, match=match):
        read(tmp_path / "a.safetensors")


@pytest.mark.parametrize("read", [hari.load_agent, HannaAgent.load, _bandit])
def test_weights_that_are_not_there_say_how_they_are_made(read, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.safetensors does not exist; name another file, or .*train"):
        read(tmp_path / "none.safetensors")


@pytest.mark.parametrize("offset", [8, 10])
def test_strips_in_an_archive_that_says_it_is_packed_otherwise_are_refused(offset, kinds):
    """A flip in the directory of a .npz: another way of packing, or 'encrypted'."""
    kind = kinds["strips"]
    before = kind.path.read_bytes()
    body = bytearray(before)
    body[body.rindex(b"PK\x01\x02") + offset] ^= 1
    try:
        kind.path.write_bytes(body)
        with pytest.raises(ValueError, match="delete it and render again"):
            kind.read(kind.path)
    finally:
        kind.path.write_bytes(before)


def test_an_index_of_pictures_that_is_whole_and_wrong_is_refused_or_its_pictures_have_its_size(tmp_path):
    """Whoever changes the index knows how to write its checksum."""
    _write_pictures(tmp_path)
    body, refused = (tmp_path / "a.pano").read_bytes(), 0
    length, _, _ = TAIL.unpack(body[-TAIL.size :])
    pictures, index = body[: -TAIL.size - length], body[-TAIL.size - length : -TAIL.size]
    for k in range(60):
        wrong = edited(index, stream(3, "index", k))
        tail = TAIL.pack(len(wrong), hashlib.sha256(wrong).digest(), MAGIC)
        (tmp_path / "b.pano").write_bytes(pictures + wrong + tail)
        try:
            with PanoramaFile(tmp_path / "b.pano") as file:
                assert all(file.rgb(n).shape == (6, file.size, file.size, 3) for n in range(len(file)))
        except CLEAR:
            refused += 1
    assert refused > 20


def test_the_mutations_are_what_they_say():
    body = b'{"a": 1, "b": [1, 2, {"c": null}]}'
    changed = [mutated(body, True, stream(1, k)) for k in range(60)]
    assert changed == [mutated(body, True, stream(1, k)) for k in range(60)], "the same in every run"
    assert len(set(changed)) > 30
    assert io.BytesIO(flipped(body, stream(2, "f"))).getbuffer().nbytes == len(body)
