"""What several lightings of one house have in common, computed for the first of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable


class Memory:
    """Keeps results by name; owned by those who light a house several times."""

    def __init__(self) -> None:
        self._known: dict[Hashable, object] = {}

    def once(self, key: Hashable, make: Callable[[], object]) -> object:
        """What `make` returned when `key` was first asked for."""
        if key not in self._known:
            self._known[key] = make()
        return self._known[key]


def once(memory: Memory | None, key: Hashable, make: Callable[[], object]) -> object:
    """`make`, remembered where there is a memory."""
    return make() if memory is None else memory.once(key, make)
