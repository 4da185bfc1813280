"""Choosing and owning the off-screen OpenGL context. Import it, and call `prepare`, before mujoco.

EGL is preferred (it uses a GPU where one is, Mesa's software rasteriser elsewhere); OSMesa is the
fall-back. MUJOCO_GL, MuJoCo's own switch, is honoured when the user has set it to either.
"""

import atexit
import contextlib
import ctypes
import ctypes.util
import functools
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from embodied import software
from embodied.errors import UnableError
from embodied.software import keep_drawing_to_threads

BACKENDS = ("egl", "osmesa")
ELSEWHERE = (
    *("", "glfw", "glx", "cgl", "wgl", "enable", "enabled", "on", "true", "1"),
    *("disable", "disabled", "off", "false", "0"),
)
"""Values of MUJOCO_GL that mujoco can be imported with, though nothing is drawn off-screen through them."""
GL_REMEDY = (
    "Install EGL and Mesa's software OpenGL (Debian, Ubuntu: apt-get install libegl1 libgl1-mesa-dri libopengl0), "
    "or, without root on Linux x86-64, run: embodied doctor --fix"
)
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software")
"""Words by which a device name tells that no graphics hardware is used."""


class GLError(UnableError):
    """No OpenGL context can be had; says why and what to do."""


@dataclass(frozen=True)
class GLInfo:
    """Description of the device that draws; goes into every recording, data set and benchmark."""

    backend: str
    """'egl' or 'osmesa'."""
    vendor: str
    device: str
    version: str
    software: bool
    """True where the CPU draws."""

    def __str__(self) -> str:
        return f"{self.device} ({'software' if self.software else 'hardware'}, {self.vendor}) through {self.backend}"


def choose() -> str:
    """The backend this process uses; also tells MuJoCo and PyOpenGL through their variables.

    Raises:
      GLError: MUJOCO_GL names something that draws on a screen, MUJOCO_EGL_DEVICE_ID is no number, or neither EGL nor
        OSMesa is there.
    """
    asked = os.environ.get("MUJOCO_GL", "").lower().strip()
    if asked and asked not in BACKENDS:
        raise GLError(f"MUJOCO_GL is {asked!r}; off-screen rendering needs one of {BACKENDS}, or unset it")
    device = os.environ.get("MUJOCO_EGL_DEVICE_ID")
    if device is not None and not device.strip().isdecimal():
        raise GLError(f"MUJOCO_EGL_DEVICE_ID is {device!r}; it should be the number of a device, from 0, or unset it")
    backend = asked or _first_available()
    os.environ["MUJOCO_GL"] = backend
    os.environ["PYOPENGL_PLATFORM"] = backend
    if backend == "osmesa":
        software.bind_osmesa()
    return backend


def available() -> bool:
    """True where some off-screen OpenGL is here."""
    try:
        choose()
    except GLError:
        return False
    return True


def prepare() -> None:
    """Set MuJoCo's switch before mujoco is imported; that nothing can draw is said only when asked to draw.

    Raises:
      GLError: MUJOCO_GL is a word with which mujoco cannot even be imported.
    """
    if os.environ.get("MUJOCO_GL", "").lower().strip() not in (*BACKENDS, *ELSEWHERE):
        choose()
    with contextlib.suppress(GLError):
        choose()


@functools.cache
def _first_available() -> str:
    if _egl_works():
        return "egl"
    if ctypes.util.find_library("OSMesa") or software.bundled("OSMesa"):
        return "osmesa"
    raise GLError(f"neither EGL nor OSMesa works here. {GL_REMEDY}")


def _egl_works() -> bool:
    """True where some EGL device initialises, tried without PyOpenGL, which binds one platform for good."""
    name = ctypes.util.find_library("EGL")
    if name is None or not any(map(ctypes.util.find_library, ("OpenGL", "GLESv2", "GLESv1_CM"))):  # PyOpenGL needs one
        return False
    software.load_triton_first()
    try:
        egl = ctypes.CDLL(name)
    except OSError:  # it is there, and broken
        return False
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    query_address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    display_address = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query_address or not display_address:
        return False
    pointer = ctypes.c_void_p
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.POINTER(pointer), ctypes.POINTER(ctypes.c_int))
    get_display = ctypes.CFUNCTYPE(pointer, ctypes.c_uint, pointer, pointer)(display_address)
    devices, count = (pointer * 16)(), ctypes.c_int()
    if not query(query_address)(16, devices, ctypes.byref(count)):
        return False
    platform_device = 0x313F  # EGL_PLATFORM_DEVICE_EXT
    egl.eglInitialize.argtypes = [pointer, pointer, pointer]
    displays = (get_display(platform_device, devices[i], None) for i in range(count.value))
    return any(d and egl.eglInitialize(d, None, None) for d in displays)


