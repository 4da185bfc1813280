"""What agents see tells them where they are, and nothing else does: sights are tokens without a name."""

from __future__ import annotations

import ast
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hand_vnla import TINY as VNLA
from hand_vnla import lesson
from test_hanna_learner import agent_for, setting

from embodied.agents.hanna.agent import hanna_policies
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import Split
from embodied.evaluation.evaluate import play
from embodied.interface import Agent, Episode, Observation, Sight, Viewpoint, is_picture, viewpoint
from embodied.kinds import metrics

ROOT = Path(__file__).resolve().parent.parent
SEEING = {
    "agents/language_models/prompts.py",
    "agents/vision/features.py",
    "agents/vision/live.py",
    "embodied/policies/doors.py",
}
"""Modules that turn sights into features or names: they alone may ask where one is from."""


def test_sights_can_neither_be_compared_nor_hashed_and_every_step_has_new_ones():
    split = setting()
    env = split.make_env()
    first, again = env.reset(split.tasks[0]), env.reset(split.tasks[0])
    assert first.sight is not again.sight and first == again, "observations are equal but for their tokens"
    for wrong in (lambda: first.sight == again.sight, lambda: first.sight in [again.sight], lambda: {first.sight: 1}):
        with pytest.raises(TypeError):
            wrong()
    assert not is_picture(first.sight) and viewpoint(first.sight) == Viewpoint(env.task.world, env.pose.node)
    assert repr(first.sight) == "Sight(...)" and not hasattr(first.sight, "__dict__")


def test_no_policy_asks_where_a_sight_is_from():
    private = {"viewpoint", "is_picture", "_Sight__viewpoint", "_Sight__picture"}
    found = set()
    for path in [*(ROOT / "agents").rglob("*.py"), *(ROOT / "embodied" / "policies").glob("*.py")]:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {a.name for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) for a in n.names}
        names |= {n.attr for n in ast.walk(tree) if isinstance(n, ast.Attribute)}
        if names & private:
            found.add(path.relative_to(ROOT).as_posix())
    assert found == SEEING


@dataclasses.dataclass(frozen=True)
class Renamed:
    """An agent whose every sight is replaced by another one that shows the same: of a house and a node drawn anew."""

    agent: Agent
    copies: int
    rows: np.ndarray
    """(copies, nodes) where the features of each copy of a node are."""

    def act(self, observations: Sequence[Observation | None], memory: object, *, rngs: Sequence) -> tuple:
        draw = np.random.default_rng(len(str(memory)))

        def other(sight: Sight | None) -> Sight | None:
            if sight is None:
                return None
            return Sight("mixed", int(self.rows[draw.integers(self.copies), viewpoint(sight).node]))

        seen = [
            None if o is None else dataclasses.replace(o, sight=other(o.sight), target=other(o.target))
            for o in observations
        ]
        return self.agent.act(seen, memory, rngs=rngs)


def both(split: Split, copies: int = 5) -> tuple[FeatureBank, np.ndarray]:
    """A bank with the one house of a split and copies of its places in another order, and where they are."""
    (name,) = split.worlds
    nodes = len(split.worlds[name].graph.positions)
    own = np.stack([split.bank.features(Sight(name, v)) for v in range(nodes)])
    order = np.random.default_rng(0).permutation(copies * nodes)
    mixed = np.empty((copies * nodes, *own.shape[1:]), np.float32)
    mixed[order] = np.tile(own, (copies, 1, 1))
    return FeatureBank({name: own, "mixed": mixed}, split.bank.digest), order.reshape(copies, nodes)


def test_an_agent_behaves_the_same_whatever_its_sights_are_called():
    hanna = setting()
    agent = agent_for(hanna)
    vnla, _, walked = lesson(VNLA)
    agent.network.eval(), vnla.network.eval()
    for split, player in (
        (hanna, agent.policy),
        (hanna, lambda bank: hanna_policies(agent, bank)["rules only"]),
        (walked, vnla.player),
    ):
        bank, rows = both(split)
        tasks = [dataclasses.replace(t, horizon=15) for t in split.tasks[:6]]
        named = play(split.make_env, player(bank), tasks, seed=0, batch=6)
        renamed = play(split.make_env, Renamed(player(bank), 5, rows), tasks, seed=0, batch=6)
        assert [e.nodes for e in named] == [e.nodes for e in renamed]
        assert [[type(s.action) for s in e.steps] for e in named] == [
            [type(s.action) for s in e.steps] for e in renamed
        ]


def test_with_black_pictures_the_rules_of_an_agent_are_worth_nothing():
    """The rules stop at what the helper's picture shows: who sees black finds it no more often than by chance."""
    split = setting()
    agent = agent_for(split)
    rules = hanna_policies(agent, split.bank)["rules only"]
    tasks = [dataclasses.replace(t, horizon=60) for t in split.tasks]

    def success(policy: Agent) -> float:
        episodes: list[Episode] = play(split.make_env, policy, tasks, seed=0, batch=len(tasks))
        return float(np.mean([metrics.success(e, split.worlds[e.task.world].graph) for e in episodes]))

    assert success(rules) > success(rules.changed(bank=split.bank.blind())) + 0.3


def test_pictures_are_of_another_time_and_what_is_seen_is_of_now():
    own, later = {"a": np.ones((2, 36, 4), np.float32)}, {"a": np.full((2, 36, 4), 5.0, np.float32)}
    bank = FeatureBank(own, "digest").with_goal_images(later)
    seen, picture = Sight("a", 1), Sight("a", 1, picture=True)
    assert bank.features(seen)[0, 0] == 1 and bank.features(picture)[0, 0] == 5
    assert bank.gather([picture, None, seen])[:, 0, 0].tolist() == [5, 0, 1]
    assert not bank.blind().features(picture).any()
    with pytest.raises(ValueError, match="same worlds"):
        FeatureBank(own, "digest").with_goal_images({"b": own["a"]})
