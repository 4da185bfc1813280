"""House to MjSpec to MjModel: the only translation. Every geom knows whose it is.

Visual geoms are in group 2 and touch nothing, the coarser copies that a renderer has of people in groups 1 and 0;
collision boxes are in group 3 and are not drawn.
"""

from __future__ import annotations

import ctypes
import dataclasses
import functools
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from embodied import gl
from embodied.assets.decoding import read_picture

gl.prepare()

import cv2
import mujoco
import numpy as np
from scipy.spatial import cKDTree

from embodied.assets.moving_parts import closed
from embodied.assets.records import Finish, MeshPart
from embodied.house.house import House, Placement
from embodied.house.moment import RigidPose
from embodied.scene import backdrop, collision, cupboards, doors, far_canvas, stairs
from embodied.scene.cupboards import Case
from embodied.scene.doors import Hung
from embodied.scene.house_meshes import Part, coarser_people, house_parts, owners
from embodied.scene.landscapes import scenery_of
from embodied.scene.lit_pages import LitMesh, LitPages
from embodied.scene.roof import ceiling_boxes
from embodied.scene.shell import shell_parts

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

VISUAL, COLLISION = 2, 3
"""Geom groups."""
TEXTURE_SIZE = 512
"""Largest side of a texture in pixels; larger ones are shrunk when loaded."""
DECODERS = 4
"""Threads that decode textures."""
PIECES = 24
"""Directions by which the outdoors of a lit house are cut up."""
PROBE_LIT = "lit_by_probes"
"""Material of a lit house for the bodies that are added to it: they shine in the colour of their light
(embodied.light.viewer)."""
INSIDE_DIM = (0.4, 0.5, 0.6)
"""Brightness of insides in a lit house, where no probes light them, of what looks along x, y and z."""
OFFSCREEN = 1024
"""Side of the off-screen buffer: the largest picture, pixels."""
LOOSE = ("floor", "against_wall", "corner", "surface")
"""Supports under which a freed object can move; what hangs on walls and ceilings stays fixed."""
SMALL = 0.5
"""Longest side of what a hand can take, metres."""
LEAVES = ("/leaf", "/leaf_2", "/glass")
"""Ends of the owners of what closes an opening."""
HOLLOW = ("person",)
"""Classes whose models are shells with gaps, through which one would see what stands behind them. Drawn from both sides
here instead of by `two_sided` of their import, which would double what is baked of them."""
YIELDING = ("curtain",)
"""Classes that give way to doors on hinges."""
UNDERFOOT = 0.03
"""Things on the floor that are lower than this (rugs, mats) are cloth to walk on and stop nothing, metres."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A compiled house."""

    model: mujoco.MjModel
    owners: tuple[str, ...]
    """parts.owners(house): instance id i + 1 belongs to owners[i]."""
    owner_of_geom: np.ndarray
    """(ngeom,) int32 instance id of every geom; 0 for geoms that nobody owns."""
    kind_of_geom: tuple[str, ...]
    """Part.kind of every geom; 'collision' for collision boxes and coarser copies."""
    room_of_geom: tuple[str, ...]
    """Part.room of every geom; '' for the outdoors and for collision boxes of the shell."""


def compile_scene(house: House, catalogue: Catalogue, *, collisions: bool = True, lit: LitPages | None = None) -> Scene:
    """Build and compile `house`.

    Args:
      collisions: False leaves the collision boxes out, which a renderer does not need.
      lit: draw these pages instead of the house's own materials.
    """
    parts = (*house_parts(house, catalogue), *coarser_people(house, catalogue)) if lit is None else ()
    spec = build_spec(house, catalogue, collisions=collisions, lit=lit, parts=parts)
    model, names = compile_spec(spec), owners(house)
    del spec
    give_memory_back()
    number = {name: i + 1 for i, name in enumerate(names)}
    labels = {p.owner: (p.kind, p.room) for p in (parts if lit is None else lit.meshes)}
    owned, kinds, rooms = np.zeros(model.ngeom, np.int32), [], []
    for g in range(model.ngeom):
        owner = owner_of_name(model.geom(g).name)
        owned[g] = number.get(owner, 0)
        kind, room = labels.get(owner, ("outdoor", ""))
        kinds.append(kind if model.geom_group[g] == VISUAL else "collision")
        rooms.append(room)
    return Scene(model, names, owned, tuple(kinds), tuple(rooms))