class _Owner:
    """The one context of a process. It changes over time: absent, created, released."""

    def __init__(self) -> None:
        self.context = None
        self.pid = 0
        self.turn = threading.RLock()
        self.depth = 0
        """How many `drawing` of the thread whose turn it is lie in one another."""


@functools.cache
def _owner() -> _Owner:
    return _Owner()


@contextlib.contextmanager
def drawing() -> Iterator[None]:
    """This process's context, created on first use, current in the calling thread until the end; also a decorator.
    Threads take turns.

    Raises:
      GLError: as `make_current`.
    """
    owner = _owner()
    _check_process(owner)
    with owner.turn:
        owner.depth += 1
        try:
            make_current()
            yield
        finally:
            owner.depth -= 1
            if owner.depth == 0:
                _let_go(owner)


def make_current() -> None:
    """Create this process's context on first use and make it current in the calling thread, which is within `drawing`.

    Raises:
      GLError: it cannot be created, or the parent of this forked process already had one (Mesa's
        worker threads do not survive a fork, and the first draw call would hang).
    """
    owner = _owner()
    _check_process(owner)
    if owner.context is None:
        owner.context, owner.pid = _create(choose()), os.getpid()
        atexit.register(_release_at_exit)
    assert owner.context is not None
    owner.context.make_current()


def _check_process(owner: _Owner) -> None:
    if owner.context is not None and owner.pid != os.getpid():
        raise GLError(
            f"process {os.getpid()} was forked after its parent {owner.pid} had opened OpenGL, which does not "
            "survive a fork; start workers with multiprocessing.get_context('spawn'), or fork before rendering"
        )


def _let_go(owner: _Owner) -> None:
    """Leave the context to the next thread; OSMesa's may be current in several."""
    if owner.context is not None and os.environ["MUJOCO_GL"] == "egl":
        from mujoco import egl

        none = egl.EGL.EGL_NO_SURFACE
        egl.EGL.eglMakeCurrent(egl.EGL_DISPLAY, none, none, egl.EGL.EGL_NO_CONTEXT)


def _create(backend: str) -> Any:
    software.load_triton_first()
    keep_drawing_to_threads()
    try:
        if backend == "egl":
            from mujoco.egl import GLContext
        else:
            from mujoco.osmesa import GLContext
        from OpenGL.error import Error
    except (ImportError, AttributeError, OSError) as e:
        raise GLError(f"cannot load OpenGL through {backend} ({e}). {GL_REMEDY}") from e
    try:
        return GLContext(64, 64)
    except (ImportError, RuntimeError, AttributeError, OSError, Error) as e:
        remedy = "Unset MUJOCO_EGL_DEVICE_ID" if "MUJOCO_EGL_DEVICE_ID" in str(e) else GL_REMEDY
        raise GLError(f"cannot open an OpenGL context through {backend} ({e}). {remedy}") from e


def info() -> GLInfo:
    """Who draws here; opens the context if need be."""
    with drawing():
        from OpenGL import GL

        vendor, device, version = (GL.glGetString(k).decode() for k in (GL.GL_VENDOR, GL.GL_RENDERER, GL.GL_VERSION))
    software = any(word in device.lower() for word in SOFTWARE)
    return GLInfo(os.environ["MUJOCO_GL"], vendor, device, version, software)


def release() -> None:
    """Close this process's context; renderers must be closed before."""
    owner = _owner()
    if owner.context is not None and owner.pid == os.getpid():
        owner.context.free()
    owner.context = None


def _release_at_exit() -> None:
    from OpenGL.error import Error

    # Whoever imported dm_control after the first picture has had the display closed already, and the context with it.
    with contextlib.suppress(Error):
        release()
