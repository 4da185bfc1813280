"""Small files that unpack to much are refused by the size that they declare, before anything is unpacked."""

from __future__ import annotations

import gzip
import io
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from agents.common.checkpoint import CheckpointError, read_checkpoint
from agents.vision.labels import HouseStrips
from assets.archives import open_arrays
from assets.json_file import RecordError
from embodied.datasets import habitat
from embodied.light.pages.records import load_record
from embodied.light.pages.unwrap import Unwrapped
from embodied.render import panorama_file
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import PanoramaFile, PanoramaFileError, write_panoramas
from embodied.render.sightings import load_table

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
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("it is decoded"))
    with PanoramaFile(tmp_path / "a.pano") as file:
        for read in (file.rgb, file.depth, file.ids):
            with pytest.raises(PanoramaFileError, match="no picture of its size"):
                read(0)


def wide_png(data: bytes) -> bytes:
    """A PNG that says to be 60000 x 30000, with the checksum of that."""
    header = b"IHDR" + struct.pack(">II", 60000, 30000) + data[24:29]
    return data[:12] + header + struct.pack(">I", zlib.crc32(header)) + data[33:]


def test_a_damaged_archive_is_still_damaged():
    with pytest.raises(zipfile.BadZipFile), open_arrays(io.BytesIO(b"PK\x03\x04" + bytes(100))):
        pass
