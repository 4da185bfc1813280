"""What a judged HANNA agent does with the map that it draws, and with the image of where to go."""

from __future__ import annotations

import dataclasses

import numpy as np

from embodied.agents.hanna.topological_map import PlaceMap, Trail, matches, opposite, weigh_by_image
from embodied.agents.learners.hanna import ask_above
from embodied.interface import Ask, Candidates, Intention, Mode, Move, Observation, Sight

LOOKS = np.random.default_rng(0).normal(size=(12, 36, 24)).astype(np.float32)
"""(12, 36, 24) features of twelve places, which look nothing like each other."""


def seen(node: int, views: list[int], words: str = "go", mode: Mode = Mode.MAIN) -> Observation:
    n = len(views)
    flat = np.zeros(n, dtype=np.float32)
    candidates = Candidates(flat, flat, np.array(views), np.ones(n, dtype=bool))
    return Observation(Sight("house", node), 0, 0, candidates, words, None, mode, (), None, 3, 3)


def test_a_trail_knows_the_way_back_and_how_often_it_was_there():
    first, second = seen(0, [12, 15]), seen(1, [18, 21])  # 12 is level, along +x; 18 lies behind it
    trail = Trail().here(first, LOOKS[0])
    assert trail.times(first).tolist() == [0, 0]
    trail = trail.left(first, Move(0)).here(second, LOOKS[1])
    assert trail.times(second).tolist() == [1, 0], "the way back leads to where one visit was"
    assert trail.times(seen(1, [18, 21], "turn")).tolist() == [0, 0], "other words begin anew"
    trail = trail.left(second, Ask(Intention.HELP)).here(second, LOOKS[1]).left(second, Move(0)).here(first, LOOKS[0])
    assert trail.times(first).tolist() == [2, 0], "a step that asks is a visit, too"
    assert trail.left(first, Move(0)).here(second, LOOKS[1]).times(second).tolist() == [2, 0]
    assert (opposite(0), opposite(7), opposite(17), opposite(35)) == (30, 25, 23, 5)


def test_who_is_shown_where_to_go_stops_there_alone_and_goes_straight_to_where_it_was():
    """A corridor of three places along +x, walked from end to end; the way back is known, the way on is not."""
    ahead, behind, likely = 12, 18, np.array([0.5, 0.4, 0.1])
    trail = Trail()
    for node, views in ((0, [ahead]), (1, [ahead, behind])):
        o = seen(node, views)
        trail = trail.here(o, LOOKS[node]).left(o, Move(0))
    end = seen(2, [ahead, behind])

    def told(target: int | None) -> tuple[np.ndarray, bool]:
        picture = None if target is None else turned(LOOKS[target], 5)
        return weigh_by_image(trail.here(end, LOOKS[2], picture), end, likely)

    arrived = trail.here(end, LOOKS[2])
    assert arrived.ways() == {k: (2 - k, None if k == 2 else behind) for k in range(3)}
    assert arrived.here(seen(0, [ahead]), LOOKS[0]).ways()[2] == (2, ahead)
    assert told(0)[0].tolist() == [0.0, 0.0, 0.1] and told(0)[1], "it knows the way back, however unlikely it seems"
    assert told(2)[0].tolist() == [1.0, 0.0, 0.0] and told(2)[1], "it is there"
    assert told(9)[0].tolist() == [0.0, 0.4, 0.1] and not told(9)[1], "it has not been there: on, without stopping"
    assert told(None)[0].tolist() == likely.tolist() and not told(None)[1]
    nowhere = seen(2, [])
    walled = weigh_by_image(trail.here(nowhere, LOOKS[2], LOOKS[9]), nowhere, np.ones(1))
    assert walled[0].tolist() == [1.0], "who cannot move stops"


