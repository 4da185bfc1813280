"""From a pack's model to MeshParts of real size, cached on disk under a checksum.

The models of Sweet Home 3D are y up with their front towards +z, of any unit: `modelRotation`
turns them, then the bounding box is stretched to the catalogue's width, height and depth, as
Sweet Home 3D does itself. The asset frame (embodied.assets.records.MeshPart) is (x, -z, y) of that.
"""

import functools
import io
import logging
import struct
import warnings
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path, PurePosixPath

import numpy as np
from PIL import Image, UnidentifiedImageError
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from embodied.assets.cache import atomic_path, digest, write_bytes, write_json
from embodied.assets.closure import code_digest
from embodied.assets.decoding import open_arrays
from embodied.assets.importing.looks import COVERS, FOLDED, corrected, cover_of, creased, finish_of, laid_on, picture
from embodied.assets.importing.meshing import CREASE, crease_normals, decimate, face_normals, indexed, sound_faces, weld
from embodied.assets.importing.obj import MaterialFaces, MeshError, MtlMaterial, Obj, libraries, parse_mtl, parse_obj
from embodied.assets.importing.rounding import FINE, folded, is_coarse, refined, rounded
from embodied.assets.importing.sh3f import Pack, PackError
from embodied.assets.importing.textures import cut, filled, palette, shrunk, tinted
from embodied.assets.json_file import from_plain, read_json
from embodied.assets.records import Finish, ImportRecipe, MeshPart, bounds

log = logging.getLogger(__name__)

READER = "embodied.assets.importing.own"
"""The module that imports models of all formats: its code is part of every cache key."""
APART = ("embodied.assets", "embodied.assets.data", "embodied.assets.importing")
"""Modules and data that the code of imported models does not count: packages' names, and the catalogue's rows, whose
recipes are in the keys."""
FORMATS = ("PNG", "JPEG", "BMP", "TGA")
"""Formats of textures. Pillow knows many more; some of them start other programs (PostScript)."""
MAX_TEXTURE = 512
MAX_PIXELS = 64_000_000
FACE_BUDGETS = ((0.3, 3_000), (0.8, 6_000), (30.0, 10_000))
"""Faces a model keeps, by its longest side in metres."""
ROUNDING = 0.5
"""Share of that budget by which rounding a model may exceed it."""
SOFT = ("cloth", "bedding", "leather", "terry")
SOFT_CREASE = np.radians(62.0)
"""Covers of what is padded, and the angle at which faces of those share a smooth normal: six faces make a round arm."""
HOLES = 2
"""Times the budget that the triangles of one part may be after the holes of its texture are cut."""
CLEAR = 0.3
"""A part that keeps texels fainter than this is blended, not masked: its opacity is the mean over them."""
NO_AREA = "its faces have no area: they are points or lines, or flattened by a scale of 0"
FOLDS = 9_000
"""Faces by which the bedding of a model may grow to hold its folds, each part by its area."""


Tell = Callable[[str], None]
"""Is told in words what a model asks for and does not get."""
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
    """The cover that it is given, folds alone where it has an image (embodied.assets.importing.looks)."""
    two_sided: bool = False
    """Seen from behind, too, where it is open."""
    least: float | None = 0.5
    """Opacity below which texels of the image are cut away; None for none."""


def import_model(pack: Pack, recipe: ImportRecipe, cache: Path) -> tuple[MeshPart, ...]:
    """The parts of a library's model, from the cache if it is there and sound."""
    model = pack.entries[recipe.model or recipe.key].model
    read = functools.partial(read_obj, pack.read, model, f"{pack.path.name}: {model}")
    return cached(recipe, pack.digest, cache, lambda tell: read(), quiet=True)  # the packs are reviewed


