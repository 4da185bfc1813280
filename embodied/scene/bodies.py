"""Bodies in a house: of any MuJoCo model as parts, robots and things that users add, to be drawn in its light; and of
people in MuJoCo models: capsules around their bones, which go where a moment has them (mocap bodies)."""

import functools
from collections.abc import Collection, Mapping
from pathlib import Path

import cv2
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from embodied.assets.cache import digest, write_bytes
from embodied.assets.importing.meshing import crease_normals, decimate, weld
from embodied.assets.people import JOINTS, Person, people
from embodied.assets.people.bodies import mesh_of, transforms
from embodied.assets.records import Finish, MeshPart
from embodied.house.moment import Moment, RigidPose
from embodied.scene.part import Part

VISIBLE = (0, 1, 2)
"""Geom groups that MuJoCo's own viewer shows at first."""
MOST_FACES = 1500
"""Triangles of a geom as it is drawn; meshes of robots may have a hundred thousand."""
ROUND = 24
"""Sides of cylinders and capsules."""


def body_parts(
    model: mujoco.MjModel, textures: Path, *, groups: Collection[int] = VISIBLE
) -> dict[str, tuple[Part, ...]]:
    """The visible geoms of every body but the world's, by the body's name, in the body's frame.

    Planes, height fields, flexes and skins are left out. Where a body has visual geoms (those that touch nothing), its
    other geoms are taken for collision shapes and left out.

    Args:
      textures: a folder for the pictures of its materials.
      groups: of the geoms to draw.
    """
    out: dict[str, tuple[Part, ...]] = {}
    for body in range(1, model.nbody):
        name = body_name(model, body)
        first, count = model.body_geomadr[body], model.body_geomnum[body]
        every = range(first, first + count)
        geoms = [g for g in every if model.geom_group[g] in groups and geom_color(model, g)[3] > 0]
        free = [g for g in geoms if not (model.geom_contype[g] or model.geom_conaffinity[g])]
        parts = [p for g in free or geoms if (p := _part(model, g, name, textures)) is not None]
        if parts:
            out[name] = tuple(parts)
    return out


def body_name(model: mujoco.MjModel, body: int) -> str:
    """The body's name, or one made of its number."""
    return str(model.body(body).name) or f"body_{body}"


def body_poses(model: mujoco.MjModel, data: mujoco.MjData, names: Collection[str]) -> dict[str, RigidPose]:
    """Poses of bodies as they are now."""
    bodies, xyz, quat = _bodies(model), data.xpos.tolist(), data.xquat.tolist()
    some = [(name, bodies[name]) for name in names if name in bodies]
    return {name: RigidPose(tuple(xyz[body]), tuple(quat[body])) for name, body in some}


@functools.lru_cache(maxsize=4)
def _bodies(model: mujoco.MjModel) -> dict[str, int]:
    """Numbers of bodies by name."""
    return {body_name(model, body): body for body in range(1, model.nbody)}


