"""Questions about houses: answers are what the house says, words fit one thing only, and no blind model gets far."""

from __future__ import annotations

import dataclasses
import json
import math
from collections import Counter

import cv2
import numpy as np
import pyarrow.parquet as pq
import pytest
from conftest import two_rooms
from hand_chat import ChatServer, first_allowed, said

from embodied.agents.vision.answers import strip_of_frames
from embodied.assets.catalogue import load_catalogue
from embodied.assets.moving_parts import OPEN
from embodied.assets.people.figures import person_of
from embodied.cli import main
from embodied.datasets.vqa.build import VqaData, asked_about
from embodied.datasets.vqa.scene import ASKING, WalkScene, recognised
from embodied.datasets.vqa.scoring import (
    BLIND,
    LETTERS,
    VqaQuestion,
    accuracy,
    chance,
    cross_judged,
    less_guessed,
    narrowed,
    score,
    thinned,
)
from embodied.datasets.vqa.types import TYPES, set_offs
from embodied.datasets.vqa.walks import CLEAR_SHARE, Walk, WalkFrame, fronts_of, hull, points_of, stands_open
from embodied.house.house import House, Placement, Storey
from embodied.house.moment import RigidPose
from embodied.language.lexicon import ROOM_NOUNS
from embodied.language.plain_language import plural
from embodied.navigation.floor_ways import FloorWays
from embodied.navigation.graph import build_graph

THINGS = {
    "sofa": (1, 3),
    "armchair": (4.3, 3.3),
    "bookcase": (4.6, 0.3),
    "bed": (7.5, 3),
    "desk": (8, 0.6),
    "stool": (3, 1),
}


def scene(clear=None, second_sofa=False, person=None) -> WalkScene:
    """A walk through the two rooms that shows all of their things, clearly or some of them not."""
    catalogue, house = load_catalogue(None), two_rooms()
    spots = [(f"{name}_1", at) for name, at in THINGS.items()] + [("sofa_2", (6, 1))] * second_sofa
    for name, (x, y) in spots:
        asset = catalogue.of_class(name[:-2])[0]
        room = "living_room_1" if x < 5 else "bedroom_1"
        p = Placement(name, asset.key, name[:-2], room, (float(x), float(y), 0.0), 0.0, asset.size)
        house = dataclasses.replace(house, placements=(*house.placements, p))
    house = dataclasses.replace(house, placements=(*house.placements, *([person] if person else [])))
    ids = [p.id for p in house.placements]
    frame = WalkFrame((2.5, 2.0, 1.5), 0.0, dict.fromkeys(ids, 0.3), tuple(ids if clear is None else clear))
    walk = Walk("hand_0000_0", "hand_0000", ("living_room_1", "bedroom_1"), (frame,) * 3)
    return WalkScene(walk, house, build_graph(two_rooms()), catalogue)


@pytest.fixture(scope="module")
def hand() -> tuple[WalkScene, list[VqaQuestion]]:
    s = scene()
    return s, asked_about(s, 60, seed=0)


def test_answers_follow_from_where_things_are(hand):
    s, questions = hand
    place, kinds = s.house.placement_by_id, {q.type for q in questions}
    assert {"object_abs_distance", "object_rel_direction_easy", "object_size_estimation"} <= kinds
    for q in questions:
        spots = [np.array(place[i].position[:2]) for i in q.about if i in place]
        if q.type.startswith("object_rel_direction"):
            (a, b), c = (spots[1] - spots[0]), spots[2] - spots[0]
            left = a * c[1] - b * c[0] > 0
            assert (("left" in q.answer) == left) or q.answer == "back"
        elif q.type == "object_abs_distance":
            middles = math.dist(*spots)
            assert float(q.answer) < middles <= float(q.answer) + 3.2
        elif q.type == "object_size_estimation":
            assert int(q.answer) == round(100 * max(place[q.about[0]].size))
        elif q.type == "room_size_estimation":
            assert float(q.answer) == pytest.approx({"living_room_1": 18.9, "bedroom_1": 15.1}[q.about[0]], abs=0.1)


def test_people_have_a_left_and_right_of_their_own():
    people = load_catalogue(None).of_class("person")
    key = next(a.key for a in people if {"male", "standing"} <= {*a.tags})
    man = Placement("person_1", key, "person", "living_room_1", (2.5, 0.6, 0.0), math.pi, (0.6, 0.4, 1.8))
    asked = [q for q in asked_about(scene(person=man), 60, seed=0) if q.type == "person_side"]
    answers = {q.about[1]: q.answer for q in asked}  # he looks along y
    assert answers["sofa_1"] == "left" and answers["armchair_1"] == "right" and "the man" in asked[0].text


