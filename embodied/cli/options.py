"""Command-line options: the types of arguments, checked before any work begins, and options made from settings.

A type here is what `type=` of argparse wants: it turns a word into a value or says, in one line,
what it should be.
"""

from __future__ import annotations

import argparse
import ast
import dataclasses
import inspect
import itertools
import math
import os
import textwrap
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

if typing.TYPE_CHECKING:
    from embodied.envs.hari import HariRules

C = typing.TypeVar("C")
METAVARS: Mapping[type, str] = {int: "N", float: "X", str: "WORD"}
MOST = 10**7
"""Largest count that any option takes."""
HOUSES = 100_000
"""Most houses of a data set."""
REPEATS = 1000
"""Most repeats of a study."""


# Types of arguments -----------------------------------------------------------------------------


def whole(least: int = 1, most: int = MOST, *, even: bool = False) -> Callable[[str], int]:
    """Whole numbers from `least` to `most`, both included."""
    wanted = f"{'an even' if even else 'a whole'} number of at least {least}"

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if not least <= value <= most or (even and value % 2):
            upto = f" and at most {most}" if most < MOST or value > most else ""
            raise argparse.ArgumentTypeError(f"should be {wanted}{upto}, got {text[:40]!r}")
        return value

    return read


def positive(text: str) -> float:
    """Finite numbers above zero."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"should be a number above 0, got {text[:40]!r}")
    return value


def not_negative(text: str) -> float:
    """Finite numbers from zero on."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"should be a number from 0 on, got {text[:40]!r}")
    return value


face = whole(8, 4096)
"""Side of a cube face, pixels."""
video_side = whole(16, 4096, even=True)
"""Height or width of a video, pixels."""


def any_path(text: str) -> Path:
    """A path that libraries can open: not empty, and text in UTF-8.

    MuJoCo, MjSpec and others take paths as UTF-8 text only.
    """
    if not text:
        raise argparse.ArgumentTypeError("should be a path, got an empty word; use . for this folder")
    try:
        os.fsencode(text).decode("utf-8")
        text.encode("utf-8")
    except (UnicodeDecodeError, UnicodeEncodeError):
        raise argparse.ArgumentTypeError(
            f"should be a path in UTF-8, which MuJoCo wants, got {os.fsencode(text)!r}; "
            "rename it, or set LC_ALL=C.UTF-8 if it is meant as UTF-8"
        ) from None
    found = Path(text)
    try:
        found.stat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass
    except OSError as e:  # a link that leads to itself, a name too long
        raise argparse.ArgumentTypeError(f"{text[:80]!r} cannot be used: {e.strerror}; choose another path") from None
    return found


def any_folder(text: str) -> Path:
    """A folder, there or not."""
    found = any_path(text)
    if found.exists() and not found.is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a file, a folder is wanted; move it away or choose another name")
    return found


def folder_to_write(text: str) -> Path:
    """A folder that is there and may be written, or that can be made."""
    found = any_folder(text)
    _refuse_unwritable(found)
    return found


def file_to_write(text: str) -> Path:
    """A file that can be written, new or over an old one."""
    found = any_path(text)
    if found.is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a folder, a file is wanted; name a file in it")
    _refuse_unwritable(found.parent)
    return found


def file_ending_in(*endings: str) -> Callable[[str], Path]:
    """A file that can be written, of the kind that is written."""

    def read(text: str) -> Path:
        found = file_to_write(text)
        if found.suffix.lower() not in endings:
            raise argparse.ArgumentTypeError(f"should end in {' or '.join(endings)}, which is written, got {text!r}")
        return found

    return read


def house_folder(text: str) -> Path:
    """A folder that `embodied house` wrote."""
    found = any_path(text)
    if found.is_file():
        raise argparse.ArgumentTypeError(f"{text} is a file; name the folder that it is in, {found.parent}")
    return found


def _refuse_unwritable(wanted: Path) -> None:
    there = next(p for p in (wanted, *wanted.absolute().parents) if p.exists())
    if not there.is_dir():
        raise argparse.ArgumentTypeError(f"{there} is a file, {wanted} needs a folder there; choose another name")
    if not os.access(there, os.W_OK | os.X_OK):
        raise argparse.ArgumentTypeError(f"{there} may not be written by you; choose another place than {wanted}")


def add_pictures(
    parser: argparse._ActionsContainer,
    kinds: Sequence[str],
    default: str | None = None,
    *,
    what: str = "how the house is drawn",
    otherwise: str = "",
) -> None:
    """--pictures: one of `kinds`, in the words of embodied.render.pictures.

    Args:
      what: is drawn, for the help.
      otherwise: what happens without the option, where there is no default.
    """
    texts = [f"{k}: {PICTURE_HELP[k]}" for k in kinds if k in PICTURE_HELP]
    ends = f"(default: {default or otherwise})"
    parser.add_argument("--pictures", choices=kinds, default=default, help=f"{what}; {'; '.join(texts)} {ends}")


PICTURE_HELP = {
    "none": "nothing is drawn",
    "unlit": "no light is computed",
    "fast": "global illumination in about a minute",
    "normal": "finer global illumination",
    "fast-matte": "without reflections, two to three times faster to draw",
    "normal-matte": "likewise",
    "fast-filament": "drawn by MuJoCo's Filament through Vulkan",
    "normal-filament": "likewise",
    "traced": "rays are traced into the baked light",
    "reference": "path tracing, slow",
}
VNLA_RULES = ("indirect", "direct", "direct-mute", "goal-aware", "algorithm-6")
"""As in embodied.envs.vnla, which --help should not import."""


