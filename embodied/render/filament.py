"""Colours by Filament, MuJoCo's physically based renderer, through Vulkan. Depth and ids stay with the classic one.

The baked pages are shown as emissive textures. Above them lie reflections of the room the camera is in: a small
picture of its surroundings, taken from its middle, is Filament's image light. MuJoCo 4.0 shines one image light on
the whole scene and lets nothing stand in its way, so the light is exchanged from room to room, and what lies under a
table shines as much as the table. Vulkan needs no X server; on the CPU it is Mesa's lavapipe.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import functools
import os
from typing import TYPE_CHECKING, Any

from embodied import gl

gl.prepare()

import mujoco
import numpy as np
import shapely

from embodied.errors import UnableError
from embodied.house.house import House
from embodied.house.shapes import room_at
from embodied.navigation.free_space import EYE
from embodied.render.camera import FAR, NEAR, Camera
from embodied.scene.lit_pages import LitPages
from embodied.scene.model import build_spec, compile_spec

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue

EXPOSURE = 0.73
"""Stops that make an emissive white come out white with linear tone mapping (measured against the classic renderer)."""
PROBE = 64
"""Side of a cube face of a room's surroundings, pixels."""
MIRROR = 11_700.0
"""Intensity of an image light at which a mirror shows its texels as they are (measured: sRGB 188 comes out as 188)."""
DULL = 0.05
"""Specular below which a mesh reflects nothing."""
CUBE = (
    ((1, 0, 0), (0, 0, 1)),
    ((-1, 0, 0), (0, 0, 1)),
    ((0, 0, 1), (0, 1, 0)),
    ((0, 0, -1), (0, -1, 0)),
    ((0, -1, 0), (0, 0, 1)),
    ((0, 1, 0), (0, 0, 1)),
)
"""Forward and up, world, of the faces of an image light: OpenGL's order and (mirrored) layout with y up, found with
coloured faces on a mirroring ball."""
REMEDY = "install Vulkan (Debian, Ubuntu: apt-get install libvulkan1 mesa-vulkan-drivers), or use backend 'classic'"


class VulkanError(UnableError):
    """Filament cannot draw here; says what to do."""


class FilamentPainter:
    """Draws the colours of one lit house. Owns its meshes and textures on the graphics side until `close`."""

    def __init__(self, house: House, catalogue: Catalogue, lit: LitPages) -> None:
        """Upload `lit`.

        Raises:
          VulkanError: no Vulkan, or a forked process.
        """
        try:
            from mujoco import mjrf
        except ImportError as e:
            raise VulkanError("Filament comes with MuJoCo's viewer; pip install 'embodied-houses[filament]'") from e

        self._mjrf, self._context = mjrf, _context(os.getpid())
        model = emissive_model(house, catalogue, lit)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        self._resources = mjrf.ModelResources(self._context, model)
        self._scene = self._context.create_scene(mjrf.SceneParams())
        self._scene.configure_from_model(model)
        self._lights = mjrf.ModelLights(self._scene, self._resources)
        self._renderables = mjrf.ModelRenderables(self._scene, self._resources)
        self._lights.update(data)
        self._renderables.update(data)
        self._model, self._house = model, house
        self._targets: dict[tuple[int, int], Any] = {}
        self._lights_of_room: dict[str, tuple] = {}
        self._room: str | None = None

    def rgb(self, camera: Camera, size: tuple[int, int]) -> np.ndarray:
        """(h, w, 3) uint8 as an embodied.render.classic.Camera sees it, top row first."""
        room = room_at(self._house, camera.position)
        if room != self._room:
            self._reflect(room)
        return self._draw(camera, size)

    def _reflect(self, room: str | None) -> None:
        """Exchange the image light for that of `room`; made on first need. None takes it away."""
        mjrf = self._mjrf
        if self._room is not None:
            self._scene.remove_light(self._lights_of_room[self._room][0])
            self._room = None
        if room is None:
            return
        if room not in self._lights_of_room:
            eye = middle_of(self._house, room)
            faces = [self._draw(Camera(eye, forward, up), (PROBE, PROBE))[:, ::-1] for forward, up in CUBE]
            texture = self._context.create_texture(
                mjrf.TextureConfig(
                    width=PROBE,
                    height=6 * PROBE,
                    format=mjrf.PixelFormat.PIXEL_FORMAT_RGB8,
                    color_space=mjrf.ColorSpace.COLORSPACE_SRGB,
                    sampler_type=mjrf.SamplerType.TEXTURE_CUBE,
                )
            )
            data = mjrf.TextureData()
            data.set_image(np.ascontiguousarray(np.concatenate(faces)).tobytes())
            texture.upload(data)
            light = self._context.create_light(
                mjrf.LightParams(type=mjrf.LightType.LIGHT_IMAGE, texture=texture, intensity=MIRROR)
            )
            self._lights_of_room[room] = light, texture
        self._scene.add_light(self._lights_of_room[room][0])
        self._room = room

    def _draw(self, camera: Camera, size: tuple[int, int]) -> np.ndarray:
        mjrf = self._mjrf
        if size not in self._targets:
            config = mjrf.RenderTargetConfig(color_format=mjrf.PixelFormat.PIXEL_FORMAT_RGB8)
            self._targets[size] = self._context.create_render_target(config)
            self._targets[size].resize(size[1], size[0])
        picture = np.empty((*size, 3), np.uint8)
        read = mjrf.ReadRequest(target=self._targets[size])
        read.set_buffer(picture)
        top = NEAR * np.tan(camera.vfov / 2)
        request = mjrf.RenderRequest()
        request.scene, request.target = self._scene, self._targets[size]
        request.camera = mjrf.Camera(
            pos=camera.position,
            forward=camera.forward,
            up=camera.up,
            frustum_bottom=-top,
            frustum_top=top,
            frustum_near=NEAR,
            frustum_far=FAR,
        )
        request.viewport.left = request.viewport.bottom = 0
        request.viewport.width, request.viewport.height = size[1], size[0]
        request.post_processing, request.skybox = True, True
        request.reflections = request.shadows = request.haze = request.headlight = False
        self._context.wait_for_frame(self._context.render([request], [read]))
        return picture

    def close(self) -> None:
        """Free what lies on the graphics side, in the order Filament asks for."""
        if self._room is not None:
            self._scene.remove_light(self._lights_of_room[self._room][0])
        for name in ("_lights_of_room", "_targets", "_renderables", "_lights", "_scene", "_resources"):
            vars(self).pop(name, None)


