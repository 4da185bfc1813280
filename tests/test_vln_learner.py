"""VLN's follower on a grid: losses by hand, no leak, no dependence on the batch, and learning."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch
from hand_data import built
from hand_worlds import grid_world

from embodied.agents.common.settings import SHIPPED_ENCODER, SHIPPED_VLN
from embodied.agents.common.tensors import IGNORE
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.learners.vln import FollowerSettings
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import Split
from embodied.agents.vln.policy import FollowerOutputs, VlnAbout, VlnAgent, VlnMoment
from embodied.agents.vln.study import VlnLearner, losses_of, teacher_share
from embodied.assistants.route_system import build_routes
from embodied.datasets.store import dataset_of
from embodied.evaluation.evaluate import play
from embodied.interface import Move
from embodied.kinds.shipped.vln import VLN, vln_task
from embodied.kinds.task_kind import EnvInputs
from embodied.language.plain_language import PlainLanguage
from embodied.policies.baselines import Forward10

TINY = FollowerSettings(hidden_size=32, dropout=0.0, iterations=40, batch=12, learning_rate=5e-3, instruction_length=30)


@pytest.fixture(scope="module")
def split() -> Split:
    world = grid_world(spacing=4.0)
    bank = FeatureBank({"grid": np.random.default_rng(0).standard_normal((36, 36, 16)).astype(np.float16)}, "hand")
    routes = build_routes(world, seed=0, language=PlainLanguage(), house_split="train")
    tasks = [vln_task("grid", r) for r in routes][:12]
    return Split({"grid": world}, tasks, VLN.environments(EnvInputs({"grid": world})), bank)


def new(split: Split, **changes):
    words = build_vocabulary(t.request for t in split.tasks).words
    config = dataclasses.replace(TINY, **changes)
    return VlnAgent.new(VlnAbout(config=config, encoder="hand", feature_size=16, words=words, pictures="unlit_192"))


def walks(episodes):
    return [[s.next_pose.node for s in e.steps] for e in episodes]


def test_losses_are_sums_over_steps_and_means_over_episodes():
    half = torch.tensor([[0.0, 0.0, -math.inf], [0.0, 0.0, 0.0]])
    rooms = torch.zeros(2, 3, 4)
    said = FollowerOutputs(half, torch.tensor([0.5, 1.0]), rooms, torch.zeros(2, 3, 8))
    moment = VlnMoment(said, torch.tensor([1, 2]), torch.tensor([0.0, 1.0]), torch.tensor([[0, 1, IGNORE], [2, 3, 1]]))
    moves, left, near = losses_of([moment, moment], episodes=4)
    assert moves.item() == pytest.approx(2 * (math.log(2) + math.log(3)) / 4)
    assert left.item() == pytest.approx(2 * 0.25 / 4)
    assert near.item() == pytest.approx(2 * (math.log(4) + math.log(4)) / 4), "a mean over the actions of a step"


def test_forcing_says_who_acts():
    share = lambda update, forcing: teacher_share(dataclasses.replace(TINY, forcing=forcing), update)
    assert [share(k, "dagger") for k in (0, 10, 20, 40)] == [1.0, 0.5, 0.0, 0.0]
    assert teacher_share(dataclasses.replace(TINY, least_teacher=0.3), 39) == 0.3
    assert share(5, "teacher") == 1.0 and share(0, "student") == 0.0


def test_a_walk_does_not_depend_on_the_batch(split):
    policy = new(split).policy(split.bank)
    together = play(split.make_env, policy, split.tasks, seed=0, batch=12)
    alone = play(split.make_env, policy, split.tasks[::-1], seed=0, batch=1)[::-1]
    assert walks(together) == walks(alone)


def test_the_blind_see_nothing_and_the_wordless_read_nothing(split, tmp_path):
    reworded = [dataclasses.replace(t, request="turn right and stop") for t in split.tasks]
    other = FeatureBank({"grid": np.ones((36, 36, 16), np.float16)}, "hand")
    for change, bank, tasks in (("blind", other, split.tasks), ("wordless", split.bank, reworded)):
        path = tmp_path / f"{change}.safetensors"
        new(split, **{change: True}).save(path)
        agent = VlnAgent.load(path)
        one = play(split.make_env, agent.policy(split.bank), split.tasks, seed=0, batch=12)
        two = play(split.make_env, agent.policy(bank), tasks, seed=0, batch=12)
        assert walks(one) == walks(two)
    with pytest.raises(ValueError, match="features come from encoder"):
        agent.policy(FeatureBank({"grid": np.ones((36, 36, 16), np.float16)}, "other"))


def test_a_follower_learns_its_routes(split):
    agent = new(split, iterations=24, learning_rate=1e-2)
    learner, first = VlnLearner(agent, split), None
    for update in range(24):
        numbers = learner.learn(update)
        first = first or numbers["loss navigation"]
    assert numbers["loss navigation"] < first / 2
    agent.network.eval()
    done = play(split.make_env, agent.policy(split.bank), split.tasks, seed=0, batch=12)
    near = [split.worlds["grid"].graph.distance[e.nodes[-1], e.task.goal_nodes[0]] <= 3 for e in done]
    assert np.mean(near) >= 0.5


def test_routes_of_a_hanna_data_set_are_tasks_of_vln(tmp_path):
    hanna = built(tmp_path / "data")
    data = dataset_of(hanna.folder, "vln")
    assert data.kind == "vln" and data.digest == hanna.digest
    for split in data.splits:
        routes = {r.id: r for n in data.names(split) for r in data.routes(n)}
        tasks = data.split(split).tasks
        assert tasks and all(t.request == routes[t.goal.route].instruction for t in tasks)
    (episode,) = play(data.split("val_unseen").make_env, Forward10(), data.tasks("val_unseen")[:1], seed=0)
    assert episode.task.kind == "vln" and isinstance(episode.steps[0].action, Move)


def test_the_shipped_follower_learned_from_the_shipped_encoder():
    agent = VlnAgent.load(SHIPPED_VLN)
    assert SHIPPED_VLN.stat().st_size < 4e6
    assert agent.about.encoder == load_encoder(SHIPPED_ENCODER).digest
    assert len(agent.vocabulary) > 900 and not agent.about.config.blind


def test_a_text_is_read_from_its_end_and_its_own_end_stays_where_it_is_too_long():
    words = build_vocabulary(["a b c d"])
    number, end = words.number, words.number("<EOS>")
    assert list(words.encode("a b", 4, backwards=True)) == [number("b"), number("a"), end, 0]
    assert list(words.encode("a b c d", 3, backwards=True)) == [number("b"), number("a"), end]
    assert list(words.encode("a b c d", 3)) == [number("a"), number("b"), number("c")], "and the same text as it is"
