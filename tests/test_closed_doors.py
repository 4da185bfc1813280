"""Closed doors in play: they bar ways and hide what is behind them until they are opened."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from conftest import two_rooms
from handmade import HandCatalogue, furnished

from embodied.envs.base import ActionError, DoorRule, HelpEnv
from embodied.evaluation.evaluate import play
from embodied.gym.spaces import SpaceLayout, action_mask, decode, number
from embodied.house.moment import Moment
from embodied.interface import Close, Episode, FindObject, FollowRoute, Move, Open, Pose, Stop, Task, viewpoint
from embodied.kinds import metrics
from embodied.kinds.task_kind import EnvInputs, kind_named
from embodied.language import People
from embodied.navigation.doors import doors_in_sight, place_named
from embodied.navigation.graph import OPENING, behind_doors, build_graph
from embodied.policies.listeners import ScriptedListener
from embodied.records import from_json, to_json
from embodied.tasks.goals import told_of_doors
from embodied.world import World

HOUSE = furnished(two_rooms())
KIND = kind_named("doors")


@pytest.fixture(scope="module")
def world(tmp_path_factory):
    with World(HOUSE, HandCatalogue(), build_graph(HOUSE), tmp_path_factory.mktemp("cache")) as world:
        yield world


@pytest.fixture(scope="module")
def task(world):
    """From one room to a thing in the other, the door between them closed."""
    graph = world.graph
    (door,) = {d for doors in graph.doors.values() for d in doors}
    rooms = HOUSE.openings[[o.id for o in HOUSE.openings].index(door)].rooms
    thing = next(p for p in HOUSE.placements if p.room == rooms[1])
    start = graph.room_of_node.index(rooms[0])
    goals = tuple(n for n, r in enumerate(graph.room_of_node) if r == rooms[1])
    goal = FindObject(thing.object_class, None, (thing.id,))
    return Task("t", "doors", HOUSE.name, Pose(start), goal, goals, "find it", 0.0, 60, closed=(door,))


def played(world, task, name) -> Episode:
    return play(KIND.environments(EnvInputs({HOUSE.name: world})), KIND.agent(name), [task], seed=0)[0]


def test_a_house_with_closed_doors_has_the_graph_that_it_has_with_open_ones():
    at = lambda openness: Moment(openness={"door_1": openness}).applied(HOUSE)
    graph, shut = build_graph(at(1.0)), build_graph(at(0.2))
    assert np.array_equal(graph.positions, shut.positions) and graph.doors == shut.doors
    assert (graph.closed, shut.closed) == (frozenset(), {"door_1"})
    assert build_graph(at(0.6), open_from=0.67).closed == {"door_1"}


def test_only_the_agent_that_opens_doors_arrives_and_spl_counts_the_opening(world, task):
    shortest, shut_in = played(world, task, "shortest"), played(world, task, "never opens")
    assert metrics.spl(shortest, world.graph) == 1 and metrics.success(shut_in, world.graph) == 0
    assert [type(s.action) for s in shortest.steps].count(Open) == 1
    way = world.graph.distance[task.start.node, shortest.nodes[-1]]
    assert metrics.path_length(shortest, world.graph) == pytest.approx(way + OPENING)
    assert from_json(Episode, to_json(shortest)) == shortest
    assert "closed" not in to_json(dataclasses.replace(task, closed=()))


def test_a_door_bars_the_way_until_it_is_opened_and_again_when_it_is_closed(world, task):
    env = HelpEnv({HOUSE.name: world})
    o = env.reset(task)
    graph = world.graph
    way = behind_doors(graph, env.closed).path(task.start.node, task.goal_nodes[0])
    while not graph.barred(env.pose.node, following(way, env), env.closed):
        o = env.step(Move(env.situation.candidate_nodes.index(following(way, env))))
    k = env.situation.candidate_nodes.index(following(way, env))
    assert k in o.can_open and not o.candidates.allowed[k] and not o.can_close
    with pytest.raises(ActionError, match="masked"):
        env.step(Move(k))
    hidden = viewpoint(o.sight).world
    o = env.step(Open(k))
    assert k in o.can_close and o.candidates.allowed[k] and viewpoint(o.sight).world == HOUSE.name != hidden
    o = env.step(Close(k))
    assert k in o.can_open and viewpoint(o.sight).world == hidden
    behind = {p.id for p in HOUSE.placements if p.room != graph.room_of_node[env.pose.node]}
    seen = lambda name: {s.placement for s in place_named({HOUSE.name: world}, name).sightings(env.pose.node)}
    assert seen(HOUSE.name) & behind and not seen(hidden) & behind, "nothing is seen through a closed door"


def following(way, env):
    return way[way.index(env.pose.node) + 1]


@pytest.mark.parametrize("rule", ["push", "walk"])
def test_agents_that_know_no_doors_arrive_under_other_rules(world, task, rule):
    class Knowing:
        """Walks as if all doors were open."""

        def act_privileged(self, observations, situations, memory, *, rngs):
            ways = [None if s is None else world.graph.next_hop[s.pose.node, task.goal_nodes[0]] for s in situations]
            return [
                None if s is None else Stop() if n == s.pose.node else Move(s.candidate_nodes.index(n))
                for n, s in zip(ways, situations, strict=True)
            ], None

    env = HelpEnv({HOUSE.name: world})
    env.doors = DoorRule(rule)
    (episode,) = play(lambda: env, Knowing(), [task], seed=0)
    assert metrics.success(episode, world.graph) == 1
    assert metrics.path_length(episode, world.graph) > world.graph.distance[episode.nodes[0], episode.nodes[-1]] + 0.5
    assert any(isinstance(s.action, Open) for s in episode.steps) == (DoorRule(rule) is DoorRule.PUSH)


def test_actions_on_doors_have_numbers_of_their_own(world, task):
    layout = SpaceLayout.of(KIND)
    chosen = [Open(0), Open(15), Close(0), Close(15), Stop(), Move(3)]
    assert [decode(number(a, layout), layout) for a in chosen] == chosen
    assert len({number(a, layout) for a in chosen}) == len(chosen) and layout.actions == SpaceLayout().actions + 32
    env = HelpEnv({HOUSE.name: world})
    mask = action_mask(env.reset(task), layout)
    assert {decode(int(k), layout) for k in np.flatnonzero(mask) if k > 20} == set(map(Open, env.observation.can_open))


def test_a_renderer_that_turns_doors_draws_what_a_new_one_draws(world):
    shut = {"door_1": 0.3}
    with World(Moment(openness=shut).applied(HOUSE), HandCatalogue(), world.graph, world.cache) as anew:
        for node in (0, len(world.graph.ids) - 1):
            turned, fresh = world.with_doors(shut).panorama(node), anew.panorama(node)
            assert np.array_equal(turned.ids, fresh.ids) and np.array_equal(turned.rgb, fresh.rgb)
    assert not np.array_equal(world.panorama(0).ids, world.with_doors(shut).panorama(0).ids)


def test_a_door_that_changes_a_picture_is_in_sight(world):
    shut, node_sees = world.with_doors({"door_1": 0.0}), doors_in_sight(HOUSE, world.graph)[:, 0]
    nodes = range(len(world.graph.ids))
    changed = [not np.array_equal(world.panorama(n).ids, shut.panorama(n).ids) for n in nodes]
    assert all(node_sees[changed]) and any(changed)
    walled = dataclasses.replace(world.graph, positions=world.graph.positions + [0, 100, 0])
    assert not doors_in_sight(HOUSE, walled).any()


def test_whoever_is_told_to_open_doors_arrives(world, task):
    graph, people = world.graph, People()
    path = graph.path(task.start.node, task.goal_nodes[0])
    route = dataclasses.replace(task, kind="vln", goal=FollowRoute("r", path), radius=3.0)
    for seed in range(8):
        told = told_of_doors(route, world, people, seed=seed)
        assert " door" in told.request
        listener = ScriptedListener({HOUSE.name: world})
        (episode,) = play(lambda: HelpEnv({HOUSE.name: world}), listener, [told], seed=0)
        assert metrics.success(episode, graph) == 1 and any(isinstance(s.action, Open) for s in episode.steps)
