"""Meshes whose vertices carry columns: cut along lines, subdivided, smoothed and pushed off what they cover."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree


@dataclass(frozen=True, eq=False)
class Layer:
    """A triangle mesh. Vertices that differ in uv alone have one `weld` number."""

    data: np.ndarray
    """(n, 8 + joints): place at rest, metres; place in the template, decimetres; uv; weights of joints."""
    faces: np.ndarray
    weld: np.ndarray

    @property
    def place(self) -> np.ndarray:
        return self.data[:, :3]

    @property
    def template(self) -> np.ndarray:
        return self.data[:, 3:6]

    @property
    def uv(self) -> np.ndarray:
        return self.data[:, 6:8]

    @property
    def weights(self) -> np.ndarray:
        return self.data[:, 8:]

    def moved(self, place: np.ndarray) -> Layer:
        return dataclasses.replace(self, data=np.column_stack([place, self.data[:, 3:]]))

    def compact(self, faces: np.ndarray) -> Layer:
        """The layer with these faces alone."""
        used, own = np.unique(faces, return_inverse=True)
        return Layer(self.data[used], own.reshape(-1, 3), np.unique(self.weld[used], return_inverse=True)[1])

    def normals(self) -> np.ndarray:
        """(n, 3) unit, smooth over seams of uv."""
        p = self.place[self.faces]
        cross = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        total = np.zeros((self.weld.max() + 1, 3))
        np.add.at(total, self.weld[self.faces].ravel(), np.repeat(cross, 3, axis=0))
        total[np.linalg.norm(total, axis=1) < 1e-12] = (0.0, 0.0, 1.0)
        return (total / np.linalg.norm(total, axis=1, keepdims=True))[self.weld]


def _pairs(weld: np.ndarray, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Weld numbers for points between vertices, beyond those in use."""
    both = np.sort(np.column_stack([weld[i], weld[j]]), axis=1)
    return weld.max() + 1 + np.unique(both, axis=0, return_inverse=True)[1].ravel()


