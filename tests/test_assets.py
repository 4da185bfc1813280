"""Truths about packs, import and the reviewed catalogue."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from handmade_models import CUBE, write_own, write_pack

from embodied.assets.built import BUILT_ASSETS
from embodied.assets.catalogue import attribution, load_catalogue
from embodied.assets.importing import sh3f
from embodied.assets.importing.importer import finish_parts, read_obj
from embodied.assets.importing.obj import MeshError, parse_obj
from embodied.assets.importing.sh3f import CATALOGUE, MAX_ENTRY, PackError, find_packs, open_pack
from embodied.assets.json_file import RecordError
from embodied.assets.records import ROOM_KINDS, SUPPORTS, ImportRecipe, bounds
from embodied.assets.rows import DATA
from embodied.light.tracing.rays import rays_among

SOME = (
    "scopia/bed1",
    "blendswap-cc-0/oakTable",
    "blendswap-cc-by/bookcase",
    "scopia/tubular_chair",
    "scopia/toaster",
    "katorlegaz/office-chair",
    "blendswap-cc-by/beer_bottle",
    "blendswap-cc-by/hangingLight",
    "scopia/table4+console",
    "scopia/vase1",
)
"""A handful of models to import; every one would take minutes."""


@pytest.fixture(scope="module")
def catalogue(shared_cache):
    assert find_packs(), "the furniture packs are missing: apt-get install sweethome3d-furniture"
    return load_catalogue(shared_cache)


# the reviewed catalogue


def test_every_word_of_the_catalogue_is_legal():
    catalogue = load_catalogue()
    classes = set(catalogue.classes) | set(json.loads((DATA / "classes.json").read_text()))
    for a in catalogue.assets.values():
        assert a.support in SUPPORTS and set(a.rooms) <= set(ROOM_KINDS), a.key
        assert a.name and a.object_class == a.object_class.lower().strip(), a.key
        assert all(0.0003 < s < 4 for s in a.size), a.key
        assert len(set(a.tags)) == len(a.tags), a.key
        assert bool(a.creator) != (a.key in BUILT_ASSETS) and a.licence, a.key
        if not a.key.startswith("built/"):
            assert (a.support == "surface") == bool(a.on), f"{a.key} needs `on` exactly if it rests on surfaces"
            assert a.rooms or {"person", "built_in"} & set(a.tags), a.key
    assert {o for a in catalogue.assets.values() if not a.key.startswith("built/") for o in a.on} & classes


def test_surfaces_lie_within_their_model():
    for a in load_catalogue().assets.values():
        assert len({s.name for s in a.surfaces}) == len(a.surfaces), a.key
        for s in a.surfaces:
            assert -a.size[0] / 2 - 0.005 <= s.x0 < s.x1 <= a.size[0] / 2 + 0.005, (a.key, s)
            assert -a.size[1] / 2 - 0.005 <= s.y0 < s.y1 <= a.size[1] / 2 + 0.005, (a.key, s)
            assert 0 < s.z <= a.size[2] + 0.002 and s.headroom > 0, (a.key, s)


def test_every_model_of_the_packs_is_used_or_excluded_for_a_reason(catalogue):
    excluded = json.loads((DATA / "excluded.json").read_text())
    known = {key for path in find_packs() for key in open_pack(path).entries}
    used = {k.split("+")[0] for k in catalogue.assets if not k.startswith(("built/", "people/"))}
    assert not used & set(excluded)
    assert used | set(excluded) == known
    assert all(reason for reason in excluded.values())


def test_attribution_names_every_maker(catalogue):
    text = attribution(catalogue)
    listed = {n for line in text.splitlines() if line.startswith("- ") for n in line.split(": ", 1)[1].split(", ")}
    for a in catalogue.assets.values():
        if a.key in BUILT_ASSETS and not a.key.startswith("built/"):
            assert a.key.split("/", 1)[1] not in listed, f"{a.key} is built, and nobody else made it"
        elif a.key not in BUILT_ASSETS and a.pack != "people":
            assert a.creator in text and a.key.split("/", 1)[1].split("+")[0] in text


def test_attribution_file_is_up_to_date(catalogue):
    file = Path(__file__).parent.parent / "ATTRIBUTION.md"
    assert file.read_text() == attribution(catalogue), "run `embodied assets attribution --out ATTRIBUTION.md`"


# import


def touched(parts, surface, points: int = 12) -> float:
    """Share of a grid of points of `surface` under which the mesh lies within 5 mm of its height."""
    low, high = np.array([surface.x0, surface.y0]), np.array([surface.x1, surface.y1])
    xy = low + (high - low) * (np.indices((points, points)).reshape(2, -1).T + 0.5001) / points
    start = np.column_stack([xy, np.full(len(xy), surface.z + 0.005)])
    corners = np.concatenate([p.vertices[p.faces] for p in parts])
    face, far, _, _ = rays_among(corners)(start, np.tile([0.0, 0.0, -1.0], (len(xy), 1)))
    return float(((face >= 0) & (far < 0.01)).mean())


@pytest.mark.slow
@pytest.mark.parametrize("key", SOME)
def test_imported_models_are_sound_as_large_as_the_catalogue_says_and_carry_things(catalogue, key):
    parts = catalogue.mesh(key)
    low, high = bounds(parts)
    np.testing.assert_allclose(high - low, catalogue.assets[key].size, atol=0.01)
    np.testing.assert_allclose([*(low + high)[:2] / 2, low[2]], 0.0, atol=0.005)
    for p in parts:
        assert len(p.vertices) == len(p.normals) == len(p.uv)
        assert p.faces.min() >= 0 and p.faces.max() < len(p.vertices)
        assert all(np.isfinite(a).all() for a in (p.vertices, p.normals, p.uv))
        np.testing.assert_allclose(np.linalg.norm(p.normals, axis=1), 1.0, atol=1e-3)
        corners = p.vertices[p.faces]
        flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.einsum("ij,ij->i", flat, p.normals[p.faces].sum(axis=1)) > 0).mean() > 0.99
        assert p.finish.texture is None or Path(p.finish.texture).is_file()
    for surface in catalogue.assets[key].surfaces:
        assert touched(parts, surface) >= 0.95, surface


@pytest.mark.slow
@pytest.mark.parametrize("key", ["blendswap-cc-by/hangingLight", "scopia/desk_lamp1", "katorlegaz/wall-spotlight"])
def test_a_lamp_glows(catalogue, key):
    assert any(p.finish.emission is not None for p in catalogue.mesh(key))


def test_mesh_is_stretched_to_the_size_asked_for(catalogue):
    low, high = bounds(catalogue.mesh("scopia/toaster", (0.5, 0.2, 0.4)))
    np.testing.assert_allclose(high - low, (0.5, 0.2, 0.4), atol=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    "damage", [lambda p: p.write_bytes(p.read_bytes()[:-100]), lambda p: p.unlink(), lambda p: p.write_bytes(b"x" * 50)]
)
@pytest.mark.parametrize("suffix", ["npz", "json", "png"])
def test_a_damaged_cache_is_repaired(tmp_path, damage, suffix):
    key = "scopia/toaster"
    before = load_catalogue(tmp_path).mesh(key)
    file = next((tmp_path / "assets").rglob(f"*.{suffix}"))
    whole = file.read_bytes()
    damage(file)
    after = load_catalogue(tmp_path).mesh(key)
    assert all((a.vertices == b.vertices).all() for a, b in zip(before, after, strict=True))
    assert suffix == "npz" or file.read_bytes() == whole


def test_a_missing_pack_is_named_with_the_remedy_and_an_installed_one_is_found_by_all(tmp_path, monkeypatch):
    library = next(p for p in find_packs() if "scopia/bed1" in open_pack(p).entries)
    for name in ("SYSTEM_FOLDER", "OWN_FOLDER"):
        monkeypatch.setattr(sh3f, name, tmp_path / name)
    monkeypatch.setattr(sh3f, "WHEEL", "no_such_package")
    with pytest.raises(PackError, match="sweethome3d-furniture.*--pack"):
        load_catalogue(tmp_path).mesh("scopia/bed1")
    assert list(sh3f.install_packs([library])) == [tmp_path / "OWN_FOLDER" / library.name]
    assert load_catalogue(tmp_path).mesh("scopia/bed1")
    with pytest.raises(PackError, match="does not exist"):
        find_packs([tmp_path / "none.sh3f"])


def test_an_unknown_asset_is_named(catalogue):
    with pytest.raises(RecordError, match="no asset 'scopia/unicorn'"):
        catalogue.mesh("scopia/unicorn")


# polygons


def test_a_concave_polygon_is_filled_exactly():
    u = "v 0 0 0\nv 3 0 0\nv 3 0 3\nv 2 0 3\nv 2 0 1\nv 1 0 1\nv 1 0 3\nv 0 0 3\nf 8 7 6 5 4 3 2 1"
    obj = parse_obj(u.encode(), "u")
    corners = obj.vertices[obj.groups[0].corners]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert np.abs(areas).sum() == pytest.approx(7.0)
    assert (areas[:, 1] > 0).all()


def test_front_and_up_follow_sweet_home_3d():
    """+z of the file becomes the front, -y; +y becomes up."""
    marker = "v 0 0 1\nv 1 0 1\nv 0 2 1\nv 0 0 0\nf 1 2 3\nf 1 3 4\nf 4 2 1"
    model = read_obj({"m.obj": marker.encode()}.__getitem__, "m.obj", "m")
    parts = [p for p, _ in finish_parts(model, ImportRecipe("m", (1, 1, 2)))]
    low, high = bounds(parts)
    top = parts[0].vertices[parts[0].vertices[:, 2].argmax()]
    np.testing.assert_allclose(top, [-0.5, -0.5, 2.0], atol=1e-5)
    np.testing.assert_allclose(high - low, [1, 1, 2], atol=1e-5)


# libraries


def write_library(path: Path, rows: str, *models: str) -> Path:
    with zipfile.ZipFile(path, "w") as z:
        z.writestr(CATALOGUE, rows)
        for name in models:
            z.writestr(name, CUBE)
    return path


LIBRARY = r"""
# a comment that ends in a backslash \
id#1=me#oak
name#1 = Oak
model#1=/chairs/oak.obj
width#1=10
depth#1=10
height#1=10
! another kind of comment
id#2 : me#elm
name#2 : Elm
model#2 : /chairs/el\
    m.obj