def cached(
    recipe: ImportRecipe, source: str, cache: Path, read: Callable[[Tell], tuple[RawPart, ...]], *, quiet: bool = False
) -> tuple[MeshPart, ...]:
    """The finished parts of `recipe`; `read` and the import run only when the cache lacks them. What they tell is
    logged each time, unless `quiet`.

    Args:
      source: digest of the pack or file that `read` reads.
    """
    folder = Path(cache) / "assets" / source[:16]
    facts = {k: v for k, v in asdict(recipe).items() if k != "model" or v}
    stem = recipe.key.replace("/", "__") + "-" + digest(code_digest(READER, without=APART), facts)[:12]
    parts = _load(folder, stem)
    if parts is None:
        messages: dict[str, None] = {}
        finished = finish_parts(read(messages.setdefault), recipe, messages.setdefault)
        _save(folder, stem, finished, list(messages))
        parts = _load(folder, stem)
    if parts is None:
        raise PackError(f"{folder / stem} cannot be read back after writing; check the disk and delete {folder}")
    for words in () if quiet else parts[1]:
        log.warning("model %s: %s", recipe.key, words)
    return parts[0]


def read_obj(
    read: Reader, name: str, where: str, remedy: str = "install the pack again", tell: Tell | None = None
) -> tuple[RawPart, ...]:
    """The parts of the OBJ file `name`, with its MTL and textures read by `read`.

    Args:
      remedy: what to do about a texture that cannot be read.
      tell: is told what the files ask for and do not get. None for the packs, which were reviewed without: colours of
        their materials and vertices then do not tint textures, and a material's texture is all or nothing.

    Raises:
      MeshError, PackError: damaged or missing files.
    """
    folder = PurePosixPath(name).parent
    obj = parse_obj(read(name), where)
    own, say = tell is not None, tell or (lambda words: None)
    materials: dict[str, MtlMaterial] = {}
    for statement in obj.libraries:
        whole, *several = (read_if_there(read, n) for n in _library_names(folder, statement))
        contents = [data for data in (several if whole is None else [whole]) if data is not None]
        if not contents:
            say(f"its material library {statement!r} is not there; put it beside the model")
        for data in contents:
            materials |= parse_mtl(data)
    for words in obj.left_out:
        say(words)
    pictures = _Pictures(read, folder, remedy, say)
    parts: list[RawPart] = []
    for group in obj.groups:
        material = materials.get(group.material)
        if material is None:
            if group.material:
                say(f"no library has its material {group.material!r}; it is drawn in grey")
            grey = (1.0,) * 3 if own and obj.colours is not None else MtlMaterial("").diffuse
            material = MtlMaterial(group.material, diffuse=(grey[0], grey[1], grey[2]))
        _tell_of(material, say)
        image = pictures.of(material)
        there = np.asarray((group.uv_corners >= 0).all(axis=1))
        if own and image is not None and not there.all():
            say(f"some faces of material {material.name!r} have no texture coordinates; they have the mean colour")
        if not own and not there.all():
            there[:] = False
        for chosen in (there, ~there):
            if chosen.any() or not len(chosen):
                parts.append(_obj_part(obj, group, chosen, material, image, own))
    return tuple(parts)


def _obj_part(
    obj: Obj, group: MaterialFaces, chosen: np.ndarray, material: MtlMaterial, image: Image.Image | None, own: bool
) -> RawPart:
    """Those faces of a group that all have texture coordinates, or none."""
    corners, uv = group.corners[chosen], None
    shades = np.broadcast_to(material.diffuse, (len(corners), 3))
    if own and obj.colours is not None:
        shades = shades * obj.colours[corners].mean(axis=1)
    if image is not None and material.texture is not None and (group.uv_corners[chosen] >= 0).all():
        uv = obj.uvs[group.uv_corners[chosen]] * material.texture.scale + material.texture.shift
        if material.texture.clamped:
            uv = np.clip(uv, 0.5 / np.array(image.size), 1 - 0.5 / np.array(image.size))
        if own and shades.mean() > 0:  # black beside a texture is what exporters write for "see there"
            image = tinted(image, shades.mean(axis=0), linear=False)
    elif image is not None and own:
        shades, image = shades * np.asarray(image.convert("RGB"), float).reshape(-1, 3).mean(0) / 255, None
    else:
        image = None
    if image is None and own and len(shades) and np.ptp(shades, axis=0).max() > 1 / 255:
        image, uv = palette(shades)
    red, green, blue = (float(c) for c in (shades.mean(axis=0) if own and len(shades) else material.diffuse))
    finish = finish_of(replace(material, diffuse=(red, green, blue)), image is not None)
    return RawPart(group.material, obj.vertices, corners, uv, finish, image)


