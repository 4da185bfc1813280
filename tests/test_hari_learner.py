"""HARI's learner: descriptions as numbers, the networks, returns and signs, and small worlds in which it must learn."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import pytest
import torch
from hand_data import built
from hand_worlds import HandWorld, grid_world, hand_graph, room, thing

from embodied.action_spaces import PanoramicMoves
from embodied.agents.common.tensors import Decisions, actor_loss, costs_to_go, critic_loss
from embodied.agents.common.weights import CheckpointError
from embodied.agents.hari.networks import (
    INTENTIONS,
    HariAgent,
    RecurrentHead,
    load_agent,
    load_executor,
    new_executor,
    new_heads,
    save,
    shown_probabilities,
)
from embodied.agents.hari.policy import DO, DONE, Choice, Considered, HariPolicy, Reader, carry, consider, policy_of
from embodied.agents.hari.pretraining import PretrainingData, guided_share, pretrain, pretraining_success
from embodied.agents.hari.pretraining import train_step as lesson
from embodied.agents.hari.run import TEST, IntentionRun, counts_of, train, train_step, values
from embodied.agents.hari.study import RULES, HariStudy, RandomWithBudgets, RuleAgent, RuleMoment
from embodied.agents.hari.words import STOP, FeatureWords, collate, feature_words, move_rows, percept
from embodied.agents.learners.hari import ExecutionConfig, IntentionConfig
from embodied.agents.studies.engine import run_study
from embodied.assistants.descriptions import Describer, frequent_classes
from embodied.datasets.store import TaskSet
from embodied.envs.hari import Costs, HariEnv
from embodied.evaluation.evaluate import play
from embodied.house.house import House, Opening, Storey
from embodied.interface import Ask, Candidates, Feature, FindObject, Intention, Move, Pose, Task
from embodied.kinds.shipped.hari import PRETRAINING, HariAssistant, hari_pool, hari_task
from embodied.language.plain_language import PlainLanguage
from embodied.records import identity_of, read_json

SMALL = ExecutionConfig(
    hidden_size=32, layers=1, heads=2, dropout=0.0, learning_rate=2e-3, iterations=2, batch=8, validate_every=2
)
QUICK = IntentionConfig(
    hidden_size=24, learning_rate=1e-2, batch=16, critic_iterations=1, iterations=2, validate_every=2
)
CUR, GOAL, SUB = (INTENTIONS.index(n) for n in ("cur", "goal", "sub"))


def identity(settings):
    return identity_of(settings=settings)


def silent(line: str) -> None:
    """Nobody watches."""


@functools.cache
def fork_world() -> HandWorld:
    """Three nodes: 0 in the middle of a hall, 1 to the east with a mug, 2 to the west with a book."""
    hall = room("hall_1", "hall", 0, 0, 14, 2)
    door = Opening("front_door_1", "front_door", ("hall_1", None), (0, 1.5), (0, 0.5), 0.0, 2.1)
    things = (thing("mug", 1, "hall_1", 12.8, 1.2), thing("book", 1, "hall_1", 1.2, 1.2))
    house = House(0, "fork", (Storey(0.0, 2.6),), (hall,), (door,), things, ())
    return HandWorld(house, hand_graph([[7, 1, 1.5], [13, 1, 1.5], [1, 1, 1.5]], [[0, 1], [0, 2]], ["hall_1"] * 3))


@functools.cache
def all_said() -> Describer:
    """Nothing is frequent; it says the same of the same, so that who reads it need not read it again."""
    return Describer(())


def fork_task(goal: int) -> Task:
    what = FindObject("mug", "hall", ("mug_1",))
    return Task(f"fork/hari/{goal}", "hari", "fork", Pose(0), what, (goal,), "find a mug in a hall", 0.0, 6)


def fork_data() -> PretrainingData:
    """Both ways of the fork, with the goal described densely or as the next action."""
    return PretrainingData(
        {"fork": fork_world()}, all_said(), [fork_task(1), fork_task(2)] * 8, [fork_task(1), fork_task(2)]
    )


def grid_data() -> tuple[HandWorld, PretrainingData]:
    world = grid_world()
    pool = hari_pool(world, seed=0, config=PRETRAINING)
    tasks = [hari_task(pool, i, seed=0, language=PlainLanguage()) for i in range(48)]
    return world, PretrainingData({"grid": world}, Describer(frequent_classes([world], 0.5)), tasks, tasks[:24])


def words_of(world: HandWorld) -> FeatureWords:
    say = all_said()
    return feature_words(say.dense(world, v) for v in range(len(world.graph.ids)))


# Descriptions as numbers ------------------------------------------------------------------------


def test_each_part_of_a_feature_set_has_its_own_column_and_rooms_have_no_direction():
    words = FeatureWords(("action/go", "action/stop", "object/mug", "room/hall"))
    assert len(words) == 6
    assert words.row(Feature("object", "mug", 3, -1, 4)) == (4, 1, 4, 1, 5)
    assert words.row(Feature("room", "hall")) == (5, 2, 0, 0, 0)
    assert words.row(Feature("action", "go", 0, 1, 2)) == (2, 3, 1, 3, 3)
    assert words.row(STOP) == (3, 3, 0, 0, 0)
    assert words.row(Feature("object", "harp", 3, -1, 4)) == (1, 1, 4, 1, 5), "unknown, but somewhere"
    assert words.rows((), "goal").tolist() == [[0, 5, 0, 0, 0]], "an empty description is still one"


def test_the_move_that_an_assistant_would_name_has_the_same_row_but_for_the_distance():
    world = grid_world()
    words, say, moves = words_of(world), Describer(()), PanoramicMoves()
    for turn in (0, 4, 11):
        candidates, poses = moves.at(world, Pose(7, turn))
        rows = move_rows(words, candidates)
        for row, pose in zip(rows[:-1], poses, strict=True):
            (said,) = say.step(world, 7, pose.node)
            assert row[:4].tolist() == list(words.row(said)[:4])
        assert rows[-1].tolist() == list(words.row(STOP))


# Networks ---------------------------------------------------------------------------------------


def test_what_the_intention_policy_is_shown_begins_with_stopping_and_falls():
    log_moves = torch.tensor([[0.2, 0.5, 0.0, 0.3]]).log()
    shown = shown_probabilities(log_moves)
    torch.testing.assert_close(shown[0, :4], torch.tensor([0.3, 0.5, 0.2, 0.0]))
    assert shown.shape == (1, 9) and shown[0, 4:].sum() == 0


# Returns and signs ------------------------------------------------------------------------------


def test_costs_to_go_by_hand():
    costs = torch.tensor([[1.0, 2.0, 4.0], [3.0, 5.0, 99.0]])
    mask = torch.tensor([[True, True, True], [True, True, False]])
    assert costs_to_go(costs, mask).tolist() == [[7.0, 6.0, 4.0], [8.0, 5.0, 0.0]]


def test_an_intention_that_cost_less_than_expected_becomes_likelier_and_the_critic_comes_nearer():
    """E.1 is an ascent direction, (V - C) grad log psi; E.2 a descent one."""
    for cost, likelier in ((1.0, True), (3.0, False)):
        logits = torch.zeros(1, 5, requires_grad=True)
        value = torch.full((1, 1), 2.0, requires_grad=True)  # V, a cost
        log_p = logits.log_softmax(-1)[:, [SUB]]
        mask = torch.ones(1, 1, dtype=torch.bool)
        d = Decisions(log_p, -value, -torch.tensor([[cost]]), mask)
        (actor_loss(d) + critic_loss(d)).backward()
        assert (logits.grad[0, SUB] < 0) == likelier, "descent on the loss moves against the gradient"
        assert logits.grad[0, SUB].item() == pytest.approx(-(2.0 - cost) * (1 - 0.2))
        assert value.grad.item() == pytest.approx(2.0 - cost), "(V - C) grad V of E.2"


def test_the_critic_remembers_each_episode_by_itself():
    torch.manual_seed(0)
    critic = RecurrentHead(4, 8, 1, knows_stack=True)
    torch.nn.init.normal_(critic.out.weight)
    draw = lambda b: (
        torch.randn(b, 4),
        torch.rand(b, 9),
        torch.zeros(b, dtype=torch.long),
        torch.ones(b, dtype=torch.long),
    )
    both, one = draw(2), draw(1)
    steps = [
        Choice([0, 1], torch.zeros(2, 5), torch.zeros(2).long(), *both),
        Choice([1], torch.zeros(1, 5), torch.zeros(1).long(), *one),
    ]
    alone = [
        Choice([0], torch.zeros(1, 5), torch.zeros(1).long(), *(x[1:] for x in both)),
        Choice([0], torch.zeros(1, 5), torch.zeros(1).long(), *one),
    ]
    together = values(critic, steps, 2)
    torch.testing.assert_close(together[1], values(critic, alone, 1)[0])
    assert together[0, 1] == 0, "the first episode had ended"


# Rules ------------------------------------------------------------------------------------------


def moment(
    taken=(0, 0, 0, 0, 0), described=False, would_stop=False, possible=(True,) * 5, budget=(9,) * 5
) -> RuleMoment:
    return RuleMoment(np.array(taken), described, would_stop, np.array(possible), np.array(budget, dtype=float))


def test_the_rules_of_the_table_ask_when_they_say_and_stop_when_the_execution_policy_would():
    rng = np.random.default_rng(0)
    assert RULES["no assistance"].choose(moment(), rng) == DO
    assert RULES["no assistance"].choose(moment(would_stop=True), rng) == DONE
    both = RULES["dense goal and state"]
    assert both.choose(moment(would_stop=True), rng) == GOAL
    assert both.choose(moment(taken=(0, 1, 0, 0, 0)), rng) == CUR
    assert both.choose(moment(taken=(1, 1, 0, 0, 0), described=True), rng) == DO
    assert both.choose(moment(taken=(1, 1, 0, 0, 0), described=True, would_stop=True), rng) == DONE


def test_random_with_budgets_begins_with_the_goal_spends_no_more_and_keeps_its_means():
    rule = RandomWithBudgets({"cur": 2.25, "goal": 1.0, "sub": 1.5, "do": 4.0})
    rng = np.random.default_rng(0)
    budgets = np.stack([rule.budget(rng) for _ in range(4000)])
    assert budgets[:, :4].mean(0) == pytest.approx([2.25, 1.0, 1.5, 4.0], abs=0.05)
    assert set(budgets[:, CUR]) == {2.0, 3.0} and set(budgets[:, GOAL]) == {1.0}
    for budget in budgets[:50]:
        taken = np.zeros(5, dtype=int)
        order = []
        while DONE not in order:
            order.append(rule.choose(moment(taken=taken, would_stop=False, budget=budget), rng))
            taken[order[-1]] += 1
        assert order[0] == GOAL and (taken[:4] == budget[:4]).all(), "where nothing is left, it is done"
    assert rule.choose(moment(taken=(0, 1, 0, 0, 0), would_stop=True, budget=(0, 1, 1, 0, 9)), rng) == SUB, (
        "not DONE first"
    )


def test_the_execution_policy_forces_done_upon_random_with_budgets():
    """Table 4.7: "when to call DONE is decided by the execution policy"; no more often than SUB while SUB is left."""
    rule, rng = RandomWithBudgets({"cur": 9.0, "goal": 1.0, "sub": 2.0, "do": 9.0}), np.random.default_rng(0)
    choose = lambda taken: rule.choose(moment(taken=taken, would_stop=True, budget=(9, 1, 2, 9, 9)), rng)
    assert {choose((0, 1, 2, 0, 0)) for _ in range(30)} == {DONE}, "SUB's budget is spent"
    assert {choose((0, 1, 1, 0, 0)) for _ in range(30)} == {DONE}, "on a sub-goal"
    assert DONE not in {choose((0, 1, 1, 0, 1)) for _ in range(30)}, "it would end too early"


def test_sub_whenever_possible_still_ends():
    rule, rng = RULES["SUB whenever possible"], np.random.default_rng(0)
    assert rule.choose(moment(), rng) == SUB
    assert rule.choose(moment(possible=(True, True, False, True, True)), rng) == DO
    assert rule.choose(moment(would_stop=True), rng) == DONE


# Moves ------------------------------------------------------------------------------------------


def test_do_takes_the_likeliest_move_and_never_stops():
    log_moves = torch.tensor([[0.2, 0.3, 0.0, 0.5]]).log()  # the third is padding, the last is stopping
    assert Considered([0], torch.zeros(1, 4), log_moves).move(0) == 1


# What is shared ---------------------------------------------------------------------------------


def test_rows_say_what_stands_in_both_descriptions():
    mug, far_mug, bed, kitchen = (
        Feature("object", "mug", 1, 0, 2),
        Feature("object", "mug", 1, 0, 3),
        Feature("object", "bed", 0, 0, 1),
        Feature("room", "kitchen"),
    )
    words = feature_words([(mug, bed, kitchen)])
    stranger = Feature("object", "never seen", 1, 0, 2)
    nothing = Candidates(np.zeros(0, np.float32), np.zeros(0, np.float32), np.zeros(0, int), np.zeros(0, bool))
    pairs = [((far_mug, bed, stranger), (kitchen, mug, stranger)), ((mug,), (kitchen, mug))]
    inputs = collate([percept(words, words.rows(a, "state"), words.rows(b, "goal"), nothing, 0) for a, b in pairs])
    assert inputs.state_shared.tolist() == [[0, 1, 0, 0], [0, 2, 0, 0]], "markers and unknown names are not shared"
    assert inputs.goal_shared.tolist() == [[0, 0, 1, 0], [0, 0, 2, 0]]


def test_the_shortest_path_takes_ever_fewer_steps():
    config = dataclasses.replace(SMALL, iterations=100, guided=0.5)
    assert [guided_share(config, u) for u in (0, 25, 50, 99)] == [1.0, 0.5, 0.0, 0.0]
    assert guided_share(dataclasses.replace(config, guided=0.0), 0) == 0.0


def test_a_walk_that_is_wholly_guided_takes_only_right_moves():
    source = fork_data()
    executor = new_executor(dataclasses.replace(SMALL, guided=1.0, iterations=10**9), words_of(fork_world()))
    optimizer = torch.optim.Adam(executor.network.parameters(), 1e-4)
    assert [lesson(executor, optimizer, source, u)["steps"] for u in range(3)] == [2 * SMALL.batch] * 3, "go, stop"


@pytest.mark.parametrize("reset", [False, True])
def test_a_belief_begins_anew_with_another_goal_only_if_it_is_to(reset):
    world, source = grid_data()
    executor = new_executor(dataclasses.replace(SMALL, reset_on_goal_change=reset), words_of(world))
    executor.network.eval()
    env = HariEnv({"grid": world}, HariAssistant(source.describer), source.describer)
    first = env.reset(source.training[1])
    reader = Reader(executor)
    considered, belief = consider(reader, [first], None)
    belief = carry(considered, belief)
    torch.testing.assert_close(belief.carried[0], considered.belief[0])
    same = consider(reader, [first], belief)[1]
    torch.testing.assert_close(same.carried[0], considered.belief[0])
    asked = env.step(Ask(Intention.SUB))
    after = consider(reader, [asked], belief)[1]
    expected = executor.network.begin(1)[0] if reset else considered.belief[0]
    torch.testing.assert_close(after.carried[0], expected)


# Learning ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fork_executor():
    """An execution policy that has learned both ways of the fork."""
    config = dataclasses.replace(SMALL, reset_on_goal_change=True, iterations=60, batch=16, validate_every=60)
    executor = new_executor(config, words_of(fork_world()))
    source = fork_data()
    optimizer = torch.optim.Adam(executor.network.parameters(), config.learning_rate)
    for update in range(config.iterations):
        lesson(executor, optimizer, source, update)
    executor.network.eval()
    return executor


@pytest.mark.slow
def test_pretraining_learns_a_world_it_can_see(fork_executor):
    source = fork_data()
    assert pretraining_success(fork_executor, source, source.validation * 8) > 0.9
    fresh = new_executor(SMALL, fork_executor.words)
    assert pretraining_success(fresh, source, source.validation * 8) < 0.9


def fork_env() -> HariEnv:
    """Goals are described by their room alone (nothing is frequent), so only asking tells them apart."""
    say = all_said()
    return HariEnv({"fork": fork_world()}, HariAssistant(say), say, costs=Costs(0.1, 0.1, 0.1, 0.1))


@pytest.mark.slow
def test_the_learner_finds_the_best_questions_of_a_three_node_house(fork_executor):
    """GOAL (or SUB), DO, DONE cost 0.1 + 0.1 + 0; going without asking costs 1.1 on average, another question 0.1."""
    config = dataclasses.replace(
        QUICK, cost=0.1, horizon=6, critic_iterations=10, iterations=150, entropy=0.01, batch=24
    )
    agent = HariAgent(fork_executor, new_heads(config, SMALL.hidden_size)[0], config)
    run = IntentionRun(agent, new_heads(config, SMALL.hidden_size)[1])
    world = fork_world()
    ground = TaskSet({"fork": world}, [fork_task(1), fork_task(2)], fork_env)
    for update in range(config.updates):
        train_step(run, ground, update)
    episodes = play(fork_env, policy_of(agent, sample=False), [fork_task(1), fork_task(2)], seed=0)
    assert all(e.ended == "stop" and e.nodes[-1] in e.task.goal_nodes for e in episodes)
    assert all(e.requests == 1 for e in episodes), "one question, and not the useless one"
    assert counts_of(episodes)["cur"] == 0
    assert sum(s.cost for e in episodes for s in e.steps) / 2 == pytest.approx(0.2, abs=0.11)


@pytest.mark.slow
def test_an_episode_does_not_depend_on_the_batch_around_it(fork_executor):
    agent = HariAgent(fork_executor, new_heads(QUICK, SMALL.hidden_size)[0], QUICK)
    tasks = [dataclasses.replace(fork_task(1 + k % 2), id=f"fork/{k}") for k in range(33)]
    ruled = RuleAgent(fork_executor, RandomWithBudgets({"cur": 1.5, "goal": 1.0, "sub": 0.5, "do": 2.5}))
    for player in (policy_of(agent), ruled):
        alone = [play(fork_env, player, [t], seed=1)[0] for t in reversed(tasks)]
        for batch in (5, 32):
            assert play(fork_env, player, tasks, seed=1, batch=batch) == list(reversed(alone))


@pytest.mark.slow
def test_both_runs_go_on_exactly_where_they_stopped(tmp_path):
    world, source = grid_data()
    config = dataclasses.replace(SMALL, iterations=4, dropout=0.1)
    whole = new_executor(config, words_of(world))
    pretrain(whole, source, tmp_path / "whole", identity(config), note=silent)
    half = new_executor(dataclasses.replace(config, iterations=2), words_of(world))
    pretrain(half, source, tmp_path / "parts", identity(half.config), note=silent)
    again = new_executor(config, words_of(world))
    pretrain(again, source, tmp_path / "parts", identity(config), note=silent)
    for a, b in zip(whole.network.parameters(), again.network.parameters(), strict=True):
        assert torch.equal(a, b)
    with pytest.raises(CheckpointError, match="batch 8 -> 4"):
        other = new_executor(dataclasses.replace(config, batch=4), words_of(world))
        pretrain(other, source, tmp_path / "parts", identity(other.config), note=silent)

    say = source.describer
    ground = TaskSet(source.places, source.training, lambda: HariEnv(source.places, HariAssistant(say), say))
    runs = {}
    for name, stops in (("one", (3,)), ("two", (1, 3))):
        for updates in stops:
            settings = dataclasses.replace(QUICK, iterations=updates, batch=4, validation_tasks=4)
            actor, critic = new_heads(settings, SMALL.hidden_size)
            runs[name] = HariAgent(whole, actor, settings)
            train(runs[name], critic, ground, ground, tmp_path / name, identity(settings), note=silent)
    for a, b in zip(runs["one"].actor.parameters(), runs["two"].actor.parameters(), strict=True):
        assert torch.equal(a, b)


@pytest.mark.slow
def test_weights_survive_the_disk_and_say_what_they_lack(tmp_path, fork_executor):
    agent = HariAgent(fork_executor, new_heads(QUICK, SMALL.hidden_size)[0], QUICK)
    save(agent, tmp_path / "agent.safetensors")
    save(fork_executor, tmp_path / "execution.safetensors")
    again = load_agent(tmp_path / "agent.safetensors")
    tasks = [fork_task(1), fork_task(2)]
    assert play(fork_env, policy_of(again), tasks, seed=5) == play(fork_env, policy_of(agent), tasks, seed=5)
    assert load_executor(tmp_path / "agent.safetensors").words == fork_executor.words
    with pytest.raises(ValueError, match="execution policy alone.*--execution"):
        load_agent(tmp_path / "execution.safetensors")


@pytest.mark.slow
def test_the_skyline_needs_no_execution_policy_on_sub_goals(fork_executor):
    """With random moves on the main goal, SUB then DO still arrives."""
    config = dataclasses.replace(QUICK, perfect=True)
    policy = policy_of(HariAgent(new_executor(SMALL, fork_executor.words), new_heads(config, 32)[0], config))
    assert isinstance(policy, HariPolicy)
    for goal in (1, 2):
        env = fork_env()
        observation = env.reset(fork_task(goal), seed=0)
        observation = env.step(Ask(next(i for i in observation.can_ask if i.value == "sub")))
        memory, rng = None, np.random.default_rng(0)
        while env.pose.node == 0 and observation is not None:  # whatever it asks: when it does, it goes there
            (action,), memory = policy.act_privileged([observation], [env.situation], memory, rngs=[rng])
            if isinstance(action, Move):
                observation = env.step(action)
        assert env.pose.node == goal


@pytest.mark.slow
def test_the_tables_are_made_from_a_data_set(tmp_path):
    """Agents that were hardly trained, beside a rule."""
    data = built(tmp_path / "data", "hari")
    walking = dataclasses.replace(SMALL, hidden_size=16, iterations=1, validate_every=1, validation_tasks=2)
    asking = dataclasses.replace(QUICK, hidden_size=8, iterations=1, batch=4, validation_tasks=3, horizon=6)
    study = HariStudy(data.folder, (0,), 2, (0,), execution=walking, config=asking)
    tables = ["4.7", "figure 4.5b"]
    run_study(study, tables, tmp_path / "out", rows=["learned", "random + rules"], note=silent)
    body, times = (read_json(tmp_path / "out" / f"hari-{n.replace(' ', '-')}.json") for n in tables)
    assert [r["label"] for r in body["rows"]] == ["random + rules", "learned"]
    assert [c["key"] for c in body["columns"]][-4:] == ["CUR", "GOAL", "SUB", "DO"]
    assert body["rows"][1]["printed"]["success_test_unseen_env"] == 19.8
    shares = [times["rows"][0]["values"][f"{name}_at_1_val_unseen_env"]["mean"] for name in INTENTIONS]
    assert sum(shares) == pytest.approx(1), "every running episode chooses one intention"
    assert (tmp_path / "out" / "hari-figure-4.5b.png").exists()


def test_another_data_set_judges_what_it_may(tmp_path):
    """All splits where houses and tasks to learn from are the same, as in a set with more to evaluate in."""
    sizes = ("2x20x1", "2x20x1/5", "1x20x1")
    data, more, other = (built(tmp_path / str(k), "hari", size) for k, size in enumerate(sizes))
    study = HariStudy(data.folder, (0,), 2, (0,), execution=SMALL, config=QUICK)
    splits = [dataclasses.replace(study, eval_data=d.folder).tables()["4.7"].splits for d in (more, other)]
    assert splits == [TEST, ("test_unseen_env",)]
    assert len(more.tasks("test_unseen_start")) > len(data.tasks("test_unseen_start"))
