"""The part of `embodied evaluate` that is for trained agents; it loads PyTorch."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.agents.learner import Learner, PlaySettings
from embodied.cli.common import bar, note
from embodied.evaluation.tables import Row
from embodied.render.pictures import in_words

if TYPE_CHECKING:
    from embodied.cli.evaluate_options import EvaluateOptions
    from embodied.datasets.store import Dataset, SplitData
    from embodied.interface import Episode


def evaluate_trained(
    args: EvaluateOptions,
    data: Dataset,
    learner: Learner,
    file: Path,
    splits: Sequence[str],
    wanted: Sequence[str],
    keep: Callable[[str, str, Sequence[Episode]], None],
    instead: Callable[[SplitData], SplitData],
) -> tuple[list[Row], dict[str, object]]:
    """Rows of a trained agent and of agents beside it, over the same tasks, and facts for run.json.

    Args:
      learner: the agent's, which can play.
      wanted: names of rows; none for all of the paper's tables.
      keep: is given split, name and episodes (to save them).
      instead: the split with another assistant.

    Raises:
      ValueError: an unknown row.
    """
    from embodied.agents.common.parallel import use_threads
    from embodied.agents.common.weights import weights_digest
    from embodied.agents.studies.episodes import JUDGES, evaluate_frozen
    from embodied.agents.vision.config import CAPTURE_CONDITIONS
    from embodied.agents.vision.drawn import pictures_of
    from embodied.identity import identity_of

    use_threads(args.threads)
    assert learner.players is not None, "others were refused"
    how = PlaySettings(**{f.name: getattr(args, f.name) for f in dataclasses.fields(PlaySettings)})
    players_of = learner.players(file, data, how)
    rows, blind = list[Row](), set[str]()
    for split in splits:
        players = players_of(split)
        if players.about and split == splits[0]:
            note(players.about)
        if unknown := sorted(set(wanted) - set(players.agents)):
            raise ValueError(f"unknown rows {unknown}; there are {list(players.agents)}")
        for name in bar(wanted or players.usual or [*players.agents], "agents", "agent"):
            whole, agent = players.agents[name]
            rows += evaluate_frozen(
                instead(whole), {name: agent}, seed=args.seed, limit=args.tasks, batch=args.batch or 32,
                keep=functools.partial(keep, split),
            )  # fmt: skip
        blind |= set(players.blind)
    looking = sorted({r.agent for r in rows} - blind)
    names = [n for split in splits for n in data.names(split)] if looking else []
    facts: dict[str, object] = {"agent": weights_digest(file) if file.is_file() else str(file), "looking": looking}
    facts["pictures"] = {n: in_words(pictures_of(data, n, args.pictures)) for n in names}
    facts["goal_image"] = dataclasses.asdict(CAPTURE_CONDITIONS[args.goal_image])
    return rows, facts | {"identity": identity_of(*JUDGES)}
