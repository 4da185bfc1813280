"""NAV as its commands run it, on a data set made by hand: data, teacher, students, a study, one episode shown."""

from __future__ import annotations

import dataclasses

import pytest
import torch
from hand_data import COMPACT, built, noise_features, small_house

from embodied.agents.common.weights import CheckpointError
from embodied.agents.iliad.nav.run import NavSetup, load_follower
from embodied.agents.iliad.nav.teacher import GrammarNavTeacher
from embodied.agents.iliad.study import IliadStudy
from embodied.agents.iliad.training import train
from embodied.agents.learners.iliad import LearnerConfig, NavConfig
from embodied.agents.studies.engine import run_study
from embodied.cli import main
from embodied.datasets.store import Dataset
from embodied.interface import Sight
from embodied.language.plain_language import PlainLanguage

pytestmark = pytest.mark.slow

SMALL = NavConfig(
    hidden_size=16, heads=2, candidates=2, executor_iterations=2, describer_iterations=2, teacher_batch=4,
    dropout=0.1, environment_dropout=0.1, progress_weight=0.5, room_weight=0.5, guided=0.5,
)  # fmt: skip
QUICK = LearnerConfig(iterations=4, batch=4, validate_every=2, checkpoint_minutes=1e-9, threshold=0.3)
silent = lambda line: None


@pytest.fixture(scope="module")
def source(tmp_path_factory) -> NavSetup:
    """Grids of 16 nodes whose features are noise."""
    data = built(tmp_path_factory.mktemp("vln") / "data", "vln", make_house=small_house)
    return NavSetup(SMALL, data.folder, noise_features(data).digest, None, tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def grounds(source, tmp_path_factory):
    """With a learned teacher, hardly trained."""
    return source.prepare(tmp_path_factory.mktemp("shared"), silent)


def test_houses_to_validate_and_to_test_in_are_nobodys_to_learn_from(grounds):
    splits, data = grounds.data.splits, grounds.data.source
    assert splits["train"] and splits["validation"] and splits["test"]
    for part, name in (("train", "train"), ("validation", "val_unseen"), ("test", "test_unseen")):
        assert {t.world for t in splits[part]} == set(data.names(name))
    assert all(len(t.requests) == 1 for part in ("validation", "test") for t in splits[part])
    asked = {r.instruction for name in data.names("train") for r in data.routes(name)}
    assert {r for t in splits["train"] for r in t.requests} == asked


def test_more_paths_are_others_worded_once_and_kept(grounds, source, monkeypatch):
    """Said plainly here: houses made by hand hold nothing that people have words for."""
    monkeypatch.setattr("embodied.agents.vln.study.load_catalogue", lambda cache: None)
    monkeypatch.setattr("embodied.agents.vln.study.People", PlainLanguage)
    monkeypatch.setattr(Dataset, "open_world", lambda self, name, catalogue, cache: self.place(name))
    more = dataclasses.replace(source, config=dataclasses.replace(SMALL, more_paths=7))
    found, few = more.data().splits, grounds.data.splits
    assert found["validation"] == few["validation"] and found["test"] == few["test"]
    added = [t for t in found["train"] if t not in few["train"]]
    assert len(added) == 7 * len({t.world for t in few["train"]}) and all(len(t.requests) == 3 for t in added)
    known = {(t.world, t.path) for t in few["train"]}
    assert not known & {(t.world, t.path) for t in added}
    monkeypatch.delattr(Dataset, "open_world")
    assert more.data().splits["train"] == found["train"]
    assert len(list((source.cache / "paths").iterdir())) == len({t.world for t in few["train"]})


@pytest.mark.parametrize("learner", ["adel", "dagger", "binary"])
def test_a_run_is_kept_resumed_and_loaded(grounds, tmp_path, learner):
    """A run that was stopped after every update ends with what it finds in one go, to the last bit."""
    config = dataclasses.replace(QUICK, learner=learner)
    learn = lambda config, name, **how: train(
        grounds.problem(0, tmp_path, silent), config, tmp_path / name, note=silent, **how
    )
    expected = learn(config, "whole")
    for _ in range(QUICK.iterations):
        cut = learn(config, "cut", minutes=1e-9)
    assert cut == expected and len(expected) == 2
    (one,), (other,) = ((tmp_path / k).rglob("checkpoint.pt") for k in ("whole", "cut"))
    a, b = (torch.load(p, weights_only=True)["parts"]["student"] for p in (one, other))
    assert all(torch.equal(a[k], b[k]) for k in a)
    (best,) = (tmp_path / "whole").rglob("best.safetensors")
    student = load_follower(best, grounds.data.eyes)
    assert student.config == SMALL and student.eyes.vocabulary == grounds.data.eyes.vocabulary
    with pytest.raises(CheckpointError, match="batch"):
        learn(dataclasses.replace(config, batch=5), "cut")


def test_the_grammar_teaches_without_training(source, tmp_path, monkeypatch):
    monkeypatch.setattr("embodied.agents.iliad.nav.run.seen_places", lambda data, cache: {})
    setup = dataclasses.replace(source, config=dataclasses.replace(SMALL, teacher="grammar"))
    assert isinstance(setup.prepare(tmp_path, silent).teacher, GrammarNavTeacher) and not any(tmp_path.iterdir())


def test_a_study_has_a_blind_row_and_chance(source, tmp_path):
    study = IliadStudy(source, QUICK, (0,))
    rows = ["DAgger", "DAgger, blind", "chance: a random shortest path of 2 to 6 edges"]
    text = run_study(study, ["3.4"], tmp_path, rows=rows, note=silent)["3.4"].read_text()
    assert all(f"| {row} | " in text for row in rows)
    best = {p.parent.name.partition("_seed")[0]: p for p in tmp_path.rglob("best.safetensors")}
    names, eyes = ("learner_dagger", "blind_True_learner_dagger"), source.data().eyes
    seeing, blind = (load_follower(best[name], eyes) for name in names)
    assert blind.config.blind and not seeing.config.blind
    assert not blind.eyes.bank.gather([Sight(next(iter(eyes.places)), 0)]).any()


def test_commands_train_and_show(source, tmp_path, capsys):
    fixed = ("teacher", "blind")
    sizes = [f"--{k.replace('_', '-')}={v}" for k, v in vars(SMALL).items() if k not in fixed]
    where = ["--data", str(source.folder), "--cache", str(source.cache), "--encoder", str(COMPACT)]
    out = ["--out", str(tmp_path), "--iterations=2", "--batch=4"]
    assert main(["train", "iliad", "nav", *where, *out, *sizes]) == 0
    (best,) = tmp_path.rglob("best.safetensors")
