"""Everybody of the pack as things of the catalogue, one for each pose in which people stay where they are."""

import functools
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from embodied.assets.built.parametric import FinishOf, ParametricAsset
from embodied.assets.built.primitives import fitted
from embodied.assets.people.bodies import STILL, PersonModel, people, posed, still_pose
from embodied.assets.records import Asset, MeshPart, Size


def _make(
    person: PersonModel, usual: str, size: Size, params: Sequence[tuple[str, str | float]], finish: FinishOf
) -> tuple[MeshPart, ...]:
    pose, detail = (str(dict(params).get(k, v)) for k, v in (("pose", usual), ("detail", 0)))
    shown, *fine = (posed(person, still_pose(person, pose), d, finish=finish) for d in sorted({int(detail), 0})[::-1])
    return fitted((*shown, *sum(fine, ())), size)[: len(shown)] if pose == usual else shown


def _figure(person: PersonModel, pose: str) -> ParametricAsset:
    x, y, z, low = person.sizes[pose]
    asset = Asset(
        key=f"people/{person.id}_{pose}",
        object_class="person",
        name=person.words,
        size=(x, y, z),
        support="floor",
        synonyms=("human", person.noun),
        elevation=low,
        clearance=0.5,
        tags=("person", STILL[pose], person.sex),
        pack="people",
        creator="MakeHuman",
        licence="CC0-1.0",
    )
    return ParametricAsset(asset, functools.partial(_make, person, pose), {"pose": pose})


FIGURES: Mapping[str, ParametricAsset] = MappingProxyType(
    {f.asset.key: f for p in people().values() for f in (_figure(p, pose) for pose in STILL)}
)
"""By key, 'people/<person>_<pose>'."""


def person_of(key: str) -> PersonModel:
    """The person that a figure shows."""
    return people()[key.removeprefix("people/").rpartition("_")[0]]
