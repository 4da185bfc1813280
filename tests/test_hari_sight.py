"""HARI's execution policy that sees: it learns to go by what it sees, and covering its eyes is felt."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch
from hand_worlds import HandWorld, hand_graph, room, thing

from agents.hari.agent import (
    Executor,
    HariAgent,
    begun_with,
    load_agent,
    load_executor,
    new_executor,
    new_heads,
    save_agent,
)
from agents.hari.config import STATES, ExecutionConfig, IntentionConfig
from agents.hari.policy import policy_of
from agents.hari.pretraining import PretrainingData, learn_once, pretraining_success
from agents.hari.rules import RULES, RuleAgent
from agents.hari.sight import FeatureSpec, Headings, hidden_channels
from agents.hari.study import Covered
from agents.hari.words import collate, feature_words, percept
from embodied.action_spaces import PanoramicMoves
from embodied.assistants.descriptions import Describer
from embodied.cli import evaluate
from embodied.envs import hari
from embodied.envs.hari import HariEnv, HariRules
from embodied.envs.make import environment_maker
from embodied.evaluation.rollout import play
from embodied.house.house import House, Opening, Storey
from embodied.interface import FindObject, Pose, Sight, Task, viewpoint

D = 4
CONFIG = ExecutionConfig(
    hidden_size=32, layers=1, heads=2, dropout=0.0, learning_rate=3e-3, iterations=90, batch=16, sees="features"
)
SEEING = FeatureSpec(D, "hand-made")


def mirrored(name: str) -> HandWorld:
    """A hall with a mug at one end and a book at the other: in the east, or the other way round."""
    hall = room("hall_1", "hall", 0, 0, 14, 2)
    door = Opening("front_door_1", "front_door", ("hall_1", None), (0, 1.5), (0, 0.5), 0.0, 2.1)
    east, west = ("mug", "book") if name == "east" else ("book", "mug")
    things = (thing(east, 1, "hall_1", 12.8, 1.2), thing(west, 1, "hall_1", 0.8, 1.2))
    house = House(0, name, (Storey(0.0, 2.6),), (hall,), (door,), things, ())
    return HandWorld(house, hand_graph([[7, 1, 1.5], [13, 1, 1.5], [1, 1, 1.5]], [[0, 1], [0, 2]], ["hall_1"] * 3))


WORLDS = {name: mirrored(name) for name in ("east", "west")}


def task(name: str) -> Task:
    goal = 1 if name == "east" else 2
    what = FindObject("mug", "hall", ("mug_1",))
    return Task(f"{name}/hari/0", "hari", name, Pose(0), what, (goal,), "find a mug in a hall", 0.0, 6)


class Eyes:
    """Sees in which of the 36 views mugs and books are, and which are near."""

    size = D

    def features(self, sight: Sight) -> np.ndarray:
        """(36, 4) float32."""
        world, out = WORLDS[viewpoint(sight).world], np.zeros((36, D), dtype=np.float32)
        here = np.asarray(world.graph.positions)[viewpoint(sight).node]
        ends = (12.8, 0.8) if viewpoint(sight).world == "east" else (0.8, 12.8)
        for channel, x in enumerate(ends):  # of the mug and of the book
            offset = np.array([x, 1.2]) - here[:2]
            turn = round(math.atan2(offset[1], offset[0]) / (math.pi / 6)) % 12
            out[12 + turn, channel + 2 * (np.linalg.norm(offset) < 1)] = 3.0
        return out


def lessons() -> PretrainingData:
    tasks = [task(name) for name in WORLDS]
    return PretrainingData(WORLDS, Describer(()), tasks * 8, tasks * 20)


def fresh(config: ExecutionConfig = CONFIG) -> Executor:
    say = Describer(())
    words = feature_words(say.dense(w, v) for w in WORLDS.values() for v in range(3))
    return new_executor(config, words, SEEING, Eyes())


@pytest.fixture(scope="module")
def executor() -> Executor:
    """One that has learned both halls."""
    made = fresh()
    optimizer = torch.optim.Adam(made.network.parameters(), CONFIG.learning_rate)
    for update in range(CONFIG.iterations):
        learn_once(made, optimizer, lessons(), update)
    made.network.eval()
    return made


# What is read -----------------------------------------------------------------------------------


def test_a_row_holds_the_three_views_of_a_heading_and_the_direction_that_words_have():
    torch.manual_seed(0)
    headings, horizontal = Headings(D, 8), torch.nn.Embedding(13, 8)
    views = torch.zeros(2, 36, D)
    views[1, 12 + 5, 2] = 1.0  # level, five steps to the left of east
    rows = headings.rows(views, horizontal)
    bare = headings.row.bias + horizontal(torch.arange(1, 13))
    torch.testing.assert_close(rows[0], bare)
    changed = (rows[1] - rows[0]).abs().sum(-1) > 0
    assert changed.nonzero()[:, 0].tolist() == [5]
    torch.testing.assert_close((rows[1] - rows[0])[5], headings.row.weight[:, D + 2], msg="the level one of three")


def test_a_move_is_shown_with_the_view_it_leads_into_and_stopping_with_none():
    torch.manual_seed(0)
    headings, views = Headings(D, 8), torch.randn(1, 36, D)
    along = headings.moves(views, torch.tensor([[1 + 17, 0]]))
    torch.testing.assert_close(along[0, 0], headings.along(views[0, 17]))
    assert along[0, 1].abs().sum() == 0


def test_moves_know_their_views_and_padding_has_none():
    moves, words = PanoramicMoves(), fresh().words
    seen = Eyes().features(Sight("east", 0))
    at = lambda node: percept(words, (), (), moves.at(WORLDS["east"], Pose(node))[0], 0, seen)
    batch = collate([at(0), at(1)])
    assert batch.views.tolist() == [[1 + 12, 1 + 18, 0], [1 + 18, 0, 0]], "east and west; west alone"
    assert batch.sight.shape == (2, 36, D)
    blind = percept(words, (), (), moves.at(WORLDS["east"], Pose(0))[0], 0)
    with pytest.raises(ValueError, match="1 of 2 agents see"):
        collate([at(0), blind])


def test_hidden_channels_are_made_up_for():
    rng = np.random.default_rng(0)
    drawn = np.stack([hidden_channels(100, 0.4, rng) for _ in range(200)])
    assert set(np.unique(drawn)) == {0.0, np.float32(1 / 0.6)} and drawn.mean() == pytest.approx(1.0, abs=0.02)
    assert (hidden_channels(5, 0.0, rng) == 1).all()


def test_what_is_told_unasked_can_be_chosen_and_is_named_alike_everywhere():
    assert STATES == hari.STATES == evaluate.STATES
    told = {}
    for states in STATES:
        env = environment_maker("hari", WORLDS, describer=Describer(("mug",)), hari=HariRules(states=states))()
        told[states] = env.reset(dataclasses.replace(task("east"), start=Pose(1))).state_description
    assert told["none"] == () and len(told["sparse"]) == 1 and len(told["dense"]) == 2, "the mug; the hall, too"
    with pytest.raises(ValueError, match="states must be one of"):
        HariRules(states="some")


def test_a_policy_that_sees_wants_eyes_and_one_that_reads_has_no_use_for_them():
    blind = dataclasses.replace(fresh(), eyes=None)
    with pytest.raises(ValueError, match="give it its houses' features"):
        blind.look([Sight("east", 0)])
    reads = new_executor(dataclasses.replace(CONFIG, sees="words"), blind.words)
    assert reads.look([Sight("east", 0)]) == [None] and reads.network.sight is None


def test_a_policy_that_reads_can_be_taught_to_see():
    reads = new_executor(dataclasses.replace(CONFIG, sees="words", seed=5), fresh().words)
    begun = begun_with(fresh(), reads)
    assert torch.equal(begun.network.names.weight, reads.network.names.weight) and begun.network.sight is not None
    with pytest.raises(ValueError, match="other sizes"):
        begun_with(fresh(dataclasses.replace(CONFIG, hidden_size=16)), reads)
    with pytest.raises(ValueError, match="sight.row.weight"):
        begun_with(reads, fresh())


# What is learned --------------------------------------------------------------------------------


@pytest.mark.slow
def test_it_goes_by_what_it_sees_and_is_lost_when_its_eyes_are_covered(executor):
    tasks = lessons().validation
    assert pretraining_success(executor, lessons(), tasks) > 0.95
    covered = dataclasses.replace(executor, eyes=Covered(D))
    assert pretraining_success(covered, lessons(), tasks) < 0.8, "a third of its goals are told as the next action"


@pytest.mark.slow
def test_nobody_is_asked_and_the_mug_is_found_by_sight(executor):
    """The environment says nothing of where the agent is, and of the goal only its room and frequent things."""
    make = environment_maker("hari", WORLDS, describer=Describer(("mug",)), hari=HariRules(states="none"))
    tasks = [task(name) for name in WORLDS]
    for eyes, found in ((Eyes(), 2), (Covered(D), 1)):
        agent = RuleAgent(dataclasses.replace(executor, eyes=eyes), RULES["no assistance"])
        episodes = play(make, agent, tasks, seed=0)
        assert isinstance(make(), HariEnv) and all(e.requests == 0 for e in episodes)
        assert sum(e.task.goal_nodes[0] in e.nodes for e in episodes) == found


@pytest.mark.slow
def test_an_agent_that_sees_survives_the_disk_and_does_not_depend_on_its_batch(tmp_path, executor):
    config = IntentionConfig(hidden_size=8, states="none", horizon=6)
    agent = HariAgent(executor, new_heads(config, CONFIG.hidden_size)[0], config)
    save_agent(agent, tmp_path / "agent.safetensors")
    again = load_agent(tmp_path / "agent.safetensors")
    assert again.executor.seeing == SEEING and again.executor.eyes is None and again.config.states == "none"
    again = dataclasses.replace(again, executor=dataclasses.replace(again.executor, eyes=Eyes()))
    make = environment_maker("hari", WORLDS, describer=Describer(()), hari=HariRules(states="none"))
    tasks = [dataclasses.replace(task(("east", "west")[k % 2]), id=f"{k}") for k in range(4)]
    together = play(make, policy_of(agent), tasks, seed=1, batch=4)
    assert together == [play(make, policy_of(again), [t], seed=1)[0] for t in tasks]
    assert load_executor(tmp_path / "agent.safetensors").seeing == SEEING
