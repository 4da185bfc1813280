"""Coarse models made round, and folds of bedding."""

from __future__ import annotations

import numpy as np
import pytest

from embodied.assets.importing.importer import FOLDS, RawPart, finish_parts
from embodied.assets.importing.meshing import CREASE, face_normals
from embodied.assets.importing.rounding import COARSE, DEEP, FINE, folded, is_coarse, refined, rounded
from embodied.assets.records import Finish, ImportRecipe

SIDES, RADIUS, HEIGHT = 12, 0.05, 0.1


def drum(sides: int = SIDES) -> tuple[np.ndarray, np.ndarray]:
    """A closed cylinder along z of so many sides."""
    a = 2 * np.pi * np.arange(sides) / sides
    ring = RADIUS * np.stack([np.cos(a), np.sin(a)], axis=1)
    rings = [np.column_stack([ring, np.full(sides, z)]) for z in (0.0, HEIGHT)]
    vertices = np.concatenate([*rings, [[0, 0, 0], [0, 0, HEIGHT]]])
    i, j, low, high = np.arange(sides), (np.arange(sides) + 1) % sides, 2 * sides, 2 * sides + 1
    k = np.full(sides, 0)
    faces = [(i, j, j + sides), (i, j + sides, i + sides), (j, i, k + low), (i + sides, j + sides, k + high)]
    return vertices, np.concatenate([np.stack(f, axis=1) for f in faces])


def sheet(side: float, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """A flat square that lies, of two triangles to the cell."""
    x, y = np.meshgrid(np.linspace(0, side, cells + 1), np.linspace(0, side, cells + 1), indexing="ij")
    at = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = at[:-1, :-1].ravel(), at[1:, :-1].ravel(), at[1:, 1:].ravel(), at[:-1, 1:].ravel()
    return (
        np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.5)], axis=1),
        np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]),
    )


def is_closed(faces: np.ndarray) -> bool:
    """Whether every edge has two faces, which run along it in opposite directions."""
    along = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    there, back = {tuple(e) for e in along.tolist()}, {tuple(e[::-1]) for e in along.tolist()}
    return len(there) == len(along) and there == back


def widest_gap(vertices: np.ndarray, faces: np.ndarray) -> float:
    """How far the side of a drum is inside its circle at most, metres."""
    level = np.abs(face_normals(vertices, faces)[:, 2]) < 1e-9
    ends = vertices[np.stack([faces[level], np.roll(faces[level], -1, axis=1)], axis=-1)]
    return float((RADIUS - np.linalg.norm(ends.mean(2)[..., :2], axis=-1)).max())


def test_a_drum_is_nearer_to_its_circle_stays_closed_and_keeps_its_flat_ends():
    vertices, faces = drum()
    points, triangles, _ = rounded(vertices, faces, None, CREASE, 10_000)
    assert widest_gap(vertices, faces) > 0.0016
    assert widest_gap(points, triangles) < widest_gap(vertices, faces) / 2
    assert is_closed(triangles) and np.allclose(np.linalg.norm(points[:-2, :2], axis=1).max(), RADIUS, atol=4e-4)
    assert np.ptp(points[:, 2]) == pytest.approx(HEIGHT), "nothing bulges out of the ends"
    volume = np.einsum("ij,ij->i", points[triangles[:, 0]], face_normals(points, triangles)).sum() / 6
    assert volume == pytest.approx(np.pi * RADIUS**2 * HEIGHT, rel=0.03), "no face is turned"


def test_what_is_flat_or_meant_to_have_edges_stays():
    square = sheet(1.0, 3)
    assert len(rounded(*square, None, CREASE, 10_000)[1]) == len(square[1])
    six = drum(6)
    assert len(rounded(*six, None, CREASE, 10_000)[1]) == len(six[1]), "a bar of six sides has edges"
    assert len(rounded(*six, None, np.radians(62), 10_000)[1]) > len(six[1]), "an arm of a sofa has not"


def hanging(side: float, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """A flat square that hangs with its front towards -y."""
    vertices, faces = sheet(side, cells)
    return (vertices - [0, 0, 0.5])[:, [0, 2, 1]], faces


def test_cloth_stays_as_it_lies_and_is_folded_outwards_where_it_hangs():
    vertices, faces = sheet(1.6, 4)
    assert is_coarse(vertices, faces) and not is_coarse(*sheet(1.0, round(2 / COARSE)))
    points, triangles, _ = refined(vertices, faces, None, FINE, 20_000)
    assert len(points) == len(vertices) and np.allclose(folded(points, triangles, np.random.default_rng(0)), points)
    points, triangles, _ = refined(*hanging(1.6, 4), None, FINE, 20_000)
    out = folded(points, triangles, np.random.default_rng(0)) - points
    assert np.allclose(out[:, [0, 2]], 0) and out[:, 1].max() <= 1e-12 and out[:, 1].min() >= -DEEP
    hem, top = points[:, 2] < 0.5, points[:, 2] > 1.55
    assert np.ptp(out[hem, 1]) > 0.8 * DEEP > 4 * np.ptp(out[top, 1]), "deeper towards the hem"
    assert np.array_equal(out, folded(points, triangles, np.random.default_rng(0)) - points)
    beside = np.concatenate([points, [[0.0, 1.0, 5.0]]])  # a headboard, which no triangle of the cloth uses
    assert np.array_equal(out, (folded(beside, triangles, np.random.default_rng(0)) - beside)[:-1])


def test_imported_bedding_is_folded_and_boards_are_not():
    front, faces = hanging(2.0, 4)
    turned = front[:, [0, 2, 1]] * [1, 1, -1]  # y up, as models come
    cover, board = (RawPart(n, turned + [0, 0, z], faces, None, Finish()) for n, z in (("cover", 0.3), ("board", 0.0)))
    recipe = ImportRecipe("test/bed", (2.0, 0.3, 2.0), looks=(("cover", "bedding"), ("board", "wood")))
    parts = [part for part, _ in finish_parts((cover, board), recipe)]
    hung, plain = sorted(parts, key=lambda p: -len(p.faces))
    assert len(faces) < len(hung.faces) <= len(faces) + FOLDS and len(plain.faces) == len(faces)
    assert np.ptp(hung.vertices[:, 1]) > 0.8 * DEEP and np.ptp(plain.vertices[:, 1]) < 1e-6
    lean = np.degrees(np.arccos(np.clip(-hung.normals[:, 1], -1, 1)))
    assert 8 < lean.max() < 45, "light will show the folds"
