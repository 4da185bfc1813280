"""Small files that unpack to much, or nest deeply, are refused before anything is unpacked."""

from __future__ import annotations

import gzip
import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import deflate
import numpy as np
import pytest
import simplejpeg

from embodied.agents.common.checkpoint import CheckpointError, read_checkpoint
from embodied.agents.common.session import Session
from embodied.agents.iliad.regex.words import read_words
from embodied.agents.language_models.prompts import read_prompt
from embodied.agents.vision.labels import HouseStrips
from embodied.assets.archives import open_arrays, read_picture
from embodied.assets.closure import ROOT
from embodied.assets.json_file import RecordError, read_toml
from embodied.datasets import habitat
from embodied.errors import UnableError
from embodied.generate.furnish.tables import tables
from embodied.generate.plan_file import load_plan
from embodied.light.pages import colours
from embodied.light.pages.records import load_record
from embodied.light.pages.unwrap import Unwrapped
from embodied.mattersim import pictures
from embodied.render import panorama_file
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import PanoramaFile, PanoramaFileError, write_panoramas
from embodied.render.sightings import load_table
from embodied.scene import model
from embodied.seeds import stream
from embodied.serve.store import Event, Store
from embodied.serve.study import load_study

FACES = Panorama(np.zeros((6, 8, 8, 3), np.uint8), np.ones((6, 8, 8), np.float32), np.zeros((6, 8, 8), np.int32))


@pytest.fixture
def npz(tmp_path) -> Path:
    """An archive of arrays that says that it unpacks to five GiB."""
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as z:
        z.writestr("rgb.npy", bytes(1000))
        z.filelist[0].file_size = 5 * 2**30
    return path


def refused(read: Callable[[], object]) -> bool:
    """Whether `read` says so, or takes the file for one that is to be made again."""
    try:
        return read() is None
    except ValueError as e:
        return "unpacks to 5368709120 bytes" in str(e)


def test_archives_of_arrays_are_refused_by_the_size_they_declare(npz):
    with pytest.raises(ValueError, match="unpacks to 5368709120 bytes"), open_arrays(npz):
        pass
    for read in (HouseStrips.load, load_table, lambda path: load_record(Unwrapped, path)):
        assert refused(lambda read=read: read(npz))


