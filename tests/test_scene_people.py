"""Capsules of people: where their flesh is, and what they push."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from embodied.assets.people import people, posed
from embodied.house.moment import Moment, MovingPerson
from embodied.people.gait import Limbs, sitting, solved, walk
from embodied.scene.bodies import AWAY, add_person, stand_people

BALL = """<mujoco><option timestep="0.005"/><worldbody><geom name="floor" type="plane" size="9 9 1"/>
<body name="ball" pos="1 0 .15"><freejoint/><geom size=".15" mass="1"/></body></worldbody></mujoco>"""
WAY = np.linspace((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), 60)


def at(person, bearing):
    return Moment(people={"someone": MovingPerson(person.id, *solved(Limbs(person), bearing))})


@pytest.mark.parametrize("who", ["anna", "jun", "finn"])
def test_capsules_are_where_the_flesh_of_who_walks_or_sits_is_and_away_from_who_is_not_there(who):
    person, spec = people()[who], mujoco.MjSpec.from_string(BALL)
    add_person(spec, "someone", person)
    model = spec.compile()
    data, walking = mujoco.MjData(model), walk(Limbs(person), WAY, np.zeros(60)).at(1.4)
    for bearing in (walking, sitting(Limbs(person), walking, np.array([0.5, 0.0, 0.45]), 0.0, 1.0)):
        moment = at(person, bearing)
        stand_people(model, data, moment)
        mujoco.mj_forward(model, data)
        figure = moment.people["someone"]
        for point in [figure.place.points(m.vertices)[::40] for m in posed(person, figure.pose, 2)][0]:
            ends = []
            for g in range(2, model.ngeom):
                axis = data.geom_xmat[g].reshape(3, 3)[:, 2] * model.geom_size[g, 1]
                share = np.clip((point - data.geom_xpos[g]) @ axis / max(axis @ axis, 1e-9), -1, 1)
                ends.append(np.linalg.norm(point - data.geom_xpos[g] - share * axis) - model.geom_size[g, 0])
            assert min(ends) < 0.15
    stand_people(model, data, Moment())
    assert (data.mocap_pos[:, 2] == AWAY).all()


def test_who_walks_pushes_what_lies_in_the_way():
    person, spec = people()["anna"], mujoco.MjSpec.from_string(BALL)
    add_person(spec, "someone", person)
    model = spec.compile()
    data, course = mujoco.MjData(model), walk(Limbs(person), WAY, np.zeros(60))
    while data.time < course.seconds:
        stand_people(model, data, at(person, course.at(data.time)))
        mujoco.mj_step(model, data)
    assert data.body("ball").xpos[0] > 2.0
