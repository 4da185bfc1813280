"""The losses of 4.2.3 by hand, and training as a whole: it learns, resumes exactly, and fails clearly."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import json
import math
import os
import signal
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hand_data import validations_of
from hand_worlds import grid_world

from embodied.action_spaces import PanoramicMoves
from embodied.agents.common import imitation
from embodied.agents.common.imitation import play_with_memory
from embodied.agents.common.session import (
    DivergedError,
    Session,
    set_learning_rate,
    tasks_of_update,
    within_standard_error,
)
from embodied.agents.common.tensors import choose_at, choose_greedily, choose_sampled
from embodied.agents.common.vocabulary import Vocabulary, build_vocabulary, tokenize
from embodied.agents.common.weights import CheckpointError, restore
from embodied.agents.hanna.agent import (
    IGNORE,
    HannaAbout,
    HannaAgent,
    HannaLearner,
    curiosity,
    help_loss,
    imitation_loss,
    labelled,
    navigation_loss,
    negative_log_likelihood,
    reason_loss,
)
from embodied.agents.hanna.policy import for_training
from embodied.agents.learners.hanna import EVALUATIONS, HANNA_SCALES, RULES, TrainingConfig
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vision.sighted_study import Split
from embodied.assistants.anna import Anna
from embodied.assistants.route_system import build_routes
from embodied.evaluation.evaluate import play
from embodied.interface import Ask, Move, Observation, Sight, Stop, Task
from embodied.kinds.shipped.hanna import HannaEnv, hanna_pool, hanna_task
from embodied.language.plain_language import PlainLanguage
from embodied.locks import LockedError, locked
from embodied.records import identity_of
from embodied.teachers.shortest import HannaTeacher

torch.set_num_threads(1)

TINY = dataclasses.replace(
    HANNA_SCALES["mini"],
    hidden_size=32,
    navigation_embedding=32,
    ask_embedding=8,
    self_heads=2,
    text_heads=2,
    dropout=0.1,
    iterations=4,
    batch=6,
    training_steps=8,
    validate_every=2,
    validation_tasks=6,
    instruction_length=40,
    learning_rate=3e-3,
    cooldown=0.25,
)
JUDGED = dataclasses.replace(EVALUATIONS["mini"], evaluation_steps=12)


@functools.cache
def ground(side: int, houses: int):
    """Grids with people, their routes, and tasks in them."""
    worlds = {f"grid{i}": grid_world(side, name=f"grid{i}") for i in range(houses)}
    routes = {n: build_routes(w, seed=3, language=PlainLanguage(), house_split="test") for n, w in worlds.items()}
    tasks: list[Task] = []
    for world in worlds.values():
        pool = hanna_pool(world, seed=3)
        tasks += [hanna_task(pool, i, seed=3, language=PlainLanguage()) for i in range(min(30, len(pool)))]
    return worlds, routes, tasks


def setting(side: int = 6, houses: int = 1) -> Split:
    """Grids with people and routes, and features that tell the nodes apart."""
    worlds, routes, tasks = ground(side, houses)
    anna = Anna({n: w.graph for n, w in worlds.items()}, routes, split="test")
    moves = PanoramicMoves()
    rng = np.random.default_rng(0)
    bank = FeatureBank({n: rng.normal(size=(side * side, 36, 16)) for n in worlds}, "tests")
    return Split(worlds, tasks, lambda: HannaEnv(worlds, anna, moves), bank)


def agent_for(split: Split, config: TrainingConfig = TINY, evaluation=JUDGED):
    routes = ground(6, 1)[1]["grid0"]
    words = build_vocabulary([t.request for t in split.tasks] + [r.instruction for r in routes])
    bank, words = split.bank, words.words
    return HannaAgent.new(
        HannaAbout(config=config, evaluation=evaluation, encoder=bank.digest, feature_size=bank.size, words=words)
    )


def identity(agent):
    return identity_of(settings=agent.config, encoder=agent.about.encoder)


def run(folder, config=TINY, split=None, **options):
    split = split or setting()
    agent = agent_for(split, config)
    learner = HannaLearner(agent, split)
    progress = imitation.train(learner, split, folder, identity(agent), note=lambda line: None, **options)
    return agent, progress


def collected(split, player, tasks):
    """Episodes that a player in training plays, and what the teacher says of them."""
    episodes, memory = play_with_memory(split.make_env, player, tasks, seed=0)
    return episodes, labelled(episodes, memory.moments, HannaTeacher(), split.worlds)


# Losses ------------------------------------------------------------------------------------------


def test_the_navigation_loss_is_that_of_equation_4_13():
    logits = torch.log(torch.tensor([[0.5, 0.2, 0.3], [0.1, 0.8, 0.1], [0.2, 0.2, 0.6]]))
    labels = torch.tensor([0, 1, IGNORE])
    negatives = torch.tensor([[False, True, True], [False, False, False], [True, False, False]])
    expected = [-math.log(0.5) + 2.0 * (math.log(0.2) + math.log(0.3)) / 2, -math.log(0.8), 0.0]
    assert torch.allclose(navigation_loss(logits, labels, negatives, 2.0), torch.tensor(expected))
    assert torch.allclose(navigation_loss(logits, labels, negatives, 0.0), negative_log_likelihood(logits, labels))


def test_the_curiosity_loss_pushes_past_mistakes_down_even_beside_masked_actions():
    logits = torch.tensor([[1.0, 0.5, -torch.inf]], requires_grad=True)
    curiosity(logits, torch.tensor([0]), torch.tensor([[False, True, False]])).sum().backward()
    assert torch.isfinite(logits.grad).all()
    assert logits.grad[0, 1] > 0  # gradient descent lowers it
    assert logits.grad[0, 2] == 0


def test_below_its_floor_the_curiosity_loss_lets_a_mistake_be():
    logits = torch.log(torch.tensor([[0.989, 0.001, 0.01]])).requires_grad_()
    label, both = torch.tensor([0]), torch.tensor([[False, True, True]])
    loss = curiosity(logits, label, both, floor=0.005)
    assert loss.item() == pytest.approx((math.log(0.005) + math.log(0.01)) / 2, rel=1e-4)
    loss.sum().backward()
    free = curiosity(logits, label, torch.tensor([[False, False, True]])) / 2
    alone = torch.autograd.grad(free.sum(), logits)[0]
    assert torch.allclose(logits.grad, alone, atol=1e-6)


def test_the_help_loss_is_that_of_equation_4_14():
    ask = torch.log(torch.tensor([[0.25, 0.75], [0.5, 0.5]]))
    labels = torch.tensor([1, IGNORE])
    rho = torch.tensor([[0.9, 0.2, 0.5], [0.9, 0.9, 0.9]])
    reasons = torch.tensor([[1.0, 0.0, 1.0], [0.0, 0.0, 0.0]])
    binary = -(math.log(0.9) + math.log(0.8) + math.log(0.5)) / 3
    assert torch.allclose(reason_loss(rho.logit(), reasons, labels), torch.tensor([binary, 0.0]))
    expected = torch.tensor([-math.log(0.75) + binary, 0.0])
    assert torch.allclose(help_loss(ask, labels, rho.logit(), reasons), expected)
    assert torch.allclose(help_loss(ask, labels, None, reasons), torch.tensor([-math.log(0.75), 0.0]))


# Words, draws, batches ---------------------------------------------------------------------------


def test_words_keep_their_numbers_and_strangers_are_unknown():
    words = build_vocabulary(["Find a mug.", "find a towel, please"])
    assert words.words[:6] == ("<PAD>", "<UNK>", "<EOS>", "a", "find", ",")
    assert tokenize("Don't go 60 degrees; stop!") == ["don't", "go", "60", "degrees", ";", "stop", "!"]
    numbers = words.encode("find the mug", 6)
    assert numbers.tolist() == [words.number_of["find"], 1, words.number_of["mug"], 2, 0, 0]
    assert words.encode("find a mug", 2).tolist() == [words.number_of["find"], words.number_of["a"]]
    with pytest.raises(ValueError, match="starts with"):
        Vocabulary(("mug",))


def test_sampled_choices_have_their_frequencies_and_never_take_the_impossible():
    """At temperature 1/2 the odds of 1 : 3 become 1 : 9, at 0 the likeliest is taken."""
    rng = np.random.default_rng(0)
    p = np.array([0.2, 0.0, 0.5, 0.3, 0.0])
    counts = np.bincount([choose_sampled(p, rng) for _ in range(4000)], minlength=5) / 4000
    assert counts[1] == counts[4] == 0
    assert np.allclose(counts, p, atol=0.03)
    assert choose_greedily(p, rng) == choose_at(0)(p, rng) == 2
    sharp = [choose_at(0.5)(np.array([0.25, 0.0, 0.75]), rng) for _ in range(4000)]
    assert abs(sharp.count(2) / 4000 - 0.9) < 0.02 and 1 not in sharp


def test_every_pass_of_training_takes_every_task_once():
    tasks = setting().tasks[:10]
    taken = [t.id for u in range(5) for t in tasks_of_update(tasks, u, 4, seed=0)]
    for start in (0, 10):
        assert sorted(taken[start : start + 10]) == sorted(t.id for t in tasks)
    assert taken[:10] != taken[10:]


# Play --------------------------------------------------------------------------------------------


def test_where_the_agent_was_weighs_less():
    split = setting()
    agent = agent_for(split, dataclasses.replace(TINY, ask_rule="never"))
    tasks = [dataclasses.replace(t, horizon=20) for t in split.tasks[::5]]

    def repeated(again: float) -> int:
        """Steps to places where the episode had been under the same words."""
        policy = dataclasses.replace(agent.policy(split.bank), revisit_weight=again)
        policy.policy.network.eval()
        with torch.inference_mode():
            played = play(split.make_env, policy, tasks, seed=1, batch=len(tasks))
        moves = lambda e: [(s.instruction, s.next_pose.node) for s in e.steps if isinstance(s.action, Move)]
        return sum(len(moves(e)) - len(set(moves(e))) for e in played)

    assert repeated(1.0) > 1.5 * repeated(0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "model, again, use_goal_image",
    [("hanna", 1.0, False), ("hanna", 0.3, False), ("hanna", 0.3, True), ("lstm", 1.0, False)],
)
def test_an_episode_does_not_depend_on_the_batch_around_it(model, again, use_goal_image):
    split = setting(houses=2)
    judged = dataclasses.replace(JUDGED, revisit_weight=again, use_goal_image=use_goal_image)
    policy = agent_for(split, dataclasses.replace(TINY, model=model), judged).policy(split.bank)
    policy.policy.network.eval()
    policy = policy.changed(choose=choose_sampled, ask_rule=RULES["learned"][0])
    tasks = [dataclasses.replace(t, id=f"{t.id}/{k}", horizon=8) for k, t in enumerate((split.tasks * 2)[:33])]
    with torch.inference_mode():
        together = play(split.make_env, policy, tasks, seed=1, batch=32)
        alone = play(split.make_env, policy, tasks, seed=1, batch=1)
        backwards = play(split.make_env, policy, tasks[::-1], seed=1, batch=5)[::-1]
    assert together == alone == backwards
    assert any(isinstance(s.action, Ask) for e in together for s in e.steps)
    assert any(isinstance(s.action, Move) for e in together for s in e.steps)
    assert len({len(e.steps) for e in together}) > 1  # some leave the batch before others


def test_actions_are_described_by_the_view_they_lie_in_and_stop_by_nothing():
    split = setting()
    policy = agent_for(split).policy(split.bank).policy
    task = split.tasks[0]
    seen = split.make_env().reset(task)
    percept = policy.percept([seen], policy.start((0,)))
    assert torch.equal(percept.actions[0, 0], torch.zeros(policy.network.action_size))
    first = split.bank.features(seen.sight)[seen.candidates.view[0]]
    assert np.allclose(percept.actions[0, 1, : split.bank.size], first)
    assert percept.actions[0, 1, split.bank.size] == pytest.approx(math.sin(seen.candidates.bearing[0]), abs=1e-6)
    ahead = split.bank.features(seen.sight)[12 + seen.turn]
    assert np.allclose(percept.current[0, 12], ahead)  # row 12 looks where the agent looks
    relative = (seen.candidates.view[0] % 12 - seen.turn) % 12
    assert percept.action_slots[0].tolist()[:2] == [36, seen.candidates.view[0] // 12 * 12 + relative]
    assert torch.equal(percept.target, torch.zeros(1, 36, split.bank.size))


def test_two_observations_that_differ_only_in_what_is_private_look_the_same():
    """An agent that turned together with its world cannot tell: bearings and views are its own."""
    split = setting()
    policy = (
        agent_for(split)
        .policy(FeatureBank({"a": np.arange(36.0)[None, :, None] * np.ones((1, 36, 16))}, "tests"))
        .policy
    )
    env = split.make_env()
    seen = env.reset(split.tasks[0])

    def turned(o: Observation, k: int) -> Observation:
        view = o.candidates.view // 12 * 12 + (o.candidates.view % 12 + k) % 12
        return dataclasses.replace(
            o, sight=Sight("a", 0), turn=(o.turn + k) % 12, candidates=dataclasses.replace(o.candidates, view=view)
        )

    bank = policy.bank.features(Sight("a", 0))
    rolled = np.concatenate([np.roll(bank[12 * b : 12 * b + 12], 4, 0) for b in range(3)])
    other = dataclasses.replace(policy, bank=FeatureBank({"a": rolled[None]}, "tests"))
    a = policy.percept([turned(seen, 0)], policy.start((0,)))
    b = other.percept([turned(seen, 4)], other.start((0,)))
    for name in ("current", "actions", "action_slots"):
        assert torch.equal(getattr(a, name), getattr(b, name)), name


def test_an_episode_misses_the_same_channels_at_every_step_and_at_its_target():
    """So a panorama still equals its target image exactly, whatever is hidden."""
    split = setting()
    learner = for_training(agent_for(split).policy(split.bank).policy, environment_dropout=0.5)
    sight = Sight("grid0", 0)
    first = dataclasses.replace(split.make_env().reset(split.tasks[0]), sight=sight, target=sight, turn=0)
    torch.manual_seed(0)
    memory = learner.start((0, 1))
    percept = learner.percept([first, first], memory)
    assert torch.equal(percept.current, percept.target)
    hidden = percept.current.abs().sum(1) == 0  # (2, D)
    assert 0.2 < hidden.float().mean() < 0.8
    assert not torch.equal(hidden[0], hidden[1])
    assert torch.equal(hidden[1:], learner.percept([first], memory.keep((1,))).current.abs().sum(1) == 0)
    assert agent_for(split).policy(split.bank).policy.start((0,)).channels is None


@pytest.mark.slow
def test_in_guided_episodes_every5_asks_and_in_the_others_the_learner():
    split = setting()
    tasks = [dataclasses.replace(t, horizon=20) for t in (*split.tasks, *split.tasks, *split.tasks)]
    half = round(len(tasks) / 2)
    learner = for_training(agent_for(split).policy(split.bank).policy, RULES["never"][0], guided_asking=0.5)
    episodes, _ = collected(split, learner, tasks)
    asked = [[t for t, s in enumerate(e.steps) if isinstance(s.action, Ask)] for e in episodes]
    assert sum(map(len, asked[:half])) > 0 and not any(asked[half:])
    assert all(first >= 4 for first, *_ in filter(None, asked)) and all(
        b - a >= 5 for times in asked for a, b in itertools.pairwise(times)
    )


def test_labels_line_up_with_what_the_networks_said():
    """The teacher's word about step t of episode i is compared with the scores of that very step."""
    split = setting()
    agent = agent_for(split)
    tasks = [dataclasses.replace(t, horizon=8) for t in split.tasks[:5]]
    teacher = HannaTeacher()
    episodes, experience = collected(split, for_training(agent.policy(split.bank).policy), tasks)
    labels = [teacher.relabel(e, split.worlds[e.task.world]) for e in episodes]
    rows = [(t, i) for t in range(8) for i, e in enumerate(episodes) if t < len(e.steps)]
    assert len(rows) == len(experience.right_moves)
    for row, (t, i) in enumerate(rows):
        step, label = episodes[i].steps[t], labels[i][t]
        expected = IGNORE if label.move is None else 0 if isinstance(label.move, Stop) else label.move.candidate + 1
        assert experience.right_moves[row] == expected
        assert experience.right_asks[row] == (IGNORE if label.ask is None else int(label.ask))
        n = len(step.candidate_nodes)
        said = experience.moves[row].softmax(-1).detach().numpy()
        assert np.allclose(np.append(said[1 : n + 1], said[0]), step.action.thought.moves, atol=1e-5)
        assert said[n + 1 :].sum() == 0