def test_people_without_a_head_and_slivers_are_not_recognised():
    man = Placement("man_1", "", "person", "", (2.5, 0.0, 0.0), 0.0, (0.5, 0.4, 1.8))
    cup = Placement("cup_1", "", "cup", "", (2.5, 0.0, 1.0), 0.0, (0.1, 0.1, 0.1))
    near, far = (WalkFrame((x, 0.0, 1.5), 0.0, {"man_1": 0.2, "cup_1": 0.005}) for x in (1.7, 0.0))
    assert recognised(man, far) and not recognised(man, near)  # the upper edge cuts him at the neck
    away = dataclasses.replace(man, yaw=math.pi / 2)  # his back to the camera
    assert recognised(dataclasses.replace(man, yaw=0.0), far) and not recognised(away, far)
    picture = dataclasses.replace(cup, object_class="picture", size=(0.6, 0.03, 0.6), yaw=0.0)
    shown = dataclasses.replace(far, shares={"cup_1": 0.1})
    assert recognised(picture, shown) and not recognised(picture, shown, "wall")  # it looks past the camera
    assert recognised(cup, dataclasses.replace(far, shares={"cup_1": 0.001})) and not recognised(cup, near)


def test_no_question_is_about_what_is_only_glimpsed():
    clear = [f"{name}_1" for name in THINGS if name != "sofa"]
    questions = asked_about(scene(clear=clear), 60, seed=0)
    assert questions and not any("sofa_1" in q.about for q in questions)


def test_a_name_means_one_thing_to_who_reads_it(hand):
    s = hand[0].asked("support", np.random.default_rng(0))
    sofa = s.house.placement_by_id["sofa_1"]
    assert s.meant(s.name(sofa).removeprefix("the ")) == [sofa]
    both = scene(second_sofa=True).asked("support", np.random.default_rng(0))
    rooms = {both.name(both.house.placement_by_id[i]).rpartition(" in the ")[2] for i in ("sofa_1", "sofa_2")}
    assert len(rooms) == 2 and rooms <= {*ROOM_NOUNS["living_room"], *ROOM_NOUNS["bedroom"]}


def test_the_next_step_has_no_other_way_as_short():
    table = Placement("table_1", "", "table", "living_room_1", (2.5, 2.0, 0.0), 0.0, (1.4, 1.8, 0.8))
    ground = FloorWays(dataclasses.replace(two_rooms(), placements=(table,)))

    def around(y: float) -> list[float]:
        feet = np.array([1.1, y, 0.0])
        walked = ground.ways(np.array([ground.cell_at(feet)])).metres
        ways = set_offs(ground, feet, walked, ground.cell_at(np.array([4.4, y])))
        return [math.degrees(x) for x in ways]

    left, right = sorted(around(2.0))
    assert -90 < left < -30 and 30 < right < 90 and len(around(3.4)) == 1


def test_rooms_of_one_kind_are_told_apart_by_their_floor():
    house = scene().house
    below, above = (dataclasses.replace(r, kind="bedroom", storey=k) for k, r in enumerate(house.rooms))
    house = dataclasses.replace(house, rooms=(below, above), storeys=(*house.storeys, Storey(2.8, 2.5)))
    s = WalkScene(scene().walk, house, build_graph(two_rooms()), load_catalogue(None))
    assert {s.room_name(r.id).partition(" on the ")[2] for r in house.rooms} == {"ground floor", "upper floor"}


def test_what_is_counted_is_in_a_room_or_in_the_video():
    counted = [q for q in asked_about(scene(second_sofa=True), 60, seed=0) if q.type == "object_counting"]
    assert {(q.answer, "video" in q.text) for q in counted} == {("2", True)}  # one sofa in each room


def test_words_that_mislead_are_words_of_things():
    of = scene().lexicon
    nouns = {n for nouns in of.nouns_of.values() for n in nouns}
    groups = [ASKING["alike"], ASKING["parts"], ASKING["parts"].values(), ASKING["together"].values()]
    groups += [[ASKING[k]] for k in ("oversized", "upright", "underfoot", "worktops", "colourless")]
    classes = {c for some in groups for group in some for c in ([group] if isinstance(group, str) else group)}
    assert {*ASKING["unsaid"]} <= nouns and classes <= {*of.nouns_of}
    assert {*ASKING["unlike"]} <= {*of.nouns_of, *load_catalogue(None).assets}


