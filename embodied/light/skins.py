"""People in light: a surface that follows the skin of its owner from pose to pose."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from embodied.assets.people import Person, Pose, people, posed
from embodied.assets.people.bodies import mesh_of, transforms
from embodied.light.movers import Surface
from embodied.light.probes import FROM_NORMALS, NORMALS, harmonics
from embodied.scene.part import Part

MOVING_DETAIL, SHADOW_DETAIL = 0, 2
"""Detail of the meshes of people who move, and of what casts their shadows."""


def person_parts(person: Person) -> list[Part]:
    """Somebody at rest, in their own frame."""
    parts = posed(person, Pose(), MOVING_DETAIL)
    return [Part("", "object", "", m, f"person/{person.id}/{MOVING_DETAIL}#{k}") for k, m in enumerate(parts)]


class Skin:
    """Owns how the surface of a person at rest hangs on the joints: each point as the nearest vertex of the mesh."""

    def __init__(self, person: str, rest: Surface) -> None:
        self._person, self._rest, self._by_normals = people()[person], rest, rest.transfer @ FROM_NORMALS
        mesh = mesh_of(person, MOVING_DETAIL)
        tree = cKDTree(mesh.vertices[:, :3])
        weights = lambda points: mesh.weights[tree.query(points)[1]]
        self._meshes = [weights(m.vertices) for m in rest.meshes]
        self._luxels, self._discs = map(weights, (rest.position, rest.discs.position))
        coarse = mesh_of(person, SHADOW_DETAIL)
        corners = np.concatenate([np.arange(len(coarse.vertices))[span][faces] for _, span, faces, _ in coarse.parts])
        self._still, self._corners = coarse.vertices[corners, :3], coarse.weights[corners.ravel()]

    def meshes(self, pose: Pose) -> list[np.ndarray]:
        """(n, 3) float32 vertices of each mesh of the surface in a pose, metres, in the person's frame."""
        turns = transforms(self._person, pose)
        return [_moved(turns, w, m.vertices)[1] for w, m in zip(self._meshes, self._rest.meshes, strict=True)]

    def surface(self, pose: Pose, meshes: Sequence[np.ndarray]) -> Surface:
        """The surface in a pose, whose vertices are `meshes`; the light of a luxel turns with it."""
        rest, turns = self._rest, transforms(self._person, pose)
        turned, position = _moved(turns, self._luxels, rest.position)
        disc_turned, disc_position = _moved(turns, self._discs, rest.discs.position)
        towards = NORMALS @ turned.swapaxes(-1, -2)
        light = harmonics(towards / np.linalg.norm(towards, axis=-1, keepdims=True))
        moved = [dataclasses.replace(m, vertices=v) for m, v in zip(rest.meshes, meshes, strict=True)]
        return dataclasses.replace(
            rest,
            meshes=tuple(moved),
            position=position,
            normal=_unit(turned, rest.normal),
            transfer=np.einsum("nk,nkj->nj", self._by_normals, light).astype(np.float32),
            corners=_moved(turns, self._corners, self._still)[1],
            discs=dataclasses.replace(rest.discs, position=disc_position, normal=_unit(disc_turned, rest.discs.normal)),
        )


def _moved(turns: np.ndarray, weights: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3, 3) how points (..., 3) turn, and (..., 3) where they come to, float32."""
    turned, shift = np.split((weights @ turns.reshape(len(turns), 12)).reshape(*points.shape[:-1], 3, 4), [3], axis=-1)
    return turned, (_turned(turned, points) + shift[..., 0]).astype(np.float32)


def _turned(turned: np.ndarray, points: np.ndarray) -> np.ndarray:
    along: np.ndarray = sum(turned[..., k] * points[..., k, None] for k in range(3))  # five times as fast as matmul
    return along


def _unit(turned: np.ndarray, normal: np.ndarray) -> np.ndarray:
    out = _turned(turned, normal)
    return (out / np.linalg.norm(out, axis=-1, keepdims=True)).astype(np.float32)