def compile_spec(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile, without MuJoCo's asset cache: it would keep half a gigabyte of the meshes of houses long gone."""
    mujoco.mj_setCacheCapacity(mujoco.mj_getCache(), 0)
    return spec.compile()


def give_memory_back() -> None:
    """Return freed memory to the system where the C library can: compiling frees about a kilobyte per triangle."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def owner_of_name(geom: str) -> str:
    """The owner in a geom's name: '<owner>#<number>' or '<owner>#box<number>'."""
    return geom.rpartition("#")[0]


def loose(house: House, catalogue: Catalogue) -> frozenset[str]:
    """The placements that physics can move: all that stand or lie, not what is fixed to the house or underfoot."""
    floors = {r.id: house.storey_of(r).elevation for r in house.rooms}
    return frozenset(
        p.id
        for p in house.placements
        if catalogue.assets[p.asset].support in LOOSE
        and not is_underfoot(p)
        and (p.parent is not None or p.position[2] <= floors[p.room] + UNDERFOOT)  # else it is fixed to a wall
    )


def takeable(house: House, catalogue: Catalogue) -> frozenset[str]:
    """Those of them that a hand can take: no larger than SMALL, not plugged in, and nothing rests on them."""
    carry = {p.parent for p in house.placements} | {light.placement for light in house.lights}
    sizes = {p.id: max(p.size) for p in house.placements}
    return frozenset(i for i in loose(house, catalogue) if sizes[i] <= SMALL and i not in carry)


def is_underfoot(p: Placement) -> bool:
    """True if one walks over it: a rug, a mat."""
    return p.parent is None and p.size[2] < UNDERFOOT


def build_spec(
    house: House,
    catalogue: Catalogue,
    *,
    free: frozenset[str] = frozenset(),
    collisions: bool = True,
    lit: LitPages | None = None,
    parts: Sequence[Part] | None = None,
    hinged: bool = False,
    contents: Sequence[Placement] = (),
) -> mujoco.MjSpec:
    """The house as an MjSpec.

    Args:
      free: ids of the placements that physics may move; see `loose`.
      collisions, lit: as for `compile_scene`.
      hinged: doors turn on hinges, and what furniture has moves (embodied.scene.doors, cupboards); fixed without.
      parts: house_parts(house, catalogue) where the caller has them already.
      contents: what lies in closed furniture that is hinged (embodied.house.contents).

    Raises:
      ValueError: `free` names something that is no placement; `lit` was baked for another house.
    """
    if unknown := sorted(free - set(house.placement_by_id)):
        raise ValueError(f"free names {unknown}, which are no placements of house {house.name!r}")
    if lit is not None and lit.owners and lit.owners != owners(house):
        raise ValueError(f"this light was baked for another house than {house.name!r}; bake it again (embodied light)")
    spec = _empty_spec(house)
    if free or hinged:
        _let_move(spec)
    shell = parts or (shell_parts(house, catalogue.finish, hinged) if hinged or collisions else ())
    hung = doors.hang(spec, house, shell) if hinged else {}
    cases = cupboards.hang(spec, house, catalogue, free) if hinged else {}
    lying = list(cupboards.lying(cases, contents, catalogue))
    bodies = {p: Hung(_free_body(spec, house.placement_by_id[p]), (0.0, 0.0, 0.0)) for p in sorted(free)}
    if lit is None:
        _light(spec)
        _add_sky(spec, house, getattr(catalogue, "cache", None))
        parts = house_parts(house, catalogue, hinged) if parts is None else parts
        own = lambda p: bodies.get(p.owner) or (hung.get((p.owner, p.position)) if doors.is_leaf(p) else None)
        carried = [(p, own(p)) for p in parts if p.owner not in cases]
        _add_parts(spec, [*carried, *(x for case in cases.values() if parts for x in cupboards.parts_of(case)), *lying])
    else:
        spec.visual.headlight.active = 0
        spec.add_material(name=PROBE_LIT, emission=1.0, specular=0.0, shininess=0.0)
        frames: dict[str, list[tuple[Part | Placement, Hung | None]]] = {}
        for p in shell if hung else ():
            frames.setdefault(p.owner, []).append((p, hung.get((p.owner, p.position)) if doors.is_leaf(p) else None))
        frames |= {p: [(house.placement_by_id[p], body)] for p, body in bodies.items()}
        _add_pages(spec, lit, house, lambda m: _lit_pieces(m, frames, cases))
        _add_insides(spec, cases, lying)
    if collisions:
        _add_collisions(spec, house, catalogue, bodies, cases, YIELDING if hung else ())
        roof = tuple(f"{o.id}/" for o in house.openings if o.kind == "roof_window")  # closed by ceiling_boxes
        _add_leaves(spec, [p for p in shell if not p.owner.startswith(roof)], hung)
    return spec


def _empty_spec(house: House) -> mujoco.MjSpec:
    spec = mujoco.MjSpec()
    spec.modelname = re.sub(r"\W+", "_", house.name) or "house"
    spec.compiler.usethread = True
    low, high = bounds_of(house)
    spec.stat.center = [*(low + high) / 2, 1.0]
    spec.stat.extent = float(np.linalg.norm(high - low))
    view = spec.visual
    view.global_.offwidth = view.global_.offheight = OFFSCREEN
    view.quality.shadowsize = 0
    view.quality.offsamples = 4
    view.map.znear, view.map.zfar = 0.02 / spec.stat.extent, 200.0 / spec.stat.extent
    return spec


def _let_move(spec: mujoco.MjSpec) -> None:
    """Options under which furniture stands still. A house in which nothing moves leaves them to whoever adds to it."""
    spec.option.timestep = 0.004
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP


def _light(spec: mujoco.MjSpec) -> None:
    """Soft light from all sides without shadows, the same for every camera: cube faces join."""
    head = spec.visual.headlight
    head.active, head.ambient, head.diffuse, head.specular = 1, [0.63, 0.62, 0.60], [0.0] * 3, [0.0] * 3
    kind = {"type": mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, "castshadow": False, "pos": [0, 0, 3]}
    for direction, strength in LIGHTS:
        colour = [strength, strength * 0.985, strength * 0.95]
        spec.worldbody.add_light(**kind, dir=direction, ambient=[0] * 3, diffuse=colour, specular=[0.1] * 3)


def _add_sky(spec: mujoco.MjSpec, house: House, cache: Path | None) -> None:
    """The far landscape on a dome, as lit houses have it; behind it a gradient, for who looks from beyond."""
    _add_picture(spec, "landscape", backdrop.kept_picture(scenery_of(house), house.seed, cache))
    vertices, faces, uv = far_canvas.dome(house)
    below = np.tile(np.array([0, 0, -1], np.float32), (len(vertices), 1))  # one normal, so that all of it is lit alike
    _add_mesh(spec, "landscape", vertices, below, uv, faces)
    _draw(spec.worldbody, f"{far_canvas.DOME}#0", "landscape", "landscape", (1, 1, 1, 1))
    kind = {"type": mujoco.mjtTexture.mjTEXTURE_SKYBOX, "builtin": mujoco.mjtBuiltin.mjBUILTIN_GRADIENT}
    spec.add_texture(name="sky", **kind, rgb1=[0.50, 0.68, 0.90], rgb2=[0.93, 0.95, 0.97], width=128, height=128)


LIGHTS = (((0.35, 0.5, -0.8), 0.34), ((-0.85, -0.5, 0.15), 0.30), ((0.0, 0.0, 1.0), 0.30))
"""Direction and strength of the fill lights: floor, ceiling and the four ways a wall can face."""


def _free_body(spec: mujoco.MjSpec, p: Placement) -> mujoco.MjsBody:
    body = spec.worldbody.add_body(name=p.id, pos=p.position, quat=yaw_quat(p.yaw))
    body.add_freejoint(name=p.id)
    return body


def yaw_quat(yaw: float, tilt: float = 0.0) -> list[float]:
    """w x y z of a turn about z, after one about x."""
    (c, s), (d, t) = ((math.cos(a / 2), math.sin(a / 2)) for a in (yaw, tilt))
    return [c * d, c * t, s * t, s * d]


def _add_parts(spec: mujoco.MjSpec, bodied: Sequence[tuple[Part, Hung | None]]) -> None:
    parts = [part for part, _ in bodied]
    meshes: dict[str, str] = {}
    looks = _Looks(spec, [p.mesh.finish.texture for p in parts if p.mesh.finish.texture])
    count: dict[str, int] = {}
    drawable: dict[str, bool] = {}
    for part, carrier in bodied:
        if part.mesh_key not in drawable:
            drawable[part.mesh_key] = _is_drawable(part.mesh)
        if not drawable[part.mesh_key]:
            continue
        if part.mesh_key not in meshes:
            meshes[part.mesh_key] = f"{len(meshes):04d}_{re.sub(r'[^A-Za-z0-9]+', '_', part.mesh_key)[:60]}"
            uv = part.mesh.uv * [1, -1] + [0, 1]
            _add_mesh(spec, meshes[part.mesh_key], part.mesh.vertices, part.mesh.normals, uv, part.mesh.faces)
        k = count[part.owner] = count.get(part.owner, -1) + 1
        material, rgba = looks.of(part.mesh.finish)
        pose = {"pos": part.position, "quat": yaw_quat(part.yaw)} if carrier is None else {"pos": carrier.origin}
        body = spec.worldbody if carrier is None else carrier.body
        group = VISUAL - part.detail
        _draw(body, f"{part.owner}#{k}", meshes[part.mesh_key], material, rgba, **pose, group=group)


def _draw(body: mujoco.MjsBody, name: str, mesh: str, material: str, rgba: Sequence[float], **pose: Any) -> None:
    """A visual geom: it touches nothing and weighs nothing."""
    kind = {"type": mujoco.mjtGeom.mjGEOM_MESH, "group": VISUAL, "contype": 0, "conaffinity": 0, "mass": 0}
    body.add_geom(name=name, **{**kind, **pose}, meshname=mesh, material=material, rgba=rgba)


def _is_drawable(mesh: MeshPart) -> bool:
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return bool(np.abs(normals).sum() > 1e-7)


def _add_mesh(
    spec: mujoco.MjSpec, name: str, vertices: np.ndarray, normals: np.ndarray | None, uv: np.ndarray, faces: np.ndarray
) -> None:
    """A mesh by way of MuJoCo's binary format, which is much faster than handing over lists."""
    if len(vertices) < 4:  # the format's least
        vertices, uv = (np.concatenate([a, a[-1:]]) for a in (vertices, uv))
        normals = None
    n = len(vertices)
    head = np.array([n, 0 if normals is None else n, n, len(faces)], np.int32)
    arrays = [vertices, *([] if normals is None else [normals]), uv]
    data = head.tobytes() + b"".join(np.ascontiguousarray(a, np.float32).tobytes() for a in arrays)
    data += np.ascontiguousarray(faces, np.int32).tobytes()
    spec.assets[f"{name}.msh"] = data
    spec.add_mesh(name=name, file=f"{name}.msh", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)


class _Looks:
    """Materials and textures of a spec, each made once. MuJoCo draws at most 1000 of either."""

    def __init__(self, spec: mujoco.MjSpec, textures: Sequence[str]) -> None:
        """`textures`: the files that will be needed; they are decoded side by side, which OpenCV allows."""
        self._spec = spec
        files = list(dict.fromkeys(textures))
        with ThreadPoolExecutor(DECODERS) as pool:
            self._images = dict(zip(files, pool.map(load_texture, files), strict=True))
        self._materials: dict[tuple, str] = {}
        self._textures: dict[str, str] = {}

    def of(self, finish: Finish) -> tuple[str, tuple[float, float, float, float]]:
        """Material name and geom colour for `finish`; untextured finishes share their materials."""
        gloss = round(float(np.clip((1 - finish.roughness) * finish.specular, 0, 1)), 1)
        glow = finish.emission is not None
        key = (finish.texture, gloss, glow, finish.metallic > 0.5)
        if key not in self._materials:
            name = self._materials[key] = f"material_{len(self._materials)}"
            shine = {"emission": 0.9 * glow, "specular": gloss, "shininess": max(0.05, 1 - finish.roughness)}
            rgba = [1, 1, 1, 1] if finish.texture else [0.5, 0.5, 0.5, 1]
            material = self._spec.add_material(name=name, rgba=rgba, **shine)
            if finish.texture:
                material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = self._texture(finish.texture)
        red, green, blue = (1.0 if finish.texture else float(c) for c in finish.color[:3])
        return self._materials[key], (red, green, blue, float(finish.color[3]))

    def _texture(self, path: str) -> str:
        if path not in self._textures:
            name = self._textures[path] = f"texture_{len(self._textures)}"
            add_texture(self._spec, name, self._images[path])
        return self._textures[path]


def add_texture(spec: mujoco.MjSpec, name: str, image: np.ndarray) -> None:
    """Add (h, w, 3 or 4) uint8 sRGB as a texture of `spec`. The colour space stays at MuJoCo's default:
    declared as sRGB it would be decoded by the classic renderer and never encoded again."""
    texture = spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, nchannel=image.shape[2])
    texture.height, texture.width = image.shape[:2]
    texture.data = np.ascontiguousarray(image).tobytes()


