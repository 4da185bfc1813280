"""Navigation from ratings, studied: gain against granularity, noise and skew, in houses that were not rated."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch

from agents.bandit.figures import gains_figure
from agents.bandit.navigation import fingerprint, learn_from_stars, score_of
from agents.bandit.rating_config import DECISIONS, RatingConfig
from agents.bandit.ratings import CLEAN, Rater, rater_of
from agents.common.lessons import Split, split_of
from agents.common.studies import history_of
from agents.hanna.agent import HannaAgent, load_agent
from agents.hanna.asking import RULES
from agents.hanna.policy import for_training
from agents.vision.encoder import Encoder
from assets.cache import write_bytes, write_json
from embodied.datasets.store import dataset_of
from embodied.evaluation import metrics
from embodied.evaluation.evaluate import spread
from embodied.evaluation.rollout import play
from embodied.evaluation.tables import Estimate, estimate
from embodied.interface import Episode
from embodied.records import load_lines, save_lines

Note = Callable[[str], None]
SWEEPS: Mapping[str, Sequence[float]] = {
    "granularity": (1, 2, 4, 9),
    "variance": (0.5, 1, 2, 5),
    "skew": (0.25, 0.5, 2, 4),
}
"""A granularity of 4 is one to five stars, of 9 one to ten."""
COLUMNS = ("success", "SDTW", "requests")


@dataclass(frozen=True)
class NavigationSetting:
    """What all runs share."""

    data: Path
    encoder: Encoder
    """Whose features the agents know."""
    agent: Path
    """The imitation-trained agent that all begin with."""
    out: Path
    config: RatingConfig
    seeds: tuple[int, ...]
    """One run of each rater per seed."""
    split: str = "test_unseen"
    """Whose houses are judged in; nobody rated an episode there."""
    rated: str = "train"
    """Whose houses and tasks are rated in."""
    tasks: int | None = None
    """Judge on at most so many tasks."""
    threads: int = 1
    judgings: int = 3
    """How often each task is judged, each time with another seed: agents draw what they do."""
    decisions: str = "drawn"
    """Judged with moves and questions 'drawn' from the networks, as they are while they are rated, or with the
    'usual' ones of `embodied judge`, which asks where that is likelier than not."""


def raters() -> dict[str, Rater]:
    """By name: 'clean', and each perturbation at each strength."""
    swept = {f"{name} {value:g}": rater_of(name, value) for name, values in SWEEPS.items() for value in values}
    return {"clean": CLEAN, **swept}


def run_navigation_study(setting: NavigationSetting, only: Sequence[str] | None = None, *, note: Note = print) -> Path:
    """Run and judge what is missing; write table and figure of all that is there; returns the table's path.

    Raises:
      ValueError: an unknown rater, unknown decisions, houses that are rated and judged in, or a data set without
        the agent's features.
    """
    if setting.decisions not in DECISIONS:
        raise ValueError(f"decisions must be one of {DECISIONS}, got {setting.decisions!r}")
    if unknown := [name for name in only or () if name not in raters()]:
        raise ValueError(f"unknown raters {unknown}; there are {list(raters())}")
    torch.set_num_threads(setting.threads)
    data = dataset_of(setting.data, "hanna")
    if both := set(data.names(setting.rated)) & set(data.names(setting.split)):
        raise ValueError(
            f"{len(both)} houses of {setting.split!r} are rated in, too ({setting.rated!r}); judge in others"
        )
    rated, judged = (split_of(data, name, setting.encoder.digest) for name in (setting.rated, setting.split))
    return run_raters(setting, rated, judged, list(only or raters()), note=note)


def run_raters(setting: NavigationSetting, rated: Split, judged: Split, wanted: Sequence[str], *, note: Note) -> Path:
    """Learn in the houses of `rated`, judge in those of `judged`, and write what there is."""
    _judge(setting, judged, None, None, note)
    for seed in setting.seeds:
        for name in wanted:
            _learn(setting, rated, name, seed, note)
            _judge(setting, judged, name, seed, note)
    return _write(setting, judged)


def _folder(setting: NavigationSetting, name: str | None, seed: int | None) -> Path:
    return setting.out / "before" if name is None else setting.out / f"seed_{seed}" / name.replace(" ", "_")


def _learn(setting: NavigationSetting, split: Split, name: str, seed: int, note: Note) -> None:
    folder = _folder(setting, name, seed)
    if (folder / "agent.safetensors").exists():
        return
    agent, config = load_agent(setting.agent), dataclasses.replace(setting.config, seed=seed)
    learn_from_stars(agent, split, raters()[name], config, folder, begun_with=fingerprint(agent), note=note)


def _judge(setting: NavigationSetting, split: Split, name: str | None, seed: int | None, note: Note) -> None:
    """Play the tasks to be judged on, as `embodied judge` does, and keep the episodes."""
    folder = _folder(setting, name, seed)
    missing = [k for k in range(setting.judgings) if not _episodes_file(setting, folder, k).exists()]
    if not missing:
        return
    agent: HannaAgent = load_agent(setting.agent if name is None else folder / "agent.safetensors")
    policy, tasks = agent.policy(split.bank), spread(split.tasks, setting.tasks)
    if setting.decisions == "drawn":
        policy = dataclasses.replace(for_training(policy, RULES[agent.config.ask_rule][0]), keep_moments=False)
    for k in missing:
        with torch.inference_mode():
            episodes = play(split.make_env, policy, tasks, seed=k, batch=32)
        save_lines(_episodes_file(setting, folder, k), episodes)
        success = np.mean([metrics.success(e, split.worlds[e.task.world].graph) for e in episodes])
        note(
            f"{folder}: success {100 * success:.1f} % on {len(episodes)} tasks of {setting.split}, judged with seed {k}"
        )


def _episodes_file(setting: NavigationSetting, folder: Path, judging: int) -> Path:
    return folder / f"episodes_{setting.decisions}_{judging}.jsonl"


def _judged(setting: NavigationSetting, folder: Path) -> list[Episode]:
    """The episodes of all judgings, one after the other; none if one is missing."""
    paths = [_episodes_file(setting, folder, k) for k in range(setting.judgings)]
    return [e for path in paths for e in load_lines(path, Episode)] if all(p.exists() for p in paths) else []


def values(episodes: Sequence[Episode], split: Split) -> dict[str, np.ndarray]:
    """Column to one number per episode; success in per cent."""
    graphs = [split.worlds[e.task.world].graph for e in episodes]
    pairs = list(zip(episodes, graphs, strict=True))
    return {
        "success": np.array([100 * metrics.success(e, g) for e, g in pairs]),
        "SDTW": np.array([100 * score_of(e, g, "SDTW") for e, g in pairs]),
        "requests": np.array([float(e.requests) for e in episodes]),
    }


def rise(scores: Sequence[Sequence[float]], untaught: int) -> Estimate:
    """How much the last quarter of the updates scores more than the first `untaught` ones, before anything is learned.

    In points of 100; every update plays other tasks of the rated houses, so updates are what varies.

    Args:
      scores: per seed, the mean true score of each update's episodes.
    """
    first = np.concatenate([100 * np.array(one[: max(untaught, 1)]) for one in scores])
    last = np.concatenate([100 * np.array(one[-max(len(one) // 4, 1) :]) for one in scores])
    error = sum(a.var(ddof=1) / len(a) for a in (first, last)) if min(len(first), len(last)) > 1 else np.nan
    return Estimate(float(last.mean() - first.mean()), float(1.96 * np.sqrt(error)), len(scores))


def gain(after: Sequence[np.ndarray], before: np.ndarray, houses: Sequence[str]) -> Estimate:
    """Mean difference on the same tasks, averaged over seeds, its interval clustered by house."""
    return estimate((np.mean(after, 0) - before).tolist(), houses)


def _write(setting: NavigationSetting, split: Split) -> Path:
    first = _judged(setting, _folder(setting, None, None))
    houses, before = [e.task.world for e in first], values(first, split)
    found: dict[str, dict[str, Estimate]] = {}
    each: dict[str, list[float]] = {}
    for name in raters():
        judged = [_judged(setting, _folder(setting, name, seed)) for seed in setting.seeds]
        if all(judged):
            after = [values(episodes, split) for episodes in judged]
            found[name] = {c: gain([a[c] for a in after], before[c], houses) for c in COLUMNS}
            histories = [history_of(_folder(setting, name, seed)) for seed in setting.seeds]
            found[name]["rated"] = rise([[h["score"] for h in one] for one in histories], setting.config.critic_updates)
            each[name] = [float((a["success"] - before["success"]).mean()) for a in after]
    base = {c: estimate(before[c].tolist(), houses) for c in COLUMNS}
    write_json(
        setting.out / "navigation.json", {k: {c: vars(e) for c, e in v.items()} for k, v in found.items()}, indent=1
    )
    if "clean" in found:
        _figure(setting, found)
    path = setting.out / "navigation.md"
    write_bytes(path, _markdown(setting, base, found, each, len(set(houses))).encode())
    return path


def _figure(setting: NavigationSetting, found: Mapping[str, Mapping[str, Estimate]]) -> None:
    columns = {"rated": f"{setting.config.score} where rated", "success": "success elsewhere", "SDTW": "SDTW elsewhere"}
    swept = {
        name: {
            v: {columns[c]: found[f"{name} {v:g}"][c] for c in columns} for v in strengths if f"{name} {v:g}" in found
        }
        for name, strengths in SWEEPS.items()
    }
    swept = {name: points for name, points in swept.items() if points}
    if swept:
        clean = {columns[c]: found["clean"][c] for c in columns}
        gains_figure(swept, clean, setting.out / "figure_navigation.png")


def _markdown(
    setting: NavigationSetting,
    base: Mapping[str, Estimate],
    found: Mapping[str, Mapping[str, Estimate]],
    each: Mapping[str, Sequence[float]],
    houses: int,
) -> str:
    shown = lambda e: f"{e.mean:.1f} ± {e.half:.1f}"
    lines = [
        "# Navigation from ratings: gain in houses that were not rated",
        "",
        f"| rater | Δ {setting.config.score} where rated | Δ success (points) | of each seed | Δ SDTW (points) "
        "| Δ requests |",
        "|---|---|---|---|---|---|",
    ]
    for name, row in found.items():
        seeds = ", ".join(f"{x:+.1f}" for x in each[name])
        rated, success, sdtw, requests = (shown(row[c]) for c in ("rated", "success", "SDTW", "requests"))
        lines.append(f"| {name} | {rated} | {success} | {seeds} | {sdtw} | {requests} |")
    missing = [name for name in raters() if name not in found]
    c = setting.config
    how = (
        f"Before: success {shown(base['success'])} %, SDTW {shown(base['SDTW'])}, {shown(base['requests'])} requests, "
        f"on {base['success'].n // setting.judgings} tasks in {houses} houses ({setting.split}), each judged "
        f"{setting.judgings} times. {c.updates} updates of {c.batch} "
        f"episodes, each rated once by its {c.score}; learning rate {c.learning_rate:g}; seeds "
        f"{', '.join(map(str, setting.seeds))}; decisions {setting.decisions}. Where rated: last quarter of the "
        f"updates less the first {c.critic_updates}, in which only the critic learns. Elsewhere: differences task by "
        "task, averaged over seeds; intervals 95 %, clustered by house."
    )
    return "\n".join([*lines, "", how, *([f"Not run: {', '.join(missing)}."] if missing else []), ""])
