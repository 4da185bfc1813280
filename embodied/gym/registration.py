"""Makes the environments known to gymnasium.make, without importing Gymnasium for those who do not use it."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

IDS = {"find": "Find", "vln": "VLN", "vnla": "VNLA", "hanna": "HANNA", "hari": "HARI", "ask": "Ask"}
"""Kind of task to the name of its environment: embodied/HANNA-v0."""

CONTINUOUS = {"vlnce": "VLNCE", "objectnav": "ObjectNav"}
"""The same, of continuous navigation (embodied.gym.continuous)."""


def register_with_gymnasium() -> None:
    """Register the environments: now if Gymnasium is imported already, else as soon as it is."""
    if "gymnasium" in sys.modules:
        register(sys.modules["gymnasium"])
    else:
        sys.meta_path.insert(0, WhenImported())


def register(gymnasium: ModuleType) -> None:
    """Environments by the name of their maker, which is imported when the first is made."""
    for kind, name in (IDS | CONTINUOUS).items():
        one, many = ("env", "in_step") if kind in IDS else ("continuous", "continuous")
        makers = {"entry_point": f"embodied.gym.{one}:make", "vector_entry_point": f"embodied.gym.{many}:make_vec"}
        if f"embodied/{name}-v0" not in gymnasium.registry:
            gymnasium.register(f"embodied/{name}-v0", **makers, kwargs={"kind": kind})
    if "embodied/Drive-v0" not in gymnasium.registry:
        gymnasium.register("embodied/Drive-v0", entry_point="embodied.gym.drive:make")


class WhenImported(MetaPathFinder):
    """Waits for the import of Gymnasium, lets it happen as always, and registers at its end."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name != "gymnasium":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def execute_and_register(module: ModuleType) -> None:
                execute(module)
                register(module)

            spec.loader.exec_module = execute_and_register  # type: ignore[method-assign]  # on this one loader
        return spec
