"""Command-line options made from a configuration dataclass, so that each is defined once."""

from __future__ import annotations

import argparse
import ast
import dataclasses
import inspect
import itertools
import textwrap
import types
import typing
from collections.abc import Mapping, Sequence

METAVARS = {int: "N", float: "X", str: "WORD"}


def add_options(
    parser: argparse.ArgumentParser,
    kind: type,
    skip: tuple[str, ...] = (),
    *,
    words: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """One option per field of the frozen dataclass `kind`; the sentence below a field is its help.

    Args:
      words: what may be given for a field, to be listed in the help.
    """
    helps = field_docs(kind)
    hints = typing.get_type_hints(kind)
    for f in dataclasses.fields(kind):
        if f.name in skip:
            continue
        flag, text = "--" + f.name.replace("_", "-"), helps.get(f.name, "").replace("%", "%%")
        default = None if f.default is dataclasses.MISSING else f.default
        text = f"{text} (default: {default})" if default is not None else text
        item, many = _scalar(hints[f.name])
        name = "{" + ",".join((words or {})[f.name]) + "}" if f.name in (words or {}) else METAVARS.get(item)
        if item is bool:
            parser.add_argument(flag, action=argparse.BooleanOptionalAction, default=default, help=text)
        elif many:
            parser.add_argument(flag, type=item, nargs=many, default=default, help=text, metavar=name)
        else:
            parser.add_argument(flag, type=item, default=default, help=text, metavar=name)


def read_options(args: argparse.Namespace, kind: type, skip: tuple[str, ...] = ()):
    """The `kind` that the parsed options describe."""
    values = {}
    for f in dataclasses.fields(kind):
        if f.name not in skip:
            value = getattr(args, f.name)
            values[f.name] = tuple(value) if isinstance(value, list) else value
    return kind(**values)


def _scalar(hint: typing.Any) -> tuple[type, str | int | None]:
    """The type of one value and how many: None (one), a number, or '+'."""
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        hint = next(a for a in typing.get_args(hint) if a is not type(None))
    if typing.get_origin(hint) is tuple:
        items = typing.get_args(hint)
        return items[0], "+" if Ellipsis in items else len(items)
    return hint, None


def field_docs(kind: type) -> dict[str, str]:
    """Field name to the docstring that stands below it in the source, on one line."""
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0].body
    docs = {}
    for field, doc in itertools.pairwise(body):
        if isinstance(field, ast.AnnAssign) and isinstance(doc, ast.Expr) and isinstance(doc.value, ast.Constant):
            docs[field.target.id] = " ".join(str(doc.value.value).split())
    return docs