def _add_picture(spec: mujoco.MjSpec, name: str, image: np.ndarray, emission: float = 0.0) -> None:
    """A texture and a matt material of one name that shows it."""
    add_texture(spec, name, image)
    material = spec.add_material(name=name, rgba=[1, 1, 1, 1], emission=emission, specular=0.0, shininess=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name


@functools.lru_cache(maxsize=64)
def load_texture(path: str, largest: int = TEXTURE_SIZE) -> np.ndarray:
    """(h, w, 3) uint8 RGB, or (h, w, 4) where the picture has holes; at most `largest` pixels a side."""
    image = read_picture(path, cv2.IMREAD_UNCHANGED)
    if image is None:
        raise OSError(f"texture {path} is missing or damaged; delete {Path(path).parent}, it is made again")
    if image.ndim == 2:
        image = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    if image.dtype != np.uint8:
        image = (image / 257).astype(np.uint8)
    if (shrink := largest / max(image.shape[:2])) < 1:
        image = cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    if image.shape[2] == 4:
        return cv2.cvtColor(image, cv2.COLOR_BGRA2RGBA) if image[..., 3].min() < 250 else image[..., 2::-1].copy()
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def _add_pages(
    spec: mujoco.MjSpec, lit: LitPages, house: House, pieces: Callable[[LitMesh], Iterable[tuple[LitMesh, Hung | None]]]
) -> None:
    for i, page in enumerate(lit.pages):
        _add_picture(spec, f"page_{i}", page, emission=1.0)
    count: dict[str, int] = {}
    for i, whole in drawn_meshes(lit, house):
        for m, carrier in pieces(whole):
            k = count[m.owner] = count.get(m.owner, -1) + 1
            if not len(m.faces):
                continue
            name = f"{i:04d}_{k}_{re.sub(r'[^A-Za-z0-9]+', '_', m.owner)}"
            _add_mesh(spec, name, m.vertices, None, m.uv, m.faces)
            body, pose = (spec.worldbody, {}) if carrier is None else (carrier.body, {"pos": carrier.origin})
            _draw(body, f"{m.owner}#{k}", name, f"page_{m.page}", (1, 1, 1, m.alpha), **pose)


def _lit_pieces(
    m: LitMesh, frames: Mapping[str, Sequence[tuple[Part | Placement, Hung | None]]], cases: Mapping[str, Case]
) -> Iterable[tuple[LitMesh, Hung | None]]:
    """A lit mesh in the frames of the bodies that carry it: the frame of a window and its casements are one."""
    if m.owner in cases:
        yield from cupboards.lit_parts(m, cases[m.owner])
        return
    of = frames.get(m.owner, ())
    if all(carrier is None for _, carrier in of):
        yield m, None
        return
    poses, which = [RigidPose.upright(x.position, x.yaw) for x, _ in of], np.zeros(len(m.faces), int)
    if len(of) > 1:
        middles = [x.mesh.vertices[x.mesh.faces].mean(1) for x, _ in of if isinstance(x, Part)]
        there = np.concatenate([x @ pose.rotation.T + pose.position for x, pose in zip(middles, poses, strict=True)])
        near = cKDTree(there).query(m.vertices[m.faces].mean(1))[1]
        which = np.repeat(np.arange(len(of)), [len(x) for x in middles])[near]
    for k, ((_, carrier), pose) in enumerate(zip(of, poses, strict=True)):
        vertices = m.vertices if carrier is None else pose.local(m.vertices)
        yield dataclasses.replace(m, vertices=vertices, faces=m.faces[which == k]), carrier


def _add_insides(spec: mujoco.MjSpec, cases: Mapping[str, Case], lying: Sequence[tuple[Part, Hung]]) -> None:
    """Draw insides of closed furniture and what lies there, which were not lit, in a plain colour, as bodies added to a
    lit house."""
    hidden = (*(x for case in cases.values() for x in cupboards.parts_of(case, hidden=True)), *lying)
    for k, (part, carrier) in enumerate(hidden):
        mesh, finish = part.mesh, part.mesh.finish
        color = (
            load_texture(finish.texture)[..., :3].mean((0, 1)) / 255 if finish.texture else np.array(finish.color[:3])
        )
        corners = mesh.vertices[mesh.faces]
        way = np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).argmax(1)
        for axis in np.unique(way):
            if not _is_drawable(dataclasses.replace(mesh, faces=mesh.faces[way == axis])):
                continue  # slivers of what was cut
            name, rgba = f"inside_{k}_{axis}", (*(INSIDE_DIM[axis] * color).tolist(), float(finish.color[3]))
            _add_mesh(spec, name, mesh.vertices, mesh.normals, mesh.uv, mesh.faces[way == axis])
            _draw(carrier.body, f"{part.owner}#{name}", name, PROBE_LIT, rgba, pos=carrier.origin)