def test_furniture_is_open_where_its_door_and_its_inside_are_seen_and_shut_where_all_its_front_is():
    catalogue, rng = load_catalogue(None), np.random.default_rng(0)
    asset = next(a for a in catalogue.of_class("base cabinet") if a.size[0] < 0.7)
    shut = Placement("cabinet_1", asset.key, "base cabinet", "kitchen_1", (3.0, 1.0, 0.0), 0.5, asset.size)
    door = next(m for m in fronts_of(shut, catalogue) if m.kind == "door")
    pose = RigidPose.upright(shut.position, shut.yaw)
    wide, (turn, shift) = dataclasses.replace(shut, params=((OPEN + door.name, 0.7),)), door.turn(0.7)
    front, inside = (box[0] + rng.random((99, 3)) * np.ptp(box, axis=0) for box in (door.box, door.inside))
    inside[:, 1] = door.inside[1, 1]
    leaf = front @ turn.T + shift

    def shown(p: Placement, *seen: np.ndarray, side: int = -1) -> bool | None:
        at = pose.points(np.array([[0.0, 2.0 * side, 1.5]]))[0]
        return stands_open(p, [door], pose.points(np.concatenate(seen)), at, shut.yaw - side * math.pi / 2)

    assert shown(wide, leaf, inside) is True and shown(shut, front) is False
    assert {shown(wide, leaf), shown(wide, inside), shown(shut, front, side=1), shown(shut, inside)} == {None}


def test_the_points_of_a_frame_fill_it():
    there = hull(points_of(np.full((360, 480), 2.0), (1.0, 2.0, 1.5), 0.7), (1.0, 2.0, 1.5), 0.7)
    assert np.abs(there).max() == pytest.approx(1, abs=0.01) and cv2.contourArea(there) == pytest.approx(4, abs=0.05)


def test_the_same_seed_asks_the_same(hand):
    assert asked_about(scene(), 60, seed=0) == hand[1] != asked_about(scene(), 60, seed=1)


def test_numbers_are_scored_as_by_vsi_bench():
    assert accuracy(np.array([2.0, 1.5, 9.0]), np.full(3, 2.0)).tolist() == pytest.approx([1, 0.6, 0])
    choice = VqaQuestion("c", "w", "support", "What?", "mug", ("cup", "mug"))
    assert score(choice, "B.") == 1 and score(choice, "A") == 0 and "A. cup\nB. mug" in choice.prompt
    assert chance([VqaQuestion("c", "w", "support", "What?", "mug", ("cup", "mug"))]) == 0.5


def test_each_side_is_right_for_the_same_three_things(hand):
    sides = dict[tuple[str, ...], set[str]]()
    for q in hand[1]:
        if q.type == "object_rel_direction_easy":
            sides.setdefault(tuple(sorted(q.about)), set()).add(q.answer)
    assert len(sides) > 2 and all(x == {"left", "right"} for x in sides.values())


def test_what_is_offered_is_no_more_often_right_than_chance_has_it():
    rng, nouns = np.random.default_rng(0), [f"noun{k}" for k in range(20)]

    def asked(k: int) -> VqaQuestion:
        right = nouns[int(20 * rng.random() ** 3)]  # the first are right most often
        wrong = [str(n) for n in rng.permutation(nouns) if n != right][:12]
        about = ("desk_1", f"{right}_1", *(f"{n}_1" for n in wrong))
        return VqaQuestion(str(k), f"w_{k}_0", "nearest", "Which is nearest?", right, (right, *wrong), about)

    kept = narrowed([asked(k) for k in range(400)], 0)
    rights, offered = Counter(q.answer for q in kept), Counter(o for q in kept for o in q.options)
    assert len(kept) > 200 and all(n <= 0.25 * offered[o] + 2 for o, n in rights.items())
    assert all({i[:-2] for i in q.about[1:]} == {*q.options} and q.about[1] == f"{q.answer}_1" for q in kept)
    assert max(Counter(q.letter for q in kept).values()) - len(kept) / 4 < 1


def test_questions_that_can_be_guessed_are_thinned_until_they_cannot():
    rng, nouns = np.random.default_rng(0), ["bed", "mug", "sofa", "lamp", "vase", "desk", "rug", "stool"]

    def asked(guessable: float) -> list[VqaQuestion]:
        out = []
        for k in range(400):
            options = [str(o) for o in rng.permutation(nouns)[:4]]
            right = "bed" if "bed" in options and rng.random() < guessable else options[rng.integers(4)]
            walk = f"{'train' if k % 4 else 'test'}_{k // 10:04d}_0"
            out.append(VqaQuestion(str(k), walk, "support", "What is there?", right, tuple(options)))
        return out

    assert max(cross_judged(m, asked(0.9), 5)[0].mean() for m in BLIND) > 0.4
    left = thinned(asked(0.9), 0)
    test = [q.walk.startswith("test") for q in left]
    judged = [cross_judged(m, left, 5)[0] for m in BLIND]
    assert 50 < len(left) < 380 and max(scores.mean() for scores in judged) < 0.33
    assert sum(test) > 10 and max(scores[test].mean() for scores in judged) < 0.4
    assert len(thinned(asked(0.0), 0)) > 300


