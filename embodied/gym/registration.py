"""Makes the environments known to gymnasium.make, without importing Gymnasium for those who do not use it."""

import importlib.util
import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from embodied.kinds.plugins import for_each_kind, titled_files


def register_with_gymnasium() -> None:
    """Register the environments: now if Gymnasium is imported already, else as soon as it is."""
    if "gymnasium" in sys.modules:
        register(sys.modules["gymnasium"])
    else:
        sys.meta_path.insert(0, WhenImported())


def register(gymnasium: ModuleType) -> None:
    """Environments by the name of their maker, which is imported when the first is made: kinds of tasks, continuous
    tasks, and the files of this folder whose title is an id."""
    for_each_kind(lambda name, title: register_environment(gymnasium, title, name))
    for name, title in titled_files("gym/continuous_tasks").items():
        register_environment(gymnasium, title, name, "embodied.gym.continuous", "embodied.gym.continuous")
    for name, title in titled_files("gym").items():
        if title.startswith("embodied/") and title not in gymnasium.registry:
            gymnasium.register(title, entry_point=f"embodied.gym.{name}:make")


def register_environment(
    gymnasium: ModuleType, title: str, kind: str, one: str = "embodied.gym.env", many: str = "embodied.gym.vector_env"
) -> None:
    """Register embodied/TITLE-v0, unless there is one: `one` has its `make`, `many` its `make_vec`."""
    if f"embodied/{title}-v0" not in gymnasium.registry:
        entries = {"entry_point": f"{one}:make", "vector_entry_point": f"{many}:make_vec"}
        gymnasium.register(f"embodied/{title}-v0", **entries, kwargs={"kind": kind})


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
