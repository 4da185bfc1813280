"""Colours by Filament, MuJoCo's physically based renderer, through Vulkan. Depth and ids stay with the classic one.

The baked pages are shown as emissive textures. Vulkan needs no X server; on the CPU it is Mesa's lavapipe.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import functools
import os

from embodied import gl

gl.prepare()

import mujoco
import numpy as np

from embodied.errors import UnableError
from embodied.house import House
from embodied.lit import LitPages
from embodied.scene import build_spec, compile_spec

EXPOSURE = 0.73
"""Stops that make an emissive white come out white with linear tone mapping (measured against the classic renderer)."""
REMEDY = "install Vulkan (Debian, Ubuntu: apt-get install libvulkan1 mesa-vulkan-drivers), or use backend 'classic'"


class VulkanError(UnableError):
    """Filament cannot draw here; says what to do."""


class Painter:
    """Draws the colours of one lit house. Owns its meshes and textures on the graphics side until `close`."""

    def __init__(self, house: House, catalogue, lit: LitPages) -> None:
        """Upload `lit`.

        Raises:
          VulkanError: no Vulkan, or a forked process.
        """
        from mujoco import mjrf

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
        self._model = model
        self._targets: dict[tuple[int, int], object] = {}

    def rgb(self, camera, size: tuple[int, int], near: float, far: float) -> np.ndarray:
        """(h, w, 3) uint8 as an embodied.render.Camera sees it, top row first."""
        mjrf = self._mjrf
        if size not in self._targets:
            config = mjrf.RenderTargetConfig(color_format=mjrf.PixelFormat.PIXEL_FORMAT_RGB8)
            self._targets[size] = self._context.create_render_target(config)
            self._targets[size].resize(size[1], size[0])
        picture = np.empty((*size, 3), np.uint8)
        read = mjrf.ReadRequest(target=self._targets[size])
        read.set_buffer(picture)
        top = near * np.tan(camera.vfov / 2)
        request = mjrf.RenderRequest()
        request.scene, request.target = self._scene, self._targets[size]
        request.camera = mjrf.Camera(pos=camera.position, forward=camera.forward, up=camera.up, frustum_bottom=-top,
                                     frustum_top=top, frustum_near=near, frustum_far=far)
        request.viewport.left = request.viewport.bottom = 0
        request.viewport.width, request.viewport.height = size[1], size[0]
        request.post_processing, request.skybox = True, True
        request.reflections = request.shadows = request.haze = request.headlight = False
        self._context.wait_for_frame(self._context.render([request], [read]))
        return picture

    def close(self) -> None:
        """Free what lies on the graphics side, in the order Filament asks for."""
        for name in ("_targets", "_renderables", "_lights", "_scene", "_resources"):
            if hasattr(self, name):
                delattr(self, name)


def emissive_model(house: House, catalogue, lit: LitPages) -> mujoco.MjModel:
    """The lit house with its pages as light sources and nothing else shining."""
    spec = build_spec(house, catalogue, collisions=False, lit=lit)
    role = mujoco.mjtTextureRole
    for material in spec.materials:
        material.textures[role.mjTEXROLE_EMISSIVE] = material.textures[role.mjTEXROLE_RGB]
        material.textures[role.mjTEXROLE_RGB] = ""
        material.rgba, material.emission, material.roughness, material.metallic = [0, 0, 0, 1], 1, 1, 0
    for texture in spec.textures:
        texture.colorspace = mujoco.mjtColorSpace.mjCOLORSPACE_SRGB
    for name, value in (("ao.enabled", 0.0), ("cg.exposure", EXPOSURE)):
        spec.add_numeric(name=f"filament.{name}", data=[value], size=1)
    spec.add_text(name="filament.cg.tone_mapping", data="linear")
    # any light with an intensity switches Filament's own lighting off; this one is too faint and far to be seen
    light = spec.worldbody.add_light(name="faint", pos=[0, 0, -50], dir=[0, 0, -1], castshadow=False)
    light.intensity = 1e-3
    return compile_spec(spec)


@functools.cache
def _context(pid: int):
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


class _InstanceInfo(ctypes.Structure):
    """VkInstanceCreateInfo of the Vulkan specification."""

    _fields_ = [
        ("kind", ctypes.c_int), ("next", ctypes.c_void_p), ("flags", ctypes.c_uint32), ("application", ctypes.c_void_p),
        ("layers", ctypes.c_uint32), ("layer_names", ctypes.c_void_p), ("extensions", ctypes.c_uint32),
        ("extension_names", ctypes.c_void_p),
    ]


def _vulkan_works() -> bool:
    """Whether Vulkan finds a device. Asked beforehand, because Filament ends the process where it does not."""
    name = ctypes.util.find_library("vulkan")
    if name is None:
        return False
    vulkan, instance, count = ctypes.CDLL(name), ctypes.c_void_p(), ctypes.c_uint32()
    info = _InstanceInfo(kind=1)
    if vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)) != 0:
        return False
    found = vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None) == 0 and count.value > 0
    vulkan.vkDestroyInstance(instance, None)
    return found