def _tell_of(material: MtlMaterial, say: Tell) -> None:
    if material.dissolve is None and material.transparency is not None and material.transparency >= 1:
        say(f"material {material.name!r} has Tr 1, which means fully clear; it is taken for opaque, write d to be sure")
    if any(material.emission):
        say(f"material {material.name!r} does not glow by its Ke; name it in 'glow', and its light in 'emits'")
    for statement in dict.fromkeys(material.unread):
        say(f"the {statement} of material {material.name!r} is not drawn")


class _Pictures:
    """The textures of one OBJ file, each opened once."""

    def __init__(self, read: Reader, folder: PurePosixPath, remedy: str, say: Tell) -> None:
        self._read, self._folder, self._remedy, self._say = read, folder, remedy, say
        self._held: dict[object, Image.Image | None] = {}

    def of(self, material: MtlMaterial) -> Image.Image | None:
        """The colours of a material's texture, and its opacity map as their transparency; None for none."""
        if material.texture is None:
            if material.opacity_map is not None:
                self._say(f"the map_d of material {material.name!r} is not drawn without a map_Kd")
            return None
        key = material.texture.name, material.opacity_map
        if key not in self._held:
            image = self._open(material.texture.name)
            if image is not None and material.opacity_map is not None:
                opacity = self._open(material.opacity_map.name)
                if opacity is not None:
                    grey = opacity.getchannel("A") if opacity.mode == "RGBA" else opacity.convert("L")
                    image = image.convert("RGB")
                    image.putalpha(grey.resize(image.size))
            self._held[key] = image
        return self._held[key]

    def _open(self, name: str) -> Image.Image | None:
        if name not in self._held:
            self._held[name] = image = _image(self._read, _texture_name(self._folder, name), self._remedy)
            if image is None:
                self._say(f"its texture {name!r} is not there; put it beside the model")
            elif image.mode == "RGBA" and not image.getchannel("A").getbbox():
                self._say(f"the alpha channel of texture {name!r} is 0 everywhere; it is drawn opaque")
                self._held[name] = image.convert("RGB")
        return self._held[name]


def obj_files(read: Reader, name: str) -> tuple[str, ...]:
    """The MTL files and textures that the OBJ file `name` names, whether they are there or not."""
    folder, files = PurePosixPath(name).parent, []
    for statement in libraries(read(name)):
        for library in _library_names(folder, statement):
            files.append(library)
            for m in parse_mtl(read_if_there(read, library) or b"").values():
                files += [_texture_name(folder, t.name) for t in (m.texture, m.opacity_map) if t is not None]
    return tuple(dict.fromkeys(files))


def _library_names(folder: PurePosixPath, statement: str) -> tuple[str, ...]:
    """The files that an mtllib statement may mean: one whose name has blanks, or several."""
    return tuple(dict.fromkeys(_texture_name(folder, n.strip('"')) for n in (statement, *statement.split())))


def _texture_name(folder: PurePosixPath, texture: str) -> str:
    return str(folder / texture.replace("\\", "/"))


def read_if_there(read: Reader, name: str) -> bytes | None:
    """The bytes of a file that models may do without; None where it is lost."""
    try:
        return read(name)
    except (PackError, FileNotFoundError):
        return None


