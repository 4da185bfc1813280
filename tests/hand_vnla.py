"""A VNLA lesson over a house made by hand, whose features tell nodes and views apart."""

from __future__ import annotations

import numpy as np
from hand_worlds import grid_world

from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.learners.vnla import VnlaSettings
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import Split
from embodied.agents.vnla.study import VnlaAbout, VnlaAgent
from embodied.kinds.shipped.vnla import VNLA
from embodied.kinds.task_kind import EnvInputs
from embodied.language.plain_language import PlainLanguage
from embodied.tasks.goals import vnla_pool, vnla_task
from embodied.teachers.vnla import VnlaTeacher

TINY = VnlaSettings(
    hidden_size=24,
    word_embedding=12,
    navigation_embedding=6,
    ask_embedding=5,
    budget_embedding=4,
    dropout=0.1,
    instruction_length=30,
    iterations=4,
    looking=1,
    batch=6,
    learning_rate=3e-3,
    validate_every=4,
    validation_tasks=6,
)


def tasks_of(world, count=24):
    plan = VnlaTeacher().plan(world)
    pool = vnla_pool(world, plan, seed=0)
    return [vnla_task(pool, i, world, plan, seed=0, language=PlainLanguage()) for i in range(min(count, len(pool)))]


def split_under(rules: str, count=24) -> Split:
    world = grid_world()
    rng = np.random.default_rng(0)
    bank = FeatureBank({"grid": rng.standard_normal((len(world.graph.ids), 36, 16)).astype(np.float16)}, "hand")
    worlds = {"grid": world}
    tasks = VNLA.tasks_under(tasks_of(world, count), worlds, rules)
    return Split(worlds, tasks, VNLA.environments(EnvInputs(worlds, rules=rules)), bank)


def lesson(config: VnlaSettings = TINY):
    """An untrained agent, what it learns from and what it is validated on."""
    training, validation = (
        split_under("direct" if config.rules == "indirect" else config.rules),
        split_under(config.rules),
    )
    words = build_vocabulary(
        [*(t.request for t in training.tasks), "turn left , go forward 2 3 4 steps . look up down"]
    )
    about = VnlaAbout(config=config, encoder="hand", feature_size=16, words=words.words, pictures="unlit_192")
    return VnlaAgent.new(about), training, validation
