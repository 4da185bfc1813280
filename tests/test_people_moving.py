"""People who move: feet, stairs and seats, and how they are drawn."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from embodied.assets.people import JOINTS, joint_positions, people
from embodied.assets.people.bodies import transforms
from embodied.people.gait import BALL, HEEL, SIDES, Limbs, between, sitting, solved, turn, walk

SOMEBODY = [people()[i] for i in sorted(people(), key=lambda i: people()[i].height)][:: max(len(people()) - 1, 1)]
"""The shortest and the tallest."""
RISE, GOING = 0.175, 0.28


def soles(person, posed):
    """(2, 2, 3) heels and balls of both feet, right first, world, by the skeleton itself."""
    place, pose = posed
    turns, limbs = transforms(person, pose)[:, :, :3], Limbs(person)
    at = joint_positions(person, pose)
    points = []
    for side in SIDES:
        foot = turns[[*JOINTS].index(f"{side}_foot")].astype(float)
        for y in (HEEL, -BALL):
            points.append(at[f"{side}_foot"] + foot @ [0.0, y * limbs.leg, -limbs.ankle])
    return place.points(np.array(points)).reshape(2, 2, 3)


def slid(person, frames, ground=lambda p: 0.0):
    """Metres that a heel or ball slid at most while it was on the ground, and how far one was below it."""
    points = np.array([soles(person, f) for f in frames]).reshape(-1, 4, 3)
    height = points[..., 2] - np.array([[ground(p) for p in row] for row in points])
    worst = 0.0
    for k in range(4):
        down, start = height[:, k] < 0.004, None
        for i in range(len(points)):
            start = (i if start is None else start) if down[i] else None
            if start is not None:
                worst = max(worst, float(np.linalg.norm(points[i, k, :2] - points[start, k, :2])))
    return worst, -float(height.min())


@pytest.mark.parametrize("person", SOMEBODY, ids=lambda p: p.id)
def test_feet_on_the_ground_slide_less_than_a_centimetre_on_straight_and_bent_ways_and_turns(person):
    limbs, t = Limbs(person), np.linspace(0, 1, 90)
    bent = np.column_stack([1.5 * np.sin(3 * t), 1.5 - 1.5 * np.cos(3 * t), 0 * t])
    straight = np.column_stack([4 * t, 0 * t, 0 * t])
    for course in (walk(limbs, straight, 0 * t), walk(limbs, bent, 3 * t), turn(limbs, np.zeros(3), 0.4, 3.0)):
        frames = [solved(limbs, course.at(s)) for s in np.arange(0, course.seconds + 0.1, 1 / 30)]
        slip, below = slid(person, frames)
        assert slip < 0.01 and below < 0.012
        steps = [np.linalg.norm(np.subtract(b[0].position, a[0].position)) for a, b in pairwise(frames)]
        assert max(steps) < 2.2 * course.speed / 30 + 1e-6  # nobody jumps


def test_feet_land_in_the_middle_of_treads_and_pass_through_none():
    person = SOMEBODY[-1]
    n, x = 6, np.linspace(0, 4.0, 120)
    height = lambda s: np.clip((s - 1) / GOING, 0, n) * RISE
    treads = [(1 + (k - 0.5) * GOING, k * RISE) for k in range(1, n + 1)]
    stairs = lambda p: RISE * float(np.clip(math.ceil((p[0] - 1) / GOING), 0, n))
    limbs = Limbs(person)
    for way in (1, -1):  # up and down
        points = np.column_stack([x, 0 * x, height(x)])[::way] * (1, 1, 1)
        marks = treads if way > 0 else [(4.0 - s, z) for s, z in treads[::-1]]
        course = walk(limbs, points, np.full(len(x), 0.0 if way > 0 else math.pi), marks)
        landed, deepest = set(), 0.0
        for s in np.arange(0, course.seconds, 1 / 20):
            for foot in course.at(s).feet:
                if foot[4] == 0:
                    landed.add(round((foot[2] - limbs.ankle) / RISE, 3))
            heels, balls = np.moveaxis(soles(person, solved(limbs, course.at(s))), 1, 0)
            assert all(p[2] - stairs(p) > -0.09 for p in heels + 0.5 * (balls - heels))
        assert {float(k) for k in range(n + 1)} <= landed and deepest > -0.05


def test_who_sits_down_keeps_the_feet_and_ends_on_the_seat_and_gets_up_the_same_way():
    person = SOMEBODY[-1]
    limbs = Limbs(person)
    begin, seat = limbs.standing(np.zeros(3), 0.0), np.array([-0.45, 0.1, 0.46])
    frames = [solved(limbs, sitting(limbs, begin, seat, 0.3, k / 60)) for k in range(61)]
    assert slid(person, frames)[0] < 0.01
    place, pose = frames[-1]
    pelvis = place.points(joint_positions(person, pose)["pelvis"][None])[0]
    np.testing.assert_allclose(pelvis, [*seat[:2], seat[2] + person.seat], atol=1e-6)
    half = between(frames[0], frames[-1], 0.5)
    assert math.isclose(half[1].lift, pose.lift / 2, abs_tol=1e-3)


def test_a_hand_reaches_a_handle_and_the_head_turns_to_who_speaks():
    person, handle = SOMEBODY[-1], np.array([0.35, -0.25, 1.05])
    limbs = Limbs(person)
    still = limbs.standing(np.zeros(3), 0.0)
    place, pose = solved(
        limbs, type(still)(**{**vars(still), "hands": {"right": handle}, "look": np.array([1.0, 1, 1.6])})
    )
    at = joint_positions(person, pose)
    np.testing.assert_allclose(place.points(at["right_hand"][None])[0], handle, atol=0.01)
    head = Rotation.from_matrix(place.rotation @ transforms(person, pose)[[*JOINTS].index("head"), :, :3])
    assert head.apply([0, -1, 0]) @ [1, 1, 0] / math.sqrt(2) > 0.95
