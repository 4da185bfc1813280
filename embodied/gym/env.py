"""Gymnasium environments embodied/Find-v0, VLN-v0, VNLA-v0, HANNA-v0 and HARI-v0, registered by `import embodied`.

    env = gymnasium.make("embodied/HANNA-v0", data="DIR", split="train")

Without `data` a small furnished house is generated, which takes a few seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from PIL import Image, ImageDraw

from assets.cache import default_cache
from embodied.envs.base import ActionError, HelpEnv
from embodied.evaluation.metrics import PER_EPISODE
from embodied.gym.playground import make_playground
from embodied.gym.semantic_features import FeatureTable
from embodied.gym.spaces import Layout, action_space, decode, encode, observation_space
from embodied.house.floor_plan import draw_plan, font
from embodied.interface import FeatureSource, Observation, Place, Pose, SeenPlace, Task
from embodied.world import World

STEP_COST = 0.01
LAYOUT = Layout()
VIEW = (480, 640)
"""Height and width of the rendered view, pixels."""
VIEW_ANGLE = np.radians(78.0)
"""Vertical field of view of what `render` shows, radians: wider than the agent's 60 degrees, so that a person finds their way."""


class HelpGymEnv(gym.Env[dict[str, Any], int]):
    """A HelpEnv as a Gymnasium environment: numbers in, numbers out, text as text.

    Reward: 1 on success at the end, minus 0.01 per step; HARI: minus the cost of the step. With
    `shaping`, minus the change of the distance to the nearest goal in metres / 10 (in HARI, in
    edges, Eq 4.20), which leaves the best policy as it is.

    An action that the mask forbids leaves everything as it was and is reported in
    info["invalid_action"]; after `patience` of them the episode is truncated. With `strict` it
    raises ActionError instead.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012 - as Gymnasium wants it

    def __init__(
        self,
        make_env: Callable[[], HelpEnv],
        tasks: Sequence[Task],
        source: FeatureSource,
        *,
        layout: Layout = LAYOUT,
        shaping: bool = False,
        strict: bool = False,
        patience: int = 20,
        render_mode: str | None = None,
    ) -> None:
        """
        Args:
          tasks: what `reset` draws from; reset(options={"task": i}) chooses one.
          source: features of every place, of the target image too.

        Raises:
          ValueError: no tasks, or an unknown render mode.
        """
        if not tasks:
            raise ValueError("there are no tasks to play; choose another split or a larger scale")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"render_mode should be 'rgb_array' or None, got {render_mode!r}")
        self._env, self._tasks, self._source, self._layout = make_env(), tuple(tasks), source, layout
        self._shaping, self._strict, self._patience = shaping, strict, patience
        self._names: dict[str, int] = {}
        self.render_mode = render_mode
        self.action_space = action_space(layout)
        self.observation_space = observation_space(layout, source.size)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """A task drawn with this environment's generator, or options["task"] by number."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(len(self._tasks)))
        chosen = drawn if options is None else int(options.get("task", drawn))
        self._o = self._env.reset(self._tasks[chosen], seed=int(self.np_random.integers(2**31)))
        self._invalid = 0
        return self._encoded(self._o), {"task": self._tasks[chosen].id}

    def step(self, action: int) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        before = self._potential()
        try:
            o = self._env.step(decode(int(action), self._layout))
        except ActionError as e:
            if self._strict or self._env.ended is not None:
                raise
            self._invalid += 1
            return (
                self._encoded(self._o),
                -STEP_COST,
                False,
                self._invalid >= self._patience,
                {"invalid_action": str(e)},
            )
        ended = self._env.ended
        info = {} if ended is None else self._judged()
        hari = self._env.task.kind == "hari"
        reward = -self._env.last_step.cost if hari else info.get("success", 0.0) - STEP_COST
        if self._shaping:
            reward += before - (0.0 if ended is not None and hari else self._potential())
        self._o = o if o is not None else self._o
        info |= self._env.facts()
        return self._encoded(self._o), float(reward), ended == "stop", ended == "limit", info

    def render(self) -> np.ndarray | None:
        """(h, w, 3) uint8: the agent's view, the plan with its path, and what was said."""
        if self.render_mode is None:
            gym.logger.warn("render() needs render_mode='rgb_array' when the environment is made")
            return None
        return picture(self._env, self._o)

    def _encoded(self, o: Observation) -> dict[str, Any]:
        return encode(o, self._source, self._layout, self._names)

    def _potential(self) -> float:
        e = self._env
        if e.task.kind == "hari":
            return e.task_error(e.pose.node, e.targets[0])
        return min(float(e.world.graph.distance[e.pose.node, g]) for g in e.task.goal_nodes) / 10.0

    def _judged(self) -> dict[str, float]:
        episode = self._env.episode()
        return {name.replace(" ", "_"): f(episode, self._env.world.graph) for name, f in PER_EPISODE.items()}