def drawn_meshes(lit: LitPages, house: House, twice: bool = True) -> Iterator[tuple[int, LitMesh]]:
    """The meshes of a lit house as they are drawn, each with its number in LitPages.meshes: those of HOLLOW things
    with their backs, unless not `twice`; what stands around the house in pieces, of which a window shows few."""
    hollow = hollow_things(house) if twice else ()
    low, high = bounds_of(house)
    for i, mesh in enumerate(lit.meshes):
        for vertices, uv, faces in _pieces(mesh, (low + high) / 2):
            if mesh.owner in hollow:
                faces = np.concatenate([faces, faces[:, ::-1] + len(vertices)])
                vertices, uv = np.concatenate([vertices, vertices]), np.concatenate([uv, uv])
            yield i, dataclasses.replace(mesh, vertices=vertices, uv=uv, faces=faces)


def hollow_things(house: House) -> frozenset[str]:
    """Ids of the placements that are seen from inside, too."""
    return frozenset(p.id for p in house.placements if p.object_class in HOLLOW)


def bounds_of(house: House) -> tuple[np.ndarray, np.ndarray]:
    """(2,) the least and the greatest corner of its rooms, metres."""
    corners = np.array([c for r in house.rooms for c in r.polygon])
    return corners.min(axis=0), corners.max(axis=0)


