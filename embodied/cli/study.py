"""Train agents for each row of a table of a paper, evaluate them, and write the table beside the printed numbers.

    embodied study hanna 4.5 --data DATA --out STUDY --seeds 3
    embodied study my_learner:LEARNER --data DATA --out STUDY

`embodied study LEARNER --help` lists the tables of a learner. Rows that tables share are trained once. Each table is
written as JSON, Markdown and, for some, as a figure. Rerun an interrupted command to resume.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from embodied.cli.common import note
from embodied.cli.train import learner_commands


def commands(words: Sequence[str]) -> Mapping[str, Any]:
    """The commands of the learners that `words`, of the command line, name; of all where none is named."""
    return learner_commands("study", words, run_tables)


def run_tables(study: Callable[[Any], Any], args: Any) -> None:
    """Make the tables of a study and print them."""
    from embodied.agents.studies.engine import run_study

    learner = study(args)
    tables, command = getattr(args, "tables", None) or list(learner.tables()), " ".join(["embodied", *sys.argv[1:]])
    how = {"rows": args.rows or None, "workers": args.workers, "report": args.report}
    files = run_study(learner, tables, args.out, command=command, note=note, **how)
    for path in files.values():
        print(path.read_text(encoding="utf-8"))
