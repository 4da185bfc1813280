"""Names of what need not be part of the program: kinds of tasks by file, and a user's own things by 'module:NAME'."""

from __future__ import annotations

import functools
import importlib
import re
import sys
from collections.abc import Callable, Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

if TYPE_CHECKING:
    from embodied.interface import Assistant

T = TypeVar("T", bound=Any)


@functools.cache
def titled_files(folder: str) -> dict[str, str]:
    """Names and titles of the modules in a folder of this package, without importing them.

    A file begins with its title and a colon: embodied/kinds/shipped/hanna.py with 'HANNA'.
    """
    files = sorted((Path(__file__).parents[1] / folder).glob("[!_]*.py"))
    return {f.stem: f.read_text(encoding="utf-8").partition(":")[0].strip('"') for f in files}


shipped_kinds = functools.partial(titled_files, "kinds/shipped")
"""Names and titles of the kinds of tasks that come with the program."""


_OWN_KINDS: dict[str, str] = {}
_LISTENERS: list[Callable[[str, str], None]] = []


def announce_kind(name: str, title: str) -> None:
    """Tell who waits for kinds of tasks (`for_each_kind`) that there is one of a user's own.

    Raises:
      ValueError: its name does not say where it is found, or its title is another kind's.
    """
    if ":" not in name and name not in shipped_kinds():
        raise ValueError(f"a kind of your own is named 'module:NAME', so that commands find it; got {name!r}")
    if others := [n for n, t in {**shipped_kinds(), **_OWN_KINDS}.items() if t == title and n != name]:
        raise ValueError(f"the title {title!r} is that of the kind {others[0]!r}; choose another")
    if name not in shipped_kinds() and name not in _OWN_KINDS:
        _OWN_KINDS[name] = title
        for listener in _LISTENERS:
            listener(name, title)


def for_each_kind(listener: Callable[[str, str], None]) -> None:
    """Call `listener` with name and title of every kind of task: at once with those that are known, later with new
    ones."""
    for name, title in {**shipped_kinds(), **_OWN_KINDS}.items():
        listener(name, title)
    _LISTENERS.append(listener)


def named_object(name: str) -> Any:
    """The object that 'module:NAME' names; the module may lie in the current folder.

    Raises:
      ValueError: no such module or name; an error inside the module is told as it is.
    """
    module, colon, attribute = name.partition(":")
    if "" not in sys.path:
        sys.path.insert(0, "")  # console commands have their own folder there
    try:
        if not (module and colon and attribute):
            raise ValueError("no colon between two words")
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, TypeError, ValueError) as e:
        raise ValueError(f"expected 'module:NAME' with an importable module, got {name!r} ({e})") from e


class Registry(Generic[T]):
    """Records of a type by their names; those that come with the program are added by the modules of a package."""

    def __init__(self, kind: type[T], package: str = "", shipped: Callable[[], Collection[str]] = tuple) -> None:
        """`shipped`: names of the modules of `package`, which are those of their records."""
        self.known, self._kind, self._package, self._shipped = dict[str, T](), kind, package, shipped

    def add(self, record: T) -> T:
        """Make a record known by its name; returns it. Call it where the record is defined."""
        self.known[record.name] = record
        return record

    def named(self, name: str) -> T:
        """The record of a name: one that was added, a shipped one, or 'module:NAME', whose module is imported.

        Raises:
          ValueError: unknown, or what 'module:NAME' names is no such record of that name.
        """
        shipped = self._shipped()
        if name not in self.known and name in shipped:
            importlib.import_module(f"{self._package}.{name}")
        elif name not in self.known and ":" in name:
            made = named_object(name)
            if not isinstance(made, self._kind) or getattr(made, "name", None) != name:
                raise ValueError(f"{name!r} should be a {self._kind.__name__} with name={name!r}, got {made!r:.60}")
            self.known[name] = made
        if name not in self.known:
            what, known = re.sub(r"\B([A-Z])", r" \1", self._kind.__name__).lower(), sorted({*self.known, *shipped})
            raise ValueError(f"unknown {what} {name!r}; use one of {known}, or 'module:NAME' of your own")
        return self.known[name]


def made_by_name(name: str) -> Any:
    """The product of the class or function that 'module:NAME' names, without arguments.

    Raises:
      ValueError: no such module or name, or it cannot be made.
    """
    maker = named_object(name)
    try:
        return maker()
    except (AttributeError, TypeError, ValueError) as e:
        raise ValueError(f"{name!r} should make something without arguments ({e})") from e


def assistant_of(named: Assistant | str | None) -> Assistant | None:
    """An assistant as it is, or made by what 'module:Class' names, without arguments.

    Raises:
      ValueError: no such class, or what it makes is no Assistant.
    """
    if not isinstance(named, str):
        return named
    made = made_by_name(named)
    if not (hasattr(made, "intentions") and hasattr(made, "answer")):
        raise ValueError(f"{named!r} is no Assistant; it needs intentions() and answer() (embodied/interface.py)")
    return made
