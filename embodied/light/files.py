"""A bake on disk: which files it is, and how they are written, read, checked and repaired.

Every stage is a file of its own, written whole or not at all; manifest.json is written last and lists every file with
its checksum.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from assets.archives import open_arrays
from assets.cache import atomic_path, digest, write_bytes
from assets.json_file import read_json
from embodied.house.house import House
from embodied.light.atlas import Atlas
from embodied.light.backend import LightError, device, warn
from embodied.light.compose import Ingredients, Solved
from embodied.light.emitters import Lamp
from embodied.light.settings import light_code
from embodied.light.solve import Radiosity
from embodied.light.tone import Exposure
from embodied.scene.house_meshes import owners
from embodied.scene.lit_pages import LitMesh, LitPages


class StaleBake(LightError):
    """A bake that does not belong to the house at hand."""


@dataclass(frozen=True, eq=False)
class Bake:
    """A lit house on disk."""

    folder: Path
    manifest: dict

    @functools.cached_property
    def exposure(self) -> Exposure:
        e = self.manifest["exposure"]
        polygons = tuple(tuple(tuple(c) for c in p) for p in e["polygons"])
        return Exposure(polygons, np.array(e["levels"]), np.array(e["gains"]), np.array(e["outdoors"]))

    @functools.cached_property
    def lit(self) -> LitPages:
        """What renderers draw."""
        pages = tuple(_read_picture(self.folder / f"page_{i:03d}.jpg") for i in range(self.manifest["pages"]))
        with open_arrays(self.folder / "meshes.npz") as z:
            meshes = tuple(
                LitMesh(
                    m["owner"],
                    m["kind"],
                    m["room"],
                    m["page"],
                    z[f"v{i}"],
                    z[f"f{i}"],
                    z[f"t{i}"],
                    m["alpha"],
                    m["gloss"],
                )
                for i, m in enumerate(self.manifest["meshes"])
            )
        return LitPages(meshes, pages, self.manifest["key"], tuple(self.manifest["owners"]))

    def probe(self, room: str) -> np.ndarray:
        """(6, 3) float32 light that reaches the middle of a room from +x, -x, +y, -y, +z, -z, as sRGB in [0, 1].

        Multiply a moving thing's sRGB colour by the value of the side a face looks to.

        Raises:
          KeyError: no such room.
        """
        return np.array(self.manifest["probes"][room], np.float32)

    def ingredients(self, page: int) -> Ingredients:
        """One page before exposure."""
        with open_arrays(self.folder / f"light_{page:03d}.npz") as z:
            soft, glow = z["soft"], z["glow"]
        sun = np.asarray(cv2.imread(str(self.folder / f"sun_{page:03d}.png"), cv2.IMREAD_GRAYSCALE))
        shown = _read_picture(self.folder / f"albedo_{page:03d}.jpg")
        return Ingredients(soft, sun, shown, _read_picture(self.folder / f"page_{page:03d}.jpg"), glow)


def open_bake(folder: Path, house: House) -> Bake:
    """Open a finished bake and make sure that it belongs to `house`.

    Raises:
      StaleBake: absent, unfinished, damaged, made by other code, or of a house that was edited since.
    """
    folder = Path(folder)
    try:
        manifest = read_json(folder / "manifest.json")
        files = dict(manifest["files"])
    except (OSError, ValueError, KeyError, TypeError) as e:
        raise StaleBake(f"{folder} holds no finished bake ({e}); run `embodied light` to make or finish it") from e
    if manifest.get("code") != light_code():
        raise StaleBake(
            f"{folder} was baked by other code ({manifest.get('code', 'an earlier version')}; this is {light_code()}); "
            "run `embodied light` again"
        )
    if manifest.get("house") != house.digest:
        raise StaleBake(
            f"{folder} was baked for house {manifest.get('house', '')[:12]}, this house is {house.digest[:12]}: "
            "it was edited after it was lit; run `embodied light` again"
        )
    for name, mark in files.items():
        if _mark(folder / name) != mark:
            raise StaleBake(f"{folder / name} is missing or damaged; run `embodied light` again")
    return Bake(folder, manifest)


def reopened(folder: Path, house: House) -> Bake | None:
    """The finished bake in `folder`; None where there is none, with what is damaged there deleted and a warning."""
    if not folder.exists():
        return None
    try:
        return open_bake(folder, house)
    except StaleBake as e:
        if (folder / "manifest.json").exists():
            warn(f"{e}; doing so now")
        _drop_damaged(folder)
        return None


def same_atlas(folder: Path, atlas: Atlas) -> None:
    """Empty `folder` if what an interrupted run left there belongs to other meshes or textures."""
    pages = [
        digest(p.corners.tobytes(), p.luxels.tobytes(), p.uv.tobytes(), p.fineness, repr(p.finishes))
        for p in atlas.pages
    ]
    mark, path = digest(pages), folder / "atlas.txt"
    if not path.exists() or path.read_text() != mark:
        for old in sorted(p for p in folder.iterdir() if not p.name.startswith(".")):  # which holds a lock, too
            old.unlink()
        write_bytes(path, mark.encode())


def kept_light(folder: Path | None, n: int, work: Callable[[], Radiosity]) -> Radiosity:
    """What `work` returns, from disk if an interrupted run left it there whole."""
    path = folder / "stage_light.npz" if folder else None
    names = [f.name for f in dataclasses.fields(Radiosity)]
    if path is not None and path.exists():
        try:
            with open_arrays(path) as z:
                known = Radiosity(*(z[name] for name in names))
            if all(len(getattr(known, name)) == n for name in names):
                return known
        except Exception as e:
            warn(f"{path} is damaged ({type(e).__name__}); the stage is computed again")
    made = work()
    if path is not None:
        with atomic_path(path) as temporary, open(temporary, "wb") as f:
            np.savez(f, **{name: getattr(made, name) for name in names})
    return made


def page_files(i: int) -> tuple[str, ...]:
    """Names of the files of page i: its light, its sun, its colours, its picture."""
    return f"light_{i:03d}.npz", f"sun_{i:03d}.png", f"albedo_{i:03d}.jpg", f"page_{i:03d}.jpg"


def write_page(folder: Path, i: int, page: Ingredients, quality: int) -> None:
    """Page i: light as half floats, the sun as PNG, colours and picture as JPEG of `quality`."""
    light, sun, shown, picture = page_files(i)
    with atomic_path(folder / light) as temporary, open(temporary, "wb") as f:
        np.savez_compressed(f, soft=page.soft, glow=page.glow)
    write_bytes(folder / sun, cv2.imencode(".png", page.sun)[1].tobytes())
    write_jpeg(folder / shown, page.albedo, quality)
    write_jpeg(folder / picture, page.picture, quality)


def write_jpeg(path: Path, picture: np.ndarray, quality: int) -> None:
    """`picture`: (h, w, 3) uint8 sRGB."""
    data = cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    write_bytes(path, data.tobytes())


def write_meshes(folder: Path, meshes: Sequence[LitMesh], gloss: Sequence[np.ndarray]) -> None:
    """meshes.npz: corners, faces, places on the page and gloss of each mesh, in the manifest's order."""
    with atomic_path(folder / "meshes.npz") as temporary, open(temporary, "wb") as f:
        arrays: dict[str, Any] = {f"g{i}": g for i, g in enumerate(gloss)}
        for i, m in enumerate(meshes):
            arrays |= {f"v{i}": m.vertices, f"f{i}": m.faces, f"t{i}": m.uv}
        np.savez_compressed(f, **arrays)


