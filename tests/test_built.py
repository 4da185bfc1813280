"""Things built in code have the size they are asked for, face outward and are the same everywhere."""

from __future__ import annotations

import functools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapely

from embodied.assets.built import BUILDS, BUILT_ASSETS, read_built_assets, remade, soft, storage, tableware
from embodied.assets.built.primitives import (
    ball,
    bar,
    box,
    cylinder,
    extruded,
    fitted,
    flat,
    lathe,
    part,
    pillow,
    sheet,
    tube,
)
from embodied.assets.json_file import RecordError
from embodied.assets.materials import MATERIALS, read_materials
from embodied.assets.records import Finish
from embodied.assets.rows import read_models


@functools.cache
def finish(key: str) -> Finish:
    """A finish without maps: the makers need its tile only."""
    return Finish(tile=MATERIALS[key].tile)


def builders() -> list[str]:
    """One key for each builder function and set of arguments."""
    seen, keys = set(), []
    for key, m in BUILT_ASSETS.items():
        _, build, look = m.make.args
        path = (build.__name__, tuple(sorted(look)), tuple(sorted(str(v) for k, v in look.items() if k == "kind")))
        if path not in seen:
            seen.add(path)
            keys.append(key)
    return keys


def volume(shape) -> float:
    p = shape.vertices[shape.faces].astype(float)
    return float(np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6)


def against_normals(shape) -> int:
    """Faces whose winding disagrees with their vertex normals."""
    p = shape.vertices[shape.faces].astype(float)
    n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    mean = shape.normals[shape.faces].astype(float).mean(1)
    area = np.linalg.norm(n, axis=1)
    return int((((n * mean).sum(1) < -0.2 * area) & (area > 1e-9)).sum())


def open_edges(shape) -> int:
    """Edges, welded by position, that do not belong to two faces in opposite directions."""
    _, weld = np.unique(np.round(shape.vertices, 6), axis=0, return_inverse=True)
    f = weld.reshape(-1)[shape.faces]
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    edges = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]])
    forward, count = np.unique(edges, axis=0, return_counts=True)
    backward = {tuple(e) for e in forward[:, ::-1].tolist()}
    return int((count > 1).sum()) + sum(tuple(e) not in backward for e in forward.tolist())


SQUARE = shapely.box(0, 0, 2, 1)
CLOSED = {
    "box": (box([0, 0, 0], [1, 2, 3]), 6.0),
    "bevelled box": (
        box([0, 0, 0], [1, 2, 3], 0.1),
        6.0 - 0.02 * (1 + 2 + 3) * 1.0 + 8 * 0.1**3 * (0.5 - 1 / 6 + 1 / 6),
    ),
    "cylinder": (cylinder(1, 0, 2, segments=400), 2 * np.pi),
    "ball": (ball(1, 120, 91), 4 / 3 * np.pi),
    "ring": (
        tube([(np.cos(t), np.sin(t), 0) for t in np.linspace(0, 2 * np.pi, 300)[:-1]], 0.1, 60, closed=True),
        2 * np.pi**2 * 0.01,
    ),
    "bar": (bar((0, 0, 0), (3, 4, 0), 0.2, 0.1), 0.1),
    "plate with a hole": (extruded(SQUARE.difference(shapely.box(0.5, 0.2, 1, 0.7)), 0, 2), 3.5),
    "bowl": (lathe([(0, 0), (1, 0), (1, 1), (0.9, 1), (0.9, 0.1), (0, 0.1)], 300), np.pi * (1 - 0.81 * 0.9)),
    "slab": (
        sheet(
            np.stack([*np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 2, 4)), np.zeros((4, 5))], -1)[..., [0, 2, 1]],
            0.1,
        ),
        0.2,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CLOSED)
def test_a_primitive_is_closed_faces_outward_and_has_its_volume(name):
    shape, expected = CLOSED[name]
    assert open_edges(shape) == 0
    assert against_normals(shape) == 0
    assert volume(shape) == pytest.approx(expected, rel=0.01)
    assert np.abs(np.linalg.norm(shape.normals, axis=1) - 1).max() < 1e-9


def test_a_pillow_is_closed_and_moving_shapes_keeps_them_outward():
    for shape in (
        pillow(0.4, 0.5, 0.15),
        box([0, 0, 0], [1, 1, 1], 0.1).scaled(-1, 1, 2),
        cylinder(1, 0, 1).turned(1.0, "x"),
    ):
        assert volume(shape) > 0 and against_normals(shape) == 0
    assert volume(box([0, 0, 0], [1, 2, 3]).scaled(1, -2, 1)) == pytest.approx(12)


