"""Software OpenGL and LLVM out of a wheel are used where that wheel is whole, and never in place of the system's."""

from __future__ import annotations

import ctypes
import importlib.util
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

from embodied import gl, software
from embodied.assets.importing import sh3f
from embodied.cli import doctor


@pytest.fixture
def wheel(tmp_path, monkeypatch):
    """The folder of an installed wheel's libraries; nothing is in it."""
    package = SimpleNamespace(origin=str(tmp_path / "lavavu" / "__init__.py"))
    triton = SimpleNamespace(submodule_search_locations=[str(tmp_path / "triton")])
    specs = {software.WHEEL: package, "triton": triton}
    monkeypatch.setattr(importlib.util, "find_spec", specs.get)
    software.bundled.cache_clear()
    software.load_triton_first.cache_clear()
    folder = tmp_path / software.FOLDER
    folder.mkdir()
    yield folder
    software.bundled.cache_clear()
    software.load_triton_first.cache_clear()


def test_libraries_are_loaded_in_the_order_that_they_need_and_after_pytorchs_own_llvm(wheel, monkeypatch):
    for name in ("libLLVM-17.so", "libffi-1.so", "libzstd-1.so"):
        (wheel / name).write_bytes(b"")
    loaded: list[str] = []

    def load(path: str) -> None:
        name = path.rpartition("/")[2]
        if name.startswith("libLLVM") and len(loaded) < 3:
            raise OSError("libffi-1.so: cannot open shared object file")
        loaded.append(name)

    monkeypatch.setattr(ctypes, "CDLL", load)
    assert software.bundled("LLVM") == wheel / "libLLVM-17.so"
    assert loaded == ["libtriton.so", "libffi-1.so", "libzstd-1.so", "libLLVM-17.so"]


def test_the_systems_osmesa_goes_before_the_wheels(monkeypatch):
    before = ctypes.cdll._dlltype
    monkeypatch.setattr(software, "bundled", lambda stem: "somewhere")
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: "libOSMesa.so.8")
    software.bind_osmesa()
    assert ctypes.cdll._dlltype is before


def test_libatomic_comes_out_of_debians_package_without_root(tmp_path, monkeypatch):
    def run(order, *, cwd, **_):
        if order[0] == "apt-get" and order[-1] == "libatomic1":
            Path(cwd, "libatomic1_12_amd64.deb").write_bytes(b"")
        elif order[0] == "dpkg-deb":
            place = Path(cwd, order[3], "usr/lib/x86_64-linux-gnu")
            place.mkdir(parents=True)
            (place / "libatomic.so.1.2.0").write_bytes(b"the library")
            (place / software.ATOMIC).symlink_to("libatomic.so.1.2.0")

    loaded = []
    monkeypatch.setattr(subprocess, "run", run)
    monkeypatch.setattr(software, "_try", lambda path: loaded.append(path) or path.exists())
    assert not software.load_atomic(tmp_path) and software.bring_atomic(tmp_path)
    assert loaded[-1].read_bytes() == b"the library" and not loaded[-1].is_symlink()


@pytest.mark.parametrize("apt", [True, False])
def test_where_pip_has_no_furniture_debians_is_brought_or_the_way_to_make_it_is_said(apt, tmp_path, monkeypatch):
    def run(order, *, cwd=None, **_):
        if "pip" in order:
            return subprocess.CompletedProcess(order, 1)
        if not apt:
            raise FileNotFoundError(order[0])
        if order[0] == "apt-get" and "download" in order:
            Path(cwd, f"{order[-1]}_1.8_all.deb").write_bytes(b"")
        elif order[0] == "dpkg-deb":
            place = Path(cwd, order[3], "usr/share/sweethome3d/furniture")
            place.mkdir(parents=True)
            (place / "Scopia.sh3f").write_bytes(b"models")
        return subprocess.CompletedProcess(order, 0)

    own = tmp_path / "share"
    monkeypatch.setattr(subprocess, "run", run)
    for name, value in (("SYSTEM_FOLDER", tmp_path / "none"), ("OWN_FOLDER", own), ("WHEEL", "no_such_package")):
        monkeypatch.setattr(sh3f, name, value)
    for where, name in ((gl, "available"), (doctor, "load_atomic")):
        monkeypatch.setattr(where, name, lambda: True)
    monkeypatch.setattr("embodied.light.backend.find_llvm", lambda: "here")
    said = list(doctor.fix())
    assert said[:2] == [
        "pip install embodied-houses-furniture",
        "pip finds no such wheel; apt-get download sweethome3d-furniture, which goes into this environment",
    ]
    if apt:
        assert len(said) == 2 and sh3f.find_packs() == (own / "Scopia.sh3f",) and not list(doctor.fix())
    else:
        assert len(said) == 3 and "make wheels" in said[2] and sh3f.find_packs() == ()