def geom_color(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """(4,) as MuJoCo draws it: the geom's own unless that is the default, else the material's."""
    material, own = model.geom_matid[geom], model.geom_rgba[geom]
    if material < 0 or not np.allclose(own, 0.5 * np.array([1, 1, 1, 2])):
        return np.asarray(own)
    return np.asarray(model.mat_rgba[material])


def _part(model: mujoco.MjModel, geom: int, owner: str, textures: Path) -> Part | None:
    shape = shape_of(model, geom)
    if shape is None or not len(shape[1]):
        return None
    vertices, faces, normals, uv = shape if len(shape[1]) <= MOST_FACES else _fewer(*shape)
    flat = np.zeros(9)
    mujoco.mju_quat2Mat(flat, model.geom_quat[geom])
    turn = flat.reshape(3, 3)
    placed = (vertices @ turn.T + model.geom_pos[geom]).astype(np.float32)
    mesh = MeshPart(
        placed, faces.astype(np.int32), (normals @ turn.T).astype(np.float32), uv, _finish(model, geom, textures)
    )
    return Part(owner, "object", "", mesh, f"body/{digest(placed.tobytes(), faces.tobytes())[:16]}")


def shape_of(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """Vertices, faces, normals and texture coordinates of a geom, in its own frame; None of what has no triangles."""
    import trimesh  # late: people walk in small installations, too

    kind, size = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom]
    kinds = mujoco.mjtGeom
    if kind == kinds.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == kinds.mjGEOM_BOX:
        solid = trimesh.creation.box(2 * size)
        solid.unmerge_vertices()
    elif kind in (kinds.mjGEOM_SPHERE, kinds.mjGEOM_ELLIPSOID):
        solid = trimesh.creation.icosphere(subdivisions=2)
        solid.apply_scale(size if kind == kinds.mjGEOM_ELLIPSOID else size[0])
    elif kind == kinds.mjGEOM_CAPSULE:
        solid = trimesh.creation.capsule(2 * size[1], size[0], count=[ROUND, ROUND])
        solid.apply_translation([0, 0, -solid.bounds.mean(0)[2]])
    elif kind == kinds.mjGEOM_CYLINDER:
        solid = trimesh.creation.cylinder(size[0], 2 * size[1], sections=ROUND)
        solid = trimesh.graph.smooth_shade(solid, angle=0.8)
    else:
        return None
    vertices = np.asarray(solid.vertices, np.float32)
    return vertices, np.asarray(solid.faces), np.asarray(solid.vertex_normals), np.zeros((len(vertices), 2), np.float32)


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """As `shape_of`, with a vertex for every corner of a face, as corners have normals and coordinates of their own."""
    part = lambda values, first, count: values[first : first + count]
    first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    vertices = part(model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_vertnum[mesh])
    corners = vertices[part(model.mesh_face, first, count)].reshape(-1, 3)
    normals = part(model.mesh_normal, model.mesh_normaladr[mesh], model.mesh_normalnum[mesh])
    normals = normals[part(model.mesh_facenormal, first, count)].reshape(-1, 3)
    uv = np.zeros((len(corners), 2), np.float32)
    if model.mesh_texcoordnum[mesh] > 0:
        known = part(model.mesh_texcoord, model.mesh_texcoordadr[mesh], model.mesh_texcoordnum[mesh])
        uv = known[part(model.mesh_facetexcoord, first, count)].reshape(-1, 2) * [1, -1] + [0, 1]
    return corners, np.arange(len(corners)).reshape(-1, 3), normals, uv.astype(np.float32)


def _fewer(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, ...]:
    """A mesh of a vertex for every corner, of about MOST_FACES triangles."""
    welded, whole = weld(vertices, faces, 1e-6)
    points, few, corners_uv = decimate(welded, whole, uv[faces], MOST_FACES)
    turned = crease_normals(points, few).reshape(-1, 3).astype(np.float32)
    return points[few].reshape(-1, 3), np.arange(3 * len(few)).reshape(-1, 3), turned, corners_uv.reshape(-1, 2)


def _finish(model: mujoco.MjModel, geom: int, textures: Path) -> Finish:
    material, (red, green, blue, alpha) = int(model.geom_matid[geom]), geom_color(model, geom).tolist()
    if material < 0:
        return Finish(color=(red, green, blue, alpha), roughness=0.6)
    shine = float(model.mat_shininess[material])
    texture = int(model.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB])
    flat = texture >= 0 and model.tex_type[texture] == mujoco.mjtTexture.mjTEXTURE_2D
    is_mesh = model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH
    laid_on = flat and is_mesh and model.mesh_texcoordnum[model.geom_dataid[geom]] > 0
    return Finish(
        color=(red, green, blue, alpha),
        texture=_texture(model, texture, textures) if laid_on else None,
        roughness=float(np.clip(1 - shine, 0.2, 1.0)),
        specular=float(model.mat_specular[material]) * 0.5,
    )