def test_a_flat_polygon_has_its_area_and_looks_up_or_down():
    ell = shapely.Polygon([(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)])
    for up in (True, False):
        s = flat(ell, 2.0, up)
        p = s.vertices[s.faces]
        n = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        assert n[:, 2].sum() / 2 == pytest.approx(6.0 if up else -6.0)
        assert (np.sign(n[:, 2]) == (1 if up else -1)).all() and (s.vertices[:, 2] == 2.0).all()


def test_uv_is_in_metres_so_that_one_tile_covers_one_tile():
    board = part(Finish(tile=0.5), box([0, 0, 0], [2.0, 0.1, 0.02]))
    p, uv = board.vertices[board.faces].astype(float), board.uv[board.faces].astype(float)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        metres = np.linalg.norm(p[:, a] - p[:, b], axis=1)
        assert np.allclose(np.linalg.norm(uv[:, a] - uv[:, b], axis=1) * 0.5, metres, atol=1e-6)
    assert np.ptp(board.uv[-4:], axis=0) == pytest.approx([4.0, 0.2]), "the grain runs along the board"
    assert np.allclose(fitted([board], (1, 1, 1))[0].uv, board.uv)


@pytest.mark.parametrize("key", builders())
def test_a_built_thing_is_as_large_as_asked_and_faces_outward(key):
    maker = BUILT_ASSETS[key]
    for factor in ((1, 1, 1), (1.1, 1.0, 0.93)):
        size = tuple(s * f for s, f in zip(maker.asset.size, factor, strict=True))
        parts = maker.make(size, (), finish)
        low = np.min([p.vertices.min(0) for p in parts], axis=0)
        high = np.max([p.vertices.max(0) for p in parts], axis=0)
        assert np.abs(high - low - size).max() < 1e-3
        assert np.abs((low + high)[:2]).max() < 1e-3 and abs(low[2]) < 1e-3
    faces = sum(len(p.faces) for p in parts)
    assert 4 <= faces <= 5000, f"{key} has {faces} faces; give it at most 5000"
    for p in parts:
        assert p.vertices.dtype == p.normals.dtype == p.uv.dtype == np.float32 and p.faces.dtype == np.int32
        assert np.isfinite(p.vertices).all() and np.isfinite(p.uv).all()
        assert np.abs(np.linalg.norm(p.normals, axis=1) - 1).max() < 1e-3
        assert p.faces.min() >= 0 and p.faces.max() < len(p.vertices)
        assert against_normals(p) <= 0.02 * len(p.faces), f"{key}: faces look inward"
    assert any(p.finish.emission is not None for p in parts) == (maker.asset.emits is not None), "what glows is a lamp"
    glass = [p for p in parts if p.finish.mirror]
    if maker.asset.object_class == "mirror":
        assert len(glass) == 1 and (glass[0].normals[:, 1] < -0.99).all(), "the glass looks along -y"


def test_assets_are_what_the_catalogue_expects():
    assert len(BUILT_ASSETS) >= 60 and len(builders()) >= 60
    classes = {m.asset.object_class for m in BUILT_ASSETS.values()}
    assert {"rug", "curtain", "picture", "mirror", "base cabinet", "kitchen sink", "towel", "cushion"} <= classes
    for key, m in BUILT_ASSETS.items():
        a = m.asset
        assert a.key == key and a.pack == key.split("/")[0]
        assert (a.support != "surface") or a.on, f"{key} lies on nothing"


DIGEST = """
import hashlib, numpy as np
from embodied.assets.built import BUILT_ASSETS
from embodied.assets.records import Finish
h = hashlib.sha256()
for key in ("built/curtain_linen_0", "built/book_row_2", "built/coat_hooks_0", "built/potted_plant_broad_grey"):
    for p in BUILT_ASSETS[key].make(BUILT_ASSETS[key].asset.size, (), lambda k: Finish(tile=0.5)):
        h.update(np.round(p.vertices * 1e5).astype("int64").tobytes() + p.faces.tobytes())
print(h.hexdigest())
"""


@pytest.mark.slow
def test_another_process_builds_the_same_things(capsys):
    exec(DIGEST, {})
    command = [sys.executable, "-c", DIGEST]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == capsys.readouterr().out


def test_params_override_the_look_and_the_seed_changes_only_the_details():
    m = BUILT_ASSETS["built/book_row_0"]
    one, other = (m.make(m.asset.size, p, finish) for p in ((), (("seed", 5),)))
    assert len(one[0].vertices) != len(other[0].vertices) or not np.array_equal(one[0].vertices, other[0].vertices)
    asked = []
    BUILT_ASSETS["built/rug"].make(
        (2, 1, 0.01), (("pattern", "rug_kilim/0"),), lambda key: asked.append(key) or finish(key)
    )
    assert asked == ["rug_kilim/0"]
    with pytest.raises(ValueError, match="must be positive"):
        BUILT_ASSETS["built/rug"].make((2, 0, 0.01), (), finish)


# the table


