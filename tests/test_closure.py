"""Cache keys follow the code: what a maker imports changes them, what it does not import leaves them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

import embodied.assets.closure as closure_module
from embodied.assets.closure import ROOT, closure, code_digest
from embodied.assets.importing import importer
from embodied.cli import doctor
from embodied.datasets.build import program
from embodied.light import settings
from embodied.light.pages import unwrap
from embodied.render.pictures import Baked, Traced, Unlit
from embodied.scene import collision
from embodied.world import makers

PROJECT = (ROOT / "pyproject.toml").read_text()


@pytest.fixture
def tree(tmp_path) -> Path:
    """A copy of the sources, to be edited."""
    for package in ("assets", "embodied"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__", "*.npz"))
    return tmp_path


def key(root: Path, *modules: str, without: tuple[str, ...] = ()) -> str:
    """The digest, read anew."""
    code_digest.cache_clear()
    return code_digest(*modules, root=root, without=without)


def test_a_table_that_a_docstring_mentions_is_in_no_key(tmp_path):
    package = tmp_path / "embodied"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "a.py").write_text('"""See other.toml."""\n\nTABLE = "own.toml"\n')
    for name in ("own", "other"):
        (package / f"{name}.toml").write_text("x = 1\n")
    before = key(tmp_path, "embodied.a")
    (package / "other.toml").write_text("x = 2\n")
    assert key(tmp_path, "embodied.a") == before
    (package / "own.toml").write_text("x = 2\n")
    assert key(tmp_path, "embodied.a") != before


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("x: int = 1", 'x: int = 1  # metres\n"""Length."""', True),
        ('def f():\n    """Says."""\n    return 1', "def f(): return 1", True),
        ("f('')", "f()", False),
        ("x = None", "x = ''", False),
        ("x = 1", "x = True", False),
        ("x = f'{a:<{b}} c'", "x = f'{a:<{b}}  c'", False),
        ("x = [a, b]", "x = (a, b)", False),
    ],
)
def test_what_code_does_counts_and_not_how_it_is_written(tmp_path, one, other, same):
    package = tmp_path / "embodied"
    package.mkdir()
    keys = []
    for text in (one, other):
        (package / "made.py").write_text(text)
        keys.append(key(tmp_path, "embodied.made"))
    assert (keys[0] == keys[1]) is same


PRODUCTS = {
    "bakes": ("embodied.light.baking.house", settings.UNCOUNTED_BY_LIGHT),
    "unwrappings": ("embodied.light.pages.unwrap", unwrap.UNCOUNTED_BY_UNWRAPPING),
    "boxes": ("embodied.scene.collision", collision.UNCOUNTED_MODULES),
    "models": (importer.READER, importer.APART),
}
DECIDED_BY = {
    "embodied/light/tracing/sky.py": {"bakes"},
    "embodied/house/shapes.py": {"bakes"},
    "embodied/light/pages/unwrap.py": {"bakes", "unwrappings"},
    "embodied/light/pages/colours.py": {"bakes"},
    "embodied/geometry.py": {"bakes", "unwrappings", "boxes"},
    "embodied/scene/collision.py": {"boxes"},
    "assets/records.py": {"bakes", "unwrappings", "boxes", "models"},
    "assets/importing/glb.py": {"models"},
    "embodied/light/settings.py": set(),
    "embodied/light/tracing/reference.py": set(),
    "embodied/light/__init__.py": set(),
    "embodied/scene/walls.py": set(),
    "embodied/gym/registration.py": set(),
    "assets/built/soft.py": set(),
    "assets/data/classes.json": set(),
}
"""File to the products that it decides. What builds a house's parts is in no bake's code: the parts themselves are in
its key."""
IN_KEY_OF = {
    "embodied/language/templates.toml": ("embodied.language.people_language",),
    "embodied/language/speakers.toml": ("embodied.language.people_language",),
    "embodied/generate/style_finishes.toml": ("embodied.generate",),
    "embodied/generate/furnish/smalls.toml": ("embodied.generate",),
    "assets/data/classes.json": ("embodied.assets.catalogue",),
    "embodied/house/house.py": makers(Unlit()),
    "embodied/scene/walls.py": makers(Unlit()),
    "assets/importing/meshing.py": makers(Unlit()),
    "assets/built/__init__.py": makers(Unlit()),
    "embodied/render/gloss.py": makers(Baked()),
}
"""File to what is made by it, also where it is a table, or imported by name inside a function."""


def add_to(path: Path) -> None:
    """Another constant, comment or line at the end of a file of code, of a table or of data."""
    with path.open("a") as f:
        f.write({".py": "X = 1\n", ".toml": "# another\n"}.get(path.suffix, "\n"))


@pytest.mark.slow
def test_products_follow_the_code_that_makes_them_and_no_other(tree):
    keys = lambda: {name: key(tree, module, without=apart) for name, (module, apart) in PRODUCTS.items()}
    before = keys()
    for file, decided in DECIDED_BY.items():
        add_to(tree / file)
        after = keys()
        assert {name for name in PRODUCTS if after[name] != before[name]} == decided, file
        before = after


def test_what_something_is_made_by_is_in_its_key_and_what_is_not_is_in_none(tree):
    for file, modules in IN_KEY_OF.items():
        before, apart = key(tree, *modules), key(tree, "embodied.seeds")
        add_to(tree / file)
        assert key(tree, *modules) != before and key(tree, "embodied.seeds") == apart, file
    lit = key(tree, *makers(Baked()))
    add_to(tree / "embodied/cli/demo.py")
    assert key(tree, *makers(Baked())) == lit


@pytest.mark.parametrize(
    ("modules", "without", "library"),
    [(("embodied.light.baking.house",), settings.UNCOUNTED_BY_LIGHT, "mitsuba"), (makers(Unlit()), (), "mujoco")],
)
def test_versions_of_the_libraries_that_decide_are_in_the_key(modules, without, library, monkeypatch):
    libraries = set(closure(*modules, without=without).libraries)
    assert {library, "numpy"} <= libraries and "tqdm" not in libraries
    before = key(ROOT, *modules, without=without)
    monkeypatch.setattr(closure_module, "_version", lambda name: "another" if name == library else "")
    assert key(ROOT, *modules, without=without) != before
    code_digest.cache_clear()


def test_pictures_depend_on_what_draws_them():
    unlit, lit = (set(closure(*makers(p)).modules) for p in (Unlit(), Baked()))
    assert "embodied.light.baking.house" in lit and not any(m.startswith("embodied.light") for m in unlit)
    assert "embodied.house.house" in unlit and not any(m.startswith("embodied.generate") for m in lit)
    assert "embodied.light.tracing.reference" in closure(*makers(Traced())).modules


def test_late_imports_count_and_those_for_type_checkers_do_not(tmp_path):
    (tmp_path / "embodied").mkdir()
    files = {
        "__init__": "",
        "a": "from typing import TYPE_CHECKING\nfrom . import b\nif TYPE_CHECKING:\n    import embodied.never\n",
        "b": "def f():\n    from embodied.c import C\n    import numpy.linalg\n    return C\n",
        "c": "import importlib\nC = importlib.import_module('embodied.d')\n",
        "d": "",
        "never": "",
    }
    for name, text in files.items():
        (tmp_path / "embodied" / f"{name}.py").write_text(text)
    whole = closure("embodied.a", root=tmp_path)
    assert list(whole.modules) == ["embodied", "embodied.a", "embodied.b", "embodied.c", "embodied.d"]
    assert whole.libraries == ("numpy",)
    with pytest.raises(ModuleNotFoundError, match=r"embodied\.nowhere"):
        closure("embodied.nowhere", root=tmp_path)


def test_a_neighbour_without_metadata_neither_stops_the_digest_nor_the_doctor(tmp_path, monkeypatch):
    before = closure_module._version("numpy")
    for folder in ("Foo-1.0.dist-info", "torch-2.0.dist-info", "-1.0.dist-info"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "RECORD").write_text("numpy/__init__.py,,\n")
    monkeypatch.syspath_prepend(tmp_path)
    closure_module._distributions.cache_clear()
    assert closure_module._version("numpy") == before
    closure_module._distributions.cache_clear()
    assert "agents" in doctor.extras(None).remedy, "torch is there without a version"


def test_an_optional_package_that_comes_or_goes_leaves_data_sets_as_they_are(monkeypatch):
    """What the project needs decides; what is installed besides does not."""
    needed = re.findall(r'^ +"([\w-]+)', re.search(r"\ndependencies = \[(.*?)\n\]", PROJECT, re.S)[1], re.M)
    code_digest.cache_clear()
    before, version = program(), closure_module._version
    names = {d.lower().replace("_", "-"): tops for tops, ds in closure_module._distributions().items() for d in ds}
    kept = {names.get(n.lower(), n) for n in needed}
    monkeypatch.setattr(closure_module, "_version", lambda n: version(n) if n in kept else "another")
    code_digest.cache_clear()
    assert program() == before
    monkeypatch.setattr(closure_module, "_version", lambda n: "another" if n == "shapely" else version(n))
    code_digest.cache_clear()
    assert program() != before
    code_digest.cache_clear()
