"""From a pack's model to MeshParts of real size, cached on disk under a checksum.

The models of Sweet Home 3D are y up with their front towards +z, of any unit: `modelRotation`
turns them, then the bounding box is stretched to the catalogue's width, height and depth, as
Sweet Home 3D does itself. The asset frame (assets.records.MeshPart) is (x, -z, y) of that.
"""

from __future__ import annotations

import io
import struct
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np
from PIL import Image, UnidentifiedImageError

from assets.cache import atomic_path, digest, write_bytes, write_json
from assets.closure import code_digest
from assets.importing.covers import COVERS, FOLDED, cover_of, creased, kind_of, laid_on, picture
from assets.importing.meshing import CREASE, crease_normals, decimate, face_normals, indexed, sound_faces, weld
from assets.importing.mtl_finish import corrected, finish_of
from assets.importing.obj import MeshError, MtlMaterial, libraries, parse_mtl, parse_obj
from assets.importing.rounding import FINE, folded, is_coarse, refined, rounded
from assets.importing.sh3f import Pack, PackError
from assets.json_file import read_json
from assets.records import Finish, ImportRecipe, MeshPart, bounds

READER = "assets.importing.own"
"""The module that imports models of all formats: its code is part of every cache key."""
APART = ("assets", "assets.data", "assets.importing")
"""What the code of imported models does not count: packages' names, and the catalogue's rows, whose recipes are in the
keys."""
FORMATS = ("PNG", "JPEG", "BMP", "TGA")
"""What textures are opened as. Pillow knows many more; some of them start other programs (PostScript)."""
MAX_TEXTURE = 512
MAX_PIXELS = 64_000_000
FACE_BUDGETS = ((0.3, 3_000), (0.8, 6_000), (30.0, 10_000))
"""Faces a model keeps, by its longest side in metres."""
ROUNDING = 0.5
"""Share of that budget by which rounding a model may exceed it."""
SOFT = ("cloth", "bedding", "leather", "terry")
SOFT_CREASE = np.radians(62.0)
"""Covers of what is padded, and the angle at which faces of those share a smooth normal: six faces make a round arm."""
FOLDS = 9_000
"""Faces by which the bedding of a model may grow to hold its folds, each part by its area."""


Reader = Callable[[str], bytes]
"""The bytes of a file by its name; PackError or FileNotFoundError where there is none."""


@dataclass(frozen=True, eq=False)
class RawPart:
    """One material of a model before import: y up, any unit."""

    name: str
    vertices: np.ndarray
    """(n, 3) float64."""
    faces: np.ndarray
    """(m, 3) int64."""
    uv: np.ndarray | None
    """(m, 3, 2) float64 of the corners."""
    finish: Finish
    image: Image.Image | None = None
    cover: str | None = None
    """What it wears, folds alone where it has an image (assets.importing.covers)."""


def import_model(pack: Pack, recipe: ImportRecipe, cache: Path, obj: str | None = None) -> tuple[MeshPart, ...]:
    """The parts of a library's model (the OBJ entry `obj`, that of the recipe's key if None), from
    the cache if it is there and sound."""
    obj = obj or pack.entries[recipe.model or recipe.key].model
    return cached(recipe, pack.digest, cache, lambda: read_obj(pack.read, obj, f"{pack.path.name}: {obj}"))


def cached(
    recipe: ImportRecipe, source: str, cache: Path, read: Callable[[], tuple[RawPart, ...]]
) -> tuple[MeshPart, ...]:
    """The finished parts of `recipe`; `read` and the import run only when the cache lacks them.

    Args:
      source: digest of the pack or file that `read` reads.
    """
    folder = Path(cache) / "assets" / source[:16]
    told = {k: v for k, v in asdict(recipe).items() if k != "model" or v}
    stem = recipe.key.replace("/", "__") + "-" + digest(code_digest(READER, without=APART), told)[:12]
    parts = _load(folder, stem)
    if parts is None:
        _save(folder, stem, finish_parts(read(), recipe))
        parts = _load(folder, stem)
    if parts is None:
        raise PackError(f"{folder / stem} cannot be read back after writing; check the disk and delete {folder}")
    return parts