def test_no_more_is_left_out_than_a_model_guesses():
    asked = [VqaQuestion(str(k), "w_0_0", "sun", "Where?", "a", ("a", "b")) for k in range(100)]
    half, sure = np.arange(100) % 2, np.arange(100.0)
    assert less_guessed(asked, half, sure) == asked
    assert less_guessed(asked, np.ones(100), sure) == []
    most = np.arange(100) < 60
    kept = [int(q.id) for q in less_guessed(asked, most.astype(float), sure)]
    assert np.mean(most[kept]) <= 0.53 and 80 < len(kept) < 90 and {*range(60, 100)} <= {*kept}


def test_a_look_around_becomes_a_strip_whose_middle_is_the_first_frame():
    strip = strip_of_frames([np.full((360, 480, 3), k, np.uint8) for k in range(12)])
    turns = np.repeat([6, 5, 4, 3, 2, 1, 0, 11, 10, 9, 8, 7], 48)  # what is to the left is seen later
    assert (strip == np.roll(turns, -24)[None, :, None]).all()


def names_of(key: str, other: str) -> dict[str, str]:
    """Two people who stand before the camera, by the names that fit one of them."""
    one = Placement("person_1", key, "person", "living_room_1", (2.5, 0.6, 0.0), math.pi, (0.6, 0.4, 1.8))
    s = scene(person=one)
    house = dataclasses.replace(
        s.house,
        placements=(
            *s.house.placements,
            dataclasses.replace(one, id="person_2", asset=other, position=(2.4, 1.2, 0.0)),
        ),
    )
    frames = tuple(
        dataclasses.replace(f, shares={**f.shares, "person_2": 0.6}, clear=(*f.clear, "person_2"))
        for f in s.walk.frames
    )
    walk = dataclasses.replace(s.walk, frames=frames)
    s = WalkScene(walk, house, s.graph, load_catalogue(None)).asked("person_room", np.random.default_rng(0))
    return {p.id: name for p, name in s.people()}


def test_people_are_told_apart_by_how_they_look():
    standing = {person_of(a.key).id: a.key for a in load_catalogue(None).of_class("person") if "standing" in a.tags}
    noun = {i: person_of(key).noun for i, key in standing.items()}
    key, other = [standing[i] for i in sorted(standing) if noun[i] == "woman" and i not in ASKING["taken_for"]][:2]
    assert names_of(key, other) == {
        "person_1": f"the {person_of(key).words}",
        "person_2": f"the {person_of(other).words}",
    }
    for i in ASKING["taken_for"]:  # who may be taken for another still is what they are
        like = next(key for j, key in standing.items() if j != i and noun[j] == noun[i])
        assert f"the {noun[i]}" not in names_of(like, standing[i]).values()


def test_plurals():
    nouns = ["mug", "box", "peace lily", "toy", "bookshelf", "row of books", "knife", "woman", "slippers", "laundry"]
    plurals = ["mugs", "boxes", "peace lilies", "toys", "bookshelves", "rows of books", "knives", "women", "slippers"]
    assert [plural(n) for n in nouns] == [*plurals, "laundry"]


