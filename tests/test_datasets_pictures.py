"""The pictures of a data set: which are drawn, what is kept, who believes them, and features that come from them."""

from __future__ import annotations

import os
import shutil
from typing import Any

import numpy as np
import pytest
from hand_data import build, random_encoder, small_house
from handmade import HandCatalogue

from embodied.agents.vision import run as vision
from embodied.agents.vision.config import LATER_CAMERA, PLAIN, RENDER_PRESETS, SAME_TIME
from embodied.agents.vision.features import encode_panoramas, feature_path, load_features
from embodied.agents.vision.run import Extractor, captured_path
from embodied.cli.dataset import chosen_pictures
from embodied.datasets import build as building
from embodied.datasets.store import Dataset
from embodied.render.panorama import Panorama
from embodied.render.panorama_file import write_panoramas
from embodied.render.pictures import Baked, PictureSettings, Unlit
from embodied.world import World

SMALL = Unlit(size=16)


def test_houses_are_drawn_lit_unless_the_kind_needs_words_only_or_pictures_are_there():
    assert chosen_pictures("hanna", None, None, None) == Baked("fast")
    assert chosen_pictures("find", None, 128, None) == Baked("fast", size=128)
    assert chosen_pictures("hari", None, None, None) is None
    assert chosen_pictures("hari", "unlit", None, None) == Unlit()
    held = Baked(size=192)
    assert chosen_pictures("hanna", None, None, held) == held, "not drawn again in another way that nobody asked for"
    assert chosen_pictures("hanna", None, 64, held) == Baked(size=64)
    assert chosen_pictures("hanna", "fast", None, held) == Baked("fast")
    assert chosen_pictures("hanna", "none", None, held) is None


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Dataset:
    """Three small houses by hand, without pictures."""
    folder = tmp_path_factory.mktemp("pictures")
    return build(folder / "data", folder / "cache", "find", size="1x4", make_house=small_house)


@pytest.fixture(autouse=True)
def hand_catalogue(monkeypatch):
    for module in (building, vision):
        monkeypatch.setattr(module, "load_catalogue", lambda *_, **__: HandCatalogue())


def files(data: Dataset) -> dict[str, int]:
    """House to when its panoramas were written."""
    return {p.parent.name: p.stat().st_mtime_ns for p in sorted(data.folder.glob("houses/*/panoramas.pano"))}


def pano(data: Dataset, name: str):
    return data.folder / "houses" / name / "panoramas.pano"


def draw(data: Dataset, pictures: PictureSettings = SMALL) -> None:
    building.draw_panoramas(data.config, data.folder, data.folder / "cache", pictures=pictures)


def grey(level: int, size: int = 16) -> Panorama:
    faces = np.full((6, size, size, 3), level, np.uint8)
    return Panorama(faces, np.ones((6, size, size), np.float32), np.zeros((6, size, size), np.int32))


def pretend_drawn(data: Dataset, name: str, pictures: PictureSettings, **other: str) -> None:
    """Grey pictures that say of themselves that they were drawn so."""
    place = data.place(name)
    world = World(place.house, HandCatalogue(), place.graph, data.folder / "cache", pictures)
    nodes = [grey(40 + i, pictures.size) for i in range(len(place.graph.ids))]
    write_panoramas(pano(data, name), nodes, {**world.fingerprint, **other})


@pytest.mark.slow
@pytest.mark.gl
def test_drawing_goes_on_where_it_was_stopped(data, caplog):
    draw(data)
    first, names = files(data), [u.name for u in building.units(data.scale)]
    assert sorted(first) == sorted(names) and data.pictures == SMALL
    pano(data, names[0]).unlink()  # killed before this one
    shutil.rmtree(data.folder / "cache" / "panoramas")
    cut = pano(data, names[1])
    cut.write_bytes(cut.read_bytes()[:-9])  # or the disk was full
    draw(data)
    again = files(data)
    assert {n for n in names if again[n] != first[n]} == set(names[:2])
    assert all(data.drawn_pictures(n) == SMALL for n in names)
    draw(data, Unlit(size=8))
    assert all(data.drawn_pictures(n).size == 8 for n in names), "another size is drawn anew"


