"""Writing a house as a self-contained MJCF folder."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import mujoco
import numpy as np
import shapely

from embodied.assets.cache import write_bytes, write_json
from embodied.house.contents import contents
from embodied.house.house import House
from embodied.house.shapes import footprint
from embodied.scene.doors import metadata
from embodied.scene.lit_pages import LitPages
from embodied.scene.model import UNDERFOOT, build_spec, compile_spec

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

EYE = 1.5
"""Height of cameras above the floor, metres."""
MESHES, TEXTURES = "meshes", "textures"
"""Folders beside house.xml."""


def export_mjcf(
    house: House,
    catalogue: Catalogue,
    folder: Path,
    *,
    free: frozenset[str] = frozenset(),
    lit: LitPages | None = None,
    hinged: bool = False,
) -> Path:
    """Write `folder`/house.xml with its meshes and textures; opens in MuJoCo's own viewer and in dm_control as it is.

    Names have dots where owners have slashes, which dm_control keeps for itself. Every room has a camera of its name,
    at eye height where most floor is free. What is added by <include>, MjSpec.attach or body by body keeps its own
    masses, angles and files; options of physics are written only where something is free, and yield to those that
    come after.

    Args:
      free: placements that physics may move, see embodied.scene.model.loose.
      lit: write the house with its baked light instead of its materials.
      hinged: doors, drawers and lids move, furniture holds things, and house_metadata.json says what bodies and joints
        are.

    Returns:
      The path of house.xml.
    """
    folder = Path(folder)
    inside = contents(house, catalogue, hidden=True) if hinged else ()
    spec = build_spec(house, catalogue, free=free, lit=lit, hinged=hinged, contents=inside)
    _add_cameras(spec, house)
    for element in (*spec.geoms, *spec.bodies, *spec.joints, *spec.cameras):
        element.name = element.name.replace("/", ".")
    model = compile_spec(spec)
    (folder / "house.xml").unlink(missing_ok=True)  # written last: where it is, its files are whole
    for name in (MESHES, TEXTURES):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for mesh in spec.meshes:
        (folder / MESHES / mesh.file).write_bytes(spec.assets[mesh.file])
        mesh.file = f"{MESHES}/{mesh.file}"
    for texture in spec.textures:
        if texture.data:
            size = texture.height, texture.width, texture.nchannel
            order = cv2.COLOR_RGBA2BGRA if texture.nchannel == 4 else cv2.COLOR_RGB2BGR
            image = cv2.cvtColor(np.frombuffer(bytes(texture.data), np.uint8).reshape(size), order)
            (folder / TEXTURES / f"{texture.name}.png").write_bytes(cv2.imencode(".png", image)[1].tobytes())
            texture.data = b""
            texture.file = f"{TEXTURES}/{texture.name}.png"
    spec.modelfiledir = str(folder)
    # MuJoCo writes this one as a word, which dm_control takes for a number.
    xml = re.sub(r'(<headlight[^>]* active=)"(true|false)"', lambda m: f'{m[1]}"{int(m[2] == "true")}"', spec.to_xml())
    xml = re.sub(r"  <compiler[^>]*/>\n\n?", "", xml)  # it would hold for all that is added
    xml = re.sub(r'(<joint (?![^>]*type="slide")[^>]*>)', _in_degrees, xml)
    if hinged or free:
        write_json(folder / "house_metadata.json", metadata(house, model))
    write_bytes(folder / "house.xml", xml.encode())
    return folder / "house.xml"


def _in_degrees(joint: re.Match[str]) -> str:
    """A joint with its angles in degrees, which is what MuJoCo reads where no <compiler> says otherwise."""
    turned = lambda m: " ".join(f"{math.degrees(float(x)):.6g}" for x in m[2].split())
    return re.sub(r'\b(range|ref)="([^"]*)"', lambda m: f'{m[1]}="{turned(m)}"', joint[1])


def _add_cameras(spec: mujoco.MjSpec, house: House) -> None:
    for room in house.rooms:
        things = [footprint(p) for p in house.placements if p.room == room.id and p.size[2] > UNDERFOOT]
        floor = shapely.Polygon(room.polygon)
        free = floor.difference(shapely.union_all(things))
        x, y = shapely.maximum_inscribed_circle(free if free.area > 0 else floor).coords[0]
        away = np.array(shapely.Polygon(room.polygon).exterior.coords) - (x, y)
        yaw = math.atan2(*away[np.argmax(np.linalg.norm(away, axis=1))][::-1])
        axes = np.array([[math.sin(yaw), 0, -math.cos(yaw)], [-math.cos(yaw), 0, -math.sin(yaw)], [0, 1, 0]])
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, axes.reshape(-1))
        spec.worldbody.add_camera(
            name=room.id, pos=[x, y, house.storey_of(room).elevation + EYE], quat=quat.tolist(), fovy=75
        )
