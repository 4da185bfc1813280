"""VNLA's learner: the two losses, budgets, a head that is detached, resuming, and a run on a small house."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
import torch
from hand_vnla import TINY, lesson, split_under

from embodied.action_spaces import WORDS
from embodied.agents.common import imitation
from embodied.agents.common.imitation import play_with_memory
from embodied.agents.common.weights import CheckpointError
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vnla.network import (
    ASK,
    DONT,
    MOST_LEFT,
    NO_ASK,
    NO_MOVE,
    READING,
    STOP,
    VnlaPercept,
    lessons_of,
    turned,
)
from embodied.agents.vnla.policy import VnlaMoment, _decided, carried_out, for_training
from embodied.agents.vnla.study import ASKED, LEARNED, TEACHER, VnlaAgent, VnlaLearner, losses_of
from embodied.assets.records import ROOM_KINDS
from embodied.evaluation.evaluate import play
from embodied.interface import Ask
from embodied.kinds.shipped.vnla import RULES_OF_PLAY
from embodied.records import identity_of
from embodied.teachers.vnla import VnlaTeacher, ask_reason

quiet = lambda line: None
identity = lambda agent: identity_of(settings=agent.config, pictures=agent.about.pictures)


# The networks ------------------------------------------------------------------------------------


def percept(agents=3, left=2):
    before = torch.full((agents,), NO_MOVE), torch.full((agents,), NO_ASK), torch.full((agents,), left)
    return VnlaPercept(torch.randn(agents, READING), *before, torch.ones(agents, STOP + 1, dtype=torch.bool))


def test_no_gradient_leaves_the_asking_head():
    agent, *_ = lesson()
    network = agent.network
    text = network.read(torch.tensor([[5, 6, 2]] * 3))
    _, asks = network.consider(percept(), torch.zeros(3, 2, network.hidden_size), text)
    asks.sum().backward()
    touched = {name.split(".")[0] for name, p in network.named_parameters() if p.grad is not None and p.grad.any()}
    assert touched == {"asking"}


def test_readers_are_taught_which_rooms_lie_where():
    agent, training, _ = lesson()
    ((_, words, _, ways, asked, here, ends, onward),) = lessons_of(training, agent.vocabulary)
    kitchen, bedroom, bathroom = (ROOM_KINDS.index(k) for k in ("kitchen", "bedroom", "bathroom"))
    beside = 2 + 6  # the kitchen's node before the door to the bedroom, which lies towards +x
    east = torch.isin(torch.arange(12), torch.tensor([11, 0, 1]))
    assert here[beside] == kitchen and ways[beside].all()
    assert (ends[beside] == torch.where(east, bedroom, kitchen)).all()
    assert onward[beside, bedroom, east].sum() > 0.99 and not onward[beside, kitchen].any()
    assert onward[beside, bathroom, ~east].sum() > 0.99  # over the living room
    assert {agent.vocabulary.words[w] for w in words[asked == bathroom].flatten()} >= {"bathroom"}


@pytest.mark.slow
def test_the_asking_head_knows_how_many_requests_are_left_and_counts_no_further_than_the_table():
    agent, *_ = lesson()
    network = agent.network.eval()
    torch.manual_seed(0)
    seen, text = percept(), network.read(torch.tensor([[5, 6, 2]] * 3))
    left = [dataclasses.replace(seen, left=torch.full((3,), n)) for n in (0, 1, MOST_LEFT, MOST_LEFT + 5)]
    said = [network.consider(some, torch.zeros(3, 2, network.hidden_size), text)[1] for some in left]
    assert not torch.allclose(said[0], said[1]) and torch.equal(said[2], said[3])


def test_what_is_read_of_a_place_is_told_as_seen_from_where_the_agent_looks():
    read = torch.cat([torch.eye(12)[4], torch.eye(12)[5], torch.tensor([0.7])])[None]
    seen = turned(read, torch.tensor([3]), torch.tensor([2]), torch.tensor([True]))[0]
    leads, ways, back = seen[:36].split(12)
    assert [int(x.argmax()) for x in (leads, ways, back)] == [1, 2, 11] and seen[36:].tolist() == pytest.approx(
        [0.7, 1]
    )
    assert not turned(read, torch.tensor([3]), torch.tensor([-1]), torch.tensor([True]))[0, 24:36].any()


def test_in_evaluation_no_turn_is_undone_and_who_is_unsure_goes_on():
    left, right = WORDS.index("left"), WORDS.index("right")
    chances = np.array([0.1, 0.05, 0.4, 0.0, 0.0, 0.45])
    assert _decided(chances, None).argmax() == right and _decided(chances, left).argmax() == 0
    assert _decided(np.array([0.1, 0.0, 0.25, 0.0, 0.0, 0.65]), left).argmax() == STOP


@pytest.mark.slow
def test_readers_learn_the_ways_of_a_house_by_heart():
    agent, training, _ = lesson(dataclasses.replace(TINY, looking=80, iterations=80, dropout=0.0))
    learner = VnlaLearner(agent, training)
    numbers = [learner.learn(u)["reading"] for u in range(80)]
    assert sum(numbers[-5:]) < 0.75 * sum(numbers[:5])


# The losses --------------------------------------------------------------------------------------


def test_the_losses_are_two_cross_entropies_by_hand():
    moves = torch.tensor([[0.0, 0.0, -math.inf, -math.inf, -math.inf, 0.0], [math.log(3), 0, 0, 0, -math.inf, 0]])
    one = VnlaMoment(torch.tensor([[0.0, math.log(4)]]), torch.tensor([ASK]), moves, torch.tensor([1, 0]))
    other = VnlaMoment(torch.zeros(0, 2), torch.zeros(0, dtype=torch.long), moves[:1], torch.tensor([STOP]))
    navigation, asking = losses_of([one, other], episodes=2)
    assert float(navigation) == pytest.approx((math.log(3) + math.log(7 / 3) + math.log(3)) / 2)
    assert float(asking) == pytest.approx(math.log(5 / 4) / 2)


def moments(config=TINY):
    agent, training, _ = lesson(config)
    teacher = VnlaTeacher()
    player = for_training(agent.policy(training.bank), teacher)
    return training, *play_with_memory(training.make_env, player, training.tasks[:8], seed=3)


@pytest.mark.slow
def test_in_training_it_asks_when_its_teacher_would_and_learns_from_every_move():
    training, episodes, memory = moments()
    asked = sum(e.requests for e in episodes)
    wished = torch.cat([m.ask_labels for m in memory.moments])
    assert asked == int(wished.sum()) > 0, "who should have asked has asked"
    assert sum(len(m.move_labels) for m in memory.moments) == sum(len(e.steps) for e in episodes) - asked
    assert sum(len(m.ask_labels) for m in memory.moments) == sum(bool(s.can_ask) for e in episodes for s in e.steps)


@pytest.mark.slow
def test_what_an_advisor_did_in_its_place_is_what_it_knows_to_have_done():
    training, episodes, _ = moments()
    for episode in episodes:
        env = training.make_env()
        before = env.reset(episode.task, seed=3)
        for step in episode.steps[:-1]:
            after = env.step(step.action)
            if not isinstance(step.action, Ask):
                assert carried_out(before, after) == step.action.candidate
            before = after


# Acting ------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("row", "asker"), [(LEARNED, "learned"), *ASKED.items()])
def test_every_asker_keeps_to_its_budget_and_to_itself(row, asker):
    agent, _, split = lesson()
    agent.network.eval()
    player = agent.player(split.bank, row)
    some = itertools.islice(itertools.cycle(split.tasks), 33)
    tasks = [dataclasses.replace(t, id=f"{t.id}/{k}", budget=2.0, horizon=8) for k, t in enumerate(some)]
    together = play(split.make_env, player, tasks, seed=1, batch=32)
    for batch in (1, 5):
        others = play(split.make_env, player, tasks[::-1], seed=1, batch=batch)[::-1]
        assert [[s.action for s in e.steps] for e in together] == [[s.action for s in e.steps] for e in others]
    requests = [e.requests for e in together]
    assert max(requests) <= 2 and (asker != "none" or not any(requests)) and (asker != "first" or sum(requests) > 6)


@pytest.mark.slow
def test_the_asker_teacher_asks_by_the_first_pass():
    agent, _, split = lesson()
    for e in play(split.make_env, agent.player(split.bank, TEACHER), split.tasks[:4], seed=1):
        env = split.make_env()
        env.reset(e.task, seed=1)
        for step in e.steps:
            if isinstance(step.action, Ask):
                assert ask_reason(env.situation, step.action.thought) is not None
            env.step(step.action)


@pytest.mark.slow
def test_features_of_another_encoder_are_refused():
    agent, _, split = lesson()
    with pytest.raises(ValueError, match="the agent learned from other"):
        dataclasses.replace(agent, about=dataclasses.replace(agent.about, encoder="other")).policy(split.bank)


# Training ----------------------------------------------------------------------------------------


@pytest.mark.slow
def test_it_learns_one_batch_by_heart():
    config = dataclasses.replace(
        TINY, hidden_size=48, looking=60, iterations=160, batch=4, learning_rate=4e-3, dropout=0.0
    )
    agent, training, _ = lesson(config)
    learner = VnlaLearner(agent, dataclasses.replace(training, tasks=training.tasks[:4]))
    numbers = [learner.learn(u) for u in range(config.iterations)][config.looking :]
    mean = lambda name, some: sum(n[name] for n in some) / len(some)
    assert mean("right moves", numbers[-10:]) > 0.65 > 0.55 > mean("right moves", numbers[:5])
    assert mean("loss navigation", numbers[-10:]) < 0.9 * mean("loss navigation", numbers[5:15])


@pytest.mark.slow
@pytest.mark.parametrize("rules", RULES_OF_PLAY)
def test_a_run_under_every_rule_writes_an_agent_that_plays(rules, tmp_path):
    agent, training, validation = lesson(dataclasses.replace(TINY, rules=rules, iterations=2, validate_every=2))
    progress = imitation.train(VnlaLearner(agent, training), validation, tmp_path, identity(agent), note=quiet)
    assert progress.update == 2
    found = VnlaAgent.load(tmp_path / "best.safetensors")
    assert (found.about.pictures, found.config.rules) == ("unlit_192", rules)
    played = play(validation.make_env, found.player(validation.bank), validation.tasks[:3], seed=0)
    assert len(played) == 3


def test_the_blind_see_nothing():
    agent, training, split = lesson(dataclasses.replace(TINY, blind=True))
    agent.network.eval()
    dark = FeatureBank({"grid": np.full_like(training.bank._table.numpy(), np.nan)}, "hand")
    one, two = (play(split.make_env, agent.player(bank), split.tasks[:6], seed=0) for bank in (split.bank, dark))
    assert [[s.action for s in e.steps] for e in one] == [[s.action for s in e.steps] for e in two]
    VnlaLearner(agent, dataclasses.replace(training, bank=dark)).learn(0)  # or it would diverge


def test_a_run_that_was_stopped_goes_on_as_if_it_had_not_been(tmp_path):
    def run(folder, *iterations):
        for n in iterations:
            agent, training, validation = lesson(dataclasses.replace(TINY, iterations=n, validate_every=10))
            imitation.train(VnlaLearner(agent, training), validation, folder, identity(agent), note=quiet)
        return agent.network.state_dict()

    whole, parts = run(tmp_path / "whole", 4), run(tmp_path / "parts", 2, 4)
    assert all(torch.equal(whole[k], parts[k]) for k in whole)
    with pytest.raises(CheckpointError, match="hidden_size 24 -> 32|settings changed"):
        agent, training, validation = lesson(dataclasses.replace(TINY, batch=5))
        imitation.train(VnlaLearner(agent, training), validation, tmp_path / "parts", identity(agent), note=quiet)


def test_an_agent_comes_back_from_its_file(tmp_path):
    agent, _, split = lesson()
    agent.save(tmp_path / "agent.safetensors")
    found = VnlaAgent.load(tmp_path / "agent.safetensors")
    assert (found.config, found.vocabulary, found.about.pictures) == (agent.config, agent.vocabulary, "unlit_192")


def test_settings_refuse_what_they_cannot_be():
    with pytest.raises(ValueError, match="rules must be one of"):
        dataclasses.replace(TINY, rules="Algorithm 6")
    assert DONT != ASK
    assert split_under("algorithm-6", 3).tasks[0].horizon > split_under("indirect", 3).tasks[0].horizon
