"""Arguments of the C++ module (pybind11): the same values are accepted, the same ones raise TypeError.

Arguments go by position. A whole number is anything but a float that says what integer it is; a number anything that
says what float it is; lists are lists, tuples, ranges and arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

LARGEST = 2**32
"""Indices are 32 bits there."""


def integer(value: Any, what: str, least: int = -(2**31), most: int = 2**31) -> int:
    """A whole number from `least` to below `most`."""
    if type(value) is not int:
        if isinstance(value, (float, str)) or not hasattr(value, "__int__"):
            raise _wrong(what, "a whole number", value)
        value = int(value)
    if not least <= value < most:
        raise _wrong(what, f"a whole number from {least} to {most - 1}", value)
    return value


def index(value: Any, what: str) -> int:
    """A whole number that is not negative."""
    return integer(value, what, 0, LARGEST)


def number(value: Any, what: str) -> float:
    if not (hasattr(value, "__float__") or hasattr(value, "__index__")):
        raise _wrong(what, "a number", value)
    return float(value)


def flag(value: Any, what: str) -> bool:
    if value is not None and not hasattr(value, "__bool__"):
        raise _wrong(what, "True or False", value)
    return bool(value)


def text(value: Any, what: str) -> str:
    if not isinstance(value, (str, bytes)):
        raise _wrong(what, "a str", value)
    return value if isinstance(value, str) else value.decode()


def indices(values: Any, what: str) -> list[int]:
    """A list of whole numbers that are not negative."""
    return _each(values, what, "whole numbers", (int,), index)


def numbers(values: Any, what: str) -> list[float]:
    """A list of numbers; integers stay integers."""
    return _each(values, what, "numbers", (float, int), number)


def texts(values: Any, what: str) -> list[str]:
    return _each(values, what, "str", (str,), text)


def _each(values: Any, what: str, of: str, kinds: tuple[type, ...], convert: Callable[[Any, str], Any]) -> list[Any]:
    if isinstance(values, (str, bytes)) or not isinstance(values, (Sequence, np.ndarray)):
        raise TypeError(
            f"MatterSim: {what} should be a list of {of}, one for each agent of the batch, got {values!r:.80}; this "
            "dialect takes lists, 'v0.1' takes single values"
        )
    items = list(values)
    usual = set(map(type, items)) <= set(kinds)
    if usual and (convert is not index or not items or 0 <= min(items) <= max(items) < LARGEST):
        return items
    return [convert(v, what) for v in items]


def _wrong(what: str, wanted: str, value: object) -> TypeError:
    return TypeError(f"MatterSim: {what} should be {wanted}, got {value!r:.80}")