def add_rules(parser: argparse._ActionsContainer) -> None:
    parser.add_argument(
        "--rules",
        choices=VNLA_RULES,
        default=VNLA_RULES[0],
        help="VNLA's rule of play: help in words (indirect), the advisor acts and says it (direct) or does not "
        "(direct-mute), the program's 'forward' (goal-aware), Algorithm 6 as printed (default: %(default)s)",
    )


STATES = ("none", "sparse", "dense")
"""As in embodied.envs.hari, which --help should not import."""


def add_hari_rules(parser: argparse.ArgumentParser) -> None:
    """HARI's variants; `hari_rules_of` reads them."""
    group = parser.add_argument_group("HARI's variants (defaults: Table E.2 of the dissertation)")
    group.add_argument(
        "--stack", type=whole(), default=2, metavar="L", help="largest number of goals on the stack (default: 2)"
    )
    group.add_argument(
        "--longest", type=whole(), default=3, metavar="N", help="longest path to a sub-goal, in nodes (default: 3)"
    )
    group.add_argument(
        "--cost", type=not_negative, default=0.01, metavar="X", help="cost of each action (default: 0.01)"
    )
    group.add_argument(
        "--horizon", type=whole(), metavar="H", help="longest episode in steps (default: its task's, 30)"
    )
    group.add_argument(
        "--uncooperative", action="store_true", help="the assistant answers a different question from the one asked"
    )
    group.add_argument(
        "--states",
        choices=STATES,
        default=STATES[1],
        help="how the agent's own place is described without a request (default: %(default)s)",
    )
    group.add_argument(
        "--kept",
        type=float,
        default=0.1,
        metavar="SHARE",
        help="share of the object classes, the commonest, that sparse descriptions keep (default: %(default)s)",
    )


def hari_rules_of(args: argparse.Namespace) -> HariRules:
    """The variants of `add_hari_rules`."""
    from embodied.envs.hari import Costs, HariRules

    costs, cooperative = Costs.alike(args.cost), not args.uncooperative
    return HariRules(costs, args.stack, args.longest, cooperative, args.states, args.horizon, args.kept)


# Options made from settings ---------------------------------------------------------------------


def add_fields(
    parser: argparse._ActionsContainer,
    config: type,
    skip: Sequence[str] = (),
    *,
    words: Mapping[str, Sequence[str]] | None = None,
    scales: Mapping[str, object] | None = None,
) -> None:
    """One option per field of the frozen dataclass `config`; the sentence below a field is its help.

    An option that is not given leaves the field as it is in the settings that `chosen` starts from.

    Args:
      words: what may be given for a field, to be listed in the help.
      scales: named settings that `chosen` may start from, for the help.
    """
    hints, helps = typing.get_type_hints(config), field_docs(config)
    for f in dataclasses.fields(config):
        if f.name in skip:
            continue
        option, text = "--" + f.name.replace("_", "-"), helps.get(f.name, "")
        if default := _default(config, f, scales or {}):
            text = f"{text} (default: {default})"
        text = text.replace("%", "%%")
        item, many = _scalar(hints[f.name])
        listed = (words or {}).get(f.name)
        name = "{" + ",".join(listed) + "}" if listed else METAVARS.get(item)
        if item is bool:
            parser.add_argument(option, action=argparse.BooleanOptionalAction, default=None, help=text)
        elif many:
            parser.add_argument(option, type=item, nargs=many, default=None, help=text, metavar=name)
        else:
            parser.add_argument(option, type=item, default=None, help=text, metavar=name)


def chosen(args: argparse.Namespace, config: C) -> C:
    """The settings `config` with the fields that were given on the command line; they check themselves.

    Raises:
      ValueError: a value that the settings refuse.
    """
    given = {f.name: getattr(args, f.name, None) for f in dataclasses.fields(config)}  # type: ignore[arg-type]
    values = {k: tuple(v) if isinstance(v, list) else v for k, v in given.items() if v is not None}
    return dataclasses.replace(config, **values)  # type: ignore[type-var]


def _default(config: type, field: dataclasses.Field, scales: Mapping[str, object]) -> str:
    """The field's default in words, for every scale where they differ; '' for none."""
    of_scale = {name: getattr(c, field.name) for name, c in sorted(scales.items()) if isinstance(c, config)}
    if len(set(of_scale.values())) > 1:
        return ", ".join(f"{name}: {value}" for name, value in of_scale.items())
    return "" if field.default in (None, dataclasses.MISSING) else str(field.default)


def _scalar(hint: typing.Any) -> tuple[type, str | int | None]:
    """The type of one value and how many: None (one), a number, or '+'."""
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        hint = next(a for a in typing.get_args(hint) if a is not type(None))
    if typing.get_origin(hint) is tuple:
        items = typing.get_args(hint)
        return items[0], "+" if Ellipsis in items else len(items)
    return hint, None


def field_docs(kind: type) -> dict[str, str]:
    """Field name to the docstring that stands below it in the source, on one line; those of the records that `kind`
    stands on, too."""
    docs: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if dataclasses.is_dataclass(base):
            docs |= _own_docs(base)
    return docs


def _own_docs(kind: type) -> dict[str, str]:
    (body,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
    assert isinstance(body, ast.ClassDef)
    docs = {}
    for field, doc in itertools.pairwise(body.body):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(doc, ast.Expr)
            and isinstance(doc.value, ast.Constant)
        ):
            docs[field.target.id] = " ".join(str(doc.value.value).split())
    return docs
