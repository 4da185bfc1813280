"""The commands that learn, end to end on a hand-made data set: features, training, resuming, judging."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import re

import numpy as np
import pytest
import torch
from hand_data import build

from agents.common.lessons import Lessons, split_of
from agents.common.processor_time import ProcessorTime
from agents.common.shipped import WEIGHTS
from agents.hanna import study as module
from agents.hanna.agent import load_agent, new_agent
from agents.hanna.evaluation import failures, hanna_policies, predictions, request_share
from agents.hanna.judging import run_eval
from agents.hanna.realism import RealismSetting, rank_correlation
from agents.hanna.realism import run_study as realism
from agents.hanna.run import run_train_hanna, train_agent, vocabulary_of
from agents.hanna.study import StudySetting, run_study
from agents.hanna.training_config import SCALES
from agents.vision.config import PLAIN, WAYS
from agents.vision.encoder import SHIPPED, load_encoder, random_encoder, save_encoder
from agents.vision.features import feature_path, save_features
from agents.vision.run import encoder_of
from embodied.cli import learning
from embodied.cli.options import chosen
from embodied.cli.view import looked_at
from embodied.datasets.store import dataset_of
from embodied.evaluation.evaluate import evaluate
from embodied.interface import Episode
from embodied.records import load_lines
from embodied.seeds import stream

pytestmark = pytest.mark.slow

torch.set_num_threads(1)
SMALL = [
    "--hidden-size",
    "16",
    "--navigation-embedding",
    "16",
    "--ask-embedding",
    "8",
    "--self-heads",
    "2",
    "--text-heads",
    "2",
    "--batch",
    "4",
    "--training-steps",
    "6",
    "--evaluation-steps",
    "8",
    "--validation-tasks",
    "3",
    "--validate-every",
    "1",
    "--threads",
    "1",
    "--network",
    "random",
]


def train_hanna(arguments, note=print, **more):
    return run_train_hanna(arguments, chosen(arguments, SCALES[arguments.scale]), note, **more)


def parsed(add, *words):
    parser = argparse.ArgumentParser()
    add(parser)
    return parser.parse_args([str(w) for w in words])


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """A tiny data set on grids, with features of the untrained encoder that are not computed but drawn."""
    folder = tmp_path_factory.mktemp("line")
    data = build(folder / "data", folder / "cache", ood=1)
    encoder = random_encoder(seed=0)
    rng = np.random.default_rng(0)
    for name in {n for s in data.splits for n in data.names(s)}:
        place = data.place(name)
        features = rng.normal(size=(len(place.graph.positions), 36, encoder.size))
        save_features(
            feature_path(data.folder / "features", encoder.digest, name), features, encoder, place.house.digest
        )
    return data


def test_training_resuming_and_judging_from_the_command_line(data, tmp_path):
    lines = []
    run = lambda updates: train_hanna(
        parsed(learning.add_train_hanna, "--data", data.folder, "--out", tmp_path, *SMALL, "--iterations", updates),
        lines.append,
    )
    assert run(2) == 0
    assert run(3) == 0
    assert any("continuing after update 2" in line for line in lines)
    assert len((tmp_path / "validation.jsonl").read_text().splitlines()) == 3
    said = []
    judge = parsed(
        learning.add_eval,
        "--data",
        data.folder,
        "--agent",
        tmp_path / "best.safetensors",
        "--network",
        "random",
        "--tasks",
        4,
        "--out",
        tmp_path / "table",
        "--threads",
        1,
    )
    assert run_eval(judge, said.append) == 0
    table = (tmp_path / "table" / "table.md").read_text()
    for row in ("random walk", "shortest", "learned", "learned, no ask", "learned, perfect interpretation"):
        assert f"| {row} |" in table
    behaviour = json.loads((tmp_path / "table" / "behaviour.json").read_text(), parse_constant=pytest.fail)
    assert 0 <= behaviour["behaviour"]["test_unseen"]["request share"] <= 1
    assert len(list((tmp_path / "table").glob("episodes_*.jsonl"))) == table.count("| test_unseen |")
    looked, (name,) = looked_at(tmp_path / "table"), data.names("test_unseen")
    assert looked.by("learned", name) == looked.by("learned, no ask", name) == PLAIN, "recordings show what it saw"
    assert (
        looked.by("shortest", name)
        is looked.by("learned", "elsewhere")
        is looked_at(tmp_path).by("learned", "")
        is None
    )
    old = {"looking": ["learned"], "pictures": {name: {"size": 8, "quality": "fast"}}}
    (tmp_path / "run.json").write_text(json.dumps(old))
    seen = looked_at(tmp_path).by("learned", name)
    assert seen is not None and seen.shown_with == "matte", "runs that name no look are older than gloss"


def test_perfect_interpretation_reaches_where_it_is_sent(data, tmp_path):
    """On routes the teacher walks: every sub-task that is departed from is departed from at its target."""
    config = chosen(parsed(learning.add_train_hanna, "--data", ".", "--out", ".", *SMALL), SCALES["mini"])
    bank = split_of(data, "test_unseen", random_encoder(seed=0).digest).bank
    agent = new_agent(config, vocabulary_of(data), bank.digest, bank.size)
    agent.network.eval()
    agent.network.ask_out.bias.data = torch.tensor([-1.0, 1.0])  # it asks whenever it can
    policies = hanna_policies(agent, bank)
    episodes = []
    evaluate(
        data.split("test_unseen"),
        {"p": policies["learned, perfect interpretation"]},
        seed=0,
        batch=4,
        keep=lambda name, played: episodes.extend(played),
    )
    worlds = data.places("test_unseen")
    assert failures(episodes, worlds).departed_wrong == 0.0
    assert request_share(episodes) > 0.2
    assert [p.reason for p in predictions(episodes, worlds)] == ["lost", "uncertain_wrong", "never_asked"]


@pytest.fixture
def study(data, tmp_path):
    """A study of the smallest agents on the hand-made data set, with features of an encoder on disk."""
    save_encoder(random_encoder(seed=1), tmp_path / "encoder.safetensors")
    encoder = load_encoder(tmp_path / "encoder.safetensors")
    for name in {n for s in data.splits for n in data.names(s)}:
        place = data.place(name)
        features = stream(0, "features", name).normal(size=(len(place.graph.positions), 36, encoder.size))
        save_features(
            feature_path(data.folder / "features", encoder.digest, name), features, encoder, place.house.digest
        )
    config = chosen(parsed(learning.add_train_hanna, "--data", ".", "--out", ".", *SMALL), SCALES["mini"])
    config = dataclasses.replace(config, iterations=2)
    return StudySetting(data.folder, tmp_path / "encoder.safetensors", tmp_path / "study", config, tasks=3)


@pytest.fixture
def other(study, tmp_path):
    """The study's data set again, but of another kind of routes and without houses out of distribution."""
    other, encoder = build(tmp_path / "other", tmp_path / "cache", routes="spanning"), load_encoder(study.encoder)
    for name in other.names("test_unseen"):
        place = other.place(name)
        features = stream(3, "features", name).normal(size=(len(place.graph.positions), 36, encoder.size))
        path = feature_path(other.folder / "features", encoder.digest, name)
        save_features(path, features, encoder, place.house.digest)
    return other


