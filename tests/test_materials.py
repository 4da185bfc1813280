"""Materials tile, are the same everywhere, and look like what they are called."""

from __future__ import annotations

import ast
import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from embodied.assets.json_file import RecordError
from embodied.assets.materials import MATERIALS, PAINTERS, fingerprint, finish, make_maps, painters_of, read_materials

PICTURES = ("art", "rug", "label")
"""Families that are shown once, not repeated."""


def seam_ratio(image: np.ndarray) -> float:
    """Step across the tile's border over the largest step that is usual between its rows and columns."""
    worst = 0.0
    for axis in (0, 1):
        inner = np.abs(np.diff(image, axis=axis)).mean(axis=tuple(k for k in range(image.ndim) if k != axis))
        border = np.abs(np.take(image, 0, axis) - np.take(image, -1, axis)).mean()
        worst = max(worst, float(border / max(np.percentile(inner, 99.5) * 1.05, 1e-4)))
    return worst


def one_of_each_recipe() -> list[str]:
    """One key per set of painters, so that every code path is tried once."""
    seen, keys = set(), []
    for key, m in MATERIALS.items():
        path = frozenset(painters_of(m.maps))
        if path not in seen and m.family not in PICTURES:
            seen.add(path)
            keys.append(key)
    return keys


@pytest.mark.slow
@pytest.mark.parametrize("key", one_of_each_recipe())
def test_a_material_tiles_without_a_seam_and_its_maps_are_sane(key):
    n = MATERIALS[key].pixels // 2
    maps = MATERIALS[key].draw(n, rng=np.random.default_rng(3))
    assert maps.color.shape == (n, n, 3)
    assert maps.color.dtype == np.float32 and maps.color.min() > 0 and maps.color.max() < 1
    assert 0 < maps.roughness <= 1
    assert seam_ratio(maps.color) <= 1.1


def test_the_maps_on_disk_are_whole_or_made_again(tmp_path):
    first = finish("cotton/0", tmp_path)
    assert first.texture.startswith(str(tmp_path)) and first.tile == MATERIALS["cotton/0"].tile
    before = Path(first.texture).read_bytes()
    Path(first.texture).write_bytes(before[:100])
    finish.cache_clear()
    again = finish("cotton/0", tmp_path)
    assert again == first and Path(again.texture).read_bytes() == before


@pytest.mark.slow
def test_another_process_makes_the_same_maps():
    code = (
        "import hashlib; from embodied.assets.materials import make_maps, fingerprint; m = make_maps('linen/3');"
        "print(hashlib.sha256((m.color * 255).round().astype('uint8').tobytes()).hexdigest(), fingerprint('linen/3'))"
    )
    other = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=600
    ).stdout.split()
    mine = hashlib.sha256((make_maps("linen/3").color * 255).round().astype("uint8").tobytes()).hexdigest()
    assert other == [mine, fingerprint("linen/3")]


@pytest.mark.slow
def test_fingerprints_differ_and_unknown_keys_say_what_exists(tmp_path):
    prints = [fingerprint(k) for k in MATERIALS]
    assert len(set(prints)) == len(prints)
    with pytest.raises(ValueError, match=r"oak_planks/7.*oak_planks/0"):
        finish("oak_planks/7", tmp_path)


# the table


ROW = {
    "family": "paint",
    "name": "lime paint",
    "colours": ["green"],
    "materials": ["paint"],
    "tile": 1.0,
    "pixels": 64,
    "maps": {"by": "surface.paint", "color": [0.6, 0.9, 0.2]},
}


def table(**changes) -> dict:
    return {"groups": [{"rows": {"paint_lime/0": ROW | changes}}]}


def test_a_new_row_is_a_new_material():
    (material,) = read_materials("table", table()).values()
    maps = material.draw(64, rng=np.random.default_rng(0))
    assert material.name == "lime paint" and np.abs(maps.color.mean((0, 1)) - (0.6, 0.9, 0.2)).max() < 0.01


def test_what_a_group_shares_may_be_overridden_and_its_recipe_is_filled_up():
    shared = {k: v for k, v in ROW.items() if k != "maps"} | {"maps": {"by": "surface.paint", "rough": 0.3}}
    made = read_materials(
        "table",
        {"groups": [shared | {"rows": {"a/0": {"maps": {"color": [0.5, 0.5, 0.5]}}, "a/1": {**ROW, "tile": 2}}}]},
    )
    rough = made["a/0"].draw(64, rng=np.random.default_rng(0)).roughness
    assert abs(rough - 0.3) < 0.02 and (made["a/0"].tile, made["a/1"].tile) == (1.0, 2.0)
    assert made["a/1"].maps == {"by": "surface.paint", "rough": 0.3, "color": [0.6, 0.9, 0.2]}


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"role": ["rug"]}, "unknown fields"),
        ({"tile": 0}, "a length"),
        ({"pixels": 1.5}, "should be an integer"),
        ({"maps": {"by": "surface.print"}}, 'should have a "by" out of'),
        ({"maps": {}}, 'should have a "by" out of'),
        ({"maps": {"by": "surface.paint", "colour": [1, 0, 0]}}, r"does not take \['colour'\]"),
    ],
)
def test_a_wrong_row_is_named_with_what_it_should_hold(changes, match):
    with pytest.raises(RecordError, match=match) as caught:
        read_materials("table", table(**changes))
    assert "paint_lime/0" in str(caught.value)


def test_every_painter_of_the_table_exists_for_a_material():
    """What no row names is dead: a recipe, layout, face or motif that nobody sees."""
    named = set().union(*(painters_of(m.maps) for m in MATERIALS.values()))
    helpers = {p for p in PAINTERS if p.startswith("maps.")} | {"textile.folds", "wood.boards", "wood.Species"}
    assert set(PAINTERS) - helpers <= named


def test_painters_run_no_code_that_fingerprints_do_not_know():
    for module in {p.__module__ for p in PAINTERS.values()}:
        tree = ast.parse(Path(sys.modules[module].__file__).read_text())
        names = {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module}
        allowed = {f"embodied.assets.{name}" for name in ("json_file", "materials.maps", "records")}
        assert {n for n in names if n.startswith("embodied")} <= allowed, module
