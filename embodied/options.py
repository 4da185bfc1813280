"""Command-line options from dataclasses: a field is an option, the docstring below it is its help.

A command is a record of options and a function that takes it. A field's annotation says what may be given:
`Annotated[int, Option(whole(), "N")]` names the function that reads a word, or says in one line what it should be.
A field that is a record of settings (`Settings`) is a group of options, one for each of its own fields.
"""

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
from typing import Annotated, Any

from embodied.assets.cache import default_cache

C = typing.TypeVar("C")
METAVARS: Mapping[type, str] = {int: "N", float: "X", str: "WORD", Path: "FILE"}
LARGEST_COUNT = 10**7
"""Largest count that any option takes."""
HOUSES = 100_000
"""Most houses of a data set."""
REPEATS = 1000
"""Most repeats of a study."""


def whole(least: int = 1, most: int = LARGEST_COUNT, *, even: bool = False) -> Callable[[str], int]:
    """Whole numbers from `least` to `most`, both included."""
    wanted = f"{'an even' if even else 'a whole'} number of at least {least}"

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if not least <= value <= most or (even and value % 2):
            upto = f" and at most {most}" if most < LARGEST_COUNT or value > most else ""
            raise argparse.ArgumentTypeError(f"should be {wanted}{upto}, got {text[:40]!r}")
        return value

    return read


def _finite(words: str, holds: Callable[[float], bool]) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not holds(value) or value == math.inf:
            raise argparse.ArgumentTypeError(f"should be a number {words}, got {text[:40]!r}")
        return value

    return read


positive = _finite("above 0", lambda x: x > 0)
part = _finite("above 0 and at most 1", lambda x: 0 < x <= 1)
not_negative = _finite("from 0 on", lambda x: x >= 0)
face = whole(8, 4096)
"""Side of a cube face, pixels."""
video_side = whole(16, 4096, even=True)
"""Height or width of a video, pixels."""


def any_path(text: str) -> Path:
    """A path, there or not."""
    if not text:
        raise argparse.ArgumentTypeError("should be a path, got an empty word; use . for this folder")
    return Path(text)


def any_folder(text: str) -> Path:
    """A folder, there or not."""
    path = any_path(text)
    if path.exists() and not path.is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a file, a folder is wanted; move it away or choose another name")
    return path


def folder_to_write(text: str) -> Path:
    """A folder that is there and may be written, or that can be made."""
    path = any_folder(text)
    _refuse_unwritable(path)
    return path


def file_to_write(text: str) -> Path:
    """A file that can be written, new or over an old one."""
    path = any_path(text)
    if path.is_dir():
        raise argparse.ArgumentTypeError(f"{text} is a folder, a file is wanted; name a file in it")
    _refuse_unwritable(path.parent)
    return path


def file_ending_in(*endings: str) -> Callable[[str], Path]:
    """A file that can be written, of the kind that is written."""

    def read(text: str) -> Path:
        path = file_to_write(text)
        if path.suffix.lower() not in endings:
            raise argparse.ArgumentTypeError(f"should end in {' or '.join(endings)}, which is written, got {text!r}")
        return path

    return read


def house_folder(text: str) -> Path:
    """A folder that `embodied house` wrote."""
    path = any_path(text)
    if path.is_file():
        raise argparse.ArgumentTypeError(f"{text} is a file; name the folder that it is in, {path.parent}")
    return path


def _refuse_unwritable(wanted: Path) -> None:
    there = next(p for p in (wanted, *wanted.absolute().parents) if p.exists())
    if not there.is_dir():
        raise argparse.ArgumentTypeError(f"{there} is a file, {wanted} needs a folder there; choose another name")
    if not os.access(there, os.W_OK | os.X_OK):
        raise argparse.ArgumentTypeError(f"{there} may not be written by you; choose another place than {wanted}")


PICTURE_HELP = {
    "none": "nothing is drawn",
    "unlit": "no light is computed",
    "fast": "global illumination in about a minute",
    "normal": "finer global illumination",
    "fast-matte": "without reflections, two to three times faster to draw",
    "normal-matte": "likewise",
    "traced": "rays are traced into the baked light",
    "reference": "path tracing, slow",
}


@dataclasses.dataclass(frozen=True, eq=False)  # annotations are hashed
class Option:
    """How a field is given on the command line, as metadata of its annotation."""

    read: Callable[[str], Any] | None = None
    """Turns a word into a value; None: the annotated type does."""
    metavar: str | tuple[str, ...] | None = None
    words: Sequence[str] = ()
    """The words that may be given."""
    helps: Mapping[str, str] = dataclasses.field(default_factory=dict)
    """The meaning of these words."""
    name: str = ""
    """The option's name where it is not the field's; without dashes for an argument by position."""
    repeated: bool = False
    """True if it is given once for each item, instead of once with all items."""


