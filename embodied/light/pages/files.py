"""A bake on disk: which files it is, and how they are written, read, checked and repaired.

Every stage is a file of its own, written whole or not at all; manifest.json is written last and lists every file with
its checksum.
"""

import functools
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.cache import write_bytes
from embodied.assets.decoding import jpeg, load_record, open_arrays, packed, read_picture
from embodied.assets.json_file import read_json
from embodied.house.house import House
from embodied.light.backend import LightError, LightingCache, get_or_compute, warn
from embodied.light.pages.tone import Exposure
from embodied.light.probes import Probes
from embodied.light.settings import light_code
from embodied.scene.lit_pages import LitMesh, LitPages

PROBES = "probes.npz"
"""Name of the file of light probes."""


class StaleBake(LightError):
    """A bake that does not belong to the house at hand."""


@dataclass(frozen=True, eq=False)
class Ingredients:
    """One page before exposure, at texel size unless said otherwise."""

    soft: np.ndarray
    """(h luxels, w luxels, 3) float16 e of all light but the sun's own."""
    sun: np.ndarray
    """(h, w) uint8 share of the sun seen, times 255."""
    albedo: np.ndarray
    """(h, w, 3) uint8 sRGB."""
    picture: np.ndarray
    """(h, w, 3) uint8 sRGB, exposed: what the classic renderer shows."""
    glow: np.ndarray
    """(h luxels, w luxels, 3) float16 radiance of what shines itself; (0, 0, 3) where nothing does."""


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
        """Pages and meshes that renderers draw."""
        pages = tuple(_read_picture(self.folder / f"page_{i:03d}.jpg") for i in range(self.manifest["pages"]))
        with open_arrays(self.folder / "meshes.npz") as z:
            corners, uv = np.split(z["vertices"], z["vertex_ends"]), np.split(z["uv"], z["vertex_ends"])
            faces = np.split(z["faces"], z["face_ends"])
        meshes = tuple(
            LitMesh(m["owner"], m["kind"], m["room"], m["page"], v, f, t, m["alpha"], m["gloss"])
            for m, v, f, t in zip(self.manifest["meshes"], corners, faces, uv)
        )
        return LitPages(meshes, pages, self.manifest["key"], tuple(self.manifest["owners"]))

    @functools.cached_property
    def gloss(self) -> tuple[np.ndarray | None, ...]:
        """(m, 4) uint8 of each mesh's faces, from `meshes_of`; None where nothing is known of them."""
        with open_arrays(self.folder / "meshes.npz") as z:
            known = np.split(z["gloss"], z["face_ends"][: int(z["glossy"]) - 1])
        return (*known, *[None] * (len(self.manifest["meshes"]) - len(known)))

    @functools.cached_property
    def probes(self) -> Probes:
        """Light at places in the rooms' air; raises StaleBake where the file is damaged."""
        probes = load_record(Probes, self.folder / PROBES)
        if probes is None:
            raise StaleBake(f"{self.folder / PROBES} is missing or damaged; run `embodied light` again")
        return probes

    def glow(self, page: int) -> np.ndarray | None:
        """(h, w, 3) float16 radiance of what shines itself on a page; None where nothing does."""
        with open_arrays(self.folder / page_files(page)[0]) as z:
            return z["glow"] if z["glow"].size else None

    def albedo(self, page: int) -> np.ndarray:
        """(h, w, 3) uint8 sRGB of a page's own colours."""
        return _read_picture(self.folder / page_files(page)[2])

    def ingredients(self, page: int) -> Ingredients:
        """One page before exposure."""
        with open_arrays(self.folder / page_files(page)[0]) as z:
            soft, glow = z["soft"], z["glow"]
        sun = _read_picture(self.folder / f"sun_{page:03d}.png", cv2.IMREAD_GRAYSCALE)
        return Ingredients(soft, sun, self.albedo(page), _read_picture(self.folder / f"page_{page:03d}.jpg"), glow)


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
        if checksum(folder / name) != mark:
            raise StaleBake(f"{folder / name} is missing or damaged; run `embodied light` again")
    return Bake(folder, manifest)


def reopened(folder: Path, house: House) -> Bake | None:
    """The finished bake in `folder`; None where there is none. A damaged one is deleted, with a warning."""
    try:
        return open_bake(folder, house)
    except StaleBake as e:
        if (folder / "manifest.json").exists():
            warn(f"{e}; doing so now")
            for old in sorted(p for p in folder.iterdir() if not p.name.startswith(".")):  # which holds a lock, too
                old.unlink()
        return None


def page_files(i: int) -> tuple[str, ...]:
    """Names of the files of page i: its light, its sun, its colours, its picture."""
    return f"light_{i:03d}.npz", f"sun_{i:03d}.png", f"albedo_{i:03d}.jpg", f"page_{i:03d}.jpg"


def write_page(folder: Path, i: int, page: Ingredients, quality: int, memory: LightingCache | None = None) -> None:
    """Light as half floats, the sun as PNG, colours (the same at all hours) and picture as JPEG of `quality`."""
    light, sun, shown, picture = page_files(i)
    write_bytes(folder / light, packed({"soft": page.soft, "glow": page.glow}))
    write_bytes(folder / sun, cv2.imencode(".png", page.sun)[1].tobytes())
    write_bytes(folder / shown, get_or_compute(memory, ("colours", i), lambda: jpeg(page.albedo, quality)))
    write_bytes(folder / picture, jpeg(page.picture, quality))


def packed_meshes(meshes: Sequence[LitMesh], gloss: Sequence[np.ndarray]) -> bytes:
    """meshes.npz: corners, faces and places on the page of all meshes and gloss of the first ones, in the manifest's
    order, and where each ends but the last."""
    ends = lambda arrays: np.cumsum([len(a) for a in arrays])[:-1]
    arrays = {
        "vertices": np.concatenate([m.vertices for m in meshes]),
        "uv": np.concatenate([m.uv for m in meshes]),
        "vertex_ends": ends([m.vertices for m in meshes]),
        "faces": np.concatenate([m.faces for m in meshes]),
        "face_ends": ends([m.faces for m in meshes]),
        "gloss": np.concatenate(list(gloss)),
        "glossy": np.array(len(gloss)),
    }
    return packed(arrays)


def checksum(path: Path) -> list[int] | None:
    """Size and CRC-32 of a file; None where there is none."""
    return [path.stat().st_size, zlib.crc32(path.read_bytes())] if path.is_file() else None


def _read_picture(path: Path, mode: int = cv2.IMREAD_COLOR) -> np.ndarray:
    image = read_picture(path, mode)
    if image is None:
        raise StaleBake(f"{path} is missing or damaged; run `embodied light` again")
    return image if image.ndim == 2 else np.ascontiguousarray(image[..., ::-1])