# Learning ----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("model", ["hanna", "lstm"])
def test_it_overfits_one_batch(model):
    """Loss on the same eight episodes falls to a fraction; nothing in the gradient's way is broken."""
    split = setting()
    agent = agent_for(split, dataclasses.replace(TINY, model=model, dropout=0.0))
    optimizer = torch.optim.Adam(agent.network.parameters(), 5e-3)
    learner = dataclasses.replace(for_training(agent.policy(split.bank).policy), choose=choose_greedily)
    tasks = [dataclasses.replace(t, horizon=8) for t in split.tasks[:8]]
    losses, rights = [], []
    for _ in range(40):
        _, played = collected(split, learner, tasks)
        navigation, asking = imitation_loss(played, 0.0, len(tasks))
        optimizer.zero_grad()
        (navigation + asking).backward()
        optimizer.step()
        known = played.right_moves != IGNORE
        rights.append(float((played.moves.argmax(-1) == played.right_moves)[known].float().mean()))
        losses.append(float((navigation / known.sum()).detach()))
    assert np.mean(rights[-5:]) > 0.8, rights
    assert np.mean(losses[-5:]) < 0.5 * losses[0], losses


@pytest.mark.slow
def test_a_run_writes_what_a_researcher_looks_at_and_ends_the_same_where_it_was_stopped(tmp_path):
    seen = []
    noted = lambda update, episodes: seen.append((update, len(episodes)))
    straight, progress = run(tmp_path / "straight", on_validation=noted)
    assert seen == [(2, 6), (4, 6)]
    found = {update: value for update, name, value in validations_of(tmp_path / "straight") if name == "success"}
    assert list(found) == [2, 4] and progress.best == max(found.values())
    good = [update for update, success in found.items() if within_standard_error(success, progress.best, 6)]
    assert progress.best_update in good
    assert list((tmp_path / "straight").glob("events.out.tfevents.*"))
    assert json.loads((tmp_path / "straight" / "settings.json").read_text())["settings"]["batch"] == 6
    run(tmp_path / "broken", dataclasses.replace(TINY, iterations=2))
    resumed, progress = run(tmp_path / "broken")
    assert progress.update == 4
    for name, value in straight.network.state_dict().items():
        assert torch.equal(value, resumed.network.state_dict()[name]), name
    a, b = (validations_of(tmp_path / d) for d in ("straight", "broken"))
    assert a == b and {name for _, name, _ in a} >= {"success", "spl"}


