"""The console command `embodied`: one module per subcommand, composed here.

This is the one place of the package where everything meets: subcommands may import `viz` and
`agents`, late and inside `run`, so that `embodied --help` answers at once.
"""

import argparse
import ast
import errno
import importlib
import io
import os
import sys
import typing
import warnings
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from pathlib import Path
from typing import NoReturn

from embodied.errors import UnableError

COMMANDS = (
    *("demo", "doctor", "assets", "house", "light", "render", "rollout", "view", "dataset", "features", "corpus"),
    *("export", "train", "evaluate", "serve", "llm", "study", "bench", "cache"),
)
"""Subcommands in the order `--help` lists them; each is a module with `run(options)`, or with commands of its own:
`COMMANDS`, or `commands(words)` of the command line."""

REMEDIES = {
    errno.ENOSPC: "the disk is full; free some space, or put --cache and --out elsewhere. Finished files are kept",
    errno.EFBIG: "this disk, or the limit set with `ulimit -f`, holds no larger files; put --cache and --out elsewhere",
    errno.ELOOP: "a symbolic link leads to itself; remove it",
    errno.EDQUOT: "your share of the disk is used up; free some space, or put --cache and --out on another disk",
    errno.EACCES: "it may not be read or written by you; choose another --out or --cache",
    errno.EPERM: "it may not be read or written by you; choose another --out or --cache",
    errno.EROFS: "this disk is read-only; choose another --out or --cache",
    errno.EEXIST: "a file stands where a folder is needed; move it away or choose another name",
    errno.ENOTDIR: "a file stands where a folder is needed; move it away or choose another name",
    errno.EISDIR: "a folder stands where a file is needed; move it away or choose another name",
    errno.ENOENT: "there is no such file or folder, and it cannot be made; check the path",
}
"""The remedy of an error of the operating system."""

EXTRAS = {
    **dict.fromkeys(("torch", "safetensors", "sacrebleu"), "agents"),
    **dict.fromkeys(("rerun", "rerun_cli", "av", "matplotlib"), "viz"),
    **dict.fromkeys(("pyarrow", "networkx", "trimesh"), "data"),
}
"""Which extra of the distribution brings a library that a small installation lacks."""

KILLED = (
    "a worker process was ended from outside, most often because memory ran out; run the same command again, "
    "perhaps with fewer --workers. Finished files are kept"
)
"""The message about a killed worker."""


class Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as all commands do, instead of the whole usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"error: {message}; `{self.prog} --help` explains\n")


def parser(*chosen: str, words: Sequence[str] = ()) -> argparse.ArgumentParser:
    """The argument parser; of the subcommands, only those `chosen` get their options (and are imported).

    Args:
      words: of the command line, by which `train` and `study` see which learner they are for.
    """
    top = Parser(
        prog="embodied",
        description="Generated houses in MuJoCo, panoramas, and agents that ask people for help.",
        epilog="Start with `embodied doctor`, then `embodied demo`. `embodied COMMAND --help` explains each.",
    )
    top.add_argument(
        "--traceback", action="store_true", help="show where in the code an error comes from (before COMMAND)"
    )
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        text = ast.get_docstring(ast.parse((Path(__file__).parent / f"{name}.py").read_text(encoding="utf-8")))
        assert text, "every subcommand says what it does"
        summary = text.splitlines()[0].rstrip(".")
        sub = commands.add_parser(
            name,
            help=summary[0].lower() + summary[1:],
            description=text,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        if name in chosen:
            module = importlib.import_module(f"embodied.cli.{name}")
            from embodied.options import add_command, add_commands

            if hasattr(module, "run"):
                (options,) = (hint for name, hint in typing.get_type_hints(module.run).items() if name != "return")
                add_command(sub, options, module.run)
            else:
                commands_of = module.commands(words) if hasattr(module, "commands") else module.COMMANDS
                add_commands(sub, commands_of, "WHAT", "what")
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; returns the exit status (2: wrong input or an unable machine, 130: Ctrl-C)."""
    argv = sys.argv[1:] if argv is None else list(argv)
    for out in (sys.stdout, sys.stderr):
        if isinstance(out, io.TextIOWrapper):  # "±" on a terminal without it is a "?", not an error at the end
            out.reconfigure(errors="replace")
    try:
        args = parser(*[a for a in argv if a in COMMANDS][:1], words=argv).parse_args(argv)
        with warnings.catch_warnings():
            warnings.showwarning = lambda message, *_, **__: print(f"warning: {message}", file=sys.stderr)
            return args.run(args) or 0
    except KeyboardInterrupt:
        print("\nstopped; finished parts are kept and the same command goes on from there", file=sys.stderr)
        return 130
    except BrokenPipeError:  # the reader, such as `head`, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except (ValueError, OSError, UnableError, BrokenExecutor, ImportError) as e:  # executors: joblib's workers
        if "--traceback" in argv or (isinstance(e, ImportError) and _extra_of(e) is None):
            raise
        _close_bars()
        print(f"error: {message_of(e)}", file=sys.stderr)
        return 2


def _extra_of(error: ImportError) -> str | None:
    return EXTRAS.get((error.name or "").partition(".")[0])


def message_of(error: Exception) -> str:
    """An error in one line, with the remedy."""
    if isinstance(error, BrokenExecutor):
        return KILLED
    if isinstance(error, ImportError):
        return f"this needs {error.name}, which is not installed; pip install 'embodied-houses[{_extra_of(error)}]'"
    if isinstance(error, OSError) and error.errno in REMEDIES and error.strerror:
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror}: {REMEDIES[error.errno]}"
    return " ".join(str(error).split()) or type(error).__name__


def _close_bars() -> None:
    """End progress bars, so that what follows has a line of its own."""
    tqdm = sys.modules.get("tqdm")
    for bar in list(getattr(getattr(tqdm, "tqdm", None), "_instances", ())):
        bar.close()
