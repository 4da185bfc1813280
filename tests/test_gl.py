"""OpenGL: opened only by who draws, shared by threads, closed without a word."""

from __future__ import annotations

import gc
import multiprocessing
import os
import subprocess
import sys
import threading
import weakref
from pathlib import Path

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied import gl
from embodied.house.house import House
from embodied.navigation.graph import graph_of
from embodied.render.classic import Renderer
from embodied.render.pictures import Unlit
from embodied.world import World

pytestmark = pytest.mark.gl
EYE = (3.0, 2.0, 1.5)


def house_to_draw() -> House:
    return furnished(two_rooms())


@pytest.fixture(scope="module")
def house():
    return house_to_draw()


def world_of(house, tmp_path, **more) -> World:
    graph = graph_of(np.array([EYE]), np.empty((0, 2), int), ("a",), ("living_room_1",))
    pictures = Unlit(size=32)
    return World(house, HandCatalogue(), graph, tmp_path, pictures, file=tmp_path / "a.pano", **more)


def sum_of(world: World) -> int:
    return int(world.panorama(0).rgb.astype(np.int64).sum())


def test_stored_pictures_are_read_without_opengl_and_in_forked_workers(house, tmp_path, monkeypatch):
    with world_of(house, tmp_path) as world:
        world.render_all()
        drawn, device = sum_of(world), world.fingerprint["renderer"]
    refused = lambda *a: pytest.fail("OpenGL was opened")
    monkeypatch.setattr(gl, "drawing", refused)
    monkeypatch.setattr(gl, "make_current", refused)
    monkeypatch.setattr(gl, "info", refused)
    with world_of(house, tmp_path, ignore_fields=("renderer", "code")) as world:
        assert sum_of(world) == drawn and world.fingerprint["renderer"] == device
        assert world.render_all() == tmp_path / "a.pano"
        context = multiprocessing.get_context("fork")
        queue = context.Queue()
        worker = context.Process(target=lambda: queue.put(sum_of(world)))
        worker.start()
        assert queue.get(timeout=600) == drawn
        worker.join(timeout=600)


def test_stored_pictures_that_are_damaged_are_drawn_again_under_the_name_of_who_draws(house, tmp_path):
    with world_of(house, tmp_path) as world:
        path, drawn = world.render_all(), sum_of(world)
    data = bytearray(path.read_bytes())
    data[20] ^= 255
    path.write_bytes(data)
    with world_of(house, tmp_path, ignore_fields=("renderer",)) as world:
        world.render_all()
        assert sum_of(world) == drawn and world.fingerprint["renderer"] == str(gl.info())


def test_threads_take_turns(house):
    with Renderer(house, HandCatalogue(), size=32) as renderer:
        expected = renderer.panorama(EYE).rgb
        found, failed = [], []

        def draw(own: bool) -> None:
            try:
                mine = Renderer(house, HandCatalogue(), size=32) if own else renderer
                found.append(mine.panorama(EYE).rgb)
                if own:
                    mine.close()
            except Exception as e:
                failed.append(e)

        for own in ((False,), (True,), (True, True, True)):
            threads = [threading.Thread(target=draw, args=(o,)) for o in own]
            for t in threads:
                t.start()
            for t in threads:
                t.join()
        assert not failed and len(found) == 5
        assert all((f == expected).all() for f in found)
        assert (renderer.panorama(EYE).rgb == expected).all(), "the first thread draws on"