def test_an_array_alone_is_no_archive(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(ValueError, match="is no .npz archive"), open_arrays(tmp_path / "a.npy"):
        pass


def test_episodes_are_unpacked_to_a_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(habitat, "MOST", 2**20)
    (tmp_path / "a.json.gz").write_bytes(gzip.compress(b"[" + bytes(2**23)))
    with pytest.raises(RecordError, match="a.json.gz unpacks to over 1048576 bytes"):
        habitat.read_vlnce(tmp_path / "a.json.gz")


def test_a_checkpoint_is_not_compressed(tmp_path):
    with zipfile.ZipFile(tmp_path / "checkpoint.pt", "w", zipfile.ZIP_DEFLATED) as z:
        z.writestr("archive/data/0", bytes(2**23))
    with pytest.raises(CheckpointError, match="it is compressed"):
        read_checkpoint(tmp_path / "checkpoint.pt")


def nothing_is_decoded(monkeypatch) -> None:
    for library, name in (
        (cv2, "imread"),
        (cv2, "imdecode"),
        (simplejpeg, "decode_jpeg"),
        (deflate, "zlib_decompress"),
    ):
        monkeypatch.setattr(library, name, lambda *_, **__: pytest.fail("it is decoded"))


@pytest.mark.parametrize("kind", [".png", ".jpg"])
def test_a_picture_is_not_decoded_where_it_declares_another_size(kind, tmp_path, monkeypatch):
    small = cv2.imencode(kind, np.zeros((8, 48, 3), np.uint8))[1].tobytes()
    wide = (
        wide_png(small)
        if kind == ".png"
        else small.replace(struct.pack(">HH", 8, 48), struct.pack(">HH", 30000, 60000))
    )
    assert wide != small
    monkeypatch.setattr(panorama_file, "encode", lambda *_: (wide, wide, wide))
    write_panoramas(tmp_path / "a.pano", [FACES], {})
    nothing_is_decoded(monkeypatch)
    with PanoramaFile(tmp_path / "a.pano") as file:
        for read in (file.rgb, file.depth, file.ids):
            with pytest.raises(PanoramaFileError, match="no picture of its size"):
                read(0)


@pytest.mark.parametrize("size", [(60000, 30000), (12000, 12000)])
def test_no_picture_is_decoded_that_declares_to_be_huge(size, tmp_path, monkeypatch):
    (tmp_path / "a.png").write_bytes(wide_png(cv2.imencode(".png", np.zeros((8, 48, 3), np.uint8))[1].tobytes(), size))
    nothing_is_decoded(monkeypatch)
    assert read_picture(tmp_path / "a.png") is None
    for read in (
        colours.read_colours,
        model.load_texture,
        lambda path: pictures._pixels(Path(path), Path(path).read_bytes(), pictures._bgra),
    ):
        with pytest.raises((ValueError, OSError), match=r"a\.png"):
            read(str(tmp_path / "a.png"))


def test_pictures_are_read_through_what_knows_their_size():
    found = [
        p.name
        for top in ("assets", "embodied", "agents", "viz")
        for p in (ROOT / top).rglob("*.py")
        if "cv2.imread(" in p.read_text(encoding="utf-8")
    ]
    assert found == ["archives.py"]


DEEP = "[" * 5000 + "]" * 5000


@pytest.mark.parametrize(
    "body", [f"a = {DEEP}", "a = " + "[" * 60 + "]" * 60, "a = 1\na = 2", "a = " + "9" * 9000, "\ud83d"]
)
@pytest.mark.parametrize("read", [load_study, lambda path: tables((path,)), read_toml])
def test_toml_that_is_deep_or_none_is_refused_by_name(read, body, tmp_path):
    (tmp_path / "a.toml").write_bytes(body.encode("utf-8", "surrogatepass"))
    with pytest.raises(ValueError, match=r"a\.toml.*(expected TOML|not UTF-8)"):
        read(tmp_path / "a.toml")


ROOM = '{"kind": "hall", "polygon": [[0, 0], [%s, 0], [%s, 6], [0, 6]]}'


@pytest.mark.parametrize(
    "body",
    [
        f'{{"rooms": {DEEP}}}',
        '{"rooms": [%s]}' % (ROOM % (("1" + "0" * 400,) * 2)),
        '{"rooms": [%s]}' % (ROOM % ("1e999", "1e999")),
        '{"rooms": [%s]}' % (ROOM % ("NaN", "NaN")),
        '{"rooms": [], "rooms": [%s]}' % (ROOM % (2, 2)),
        f'{{"rooms": [{", ".join([ROOM % (2, 2)] * 5000)}]}}',
        "[]",
        '{"rooms": {"kind": "hall"}}',
    ],
    ids=["deep", "long", "infinite", "nan", "twice", "many", "list", "object"],
)
def test_a_floor_plan_is_read_as_strictly_as_all_json(body, tmp_path):
    (tmp_path / "plan.json").write_text(body)
    with pytest.raises(ValueError, match=r"plan\.json"):
        load_plan(tmp_path / "plan.json")


@pytest.mark.parametrize("body", [b"\xff\xfea\x00b\x00", b"abc\n\xe9t\xe9\n"])
@pytest.mark.parametrize("read", [read_words, lambda path: read_prompt("a", (), path.parent)])
def test_a_text_that_is_not_utf_8_is_named_with_its_line(read, body, tmp_path):
    (tmp_path / "a.md").write_bytes(body)
    with pytest.raises(ValueError, match=r"a\.md:[12]: not UTF-8"):
        read(tmp_path / "a.md")


@pytest.mark.parametrize("body", [b'"' + b"x" * 200_000, b"\xff"])
def test_a_damaged_log_of_a_training_is_named(body, tmp_path):
    (tmp_path / "metrics.csv").write_bytes(body)
    with pytest.raises(ValueError, match=r"metrics\.csv"), Session(tmp_path, {}, {}, 1):
        pass


def test_a_damaged_log_of_what_people_did_is_named(tmp_path):
    (tmp_path / "no.db").write_bytes(b"no database" * 500)
    with pytest.raises(UnableError, match=r"no\.db is damaged"):
        Store(tmp_path / "no.db")
    store = Store(tmp_path / "people.db")
    store._write([Event("came", 1.0, body={"a": "b"}) for _ in range(200)])
    store.close()
    sound, refused = (tmp_path / "people.db").read_bytes(), 0
    for k in range(60):
        rng = stream(0, "people.db", k)
        damaged = bytearray(sound)
        for at in rng.integers(len(sound), size=8):
            damaged[at] ^= 1 << int(rng.integers(8))
        (tmp_path / "people.db").write_bytes(damaged)
        try:
            store = Store(tmp_path / "people.db")
            list(store.events())
            store.close()
        except UnableError as e:
            refused += "people.db is damaged" in str(e)
    assert refused > 10


def wide_png(data: bytes, size: tuple[int, int] = (60000, 30000)) -> bytes:
    """A PNG that says to be of `size`, with the checksum of that."""
    header = b"IHDR" + struct.pack(">II", *size) + data[24:29]
    return data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]


def test_a_damaged_archive_is_still_damaged():
    with pytest.raises(zipfile.BadZipFile), open_arrays(io.BytesIO(b"PK\x03\x04" + bytes(100))):
        pass
