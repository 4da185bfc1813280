"""What a judged HANNA agent does with the map that it draws, and with the image of where to go."""

from __future__ import annotations

import numpy as np

from agents.hanna.asking import ask_patiently
from agents.hanna.trail import Trail, opposite, weigh_by_image
from embodied.interface import Ask, Candidates, Intention, Mode, Move, Observation, Sight


def test_a_trail_knows_the_way_back_and_how_often_it_was_there():
    def seen(node: int, views: list[int], words: str = "go") -> Observation:
        n = len(views)
        flat = np.zeros(n, dtype=np.float32)
        candidates = Candidates(flat, flat, np.array(views), np.ones(n, dtype=bool))
        return Observation(Sight("house", node), 0, 0, candidates, words, None, Mode.MAIN, (), None, 0, 0)

    first, second = seen(0, [12, 15]), seen(1, [18, 21])  # 12 is level, along +x; 18 lies behind it
    trail = Trail().here(first)
    assert trail.times(first).tolist() == [0, 0]
    trail = trail.left(first, Move(0)).here(second)
    assert trail.times(second).tolist() == [1, 0], "the way back leads to where one visit was"
    assert trail.times(seen(1, [18, 21], "turn")).tolist() == [0, 0], "other words begin anew"
    trail = trail.left(second, Ask(Intention.HELP)).here(second).left(second, Move(0)).here(first)
    assert trail.times(first).tolist() == [2, 0], "a step that asks is a visit, too"
    assert trail.left(first, Move(0)).here(second).times(second).tolist() == [2, 0]
    assert (opposite(0), opposite(7), opposite(17), opposite(35)) == (30, 25, 23, 5)


def test_who_is_shown_where_to_go_stops_there_alone_and_goes_straight_to_where_it_was():
    """A corridor of three places along +x, walked from end to end; the way back is known, the way on is not."""

    def seen(node: int, views: list[int], target: int | None) -> Observation:
        n = len(views)
        flat = np.zeros(n, dtype=np.float32)
        candidates = Candidates(flat, flat, np.array(views), np.ones(n, dtype=bool))
        image = None if target is None else Sight("house", target)
        return Observation(Sight("house", node), 0, 0, candidates, "go", image, Mode.MAIN, (), None, 0, 0)

    ahead, behind, likely = 12, 18, np.array([0.5, 0.4, 0.1])
    trail = Trail()
    for node, views in ((0, [ahead]), (1, [ahead, behind])):
        o = seen(node, views, None)
        trail = trail.here(o).left(o, Move(0))
    end = seen(2, [ahead, behind], 0)
    trail = trail.here(end)
    assert trail.ways(end.sight) == {Sight("house", k): (2 - k, None if k == 2 else behind) for k in range(3)}
    assert trail.ways(Sight("house", 0))[end.sight] == (2, ahead)
    told = lambda target: weigh_by_image(trail, seen(2, [ahead, behind], target), likely)
    assert told(0)[0].tolist() == [0.0, 0.0, 0.1] and told(0)[1], "it knows the way back, however unlikely it seems"
    assert told(2)[0].tolist() == [1.0, 0.0, 0.0] and told(2)[1], "it is there"
    assert told(9)[0].tolist() == [0.0, 0.4, 0.1] and not told(9)[1], "it has not been there: on, without stopping"
    assert told(None)[0].tolist() == likely.tolist() and not told(None)[1]
    walled = weigh_by_image(trail, seen(2, [], 9), np.ones(1))
    assert walled[0].tolist() == [1.0], "who cannot move stops"


def test_who_looks_for_what_it_was_shown_goes_back_to_the_way_that_seemed_best():
    """At the first place two ways seemed likely, 12 and 15; 12 was taken and ends blind."""
    image, words = Sight("house", 9), "find a mug"

    def seen(node: int, views: list[int], mode: Mode = Mode.MAIN) -> Observation:
        n = len(views)
        flat = np.zeros(n, dtype=np.float32)
        candidates = Candidates(flat, flat, np.array(views), np.ones(n, dtype=bool))
        return Observation(Sight("house", node), 0, 0, candidates, words, image, mode, (), None, 3, 3)

    first, second, blind = seen(0, [12, 15]), seen(1, [18, 20]), seen(2, [14])  # 18 leads back, 20 on to the blind end
    trail = Trail().here(first).thinking(first, np.array([0.6, 0.3]))
    assert trail.untried(first, 0.2) == 12
    trail = trail.left(first, Move(0)).here(second).thinking(second, np.array([0.9, 0.05]))
    assert trail.untried(second, 0.2) == 18, "0.3, one move back, is worth more than 0.05 ahead"
    assert trail.untried(second, 0.1) == 20, "not if a move back costs more"
    trail = trail.left(second, Move(1)).here(blind).thinking(blind, np.array([0.9]))
    assert trail.untried(blind, 0.2) == opposite(20) == 14, "back, and back again, to 15"
    weights, known = weigh_by_image(trail, second, np.array([0.2, 0.1, 0.7]), 0.2)
    assert weights.tolist() == [0.0, 0.1, 0.0] and not known
    weights, _ = weigh_by_image(trail, seen(1, [18, 20], Mode.SUB), np.array([0.2, 0.1, 0.7]), 0.2)
    assert weights.tolist() == [0.0, 0.1, 0.7], "on a route it follows the words"
    everywhere = trail.left(blind, Move(0)).here(second).left(second, Move(0)).here(first).left(first, Move(1))
    assert everywhere.here(seen(3, [21])).untried(first, 0.2) is None


def test_asking_patiently_waits_after_a_route_and_asks_sooner_before_the_first():
    flat = np.zeros(0, dtype=np.float32)
    nowhere = Candidates(flat, flat, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool))

    def asks(probability: float, target: Sight | None, mode: Mode, time_on_task: int) -> bool:
        o = Observation(Sight("house", 0), 0, 0, nowhere, "go", target, mode, (), None, 9, time_on_task)
        return ask_patiently(0.5, first=0.25, on_route=0.7, patience=2)(probability, o, -1, rng=None)

    image = Sight("house", 1)
    assert asks(0.3, None, Mode.MAIN, 0) and not asks(0.2, None, Mode.MAIN, 9)
    assert not asks(0.3, image, Mode.MAIN, 5) and asks(0.6, image, Mode.MAIN, 2)
    assert not asks(0.9, image, Mode.MAIN, 1), "it has just left a route"
    assert asks(0.8, image, Mode.SUB, 0), "on a route it may ask at once"
    assert not asks(0.6, image, Mode.SUB, 5), "the next person may send it elsewhere"