def read_obj(read: Reader, name: str, where: str, remedy: str = "install the pack again") -> tuple[RawPart, ...]:
    """The parts of the OBJ file `name`, with its MTL and textures read by `read`.

    Args:
      remedy: what to do about a texture that cannot be read.

    Raises:
      MeshError, PackError: damaged or missing files.
    """
    folder = PurePosixPath(name).parent
    obj = parse_obj(read(name).decode("latin-1"), where)
    materials: dict[str, MtlMaterial] = {}
    for library in obj.libraries:
        materials |= parse_mtl((_read_if_there(read, str(folder / library)) or b"").decode("latin-1"))
    images: dict[str, Image.Image | None] = {}
    parts = []
    for group in obj.groups:
        material = materials.get(group.material, MtlMaterial(group.material))
        image = None
        if material.texture and (group.uv_corners >= 0).all():
            if material.texture not in images:
                images[material.texture] = _image(read, _texture_name(folder, material.texture), remedy)
            image = images[material.texture]
        uv = obj.uvs[group.uv_corners] if image is not None else None
        parts.append(
            RawPart(group.material, obj.vertices, group.corners, uv, finish_of(material, image is not None), image)
        )
    return tuple(parts)


def obj_files(read: Reader, name: str) -> tuple[str, ...]:
    """The MTL files and textures that the OBJ file `name` names, whether they are there or not."""
    folder, found = PurePosixPath(name).parent, []
    for library in libraries(read(name).decode("latin-1")):
        found.append(str(folder / library))
        materials = parse_mtl((_read_if_there(read, found[-1]) or b"").decode("latin-1"))
        found += [_texture_name(folder, m.texture) for m in materials.values() if m.texture]
    return tuple(dict.fromkeys(found))


def _texture_name(folder: PurePosixPath, texture: str) -> str:
    return str(folder / texture.replace("\\", "/"))


def _read_if_there(read: Reader, name: str) -> bytes | None:
    """The bytes of a file that models may do without; None where it is lost."""
    try:
        return read(name)
    except (PackError, FileNotFoundError):
        return None


def finish_parts(raw: tuple[RawPart, ...], recipe: ImportRecipe) -> list[tuple[MeshPart, Image.Image | None]]:
    """Sized, turned, welded, decimated and shaded parts with their texture images.

    Raises:
      MeshError: nothing is left, or numbers are not finite.
    """
    raw = tuple(_looking(p, dict(recipe.looks)) for p in raw if p.name not in recipe.dropped)
    if not raw:
        raise MeshError(f"{recipe.key} has no faces; the model is empty or damaged")
    placed = _placed(raw, recipe)
    tolerance = 2e-5 * max(recipe.size)
    prepared = []
    for part, vertices in zip(raw, placed):
        points, faces = weld(vertices, part.faces, tolerance)
        uv = part.uv
        if part.name in recipe.flipped:
            faces, uv = faces[:, ::-1], None if uv is None else uv[:, ::-1]
        keep = sound_faces(points, faces)
        if keep.any():
            prepared.append((part, points, faces[keep], None if uv is None else uv[keep]))
    if not prepared:
        raise MeshError(f"{recipe.key} has only degenerate faces; the model is damaged")
    total = sum(len(f) for _, _, f, _ in prepared)
    budget = recipe.faces or next(n for side, n in FACE_BUDGETS if max(recipe.size) <= side)
    bedding = sum(_area(v, f) for p, v, f, _ in prepared if p.cover == "bedding")
    out = []
    for part, points, faces, uv in prepared:
        if total > budget and len(faces) > 40:
            points, faces, uv = decimate(points, faces, uv, max(40, round(len(faces) * budget / total)))
        sheet = part.name in recipe.two_sided or "*" in recipe.two_sided
        if part.cover == "bedding" and is_coarse(points, faces):
            points, faces, uv = refined(points, faces, uv, FINE, round(FOLDS * _area(points, faces) / bedding))
            points = folded(points, faces, np.random.default_rng(0))
        elif part.cover in SOFT or not sheet:  # leaves are flat, and many
            room = round(ROUNDING * budget * len(faces) / min(total, budget))
            points, faces, uv = rounded(points, faces, uv, _crease(part), room)
        keep = sound_faces(points, faces)  # folding and clipping may flatten a sliver
        faces, uv = faces[keep], None if uv is None else uv[keep]
        if sheet:
            out.append(
                _part(part, points, np.ascontiguousarray(faces[:, ::-1]), None if uv is None else uv[:, ::-1], recipe)
            )
        out.append(_part(part, points, faces, uv, recipe))
    return _to_size(out, recipe.size)


