"""The commands that learn, end to end on a hand-made data set: features, training, resuming, judging."""

from __future__ import annotations

import argparse
import dataclasses
import json
import shlex
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hand_data import COMPACT, built, noise_features, random_encoder, small_house, validations_of

from embodied import options
from embodied.agents.common.settings import SHIPPED_AGENT, WEIGHTS
from embodied.agents.common.weights import origin_of, weights_digest
from embodied.agents.hanna.agent import HannaAbout, HannaAgent, HannaLearner, HannaStudy, hanna_policies
from embodied.agents.hanna.topological_map import PerfectInterpretation
from embodied.agents.learners.hanna import HannaTraining
from embodied.agents.studies.engine import run_study
from embodied.agents.vision.config import PLAIN
from embodied.agents.vision.encoder import load_encoder, save_encoder
from embodied.agents.vision.features import feature_path
from embodied.agents.vision.sighted_study import TrainingData
from embodied.cli import main
from embodied.cli.view import looked_at
from embodied.datasets.store import dataset_of
from embodied.evaluation.evaluate import evaluate
from embodied.interface import Mode, Stop
from embodied.records import read_json
from embodied.teachers.shortest import segments

pytestmark = pytest.mark.slow

torch.set_num_threads(1)
SMALL = shlex.split(
    "--hidden-size 16 --navigation-embedding 16 --ask-embedding 8 --self-heads 2 --text-heads 2 --batch 4 "
    "--training-steps 6 --evaluation-steps 8 --validation-tasks 3 --validate-every 1 --threads 1"
)


