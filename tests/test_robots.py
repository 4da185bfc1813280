"""Robots of other files in houses."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from conftest import two_rooms

import embodied
from embodied.assets.catalogue import load_catalogue
from embodied.scene.robots import place

AWKWARD = """
<mujoco model="awkward">
 <compiler angle="radian" eulerseq="ZYX" settotalmass="7" meshdir="own"/>
 <option timestep="0.001" integrator="RK4" gravity="0 0 0" impratio="5"><flag contact="disable"/></option>
 <include file="{folder}/more.xml"/>
 <asset>
  <texture name="sky" type="skybox" builtin="gradient" width="32" height="192"/><material name="material_0"/>
  <mesh name="0000_built_rug" file="wedge.obj"/>
 </asset>
 <worldbody>
  <light name="sun" pos="0 0 3"/><geom name="floor" type="plane" size="3 3 .1"/>
  <body name="rug_1" pos="0 0 .3"><freejoint name="rug_1"/>
   <geom name="living_room_1/floor#box0" type="mesh" mesh="0000_built_rug" material="material_0"/>
   <body name="link" pos="0 0 .1" euler="0.5 0 0"><joint name="j" class="arm" axis="0 1 0" range="-1 1"/>
    <geom type="capsule" size=".03" fromto="0 0 0 0 0 .4"/><camera name="eye" pos="0 0 .4"/></body></body>
 </worldbody>
 <tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
 <sensor><jointpos name="s" joint="j"/></sensor>
 <keyframe><key name="home" qpos="0 0 .35 1 0 0 0 .4" ctrl=".4"/></keyframe>
</mujoco>"""
MORE = """<mujoco>
 <default><geom contype="2" conaffinity="4"/><joint damping="3"/>
  <default class="arm"><joint armature="0.1"/></default></default>
 <actuator><position name="a" tendon="t" kp="20"/></actuator></mujoco>"""
WEDGE = "v 0 0 0\nv .2 0 0\nv 0 .2 0\nv 0 0 .2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


@pytest.fixture
def house_spec(shared_cache):
    return embodied.scene_spec(two_rooms(), None, catalogue=load_catalogue(shared_cache), cache=shared_cache)


@pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass'")
def test_a_robot_in_every_awkward_style_stands_works_and_keeps_its_masses(house_spec, tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "wedge.obj").write_text(WEDGE)
    (tmp_path / "more.xml").write_text(MORE)
    (tmp_path / "robot.xml").write_text(AWKWARD.format(folder=tmp_path))
    bare = house_spec.copy().compile()
    first = place(house_spec, tmp_path / "robot.xml", "living_room_1")
    second = place(house_spec, tmp_path / "robot.xml", (7.0, 2.0, 1.0), name="other", rolling=True)
    model = house_spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("robot/start").id)
    mujoco.mj_forward(model, data)
    for placed in (first, second):
        bodies = [b for b in range(model.nbody) if model.body(b).name.startswith(f"{placed.name}/")]
        weight = sum(model.body_mass[b] for b in bodies if not model.body(b).name.endswith("rolling"))
        assert abs(weight - 7) < 1e-6
        told = " ".join(placed.changes)
        for word in (
            "floor",
            "light",
            "skies",
            "gravity",
            "timestep",
            "integrator",
            "disableflags",
            "contype",
            "start",
        ):
            assert word in told or (word == "timestep" and placed is second), word
    assert model.opt.timestep == 0.001 and model.opt.impratio == 5 and model.opt.gravity[2] == -9.81
    assert model.opt.disableflags == 0 and model.nlight == bare.nlight
    assert np.allclose(model.joint("robot/j").range, (-1, 1)) and model.joint("robot/j").damping == 3
    assert abs(data.sensor("robot/s").data[0] - 0.4) < 1e-9 and data.ctrl[model.actuator("robot/a").id] == 0.4
    assert abs(model.key("other/start").qpos[model.joint("other/j").qposadr[0]] - 0.4) < 1e-9
    assert np.linalg.norm(data.body("other/rug_1").xpos[:2] - (7.0, 2.0)) < 1e-6
    height = data.body("robot/rug_1").xpos[2]
    data.ctrl[model.actuator("robot/a").id] = -0.5
    model.body_gravcomp[:] = 0
    mujoco.mj_step(model, data, nstep=1500)
    assert data.body("robot/rug_1").xpos[2] > height - 0.1, "it stands on the house's floor"
    assert data.sensor("robot/s").data[0] < 0.2, "its tendon moves it"
    assert {model.camera(c).name for c in range(model.ncam)} == {"robot/eye", "other/eye"}
    assert [model.geom(g).name for g in range(bare.ngeom)][:40] == [bare.geom(g).name for g in range(bare.ngeom)][:40]


def test_a_jaco_of_dm_control_rides_on_our_wheels(house_spec):
    from dm_control.third_party import kinova

    from embodied.envs.driven import WHEELS

    robot = mujoco.MjSpec.from_file(str(WHEELS))
    chassis = robot.body("chassis")
    arm = mujoco.MjSpec.from_file(f"{kinova.__path__[0]}/jaco_arm.xml")
    robot.attach(arm, frame=chassis.add_frame(pos=[0, 0, 1.35]), prefix="arm_")
    place(house_spec, robot, "living_room_1")
    model = house_spec.compile()
    mujoco.mj_resetDataKeyframe(model, data := mujoco.MjData(model), 0)
    mujoco.mj_forward(model, data)
    data.ctrl[[model.actuator(f"robot/{side}").id for side in ("left", "right")]] = 3.0
    before = data.body("robot/chassis").xpos.copy()
    mujoco.mj_step(model, data, nstep=1000)
    assert (
        0.1 < np.linalg.norm(data.body("robot/chassis").xpos - before) < 1.0
        and data.body("robot/chassis").xmat[8] > 0.9
    )


def test_a_name_is_of_menagerie_which_is_asked_for_the_robot_without_its_scene(house_spec, monkeypatch):
    entry = lambda name, is_mjx=False: SimpleNamespace(name=name, is_mjx=is_mjx)

    def spec(name):
        assert name == "cube"
        (robot := mujoco.MjSpec()).worldbody.add_body(name="it").add_geom(size=[0.1, 0, 0])
        return robot

    entries = entry("scene"), entry("cube_mjx", True), entry("cube")
    known = SimpleNamespace(entry_points=entries, spec=spec)
    stand_in = SimpleNamespace(get={"cube": known}.__getitem__)
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", stand_in)
    assert place(house_spec, "cube").name == "robot" and house_spec.compile().body("robot/it").mass[0] > 0
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(ValueError, match=r"pip install 'embodied-houses\[robots\]'"):
        place(house_spec, "cube", name="other")


def test_a_robot_without_room_or_name_is_refused(house_spec):
    big = mujoco.MjSpec()
    big.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[2.5, 2.5, 0.1])
    with pytest.raises(ValueError, match="no free floor for a robot of 5.0"):
        place(house_spec, big, "bedroom_1")
    for robot, at, said in (("no.xml", None, "no robot file"), (mujoco.MjSpec(), "attic", "no room 'attic'")):
        with pytest.raises(ValueError, match=said):
            place(house_spec, robot, at)
    with pytest.raises(ValueError, match="needs a spec of embodied.scene_spec"):
        place(mujoco.MjSpec(), mujoco.MjSpec())