def _pieces(mesh: LitMesh, centre: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Vertices, uv and faces of a mesh, or of its pieces."""
    if mesh.kind != "outdoor":
        if len(mesh.faces):
            yield mesh.vertices, mesh.uv, mesh.faces
        return
    x, y = (mesh.vertices[mesh.faces].mean(1)[:, :2] - centre).T
    piece = np.floor((np.arctan2(y, x) / (2 * np.pi) + 0.5) * PIECES)
    for k in np.unique(piece):
        used, faces = np.unique(mesh.faces[piece == k], return_inverse=True)
        yield mesh.vertices[used], mesh.uv[used], faces.reshape(-1, 3)


def _add_collisions(
    spec: mujoco.MjSpec,
    house: House,
    catalogue: Catalogue,
    bodies: Mapping[str, Hung],
    cases: Mapping[str, Case],
    without: Collection[str],
) -> None:
    for room in house.rooms:
        _add_boxes(spec.worldbody, f"{room.id}/floor", collision.floor_boxes(house, room))
        for i in range(len(room.polygon)):
            _add_boxes(spec.worldbody, f"{room.id}/wall_{i}", collision.wall_boxes(house, room, i))
        _add_boxes(spec.worldbody, f"{room.id}/ceiling", tuple(ceiling_boxes(house, room)))
    for stair in house.stairs:
        _add_boxes(spec.worldbody, f"{stair.id}/stairs", stairs.stair_boxes(house, stair))
    known: dict[tuple, tuple[collision.CollisionBox, ...]] = {}
    for p in house.placements:
        if is_underfoot(p) or p.object_class in without:
            continue
        density = collision.density_of(catalogue.assets[p.asset])
        if p.id in cases:
            shut = dataclasses.replace(p, params=closed(p.params))
            pieces = cupboards.boxes_of(cases[p.id], density, placement_boxes(catalogue, shut))
            for k, (carrier, box, heavy) in enumerate(pieces):
                _add_boxes(carrier.body, p.id, [box], density=heavy, position=carrier.origin, first=k)
            continue
        key = (p.asset, p.size, p.params)
        if key not in known:
            known[key] = placement_boxes(catalogue, p)
        boxes = known[key]
        if p.id in bodies:
            _add_boxes(bodies[p.id].body, p.id, boxes, density=density)
        else:
            _add_boxes(spec.worldbody, p.id, boxes, position=p.position, yaw=p.yaw)


def _add_leaves(spec: mujoco.MjSpec, parts: Sequence[Part], hung: Mapping[doors.LeafKey, Hung]) -> None:
    """One box for every door leaf and window pane, as it stands; of doors on hinges, for the levers, too."""
    count: dict[str, int] = {}
    for part in parts:
        leaf = hung.get((part.owner, part.position)) if doors.is_leaf(part) else None
        if leaf is not None:
            box = collision.bounding_box(part.mesh.vertices)
            if part.owner.endswith("/frame"):  # casements meet in a rebate
                box = dataclasses.replace(box, half=(box.half[0] - 0.003, *box.half[1:]))
            first = count[part.owner] = count.get(part.owner, len(leaf.body.geoms) - 1) + 1
            _add_boxes(leaf.body, part.owner, [box], density=doors.LEAF_DENSITY, position=leaf.origin, first=first)
        elif part.kind == "opening" and part.owner.endswith(LEAVES):
            first = count[part.owner] = count.get(part.owner, -1) + 1
            box = collision.bounding_box(part.mesh.vertices)
            _add_boxes(spec.worldbody, part.owner, [box], position=part.position, yaw=part.yaw, first=first)


def placement_boxes(catalogue: Catalogue, p: Placement) -> tuple[collision.CollisionBox, ...]:
    """The collision boxes of a placement, in the asset frame; kept where the catalogue has a cache."""
    asset, parts = catalogue.assets[p.asset], catalogue.mesh(p.asset, p.size, p.params)
    if (cache := getattr(catalogue, "cache", None)) is None:
        return collision.object_boxes(asset, parts, p.size)
    return collision.kept_boxes(asset, parts, p.size, cache)


def _add_boxes(
    body: mujoco.MjsBody,
    owner: str,
    boxes: Sequence[collision.CollisionBox],
    *,
    density: float = 1000.0,
    position: Sequence[float] = (0.0, 0.0, 0.0),
    yaw: float = 0.0,
    first: int = 0,
) -> None:
    """Boxes of a frame at `position`, turned by `yaw`."""
    c, s, kind = math.cos(yaw), math.sin(yaw), {"type": mujoco.mjtGeom.mjGEOM_BOX, "group": COLLISION}
    kind |= {"rgba": [0.6, 0.7, 0.9, 0.4], "density": density, "friction": [0.9, 0.005, 0.0001]}
    for k, box in enumerate(boxes, first):
        x, y, z = box.centre
        pos = [position[0] + c * x - s * y, position[1] + s * x + c * y, position[2] + z]
        body.add_geom(name=f"{owner}#box{k}", **kind, pos=pos, quat=yaw_quat(yaw + box.yaw, box.tilt), size=box.half)
