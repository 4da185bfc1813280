"""ObjectNav: go near an object of a class, as Habitat's (Anderson et al. 2018)."""

from embodied.datasets.habitat import object_episodes, read_objectnav
from embodied.envs.continuous import Body, CameraConfig, ContinuousEpisode
from embodied.gym.continuous import ContinuousTask, EpisodeSource, register_continuous

OBJECTS = 100
"""Episodes in each house where no file says otherwise."""


def object_source(source: EpisodeSource) -> list[ContinuousEpisode]:
    """OBJECTS episodes in each house."""
    seed, navmeshes = source.seed, source.navmeshes
    return [e for w in source.worlds.values() for e in object_episodes(w, OBJECTS, seed=seed, navmeshes=navmeshes)]


BODY, CAMERA = Body(turn=30, looks=True, eye=0.88), CameraConfig(480, 640, 79.0)
OBJECTNAV = register_continuous(
    ContinuousTask("objectnav", "ObjectNav", read_objectnav, object_source, BODY, CAMERA, gps=True)
)