def test_a_study_trains_each_agent_once_and_prints_the_dissertation_beside(study):
    lines = []
    written = run_study(study, ["4.5", "4.6"], note=lines.append)
    assert (study.out / "figure_curves.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(p.name for p in (study.out / "agents").iterdir()) == [
        "ask_every_5",
        "final",
        "half_curiosity",
        "lstm",
        "no_ask",
        "no_curiosity",
        "no_curiosity_no_conditions",
        "random_ask",
    ]
    settings = json.loads((study.folder_of("ask every 5") / "settings.json").read_text())
    assert (settings["ask_rule"], settings["alpha"]) == ("every5", 0.5)
    table = written["4.5"].read_text()
    rows = json.loads((study.out / "table_4.5.json").read_text())
    assert [(r["agent"], r["split"]) for r in rows] == [
        (a, s)
        for s in ("test_seen", "test_unseen", "test_ood")
        for a in ("No ask", "Random ask", "Ask every 5", "Learned")
    ]
    assert rows[0]["values"]["requests"]["mean"] == 0.0
    assert "(86.67)" in table and "(45.43)" in table and "3 tasks in 1 houses" in table
    assert "- half curiosity less no ask, test_unseen: success " in table
    assert "success test_ood" in table
    assert (study.out / "figure_D.1.png").stat().st_size > 5_000 and (study.out / "figure_D.2.png").exists()
    once = {v: (study.folder_of(v) / "validation.jsonl").read_text() for v in ("final", "lstm")}
    again = run_study(study, ["4.6"], note=lines.append)
    results = lambda made: made["4.6"].read_text().partition(" Processor time")[0]
    assert results(again) == results(written)
    assert {v: (study.folder_of(v) / "validation.jsonl").read_text() for v in once} == once, "nothing was trained twice"


