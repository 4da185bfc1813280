"""NAV by hand: walks, rewards and teachers on a grid, and a small student that learns its way by descriptions."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hand_worlds import grid_world, line_world

from embodied.agents.common.tensors import greedy_choice
from embodied.agents.common.vocabulary import build_vocabulary
from embodied.agents.hanna.attention import orientation
from embodied.agents.iliad.nav.run import new_follower
from embodied.agents.iliad.nav.student import LoopFree, NavEyes, NavStudent, Track
from embodied.agents.iliad.nav.teacher import (
    GrammarNavTeacher,
    LearnedNavTeacher,
    WalkDescriber,
    arrives,
    encoded_walks,
)
from embodied.agents.iliad.nav.world import (
    HORIZON,
    NavMarginal,
    NavWalk,
    NavWorld,
    Trip,
    trips_of,
    walk_along,
    without_loops,
)
from embodied.agents.iliad.training import IliadProblem, success_rate, train
from embodied.agents.learners.iliad import LearnerConfig, NavConfig
from embodied.agents.vision.features import FeatureBank
from embodied.agents.vln.policy import COPIES
from embodied.assets.records import ROOM_KINDS
from embodied.interface import Pose, Route
from embodied.seeds import stream

LINE = line_world()
TRIP = Trip("line", Pose(0), (0, 1, 2), ("to the third", "two steps on"))
GRID = grid_world(side=4, spacing=4.0)


def test_a_walk_has_at_most_nine_moves():
    assert walk_along([0, 1, 2]) == NavWalk((0, 1, 2), (1, 2, 2)), "the last action stops"
    long = walk_along(list(range(20)))
    assert long == NavWalk(tuple(range(HORIZON)), tuple(range(1, HORIZON))), "cut, and nobody sees it stop"
    assert len(walk_along(range(9)).steps) == 9


def test_loops_are_cut_out():
    assert without_loops([0, 1, 2, 1, 3]) == (0, 1, 3)
    assert without_loops([0, 1, 0]) == (0,)
    assert without_loops([0, 1, 2, 3, 1, 2, 4]) == (0, 1, 2, 4)


def test_success_reward_and_demonstration_by_hand():
    world = NavWorld({"line": LINE})
    assert world.success(TRIP, walk_along([0, 1])), "two metres from the end"
    assert not world.success(TRIP, walk_along([0]))
    assert world.reward(TRIP, walk_along([0, 1])) == pytest.approx((4 - 2) / 4), "Eq C.2"
    assert world.reward(TRIP, walk_along([0])) == 0 and world.reward(TRIP, walk_along([0, 1, 2])) == 1
    assert world.demonstrate(TRIP, walk_along([0, 1, 2, 3])) == NavWalk((0, 1, 2, 3), (1, 2, 2, 2))
    stay = Trip("line", Pose(1), (1,), ("stay",))
    assert world.reward(stay, walk_along([1])) == 1 and world.reward(stay, walk_along([1, 2])) == 0


def test_the_marginal_walks_shortest_paths_of_two_to_six_edges():
    marginal, trip = NavMarginal({"grid": GRID}), Trip("grid", Pose(5), (5, 6), ("x",))
    found = marginal.draw([trip] * 200, rng=stream(0, "m"))
    assert {len(w.nodes) - 1 for w in found} <= set(range(2, 7)) and len({len(w.nodes) for w in found}) > 2
    for w in found:
        assert w.nodes == GRID.graph.path(5, w.nodes[-1])
    assert len({w.nodes[-1] for w in found}) > 8


def test_tasks_of_one_path_are_one_trip():
    routes = [Route(f"r{k}", (0, 1, 2), 0, 0, text) for k, text in enumerate(("a", "b", "c"))]
    (trip,) = trips_of("line", routes)
    assert trip.requests == ("a", "b", "c") and trip.path == (0, 1, 2)


def eyes(place, name: str, texts) -> NavEyes:
    features = stream(0, "features").normal(size=(len(place.graph.ids), 36, 8)).astype(np.float32)
    return NavEyes({name: place}, FeatureBank({name: features}, "hand"), build_vocabulary(texts))


def student(look: NavEyes, seed: int = 0, kind=NavStudent, **settings) -> NavStudent:
    config = NavConfig(hidden_size=32, heads=2, **settings)
    return kind(new_follower(config, look, seed, "student"), look, config)


def test_what_is_learned_besides_is_by_hand_the_way_that_is_left_and_the_rooms():
    look = eyes(GRID, "grid", ["go"])
    trip, path = Trip("grid", Pose(5), (5, 6), ("go",)), walk_along([5, 6, 7])
    plain, other = student(look), student(look, progress_weight=0.5, room_weight=0.25)
    other.network.load_state_dict(plain.network.state_dict())
    with torch.no_grad():
        a, b = (s.scores([trip], ["go"], [path]) for s in (plain, other))
        assert torch.equal(a.log_probabilities, b.log_probabilities) and not a.auxiliary_loss.any()
        track = Track(look, trip)
        said, _ = other.network(other.network.begin(look.words(["go"])), look.see([track]))
    rooms = [kind_of(GRID, n) for n in (5, *(p.node for p in track.ways.poses))]
    named = -said.rooms[0].log_softmax(-1)[torch.arange(len(rooms)), rooms].mean()
    assert float(b.auxiliary_loss[0, 0]) == pytest.approx(
        0.5 * float((said.left - 1) ** 2) + 0.25 * float(named), abs=1e-5
    )


def kind_of(place, node: int) -> int:
    return ROOM_KINDS.index(place.house.room_by_id[str(place.graph.room_of_node[node])].kind)


def test_who_is_guided_all_the_way_arrives_and_who_is_not_is_on_its_own():
    look = eyes(GRID, "grid", ["go"])
    trips = [Trip("grid", Pose(n), GRID.graph.path(n, 15), ("go",)) for n in (0, 5, 10)]
    asked, walks = ["go"] * 3, {}
    for share in (0.0, 1.0):
        walks[share] = student(look, guided=share).rollout_for_dagger(trips, asked, rng=stream(0, "p"))
    assert walks[1.0] == [walk_along(t.path) for t in trips]
    assert walks[0.0] == student(look).sample(trips, asked, rng=stream(0, "p"))


def test_dropout_is_for_learning_alone():
    look = eyes(GRID, "grid", ["go"])
    walker = student(look, dropout=0.5, environment_dropout=0.5)
    trip, walk = [Trip("grid", Pose(5), (5, 6), ("go",))], [walk_along([5, 6])]
    drawn = [float(walker.scores(trip, ["go"], walk).log_probabilities.sum().detach()) for _ in range(4)]
    with torch.no_grad():
        judged = [float(walker.scores(trip, ["go"], walk).log_probabilities.sum()) for _ in range(4)]
    assert len(set(drawn)) == 4 and len(set(judged)) == 1
    assert not walker.network.training


def test_the_blind_see_directions_and_nothing_else():
    look = eyes(GRID, "grid", ["go"])
    seen = look.blind().see([Track(look.blind(), Trip("grid", Pose(5, 3), (5, 6), ("go",)))])
    size = look.bank.size
    assert not seen.views[..., :size].any() and not seen.actions[..., :size].any()
    ahead = seen.views[0, 12 + 3, size:]
    assert torch.allclose(ahead, orientation(torch.zeros(()), torch.zeros(()), COPIES), atol=1e-6), "where it looks"


def test_scores_are_those_of_the_steps_that_were_sampled():
    look = eyes(GRID, "grid", ["go"])
    walker, trips = student(look), [Trip("grid", Pose(n), (n,), ("go",)) for n in (5, 6, 0)]
    done = walker.sample(trips, ["go"] * 3, rng=stream(0, "s"))
    assert all(b in GRID.graph.neighbours(a) for w in done for a, b in zip(w.nodes, w.nodes[1:]))
    found = walker.scores(trips, ["go"] * 3, done)
    assert found.mask.sum(1).tolist() == [len(w.steps) for w in done]
    alone = walker.scores(trips[1:2], ["go"], done[1:2]).log_probabilities[0]
    assert torch.allclose(found.log_probabilities[1, : len(alone)], alone, atol=1e-5), "whoever walks beside"
    stay = walker.scores(trips[:1], ["go"], [walk_along([5])])
    others = [walker.scores(trips[:1], ["go"], [NavWalk((5,), (n,))]) for n in GRID.graph.neighbours(5)]
    total = sum(float(s.log_probabilities.detach().exp().sum()) for s in (stay, *others))
    assert total == pytest.approx(1, abs=1e-5), "stopping and every neighbour"


def test_a_student_walks_the_same_way_whoever_walks_beside():
    walker = student(eyes(GRID, "grid", ["go", "to", "the", "end"]))
    trips = [Trip("grid", Pose(k % 16), (k % 16,), ("go",)) for k in range(33)]
    asked = [("go", "go to the end")[k % 2] for k in range(33)]
    walked_by = lambda n: [w for k in range(0, 33, n) for w in walker.greedy(trips[k : k + n], asked[k : k + n])]
    assert walked_by(1) == walked_by(5) == walked_by(32)


class Scripted(LearnedNavTeacher):
    """Its executor goes where a description says, nodes apart by blanks."""

    def __init__(self, drafts: list[str]) -> None:
        self.world, self.candidates, self.drafts = NavWorld({"line": LINE}), 1, drafts

    def candidates_of(self, trips, walks, uniforms=None):
        return [self.drafts for _ in walks]

    def fits(self, cases):
        return [arrives(self.world, trip, [int(n) for n in d.split()], walk.nodes) for trip, walk, d in cases]


def test_near_walks_get_a_persons_request_and_others_what_is_executed_alike():
    one = lambda t, nodes: t.describe([TRIP], [walk_along(nodes)], rng=stream(0, "d"))[0]
    assert one(Scripted([]), [0, 1, 2]) in TRIP.requests, "SDTW 1"
    assert one(Scripted(["0 1 2 3", "0"]), [0]) == "0", "the first ends elsewhere"
    assert one(Scripted(["0 1 2 3"]), [0]) is None


def test_walks_are_read_and_described_whoever_is_beside():
    look = eyes(GRID, "grid", ["go to the end"])
    torch.manual_seed(0)
    describer = WalkDescriber(len(look.vocabulary), 32, 2, look.size, HORIZON)
    trips = [Trip("grid", Pose(n), (n,), ("go",)) for n in (5, 0)]
    walks = [walk_along([5, 6, 7]), walk_along([0])]
    both = look.vocabulary.texts(describer.write(*encoded_walks(look, trips, walks), greedy_choice, 6).tolist())
    written = describer.write(*encoded_walks(look, trips[1:], walks[1:]), greedy_choice, 6)
    alone = look.vocabulary.texts(written.tolist())
    assert both[1:] == alone
    teacher = LearnedNavTeacher(NavWorld({"grid": GRID}), describer, student(look), 2)
    found = teacher.describe(trips, walks, rng=stream(0, "t"))
    assert found[1] == "go" and (found[0] is None or isinstance(found[0], str))


GOALS = (1, 4, 6, 9, 2)


def names_the_end(world, path, yaw, *, rng) -> str:
    """A wording that names the last node."""
    return f"go to n{path[-1]}"


class NearMarginal:
    """Shortest paths to GOALS from node 5."""

    def draw(self, tasks, *, rng):
        return [walk_along(GRID.graph.path(5, GOALS[int(i)])) for i in rng.integers(len(GOALS), size=len(tasks))]


@pytest.mark.slow
def test_a_small_student_learns_its_way_from_descriptions(tmp_path):
    """More than 90 % of requests, from walks that it made up and what a neighbour said of them."""
    places = {"grid": GRID}
    trips = [Trip("grid", Pose(5), GRID.graph.path(5, g), (f"go to n{g}",)) for g in GOALS]
    look = eyes(GRID, "grid", [t.requests[0] for t in trips])
    teacher = GrammarNavTeacher(NavWorld(places), places, names_the_end)
    walker, explorer = student(look), student(look, kind=LoopFree)
    problem = IliadProblem(
        NavWorld(places),
        teacher,
        NearMarginal(),
        walker,
        explorer,
        trips * 20,
        trips,
        {"world": "grid"},
        lambda *_: None,
    )
    config = LearnerConfig(iterations=80, batch=12, learning_rate=5e-3, cooldown=0.4, validate_every=40)
    found = train(problem, config, tmp_path, note=lambda line: None)
    assert found[-1]["success"] > 0.9, found
    assert success_rate(problem.world, walker, trips) == found[-1]["success"]