@dataclasses.dataclass(frozen=True, eq=False)  # annotations are hashed
class Settings:
    """A field that is a record of settings; an option that is not given leaves its field as it is in `base`."""

    title: str
    """Of the group of their options."""
    base: Any
    """The settings to start from; a mapping: those of the name that --scale gives."""
    skip: Sequence[str] = ()
    """Fields without an option."""
    words: Mapping[str, Sequence[str]] = dataclasses.field(default_factory=dict)
    """The words that may be given for a field, listed in its help; the settings check themselves."""

    @property
    def of_scale(self) -> bool:
        return isinstance(self.base, Mapping)


Count = Annotated[int, Option(whole(), "N")]
CubeFace = Annotated[int, Option(face, "PIXELS")]
InputPath = Annotated[Path, Option(any_path, "FILE")]
InputFolder = Annotated[Path, Option(any_path, "DIR")]
AnyFolder = Annotated[Path, Option(any_folder, "DIR")]
HouseFolder = Annotated[Path, Option(house_folder, "DIR")]
OutputFolder = Annotated[Path, Option(folder_to_write, "DIR")]
OutputPng = Annotated[Path, Option(file_ending_in(".png"), "PNG")]
OutputRrd = Annotated[Path, Option(file_ending_in(".rrd"), "FILE")]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Cached:
    cache: AnyFolder = dataclasses.field(default_factory=default_cache)
    """Cache folder; it is safe to delete."""


def drawn_as(kinds: Sequence[str]) -> Option:
    """--pictures, in the words of embodied.render.pictures."""
    return Option(words=kinds, helps=PICTURE_HELP)


def add_commands(parser: argparse.ArgumentParser, commands: Mapping[str, Any], metavar: str, dest: str) -> None:
    """Subcommands: name to (record of its options, whose docstring describes it; what it does, which returns the exit
    status or None), or to (help, subcommands) where there are further ones."""
    subs = parser.add_subparsers(dest=dest, metavar=metavar, required=True)
    for name, (about, what) in commands.items():
        text = about if isinstance(about, str) else inspect.cleandoc(about.__doc__ or "")
        summary = text.split("\n\n")[0].rstrip(".").replace("%", "%%")
        summary = _lower(summary)
        formatter = argparse.RawDescriptionHelpFormatter
        sub = subs.add_parser(name, help=summary, description=text, formatter_class=formatter)
        if isinstance(about, str):
            add_commands(sub, what, name.upper(), f"{dest}_of_{name}")
        else:
            add_command(sub, about, what)


def add_command(parser: argparse.ArgumentParser, options: type, run: Callable[[Any], int | None]) -> None:
    """The options of one command; `args.run(args)` reads and runs it."""
    add_options(parser, options)
    parser.set_defaults(run=lambda args: run(read_options(args, options)))


def add_options(parser: argparse._ActionsContainer, kind: type) -> None:
    """One option per field of the record `kind`: what is required first, then its own fields before those of the
    records it extends. A record with a docstring that is extended is a group of that title."""
    hints, helps = typing.get_type_hints(kind, include_extras=True), field_docs(kind)
    fields = {f.name: f for f in dataclasses.fields(kind)}
    owners: dict[str, type] = {}
    for base in kind.__mro__:
        owners |= dict.fromkeys(vars(base).get("__annotations__", ()), base)  # where it was declared first
    groups: dict[str, argparse._ActionsContainer] = {"": parser}
    for name in sorted(owners, key=lambda n: not _required(fields[n]) or _settings(hints[n]) is not None):
        owner, settings = owners[name], _settings(hints[name])
        about = "" if owner is kind else inspect.cleandoc(owner.__doc__ or "")
        title = settings.title if settings else "" if about.startswith(owner.__name__) else _lower(about.rstrip("."))
        group = groups[title] if title in groups else groups.setdefault(title, parser.add_argument_group(title))
        if settings:
            _add_settings(group, typing.get_args(hints[name])[0], settings)
        else:
            _add(group, fields[name], hints[name], helps.get(name, ""))


def read_options(args: argparse.Namespace, kind: type[C]) -> C:
    """The record `kind` of what was given.

    Raises:
      ValueError: a value that settings refuse.
    """
    values: dict[str, Any] = {}
    for name, hint in typing.get_type_hints(kind, include_extras=True).items():
        if settings := _settings(hint):
            values[name] = _changed(args, settings.base[args.scale] if settings.of_scale else settings.base)
        else:
            given = getattr(args, name)
            values[name] = tuple(given) if isinstance(given, list) else given
    return kind(**values)


