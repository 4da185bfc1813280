"""SocialNav: go to a point among people who walk to and fro (Social-HM3D, Falcon: Gong et al. 2024)."""

from embodied.envs.continuous import ContinuousEpisode, NavigationGoal
from embodied.gym.continuous import ContinuousTask, EpisodeSource, register_continuous
from embodied.kinds.shipped.social import SOCIAL
from embodied.kinds.task_kind import TaskInputs
from embodied.language.plain_language import PlainLanguage
from embodied.navigation.free_space import EYE

EPISODES, REACHED = 60, 0.3
"""Tasks of the kind `social` in each house; metres from its goal within which an agent has to stop."""


def social_source(source: EpisodeSource) -> list[ContinuousEpisode]:
    """EPISODES in each house, without those in which nobody walks."""
    episodes = []
    for name, world in source.worlds.items():
        for task in SOCIAL.tasks(TaskInputs(world, (), source.seed, PlainLanguage()), [("main", EPISODES)])["main"]:
            nodes, people = [task.start.node, *task.goal_nodes], getattr(task.goal, "strolls", ())
            start, goal = ((x, y, z - EYE) for x, y, z in world.graph.positions[nodes].tolist())
            about = start, task.start.yaw, task.request, (NavigationGoal(goal),), REACHED
            episodes += [ContinuousEpisode(task.id, name, *about, people=people)] if people else []
    return episodes


SOCIALNAV = register_continuous(ContinuousTask("social", "SocialNav", None, social_source, point=True))
