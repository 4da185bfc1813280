"""embodied: generated, photo-realistic houses in MuJoCo, and agents that ask people for help.

    import embodied

    house = embodied.generate_house(7)                        # the same on every machine
    with embodied.open_world(house, pictures="fast") as world: # lit once, then drawn in milliseconds
        view = world.camera((2.0, 3.0, 1.5), yaw=0.5)         # rgb, depth and ids from anywhere
        panorama = world.panorama(0)                          # or from a viewpoint of its navigation graph
        print({world.classes[i] for i in set(view.ids.flat)})

Houses
    generate_house, HouseConfig    a furnished house from a seed
    load_plan, house_of_plan       a furnished house on a floor plan of your own
    House, load_house              a house as data: rooms, openings, furniture, lamps; JSON
    Catalogue, load_catalogue      the furniture and materials, your own models included
Pictures
    open_world, open_folder, World a house with its navigation graph, light, cameras and panoramas
    Unlit, Baked, Traced, ViewSettings  how houses are drawn; how an agent's views are framed
    scene_spec, place              a house as an MjSpec; a robot of any MJCF on its free floor
    NavGraph, Panorama             viewpoints and ways between them; what is seen around one
Tasks
    make_env                       a Gymnasium environment, as gymnasium.make("embodied/HANNA-v0")
    Task, Observation, Move, Ask, Stop, Intention, Situation, Reply, Subtask, Episode
Data sets
    DatasetConfig, build_dataset, draw_panoramas, Dataset
Evaluation
    play, evaluate, baseline, markdown
Other
    default_cache                  where expensive products are kept
    stream                         named random generators of one seed

Each name is imported when it is first used; `help(embodied.open_world)` shows an example. Environments:
embodied/Find-v0, VLN-v0, VNLA-v0, HANNA-v0, HARI-v0, Ask-v0, Doors-v0, VLNCE-v0, ObjectNav-v0 and Drive-v0, registered
by `import embodied`.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from embodied.gym.registration import register_with_gymnasium

if TYPE_CHECKING:
    from embodied.assets.cache import default_cache
    from embodied.assets.catalogue import Catalogue, load_catalogue
    from embodied.datasets.build import DatasetConfig, build_dataset, draw_panoramas
    from embodied.datasets.store import Dataset
    from embodied.evaluation.evaluate import agent as baseline
    from embodied.evaluation.evaluate import evaluate, play
    from embodied.evaluation.tables import markdown
    from embodied.generate import HouseConfig, generate_house
    from embodied.generate.plan_file import house_of_plan, load_plan
    from embodied.gym.env import make as make_env
    from embodied.gym.sensors import ViewSettings
    from embodied.house.house import House
    from embodied.house.validation import load_house
    from embodied.interface import Ask, Episode, Intention, Move, Observation, Reply, Situation, Stop, Subtask, Task
    from embodied.navigation.graph import NavGraph, build_graph
    from embodied.render.classic import Renderer
    from embodied.render.panorama import Panorama
    from embodied.render.pictures import Baked, Traced, Unlit
    from embodied.scene.robots import place
    from embodied.seeds import stream
    from embodied.world import World, open_folder, open_world, scene_spec

__version__: str
"""The version of the installed distribution."""

_HOMES = {
    "embodied.assets.cache": ("default_cache",),
    "embodied.assets.catalogue": ("Catalogue", "load_catalogue"),
    "embodied.datasets.build": ("DatasetConfig", "build_dataset", "draw_panoramas"),
    "embodied.datasets.store": ("Dataset",),
    "embodied.evaluation.evaluate": ("evaluate", "play"),
    "embodied.evaluation.tables": ("markdown",),
    "embodied.generate": ("HouseConfig", "generate_house"),
    "embodied.generate.plan_file": ("house_of_plan", "load_plan"),
    "embodied.gym.sensors": ("ViewSettings",),
    "embodied.house.house": ("House",),
    "embodied.house.validation": ("load_house",),
    "embodied.interface": (
        *("Ask", "Episode", "Intention", "Move", "Observation"),
        *("Reply", "Situation", "Stop", "Subtask", "Task"),
    ),
    "embodied.navigation.graph": ("NavGraph", "build_graph"),
    "embodied.render.classic": ("Renderer",),
    "embodied.render.panorama": ("Panorama",),
    "embodied.render.pictures": ("Baked", "Traced", "Unlit"),
    "embodied.scene.robots": ("place",),
    "embodied.seeds": ("stream",),
    "embodied.world": ("World", "open_folder", "open_world", "scene_spec"),
}
"""The public names of each module."""
_FOUND = {name: (module, name) for module, names in _HOMES.items() for name in names} | {
    "baseline": ("embodied.evaluation.evaluate", "agent"),
    "make_env": ("embodied.gym.env", "make"),
}

__all__ = [
    "__version__",
    "Ask",
    "Baked",
    "Catalogue",
    "Dataset",
    "DatasetConfig",
    "Episode",
    "House",
    "HouseConfig",
    "Intention",
    "Move",
    "NavGraph",
    "Observation",
    "Panorama",
    "Renderer",
    "Reply",
    "Situation",
    "Stop",
    "Subtask",
    "Task",
    "Traced",
    "Unlit",
    "ViewSettings",
    "World",
    "baseline",
    "build_dataset",
    "build_graph",
    "default_cache",
    "draw_panoramas",
    "evaluate",
    "generate_house",
    "house_of_plan",
    "load_catalogue",
    "load_house",
    "load_plan",
    "make_env",
    "markdown",
    "open_folder",
    "open_world",
    "place",
    "play",
    "scene_spec",
    "stream",
]


def __getattr__(name: str) -> object:
    """A public name, imported on first use (PEP 562)."""
    if name == "__version__":
        from importlib.metadata import version

        from embodied.software import DISTRIBUTION

        value: object = version(DISTRIBUTION)
    elif name in _FOUND:
        module, attribute = _FOUND[name]
        value = getattr(importlib.import_module(module), attribute)
    else:
        raise AttributeError(f"module 'embodied' has no attribute {name!r}; it offers {__all__}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


register_with_gymnasium()
