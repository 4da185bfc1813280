"""Results that several lightings of one house share, computed for the first of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")
LightingCache: TypeAlias = dict[Hashable, Any]
"""Results by name; owned by those who light a house several times."""


def get_or_compute(memory: LightingCache | None, key: Hashable, make: Callable[[], T]) -> T:
    """Result of `make` when `key` was first asked for; without a cache it is made each time."""
    if memory is None:
        return make()
    if key not in memory:
        memory[key] = make()
    known: T = memory[key]
    return known