def subdivided(layer: Layer) -> Layer:
    """Every triangle in four."""
    f = layer.faces
    edges = np.sort(f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, own = np.unique(edges, axis=0, return_inverse=True)
    i, j = unique.T
    m = own.reshape(-1, 3) + len(layer.data)
    a, b, c = f.T
    faces = np.concatenate(
        [
            np.column_stack(x)
            for x in ((a, m[:, 0], m[:, 2]), (m[:, 0], b, m[:, 1]), (m[:, 2], m[:, 1], c), (m[:, 0], m[:, 1], m[:, 2]))
        ]
    )
    return Layer(
        np.vstack([layer.data, (layer.data[i] + layer.data[j]) / 2]),
        faces,
        np.concatenate([layer.weld, _pairs(layer.weld, i, j)]),
    )


def clipped(layer: Layer, field: np.ndarray) -> Layer:
    """The layer where `field` (n,) is positive, cut exactly where it is 0."""
    field = np.where(np.abs(field) < 1e-6, 1e-6, field)
    inside = field > 0
    count = inside[layer.faces].sum(1)
    faces = [layer.faces[count == 3]]
    rotated = lambda f, first: np.take_along_axis(f, (first[:, None] + [0, 1, 2]) % 3, 1)
    one, two = layer.faces[count == 1], layer.faces[count == 2]
    one, two = rotated(one, inside[one].argmax(1)), rotated(two, (~inside[two]).argmax(1))
    cuts = np.sort(np.concatenate([one[:, [0, 1]], one[:, [0, 2]], two[:, [0, 1]], two[:, [0, 2]]]), axis=1)
    if not len(cuts):
        return layer.compact(faces[0])
    unique, own = np.unique(cuts, axis=0, return_inverse=True)
    i, j = unique.T
    t = (field[i] / (field[i] - field[j]))[:, None]
    new = own.ravel() + len(layer.data)
    k, n = len(one), len(two)
    ab, ac, pq, pr = np.split(new, [k, 2 * k, 2 * k + n])
    faces += [
        np.column_stack([one[:, 0], ab, ac]),
        np.column_stack([pq, two[:, 1], two[:, 2]]),
        np.column_stack([pq, two[:, 2], pr]),
    ]
    whole = Layer(
        np.vstack([layer.data, (1 - t) * layer.data[i] + t * layer.data[j]]),
        layer.faces,
        np.concatenate([layer.weld, _pairs(layer.weld, i, j)]),
    )
    return whole.compact(np.concatenate(faces))


def smoothed(layer: Layer, times: int, strength: float | np.ndarray = 0.5) -> Layer:
    """Every vertex drawn to the mean of its neighbours; edges of the mesh stay."""
    n = layer.weld.max() + 1
    f = layer.weld[layer.faces]
    e = f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    graph = sp.coo_matrix((np.ones(len(e)), (e[:, 0], e[:, 1])), (n, n)).tocsr()
    edge = np.asarray((abs(graph - graph.T) > 0.5).sum(1)).ravel() > 0
    graph = ((graph + graph.T) > 0).astype(float)
    mean = sp.diags(1 / np.maximum(np.asarray(graph.sum(1)).ravel(), 1)) @ graph
    place, own = np.zeros((n, 3)), np.zeros(n)
    place[layer.weld] = layer.place
    own[layer.weld] = strength
    own[edge] = 0
    for _ in range(times):
        place += own[:, None] * (mean @ place - place)
    return layer.moved(place[layer.weld])


def pushed(layer: Layer, below: tuple[np.ndarray, np.ndarray], distance: float | np.ndarray) -> Layer:
    """The layer at least `distance` above the points `below` (places and normals), metres."""
    tree = cKDTree(below[0])
    place = layer.place.copy()
    for _ in range(3):
        _, near = tree.query(place, k=4)
        away = place[:, None] - below[0][near]
        height = np.einsum("nki,nki->nk", away, below[1][near])
        close = np.linalg.norm(away, axis=2) < 0.06
        lack = np.where(close, np.asarray(distance).reshape(-1, 1) - height, 0.0).max(1)
        place += np.maximum(lack, 0)[:, None] * below[1][near[:, 0]]
    return layer.moved(place)


def hemmed(layer: Layer, thickness: float) -> Layer:
    """The layer with its open edges folded in by the thickness of cloth."""
    f = layer.faces
    e = f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    welded = layer.weld[e]
    keys, counts = np.unique(np.sort(welded, axis=1), axis=0, return_counts=True)
    once = {tuple(k) for k in keys[counts == 1]}
    rim = e[[tuple(sorted(w)) in once for w in welded.tolist()]]
    if not len(rim):
        return layer
    ends, own = np.unique(rim, return_inverse=True)
    own = own.reshape(-1, 2)
    data, normals = layer.data[ends].copy(), layer.normals()[ends]
    data[:, :3] -= thickness * normals
    n, w = len(layer.data), layer.weld.max() + 1
    inner = own + n
    faces = [
        np.column_stack([rim[:, 1], rim[:, 0], inner[:, 0]]),
        np.column_stack([rim[:, 1], inner[:, 0], inner[:, 1]]),
    ]
    return Layer(
        np.vstack([layer.data, data]),
        np.concatenate([f, *faces]),
        np.concatenate([layer.weld, w + np.unique(layer.weld[ends], return_inverse=True)[1]]),
    )


def joined_layers(layers: list[Layer]) -> Layer:
    """All layers as one."""
    vertex = np.cumsum([0, *(len(x.data) for x in layers)])
    welds = np.cumsum([0, *(x.weld.max() + 1 for x in layers)])
    return Layer(
        np.vstack([x.data for x in layers]),
        np.concatenate([x.faces + k for x, k in zip(layers, vertex)]),
        np.concatenate([x.weld + k for x, k in zip(layers, welds)]),
    )


def noise(points: np.ndarray, size: float, rng: np.random.Generator, waves: int = 24) -> np.ndarray:
    """(n,) smooth noise with standard deviation 1 of a grain, in the unit of `points`."""
    k = rng.normal(size=(waves, 3)) * (2 * np.pi / size) * 0.5
    phase = rng.uniform(0, 2 * np.pi, waves)
    return np.sin(points @ k.T + phase).sum(1) * np.sqrt(2 / waves)