def test_agents_that_are_compared_differ_in_one_setting(study):
    settings = lambda name: dataclasses.asdict(study.config_of(name))
    for table in module.TABLES.values():
        for pair in table.compared:
            a, b = map(settings, pair)
            assert len([k for k in a if a[k] != b[k]]) == 1, pair


def test_a_row_of_several_seeds_is_the_mean_of_their_agents(study):
    several = dataclasses.replace(study, seeds=2)
    written = run_study(several, ["4.4"])
    assert (several.folder_of("final", 0) / "best.safetensors").exists()
    assert (several.folder_of("final", 1) / "best.safetensors").exists()
    rows = json.loads((several.out / "table_4.4.json").read_text())
    learned = next(r for r in rows if r["agent"].startswith("+") and r["split"] == "test_unseen")
    assert learned["episodes"] == 6 and "seeds 0, 1" in written["4.4"].read_text()


def test_agents_are_judged_in_houses_drawn_in_other_ways(study, data):
    run_study(study, ["4.4"])
    arms = {"all": [study.folder_of("final") / "best.safetensors"] * 2}
    arms["pictures only"] = [study.folder_of("target image only") / "best.safetensors"]
    setting = RealismSetting(data.folder, study.out / "realism", arms, ("unlit", "matte"), "test_unseen", tasks=3)
    with pytest.raises(FileNotFoundError, match="embodied features --quality matte"):
        realism(setting)
    encoder, (name,) = load_encoder(study.encoder), data.names("test_unseen")
    place = data.place(name)
    features = stream(1, "features", name).normal(size=(len(place.graph.positions), 36, encoder.size))
    path = feature_path(data.folder / "features", encoder.digest, name, WAYS["matte"])
    save_features(path, features, encoder, place.house.digest, WAYS["matte"])
    text = realism(setting).read_text()
    assert "| all | 2 | " in text and "rank correlation with matte | 3 |" in text and "fast_192" in text
    assert "3 tasks in 1 houses" in text
    first = dataclasses.replace(setting, houses=1, out=study.out / "first")
    assert first.names(data) == (name,) and realism(first).read_text() == text, "there is but one house"
    kept = {p: p.stat().st_mtime_ns for p in (setting.out / "episodes").iterdir()}
    assert len(kept) == 4 and (setting.out / "figure_realism.png").exists()
    path.unlink()
    assert realism(setting).read_text() == text, "what was played is not played again"
    assert {p: p.stat().st_mtime_ns for p in (setting.out / "episodes").iterdir()} == kept


