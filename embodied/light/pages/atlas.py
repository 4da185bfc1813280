"""The atlas of a house: which page holds whose light, what lies under every texel, and the meshes that wear it.

A page is one texture. Things of one room that want the same fineness share pages; every owner
keeps its own triangles, so that instance ids and culling by room go on working.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from embodied.assets.records import DETAILS, Finish, MeshPart
from embodied.geometry import rotation
from embodied.light.pages.unwrap import Unwrapped, areas_of, cached_model, pack, told_apart, unwrap_planes
from embodied.light.settings import LightSettings
from embodied.scene.lit_pages import LitMesh

SHELL = ("wall", "floor", "ceiling")
FINEST = 8
"""Texels per luxel at most."""


PRINT_AREA, PRINT_THICKNESS = 1.5, 0.06
"""The most that prints measure, patterned things that are looked at as pictures are, such as posters and books: square
metres of a side, and metres along the world's axis that is nearest to none."""


@dataclass(frozen=True, eq=False)
class UnwrappedThing:
    """Everything of one owner, unwrapped, in world coordinates."""

    owner: str
    room: str
    kind: str
    flat: Unwrapped
    finishes: tuple[Finish, ...]
    """Indexed by `flat.part`."""
    fineness: int
    """Texels per luxel along each axis."""
    glass: bool
    """Lets light through and is drawn see-through."""
    person: bool
    """Is part of a person, whose skin and cloth meet in folds."""


