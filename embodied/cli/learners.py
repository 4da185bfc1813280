"""The commands of learners, whoever they are."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from embodied.agents.learner import learner_named, shipped_learners


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