def parsed(kind, *words):
    parser = argparse.ArgumentParser()
    options.add_options(parser, kind)
    return options.read_options(parser.parse_args([str(w) for w in words]), kind)


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A tiny data set on grids, with features of the untrained encoder that are not computed but drawn."""
    data = built(tmp_path_factory.mktemp("line") / "data", make_house=small_house, ood=1)
    noise_features(data)
    return data


def test_training_resuming_and_judging_from_the_command_line(data, tmp_path, capsys):
    run = lambda *words: main([str(w) for w in words])
    train = ("train", "hanna", "--data", data.folder, "--out", tmp_path, "--encoder", COMPACT, *SMALL)
    assert run(*train, "--iterations", 2) == 0 and run(*train, "--iterations", 3) == 0
    assert "continuing after update 2" in capsys.readouterr().err
    assert [u for u, name, _ in validations_of(tmp_path) if name == "success"] == [1, 2, 3]
    best, out = tmp_path / "best.safetensors", tmp_path / "table"
    judge = ("evaluate", "hanna", "--data", data.folder, "--agent", best, "--encoder", COMPACT, "--tasks", 4)
    judge = (*judge, "--threads", 1)
    assert run(*judge, "--out", out) == 0
    table = (out / "table.md").read_text()
    for row in ("random walk", "shortest", "learned", "learned, no ask", "learned, perfect interpretation"):
        assert f"| {row} |" in table
    assert len(list(out.glob("episodes_*.jsonl"))) == table.count("| test_unseen |")
    (name,) = data.names("test_unseen")
    assert looked_at(out, "learned", name) == looked_at(out, "learned, no ask", name) == PLAIN, "what recordings show"
    assert looked_at(out, "shortest", name) is looked_at(out, "learned", "elsewhere") is None
    told = json.loads((out / "run.json").read_text())
    assert told["agent"] == weights_digest(best) and told["data"] == data.digest
    origin = origin_of(best)
    assert origin["data"] == data.digest and origin["settings"]["batch"] == 4, "weights say what they come from"


def test_perfect_interpretation_reaches_where_it_is_sent(tmp_path):
    """On routes the teacher walks: every sub-task that is departed from is departed from at its target."""
    data = built(tmp_path / "data")
    noise_features(data)
    config = parsed(HannaTraining, "--data", ".", "--out", ".", *SMALL).config
    bank = TrainingData(data, load_encoder(COMPACT)).split("test_unseen").bank
    words = HannaLearner.words_of(data, data.split("train")).words
    torch.manual_seed(0)
    agent = HannaAgent.new(HannaAbout(config=config, encoder=bank.digest, feature_size=bank.size, words=words))
    agent.network.eval()
    agent.network.ask_out.bias.data = torch.tensor([-1.0, 1.0])  # it asks whenever it can
    policies = hanna_policies(agent, bank)
    rarely = PerfectInterpretation(policies["learned, ask every 5"])
    episodes = {"always": [], "rarely": []}
    players = {"always": policies["learned, perfect interpretation"], "rarely": rarely}
    keep = lambda name, played: episodes[name].extend(played)
    evaluate(data.split("test_unseen"), players, seed=0, batch=4, keep=keep)
    worlds = data.places("test_unseen")
    pieces = [(worlds[e.task.world].graph, p) for e in sum(episodes.values(), []) for p in segments(e.steps)]
    left = [(g, p) for g, p in pieces if p[0].mode is Mode.SUB and isinstance(p[-1].action, Stop)]
    assert left and all(g.distance[p[-1].pose.node, p[0].targets[0]] <= 2.0 + 1e-9 for g, p in left)
    assert sum(e.requests for e in episodes["always"]) > 0


@pytest.fixture(scope="module")
def study(data, tmp_path_factory):
    """A study of the smallest agents on the hand-made data set, with features of an encoder on disk, run once."""
    folder = tmp_path_factory.mktemp("study")
    save_encoder(random_encoder(seed=1), folder / "encoder.safetensors")
    noise_features(data, load_encoder(folder / "encoder.safetensors"))
    words = parsed(HannaTraining, "--data", ".", "--out", ".", *SMALL)
    config = dataclasses.replace(words.config, iterations=2)
    learner = HannaStudy(
        data.folder, (0,), tasks=3, encoder=folder / "encoder.safetensors", config=config, evaluation=words.evaluation
    )
    run_study(learner, ["4.4"], folder / "out", note=print)
    return learner, folder / "out"


def times(out, pattern):
    return {p: p.stat().st_mtime_ns for p in (out / "runs").rglob(pattern)}


def test_a_study_trains_each_agent_once_and_prints_the_dissertation_beside(study):
    learner, out = study
    body = read_json(out / "hanna-4.4.json")
    assert [r["label"] for r in body["rows"]] == ["Target image only", "+ language instruction"]
    value = body["rows"][1]["values"]["success_test_unseen"]
    assert value["n"] == 3 and body["rows"][1]["printed"]["success_test_unseen"] == 45.43
    assert "success_test_ood" in body["rows"][0]["values"] and body["paper"] == "the dissertation, Table 4.4"
    change = "+ language instruction minus Target image only, success, test unseen"
    assert any(note.startswith(change) for note in body["notes"])
    assert "(45.43)" in (out / "hanna-4.4.md").read_text()
    assert "success_test_unseen_as_shipped" in body["rows"][0]["values"]
    assert "success_test_unseen_as_shipped" not in body["rows"][0]["printed"]
    weights, judged = times(out, "best.safetensors"), times(out, "judged/*")
    run_study(learner, ["4.4", "4.5"], out, rows=["Learned", "Target image only"], note=print)
    assert times(out, "best.safetensors") == weights, "rows that tables share are trained once"
    assert judged.items() <= times(out, "judged/*").items(), "what was played is not played again"


def test_the_papers_columns_take_the_likeliest_action_and_ours_stand_apart(study):
    learner, out = study
    row = learner.tables()["4.4"].rows[0]
    agent = learner.load(next(iter(times(out, "best.safetensors"))))
    plain, shipped = (learner.policies(agent, row.judge, s) for s in ("test_unseen", "test_unseen as shipped"))
    draws = [np.random.default_rng(k) for k in range(50)]
    assert {plain.policy.choose(np.array([0.4, 0.6]), rng) for rng in draws} == {1} and not plain.use_goal_image
    assert {shipped.policy.choose(np.array([0.4, 0.6]), rng) for rng in draws} == {0, 1} and shipped.use_goal_image
    assert plain.revisit_weight == 1 and shipped.revisit_weight < 1
    asks = lambda probability: plain.policy.ask_rule(probability, SimpleNamespace(target=None), -1, rng=draws[0])
    assert asks(0.6) and not asks(0.4)


def test_agents_that_are_compared_differ_in_one_setting(study):
    learner, _ = study

    def settings(row):
        trained = dataclasses.asdict(learner.settings(row.train, 0))
        return {**trained, **{f"judged: {k}": v for k, v in row.judge.items()}}

    for table in learner.tables().values():
        for pair in table.compared:
            a, b = map(settings, pair)
            differ = {k for k in a | b if a.get(k) != b.get(k)}
            assert len(differ) == 1 or differ == {"alpha", "ask_rule"}, pair  # alpha is the authors' for a rule


def test_missing_features_are_told_before_anything_is_trained(study, data, tmp_path):
    learner, _ = study
    path = feature_path(data.folder / "features", load_encoder(learner.encoder).digest, data.names(data.ood[0])[0])
    held = path.rename(tmp_path / "held")
    with pytest.raises(FileNotFoundError, match="embodied features"):
        run_study(learner, ["4.4"], tmp_path / "out", note=print)
    held.rename(path)
    assert not (tmp_path / "out" / "runs").exists()


def test_more_training_houses_than_there_are_are_refused(study, tmp_path):
    learner, _ = study
    source = TrainingData(dataset_of(learner.data, "hanna"), load_encoder(learner.encoder))
    config = dataclasses.replace(learner.config, training_houses=99)
    with pytest.raises(ValueError, match="99 houses of 'train' are wanted, .* has 2; ask for fewer"):
        HannaLearner.train(source, config, learner.evaluation, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_fewer_training_houses_mean_fewer_tasks_and_words(data):
    encoder = load_encoder(COMPACT)
    some, every = (TrainingData(data, encoder).split("train", houses=n) for n in (1, None))
    assert {t.world for t in some.tasks} == {data.names("train")[0]}
    assert 0 < len(some.tasks) < len(every.tasks)
    words_of = lambda split: HannaLearner.words_of(data, split).words
    assert len(words_of(some)) <= len(words_of(every))


def test_a_data_set_of_another_kind_of_task_is_refused_with_the_command_that_makes_the_right_one(data):
    assert dataset_of(data.folder, "hanna").digest == data.digest
    with pytest.raises(ValueError, match="is a data set of 'hanna', a learner of 'vnla' needs .*dataset vnla --out"):
        dataset_of(data.folder, "vnla")


def test_the_shipped_encoder_and_agent_are_small_and_fit_each_other():
    encoder, agent = load_encoder(), HannaAgent.load(SHIPPED_AGENT)
    assert agent.about.encoder == encoder.digest
    assert agent.about.feature_size == encoder.size
    sizes = {p.name: p.stat().st_size for p in WEIGHTS.iterdir()}
    encoders = sum(size for name, size in sizes.items() if name.startswith("encoder"))
    assert encoders < 9e6 and sum(sizes.values()) - encoders < 15e6
    look = encoder.encode_strips(np.zeros((1, 192, 576, 3), np.uint8))
    assert look.shape == (1, 36, encoder.size) and np.isfinite(look).all()
