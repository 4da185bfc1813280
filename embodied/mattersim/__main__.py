"""Run a program that imports MatterSim with the stand-in: python -m embodied.mattersim DIALECT SCRIPT [ARGUMENTS]."""

import runpy
import sys
from collections.abc import Sequence
from pathlib import Path

from embodied.mattersim import DIALECTS, install

USAGE = f"use: python -m embodied.mattersim {{{','.join(DIALECTS)}}} SCRIPT.py [ARGUMENTS OF THE SCRIPT]"


def main(arguments: Sequence[str]) -> int:
    """Run the script as `python SCRIPT.py ARGUMENTS` would, but for MatterSim; returns the status of a wrong call."""
    if len(arguments) < 2 or arguments[0] not in DIALECTS:
        print(
            f"error: expected a dialect and a script, got {' '.join(arguments) or 'nothing'}; {USAGE}", file=sys.stderr
        )
        return 2
    dialect, script = arguments[0], Path(arguments[1])
    if not script.is_file():
        print(f"error: there is no script {script}; {USAGE}", file=sys.stderr)
        return 2
    install(dialect)
    sys.argv = list(arguments[1:])
    sys.path[0] = str(script.resolve().parent)  # where Python looks first for the modules beside a script
    runpy.run_path(str(script), run_name="__main__")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
