"""What several lightings of one house have in common, computed for the first of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeAlias, TypeVar

T = TypeVar("T")
Memory: TypeAlias = dict[Hashable, Any]
"""Results by name; owned by those who light a house several times."""


def once(memory: Memory | None, key: Hashable, make: Callable[[], T]) -> T:
    """What `make` returned when `key` was first asked for; `make` itself where there is no memory."""
    if memory is None:
        return make()
    if key not in memory:
        memory[key] = make()
    known: T = memory[key]
    return known