@pytest.mark.gl
@pytest.mark.slow
def test_the_command_makes_questions_about_what_the_frames_show(tmp_path, capsys):
    data = str(tmp_path / "vqa")
    small = ["--houses", "1", "--test-houses", "1", "--area", "38", "46", "--seed", "3", "--workers", "1"]
    assert main(["dataset", "vqa", "--out", data, *small, "--tasks", "60", "--pictures", "unlit"]) == 0
    questions = VqaData(data).questions("test")
    assert questions and {q.type for q in questions} <= {*TYPES}
    home = tmp_path / "vqa/houses/test_0000"
    q = next(q for q in questions if q.type == "object_abs_distance")
    owner = 1 + [p.id for p in House.load(home / "house.json").placements].index(q.about[0])
    frames = sorted((home / f"walk_{q.walk[-1]}").glob("*.png"))
    assert max((cv2.imread(str(f), -1) == owner).mean() for f in frames) >= CLEAR_SHARE
    within = 0
    for file in home.glob("walk_*/walk.json"):
        walk, ids = json.loads(file.read_text()), [cv2.imread(str(f), -1) for f in sorted(file.parent.glob("*.png"))]
        for name, i in walk["inside"].items():
            shares = [f["shares"].get(name, 0.0) for f in walk["frames"]]
            assert shares == pytest.approx([(m == i).mean() for m in ids], abs=1e-5) and max(shares) > 0
        within += len(walk["inside"])
    assert within > 3
    llm = ["evaluate", "vqa", "--data", data, "--agent", "llm", "blind", "--model", "m", "--frames", "2", "--json"]
    llm += ["--answers", str(tmp_path / "answers.sqlite")]
    with ChatServer(first_allowed) as server:
        assert main([*llm, "--base-url", server.url]) == 0
        content = server.requests[0]["messages"][1]["content"]
        assert [part["type"] for part in content] == ["text", "image_url", "image_url"]
    capsys.readouterr()
    assert main([*llm, "--offline"]) == 0
    table = json.loads(capsys.readouterr().out)
    nearest = [q.letter == "A" for q in questions if q.type == "object_rel_distance"]  # whoever always says A
    assert table["scores"]["llm"][table["types"].index("object_rel_distance")] == pytest.approx(np.mean(nearest))
    plain = [*llm[:-1], str(tmp_path / "plain.sqlite")]
    with ChatServer(lambda _: said("B.")) as server:
        assert main([*plain, "--base-url", server.url]) == 0
    shown = capsys.readouterr()
    second = [q.letter == "B" for q in questions if q.type == "object_rel_distance"]
    scores = json.loads(shown.out)["scores"]["llm"]
    assert scores[table["types"].index("object_rel_distance")] == pytest.approx(np.mean(second))
    assert f"{len(questions)} answers of {len(questions)} were no JSON" in shown.err
    assert {*table["scores"]} == {"chance", "llm", "network", *BLIND} and table["types"] == [
        *dict.fromkeys(q.type for q in questions)
    ]
    capsys.readouterr()
    assert main(["evaluate", "vqa", "--data", data, "--agent", "judge", "--json"]) == 0
    judged = json.loads(capsys.readouterr().out)["scores"]
    assert judged["judge"] != judged["judge, blind"] and min(judged["judge"]) >= 0
    assert (
        main(["evaluate", "vqa", "--data", data, "--agent", "judge", "blind", "--split", "train", "test", "--json"])
        == 0
    )
    both = json.loads(capsys.readouterr().out)
    assert sum(both["n"]) == len(questions) + len(VqaData(data).questions("train"))
    assert main(["view", data, "--episode", "0"]) == 0
    assert cv2.imread(f"{data}/sheets/0.png").shape[1] == 4 * 480
    for form in ("vsi", "llava", "sat", "openeqa"):
        assert main(["export", "vqa", "--data", data, "--out", str(tmp_path / form), "--form", form]) == 0
    rows = pq.read_table(tmp_path / "vsi/test.parquet").to_pylist()
    assert [r["ground_truth"] for r in rows] == [q.letter for q in questions]
    film = cv2.VideoCapture(str(tmp_path / f"vsi/vsibench/embodied/{rows[0]['scene_name']}.mp4"))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == len([*(home / f"walk_{rows[0]['scene_name'][-1]}").glob("*.jpg")])
    facts = json.loads((tmp_path / "vsi/meta_info_test.json").read_text())[rows[0]["scene_name"]]["object_bbox"]
    beds = [p for p in House.load(home / "house.json").placements if p.object_class == "bed"]
    assert [b["centroid"][:2] for b in facts["bed"]] == [list(p.position[:2]) for p in beds]
    choices = [q for q in questions if q.options]
    sat = pq.read_table(tmp_path / "sat/test.parquet").to_pylist()
    right = [r["answers"][LETTERS.index(q.letter)] for r, q in zip(sat, choices, strict=True)]
    assert right == [q.answer for q in choices] == [r["correct_answer"] for r in sat]
    assert len(sat[0]["image_bytes"]) == 8
    history = json.loads((tmp_path / "openeqa/open-eqa-test.json").read_text())[0]["episode_history"]
    assert [*(tmp_path / "openeqa/frames" / history).glob("*-rgb.png")]
    turns = json.loads((tmp_path / "llava/test.jsonl").read_text().splitlines()[0])["conversations"]
    assert turns[0]["value"].startswith("<image>") and turns[1]["value"] == questions[0].letter
