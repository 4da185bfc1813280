"""VLNCE: follow an instruction along a route, as VLN-CE (Krantz et al. 2020)."""

from embodied.datasets.habitat import read_vlnce, route_episodes
from embodied.envs.continuous import ContinuousEpisode
from embodied.gym.continuous import ContinuousTask, EpisodeSource, register_continuous
from embodied.gym.playground import PlaygroundSettings, flat_playground


def route_source(source: EpisodeSource) -> list[ContinuousEpisode]:
    """The routes of a data set, or of the only house.

    Raises:
      ValueError: the tasks of the data set are no routes.
    """
    data = source.data
    if data is None:
        settings = PlaygroundSettings(source.cache, source.worlds)
        return route_episodes(flat_playground("vln", source.seed, settings).tasks, source.worlds)
    if not data.task_kind.from_routes:
        raise ValueError(f"{data.folder} has tasks of {data.kind!r}; VLNCE-v0 plays those of 'vln', or give episodes")
    return route_episodes(data.tasks(source.split), source.worlds)


VLNCE = register_continuous(ContinuousTask("vlnce", "VLNCE", read_vlnce, route_source))