def emissive_model(house: House, catalogue: Catalogue, lit: LitPages) -> mujoco.MjModel:
    """The lit house with its pages as light sources, and a black, smooth coat over what is glossy."""
    spec = build_spec(house, catalogue, collisions=False, lit=lit)
    role = mujoco.mjtTextureRole
    for material in spec.materials:
        material.textures[role.mjTEXROLE_EMISSIVE] = material.textures[role.mjTEXROLE_RGB]
        material.textures[role.mjTEXROLE_RGB] = ""
        material.rgba, material.emission = [0, 0, 0, 1], 1
        material.roughness, material.metallic = 1, 1  # a black metal reflects nothing
    _add_coats(spec, lit)
    for texture in spec.textures:
        texture.colorspace = mujoco.mjtColorSpace.mjCOLORSPACE_SRGB
    for name, value in (("ao.enabled", 0.0), ("cg.exposure", EXPOSURE)):
        spec.add_numeric(name=f"filament.{name}", data=[value], size=1)
    spec.add_text(name="filament.cg.tone_mapping", data="linear")
    # any light with an intensity switches Filament's own lighting off; this one is too faint and far to be seen
    light = spec.worldbody.add_light(name="faint", pos=[0, 0, -50], dir=[0, 0, -1], castshadow=False)
    light.intensity = 1e-3
    return compile_spec(spec)


def _add_coats(spec: mujoco.MjSpec, lit: LitPages) -> None:
    """Meshes that shine get a material like their page's, as rough as they are."""
    geoms = [g for g in spec.geoms if g.material.startswith("page_")]
    meshes = [lit.meshes[int(g.meshname.partition("_")[0])] for g in geoms]
    known: dict[tuple[str, float], str] = {}
    for geom, mesh in zip(geoms, meshes, strict=True):
        geom.rgba = [0, 0, 0, geom.rgba[3]]  # a geom's own colour would hide its material's
        if mesh.gloss is None or mesh.gloss[1] < DULL or mesh.kind == "outdoor":
            continue
        key = geom.material, round(mesh.gloss[0], 1)
        if key not in known:
            known[key] = f"{key[0]}_{key[1]:g}"
            coat = spec.add_material(name=known[key], rgba=[0, 0, 0, 1], emission=1, roughness=key[1], metallic=0)
            coat.textures[mujoco.mjtTextureRole.mjTEXROLE_EMISSIVE] = key[0]
        geom.material = known[key]


def middle_of(house: House, room: str) -> tuple[float, float, float]:
    """Where a room's surroundings are seen from."""
    r = house.room_by_id[room]
    x, y = shapely.Polygon(r.polygon).representative_point().coords[0]
    return x, y, house.storey_of(r).elevation + EYE


@functools.cache
def _context(pid: int) -> Any:
    """The process's one Filament context: a second one crashes."""
    if _context.cache_info().currsize:
        raise VulkanError("this process was forked from one that had opened Filament; start workers with 'spawn'")
    if not _vulkan_works():
        raise VulkanError(f"there is no Vulkan driver here; {REMEDY}")
    try:
        import mujoco.studio.window  # noqa: F401  without it Filament does not find its materials
        from mujoco import mjrf

        config = mjrf.ContextConfig()
        config.graphics_api = mjrf.GraphicsApi.GRAPHICS_API_VULKAN
        context = mjrf.Context(config)
    except (ImportError, RuntimeError, OSError) as e:
        raise VulkanError(f"Filament cannot open Vulkan ({e}); {REMEDY}") from e
    context.set_clear_color([0.0, 0.0, 0.0])
    return context


def _vulkan_works() -> bool:
    """Whether Vulkan finds a device. Asked beforehand, because Filament ends the process where it does not."""
    name = ctypes.util.find_library("vulkan")
    if name is None:
        return False
    vulkan, instance, count = ctypes.CDLL(name), ctypes.c_void_p(), ctypes.c_uint32()
    info = (ctypes.c_uint64 * 8)(1)  # a VkInstanceCreateInfo, 64 bytes: its type, which is 1, and nothing asked for
    if vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)) != 0:
        return False
    found = vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None) == 0 and count.value > 0
    vulkan.vkDestroyInstance(instance, None)
    return found