def test_training_starts_from_given_weights_and_keeps_their_words(tmp_path):
    run(tmp_path / "first", dataclasses.replace(TINY, iterations=2))
    file = tmp_path / "first" / "best.safetensors"
    before = HannaAgent.load(file)
    about = lambda kind, config, evaluation, words: kind(
        config=config, evaluation=evaluation, encoder="tests", feature_size=16, words=words.words
    )
    source = SimpleNamespace(split=lambda name, **_: setting(), device="cpu", identity=dict, about=about)
    config = dataclasses.replace(TINY, start=str(file), iterations=1, learning_rate=1e-9)
    HannaLearner.train(source, config, JUDGED, tmp_path / "second", note=lambda line: None)
    after = HannaAgent.load(tmp_path / "second" / "best.safetensors")
    assert after.about.words == before.about.words
    for name, value in before.network.state_dict().items():
        assert torch.allclose(value, after.network.state_dict()[name], atol=1e-6), name


def test_of_agents_as_good_as_each_other_the_later_is_kept():
    assert within_standard_error(0.68, 0.71, 100) and not within_standard_error(
        0.66, 0.71, 100
    )  # one standard error is 4.5 points
    assert not within_standard_error(0.68, 0.71, 1000)
    assert within_standard_error(0.0, 0.0, 60) and not within_standard_error(0.9, 1.0, 60)


