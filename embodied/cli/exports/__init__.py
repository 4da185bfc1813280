"""Formats that `embodied export` writes; each file of this folder registers some."""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from embodied.cli.common import Printed
from embodied.options import InputFolder, OutputFolder


@dataclass(frozen=True, kw_only=True)
class OfData(Printed):
    data: InputFolder
    """The data set, a folder that `embodied dataset` built."""
    out: OutputFolder
    """Folder to write, made if missing."""


_REGISTERED: dict[str, tuple[type, Callable[[Any], None]]] = {}


def register_export(name: str, options: type, run: Callable[[Any], None]) -> None:
    """Make a format known as `embodied export NAME`; the name must be new.

    Args:
      options: a record of options (embodied.options), whose docstring is the help.
      run: writes what the options say, and shows it.
    """
    assert name not in _REGISTERED, f"there are two exports {name!r}"
    _REGISTERED[name] = options, run


def registered_exports() -> dict[str, tuple[type, Callable[[Any], None]]]:
    """Options and writer of all formats by name, in the order of their files."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return dict(_REGISTERED)