def test_agents_may_look_through_an_encoder_that_sees_alike(study, data, tmp_path):
    run_study(study, ["4.4"])
    encoder, (name,) = load_encoder(study.encoder), data.names("test_unseen")
    alike = dataclasses.replace(random_encoder(seed=2), like=encoder.digest)
    save_encoder(alike, tmp_path / "alike.safetensors")
    arms = {"a": [study.folder_of("final") / "best.safetensors"]}
    setting = RealismSetting(
        data.folder, study.out / "realism", arms, ("matte",), tasks=3, encoders={"a": [tmp_path / "alike.safetensors"]}
    )
    with pytest.raises(FileNotFoundError, match=alike.digest[:16]):
        realism(setting)
    place = data.place(name)
    features = stream(2, "features", name).normal(size=(len(place.graph.positions), 36, encoder.size))
    path = feature_path(data.folder / "features", alike.digest, name, WAYS["matte"])
    save_features(path, features, alike, place.house.digest, WAYS["matte"])
    assert "| a | 1 | " in realism(setting).read_text()
    with pytest.raises(ValueError, match="encoders are given for"):
        dataclasses.replace(setting, encoders={"b": [study.encoder]})


def test_each_agent_may_look_through_an_encoder_of_its_own(tmp_path):
    a, b, x, y = (tmp_path / n for n in "abxy")
    through = lambda **encoders: RealismSetting(tmp_path, tmp_path, {"k": [a, b]}, ("fast",), encoders=encoders)
    assert through().watched("k") == [(a, None), (b, None)]
    assert through(k=[x]).watched("k") == [(a, x), (b, x)]
    assert through(k=[x, y]).watched("k") == [(a, x), (b, y)]
    with pytest.raises(ValueError, match="'k' has 2 agents and 3 encoders"):
        through(k=[x, y, x])


def test_a_study_may_begin_with_a_trained_agent(study):
    run_study(study, ["4.4"])
    begin = study.folder_of("final") / "best.safetensors"
    config = dataclasses.replace(study.config, learning_rate=1e-12, seed=5)
    again = dataclasses.replace(study, out=study.out.parent / "again", config=config, begin=begin)
    text = run_study(again, ["4.4"])["4.4"].read_text()
    gone_on = load_agent(again.folder_of("final") / "best.safetensors").network.state_dict()
    first = load_agent(begin).network.state_dict()
    assert all(torch.allclose(gone_on[k].float(), v.float(), atol=1e-6) for k, v in first.items())
    assert "begun with best.safetensors" in text


def test_what_a_study_played_is_not_played_again(study):
    written = run_study(study, ["4.4"])["4.4"].read_text()
    kept = {p: p.stat().st_mtime_ns for p in (study.out / "episodes").iterdir()}
    again = run_study(study, ["4.4"])["4.4"].read_text()
    assert again.partition(" Processor time")[0] == written.partition(" Processor time")[0]
    assert {p: p.stat().st_mtime_ns for p in (study.out / "episodes").iterdir()} == kept and len(kept) >= 4
    first = next(iter(load_lines(min(kept), Episode)))
    assert first.agent in ("final, seed 0, learned", "target image only, seed 0, learned")


def test_rank_correlation_is_spearmans():
    assert rank_correlation([0.1, 0.5, 0.3, 0.4], [0.2, 0.3, 0.1, 0.6]) == pytest.approx(1 - 6 * 4 / (4 * 15))
    assert math.isnan(rank_correlation([0.1, 0.5], [0.2, 0.3])) and math.isnan(rank_correlation([1] * 3, [1, 2, 3]))


def test_requests_are_bought_by_three_kinds_of_rule(study):
    written = run_study(study, ["requests"])
    rows = {
        r["agent"]: r["values"]["requests"]["mean"] for r in json.loads((study.out / "table_requests.json").read_text())
    }
    assert len(rows) == 20 and rows["every 2"] > rows["every 20"] and rows["with 0.6"] > rows["with 0.03"]
    assert {study.config_of(v).ask_price for v in module.PRICES} == {0.25, 4.0} and "trained at price 4" in rows
    assert (
        rows["above 0.1"] >= rows["above 0.9"] and "requests: Success and the number" in written["requests"].read_text()
    )
    assert (study.out / "figure_requests.png").stat().st_size > 5_000