def picture(env: HelpEnv, o: Observation) -> np.ndarray:
    """The view along the agent's eyes, the plan beside it, the words below."""
    nodes = [env.task.start.node, *(s.next_pose.node for s in env._steps)]
    view = _view(env.world, env.pose)
    plan = draw_plan(
        env.world.house,
        pixels_per_metre=28,
        graph=env.world.graph,
        path=tuple(nodes),
        facing=env.pose.yaw,
        titles=False,
    )
    scale = VIEW[0] / plan.height
    plan = plan.convert("RGB").resize((max(1, round(plan.width * scale)), VIEW[0]), Image.Resampling.LANCZOS)
    sheet = Image.new("RGB", (view.width + plan.width, VIEW[0] + 64), "white")
    sheet.paste(view, (0, 0))
    sheet.paste(plan, (view.width, 0))
    pen = ImageDraw.Draw(sheet)
    who = "assistant" if o.mode.value == "sub" else "task"
    pen.text((10, VIEW[0] + 8), _wrapped(f"{who}: {o.instruction}", sheet.width // 9), font=font(16), fill="black")
    return np.asarray(sheet)


def _view(world: Place, pose: Pose) -> Image.Image:
    if not isinstance(world, World):
        blank = Image.new("RGB", (VIEW[1], VIEW[0]), "lightgray")
        ImageDraw.Draw(blank).text((20, 20), "no pictures of this house", font=font(18), fill="black")
        return blank
    return Image.fromarray(world.panorama(pose.node).view_rgb(pose.yaw, pose.pitch, VIEW_ANGLE, size=VIEW))


def _wrapped(text: str, width: int) -> str:
    lines, line = [], ""
    for word in text.split():
        if len(line) + len(word) + 1 > width:
            lines.append(line)
            line = ""
        line = f"{line} {word}".strip()
    return "\n".join([*lines, line][:2])


def make(
    kind: str,
    *,
    data: str | Path | None = None,
    split: str = "train",
    seed: int = 0,
    cache: str | Path | None = None,
    source: FeatureSource | None = None,
    worlds: Mapping[str, SeenPlace] | None = None,
    wheels: bool = False,
    **options: Any,
) -> HelpGymEnv:
    """The environment of a kind of task over a data set, or over one generated house without `data`.

    Args:
      data: folder that `embodied dataset` built.
      source: features; semantic ones of what is visible where not given.
      worlds: worlds with pictures, for render(); otherwise opened from `data`.
      wheels: edges are driven physically (find, VLN and HANNA); bumps are in info["bumps"].
      options: of HelpGymEnv.

    Raises:
      ValueError: wheels for a kind of task that cannot have them.
    """
    play = make_playground(
        kind,
        Path(data) if data else None,
        split,
        seed=seed,
        cache=Path(cache) if cache else default_cache(),
        worlds=worlds,
        with_features=source is None,
    )
    layout = options.pop("layout", Layout(descriptions=kind == "hari"))
    make_env = _on_wheels(kind, play.make_env, Path(cache) if cache else default_cache()) if wheels else play.make_env
    return HelpGymEnv(make_env, play.tasks, source or FeatureTable(play.features), layout=layout, **options)


def _on_wheels(kind: str, make_env: Callable[[], HelpEnv], cache: Path) -> Callable[[], HelpEnv]:
    """The same rule of play with a body."""
    from assets.catalogue import load_catalogue
    from embodied.envs.driven import DrivenEnv, DrivenHannaEnv  # physics, only where wanted

    kinds = {"find": DrivenEnv, "vln": DrivenEnv, "hanna": DrivenHannaEnv}
    if kind not in kinds:
        raise ValueError(f"{kind!r} cannot be played on wheels, only {sorted(kinds)}")
    catalogue = load_catalogue(cache)

    def make_driven() -> HelpEnv:
        env = make_env()
        return kinds[kind](catalogue, env.worlds, env.assistant, env.moves)

    return make_driven