def finish_parts(
    raw: tuple[RawPart, ...], recipe: ImportRecipe, tell: Tell = lambda words: None
) -> list[tuple[MeshPart, Image.Image | None]]:
    """Sized, turned, welded, decimated, cut and shaded parts with their texture images.

    Args:
      tell: is told what of the model is not drawn as it says.

    Raises:
      MeshError: nothing is left, or numbers are not finite.
    """
    budget = recipe.faces or next(n for side, n in FACE_BUDGETS if max(recipe.size) <= side)
    names = {p.name for p in raw}
    corrected_names = {*dict(recipe.looks), *recipe.dropped, *recipe.flipped, *recipe.glow, *recipe.two_sided} - {"*"}
    if unknown := sorted(corrected_names - names):
        tell(f"its row names the materials {unknown}, which it lacks; it has {sorted(names)}")
    left_out: list[str] = []
    raw = tuple(_drawn(raw, recipe, HOLES * budget, tell, left_out))
    if not raw:
        raise MeshError(f"{recipe.key} has nothing to draw: {'; '.join(left_out[:3]) or 'all of it is dropped'}")
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
        else:
            tell(f"material {part.name!r} is left out: {NO_AREA}")
    if not prepared:
        raise MeshError(f"{recipe.key} has nothing to draw: {NO_AREA}")
    total = sum(len(f) for _, _, f, _ in prepared)
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
        if part.two_sided and not sheet:
            faces, uv, back = _turned_out(points, faces, uv)
        else:
            back = np.full(len(faces), sheet)
        if back.any():
            behind = np.ascontiguousarray(faces[back][:, ::-1])
            out.append(_part(part, points, behind, None if uv is None else uv[back][:, ::-1], recipe))
        out.append(_part(part, points, faces, uv, recipe))
    return _to_size(out, recipe.size)


def _drawn(
    raw: tuple[RawPart, ...], recipe: ImportRecipe, room: int, tell: Tell, left_out: list[str]
) -> Iterator[RawPart]:
    """The parts that have something to draw, looking as the recipe says; why others have nothing goes to `left_out`."""
    for part in raw:
        if part.name in recipe.dropped:
            continue
        why = NO_AREA
        if _has_area(part):
            part = _cut(_looking(part, dict(recipe.looks)), room, tell)
            why = "its texture is transparent everywhere; correct its alpha channel or map_d"
        if len(part.faces) and _has_area(part):
            yield part
        else:
            left_out.append(f"material {part.name!r} is left out: {why}")
            tell(left_out[-1])


def _has_area(part: RawPart) -> bool:
    """True if any face is more than a point or a line."""
    doubled = np.linalg.norm(face_normals(part.vertices, part.faces), axis=1)
    sides = part.vertices[part.faces] - part.vertices[np.roll(part.faces, 1, axis=1)]
    return bool((doubled > 1e-6 * np.square(sides).sum(axis=2).max(axis=1)).any())


def _cut(part: RawPart, room: int, tell: Tell) -> RawPart:
    """The part without what its texture's transparency takes away, the texture without transparency."""
    image, least, finish = part.image, part.least, part.finish
    if image is None or part.uv is None or image.mode != "RGBA":
        return part
    vertices, faces, uv = part.vertices, part.faces, part.uv
    if least is not None:
        made = cut(vertices, faces, uv, image, least, room)
        if made is None:
            tell(f"the holes in the texture of material {part.name!r} are too fine to be cut; it is drawn without them")
        else:
            vertices, faces, uv = made
        alpha = np.asarray(image.getchannel("A")) / 255.0
        seen = alpha[alpha >= least]
        if least < CLEAR and len(seen) and seen.mean() < 0.95:
            finish = replace(finish, color=(*finish.color[:3], round(finish.color[3] * float(seen.mean()), 4)))
    image = filled(image, least or 0.0)
    return replace(part, vertices=vertices, faces=faces, uv=uv, image=image, finish=finish)


