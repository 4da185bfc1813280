"""The environments by name for LeRobot's own programs, which import this file themselves (Python 3.12):

lerobot-eval --env.discover_packages_path=embodied.gym.lerobot --env.type=embodied --env.data=DIR --policy.path=MODEL
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium as gym
from lerobot.configs import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_IMAGE, OBS_STATE

from embodied.gym.lerobot import make_env, sizes


@EnvConfig.register_subclass("embodied")
@dataclass
class EmbodiedEnvConfig(EnvConfig):
    """Task, houses and size of the pictures."""

    task: str | None = "VLNCE"
    """One of embodied.gym.lerobot.ENVS."""
    data: str | None = None
    """Folder of a data set; a generated flat without one."""
    split: str = "val_unseen"
    pictures: str | None = None
    """How houses are drawn, 'unlit' or 'fast-matte' for instance; as the data set's pictures are where not given."""
    height: int = 128
    width: int = 128
    blind: bool = False
    """Pictures are black."""
    steps: int = 500
    """Longest episode of VLNCE and ObjectNav, in actions."""
    fps: int = 4
    features_map: dict[str, str] = field(
        default_factory=lambda: {ACTION: ACTION, "agent_pos": OBS_STATE, "pixels": OBS_IMAGE}
    )

    def __post_init__(self) -> None:
        """
        Raises:
          ValueError: an unknown task.
        """
        actions, position = sizes(self.task or "VLNCE")
        self.features = {
            ACTION: PolicyFeature(FeatureType.ACTION, (actions,)),
            "agent_pos": PolicyFeature(FeatureType.STATE, (position,)),
            "pixels": PolicyFeature(FeatureType.VISUAL, (self.height, self.width, 3)),
        }

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        house: dict[str, Any] = {"data": self.data, "split": self.split} if self.data else {}
        longest = {} if self.task == "Drive" else {"steps": self.steps}
        sees = () if self.blind else ("rgb",)
        sides = {"height": self.height, "width": self.width}
        return {**sides, "observations": sees, "pictures": self.pictures, **longest, **house}

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, gym.vector.VectorEnv]]:
        return make_env(n_envs, use_async_envs, env=self.task or "VLNCE", **self.gym_kwargs)
