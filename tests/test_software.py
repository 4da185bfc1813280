"""Software OpenGL and LLVM out of a wheel are used where that wheel is whole, and never in place of the system's."""

from __future__ import annotations

import ctypes
import importlib.util
from types import SimpleNamespace

import pytest

from embodied import software


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    """The folder of an installed wheel's libraries; nothing is in it."""
    package = SimpleNamespace(origin=str(tmp_path / "lavavu" / "__init__.py"))
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: package if name == software.WHEEL else None)
    software.bundled.cache_clear()
    folder = tmp_path / software.FOLDER
    folder.mkdir()
    yield folder
    software.bundled.cache_clear()


def test_a_wheel_with_a_library_that_does_not_load_is_not_used(wheel):
    (wheel / "libOSMesa-1.so.8").write_bytes(b"no library")
    assert software.bundled("OSMesa") is None and software.bundled("LLVM") is None


def test_libraries_are_loaded_in_the_order_that_they_need(wheel, monkeypatch):
    for name in ("libLLVM-17.so", "libffi-1.so", "libzstd-1.so"):
        (wheel / name).write_bytes(b"")
    loaded: list[str] = []

    def load(path: str) -> None:
        name = path.rpartition("/")[2]
        if name.startswith("libLLVM") and len(loaded) < 2:
            raise OSError("libffi-1.so: cannot open shared object file")
        loaded.append(name)

    monkeypatch.setattr(ctypes, "CDLL", load)
    assert software.bundled("LLVM") == wheel / "libLLVM-17.so"
    assert loaded == ["libffi-1.so", "libzstd-1.so", "libLLVM-17.so"]


def test_the_systems_osmesa_goes_before_the_wheels(monkeypatch):
    before = ctypes.cdll._dlltype
    monkeypatch.setattr(software, "bundled", lambda stem: "somewhere")
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: "libOSMesa.so.8")
    software.bind_osmesa()
    assert ctypes.cdll._dlltype is before