def _texture(model: mujoco.MjModel, texture: int, folder: Path) -> str:
    """Path of a texture as a PNG file."""
    h, w, channels = model.tex_height[texture], model.tex_width[texture], model.tex_nchannel[texture]
    first = model.tex_adr[texture]
    image = model.tex_data[first : first + h * w * channels].reshape(h, w, channels)[..., :3]
    path = Path(folder) / f"{digest(image.tobytes(), image.shape)[:24]}.png"
    if not path.exists():
        write_bytes(path, cv2.imencode(".png", np.ascontiguousarray(image[..., ::-1]))[1].tobytes())
    return str(path)


LEFT_OUT = ("neck", "clavicle", "eye", "toes", "fingers", "fingertips")
"""Ends of the names of joints whose flesh has no capsule of its own."""
SKIN = 80.0
"""Percentile of the flesh's distances from a bone's line that is the radius of its capsule."""
AWAY = -100.0
"""Height at which the capsules of who is not there wait, metres."""


@functools.cache
def capsules(person: str) -> Mapping[str, tuple[np.ndarray, float]]:
    """By joint: (2, 3) the ends of the line of its capsule, of the body at rest, and the radius, metres."""
    mesh, out = mesh_of(person, 2), {}
    bone = mesh.weights.argmax(1)
    for k, name in enumerate(JOINTS):
        flesh = mesh.vertices[bone == k, :3].astype(float)
        if name.endswith(LEFT_OUT) or len(flesh) < 4:
            continue
        middle = flesh.mean(0)
        along = np.linalg.svd(flesh - middle, full_matrices=False)[2][0]
        at = (flesh - middle) @ along
        radius = float(np.percentile(np.linalg.norm(flesh - middle - np.outer(at, along), axis=1), SKIN))
        half = max(np.ptp(at) / 2 - radius, 1e-3)
        out[name] = np.array([middle + ((at.min() + at.max()) / 2 + x) * along for x in (-half, half)]), radius
    return out


def add_person(spec: mujoco.MjSpec, name: str, person: Person) -> None:
    """Capsules of somebody in a spec (`scene_spec`): mocap bodies 'name/chest' and so on, away until `stand_people`."""
    for joint, ((a, b), radius) in capsules(person.id).items():
        body = spec.worldbody.add_body(name=f"{name}/{joint}", mocap=True, pos=[0.0, 0.0, AWAY])
        kind = mujoco.mjtGeom.mjGEOM_CAPSULE
        how = {"size": [radius, 0.0, 0.0], "fromto": [*a, *b], "group": 3}  # that viewers hide
        body.add_geom(type=kind, name=f"{name}#{joint}", **how)


def stand_people(model: mujoco.MjModel, data: mujoco.MjData, moment: Moment, share: float = 1.0) -> None:
    """Move the capsules of everybody that `add_person` added a share of the way to where a moment has them, and away
    who is not there."""
    turned = {n: transforms(people()[p.person], p.pose).astype(float) for n, p in moment.people.items()}
    for body in np.flatnonzero(model.body_mocapid >= 0):
        name, slash, joint = model.body(body).name.rpartition("/")
        if not slash or joint not in JOINTS:
            continue
        k, figure = model.body_mocapid[body], moment.people.get(name)
        if figure is None:
            data.mocap_pos[k] = (0.0, 0.0, AWAY)
            continue
        turn, part = turned[name][[*JOINTS].index(joint)], share if data.mocap_pos[k, 2] > AWAY else 1.0
        x, y, z, w = Rotation.from_matrix(figure.place.rotation @ turn[:, :3]).as_quat()
        quat = np.array([w, x, y, z]) * (1.0 if data.mocap_quat[k] @ (w, x, y, z) > 0 else -1.0)
        data.mocap_pos[k] += part * (figure.place.points(turn[None, :, 3])[0] - data.mocap_pos[k])
        data.mocap_quat[k] += part * (quat - data.mocap_quat[k])