def _changed(args: argparse.Namespace, config: Any) -> Any:
    given = {f.name: getattr(args, f.name, None) for f in dataclasses.fields(config)}
    values = {k: tuple(v) if isinstance(v, list) else v for k, v in given.items() if v is not None}
    return dataclasses.replace(config, **values)


def _add(parser: argparse._ActionsContainer, field: dataclasses.Field, hint: Any, text: str) -> None:
    """One option of a record of options."""
    kind, many, how = _scalar(hint)
    required = _required(field)
    default = None if required else field.default
    if field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    text = "; ".join([text.rstrip("."), *(f"{w}: {how.helps[w]}" for w in how.words if w in how.helps)])
    if "(default" not in text:
        text = _with_default(text, {"": default})
    arguments: dict[str, Any] = {"help": text.replace("%", "%%")}
    name = how.name or "--" + field.name.replace("_", "-")
    if kind is bool:
        parser.add_argument(name, dest=field.name, action="store_true", **arguments)
        return
    arguments |= {"type": how.read or kind, "choices": tuple(how.words) or None}
    arguments["default"] = str(default) if isinstance(default, Path) else default  # argparse reads strings as if given
    arguments["metavar"] = how.metavar or (None if how.words else METAVARS.get(kind))
    if how.repeated:
        arguments |= {"action": "append", "default": []}
    elif many:
        arguments["nargs"] = many
    if name.startswith("-"):
        parser.add_argument(name, dest=field.name, required=required, **arguments)
    else:
        arguments |= {} if required else {"nargs": "*" if many else "?"}
        parser.add_argument(field.name, **arguments)


def _add_settings(parser: argparse._ActionsContainer, kind: type, settings: Settings) -> None:
    """One option per field of the settings `kind`."""
    hints, helps = typing.get_type_hints(kind, include_extras=True), field_docs(kind)
    scales = settings.base if settings.of_scale else {"": settings.base}
    for f in dataclasses.fields(kind):
        if f.name in settings.skip:
            continue
        text = _with_default(
            helps.get(f.name, "").rstrip("."), {name: getattr(c, f.name) for name, c in sorted(scales.items())}
        )
        item, many, how = _scalar(hints[f.name])
        listed = settings.words.get(f.name, how.words)
        arguments: dict[str, Any] = {"default": None, "help": text.replace("%", "%%")}
        if item is bool:
            arguments["action"] = argparse.BooleanOptionalAction
        else:
            arguments |= {"type": item, "nargs": many}
            arguments["metavar"] = "{" + ",".join(listed) + "}" if listed else METAVARS.get(item)
        parser.add_argument("--" + f.name.replace("_", "-"), **arguments)


def _with_default(text: str, defaults: Mapping[str, Any]) -> str:
    """A help text with the default, or with that of every scale where they differ."""
    shown = {k: " ".join(map(str, v)) if isinstance(v, tuple) else str(v) for k, v in defaults.items()}
    different = len(set(shown.values())) > 1
    default = ", ".join(f"{name}: {value}" for name, value in shown.items()) if different else [*shown.values()][0]
    return text if default in ("", "None", "False") else f"{text} (default: {default})"


def _settings(hint: Any) -> Settings | None:
    return next((m for m in getattr(hint, "__metadata__", ()) if isinstance(m, Settings)), None)


def _lower(text: str) -> str:
    """With a small first letter, unless the first word is an abbreviation."""
    return text[0].lower() + text[1:] if text[1:2].islower() or text[1:2] == " " else text


def _required(field: dataclasses.Field) -> bool:
    return field.default is field.default_factory is dataclasses.MISSING


def _scalar(hint: Any) -> tuple[type, str | int | None, Option]:
    """The type of one value, how many (None: one; a number, or '+'), and how it is given."""
    how: Option | None = None
    many: str | int | None = None
    while typing.get_args(hint):
        parts = typing.get_args(hint)
        if typing.get_origin(hint) is Annotated:
            how = how or next((m for m in parts[1:] if isinstance(m, Option)), None)
            hint = parts[0]
        elif typing.get_origin(hint) in (types.UnionType, typing.Union):
            hint = next(a for a in parts if a is not type(None))
        else:
            hint, many = parts[0], "+" if Ellipsis in parts else len(parts)
    return hint, many, how or Option()


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
        match field, doc:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=text)):
                docs[name] = " ".join(str(text).split())
    return docs
