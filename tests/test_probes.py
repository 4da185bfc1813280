"""Light probes: their harmonics, and how they are read."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from embodied.light.probes import FROM_NORMALS, NORMALS, Probes, harmonics, lobed, radiance, turned

WHITE = np.zeros((9, 1)) + np.sqrt(4 * np.pi) * (np.arange(9) == 0)[:, None]


def directions(n: int) -> np.ndarray:
    v = np.random.default_rng(0).normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def test_even_light_is_the_same_to_every_normal_and_from_every_side():
    np.testing.assert_allclose(harmonics(directions(40)) @ WHITE, 1.0, rtol=1e-6)
    np.testing.assert_allclose(harmonics(directions(40)) @ radiance(WHITE), 1.0, rtol=1e-6)


def test_what_is_projected_comes_back():
    coefficients = np.random.default_rng(1).normal(size=(5, 9, 3))
    np.testing.assert_allclose(FROM_NORMALS @ harmonics(NORMALS) @ coefficients, coefficients, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(radiance(lobed(coefficients)), coefficients, rtol=1e-6)


def test_one_distant_lamp_gives_a_cosine_lobe_to_a_tenth():
    lamp = directions(1)
    e = harmonics(directions(200)) @ lobed(harmonics(lamp).T * np.pi)
    np.testing.assert_allclose(e, np.maximum(directions(200) @ lamp.T, 0.0), atol=0.095)


def test_turned_light_is_the_light_of_turned_normals():
    coefficients, turn = np.random.default_rng(2).normal(size=(4, 9, 3)), Rotation.from_rotvec([0.4, -1.1, 2.0])
    normals = directions(50)
    now = harmonics(turn.apply(normals)) @ turned(coefficients, turn.as_matrix())
    np.testing.assert_allclose(now, harmonics(normals) @ coefficients, atol=1e-6)


@pytest.fixture
def probes() -> Probes:
    """Two rooms side by side, each of 3 x 2 x 2 probes a metre apart; light rises along x, in the second from 100."""
    origin, counts = np.array([[0.0, 0.0, 0.0], [2.2, 0.0, 0.0]]), np.array([[3, 2, 2]] * 2)
    x = np.repeat(np.arange(3.0), 4)
    coefficients = np.zeros((24, 9, 3), np.float16)
    coefficients[:, 0] = np.concatenate([x, 100 + x])[:, None]
    far = np.full((24, 2, 3), 255, np.uint8)
    return Probes(np.array(["a", "b"]), origin, np.ones((2, 3)), counts, coefficients, np.ones(24, bool), far)


def first(probes: Probes, *points: tuple[float, float, float], room: str = "a") -> list[float]:
    return probes.at(np.array(points), room)[:, 0, 0].tolist()


def test_between_probes_light_is_trilinear_beyond_them_it_stays_and_walls_let_none_through(probes):
    assert first(probes, (0.25, 0.3, 0.9), (1.5, 0.5, 0.5)) == [0.25, 1.5]
    assert first(probes, (-1.0, 0.5, 0.5), (2.15, 9.0, -3.0)) == [0.0, 2.0]
    assert first(probes, (2.15, 0.5, 0.5), room="b") == [100.0]
    np.testing.assert_allclose(probes.position[[0, 12, 23]], [[0, 0, 0], [2.2, 0, 0], [4.2, 1, 1]])
    assert probes.room.tolist() == [0] * 12 + [1] * 12
    with pytest.raises(ValueError, match="no room 'c'.*'a', 'b'"):
        probes.at(np.zeros((1, 3)), "c")


def test_probes_in_things_do_not_count_and_where_all_are_the_nearest_one_does(probes):
    valid = probes.valid.copy()
    valid[4:8] = False
    assert first(dataclasses.replace(probes, valid=valid), (0.9, 0.5, 0.5), (1.1, 0.5, 0.5)) == [0.0, 2.0]
    valid[:4] = False
    assert first(dataclasses.replace(probes, valid=valid), (0.2, 0.5, 0.5)) == [2.0]


def test_a_probe_does_not_light_what_it_cannot_see(probes):
    """A table top at x = 0.6, say: what lies on either side takes that side's light."""
    sight = probes.sight.copy()
    sight[:4, 0, 0], sight[4:8, 1, 0] = 60, 40
    assert first(dataclasses.replace(probes, sight=sight), (0.5, 0.5, 0.5), (0.7, 0.5, 0.5)) == [0.0, 1.0]
