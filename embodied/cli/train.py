"""Train a learner: the encoder, its detector, an agent, a student, or one of your own.

    embodied train hanna --data DATA --out RUN
    embodied train my_learner:LEARNER --data DATA --out RUN

Rerun an interrupted command to resume; the result is the same. `tensorboard --logdir DIR` shows the curves.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from embodied.agents.learner import learner_named, shipped_learners
from embodied.cli.common import note

if TYPE_CHECKING:
    from embodied.interface import Episode

WATCHED = 2
"""Validation episodes that --rrd records each time."""


def commands(words: Sequence[str]) -> Mapping[str, Any]:
    """The commands of the learners that `words`, of the command line, name; of all where none is named."""
    return learner_commands("train", words, trained)


def trained(train: Callable[..., Any], args: Any) -> None:
    """Train once PyTorch has its threads, if the options say how many."""
    from embodied.agents.common.tensors import use_threads

    use_threads(getattr(args, "threads", 1))
    watch = {"on_validation": recorder(args)} if getattr(args, "rrd", False) else {}
    train(args, note=note, **watch)


def recorder(args: Any) -> Callable[[int, Sequence[Episode]], None]:
    """Records the first episodes of each validation for Rerun, with what the agent saw if it has an encoder."""
    from embodied.agents.vision.run import drawn_world, pictures_of
    from embodied.datasets.store import Dataset
    from embodied.viz.recording import record_episode
    from embodied.viz.sinks import Sinks

    data = Dataset(args.data)

    def keep(update: int, episodes: Sequence[Episode]) -> None:
        for number, episode in enumerate(episodes[:WATCHED]):
            name = episode.task.world
            with drawn_world(data, name, args.cache, pictures_of(data, name, args.pictures)) as world:
                file = args.out / f"validation_{update:06d}_{number}.rrd"
                record_episode(world, episode, Sinks(file), eyes=world if hasattr(args, "encoder") else None)

    return keep


def learner_commands(verb: str, words: Sequence[str], run: Callable[[Callable[..., Any], Any], None]) -> dict[str, Any]:
    """Commands `embodied VERB LEARNER`, for embodied.options.add_commands.

    Args:
      verb: 'train' or 'study', a field of embodied.agents.learner.Learner.
      words: of the command line; where they name a learner, only that one is imported.
      run: (the learner's function, options) -> None.
    """
    after = list(words)[list(words).index(verb) + 1 :] if verb in words else []
    named = [w for w in after[:1] if w in shipped_learners() or ":" in w]
    commands = {name: getattr(learner_named(name), verb) for name in named or shipped_learners()}
    if named and commands[named[0]] is None:
        raise ValueError(f"{named[0]!r} is no learner to {verb}; `embodied {verb} --help` lists them")
    return _bound({name: command for name, command in commands.items() if command is not None}, run)


def _bound(commands: Mapping[str, Any], run: Callable[..., None]) -> dict[str, Any]:
    return {
        name: (about, _bound(what, run) if isinstance(about, str) else functools.partial(run, what))
        for name, (about, what) in commands.items()
    }