def _area(points: np.ndarray, faces: np.ndarray) -> float:
    return float(np.linalg.norm(face_normals(points, faces), axis=1).sum()) / 2


def _crease(part: RawPart) -> float:
    return SOFT_CREASE if part.cover in SOFT else CREASE


def _looking(part: RawPart, looks: dict[str, str]) -> RawPart:
    look = looks.get(part.name, "")
    finish, keep = corrected(part.finish, look)
    textured = keep and part.image is not None
    clear = finish.color[3] < 0.9 or finish.metallic > 0.5 or finish.mirror
    cover = kind_of(part.name, look) if textured else cover_of(part.name, finish.color, look, clear)
    finish = replace(finish, detail=cover and COVERS[cover].detail)
    image, uv = (part.image, part.uv) if textured else (None, None)
    return replace(part, finish=finish, image=image, uv=uv, cover=cover)


def _placed(raw: tuple[RawPart, ...], recipe: ImportRecipe) -> list[np.ndarray]:
    """Vertices of each part in the asset frame, metres, the bounding box at its real size."""
    turn = np.array(recipe.rotation, dtype=np.float64).reshape(3, 3).T
    turned = [p.vertices @ turn for p in raw]
    used = np.concatenate([v[np.unique(p.faces)] for p, v in zip(raw, turned)])
    low, high = used.min(axis=0), used.max(axis=0)
    if not (np.isfinite(low).all() and np.isfinite(high).all()) or np.ptp(used, axis=0).max() <= 0:
        raise MeshError(f"{recipe.key} has no extent or is not finite; the model is damaged")
    yaw = round(recipe.yaw)
    width, depth, height = recipe.size
    if yaw % 180 == 90:
        width, depth = depth, width
    scale = np.array([width, height, depth]) / np.where(high - low > 1e-9, high - low, 1.0)
    centre = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    angle = np.radians(recipe.yaw)
    c, s = np.round(np.cos(angle), 12), np.round(np.sin(angle), 12)
    spin = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    return [((v - centre) * scale)[:, [0, 2, 1]] * [1.0, -1.0, 1.0] @ spin for v in turned]


def _part(
    part: RawPart, points: np.ndarray, faces: np.ndarray, uv: np.ndarray | None, recipe: ImportRecipe
) -> tuple[MeshPart, Image.Image | None]:
    finish, image = part.finish, part.image
    if part.name in recipe.glow and recipe.emits:
        finish = replace(finish, emission=recipe.emits)
    elif part.cover is not None and (image is None or uv is None):
        uv, image = laid_on(part.cover, points, faces), picture(part.cover, finish.color)
    elif part.cover in FOLDED and image is not None and uv is not None:
        image = creased(image, part.cover, points, faces, uv)
    vertices, triangles, normals, coords = indexed(points, faces, crease_normals(points, faces, _crease(part)), uv)
    return MeshPart(vertices, triangles, normals, coords, finish), image


def _to_size(parts: list, size: tuple[float, float, float]) -> list:
    """Bring a model that decimation shrank by a hair back to its exact bounding box."""
    low, high = bounds([p for p, _ in parts]).astype(np.float64)
    stretch = np.where(high - low > 1e-6, np.array(size) / np.maximum(high - low, 1e-6), 1.0)
    stretch = np.clip(stretch, 0.9, 1.1).astype(np.float32)
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]], dtype=np.float32)
    return [(replace(p, vertices=(p.vertices - origin) * stretch), image) for p, image in parts]