@pytest.mark.slow
def test_a_checkpoint_of_another_run_is_refused_and_stays_whole(tmp_path):
    run(tmp_path)
    before, settings = (tmp_path / "checkpoint.pt").read_bytes(), (tmp_path / "settings.json").read_bytes()
    with pytest.raises(CheckpointError, match="batch 6 -> 5"):
        run(tmp_path, dataclasses.replace(TINY, batch=5))
    assert (tmp_path / "settings.json").read_bytes() == settings, "who is refused writes nothing"
    other = setting()
    worlds = {n: other.bank._table.numpy() for n in other.worlds}
    with pytest.raises(CheckpointError, match="encoder 'tests' -> 'another encoder'"):
        run(tmp_path, split=dataclasses.replace(other, bank=FeatureBank(worlds, "another encoder")))
    assert (tmp_path / "checkpoint.pt").read_bytes() == before
    torch.save({"format": "something else"}, tmp_path / "checkpoint.pt")
    with pytest.raises(CheckpointError, match="not a checkpoint of format"):
        run(tmp_path)


def test_a_checkpoint_that_cannot_be_gone_on_with_is_refused(tmp_path):
    def parts(size=3):
        network = torch.nn.Linear(size, 1)
        return {"network": network, "adam": torch.optim.Adam(network.parameters())}

    def save(folder, kept):
        with Session(folder, {"settings": {}}, kept, 2, note=str) as session:
            session.save()
        return folder / "checkpoint.pt"

    path = save(tmp_path / "whole", parts())
    with pytest.raises(CheckpointError, match="network is another's"):
        restore(path, {"settings": {}}, parts(4))
    with pytest.raises(CheckpointError, match=r"holds \['adam', 'network'\], this run has \['network'\]"):
        restore(path, {"settings": {}}, {"network": parts()["network"]})


