"""agents.vision.recognise: what heads find in a panorama, and where."""

import numpy as np
import pytest
import torch

from agents.common.shipped import SHIPPED_HEADS
from agents.common.weights import origin_of
from agents.vision.encoder import load_encoder, random_encoder, strip_map
from agents.vision.features import strip_of
from agents.vision.recognise import Heads, Recogniser, save_heads
from agents.vision.strip import CELL, COLUMNS, ROWS, cell_direction, directions
from embodied.render.panorama import Panorama

FACES = (6, 32, 32)


@pytest.fixture
def panorama() -> Panorama:
    rgb = np.random.default_rng(0).integers(0, 255, (*FACES, 3), dtype=np.uint8)
    return Panorama(rgb, np.ones(FACES, np.float32), np.zeros(FACES, np.int32))


def test_cells_lie_where_the_strip_shows_them():
    rays = directions().reshape(ROWS, CELL, COLUMNS, CELL, 3)
    for row, column in [(0, 0), (6, 18), (11, 35), (3, 9)]:
        x, y, z = rays[row, :, column].mean((0, 1))
        yaw, pitch = cell_direction(row, column)
        assert np.arctan2(y, x) == pytest.approx(yaw, abs=0.01)
        assert np.arctan2(z, np.hypot(x, y)) == pytest.approx(pitch, abs=0.02)


def test_a_thing_is_found_in_the_cell_that_shows_it_best(panorama, tmp_path):
    """Heads that look for what one cell shows find it there; those of a class that no cell shows find nothing."""
    encoder = random_encoder(seed=0)
    maps = strip_map(encoder.network, torch.from_numpy(strip_of(panorama)[None]))[0].detach()
    spread = maps.flatten(1).std(1)[:, None, None] + 1e-6
    unlike = (maps - maps.mean((1, 2), keepdim=True)) / spread
    wanted = unlike[:, 4, 7] / spread[:, 0, 0]
    heads = Heads(encoder.size, 2)
    heads.load_state_dict({k: torch.zeros_like(v) for k, v in heads.state_dict().items()})
    score = torch.einsum("d,drc->rc", wanted, maps)
    heads.cell_objects.weight.data[0, :, 0, 0] = wanted * 10
    heads.cell_objects.bias.data = torch.tensor([1.0 - 10 * float(score.max()), -5.0])
    save_heads(heads, encoder, ["mug", "sofa"], tmp_path / "heads.safetensors", {"data": "a data set"})
    assert origin_of(tmp_path / "heads.safetensors") == {"data": "a data set"}
    (found,) = Recogniser.load(encoder, tmp_path / "heads.safetensors")(panorama)
    assert found.name == "mug" and 0.5 < found.probability < 1
    assert (found.yaw, found.pitch) == cell_direction(*divmod(int(score.argmax()), COLUMNS))


def test_heads_of_another_encoder_are_refused(tmp_path):
    save_heads(Heads(random_encoder(seed=0).size, 1), random_encoder(seed=0), ["mug"], tmp_path / "heads.safetensors")
    with pytest.raises(ValueError, match="name those that were trained with this encoder"):
        Recogniser.load(random_encoder(seed=1), tmp_path / "heads.safetensors")


def test_the_shipped_heads_are_those_of_the_shipped_encoder(panorama):
    found = Recogniser.load(load_encoder(), SHIPPED_HEADS)
    assert "sofa" in found.classes and len(found.classes) > 250
    assert all(0.3 <= thing.probability <= 1 for thing in found(panorama))
