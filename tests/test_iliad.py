"""ILIAD by hand: Eq 3.9 to 3.16 as they are computed here, the losses of Algorithm 9, DAgger and REINFORCE."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from embodied.agents.common.session import descend
from embodied.agents.iliad.protocol import (
    ExecutionScores,
    RequestBatch,
    adel,
    adel_loss,
    dagger,
    reinforce,
    reinforce_loss,
)
from embodied.agents.iliad.training import IliadProblem, episodes_to, success_rate, train
from embodied.agents.learners.iliad import LearnerConfig, mixing_at
from embodied.seeds import stream

silent = lambda line: None


# A bandit: H = 1, as in the theory of appendix B ---------------------------------------------------


@dataclass(frozen=True)
class Wish:
    """Press button `button`."""

    button: int

    @property
    def requests(self) -> tuple[str]:
        return (str(self.button),)


class Buttons:
    """Four buttons; a description names the one that was pressed."""

    def success(self, task: Wish, execution: int) -> bool:
        return task.button == execution

    def reward(self, task: Wish, execution: int) -> float:
        return 1 - abs(task.button - execution) / 3

    def demonstrate(self, task: Wish, execution: int) -> int:
        return task.button


class Watcher:
    """P_T(d | e): says which button it was; has nothing to say of those in `dumb`."""

    def __init__(self, dumb: tuple[int, ...] = ()) -> None:
        self.dumb = dumb

    def describe(self, tasks, executions, *, rng: np.random.Generator) -> list[str | None]:
        return [None if e in self.dumb else str(e) for e in executions]


class AnyButton:
    """P_omega: uniform."""

    def draw(self, tasks, *, rng: np.random.Generator) -> list[int]:
        return [int(i) for i in rng.integers(4, size=len(tasks))]


class Presser:
    """A table of logits: one row per description, the fifth for the empty one."""

    def __init__(self, seed: int = 0) -> None:
        self.table = nn.Embedding(5, 4)
        with torch.no_grad():
            self.table.weight.copy_(torch.from_numpy(stream(seed, "presser").normal(size=(5, 4))) * 0.1)

    @property
    def network(self) -> nn.Module:
        return self.table

    def logits(self, requests) -> Tensor:
        return self.table(torch.tensor([int(r) if r else 4 for r in requests]))

    def sample(self, tasks, requests, *, rng: np.random.Generator) -> list[int]:
        chances = self.logits(requests).detach().double().softmax(-1).numpy()
        return [int(rng.choice(4, p=p / p.sum())) for p in chances]

    def greedy(self, tasks, requests) -> list[int]:
        return self.logits(requests).argmax(-1).tolist()

    def rollout_for_dagger(self, tasks, requests, *, rng) -> list[int]:
        return self.greedy(tasks, requests)

    def scores(self, tasks, requests, executions, actions=None) -> ExecutionScores:
        logs = self.logits(requests).log_softmax(-1)
        taken = torch.tensor(list(executions if actions is None else actions))
        entropy = -(logs.exp() * logs).sum(-1, keepdim=True)
        return ExecutionScores(logs.gather(1, taken[:, None]), entropy, torch.ones(len(taken), 1, dtype=torch.bool))


def flat(*rows: list[float]) -> Presser:
    """A presser with these probabilities for the descriptions "0", "1", ...; uniform for the others."""
    made = Presser()
    with torch.no_grad():
        made.table.weight.zero_()
        for k, row in enumerate(rows):
            made.table.weight[k] = torch.tensor(row).log()
    return made


WISHES = [Wish(k) for k in range(4)]


def test_losses_of_algorithm_9_by_hand():
    student, explorer = flat([0.5, 0.25, 0.125, 0.125]), flat([0.25, 0.25, 0.25, 0.25])
    # pi_beta did button 1, which was described as "0" (a teacher may err); the marginal gave button 2
    loss = adel_loss([Wish(3)], [1], ["0"], [2], explorer, student, mixing=0.25)
    by_hand = -math.log(0.25) - 0.25 * math.log(0.25) - 0.75 * math.log(0.25)
    assert float(loss.detach()) == pytest.approx(by_hand)


@pytest.mark.parametrize(("mixing", "moves"), [(0.0, False), (0.5, True), (1.0, True)])
def test_without_a_description_only_the_marginal_is_learned(mixing, moves):
    student, explorer = Presser(0), Presser(1)
    loss = adel_loss([Wish(3)], [1], [None], [2], explorer, student, mixing)
    loss.backward()
    of_student, of_explorer = student.table.weight.grad, explorer.table.weight.grad
    assert not of_student.abs().any(), "pi_theta learns from descriptions alone"
    assert bool(of_explorer is not None and of_explorer[4].abs().any()) == moves, "with the empty description"


def test_reinforce_by_hand():
    logs = torch.tensor([[-1.0, -2.0], [-0.5, 0.0]], requires_grad=True)
    mask = torch.tensor([[True, True], [True, False]])
    scores = ExecutionScores(logs, torch.tensor([[0.6, 0.2], [0.4, 9.0]]), mask)
    loss = reinforce_loss(scores, [1.0, 0.0], baseline=0.25, entropy=0.1)
    by_hand = ((1 - 0.25) * (1 + 2) + (0 - 0.25) * 0.5) / 2 - 0.1 * (0.6 + 0.2 + 0.4) / 2
    assert float(loss.detach()) == pytest.approx(by_hand)
    loss.backward()
    assert logs.grad[1, 1] == 0, "nothing behind the end of an execution is learned"


def test_the_baseline_is_the_mean_of_all_rewards_this_batch_included():
    student, reward = flat([0.25] * 4), lambda task, execution: 0.0
    lesson = reinforce(RequestBatch([Wish(0)], ["0"], stream(0, "r")), reward, student, 0.0, (3.0, 3))
    assert lesson.rewards == [0.0]
    assert lesson.loss.item() == pytest.approx((0 - 3 / 4) * math.log(4))


def test_dagger_shows_the_best_action_in_states_that_the_student_came_to():
    student = flat([0.1, 0.7, 0.1, 0.1])
    lesson = dagger(RequestBatch([Wish(0)], ["0"], stream(0, "d")), Buttons(), student)
    assert list(lesson.executions) == [1] and lesson.loss.item() == pytest.approx(-math.log(0.1))
    lesson.loss.backward()
    assert student.table.weight.grad[0, 0] < 0, "what was shown becomes likelier"


def test_lambda_is_halved_every_l_updates_down_to_its_least():
    never, often = LearnerConfig(), LearnerConfig(anneal_every=100)
    assert {mixing_at(never, u) for u in (0, 99, 10_000)} == {0.5}
    assert [mixing_at(often, u) for u in (0, 99, 100, 199, 200, 300, 10_000)] == [0.5, 0.5, 0.25, 0.25, 0.125, 0.1, 0.1]


# The loop -------------------------------------------------------------------------------------------


def problem(teacher: Watcher | None = None) -> IliadProblem:
    tasks, save = WISHES * 8, lambda path, identity: path.touch()
    return IliadProblem(
        Buttons(), teacher or Watcher(), AnyButton(), Presser(0), Presser(1), tasks, WISHES, {"world": "b"}, save
    )


QUICK = LearnerConfig(iterations=60, batch=8, learning_rate=0.1, validate_every=20)


BINARY = {"learner": "binary", "learning_rate": 1.0}


@pytest.mark.parametrize("settings", [{}, {"learner": "dagger"}, BINARY])
def test_each_learner_learns_the_buttons(tmp_path, settings):
    config = LearnerConfig(**{**vars(QUICK), **settings})
    p = problem()
    found = train(p, config, tmp_path, note=silent)
    assert found[-1]["success"] >= (0.5 if settings == BINARY else 1)
    assert (tmp_path / "best.safetensors").exists()
    assert [h["episodes"] for h in found] == [160, 320, 480]
    assert success_rate(p.world, p.student, WISHES) == found[-1]["success"]


def test_a_button_that_is_never_described_is_never_learned(tmp_path):
    p = problem(Watcher(dumb=(2,)))
    found = train(p, QUICK, tmp_path, note=silent)
    right = [p.student.greedy([w], [str(w.button)])[0] == w.button for w in WISHES]
    assert right[0] and right[1] and right[3]
    assert found[-1]["described"] < 1


def test_adel_comes_to_the_true_marginal():
    """Theorem 1 in small: with a consistent teacher the explorer ends where the requests are, not uniform."""
    rng, explorer, student = stream(0, "t"), Presser(1), Presser(0)
    weights = [*explorer.table.parameters(), *student.table.parameters()]
    optimizer = torch.optim.Adam(weights, 0.1)
    asked = RequestBatch([Wish(0)] * 16, ["0"] * 16, rng)
    for _ in range(80):
        descend(adel(asked, Watcher(), AnyButton(), explorer, student, 0.25).loss, optimizer, "ADEL", 9.0)
    with torch.no_grad():
        pressed = explorer.logits(["0"]).softmax(-1)[0]
    assert pressed[0] > 0.6 and (pressed[1:] > 0.01).all(), "mostly what was asked for, everything now and then"


def test_episodes_to_a_threshold_are_the_first_validation_above_it():
    history = [{"episodes": float(n), "success": share} for n, share in ((10, 0.2), (20, 0.9), (30, 0.8))]
    assert episodes_to(history, 0.85) == 20 and math.isinf(episodes_to(history, 0.95))


WRONG = {"learner": "ppo", "mixing": 1.5, "batch": 0, "learning_rate": 0.0, "anneal_every": -1, "entropy": math.nan}


@pytest.mark.parametrize("field", WRONG)
def test_settings_out_of_range_are_refused(field):
    with pytest.raises(ValueError, match=field):
        LearnerConfig(**{field: WRONG[field]})