width#2 20
depth#2 20
height#2: 20
id#3=me\#small
model#3=/tables/plain.obj
width#3=30
depth#3=30
height#3=30
id#4=me\#large
model#4=/tables/plain.obj
width#4=40
depth#4=40
height#4=40
model#5=/lamps/\u006camp.obj
width#5=wide
depth#5=50
height#5=50
model#6=/beds/bed.obj
width#6=60
depth#6=60
height#6=60
model#7=/beds/gone.obj
model#8=/beds/bed.dae
width#9=9
"""
SIZES = {"chairs/oak": 0.1, "chairs/elm": 0.2, "tables/plain/small": 0.3, "tables/plain/large": 0.4, "beds": 0.6}


def test_every_row_of_a_library_is_a_model_of_its_own_and_a_bad_one_is_left_out(tmp_path, caplog):
    models = "chairs/oak.obj", "chairs/elm.obj", "tables/plain.obj", "lamps/lamp.obj", "beds/bed.obj", "beds/bed.dae"
    own = write_own(
        tmp_path / "own", {k: {"file": "a.sh3f", "model": m, "class": "mug"} for k, m in zip("abcde", SIZES)}
    )
    write_library(own / "a.sh3f", LIBRARY, *models)
    catalogue = load_catalogue(tmp_path, own=[own])
    assert {k: e.size[0] for k, e in open_pack(own / "a.sh3f").entries.items()} == SIZES
    for name, size in zip("abcde", SIZES.values()):
        np.testing.assert_allclose(np.ptp(bounds(catalogue.mesh(f"mine/{name}")), axis=0), size, rtol=1e-4)
    assert "4 of 9 models are left out" in caplog.text and caplog.text.count("left out") == 1
    for words in (
        "model 5 should have a number for width, got 'wide'",
        "model 7 names 'beds/gone.obj', which is not in the library",
        "model 8 should name an .obj file, got 'beds/bed.dae'",
        "model 9 should name an .obj file, got ''",
    ):
        assert words in caplog.text


def test_another_model_of_a_library_under_one_name_is_imported_anew(tmp_path):
    own = tmp_path / "own"
    for model, faces in (("chairs/oak", 12), ("chairs/elm", 2)):
        write_own(own, {"a": {"file": "a.sh3f", "model": model, "class": "mug", "size": [1, 1, 1]}})
        if faces == 12:
            write_library(own / "a.sh3f", LIBRARY, "chairs/oak.obj")
            with zipfile.ZipFile(own / "a.sh3f", "a") as z:
                z.writestr("chairs/elm.obj", "\n".join(CUBE.split("\n")[:8] + ["f 1 3 4 2"]))
        parts = load_catalogue(tmp_path, own=[own]).mesh("mine/a")
        assert sum(len(p.faces) for p in parts) == faces


def test_a_library_whose_rows_are_all_bad_says_so(tmp_path):
    with pytest.raises(PackError, match="1 of 1 models are left out: model 1 should have a positive size"):
        open_pack(write_library(tmp_path / "a.sh3f", "model#1=a.obj\nwidth#1=0\ndepth#1=1\nheight#1=1", "a.obj"))


# hostile and broken packs


@pytest.mark.parametrize(
    "name", ["../evil.obj", "/etc/evil.obj", "mine\\..\\evil.obj", "a/../../evil.obj", "C:evil.obj"]
)
def test_a_pack_whose_names_climb_out_is_refused(tmp_path, name):
    path = write_pack(tmp_path / "evil.sh3f", {"mine/box/box.obj": CUBE})
    with zipfile.ZipFile(path, "a") as z:
        info = zipfile.ZipInfo("x")
        info.filename = name
        z.writestr(info, "boo")
    with pytest.raises(PackError, match="outside the library"):
        open_pack(path)


def test_what_is_no_pack_or_unpacks_to_more_than_it_says_is_refused(tmp_path):
    (tmp_path / "none.sh3f").write_text("hello")
    with zipfile.ZipFile(tmp_path / "letters.sh3f", "w") as z:
        z.writestr("readme.txt", "hello")
    liar = write_pack(tmp_path / "liar.sh3f", {"mine/box/box.obj": np.random.default_rng(0).bytes(4096)})
    data = bytearray(liar.read_bytes())
    at = data.rindex(b"PK\x01\x02")
    data[at + 24 : at + 28] = struct.pack("<I", 100)
    liar.write_bytes(data)
    write_pack(tmp_path / "bomb.sh3f", {"mine/box/box.obj": b"\0" * (MAX_ENTRY // 2)})
    for name, message in (
        ("none", "not a .sh3f library"),
        ("letters", "PluginFurnitureCatalog"),
        ("liar", "cannot be read"),
        ("bomb", "bomb"),
    ):
        with pytest.raises(PackError, match=message):
            open_pack(tmp_path / f"{name}.sh3f").read("mine/box/box.obj")


def test_a_broken_mesh_is_refused_and_never_cached(tmp_path):
    own = write_own(tmp_path / "own", {"box": {"file": "box.sh3f", "model": "mine/box", "class": "cardboard box"}})
    write_pack(own / "box.sh3f", {"mine/box/box.obj": "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3"})
    with pytest.raises(MeshError, match="have no area"):
        load_catalogue(tmp_path, own=[own]).mesh("mine/box")
    assert not list((tmp_path / "assets").rglob("*.npz"))