@dataclass(frozen=True, eq=False)
class Page:
    """One texture and the triangles that wear it; m faces."""

    width: int
    """Luxels."""
    height: int
    fineness: int
    glass: bool
    corners: np.ndarray
    """(m, 3, 3) float32, metres, world."""
    normals: np.ndarray
    """(m, 3, 3) float32."""
    luxels: np.ndarray
    """(m, 3, 2) float32, position on the page in luxels."""
    uv: np.ndarray
    thin: np.ndarray
    finish: np.ndarray
    """(m,) int32 into `finishes`."""
    finishes: tuple[Finish, ...]
    owner: np.ndarray
    """(m,) int32 into `Atlas.owners`."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """All pages of a house, and who its faces belong to."""

    pages: tuple[Page, ...]
    owners: tuple[str, ...]
    rooms: tuple[str, ...]
    """Room of each owner."""
    kinds: tuple[str, ...]
    people: tuple[bool, ...]
    """True for each owner that is a person."""


def things_of(
    parts: Sequence, settings: LightSettings, cache: Path, progress: Callable[[int, int], None] = lambda i, n: None
) -> tuple[UnwrappedThing, ...]:
    """Group parts by owner and unwrap each; furniture from the cache.

    Args:
      parts: embodied.scene.house_meshes.Part of one house; kind 'outdoor' must be left out.
    """
    groups: dict[tuple, list] = {}
    for p in parts:
        glass, face = p.mesh.finish.color[3] < 0.9, p.mesh_key.startswith("people/") and _is_face(p.mesh.uv)
        groups.setdefault((p.owner, p.room, p.kind, glass, face, p.position, p.yaw), []).append(p)
    things = []
    for done, ((owner, room, kind, glass, face, position, yaw), thing_parts) in enumerate(groups.items()):
        progress(done, len(groups))
        meshes: list[MeshPart] = [p.mesh for p in thing_parts]
        person = thing_parts[0].mesh_key.startswith("people/")
        if kind in SHELL:
            flat = unwrap_planes(meshes, settings.density)
        else:
            luxels = settings.budget * (2 if person and not face else 1)
            flat = cached_model(meshes, luxels, cache, trusted=kind == "opening", alone=kind == "outdoor")
        if len(flat.corners):
            flat = _placed(flat, position, yaw)
            finishes = tuple(m.finish for m in meshes)
            sharpness = settings.sharpness * (3 if face else 1)
            fineness = min(FINEST, _fineness(kind, flat, finishes, settings.density, sharpness))
            things.append(UnwrappedThing(owner, room, kind, flat, finishes, fineness, glass, person))
    return tuple(things)


def coarsened(things: Sequence[UnwrappedThing], most: float) -> tuple[UnwrappedThing, ...]:
    """The same things with at most `most` texels, if it takes no more than this: the largest floors lose a fifth of
    their fineness first, then the largest patterned pieces a quarter. Mirrors (over 5 texels per luxel) stay sharp."""
    out = list(things)
    texels = lambda t: int(t.flat.size.prod()) * t.fineness**2
    total = sum(map(texels, out))
    for finest in (5, 4):
        for i in sorted((i for i, t in enumerate(out) if t.fineness == finest), key=lambda i: -texels(out[i])):
            if total <= most:
                return tuple(out)
            coarse = replace(out[i], fineness=finest - 1)
            total -= texels(out[i]) - texels(coarse)
            out[i] = coarse
    return tuple(out)


def atlas_of(things: Sequence[UnwrappedThing], widest: int = 4096, most: int = 3_000_000) -> Atlas:
    """Lay the things of a house out on pages, by room and fineness.

    Args:
      widest: a page's largest side in texels.
      most: texels that a page may have, if one thing alone does not need more; composing a page takes 150 bytes for
      each.
    """
    owners = tuple(dict.fromkeys(t.owner for t in things))
    number = {o: i for i, o in enumerate(owners)}
    first = {t.owner: t for t in reversed(things)}
    shelves: dict[tuple, list[UnwrappedThing]] = {}
    for t in things:
        shelves.setdefault((t.room, t.fineness, t.glass), []).append(t)
    pages = []
    for (_, fineness, glass), shelf in shelves.items():
        limit = widest // fineness
        while shelf:
            whole = min(sum(int(t.flat.size.prod()) for t in shelf), most / fineness**2)
            sizes = np.array([t.flat.size for t in shelf])
            widths = [int(min(limit, max(128, x * np.sqrt(whole)))) for x in (0.8, 0.9, 1.0, 1.05, 1.1, 1.2, 1.35, 1.5)]
            width, (places, _) = min(((w, pack(sizes, w)) for w in widths), key=lambda x: int(x[1][1].prod()))
            tall = min(limit, max(most / fineness**2 / width, max(int(t.flat.size[1]) for t in shelf)))
            inside = [bool(y + t.flat.size[1] <= tall) for t, (_, y) in zip(shelf, places)]
            if not any(inside):
                raise ValueError(
                    f"{shelf[0].owner!r} needs an atlas of {shelf[0].flat.size} luxels, over {limit}; lower the density"
                )
            pages.append(_page([t for t, ok in zip(shelf, inside) if ok], places[inside], fineness, glass, number))
            shelf = [t for t, ok in zip(shelf, inside) if not ok]
    room, kind, person = (tuple(getattr(first[o], x) for o in owners) for x in ("room", "kind", "person"))
    return Atlas(tuple(pages), owners, room, kind, person)


def _placed(flat: Unwrapped, position: Sequence[float], yaw: float) -> Unwrapped:
    turn = np.eye(3)
    turn[:2, :2] = rotation(yaw)
    corners = flat.corners.astype(np.float64) @ turn.T + np.asarray(position, float)
    return replace(flat, corners=corners.astype(np.float32), normals=(flat.normals @ turn.T.astype(np.float32)))


def _fineness(kind: str, flat: Unwrapped, finishes: Sequence[Finish], density: float, sharpness: float) -> int:
    """Texels per luxel: as many as patterns and mirrors need to stay sharp, 2 for what is plain, 1 where luxels are
    small.

    Floors get 200 texels per metre, patterned walls and ceilings 120 and 80, patterned furniture 180 where
    its luxels are not too coarse, prints twice that, mirrors 400; all times `sharpness`.
    """
    used = np.bincount(flat.part, weights=areas_of(flat.corners), minlength=len(finishes))
    patterned = sum(a for a, f in zip(used, finishes) if f.texture) > 0.15 * used.sum()
    if kind in SHELL:
        return max(round({"floor": 200, "wall": 120, "ceiling": 80}[kind] * sharpness / density), 2) if patterned else 2
    side = np.sqrt(flat_areas(flat.luxels).sum() / used.sum())
    if sum(a for a, f in zip(used, finishes) if f.mirror) > 0.15 * used.sum():
        return int(np.clip(round(400 * sharpness / side), 2, 8))
    least = 1 if side > 80 * sharpness else 2
    if not patterned:
        return least
    is_print = used.sum() < 2 * PRINT_AREA and np.ptp(flat.corners.reshape(-1, 3), axis=0).min() < PRINT_THICKNESS
    most = max(8 if is_print else 4, round(160 * sharpness / density))
    return int(np.clip(round((360 if is_print else 180) * sharpness / side), least, most))


def flat_areas(corners: np.ndarray) -> np.ndarray:
    """(m,) areas of triangles (m, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _is_face(uv: np.ndarray) -> bool:
    """True for a person's skin and eyes, which wear one picture; they have luxels of their own and finer texels."""
    return bool(uv.min() >= 0.0 and uv.max() <= 1.0)


def _page(
    things: Sequence[UnwrappedThing], places: np.ndarray, fineness: int, glass: bool, number: dict[str, int]
) -> Page:
    finishes: dict[Finish, int] = {}
    which, owner, luxels = [], [], []
    for t, place in zip(things, places):
        local = [finishes.setdefault(f, len(finishes)) for f in t.finishes]
        which.append(np.array(local, np.int32)[t.flat.part])
        owner.append(np.full(len(t.flat.part), number[t.owner], np.int32))
        luxels.append(t.flat.luxels + place.astype(np.float32))
    join = lambda name: np.concatenate([getattr(t.flat, name) for t in things])
    width = max(int(x + t.flat.size[0]) for t, (x, _) in zip(things, places))
    height = max(int(y + t.flat.size[1]) for t, (_, y) in zip(things, places))
    return Page(
        width,
        height,
        fineness,
        glass,
        join("corners"),
        join("normals"),
        np.concatenate(luxels),
        join("uv"),
        join("thin"),
        np.concatenate(which),
        tuple(finishes),
        np.concatenate(owner),
    )


def meshes_of(atlas: Atlas, first: int) -> tuple[list[LitMesh], list[np.ndarray]]:
    """One mesh per owner and page, corners welded, thin faces listed twice, and the gloss of its faces.

    Args:
      first: number of the atlas's first page.

    Returns:
      Meshes, and for each (m, 4) uint8: roughness, specular and metallic times 255, and detail (see gloss_of and
      detail_of).
    """
    out, shine = [], []
    for number, page in enumerate(atlas.pages, first):
        uv = page.luxels / np.array([page.width, page.height], np.float32)
        gloss = np.array([gloss_of(f) for f in page.finishes], np.uint8).reshape(-1, 3)
        kinds, areas = np.column_stack([gloss[page.finish], detail_of(page)]), areas_of(page.corners)
        for o in np.unique(page.owner):
            owned = np.nonzero(page.owner == o)[0]
            both = np.concatenate([page.corners[owned], uv[owned]], axis=-1).reshape(-1, 5)
            corner, index = welded(np.round(both, 5))
            faces = index.reshape(-1, 3).astype(np.int32)
            thin = page.thin[owned]
            faces = np.concatenate([faces, faces[thin][:, ::-1]])
            real = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
            alphas = [page.finishes[k].color[3] for k in np.unique(page.finish[owned])]
            alpha = min(alphas) if page.glass else 1.0
            kind, area = kinds[owned], areas[owned]
            mean = tuple(((kind[:, :2] * area[:, None]).sum(0) / max(area.sum(), 1e-12) / 255).round(3).tolist())
            whose = atlas.owners[o], atlas.kinds[o], atlas.rooms[o]
            xyz, at = both[corner, :3].astype(np.float32), both[corner, 3:].astype(np.float32)
            out.append(LitMesh(*whose, number, xyz, faces[real], at, float(alpha), mean))
            shine.append(np.concatenate([kind, kind[thin]])[real])
    return out, shine


def welded(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,) first occurrence of each different row of (n, c) numbers, in no order, and (n,) which of these each row is.

    Rows are sorted by a hash (odd multiplier and shifts, as in SplitMix64): one sort in place of one for each column.
    Should two different rows have one hash, some row may occur twice among the k.
    """
    mixed = np.zeros(len(rows), np.uint64)
    for column in (rows.astype(np.float64) + 0.0).view(np.uint64).T:  # + 0.0: -0 is 0
        mixed = (mixed ^ column) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return told_apart(rows, np.argsort(mixed, kind="stable"))


def gloss_of(finish: Finish) -> tuple[int, int, int]:
    """Roughness, specular and metallic times 255; a mirror is smooth metal."""
    if finish.mirror:
        return 4, 255, 255
    rough, specular, metal = (min(max(x, 0.0), 1.0) for x in (finish.roughness, finish.specular, finish.metallic))
    return round(255 * rough), round(255 * specular), round(255 * metal)


def detail_of(page: Page) -> np.ndarray:
    """(m,) uint8 of the faces: number of what they show from nearby, from 1 on, and 16 times that of the axis along
    which their texture's u runs, 3 for none; 0 for smooth ones."""
    number = np.array([1 + DETAILS.index(f.detail) if f.detail else 0 for f in page.finishes], np.uint8)
    corners, uv = page.corners, page.uv.astype(np.float64)
    sides, turns = corners[:, 1:] - corners[:, :1], uv[:, 1:] - uv[:, :1]
    area = turns[:, 0, 0] * turns[:, 1, 1] - turns[:, 0, 1] * turns[:, 1, 0]
    along = sides[:, 0] * turns[:, 1, 1, None] - sides[:, 1] * turns[:, 0, 1, None]
    axis = np.where(np.abs(area) > 1e-12, np.abs(along).argmax(1), 3)
    detail = number[page.finish]
    return np.where(detail > 0, detail + 16 * axis, 0).astype(np.uint8)