def things(**row) -> dict:
    first = {"class": "vase", "build": "decor.vase", "size": [0.1, 0.1, 0.2], "support": "surface", "on": ["desk"]}
    return {"sets": {"sky": {"word": "blue", "colours": ["blue"], "look": {"glaze": "blue"}}}, "groups": [first | row]}


def test_a_new_row_is_a_new_thing():
    made = read_built_assets("table", things(name="{} vase", rows={"a": {"set": "sky"}, "b": {"name": "plain vase"}}))
    a, b = made["built/a"], made["built/b"]
    assert (a.asset.name, a.asset.colours, a.asset.licence) == ("blue vase", ("blue",), "Apache-2.0")
    assert a.params == {"seed": 0.0, "glaze": "blue"} and b.params == {"seed": 0.0} and b.asset.name == "plain vase"
    assert len(a.make(a.asset.size, (), finish)) == len(BUILT_ASSETS["built/vase_blue"].make(a.asset.size, (), finish))


def test_what_stands_for_a_poor_model_keeps_its_key_words_and_variants():
    row = {"class": "vase", "name": "tall vase", "size": [0.1, 0.1, 0.3]}
    row |= {"build": "decor.vase", "look": {"glaze": "blue"}}
    variant = {"of": "pack/a", "class": "vase", "look": {"seed": 2}}
    rows = {"pack/a": row, "pack/a+red": variant, "pack/b": {"class": "vase", "size": [1, 1, 1]}}
    classes = {"vase": {"support": "surface", "on": ["desk"]}}
    assets, recipes = read_models("table", rows, classes, {"pack": "CC0-1.0"})
    makers = remade("table", rows, assets)
    assert set(recipes) == {"pack/b"} and set(makers) == {"pack/a", "pack/a+red"}
    assert makers["pack/a"].asset.name == "tall vase" and makers["pack/a"].asset.on == ("desk",)
    assert makers["pack/a+red"].params == {"seed": 2, "glaze": "blue"}
    assert (assets["pack/a"].licence, assets["pack/b"].licence) == ("Apache-2.0", "CC0-1.0")
    with pytest.raises(RecordError, match="decor.vase"):
        remade("table", {"pack/a": row | {"build": "decor.vases"}}, assets)


def test_a_thing_after_a_material_takes_its_words():
    rows = {"a": {"look": {"cloth": "linen/0"}}}
    row = {"class": "cushion", "build": "soft.cushion", "name": "{} cushion", "after": "cloth"}
    (maker,) = read_built_assets("table", things(rows=rows, **row)).values()
    linen = MATERIALS["linen/0"]
    assert maker.asset.name == f"{linen.name} cushion" and maker.asset.materials == linen.materials


@pytest.mark.parametrize(
    ("row", "match"),
    [
        ({"build": "decor.vases"}, "decor.vase"),
        ({"set": "sea"}, "'set' out of sky, got 'sea'"),
        ({"after": "cloth"}, "should be a material's key, got None"),
        ({"emits": "sun"}, "'emits' out of bulb"),
        ({"surfaces": "tops"}, "'surfaces' out of shelves, top"),
        ({"look": {"glaze": []}}, "should be a text"),
        ({"size": [1, 1]}, "should be a list of 3"),
        ({"size": [1, 1, 31]}, "three lengths"),
        ({"colour": "red"}, "unknown fields"),
    ],
)
def test_a_wrong_row_is_named_with_what_it_should_hold(row, match):
    with pytest.raises(RecordError, match=match) as caught:
        read_built_assets("table", things(rows={"a": row}))
    assert "'a'" in str(caught.value)


def test_every_builder_and_every_rug_of_the_materials_is_in_the_table():
    built = {m.make.args[1] for m in BUILT_ASSETS.values()}
    helpers = {storage.shelf_surfaces, storage.top_surface, soft.layers, tableware.cup}
    assert set(BUILDS.values()) - helpers == built
    rugs = {str(m.params["pattern"]) for m in BUILT_ASSETS.values() if "pattern" in m.params}
    assert {key for key, m in MATERIALS.items() if m.family == "rug"} <= rugs
    shown = {str(m.params["art"]) for m in BUILT_ASSETS.values() if "art" in m.params}
    assert {key for key, m in MATERIALS.items() if m.family == "art"} <= shown


def test_the_rows_that_the_documentation_shows_are_good_rows():
    text = (Path(__file__).parent.parent / "docs" / "assets.md").read_text()
    groups = [json.loads(block.split("```")[0]) for block in text.split("```json\n")[2:]]
    things, materials = groups
    assert list(read_built_assets("docs", {"sets": {}, "groups": [things]})) == ["built/vase_blue", "built/vase_white"]
    (lime,) = read_materials("docs", {"groups": [materials]}).values()
    assert lime.draw(64, rng=np.random.default_rng(0)).color.shape == (64, 64, 3)
