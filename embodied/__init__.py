"""embodied: generated houses in MuJoCo, panoramas, and agents that ask people for help.

    import embodied

    catalogue = embodied.load_catalogue()
    house = embodied.generate_house(7, embodied.HouseConfig(area=(38.0, 46.0)), catalogue)
    with embodied.open_world(house, catalogue, embodied.default_cache()) as world:
        panorama = world.panorama(0)
        left = panorama.view_rgb(yaw=1.57, pitch=0.0)

Places: generate_house, House, HouseConfig, load_catalogue, default_cache, build_graph, NavGraph.
Pictures: open_world, World, Renderer, Panorama. Randomness: stream.
Tasks and people are in embodied.interface; read it first when you write an agent.

Each name is imported when it is first used, so that `import embodied` costs nothing; and off-screen
OpenGL is chosen before mujoco is imported, whichever name comes first. The Gymnasium environments
embodied/Find-v0, VLN-v0, VNLA-v0, HANNA-v0, HARI-v0 and Drive-v0 are registered by `import embodied`; Gymnasium
itself is not imported for that (embodied.gym.registration).
"""

from __future__ import annotations

import importlib
import importlib.metadata
from typing import TYPE_CHECKING

from embodied.distribution import DISTRIBUTION
from embodied.gym.registration import register_with_gymnasium

if TYPE_CHECKING:
    from assets.cache import default_cache
    from assets.catalogue import load_catalogue
    from embodied.generate import HouseConfig, generate_house
    from embodied.house.house import House
    from embodied.navigation.graph import NavGraph, build_graph
    from embodied.render.classic import Renderer
    from embodied.render.panorama import Panorama
    from embodied.seeds import stream
    from embodied.world import World, open_world

__all__ = [
    "House",
    "HouseConfig",
    "NavGraph",
    "Panorama",
    "Renderer",
    "World",
    "build_graph",
    "default_cache",
    "generate_house",
    "load_catalogue",
    "open_world",
    "stream",
]

HOMES = {
    "House": "embodied.house.house",
    "HouseConfig": "embodied.generate",
    "NavGraph": "embodied.navigation.graph",
    "Panorama": "embodied.render.panorama",
    "Renderer": "embodied.render.classic",
    "World": "embodied.world",
    "build_graph": "embodied.navigation.graph",
    "default_cache": "assets.cache",
    "generate_house": "embodied.generate",
    "load_catalogue": "assets.catalogue",
    "open_world": "embodied.world",
    "stream": "embodied.seeds",
}
"""The module behind each public name."""


def __getattr__(name: str) -> object:
    """A public name, imported on first use (PEP 562)."""
    if name == "__version__":
        return importlib.metadata.version(DISTRIBUTION)
    if name not in HOMES:
        raise AttributeError(f"module 'embodied' has no attribute {name!r}; it offers {__all__}")
    value = globals()[name] = getattr(importlib.import_module(HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])


register_with_gymnasium()
