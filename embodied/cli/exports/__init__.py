"""Formats that `embodied export` writes; each file of this folder registers one, or some that share their options."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from embodied.cli.common import Printed
from embodied.options import InputFolder, OutputFolder


@dataclass(frozen=True, kw_only=True)
class OfData(Printed):
    data: InputFolder
    """The data set, a folder that `embodied dataset` built."""
    out: OutputFolder
    """Folder to write, made if missing."""


@dataclass(frozen=True)
class Export:
    """A format that is written for other programs."""

    name: str
    """As in `embodied export NAME`."""
    options: type
    """A record of options (embodied.options), whose docstring is the help."""
    run: Callable[[Any], None]
    """Writes what the options say, and shows it."""


_REGISTERED: dict[str, Export] = {}


def register_export(export: Export) -> None:
    """Make a format known; its name must be new."""
    assert export.name not in _REGISTERED, f"there are two exports {export.name!r}"
    _REGISTERED[export.name] = export


def registered_exports() -> Mapping[str, Export]:
    """All formats by name, in the order of their files."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    return MappingProxyType(_REGISTERED)