def ended(*arguments: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess:
    env = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")} | environment
    command = [sys.executable, "-c", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=cwd, env=env)


WITHOUT_OPENGL = """
import ctypes, ctypes.util, pkgutil, importlib, sys
find, load = ctypes.util.find_library, ctypes.CDLL.__init__
libraries = ("EGL", "OSMesa", "GL", "OpenGL", "GLX", "GLESv2", "GLESv1_CM")

def refuse(self, name, *args, **more):
    if any(f"lib{x}." in str(name) for x in libraries):
        raise OSError(f"{name} cannot be opened")
    load(self, name, *args, **more)

ctypes.util.find_library = lambda name: None if name in libraries else find(name)
ctypes.CDLL.__init__ = refuse

from pathlib import Path
import embodied, embodied.cli, embodied.datasets.build, embodied.evaluation.evaluate, embodied.gym.env
from embodied import gl
from test_gl import house_to_draw, sum_of, world_of
for name in embodied.__all__:
    getattr(embodied, name)
for module in pkgutil.iter_modules(embodied.cli.__path__):
    importlib.import_module("embodied.cli." + module.name)
assert not gl.available() and "OpenGL.GL" not in sys.modules
house, folder = house_to_draw(), Path(sys.argv[1])
with world_of(house, folder, ignore_fields=("renderer", "code")) as world:
    print(sum_of(world))
world = embodied.open_world(house, world.catalogue, folder / "other cache", graph=world.graph)
print(sorted(s.placement for s in world.sightings(0)))
try:
    world.panorama(0)
except gl.GLError as e:
    print(e)
"""


def test_without_opengl_stored_pictures_are_read_rays_find_what_is_seen_and_drawing_says_the_remedy(tmp_path):
    with world_of(house_to_draw(), tmp_path) as world:
        world.render_all()
        total, seen = sum_of(world), sorted(s.placement for s in world.sightings(0))
    child = ended(WITHOUT_OPENGL, tmp_path, cwd=Path(__file__).parent)
    assert child.returncode == 0, child.stderr
    stored, sighted, error = child.stdout.splitlines()
    assert (int(stored), sighted) == (total, str(seen)) and "apt-get install libegl1" in error


def test_nothing_is_printed_at_exit_where_dm_control_is_imported_after_the_first_picture():
    done = ended("from embodied import gl; gl.info(); import embodied.envs.driven")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize(
    ("library", "environment", "message"),
    [
        ("", {}, "neither EGL nor OSMesa.*apt-get install"),
        ("broken", {}, "neither EGL nor OSMesa.*apt-get install"),
        ("", {"MUJOCO_GL": "glfw"}, "MUJOCO_GL is 'glfw'"),
        *(("", {"MUJOCO_EGL_DEVICE_ID": device}, "MUJOCO_EGL_DEVICE_ID is") for device in ("-1", "first", "")),
    ],
)
def test_what_cannot_draw_gives_the_remedy(library, environment, message, monkeypatch, tmp_path):
    (tmp_path / "broken").write_bytes(b"not a library")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    egl = str(tmp_path / library) if library else None
    monkeypatch.setattr(gl.ctypes.util, "find_library", lambda name: egl if name in ("EGL", "OpenGL") else None)
    monkeypatch.setattr(gl.software, "bundled", lambda stem: None)
    gl._first_available.cache_clear()
    try:
        with pytest.raises(gl.GLError, match=message):
            gl.choose()
    finally:
        gl._first_available.cache_clear()


@pytest.mark.parametrize(
    ("environment", "remedy"),
    [
        ({"MUJOCO_EGL_DEVICE_ID": "99"}, "Unset MUJOCO_EGL_DEVICE_ID"),
        ({"__EGL_VENDOR_LIBRARY_FILENAMES": "/dev/null"}, "Install EGL"),
    ],
)
def test_a_device_that_is_not_there_is_one_sentence_with_its_remedy(environment, remedy):
    code = "from embodied import gl\ntry: gl.info()\nexcept gl.GLError as e: print(e)"
    done = ended(code, MUJOCO_GL="egl", **environment)
    assert remedy in done.stdout and not done.stderr


def test_opening_and_closing_leaves_one_context_and_nothing_behind(house, tmp_path):
    places, contexts = [], set()
    for _ in range(4):
        with world_of(house, tmp_path, ignore_fields=("renderer",)) as world:
            world.panorama(0)
        with Renderer(house, HandCatalogue(), size=32) as renderer:
            renderer.view(EYE, 0.0, size=(16, 16))
        places += [weakref.ref(world), weakref.ref(renderer)]
        contexts.add(id(gl._owner().context))
    del world, renderer
    gc.collect()
    assert [place() for place in places] == [None] * len(places) and len(contexts) == 1