@pytest.mark.slow
@pytest.mark.gl
def test_data_sets_over_the_same_houses_share_their_pictures(data, tmp_path):
    other = build(tmp_path / "vnla", tmp_path / "cache", "vln", size="1x4", make_house=small_house)
    names = [u.name for u in building.units(data.scale)]
    for one in (data, other):
        for name in names:
            pano(one, name).unlink(missing_ok=True)
        building.draw_panoramas(one.config, one.folder, tmp_path / "shared", pictures=SMALL)
    for name in names:
        assert data.place(name).house.digest == other.place(name).house.digest
        assert pano(data, name).samefile(pano(other, name)), "drawn once, kept once"
    kept = next((tmp_path / "shared" / "panoramas").iterdir())
    pano(other, names[0]).write_bytes(b"damaged")  # wherever it lies, nobody believes it
    building.draw_panoramas(other.config, other.folder, tmp_path / "shared", pictures=SMALL)
    assert other.drawn_pictures(names[0]) == SMALL and kept.exists()
    building.draw_panoramas(data.config, data.folder, tmp_path / "shared", pictures=Unlit(size=8))
    assert not any(pano(data, name).samefile(pano(other, name)) for name in names), "another size is another file"


@pytest.mark.gl
def test_what_a_data_set_holds_is_read_under_other_drivers_and_later_versions_and_drawn_again_by_them(data):
    name = data.names("train")[0]
    pretend_drawn(data, name, SMALL, renderer="another card", code="an earlier version")
    with data.open_world(name, HandCatalogue(), data.folder / "cache", SMALL) as world:
        assert abs(int(world.panorama(3).rgb.mean()) - 43) <= 1, "read, not drawn"
    pretend_drawn(data, name, SMALL, renderer="another card")
    os.utime(pano(data, name), ns=(1, 1))
    unit = next(u for u in building.units(data.scale) if u.name == name)
    building.draw_unit(unit, data.folder, data.folder / "cache", SMALL)
    assert pano(data, name).stat().st_mtime_ns == 1, "another machine has another driver"
    pretend_drawn(data, name, SMALL, code="an earlier version")
    building.draw_unit(unit, data.folder, data.folder / "cache", SMALL)
    with data.open_world(name, HandCatalogue(), data.folder / "cache", SMALL) as world:
        assert len(np.unique(world.panorama(3).rgb)) > 3, "one data set is of one version"


@pytest.mark.slow
@pytest.mark.gl
def test_features_of_other_pictures_are_other_features(data, monkeypatch):
    """An unlit run must not pass for a lit one."""
    monkeypatch.setitem(RENDER_PRESETS, "unlit", SMALL)
    monkeypatch.setattr("embodied.agents.vision.lite.STAGE_WIDTHS", (8, 8, 16, 16))
    encoder = random_encoder(seed=0)
    names = [u.name for u in building.units(data.scale)]
    lit = Baked("fast", size=16)

    lines: list[str] = []

    def features(kind: str | None, *goal_images: str, split: str | None = None, **how: Any) -> str:
        lines.clear()
        extract = Extractor(data.folder, encoder, data.folder / "cache", kind, (SAME_TIME, *goal_images))
        houses = data.names(split) if split else [u.name for u in building.units(data.scale)]
        vision.make_features(extract, houses, note=lines.append, **how)
        return lines[-1]

    for name in names:
        pano(data, name).unlink(missing_ok=True)
    assert features(None, split="val_unseen").startswith("1 of 1 houses made")
    shutil.rmtree(data.folder / "features")
    assert features(None).startswith("3 of 3 houses made, pictures: 3 unlit_16")
    for name in names:
        pretend_drawn(data, name, lit, code="whoever drew them")
    assert features(None).startswith("3 of 3 houses made, pictures: 3 fast_gloss_16")
    assert features("fast").startswith("0 of 3 houses made")
    monkeypatch.setattr(vision, "house_at", lambda data, name, goal_image, cache: data.place(name).house)  # no routes
    assert features("unlit", LATER_CAMERA).startswith("3 of 3 houses made")
    assert {line.split(": ")[1].split(";")[0] for line in lines[:-1]} == {LATER_CAMERA}, "the others are still there"
    assert all(captured_path(data, n, LATER_CAMERA, encoder.digest, SMALL).exists() for n in names)
    assert features("unlit", LATER_CAMERA).startswith("0 of 3 houses made")
    name = names[0]
    path = feature_path(data.folder / "features", encoder.digest, name, lit)
    found = load_features(path, encoder=encoder.digest, source=data.place(name).house.digest, pictures=lit)
    with data.open_world(name, HandCatalogue(), data.folder / "cache", lit) as world:
        wanted = encode_panoramas(encoder, [world.panorama(n) for n in range(4)])
    assert np.allclose(found[:4].astype(float), wanted.astype(float), atol=1e-2), "of the very pictures that it holds"
    path.unlink()
    assert features("fast").startswith("1 of 3 houses made") and path.exists()
    with pytest.raises(ValueError, match="made from drawing fast_gloss_"):
        load_features(path, encoder=encoder.digest, source=data.place(name).house.digest, pictures=PLAIN)
