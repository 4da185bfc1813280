"""FollowNav: find a person who walks to and fro, and follow at 1 to 2 m (Habitat 3, Puig et al. 2023)."""

import dataclasses

from embodied.envs.continuous import ContinuousEpisode, NavigationGoal
from embodied.gym.continuous import ContinuousTask, EpisodeSource, register_continuous
from embodied.gym.continuous_tasks.social import social_source


def follow_source(source: EpisodeSource) -> list[ContinuousEpisode]:
    """The episodes of SocialNav, in which the first of the people who need no closed door is followed."""
    words, episodes = "find the person and stay 1 to 2 m away, facing them", []
    for e in social_source(source):
        for person in [p for p in e.people if not p.swings][:1]:
            followed = dataclasses.replace(e, people=(person,), follows=True)
            episodes.append(dataclasses.replace(followed, instruction=words, goals=(NavigationGoal(person.way[0]),)))
    return episodes


FOLLOWNAV = register_continuous(ContinuousTask("follow", "FollowNav", None, follow_source, gps=True))
