"""Stages of a bake that was interrupted, and what the manifest says of one that is done."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from embodied.assets.cache import atomic_path
from embodied.assets.decoding import load_record
from embodied.light.backend import device, warn
from embodied.light.baking.compose import LightSolution
from embodied.light.baking.solve import Radiosity
from embodied.light.pages.files import checksum
from embodied.light.settings import light_code
from embodied.scene.house_meshes import owners
from embodied.scene.lit_pages import LitMesh

GAINS = ("levels", "gains", "outdoors")
"""Arrays of an `Exposure`."""


def kept_light(folder: Path | None, n: int, work: Callable[[], Radiosity]) -> Radiosity:
    """Result of `work`, from disk if an interrupted run left it there whole."""
    if folder is None:
        return work()
    path = folder / "stage_light.npz"
    known = load_record(Radiosity, path)
    if known is not None and all(len(a) == n for a in vars(known).values()):
        return known
    if path.exists():
        warn(f"{path} is damaged; the stage is computed again")
    made = work()
    with atomic_path(path) as temporary, open(temporary, "wb") as f:
        np.savez(f, **vars(made))  # quicker to write than what `save_record` packs
    return made


def facts_of(s: LightSolution, meshes: Sequence[LitMesh], folder: Path) -> dict[str, object]:
    """Facts of the manifest about a bake whose files are written, but how it was made."""
    written = [p for p in sorted(folder.iterdir()) if p.name != "manifest.json" and not p.name.startswith(".")]
    return {
        "code": light_code(),
        "key": folder.name,
        "house": s.house.digest,
        "device": device(),
        "own_pages": len(s.atlas.pages),
        "owners": list(owners(s.house)),
        "luxels": len(s.lux.position),
        "exposure": {"polygons": s.exposure.polygons, **{k: getattr(s.exposure, k).tolist() for k in GAINS}},
        "meshes": [
            {"owner": m.owner, "kind": m.kind, "room": m.room, "page": m.page, "alpha": m.alpha, "gloss": m.gloss}
            for m in meshes
        ],
        "lamps": [{"id": x.id, "room": x.room, "owner": x.owner} for x in s.lamps],
        "files": {p.name: checksum(p) for p in written},
    }
