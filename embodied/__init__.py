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
    Day, day_of                    who is where in a house at which hour, and the walks between
Tasks
    make_env                       a Gymnasium environment, as gymnasium.make("embodied/HANNA-v0")
    dm_env                         Robot-v0 or another one as a dm_env.Environment
    Task, Observation, Move, Ask, Stop, Intention, Situation, Reply, Subtask, Episode
Data sets
    DatasetConfig, build_dataset, draw_panoramas, Dataset
Evaluation
    play, evaluate, baseline, markdown
Other
    default_cache                  where expensive products are kept
    stream                         named random generators of one seed

Each name is imported when it is first used; `help(embodied.open_world)` shows an example. Environments:
embodied/Find-v0, VLN-v0, VNLA-v0, HANNA-v0, HARI-v0, Ask-v0, Doors-v0, Social-v0, VLNCE-v0, ObjectNav-v0, SocialNav-v0,
FollowNav-v0, Drive-v0 and Robot-v0, registered by `import embodied`.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path
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
    from embodied.gym.dm import make as dm_env
    from embodied.gym.env import make as make_env
    from embodied.gym.sensors import ViewSettings
    from embodied.house.house import House
    from embodied.house.validation import load_house
    from embodied.interface import Ask, Episode, Intention, Move, Observation, Reply, Situation, Stop, Subtask, Task
    from embodied.navigation.graph import NavGraph, build_graph
    from embodied.people.day import Day, day_of
    from embodied.render.classic import Renderer
    from embodied.render.panorama import Panorama
    from embodied.render.pictures import Baked, Traced, Unlit
    from embodied.scene.robots import place
    from embodied.seeds import stream
    from embodied.world import World, open_folder, open_world, scene_spec

__version__: str
"""The version of the installed distribution."""

_FOUND = {
    alias.asname or alias.name: (node.module or "", alias.name)
    for block in ast.parse(Path(__file__).read_text(encoding="utf-8")).body
    if isinstance(block, ast.If)
    for node in block.body
    if isinstance(node, ast.ImportFrom)
    for alias in node.names
}
"""Public name to its module and its name there: the imports above, each of which is done on first use."""
__all__ = list(_FOUND)
__all__ += ["__version__"]


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
