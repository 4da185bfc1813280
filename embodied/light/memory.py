"""What several lightings of one house have in common, computed for the first of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

T = TypeVar("T")


class Memory:
    """Keeps results by name; owned by those who light a house several times."""

    def __init__(self) -> None:
        self._known: dict[Hashable, Any] = {}

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """What `make` returned when `key` was first asked for."""
        if key not in self._known:
            self._known[key] = make()
        known: T = self._known[key]
        return known

    def known(self, key: Hashable) -> Any:
        """What is kept under `key`; None if nothing is."""
        return self._known.get(key)


def once(memory: Memory | None, key: Hashable, make: Callable[[], T]) -> T:
    """`make`, remembered where there is a memory."""
    return make() if memory is None else memory.once(key, make)