def test_a_study_of_houses_takes_the_numbers_that_there_are(study, monkeypatch):
    monkeypatch.setitem(module.VARIANTS, "8 houses", {"training_houses": 1})  # of the two of the hand-made data set
    written = run_study(study, ["houses"])
    rows = json.loads((study.out / "table_houses.json").read_text())
    assert [r["agent"] for r in rows if r["split"] == "test_unseen"] == [
        "8 houses",
        "all houses",
        "8 houses, equal passes",
        "8 houses, without a trail",
        "all houses, without a trail",
    ]
    table = written["houses"].read_text()
    assert "- final less 8 houses, test_unseen: success " in table and "32 houses" not in table
    assert "drawn unlit_192, those of training unlit_192" in table and "dissertation's numbers" not in table
    hours = re.search(r"Processor time: ([\d.]+) hours to train, ([\d.]+) to judge", table)
    assert hours and float(hours[1]) < 1
    assert sorted(p.name for p in (study.out / "agents").iterdir()) == ["8_houses", "8_houses_equal_passes", "final"]
    long, short = study.config_of("8 houses"), study.config_of("8 houses, equal passes")
    assert (long.iterations, short.iterations) == (2, 1) and short.training_houses == 1


def test_agents_may_be_judged_in_the_unseen_houses_of_another_data_set(study, other, tmp_path):
    there = dataclasses.replace(study, judged_in=other.folder)
    written = run_study(there, ["4.5"])["4.5"].read_text()
    rows = json.loads((study.out / f"judged_in_{other.digest[:16]}" / "table_4.5.json").read_text())
    assert not (study.out / "table_4.5.json").exists(), "where those of the study's own houses go"
    assert {r["split"] for r in rows} == {"test_unseen"}, "nobody has seen its houses, and none are out of distribution"
    assert f"of the data set {other.digest[:16]}, not that of training" in written
    assert "(45.43)" in written and "(86.67)" not in written, "the printed numbers are those of unseen houses"
    names = {e.task.id for p in (study.out / "episodes").iterdir() for e in load_lines(p, Episode)}
    assert names <= {t.id for t in other.tasks("test_unseen")}
    for name in other.names("test_unseen"):
        feature_path(other.folder / "features", load_encoder(study.encoder).digest, name).unlink()
    with pytest.raises(FileNotFoundError, match=f"embodied features.*{other.folder}|{other.folder}.*embodied features"):
        run_study(dataclasses.replace(there, out=tmp_path / "again"), ["4.5"])


def test_some_rows_of_a_study_may_be_had_alone(study):
    written = run_study(study, ["4.4", "requests"], rows=["target image only", "price 4"])
    text = written["4.4"].read_text()
    assert "| Target image only |" in text and "| + language instruction |" not in text and " less " not in text
    assert "Not run: final." in text
    assert sorted(p.name for p in (study.out / "agents").iterdir()) == ["price_4", "target_image_only"]
    assert "| trained at price 4 |" in written["requests"].read_text()
    with pytest.raises(ValueError, match=r"rows \['lstm'\] leave nothing of \['4.4'\]"):
        run_study(study, ["4.4", "4.6"], rows=["lstm"])
    with pytest.raises(ValueError, match=r"unknown rows of these tables \['lstms'\]; there are \['lstm', "):
        run_study(study, ["4.6"], rows=["final", "lstms"])
    with pytest.raises(ValueError, match=r"unknown rows .*\['256 houses'\]; there are \['final'\]"):
        run_study(study, ["houses"], rows=["256 houses"])


