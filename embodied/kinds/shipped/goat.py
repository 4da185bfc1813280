"""Goat: find five to ten things one after the other, told by category, description or image (GOAT-Bench).

After Khanna et al. 2024 (arXiv 2404.06609). The agent keeps what it has seen: the episode goes on in the same house.
Splits with an open vocabulary are those of HM3D-OVON (Yokoyama et al. 2024, arXiv 2409.14296): classes of training,
the same in words that training never says, and classes that training never asks for.
"""

import dataclasses
import functools
from collections.abc import Mapping, Sequence

import numpy as np

from embodied import interface
from embodied.envs.base import HelpEnv
from embodied.kinds.splits import SplitPlan, Splits, SplitSizes
from embodied.kinds.task_kind import Metric, Parts, PartTasks, StoryStyle, TaskInputs, TaskKind, register_kind
from embodied.language.plain_language import with_article
from embodied.language.templates import SPOKEN
from embodied.navigation.graph import NavGraph
from embodied.policies.baselines import RandomWalk, RecognisingExplorer, Shortest
from embodied.seeds import stream
from embodied.tasks.ask import ask_pool, is_unseen, look_of, request
from embodied.tasks.goals import GOAT_REACH, find_instances

FEWEST_IN_TURN, MOST_IN_TURN = 5, 10
GOAL_STEPS = 40
"""Steps for each goal, after which the next one comes."""
FORMS = ("object", "description", "image")
SYNONYMS, UNSEEN_CLASSES = "synonyms", "unseen_classes"


def tasks(inputs: TaskInputs, parts: Parts) -> PartTasks:
    """As many of a part as are wanted; none in a house with fewer than two of its classes."""
    things: dict[str, list[interface.NextGoal]] = {}
    for x in find_instances(inputs.world, GOAT_REACH):
        one = interface.NextGoal(
            "image", x.object_class, (x.placement,), x.nodes, "find the place of the picture", x.nodes[0]
        )
        things.setdefault(x.object_class, []).append(one)
    described: dict[str, list[interface.NextGoal]] = {}
    for goal, nodes in ask_pool(inputs.world, look_of(getattr(inputs.world, "catalogue", None)), seed=0).goals:
        if len(goal.fitting) == 1:
            one = interface.NextGoal("description", goal.object_class, goal.fitting, nodes, request(goal))
            described.setdefault(goal.object_class, []).append(one)
    made: PartTasks = {}
    for part, count in parts:
        known = [n for n in sorted(things) if is_unseen(n) == (part == UNSEEN_CLASSES)]
        nouns = {n: n for n in known}
        if part == SYNONYMS:
            nouns = {n: SPOKEN.things[n][0] for n in known if n in SPOKEN.things}
        goals = {n: (_any_of(n, things[n]), described.get(n, ()), things[n]) for n in nouns}
        some = range(count if len(nouns) > 1 else 0)
        made[part] = [_task(inputs, goals, nouns, f"{inputs.world.house.name}/goat/{part}_{i}") for i in some]
    return made


def _any_of(name: str, some: Sequence[interface.NextGoal]) -> tuple[interface.NextGoal, ...]:
    """The goal of finding any thing of a class."""
    nodes, placements = tuple(sorted({v for g in some for v in g.nodes})), tuple(p for g in some for p in g.placements)
    return (interface.NextGoal("object", name, placements, nodes, f"find {with_article(name)}"),)


def _task(
    inputs: TaskInputs, goals: Mapping[str, Sequence[Sequence[interface.NextGoal]]], nouns: Mapping[str, str], name: str
) -> interface.Task:
    """Goals of the classes of `nouns`, which say them; never the same class twice in a row, each form as likely."""
    rng, chosen = stream(inputs.seed, "task", name), list[interface.NextGoal]()
    for _ in range(int(rng.integers(FEWEST_IN_TURN, MOST_IN_TURN + 1))):
        other = [n for n in nouns if not chosen or nouns[n] != chosen[-1].category]
        of_class = other[int(rng.integers(len(other)))]
        of_form = goals[of_class][int(rng.integers(len(FORMS)))] or goals[of_class][0]
        goal, noun = of_form[int(rng.integers(len(of_form)))], nouns[of_class]
        if goal.form != "image":
            words = goal.words.replace(with_article(of_class), with_article(noun)).replace(of_class, noun)
            goal = dataclasses.replace(goal, words=words)
        chosen.append(dataclasses.replace(goal, category=noun))
    start = interface.Pose(int(rng.integers(len(inputs.world.graph.positions))), int(rng.integers(interface.TURNS)))
    house, horizon, last = inputs.world.house.name, GOAL_STEPS * len(chosen), chosen[-1].nodes
    return interface.Task(
        name, "goat", house, start, interface.FindInTurn(tuple(chosen)), last, chosen[0].words, 0.0, horizon
    )


