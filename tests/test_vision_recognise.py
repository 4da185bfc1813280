"""embodied.agents.vision.detector: what is found in a panorama, and where."""

import numpy as np
import pytest
from hand_data import random_encoder
from hand_pixels import coloured_strips

from embodied.agents.common.weights import origin_of
from embodied.agents.vision.config import StripTraining
from embodied.agents.vision.detector import Detector, train_detector
from embodied.agents.vision.encoder import CELL, STRIP_COLUMNS, STRIP_ROWS, cell_direction, directions, load_encoder
from embodied.render.panorama import Panorama

FACES = (6, 32, 32)


@pytest.fixture
def panorama() -> Panorama:
    rgb = np.random.default_rng(0).integers(0, 255, (*FACES, 3), dtype=np.uint8)
    return Panorama(rgb, np.ones(FACES, np.float32), np.zeros(FACES, np.int32))


@pytest.fixture(scope="module")
def trained(tmp_path_factory) -> Detector:
    """Learned in strips in which a red cell is a 'rose' and a green one a 'fern'."""
    config = StripTraining(epochs=6, batch=2, least_views=1, learning_rate=0.01)
    encoder = random_encoder(seed=0)
    houses, folder = [coloured_strips("a", 12, seed=0)], tmp_path_factory.mktemp("detector")
    return train_detector(houses, encoder, config, folder, note=lambda line: None)


def test_cells_lie_where_the_strip_shows_them():
    rays = directions().reshape(STRIP_ROWS, CELL, STRIP_COLUMNS, CELL, 3)
    for row, column in [(0, 0), (6, 18), (11, 35), (3, 9)]:
        x, y, z = rays[row, :, column].mean((0, 1))
        yaw, pitch = cell_direction(row, column)
        assert np.arctan2(y, x) == pytest.approx(yaw, abs=0.01)
        assert np.arctan2(z, np.hypot(x, y)) == pytest.approx(pitch, abs=0.02)


def test_a_detector_learns_which_cells_and_views_show_a_class(trained):
    other = coloured_strips("b", 6, seed=1)
    assert min(trained.precision([other]).values()) > 0.95
    cells, views = trained(other.rgb)
    shown = other.share.transpose(0, 3, 1, 2) > 128
    assert ((cells > 0.5) == shown).mean() > 0.95 and views.shape == (6, 36, 2)


def test_a_detector_is_saved_with_what_it_was_trained_with_and_belongs_to_its_encoder(trained, tmp_path):
    path = tmp_path / "detector.safetensors"
    trained.save(path, {"data": "a data set"})
    assert origin_of(path) == {"data": "a data set"}
    again, strips = Detector.load(trained.encoder, path), coloured_strips("b", 1, seed=1).rgb
    assert again.classes == ("rose", "fern") and np.allclose(again(strips)[0], trained(strips)[0], atol=0.05)
    with pytest.raises(ValueError, match="name the one that was trained with this encoder"):
        Detector.load(random_encoder(seed=1), path)


def test_a_thing_is_named_where_it_is_seen_best(panorama, monkeypatch):
    cells = np.zeros((1, 3, STRIP_ROWS, STRIP_COLUMNS), np.float32)
    cells[0, 0, 4, 7], cells[0, 1, 2, 2], cells[0, 2, 5, 5] = 0.8, 0.9, 0.2
    detector = Detector(random_encoder(seed=0), None, ("mug", "wall", "sofa"))
    monkeypatch.setattr(Detector, "__call__", lambda self, strips: (cells, None))
    (found,) = detector.recognise(panorama)
    assert found.name == "mug" and found.probability == pytest.approx(0.8)
    assert (found.yaw, found.pitch) == cell_direction(4, 7)


def test_the_shipped_detector_is_that_of_the_shipped_encoder(panorama):
    found = Detector.load(load_encoder())
    assert "sofa" in found.classes and len(found.classes) > 250
    assert all(0.3 <= thing.probability <= 1 for thing in found.recognise(panorama))
