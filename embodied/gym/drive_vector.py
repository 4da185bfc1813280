"""Many bodies on wheels in one lit house at once, their physics and pictures computed by MuJoCo Warp on one device.

    envs = DriveVectorEnv(world, DriveSettings(), 256, device="cuda:0", out=torch.from_dlpack)
    seen, _ = envs.reset(seed=0)
    seen, rewards, terminated, truncated, _ = envs.step(torch.zeros(256, 2, device="cuda"))

The same rules as embodied/Drive-v0 (embodied.gym.drive); bodies do not meet. Physics is in single precision and
pictures are MuJoCo Warp's, so an episode is not the same to the last digit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from embodied.envs.driven import CONTROL, FASTEST, TURNING, Driver, Roll
from embodied.gym.drive import seen_space
from embodied.gym.driving import DriveSettings, Driving
from embodied.gym.sensors import FAR
from embodied.navigation.floor_ways import FloorWays
from embodied.render.warp import SEEN, WarpRenderer, device_of, mjw, wp
from embodied.seeds import checked_seed
from embodied.world import World

CONTACTS = 64
"""Of one body at most; a contact has up to four rows of constraints."""


class Bodies:
    """Owns the physics of one house with a body in each of many worlds."""

    def __init__(self, first: Driver, count: int, device: Any) -> None:
        self.drivers = [first, *(first.twin() for _ in range(count - 1))]
        """Each holds the state of its world; one by one they put bodies down."""
        self._device, self._graph = device, None
        with wp.ScopedDevice(device):
            self._model = mjw.put_model(first.model)
            self._data = mjw.put_data(first.model, first.data, nworld=count, nconmax=CONTACTS, njmax=4 * CONTACTS)

    def roll(self, commands: np.ndarray, periods: int) -> list[Roll]:
        """`Driver.roll` of every body.

        Args:
          commands: (n, 2) metres and radians per second.
        """
        for driver, (speed, turn) in zip(self.drivers, commands, strict=True):
            driver.command(speed, turn)
        with wp.ScopedDevice(self._device):
            for name in ("qpos", "qvel", "ctrl"):
                states = np.stack([getattr(d.data, name) for d in self.drivers])
                getattr(self._data, name).assign(states.astype(np.float32))
            rolled = [Roll(0.0, (), False)] * len(self.drivers)
            for _ in range(periods):
                before = [d.position for d in self.drivers]
                self._step()
                rolled = [
                    d.noted(r, b, t)
                    for d, r, b, t in zip(self.drivers, rolled, before, self._taken_over(), strict=True)
                ]
        for driver in self.drivers:
            driver.update_poses()
        return rolled

    def _step(self) -> None:
        """One control period."""
        if self._graph is not None:
            wp.capture_launch(self._graph)
            return
        self._steps()  # compiles; what is captured is not carried out
        if self._device.is_cuda:
            with wp.ScopedCapture() as capture:
                self._steps()
            self._graph = capture.graph

    def _steps(self) -> None:
        for _ in range(self.drivers[0].substeps):
            mjw.step(self._model, self._data)

    def _taken_over(self) -> list[frozenset[str]]:
        """Hand every driver its state; returns what each body touches."""
        states = zip(self.drivers, self._data.qpos.numpy(), self._data.qvel.numpy(), strict=True)
        for driver, qpos, qvel in states:
            driver.take_over(qpos, qvel, CONTROL)
        met = int(self._data.nacon.numpy()[0])
        pairs, worlds = self._data.contact.geom.numpy()[:met], self._data.contact.worldid.numpy()[:met]
        return [d.owners_met(*pairs[worlds == i].T) for i, d in enumerate(self.drivers)]


class DriveVectorEnv(VectorEnv[dict[str, Any], Any, Any]):
    """`DriveEnv` many times over. What has ended begins anew at the next step, whose action and reward are nothing."""

    metadata = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}

    def __init__(
        self,
        world: World,
        settings: DriveSettings,
        count: int,
        *,
        device: str | None = None,
        out: Callable[[Any], Any] = lambda array: array.numpy(),
    ) -> None:
        """
        Args:
          world: lit, where something is seen.
          count: bodies.
          device: Warp's name of a device, 'cuda:0' or 'cpu'; None is a GPU where one is.
          out: makes what is returned of Warp arrays, NumPy's if left out; torch.from_dlpack makes tensors that share
            their memory.

        Raises:
          ValueError: no bodies, or a world without light.
        """
        if count < 1:
            raise ValueError(f"count is {count}; at least one body is needed")
        self.num_envs, self.settings, self._out, self._device = count, settings, out, device_of(device)
        self.single_observation_space = gym.spaces.Dict({**seen_space(settings)})
        self.single_action_space = gym.spaces.Box(-1.0, 1.0, (settings.numbers,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, count)
        self.action_space = batch_space(self.single_action_space, count)
        self._bodies = Bodies(Driver(world.house, world.catalogue), count, self._device)
        ground = FloorWays(world.house)
        driving = lambda driver: Driving({world.name: world}, settings, lambda _: (driver, ground))
        self._all = list(map(driving, self._bodies.drivers))
        self._rngs: list[np.random.Generator] = []
        self._renderer = None
        if settings.observations:
            if world.lit is None:
                raise ValueError(f"house {world.name!r} has no light; MuJoCo Warp draws lit houses (pictures='fast')")
            self._renderer = WarpRenderer(
                world.house,
                world.catalogue,
                world.lit,
                worlds=count,
                size=(settings.height, settings.width),
                vfov=settings.vfov,
                device=device,
            )

    @property
    def drivers(self) -> list[Driver]:
        """The bodies, each with the state of its world."""
        return self._bodies.drivers

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts and goals; body i draws from `seed` + i where one number is given.

        Raises:
          ValueError: other than one seed, or one for every body.
        """
        if seed is not None or not self._rngs:
            first = seeding.np_random(None)[1] if seed is None else seed
            seeds = (
                list(first) if isinstance(first, Sequence) else [checked_seed(first) + i for i in range(self.num_envs)]
            )
            if len(seeds) != self.num_envs:
                raise ValueError(
                    f"there are {len(seeds)} seeds for {self.num_envs} bodies; give one for each, or one number"
                )
            self._rngs = [seeding.np_random(checked_seed(s))[0] for s in seeds]
        for driving, rng in zip(self._all, self._rngs, strict=True):
            driving.reset(rng)
        return self._seen(), self._info([self._begun(d) for d in self._all])

    def step(self, actions: Any) -> tuple[dict[str, Any], Any, Any, Any, dict[str, Any]]:
        """
        Args:
          actions: (n, numbers) NumPy, or anything with DLPack.

        Raises:
          ValueError: another shape, or something that is no number.
        """
        given = actions if isinstance(actions, np.ndarray) else wp.from_dlpack(actions).numpy()
        if given.shape != self.action_space.shape:
            raise ValueError(f"actions should have the shape {self.action_space.shape}, got {given.shape}")
        begin = [d.ended is not None for d in self._all]
        still = np.zeros(self.settings.numbers)
        commands = np.array([still if b else d.command(a) for d, a, b in zip(self._all, given, begin, strict=True)])
        rolled = self._bodies.roll(commands[:, :2] * [FASTEST, TURNING], self._all[0].periods)
        rewards = np.zeros(self.num_envs, np.float32)
        terminated, truncated = np.zeros((2, self.num_envs), bool)
        infos = []
        for i, driving in enumerate(self._all):
            if begin[i]:
                driving.reset(self._rngs[i])
                infos.append(self._begun(driving))
                continue
            outcome = driving.judged(commands[i], rolled[i])
            rewards[i] = outcome.reward
            terminated[i], truncated[i] = outcome.ended in ("reached", "said"), outcome.ended == "limit"
            ended = {} if outcome.ended is None else {"is_success": outcome.facts["success"] > 0}
            infos.append({**outcome.facts, **ended})
        returned = (self._out(wp.array(x, device=self._device)) for x in (rewards, terminated, truncated))
        return self._seen(), *returned, self._info(infos)

    def close_extras(self, **_: Any) -> None:
        if self._renderer is not None:
            self._renderer.close()

    @staticmethod
    def _begun(driving: Driving) -> dict[str, Any]:
        return {"world": driving.world.name, "request": driving.goal.request}

    def _info(self, infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
        """One for all, in the way of Gymnasium: arrays, and for each under "_" + name which bodies it is of."""
        whole: dict[str, Any] = {}
        for i, info in enumerate(infos):
            whole = self._add_info(whole, info, i)
        return whole

    def _seen(self) -> dict[str, Any]:
        states = [d.proprioception() for d in self._all]
        arrays = {name: wp.array(np.stack([f[name] for f in states]), device=self._device) for name in states[0]}
        if self._renderer is not None:
            eyes = [d.camera() for d in self._all]
            at = np.array([c.position for c in eyes])
            ahead = np.array([c.forward for c in eyes])
            yaws, pitches = np.arctan2(ahead[:, 1], ahead[:, 0]), np.arcsin(np.clip(ahead[:, 2], -1.0, 1.0))
            batch = self._renderer.views(at, yaws, pitches, sees=self.settings.observations)
            arrays |= {name: wp.clone(getattr(batch, name)) for name in SEEN if name in self.settings.observations}
            if "depth" in arrays:
                wp.map(wp.min, arrays["depth"], float(FAR), out=arrays["depth"])
        return {name: self._out(arrays[name]) for name in seen_space(self.settings)}
