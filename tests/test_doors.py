"""Doors on hinges: they stay, open and close, and have the names that readers of other houses look for."""

from __future__ import annotations

import json
import math

import mujoco
import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished, smooth_pages

from embodied.scene.doors import openness
from embodied.scene.export import export_mjcf
from embodied.scene.model import build_spec

HOUSE = furnished(two_rooms())
OPEN = {o.id: o.angle / (math.pi / 2) for o in HOUSE.openings if o.id.endswith("door_1")}


@pytest.fixture(scope="module")
def model():
    return build_spec(HOUSE, HandCatalogue(), hinged=True).compile()


def pushed(model, data, joint: str, torque: float, seconds: float = 4.0) -> float:
    """How far a door is open after it was pushed, 0 to 1."""
    for _ in range(round(seconds / model.opt.timestep)):
        data.qfrc_applied[model.joint(joint).dofadr[0]] = torque
        mujoco.mj_step(model, data)
    return openness(model, data)[joint.removesuffix("_doorhinge")]


def test_doors_stay_as_they_stand_and_open_and_close_when_they_are_pushed(model):
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    windows = {o.id: 0.0 for o in HOUSE.openings if o.kind == "window"}
    assert openness(model, data) == pytest.approx({**OPEN, **windows}, abs=1e-6)
    assert pushed(model, data, "door_1_doorhinge", -30) < 0.005
    assert pushed(model, data, "door_1_doorhinge", 30) > 0.9


def test_readers_of_molmospaces_and_robocasa_find_hinges_and_handles(tmp_path):
    path = export_mjcf(HOUSE, HandCatalogue(), tmp_path, hinged=True)
    model = mujoco.MjModel.from_xml_path(str(path))
    objects = json.loads((tmp_path / "house_metadata.json").read_text())["objects"]
    doors = {name: o for name, o in objects.items() if "doorway" in name}
    assert {name.removeprefix("doorway_") for name in doors} == set(OPEN)
    for name, door in doors.items():
        assert "_door_" in name and not door["is_static"]
        hinge = next(j for j in door["name_map"]["joints"] if "handle" not in j)
        lever = next(b for b in door["name_map"]["bodies"] if "handle" in b)
        assert "door" in hinge and model.joint(hinge).range == pytest.approx([0, math.pi / 2], abs=1e-5)
        assert model.body(model.joint(hinge).bodyid[0]).name == name
        assert not (model.body_parentid == model.body(lever).id).any()  # it carries nothing
        assert model.qpos0[model.joint(hinge).qposadr[0]] == pytest.approx(
            OPEN[name.removeprefix("doorway_")] * math.pi / 2, abs=1e-4
        )
        assert model.geom_contype[model.geom_bodyid == model.body(lever).id].any()  # it can be gripped
    assert objects["table_1"]["category"] == "table" and objects["table_1"]["is_static"]


@pytest.mark.parametrize("lit", [False, True])
def test_a_house_with_hinges_looks_as_one_without(lit):
    pages = smooth_pages(HOUSE, HandCatalogue()) if lit else None
    seen = []
    for hinged in (False, True):
        model = build_spec(HOUSE, HandCatalogue(), lit=pages, hinged=hinged).compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        places = {}
        for g in range(model.ngeom):
            name = model.geom(g).name
            if "/leaf#" in name or "/handle#" in name:
                turn, mesh = data.geom_xmat[g].reshape(3, 3), model.geom_dataid[g]
                if mesh >= 0:
                    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
                    corners = model.mesh_vert[first : first + count] @ turn.T + data.geom_xpos[g]
                    places[name] = np.concatenate([corners.min(0), corners.max(0)])
        seen.append(places)
        frame = [g for g in range(model.ngeom) if model.geom(g).name.startswith("window_1/frame#")]
        carriers = {model.body(model.geom_bodyid[g]).name for g in frame}
        assert carriers == ({"world", "casement_window_1", "casement_window_1_2"} if hinged else {"world"})
    assert seen[0].keys() == seen[1].keys() and len(seen[0]) >= 4
    for name, box in seen[0].items():
        np.testing.assert_allclose(seen[1][name], box, atol=2e-4)