def test_processor_time_is_counted_over_sessions_and_kept(study):
    short = dataclasses.replace(study, config=dataclasses.replace(study.config, iterations=1))
    lessons = Lessons(dataset_of(study.data, "hanna"), load_encoder(study.encoder))
    used = [train_agent(lessons, s.config, study.out / "run", note=print).processor for s in (short, study, study)]
    assert 0 < used[0] < used[1] and used[0] < used[2], "sessions add up, and what is done is not forgotten"
    old = study.out / "run" / "checkpoint.pt"
    body = torch.load(old, weights_only=True)
    body["progress"].pop("processor")
    torch.save(body, old)
    assert train_agent(lessons, study.config, study.out / "run", note=print).processor is None, "the first part is lost"
    cost = ProcessorTime(study.out / "judging.json")
    cost.trained("final", 3600)
    cost.trained("final", 1800)
    cost.judged({"a": 720, "b": 360})
    again = ProcessorTime(study.out / "judging.json")
    again.judged({"a": 0.1, "c": 180})  # a was found played
    again.trained("final", None)
    assert cost.hours(["final"], ["a"]) == (1.5, 0.2)
    assert again.hours([], "abc") == (0.0, pytest.approx(0.35)) and again.hours(["final"], []) is None


def test_a_study_of_lightings_says_how_to_light_the_houses(study):
    assert study.config_of("3 lightings").lights == 3 and study.config_of("final").lights == 1
    with pytest.raises(FileNotFoundError, match="@1.safetensors does not exist; .*embodied features --lights 3"):
        run_study(study, ["lights"])


def test_missing_features_are_told_before_anything_is_trained(study, data):
    last = data.names(data.ood[0])[0]
    feature_path(data.folder / "features", load_encoder(study.encoder).digest, last).unlink()
    with pytest.raises(FileNotFoundError, match=f"{last}.*embodied features"):
        run_study(study, ["4.4"])
    assert not (study.out / "agents").exists()


def test_an_unknown_study_is_refused_before_anything_is_trained(study):
    with pytest.raises(ValueError, match="unknown studies"):
        run_study(study, ["5.1"])
    assert not study.out.exists()


def test_fewer_training_houses_mean_fewer_tasks_and_words(data):
    encoder = random_encoder(seed=0)
    some, every = (split_of(data, "train", encoder.digest, houses=n) for n in (1, None))
    assert {t.world for t in some.tasks} == {data.names("train")[0]}
    assert 0 < len(some.tasks) < len(every.tasks)
    assert len(vocabulary_of(data, 1).words) <= len(vocabulary_of(data).words)


def test_missing_features_and_wrong_rows_are_named(data, tmp_path):
    arguments = parsed(learning.add_train_hanna, "--data", data.folder, "--out", tmp_path, *SMALL[:-2])
    if SHIPPED.exists():
        with pytest.raises(FileNotFoundError, match="embodied features"):
            train_hanna(arguments, lambda line: None)
    words = ("--data", data.folder, "--encoder", _empty(tmp_path), "--network")
    with pytest.raises(SystemExit):
        parsed(learning.add_features, *words, "resnet1")
    with pytest.raises(ValueError, match="not the weights of resnet18"):
        encoder_of(parsed(learning.add_features, *words, "resnet18"))


def _empty(folder):
    path = folder / "weights.pth"
    torch.save({}, path)
    return path


def test_a_data_set_of_another_kind_of_task_is_refused_with_the_command_that_makes_the_right_one(data):
    assert dataset_of(data.folder, "hanna").digest == data.digest
    with pytest.raises(ValueError, match="is a data set of 'hanna', a learner of 'vnla' needs .*dataset vnla --out"):
        dataset_of(data.folder, "vnla")


def test_the_shipped_encoder_and_agent_are_small_and_fit_each_other():
    encoder, agent = load_encoder(), load_agent()
    assert agent.encoder_digest == encoder.speaks
    assert agent.feature_size == encoder.size
    assert sum(p.stat().st_size for p in WEIGHTS.iterdir()) < 15e6
    look = encoder.encode_strips(np.zeros((1, 192, 576, 3), np.uint8))
    assert look.shape == (1, 36, encoder.size) and np.isfinite(look).all()
