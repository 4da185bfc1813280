"""Show what a trained learner does: some of its episodes, or its answer to a request of your own.

    embodied show iliad --request "drop every vowel" --word banana

`embodied show LEARNER --help` explains.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from embodied.cli.common import note, show
from embodied.cli.learners import learner_commands


def commands(words: Sequence[str]) -> Mapping[str, Any]:
    """The commands of the learners that `words`, of the command line, name; of all where none is named."""
    return learner_commands("show", words, printed)


def printed(show_learner: Callable[..., Any], args: Any) -> None:
    """Print what a learner shows."""
    body, text = show_learner(args, note=note)
    show(args, body, text)