def write_lamps(folder: Path, lamps: Sequence[Lamp]) -> None:
    """lamps.npz: the surfaces that glow, lamp after lamp."""
    with atomic_path(folder / "lamps.npz") as temporary, open(temporary, "wb") as f:
        arrays: dict[str, Any] = {
            f"{k}{i}": np.asarray(getattr(x, k))
            for i, x in enumerate(lamps)
            for k in ("points", "normals", "radiance", "area", "weights")
        }
        np.savez_compressed(f, **arrays)


def facts_of(s: Solved, meshes: Sequence[LitMesh], probes: Mapping[str, list], folder: Path) -> dict[str, object]:
    """What the manifest says of a bake whose files are written, but how it was made."""
    written = [p for p in sorted(folder.iterdir()) if p.name != "manifest.json" and not p.name.startswith(".")]
    return {
        "code": light_code(),
        "key": folder.name,
        "house": s.house.digest,
        "device": device(),
        "own_pages": len(s.atlas.pages),
        "owners": list(owners(s.house)),
        "luxels": len(s.lux.position),
        "exposure": {
            "polygons": s.exposure.polygons,
            "levels": s.exposure.levels.tolist(),
            "gains": s.exposure.gains.tolist(),
            "outdoors": s.exposure.outdoors.tolist(),
        },
        "meshes": [
            {"owner": m.owner, "kind": m.kind, "room": m.room, "page": m.page, "alpha": m.alpha, "gloss": m.gloss}
            for m in meshes
        ],
        "lamps": [{"id": x.id, "room": x.room, "owner": x.owner} for x in s.lamps],
        "probes": dict(probes),
        "files": {p.name: _mark(p) for p in written},
    }


def _mark(path: Path) -> list[int] | None:
    """Size and CRC-32 of a file; None where there is none."""
    return [path.stat().st_size, zlib.crc32(path.read_bytes())] if path.is_file() else None


def _drop_damaged(folder: Path) -> None:
    """Delete the manifest and every file that is not as it says, so that they are made anew."""
    path = folder / "manifest.json"
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        for name, mark in read_json(path)["files"].items():
            if Path(name).name == name and _mark(folder / name) != mark:  # nothing outside
                (folder / name).unlink(missing_ok=True)
    path.unlink(missing_ok=True)


def _read_picture(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise StaleBake(f"{path} is missing or damaged; run `embodied light` again")
    return np.ascontiguousarray(image[..., ::-1])
