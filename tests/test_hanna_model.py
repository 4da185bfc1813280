"""The modules of dissertation appendix D.2 against cases worked by hand, and what must not matter."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch

from embodied.agents.hanna.attention import (
    DO_NOTHING,
    REQUEST,
    SLOTS,
    START,
    DotAttend,
    IncTime,
    MultiAttend,
    Percept,
    action_size,
    sim_attend,
    sinusoid,
    slot_distribution,
    target_similarity,
)
from embodied.agents.hanna.network import HannaNetwork
from embodied.agents.learners.hanna import TrainingConfig

WORDS, FEATURES = 12, 6
SMALL = TrainingConfig(hidden_size=16, navigation_embedding=8, ask_embedding=4, self_heads=2, text_heads=2, dropout=0.0)


def percepts(steps: int, agents: int, *, seed: int, actions: int = 4, words: int = 5) -> list[Percept]:
    """Random percepts of SMALL's sizes; every agent's task changes at steps of its own."""
    rng = np.random.default_rng(seed)
    normal = lambda *shape: torch.from_numpy(rng.normal(size=shape).astype(np.float32))
    out = []
    for t in range(steps):
        embedded = normal(agents, actions, action_size(FEATURES))
        embedded[:, 0] = 0
        slots = torch.from_numpy(rng.integers(0, 36, (agents, actions)))
        slots[:, 0] = SLOTS - 1
        out.append(
            Percept(
                tokens=torch.from_numpy(rng.integers(1, 12, (agents, words))),
                new_task=torch.from_numpy(rng.random(agents) < (1.0 if t == 0 else 0.3)),
                current=normal(agents, 36, 6),
                target=normal(agents, 36, 6),
                actions=embedded,
                action_mask=torch.ones(agents, actions, dtype=torch.bool),
                action_slots=slots,
                previous_action=normal(agents, action_size(FEATURES)),
                previous_ask=torch.from_numpy(rng.integers(0, 2, agents)) if t else torch.full((agents,), START),
            )
        )
    return out


def play(network, steps: list[Percept]) -> list:
    """Scores of every step."""
    memory, out = network.start(len(steps[0].new_task), steps[0].tokens.shape[1]), []
    for percept in steps:
        scores, memory = network(memory, percept)
        out.append(scores)
    return out


def network(kind=HannaNetwork, **changes):
    torch.manual_seed(0)
    return kind(dataclasses.replace(SMALL, **changes), WORDS, FEATURES).eval()


def set_identity(*layers: torch.nn.Linear) -> None:
    for layer in layers:
        torch.nn.init.eye_(layer.weight)
        torch.nn.init.zeros_(layer.bias)


def test_multi_attend_with_one_head_is_softmax_attention_plus_query_normalised():
    attend = MultiAttend(2, 1, 0.0)
    set_identity(attend.query, attend.key, attend.value, attend.out)
    q, memory = torch.tensor([[1.0, 0.0]]), torch.tensor([[[1.0, 0.0], [0.0, 3.0], [9.0, 9.0]]])
    out = attend(q, attend.key(memory), attend.value(memory), torch.tensor([[True, True, False]]))
    a = math.exp(1 / math.sqrt(2)) / (math.exp(1 / math.sqrt(2)) + 1)  # scores 1/sqrt(2) and 0; the third is masked
    x = np.array([1 + a, 3 * (1 - a)])
    expected = (x - x.mean()) / x.std()
    assert np.allclose(out.detach().numpy()[0], expected, atol=1e-5)
    with pytest.raises(ValueError, match="not a multiple"):
        MultiAttend(10, 3, 0.0)


def test_dot_attend_equals_the_formula_that_projects_every_row():
    torch.manual_seed(1)
    attend, q, rows = DotAttend(5, 7, 4), torch.randn(3, 5), torch.randn(3, 36, 7)
    scores = torch.einsum("bh,bnh->bn", attend.query(q), attend.row(rows))
    expected = torch.einsum("bn,bnd->bd", scores.softmax(-1), rows)
    assert torch.allclose(attend(q, rows), expected, atol=1e-5)


def test_sim_attend_averages_only_values_whose_keys_point_the_same_way():
    q = torch.tensor([[1.0, 0.0]])
    keys = torch.tensor([[[2.0, 0.0], [0.95, math.sqrt(1 - 0.95**2)], [0.8, 0.6], [0.0, 1.0], [5.0, 0.0]]])
    values = torch.tensor([[[1.0, 0.0], [0.0, 1.0], [9.0, 9.0], [9.0, 9.0], [9.0, 9.0]]])
    mask = torch.tensor([[True, True, True, True, False]])
    kept = sim_attend(q, keys, values, mask)
    assert torch.allclose(kept, torch.tensor([[1 / 1.95, 0.95 / 1.95]]), atol=1e-5)  # D.3 over the kept ones
    assert torch.equal(sim_attend(-q, keys, values, mask), torch.zeros(1, 2))


def test_inc_time_adds_a_relu_and_normalises():
    step = IncTime(2, 2)
    torch.nn.init.constant_(step.step.weight, 0.0)
    step.step.bias.data = torch.tensor([-5.0, 2.0])
    out = step(torch.tensor([[1.0, 1.0]]))  # [1 + 0, 1 + 2] has mean 2 and deviation 1
    assert torch.allclose(out, torch.tensor([[-1.0, 1.0]]), atol=1e-4)


def test_sinusoid_is_that_of_attention_is_all_you_need():
    table = sinusoid(3, 4, torch.zeros(1))
    assert torch.allclose(table[2], torch.tensor([math.sin(2), math.cos(2), math.sin(0.02), math.cos(0.02)]), atol=1e-6)


def test_target_similarity_is_one_everywhere_at_the_target_and_zero_without_one():
    torch.manual_seed(3)
    views = torch.randn(2, 36, 5)
    assert torch.allclose(target_similarity(views, views), torch.ones(2, 36), atol=1e-5)
    assert torch.equal(target_similarity(views, torch.zeros(2, 36, 5)), torch.zeros(2, 36))
    one = torch.zeros(1, 36, 5)
    one[0, 7] = -views[0, 3]  # the rest of the target is blank: cosine 0
    assert target_similarity(views[:1], one)[0, 3] == 0.0


def test_actions_that_share_a_view_add_up_in_the_static_distribution():
    logits = torch.log(torch.tensor([[0.1, 0.2, 0.7, 0.0]]))
    out = slot_distribution(logits, torch.tensor([[36, 12, 12, 0]]))
    assert out[0, 36] == pytest.approx(0.1)
    assert out[0, 12] == pytest.approx(0.9)
    assert out.sum() == pytest.approx(1.0)


def changed_history(steps: list[Percept]) -> list[Percept]:
    """The same steps, but the agent saw other views before the last two."""
    return [
        dataclasses.replace(p, current=p.current.roll(1, 2)) if t < len(steps) - 2 else p for t, p in enumerate(steps)
    ]


def test_a_new_task_wipes_the_inter_task_state_and_nothing_else():
    steps = [dataclasses.replace(p, new_task=torch.tensor([t in (0, 3)])) for t, p in enumerate(percepts(5, 1, seed=7))]

    def inter_state(net, history):
        memory = net.start(1, 5)
        for p in history:
            _, memory = net(memory, p)
        return memory[0].inter_state

    reset, never = network(), network(reset_inter_task=False)
    assert torch.allclose(inter_state(reset, steps), inter_state(reset, changed_history(steps)), atol=1e-6)
    assert not torch.allclose(inter_state(never, steps), inter_state(never, changed_history(steps)), atol=1e-3)
    last, other = play(reset, steps)[-1], play(reset, changed_history(steps))[-1]
    assert not torch.allclose(last.navigation, other.navigation, atol=1e-3)  # the intra-task memory remembers


def test_asking_teaches_navigation_nothing():
    net = network()
    sum(s.ask.sum() for s in play(net, percepts(3, 2, seed=8))).backward()
    assert all(p.grad is None for p in net.navigation.parameters())
    assert any(p.grad is not None and p.grad.abs().sum() > 0 for p in net.help.parameters())


def test_only_steps_at_which_it_asked_are_similar_to_the_help_network():
    net = network()
    steps = [dataclasses.replace(p, new_task=torch.tensor([t == 0])) for t, p in enumerate(percepts(3, 1, seed=9))]
    memory = net.start(1, 5)
    asks = (START, REQUEST, DO_NOTHING)
    for p, ask in zip(steps, asks, strict=True):
        _, memory = net(memory, dataclasses.replace(p, previous_ask=torch.tensor([ask])))
    assert memory[0].similar_mask.tolist() == [[True, True, True]]  # opening zero vectors, steps 0 and 1
    assert memory[1].similar_mask.tolist() == [[False, True, False]]


def test_the_gate_subtracts_what_was_thought_in_the_same_situation():
    """With one earlier step exactly like this one, h = bar h - sigmoid(gate) * h_earlier (D.16, D.17)."""
    net = network()
    net.navigation.gate.weight.data.zero_()
    net.navigation.gate.bias.data.zero_()  # beta = 1/2
    for time in (net.navigation.local_time, net.navigation.global_time):
        torch.nn.init.zeros_(time.norm.weight)
        torch.nn.init.zeros_(time.norm.bias)  # time stands still, so situations can repeat
    torch.nn.init.zeros_(net.navigation.inter_in.weight[:, 6:])
    step = dataclasses.replace(percepts(1, 1, seed=10)[0], new_task=torch.tensor([True]))
    blind = network(similarity_attention=False)
    blind.load_state_dict(net.state_dict())
    memory, reference = net.start(1, 5)[0], blind.start(1, 5)[0]
    delta, nothing, yes = (
        target_similarity(step.current, step.target),
        torch.zeros(1, 0),
        torch.ones(1, dtype=torch.bool),
    )
    previous = step.previous_action
    first, memory = net.navigation(memory, step, delta, previous, nothing, yes)
    tentative, reference = blind.navigation(reference, step, delta, previous, nothing, yes)
    assert torch.allclose(first, tentative, atol=1e-6)  # nothing similar yet: the past is zero
    reference = dataclasses.replace(memory)
    second, _ = net.navigation(memory, step, delta, previous, nothing, yes)
    tentative, _ = blind.navigation(reference, step, delta, previous, nothing, yes)
    assert torch.allclose(second, tentative - 0.5 * first, atol=1e-5)


def test_the_paper_sized_model_has_about_the_fifteen_million_parameters_of_table_4_6():
    net = HannaNetwork(TrainingConfig(), 2332, 2048)
    assert sum(p.numel() for p in net.parameters()) == pytest.approx(15.5e6, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "change", [{"reset_inter_task": False}, {"predict_reasons": False}, {"similarity_attention": False}]
)
def test_every_ablation_of_table_d2_runs_and_changes_what_is_computed(change):
    steps = percepts(6, 3, seed=11)
    base, ablated = network(), network(**change)
    shared = {k: v for k, v in base.state_dict().items() if ablated.state_dict().get(k, v[:0]).shape == v.shape}
    ablated.load_state_dict(shared, strict=False)
    a, b = play(base, steps)[-1], play(ablated, steps)[-1]
    assert (b.reasons is None) == ("predict_reasons" in change)
    assert not (torch.allclose(a.navigation, b.navigation, atol=1e-6) and torch.allclose(a.ask, b.ask, atol=1e-6))