def test_a_second_training_in_the_same_folder_is_refused(tmp_path):
    with locked(tmp_path), pytest.raises(LockedError, match=f"written by process {os.getpid()}"):
        run(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_loss_that_is_no_number_stops_the_run_and_keeps_the_checkpoint(tmp_path):
    run(tmp_path, dataclasses.replace(TINY, iterations=2))
    before = (tmp_path / "checkpoint.pt").read_bytes()
    bad = setting()
    bad.bank._table[:] = torch.nan
    with pytest.raises(DivergedError, match="update 2.*last checkpoint is intact"):
        run(tmp_path, split=bad)
    assert (tmp_path / "checkpoint.pt").read_bytes() == before


def test_an_agent_file_gives_the_same_agent_and_names_its_encoder(tmp_path):
    split = setting()
    agent, path = agent_for(split), tmp_path / "agent.safetensors"
    agent.save(path)
    again = HannaAgent.load(path)
    assert (again.config, again.about.evaluation, again.vocabulary) == (agent.config, JUDGED, agent.vocabulary)
    again.save(tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == path.read_bytes(), "equal agents are equal files"
    for name, value in agent.network.state_dict().items():
        assert torch.allclose(value, again.network.state_dict()[name], atol=2e-3), name
    other = FeatureBank({"x": np.zeros((1, 36, 16))}, "another encoder")
    with pytest.raises(ValueError, match="features come from encoder another"):
        again.policy(other)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "gpt"}, "model must be one of"),
        ({"ask_rule": "often"}, "ask_rule must be one of"),
        ({"batch": 0}, "batch must be at least 1"),
        ({"learning_rate": 0.0}, "learning_rate must be positive"),
        ({"alpha": -1.0}, "alpha must be at least 0"),
        ({"dropout": 1.5}, "dropout must be in"),
    ],
)
def test_impossible_settings_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(TINY, **change)


