"""What all learners' settings share is said and checked in one place."""

from __future__ import annotations

import dataclasses
import math

import pytest

from embodied.agents.common.settings import RunSettings, ValidatedRunSettings
from embodied.agents.learners.bandit import BanditConfig
from embodied.agents.learners.hanna import TrainingConfig
from embodied.agents.learners.hari import ExecutionConfig, IntentionConfig
from embodied.agents.learners.vnla import VnlaSettings
from embodied.agents.vision.config import VisionConfig

VALIDATED = (TrainingConfig(), ExecutionConfig(), IntentionConfig(), VnlaSettings())
RUNS = (*VALIDATED, BanditConfig())
ALL = (*RUNS, VisionConfig())


@pytest.mark.parametrize("settings", ALL, ids=lambda s: type(s).__name__)
def test_no_learner_takes_a_number_that_it_cannot_learn_with(settings):
    """A field by the same name is checked alike, whichever learner's it is."""
    refused = {
        "batch": (0,),
        "learning_rate": (0.0, -1.0, math.nan, math.inf),
        "clip": (0.0, math.nan),
        "iterations": (0,),
        "validate_every": (0,),
        "validation_tasks": (0,),
        "checkpoint_minutes": (0.0, math.nan),
        "dropout": (1.0, -0.1, math.nan),
        "cooldown": (1.1, math.nan),
    }
    named = {f.name for f in dataclasses.fields(settings)} & set(refused)
    assert "batch" in named
    for name in named:
        for value in refused[name]:
            with pytest.raises(ValueError, match=name):
                dataclasses.replace(settings, **{name: value})


def test_learners_share_the_records_of_runs():
    assert all(isinstance(s, ValidatedRunSettings) for s in VALIDATED) and all(isinstance(s, RunSettings) for s in RUNS)
    for settings in RUNS:
        again = {f.name for f in dataclasses.fields(RunSettings)} & set(vars(type(settings)).get("__annotations__", {}))
        said = {f.name: f.default for f in dataclasses.fields(RunSettings)}
        assert all(getattr(type(settings), name) != said[name] for name in again), "said twice, with the same default"