def _turned_out(
    points: np.ndarray, faces: np.ndarray, uv: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
    """The faces of a part that its maker calls two-sided: of closed pieces, those wound inside out are turned; of
    open ones, (m,) bool says that they need a back."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, which, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    n = len(faces)
    meets = np.repeat(np.arange(n), 3), n + faces.reshape(-1)  # faces and vertices as nodes of one graph
    links = coo_matrix((np.ones(3 * n), meets), shape=(n + len(points),) * 2)
    piece = connected_components(links, directed=False)[1][:n]
    rim = (counts[which.reshape(-1)].reshape(-1, 3) != 2).any(axis=1)
    is_open = np.zeros(piece.max() + 1, bool)
    is_open[piece[rim]] = True
    volume = np.bincount(piece, np.linalg.det(points[faces] - points[faces].reshape(-1, 3).mean(axis=0)))
    inside_out = (~is_open & (volume < 0))[piece]
    faces = np.where(inside_out[:, None], faces[:, ::-1], faces)
    if uv is not None:
        uv = np.where(inside_out[:, None, None], uv[:, ::-1], uv)
    return faces, uv, is_open[piece]


def _area(points: np.ndarray, faces: np.ndarray) -> float:
    return float(np.linalg.norm(face_normals(points, faces), axis=1).sum()) / 2


def _crease(part: RawPart) -> float:
    return SOFT_CREASE if part.cover in SOFT else CREASE


def _looking(part: RawPart, looks: dict[str, str]) -> RawPart:
    look = looks.get(part.name, "")
    finish, keep = corrected(part.finish, look)
    textured = keep and part.image is not None
    clear = finish.color[3] < 0.9 or finish.metallic > 0.5 or finish.mirror
    cover = cover_of(part.name, finish.color, look, textured=textured, clear=clear)
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
    angle = np.radians(recipe.yaw)
    c, s = np.round(np.cos(angle), 12), np.round(np.sin(angle), 12)
    spin = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    upright = [(v - low)[:, [0, 2, 1]] * [1.0, -1.0, 1.0] @ spin for v in turned]
    used = np.concatenate([v[np.unique(p.faces)] for p, v in zip(raw, upright)])
    low, high = used.min(axis=0), used.max(axis=0)
    scale = np.array(recipe.size) / np.where(high - low > 1e-9, high - low, 1.0)
    return [(v - [*(low + high)[:2] / 2, low[2]]) * scale for v in upright]


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
    data = read_if_there(read, name)
    if data is None:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)
        try:
            with Image.open(io.BytesIO(data), formats=FORMATS) as opened:
                if opened.width * opened.height > MAX_PIXELS:
                    raise PackError(f"texture {name} has {opened.width} x {opened.height} pixels; make it smaller")
                return shrunk(opened, MAX_TEXTURE)
        except UnidentifiedImageError as e:
            raise PackError(f"texture {name} cannot be read: it is none of {', '.join(FORMATS)}; {remedy}") from e
        except PackError:
            raise
        except (OSError, SyntaxError, ValueError, struct.error, Image.DecompressionBombError) as e:
            raise PackError(f"texture {name} cannot be read ({e}); {remedy}") from e


def _save(folder: Path, stem: str, parts: list[tuple[MeshPart, Image.Image | None]], words: list[str]) -> None:
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
    write_json(folder / f"{stem}.json", {"finishes": finishes, "words": words, "sha256": sums})


def _load(folder: Path, stem: str) -> tuple[tuple[MeshPart, ...], list[str]] | None:
    """The cached parts and what they tell, or None where a file is missing or does not match its checksum."""
    try:
        manifest = read_json(folder / f"{stem}.json")
        files = {name: (folder / name).read_bytes() for name in manifest["sha256"]}
        if any(digest(data) != manifest["sha256"][name] for name, data in files.items()):
            return None
        read = (from_plain(Finish, row) for row in manifest["finishes"])
        finishes = [replace(f, texture=f.texture and str(folder / f.texture)) for f in read]
        with open_arrays(io.BytesIO(files[f"{stem}.npz"])) as arrays:
            parts = tuple(
                MeshPart(arrays[f"v{i}"], arrays[f"f{i}"], arrays[f"n{i}"], arrays[f"t{i}"], finish)
                for i, finish in enumerate(finishes)
            )
        return parts, [str(words) for words in manifest["words"]]
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None


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
