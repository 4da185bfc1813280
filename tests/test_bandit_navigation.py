"""Navigation from ratings: what is credited for a rating, by hand, and that stars alone teach to walk."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from hand_worlds import grid_world

from agents.bandit import navigation
from agents.bandit.navigation import (
    Decided,
    StateCritic,
    decision_log_probability,
    fingerprint,
    learn_from_stars,
    rated,
    score_of,
    shortest_path,
)
from agents.bandit.rating_config import RatingConfig
from agents.bandit.ratings import CLEAN, Rater
from agents.bandit.stars_study import StarsStudy, raters, rise
from agents.common.actor_critic import advantages
from agents.common.checkpoint import CheckpointError, read_checkpoint
from agents.common.vocabulary import build_vocabulary
from agents.hanna.agent import HannaAbout, HannaAgent
from agents.hanna.training_config import SCALES
from agents.studies.engine import run_study
from agents.vision.bank import FeatureBank
from agents.vision.lessons import Split
from embodied.action_spaces import PanoramicMoves
from embodied.assistants.anna import Anna
from embodied.assistants.route_system import build_routes
from embodied.envs.hanna import HannaEnv
from embodied.evaluation.rollout import play
from embodied.interface import Ask, Intention, Move, Stop
from embodied.language.plain import PlainLanguage
from embodied.policies.baselines import Shortest
from embodied.tasks.hanna import hanna_pool, hanna_task

torch.set_num_threads(1)
SIDE = 4
TINY = dataclasses.replace(
    SCALES["mini"],
    hidden_size=32,
    navigation_embedding=32,
    ask_embedding=8,
    self_heads=2,
    text_heads=2,
    instruction_length=40,
    training_steps=6,
)
STARS = RatingConfig(updates=3, batch=6, steps=6, learning_rate=3e-3, critic_updates=1)
silent = lambda line: None


@pytest.fixture(scope="module")
def split() -> Split:
    """A grid with people and routes, and features that tell its nodes apart."""
    world = grid_world(SIDE, name="grid")
    routes = build_routes(world, seed=3, language=PlainLanguage(), house_split="test")
    pool = hanna_pool(world, seed=3)
    tasks = [hanna_task(pool, i, seed=3, language=PlainLanguage()) for i in range(min(20, len(pool)))]
    anna = Anna({"grid": world.graph}, {"grid": routes}, split="test")
    bank = FeatureBank({"grid": np.random.default_rng(0).normal(size=(SIDE * SIDE, 36, 16))}, "tests")
    return Split({"grid": world}, tasks, lambda: HannaEnv({"grid": world}, anna, PanoramicMoves()), bank)


def agent_for(split: Split) -> HannaAgent:
    words = build_vocabulary([t.request for t in split.tasks])
    return HannaAgent.new(
        HannaAbout(config=TINY, encoder=split.bank.digest, feature_size=split.bank.size, words=words.words)
    )


class Seen:
    """As much of an observation as a decision needs."""

    def __init__(self, *can_ask: Intention) -> None:
        self.can_ask = can_ask


def test_a_decision_is_whether_to_ask_and_where_to_go_if_not():
    moves = torch.log(torch.tensor([[0.5, 0.3, 0.2]] * 4))
    asks = torch.log(torch.tensor([[0.75, 0.25]] * 4))
    decisions = [
        (Seen(), Move(1)),  # nobody to ask: only the move counts
        (Seen(Intention.HELP), Move(0)),  # did not ask, and moved
        (Seen(Intention.HELP), Ask(Intention.HELP)),  # asked: no move was made
        (Seen(Intention.HELP), Stop()),
    ]
    wanted = [0.2, 0.75 * 0.3, 0.25, 0.75 * 0.5]
    assert decision_log_probability(moves, asks, decisions).exp().tolist() == pytest.approx(wanted)


def test_steps_of_episodes_that_end_apart_stay_with_their_rating():
    critic = StateCritic(2)
    for p in critic.parameters():
        torch.nn.init.zeros_(p)
    log_p = [torch.tensor([-1.0, -2.0], requires_grad=True), torch.tensor([-3.0], requires_grad=True)]
    found = rated(
        [Decided((0, 1), log_p[0], torch.ones(2, 2)), Decided((1,), log_p[1], torch.ones(1, 2))], critic, [0.25, 1.0]
    )
    assert found.log_probabilities.tolist() == [[-1.0, 0.0], [-2.0, -3.0]]
    assert found.mask.tolist() == [[True, False], [True, True]]
    assert advantages(found).tolist() == [[0.25, 0.0], [1.0, 1.0]]
    found.log_probabilities.sum().backward()
    assert log_p[0].grad.tolist() == [1.0, 1.0] and log_p[1].grad.tolist() == [1.0]


def test_the_shortest_walk_gets_the_best_score(split):
    graph = split.worlds["grid"].graph
    for episode in play(split.make_env, Shortest(), split.tasks[:5], seed=0):
        assert score_of(episode, graph, "success") == 1.0
        assert score_of(episode, graph, "nDTW") == pytest.approx(1.0)
        away = dataclasses.replace(episode, steps=episode.steps[:0])
        path = shortest_path(graph, episode.task.start.node, episode.nodes[-1])
        far = math.fsum(float(graph.distance[path[0], v]) for v in path)
        assert score_of(away, graph, "nDTW") == pytest.approx(math.exp(-far / (3 * len(path))))
        assert score_of(episode, graph, "SDTW") == pytest.approx(1.0)
        assert score_of(away, graph, "SDTW") == 0.0 or score_of(away, graph, "success") == 1.0


@pytest.mark.slow
def test_stars_alone_teach_to_walk(split, tmp_path):
    # nDTW tells failing walks apart: who knows nothing yet reaches the goal too seldom to learn from that alone
    config = dataclasses.replace(STARS, updates=40, batch=16, learning_rate=3e-3, critic_updates=3, score="nDTW")
    found = learn_from_stars(
        agent_for(split), split, Rater(granularity=4), config, tmp_path, begun_with="", note=silent
    )
    first, last = np.mean([h["score"] for h in found[:8]]), np.mean([h["score"] for h in found[-8:]])
    assert last > first + 0.05
    assert all(h["rating"] * 64 == pytest.approx(round(h["rating"] * 64)) for h in found)  # sixteen ratings in quarters


@pytest.mark.slow
def test_a_killed_run_goes_on_exactly(split, tmp_path, monkeypatch):
    whole, parts = agent_for(split), agent_for(split)
    before = fingerprint(whole)
    learn_from_stars(whole, split, Rater(variance=1), STARS, tmp_path / "whole", begun_with=before, note=silent)
    assert fingerprint(whole) != before
    short = dataclasses.replace(STARS, updates=2)
    learn_from_stars(parts, split, Rater(variance=1), short, tmp_path / "parts", begun_with=before, note=silent)
    again = agent_for(split)
    found = learn_from_stars(again, split, Rater(variance=1), STARS, tmp_path / "parts", begun_with=before, note=silent)
    assert fingerprint(again) == fingerprint(whole)
    assert found == read_checkpoint(tmp_path / "whole" / "checkpoint.pt")["history"]
    with pytest.raises(CheckpointError, match="begin"):
        learn_from_stars(again, split, Rater(variance=1), STARS, tmp_path / "parts", begun_with="other", note=silent)


def test_while_the_critic_learns_alone_the_agent_stays_as_it_was(split, tmp_path):
    agent = agent_for(split)
    before = fingerprint(agent)
    learn_from_stars(
        agent, split, CLEAN, dataclasses.replace(STARS, critic_updates=3), tmp_path, begun_with=before, note=silent
    )
    assert fingerprint(agent) == before


def test_a_rise_is_the_last_quarter_less_the_updates_before_anything_is_learned():
    assert rise([0.1, 0.3, 0.9, 0.2, 0.3, 0.4, 0.5, 0.5], untaught=2) == pytest.approx(50.0 - 20.0)


def test_raters_are_named_by_their_one_fault():
    known = raters()
    assert known["clean"] == CLEAN
    assert known["granularity 4"] == Rater(granularity=4) and isinstance(known["granularity 4"].granularity, int)
    assert known["skew 0.25"] == Rater(skew=0.25)


def test_settings_are_checked():
    with pytest.raises(ValueError, match="score must be one of"):
        RatingConfig(score="stars")
    with pytest.raises(ValueError, match="decisions must be one of"):
        StarsStudy(Path("data"), (0,), agent=Path("agent"), encoder=None, config=STARS, decisions="best")
    assert navigation.StateCritic(4)(torch.zeros(3, 2, 4)).shape == (3, 2)


@pytest.mark.slow
def test_a_study_learns_judges_and_writes_once(split, tmp_path, monkeypatch):
    agent_for(split).save(tmp_path / "agent.safetensors")
    data = SimpleNamespace(digest="d", names=lambda name: [name], split=lambda name: SimpleNamespace(**vars(split)))
    monkeypatch.setattr("agents.bandit.stars_study.dataset_of", lambda *_: data)
    monkeypatch.setattr(StarsStudy, "_split", lambda self, name: split)
    for module in ("bandit.stars_study", "studies.episodes"):
        monkeypatch.setattr(f"agents.{module}.Dataset", lambda _: data)
    study = StarsStudy(tmp_path, (0, 1), 8, (0,), agent=tmp_path / "agent.safetensors", encoder=None, config=STARS)
    study = dataclasses.replace(study, rater=Rater(granularity=4, skew=2.0))
    monkeypatch.setattr(StarsStudy, "about", lambda self: "Stars.")
    wanted = ["people", "granularity 4"]
    text = run_study(study, ["stars"], tmp_path / "out", rows=wanted, note=silent)["stars"].read_text()
    assert "| people |" in text and "| granularity 4 |" in text and "granularity 1" in text.partition("Not run: ")[2]
    assert (tmp_path / "out/stars-stars.png").exists()
    made = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").rglob("*.safetensors")}
    assert len(made) == 4
    run_study(study, ["stars"], tmp_path / "out", rows=["people"], note=silent)
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "out").rglob("*.safetensors")} == made
