"""Bodies of people: what a pose does to them."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from embodied.assets.people import POSES, STANDING, Pose, gaze, ground, joint_positions, people, posed, seated
from embodied.assets.records import Finish

PERSON = next(iter(people().values()))


def body(pose: Pose, detail: int = 2) -> dict[str, np.ndarray]:
    """Vertices by part."""
    parts = posed(PERSON, pose, detail, finish=lambda key: Finish())
    return {name: p.vertices for name, p in zip(PERSON.parts, parts, strict=True)}


@pytest.mark.parametrize("name", people())
def test_everybody_stands_on_the_floor_as_tall_as_stated_in_every_detail(name):
    person = people()[name]
    sizes = []
    for detail in range(3):
        parts = posed(person, STANDING, detail, finish=lambda key: Finish())
        z = np.concatenate([p.vertices[:, 2] for p in parts])
        assert abs(z.min()) < 0.012 and z.max() == pytest.approx(person.height, abs=0.12)
        assert all(len(p.faces) and p.faces.max() < len(p.vertices) for p in parts)
        sizes.append(sum(len(p.faces) for p in parts))
    assert sizes[0] < 26_000 and sizes[1] < 0.6 * sizes[0] and sizes[2] < 0.2 * sizes[0]


def test_a_person_faces_minus_y_and_the_left_hand_is_at_plus_x():
    joints = PERSON.joints
    assert joints["left_eye"][1] < joints["head"][1] - 0.03 and joints["left_hand"][0] > 0 > joints["right_hand"][0]


def test_a_raised_thigh_bends_forward_and_takes_the_foot_along():
    rest, raised = (joint_positions(PERSON, p) for p in (Pose(), Pose({"left_thigh": (-np.pi / 2, 0.0, 0.0)})))
    assert raised["left_foot"][1] < rest["left_foot"][1] - 0.5 * PERSON.leg_length
    assert np.allclose(raised["right_foot"], rest["right_foot"]) and np.allclose(raised["head"], rest["head"])


def test_who_sits_has_the_pelvis_over_the_seat_and_the_feet_on_the_floor():
    sitting = seated(PERSON, 0.45)
    z = np.concatenate(list(body(sitting).values()))[:, 2]
    assert abs(z.min()) < 0.05 and joint_positions(PERSON, sitting)["pelvis"][2] == pytest.approx(0.45 + PERSON.seat)


@pytest.mark.parametrize("name", POSES)
def test_no_pose_tears_a_body(name):
    pose = ground(PERSON, POSES[name])
    for part in posed(PERSON, pose, 0, finish=lambda key: Finish()):
        assert np.isfinite(part.vertices).all() and part.vertices[:, 2].min() > -0.03
        assert np.allclose(np.linalg.norm(part.normals, axis=1), 1, atol=1e-3)


def test_a_gaze_turns_the_eyes_before_the_head():
    ahead, aside = body(STANDING)["eyes"], body(gaze(STANDING, 0.5))["eyes"]
    assert aside.mean(0)[0] > ahead.mean(0)[0]


def test_an_unknown_joint_is_refused():
    with pytest.raises(ValueError, match="unknown joints"):
        Pose({"tail": (0.0, 0.0, 0.0)})


def test_posed_bodies_have_the_same_bytes_with_any_number_of_threads():
    code = (
        "from hashlib import md5\n"
        "from embodied.assets.people import POSES, people, posed\n"
        "parts = [p for who in people().values() for p in posed(who, POSES['waiting'])]\n"
        "print(md5(b''.join(p.vertices.tobytes() for p in parts)).hexdigest())"
    )
    run = lambda n: subprocess.check_output(
        [sys.executable, "-c", code], env={**os.environ, "OPENBLAS_NUM_THREADS": n, "OMP_NUM_THREADS": n}
    )
    assert run("1") == run("2")
