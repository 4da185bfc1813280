"""Find: go near any thing of a class, without help."""

from embodied.kinds.shipped.hanna import TABLE_4_2
from embodied.kinds.task_kind import Parts, PartTasks, StoryStyle, TaskInputs, TaskKind, parts_of_pool, register_kind
from embodied.tasks.goals import find_pool, find_task


def tasks(inputs: TaskInputs, parts: Parts) -> PartTasks:
    pool = find_pool(inputs.world, seed=inputs.seed)
    return parts_of_pool(len(pool), lambda i: find_task(pool, i, seed=inputs.seed, language=inputs.language), parts)


FIND = register_kind(
    TaskKind(name="find", title="Find", tasks=tasks, paper=TABLE_4_2, story=StoryStyle(dialogue=False))
)