def test_the_learning_rate_falls_over_the_last_share_of_the_updates():
    config = dataclasses.replace(TINY, iterations=100, cooldown=0.4, learning_rate=1e-3)
    optimizer = torch.optim.SGD([torch.zeros(1)])

    def rate(update: int, cooldown: float) -> float:
        set_learning_rate(optimizer, 1e-3, update, 100, cooldown)
        return optimizer.param_groups[0]["lr"]

    rates = [rate(u, 0.4) for u in range(100)]
    assert rates[:60] == [1e-3] * 60 and np.all(np.diff(rates[60:]) < 0) and 0 < rates[-1] < 5e-5
    assert rate(99, 0.0) == 1e-3
    learner = HannaLearner(agent_for(setting(), config), setting())
    learner.learn(99)
    assert learner.optimizer.param_groups[0]["lr"] == rates[-1]


def test_table_d1_is_the_default():
    d1 = HANNA_SCALES["paper"]
    assert (d1.hidden_size, d1.navigation_embedding, d1.ask_embedding, d1.batch) == (256, 256, 128, 32)
    assert (d1.learning_rate, d1.dropout, d1.alpha, d1.iterations) == (1e-4, 0.3, 1.0, 30_000)
    steps = EVALUATIONS["paper"].evaluation_steps
    assert (d1.training_steps, steps, d1.instruction_length) == (20, 50, 50)


@pytest.mark.slow
def test_ctrl_c_saves_and_the_same_command_goes_on(tmp_path):
    config, said = dataclasses.replace(TINY, iterations=10**6, validate_every=10**6), []

    def note(line: str) -> None:
        said.append(line)
        if line.startswith("20/"):
            signal.raise_signal(signal.SIGINT)

    split = setting()
    agent, before = agent_for(split, config), signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        imitation.train(HannaLearner(agent, split), split, tmp_path, identity(agent), note=note)
    assert said[-1] == "stopped after update 20; the same command goes on from there"
    assert torch.load(tmp_path / "checkpoint.pt", weights_only=True)["progress"]["update"] == 20
    assert signal.getsignal(signal.SIGINT) is before
    agent = agent_for(split, dataclasses.replace(config, iterations=21))
    imitation.train(HannaLearner(agent, split), split, tmp_path, identity(agent), note=note)
    assert "continuing after update 20" in said and said[-1].startswith("21/21")