def splits(sizes: SplitSizes) -> Splits:
    """As usual but for seen houses; two more tests in the unseen houses."""
    each, houses = sizes.each or sizes.unseen, {group: sizes.houses[group] for group in ("train", "val", "test")}
    tested = [SplitPlan(f"test_{part}", "test", each, part) for part in (SYNONYMS, UNSEEN_CLASSES)]
    plans = SplitPlan("train", "train", sizes.tasks), SplitPlan("val_unseen", "val", each)
    return Splits(houses, (*plans, SplitPlan("test_unseen", "test", each), *tested))


class GoatEnv(HelpEnv):
    """Stopping, or GOAL_STEPS steps, end a goal; then the next one is told. A step's `subtask` is the goal's number."""

    def _begin(self) -> None:
        assert isinstance(self.task.goal, interface.FindInTurn), "tasks of this kind"
        self._left = list(self.task.goal.goals)
        self._turn_to_next("limit")
        self.instruction = self.task.request

    def _stopped(self) -> None:
        self._turn_to_next("stop")

    def _moved(self) -> None:
        if self.time_on_task >= GOAL_STEPS:
            self._turn_to_next("limit")

    def _turn_to_next(self, ended: str) -> None:
        if not self._left:
            self.ended = ended
            return
        number, goal = -len(self._left), self._left.pop(0)
        self.instruction, self.targets, self.time_on_task = goal.words, goal.nodes, 0
        self.subtask = interface.Subtask(f"goal {number}", goal.nodes[0])
        self.target = None if goal.picture is None else interface.Viewpoint(self.task.world, goal.picture)


def outcomes(episode: interface.Episode, graph: NavGraph) -> list[tuple[interface.NextGoal, interface.Trajectory]]:
    """Each goal and the walk to it, judged from where it was told, as GOAT-Bench's evaluator does: found means stopped
    at a place of the goal. One that never came was not found."""
    metres, judged = np.asarray(graph.distance), []
    goals = episode.task.goal.goals if isinstance(episode.task.goal, interface.FindInTurn) else ()
    for k, goal in enumerate(goals):
        steps = [s for s in episode.steps if s.subtask == f"goal {k - len(goals)}"]
        way = [*(s.pose.node for s in steps), *(s.next_pose.node for s in steps[-1:])] or [episode.nodes[-1]]
        near, lengths = metres[np.ix_(way, goal.nodes)].min(axis=1), metres[way[:-1], way[1:]].cumsum()
        stopped = bool(steps) and isinstance(steps[-1].action, interface.Stop)
        walk = {"distances": near, "lengths": np.array([0.0, *lengths]), "shortest": float(near[0])}
        judged.append((goal, interface.Trajectory(rule=interface.SuccessRule(0.0), stopped=stopped, **walk)))
    return judged


def _mean(field: str, *forms: str) -> Metric:
    """The mean of a field of Trajectory over the goals of some forms."""
    some = lambda e, g: [getattr(t, field) for goal, t in outcomes(e, g) if goal.form in forms]
    return Metric(lambda e, g: sum(some(e, g)), percent=True, per=lambda e, g: float(len(some(e, g))))


GOAT = register_kind(
    TaskKind(
        name="goat",
        title="Goat",
        tasks=tasks,
        environment=lambda inputs: functools.partial(GoatEnv, inputs.worlds),
        baselines={
            "random walk": RandomWalk,
            "explores, forgets": functools.partial(RecognisingExplorer, remembers=False),
            "explores, remembers": functools.partial(RecognisingExplorer, remembers=True),
            "shortest": Shortest,
        },
        success=lambda e, g: float(all(t.success for _, t in outcomes(e, g))),
        shortest=lambda e, g: sum(t.shortest for _, t in outcomes(e, g)),
        metrics={"goals found": _mean("success", *FORMS), "SPL of goals": _mean("spl", *FORMS)}
        | {f"{form} found": _mean("success", form) for form in FORMS},
        columns=("goals found", "SPL of goals", *(f"{form} found" for form in FORMS), "success", "steps"),
        test_splits=("test_unseen", f"test_{SYNONYMS}", f"test_{UNSEEN_CLASSES}"),
        splits=splits,
        story=StoryStyle(dialogue=False),
    )
)
