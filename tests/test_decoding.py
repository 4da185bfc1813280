"""Files are decoded as OpenCV decodes them, by whatever decoder, and damaged ones are none."""

import io

import cv2
import numpy as np
import pytest
from PIL import Image

from embodied.assets.decoding import colours, numbers

FILTERS = [getattr(cv2, f"IMWRITE_PNG_FILTER_{name}") for name in ("NONE", "SUB", "UP", "AVG", "PAETH")]


def picture(channels: int = 3) -> np.ndarray:
    """(37, 61, channels) uint8 that no JPEG keeps exactly."""
    rows, columns = np.mgrid[:37, :61]
    waves = 128 + 100 * np.sin(rows / 5 + columns / 7) + 20 * np.cos(rows * columns)
    return np.stack([np.roll(waves, 9 * k) for k in range(channels)], -1).clip(0, 255).astype(np.uint8)


def saved(image: np.ndarray, kind: str, **options: object) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image.squeeze()).save(buffer, kind, **options)
    return buffer.getvalue()


def turned(**options: object) -> bytes:
    """A photograph that says to be shown upside down."""
    exif = Image.Exif()
    exif[0x0112] = 3
    return saved(picture(), "JPEG", exif=exif, **options)


def late() -> bytes:
    """The same behind a long comment."""
    data = turned()
    return data[:20] + b"\xff\xfe\x13\x8a" + b"x" * 5000 + data[20:]


COLOURS = {
    "full chroma": saved(picture(), "JPEG", quality=90, subsampling=0),
    "half chroma": saved(picture(), "JPEG", subsampling=2),
    "progressive": saved(picture(), "JPEG", progressive=True),
    "grey": saved(picture(1), "JPEG"),
    "turned": turned(),
    "turned behind a comment": late(),
    "png": saved(picture(), "PNG"),
}


@pytest.mark.parametrize("data", COLOURS.values(), ids=COLOURS)
def test_colours_are_those_of_opencv(data):
    bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert (colours(data, "BGR") == bgr).all()
    assert (colours(data) == bgr[..., ::-1]).all()
    assert (colours(data, "BGRA")[..., :3] == bgr).all()


@pytest.mark.parametrize("filtered", FILTERS)
@pytest.mark.parametrize("kind", [np.uint16, np.uint8])
def test_numbers_are_those_of_opencv(kind, filtered):
    image = (np.arange(37 * 61).reshape(37, 61) ** 2 % 60_000).astype(kind)
    data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_FILTER, filtered])[1].tobytes()
    got = numbers(data)
    assert got.dtype == kind
    assert (got == image).all()


def test_depths_that_are_written_here_are_read_without_opencv(monkeypatch):
    image = np.full((16, 24), 40_000, np.uint16)
    depth = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP])[1].tobytes()
    monkeypatch.setattr(cv2, "imdecode", lambda *_: pytest.fail("OpenCV decodes it"))
    assert (numbers(depth) == image).all()


@pytest.mark.parametrize("broken", [b"", b"\xff\xd8\xff\xe0", COLOURS["grey"][:-200], b"\x89PNG\r\n\x1a\n" + bytes(30)])
def test_what_is_no_picture_is_none(broken):
    assert colours(broken) is None
    assert numbers(broken) is None


def test_damaged_numbers_are_what_opencv_makes_of_them_and_a_second_header_does_not_count():
    image = np.arange(37 * 61, dtype=np.uint16).reshape(37, 61)
    data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_UP])[1].tobytes()
    middle = len(data) // 2
    for damaged in (data[:middle], data[:20], data[:middle] + bytes(8) + data[middle + 8 :]):
        assert np.array_equal(numbers(damaged), cv2.imdecode(np.frombuffer(damaged, np.uint8), cv2.IMREAD_ANYDEPTH))
    assert numbers(data[:20] + bytes(4) + data[24:33] + data[8:]) is None