def test_who_looks_for_what_it_was_shown_goes_back_to_the_way_that_seemed_best():
    """At the first place two ways seemed likely, 12 and 15; 12 was taken and ends blind."""

    def step(trail: Trail, o: Observation, node: int) -> Trail:
        return trail.here(o, LOOKS[node], LOOKS[9])

    first, second, blind = seen(0, [12, 15]), seen(1, [18, 20]), seen(2, [14])  # 18 leads back, 20 on to the blind end
    trail = step(Trail(), first, 0).thinking(first, np.array([0.6, 0.3]))
    assert trail.untried(first, 0.2) == 12
    trail = step(trail.left(first, Move(0)), second, 1).thinking(second, np.array([0.9, 0.05]))
    assert trail.untried(second, 0.2) == 18, "0.3, one move back, is worth more than 0.05 ahead"
    assert trail.untried(second, 0.1) == 20, "not if a move back costs more"
    before, trail = trail, step(trail.left(second, Move(1)), blind, 2).thinking(blind, np.array([0.9]))
    assert trail.untried(blind, 0.2) == opposite(20) == 14, "back, and back again, to 15"
    weights, known = weigh_by_image(step(trail, second, 1), second, np.array([0.2, 0.1, 0.7]), 0.2)
    assert weights.tolist() == [0.0, 0.1, 0.0] and not known
    weights, _ = weigh_by_image(before, seen(1, [18, 20], mode=Mode.SUB), np.array([0.2, 0.1, 0.7]), 0.2)
    assert weights.tolist() == [0.0, 0.1, 0.7], "on a route it follows the words"
    everywhere = step(step(trail.left(blind, Move(0)), second, 1).left(second, Move(0)), first, 0).left(first, Move(1))
    assert step(everywhere, seen(3, [21]), 3).untried(first, 0.2) is None


def turned(panorama: np.ndarray, turns: int) -> np.ndarray:
    """A panorama as a picture whose first view looks `turns` * 30 degrees to the left."""
    return np.concatenate([np.roll(panorama[12 * band : 12 * band + 12], -turns, 0) for band in range(3)])


def test_a_picture_is_recognised_whichever_way_it_was_taken_and_though_it_shows_one_view_alone():
    noise = np.random.default_rng(1).normal(size=(36, 24)).astype(np.float32)
    one = np.zeros_like(noise)
    one[12] = LOOKS[3, 12 + 7]
    for picture in (turned(LOOKS[3], 7), turned(LOOKS[3] + 0.5 * noise, 7), one):
        scores = matches(picture, LOOKS[:8], np.zeros(24, np.float32))
        assert scores.argmax() == 3 and scores[3] > 0.8 and np.delete(scores, 3).max() < 0.7
    straight = matches(turned(LOOKS[3], 7), LOOKS[:8], np.zeros(24, np.float32), turned=False)
    assert straight.max() < 0.5, "between panoramas of known headings turns do not count"


def test_what_all_places_of_a_house_have_in_common_does_not_make_them_one():
    """White walls: most of every feature is the house's own."""
    house = 3 * np.ones(24, np.float32)
    places, numbers = PlaceMap(), []
    for node in (0, 1, 2, 1, 0, 3):
        places, number = places.seen(LOOKS[node] + house)
        numbers.append(number)
    assert numbers == [0, 1, 2, 1, 0, 3]
    places, picture = places.shown(turned(LOOKS[2] + house, 4))
    assert places.find(picture)[0] == 2
    places, other = places.shown(LOOKS[7] + house)
    assert places.find(other)[0] is None


def test_who_sees_black_recognises_nothing():
    black = np.zeros((36, 24), np.float32)
    places, first = PlaceMap().seen(black)
    places, second = places.seen(black)
    places, picture = places.shown(black)
    assert first != second and places.find(picture)[0] is None


def test_asking_patiently_waits_after_a_route_and_asks_sooner_before_the_first():
    def asks(probability: float, target: Sight | None, mode: Mode, time_on_task: int) -> bool:
        o = dataclasses.replace(seen(0, [], mode=mode), target=target, time_on_task=time_on_task)
        return ask_above(0.5, first=0.25, on_route=0.7, patience=2)(probability, o, -1, rng=None)

    image = Sight("house", 1)
    assert asks(0.3, None, Mode.MAIN, 0) and not asks(0.25, None, Mode.MAIN, 9)
    assert not asks(0.3, image, Mode.MAIN, 5) and asks(0.6, image, Mode.MAIN, 2)
    assert not asks(0.9, image, Mode.MAIN, 1), "it has just left a route"
    assert asks(0.8, image, Mode.SUB, 0), "on a route it may ask at once"
    assert not asks(0.6, image, Mode.SUB, 5), "the next person may send it elsewhere"
