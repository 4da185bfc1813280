"""embodied/Drive-v0: a body on wheels, driven by velocities through lit houses, that sees every moment of its way.

    env = gymnasium.make("embodied/Drive-v0", task="find", observations=("rgb", "depth"), data="DIR", split="train")

An action says how fast ahead and how fast to the left, each from -1 to 1, and is held for a tenth of a second while
physics goes on; to find something, a third number above 0.5 says that it is here.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces

from embodied.assets.cache import default_cache
from embodied.assets.catalogue import load_catalogue
from embodied.datasets.build import make_dataset_house
from embodied.datasets.store import Dataset
from embodied.generate import HouseConfig
from embodied.gym.driving import DriveSettings, Driving, driven_task
from embodied.gym.env import VIEW, LiveEnv
from embodied.gym.playground import FLAT_AREA, pictures_of
from embodied.gym.sensors import LARGE, pixel_spaces
from embodied.render.pictures import PictureSettings, matte
from embodied.seeds import checked_seed
from embodied.world import World, open_world


class DriveEnv(LiveEnv):
    """Driving as a Gymnasium environment.

    Reward: 1 on success, minus 0.01 a command and 0.05 for every collision, plus a tenth for every metre nearer to the
    goal along the floor. An episode ends when the point is reached, when the object is said to be here, and is cut
    short after `seconds`. info: success, is_success, spl, collisions, metres, seconds, distance_to_goal (metres).
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(self, driving: Driving, *, render_mode: str | None = None) -> None:
        super().__init__(render_mode, driving.worlds.values())
        self.driving = driving
        self.action_space: spaces.Box = spaces.Box(-1.0, 1.0, (driving.settings.numbers,), np.float32)
        self.observation_space = spaces.Dict({**seen_space(driving.settings)})

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """A start and a goal drawn with this environment's generator; options["world"] chooses the house by name."""
        world = (options or {}).get("world")
        if world is not None and world not in self.driving.worlds:
            raise ValueError(f"there is no house {world!r:.80}; choose one of {sorted(self.driving.worlds)[:8]}")
        super().reset(seed=None if seed is None else checked_seed(seed))
        self.driving.reset(self.np_random, world)
        return self.driving.look(), {"world": self.driving.world.name, "request": self.driving.goal.request}

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        reward, facts = self.driving.step(action)
        ended = self.driving.ended
        info: dict[str, Any] = {**facts, "is_success": facts["success"] > 0}
        return self.driving.look(), reward, ended not in (None, "limit"), ended == "limit", info

    def _picture(self) -> np.ndarray:
        return self.driving.seen.renderer.rgb(self.driving.camera(), VIEW)


def seen_space(s: DriveSettings) -> dict[str, spaces.Box]:
    """The spaces of what `Driving.look` returns."""
    whole = pixel_spaces((s.height, s.width), s.observations)
    whole["motion"] = spaces.Box(-LARGE, LARGE, (2,), np.float32)
    whole["touched"] = spaces.Box(0.0, 1.0, (1,), np.float32)
    return {**whole, **driven_task(s.task).extra_spaces}


def make(*, render_mode: str | None = None, **options: Any) -> DriveEnv:
    """The environment; options as of `chosen_worlds`, and fields of DriveSettings."""
    worlds, settings = chosen_worlds(**options)
    if isinstance(observations := settings.get("observations"), str):
        settings["observations"] = (observations,)
    return DriveEnv(Driving(worlds, DriveSettings(**settings)), render_mode=render_mode)


def chosen_worlds(
    *,
    data: str | Path | None = None,
    split: str = "train",
    seed: int = 0,
    cache: str | Path | None = None,
    pictures: PictureSettings | str | None = None,
    worlds: Mapping[str, World] | None = None,
    **others: Any,
) -> tuple[Mapping[str, World], dict[str, Any]]:
    """The houses of a data set, given worlds, or one flat that is generated from `seed` and lit; and other options.

    Args:
      data, split: of any kind; the light of its houses is baked where the cache does not have it.
      pictures: how houses are drawn; as the data set's pictures are without reflections, 'fast-matte' elsewhere: every
        command is a picture of its own, and reflections take more than twice the time.
    """
    if worlds is not None:
        return worlds, others
    where = Path(cache) if cache else default_cache()
    catalogue = load_catalogue(where)
    if data:
        whole = Dataset(Path(data))
        names = whole.names(split)
        drawn = pictures or matte(pictures_of(whole, names, wanted=False))
        return {name: whole.open_world(name, catalogue, where, drawn) for name in names}, others
    name = f"flat_{seed}"
    house, graph = make_dataset_house(seed, name, HouseConfig(area=FLAT_AREA), catalogue)
    return {name: open_world(house, catalogue, where, pictures or "fast-matte", graph=graph)}, others