def _image(read: Reader, name: str, remedy: str) -> Image.Image | None:
    """The texture `name` at most MAX_TEXTURE wide, or None where the pack lost it."""
    data = _read_if_there(read, name)
    if data is None:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            with Image.open(io.BytesIO(data), formats=FORMATS) as opened:
                if opened.width * opened.height > MAX_PIXELS:
                    raise PackError(f"texture {name} has {opened.width} x {opened.height} pixels; make it smaller")
                clear = opened.mode in ("RGBA", "LA") or "transparency" in opened.info
                image = opened.convert("RGBA" if clear else "RGB")
        except UnidentifiedImageError as e:
            raise PackError(f"texture {name} cannot be read: it is none of {', '.join(FORMATS)}; {remedy}") from e
        except PackError:
            raise
        except (OSError, SyntaxError, ValueError, struct.error, Image.DecompressionBombError) as e:
            raise PackError(f"texture {name} cannot be read ({e}); {remedy}") from e
    if clear and np.asarray(image)[..., 3].min() > 250:
        image = image.convert("RGB")
    scale = MAX_TEXTURE / max(image.size)
    if scale < 1.0:
        width, height = (max(1, round(s * scale)) for s in image.size)
        image = image.resize((width, height), Image.Resampling.LANCZOS)
    return image


def _save(folder: Path, stem: str, parts: list[tuple[MeshPart, Image.Image | None]]) -> None:
    """Write textures, then the arrays, then the manifest that makes both believed."""
    sums: dict[str, str] = {}
    arrays: dict[str, np.ndarray] = {}
    files: dict[int, str] = {}
    finishes = []
    for i, (part, image) in enumerate(parts):
        texture = None
        if image is not None:
            texture = files.get(id(image))
            if texture is None:
                texture = files[id(image)] = f"{stem}-{len(files)}.png"
                buffer = io.BytesIO()
                image.save(buffer, format="PNG")
                write_bytes(folder / texture, buffer.getvalue())
                sums[texture] = digest(buffer.getvalue())
        finishes.append(asdict(replace(part.finish, texture=texture)))
        arrays |= {f"v{i}": part.vertices, f"f{i}": part.faces, f"n{i}": part.normals, f"t{i}": part.uv}
    with atomic_path(folder / f"{stem}.npz") as temporary:
        np.savez(temporary, allow_pickle=False, **arrays)
        sums[f"{stem}.npz"] = digest(temporary.read_bytes())
    write_json(folder / f"{stem}.json", {"finishes": finishes, "sha256": sums})


def _load(folder: Path, stem: str) -> tuple[MeshPart, ...] | None:
    """The cached parts, or None where a file is missing or does not match its checksum."""
    try:
        manifest = read_json(folder / f"{stem}.json")
        files = {name: (folder / name).read_bytes() for name in manifest["sha256"]}
        if any(digest(data) != manifest["sha256"][name] for name, data in files.items()):
            return None
        finishes = [_finish(row, folder) for row in manifest["finishes"]]
        with np.load(io.BytesIO(files[f"{stem}.npz"]), allow_pickle=False) as arrays:
            return tuple(
                MeshPart(arrays[f"v{i}"], arrays[f"f{i}"], arrays[f"n{i}"], arrays[f"t{i}"], finish)
                for i, finish in enumerate(finishes)
            )
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None


def _finish(row: dict, folder: Path) -> Finish:
    row = dict(row, color=tuple(row["color"]))
    if row["texture"] is not None:
        row["texture"] = str(folder / row["texture"])
    if row["emission"] is not None:
        row["emission"] = tuple(row["emission"])
    return Finish(**row)


def scaled(parts: tuple[MeshPart, ...], ratio: tuple[float, float, float]) -> tuple[MeshPart, ...]:
    """The parts stretched by `ratio` along x, y, z; faces, uv and finishes are shared."""
    if all(abs(r - 1.0) < 1e-6 for r in ratio):
        return parts
    s = np.array(ratio, dtype=np.float32)
    out = []
    for p in parts:
        n = p.normals / s
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-12)
        out.append(replace(p, vertices=p.vertices * s, normals=n.astype(np.float32)))
    return tuple(out)
