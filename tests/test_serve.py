"""People in every role: what a study is, who gets which task, what people are shown, and what is left of it."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hand_data import COMPACT, noise_features
from hand_serve import HEAD, TOGETHER, make_data, write_study

from embodied.agents.bandit.ratings import Rater, fitted
from embodied.agents.common.weights import load_weights
from embodied.agents.iliad.nav.run import NavAbout
from embodied.agents.vnla.study import VnlaLearner
from embodied.cli import main as start
from embodied.cli.serve import drawn
from embodied.envs.base import ActionError
from embodied.errors import UnableError
from embodied.geometry import wrap
from embodied.interface import Ask, Episode, Intention, Thought
from embodied.language.people_language import PeoplesWords
from embodied.language.plain_language import PlainLanguage, detokenized
from embodied.policies.baselines import RandomWalk
from embodied.records import load_lines, parse, to_json
from embodied.serve.app import app_of
from embodied.serve.driving import ACTIONS
from embodied.serve.game import Game, set_table
from embodied.serve.results import (
    JUDGEMENTS,
    Judgement,
    ResultsWriter,
    agreement,
    part_summary,
    rated_by_people,
    summary,
    worded_by_people,
    write_people_dataset,
)
from embodied.serve.run import open_study
from embodied.serve.screens import screen_of
from embodied.serve.sessions import Sessions
from embodied.serve.store import Event
from embodied.serve.study import Question, StudyError, StudyPart, load_study, page_address
from embodied.serve.talk import spoken_reply
from embodied.teachers.vnla import VnlaTeacher

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return make_data(tmp_path_factory.mktemp("study"))


class Names:
    """Panoramas that are only named."""

    def name(self, world, node):
        return f"{world}-{node}"


class Script:
    """Sessions without a server: events are applied at once, and kept as a log."""

    def __init__(self, data, parts=TOGETHER, people=(), **changes):
        """`people` join and press 'go on'."""
        study = load_study(write_study(data.folder.parent, parts))
        self.study = dataclasses.replace(study, **changes)
        self.tables = {p.name: set_table(p, data) for p in study.parts if p.kind == "play"}
        self.sessions, self.log, self.time = Sessions(self.study, self.tables, {}), [], 1000.0
        self.join(*people)
        self.ready(*people)

    def do(self, kind, person=None, /, **body):
        self.time += 1
        self.take(Event(kind, self.time, person, f"m{len(self.log)}" if person else None, body))

    def take(self, event):
        self.sessions.apply(event)
        self.log.append(event)

    def join(self, *names):
        for name in names:
            self.do("joined", None, person=name, key=f"key of {name}")
            self.do("consented", name)
            self.sessions.people[name].connected = 1

    def ready(self, *names):
        """They press 'go on'; what can begin begins."""
        for name in names:
            person = self.sessions.people[name]
            person.ready = True
            while events := self.sessions.next(person, self.time):
                for event in events:
                    self.take(event)

    def game(self, name):
        return self.sessions.games[self.sessions.people[name].game]

    def play(self, name, kind, **body):
        self.do(kind, name, game=self.sessions.people[name].game, **body)

    def bot(self, game):
        """The bot whose turn it is acts; returns its event."""
        kind, body = game.think()
        self.do(kind, None, game=game.id, **body)
        return kind, body

    def answer(self, name, text, picture=None):
        reply = spoken_reply(self.game(name).situation, text, picture, 1)
        self.play(name, "answered", reply=parse(to_json(reply)))

    def screen(self, name):
        return screen_of(self.sessions, self.sessions.people[name], Names(), "CODE")

    def episode(self, agent, assistant):
        """A short one."""
        self.play(agent, "asked", question="Where?")
        self.answer(assistant, "over there")
        self.play(agent, "stopped")


def test_a_mistake_in_a_study_is_told_with_its_place(tmp_path):
    for parts, said in (
        ('[[parts]]\nname = "a"\nagnet = "person"\n', r"parts\[0\] has the unknown fields \['agnet'\]; it may hold"),
        ('[[parts]]\nkind = "play"\n', r"parts\[0\] lacks the fields \['name'\]; it may hold"),
        ('[[parts]]\nname = "a"\nagent = "random"\nassistant = "none"\n', "nobody would take part"),
        ('[[parts]]\nname = "a"\nkind = "rate"\nof = "b"\n', "'b'"),
        (TOGETHER + TOGETHER, "name of its own"),
        ("parts = 3\n", "parts"),
    ):
        with pytest.raises(StudyError, match=said):
            load_study(write_study(tmp_path, parts))


def test_the_example_is_a_study_with_every_role():
    study = load_study(ROOT / "examples" / "study.toml")
    assert {r for p in study.parts for r in p.roles} == {"agent", "assistant", "rater", "describer"}


def test_two_people_play_and_the_episode_holds_questions_answers_and_seconds(data, tmp_path):
    play = Script(data, people=("ann", "bob"))
    assert play.screen("ann")["screen"] == "agent" and play.screen("bob")["screen"] == "assistant"
    play.play("ann", "asked", question="Which door?")
    play.answer("bob", "the left one", picture=9)
    play.play("ann", "moved", candidate=0)
    play.play("ann", "stopped")
    ResultsWriter(tmp_path, play.sessions)
    (episode,) = load_lines(tmp_path / "episodes_val_seen_together.jsonl", Episode)
    ask, move, stop = episode.steps
    assert isinstance(ask.action, Ask) and ask.action.question == "Which door?"
    assert ask.reply.text == "the left one" and ask.reply.image.node == 9 == ask.reply.subtask.target
    assert move.instruction == "the left one" and ask.pose == ask.next_pose
    assert ask.seconds < move.seconds < stop.seconds and episode.agent == "ann with bob"


def test_the_state_after_a_restart_is_that_before(data):
    play = Script(data, TOGETHER + '[[parts]]\nname = "stars"\nkind = "rate"\nof = "together"\n')
    play.join("ann", "bob", "eve", "dan")
    play.ready("ann", "bob", "eve")
    play.episode("ann", "bob")
    play.ready("bob")
    play.play("eve", "moved", candidate=0)
    play.play("eve", "asked", question="And now?")
    again = Script(data, (data.folder.parent / "study.toml").read_text().removeprefix(HEAD))
    for event in play.log:
        again.sessions.apply(Event(**json.loads(json.dumps(dataclasses.asdict(event)))))
    for person in again.sessions.people.values():
        person.connected = 1
    for name in ("eve", "bob"):
        assert again.screen(name) == play.screen(name)
    assert summary(again.sessions)["parts"] == summary(play.sessions)["parts"]


def test_every_task_gets_as_many_answers_as_wanted_and_nobody_plays_one_twice(data):
    play = Script(data, TOGETHER + "answers = 2\n")
    names = [f"p{i}" for i in range(8)]
    play.join(*names)
    for _ in range(6):
        play.ready(*names)
        for name in names:
            if (game := play.sessions.people[name].game) and play.sessions.games[game].people["agent"] == name:
                play.episode(name, play.game(name).people["assistant"])
    games = play.sessions.games.values()
    count = {t: sum(g.task.id == t for g in games) for t in play.tables["together"].tasks}
    assert set(count.values()) == {2} and len(count) == 3
    had = [(p, g.task.id) for g in games for p in g.people.values()]
    assert len(had) == len(set(had))
    assert all(p.ended in ("done", "nothing") for p in play.sessions.people.values())


def test_judges_see_what_others_played_and_never_their_own(data, tmp_path):
    play = Script(data, TOGETHER + '[[parts]]\nname = "stars"\nkind = "rate"\nof = "together"\nanswers = 2\n')
    play.join("ann", "bob", "eve")
    play.ready("ann", "bob")
    play.episode("ann", "bob")
    play.sessions.people["eve"].without.add("together")
    play.ready("eve")
    assert play.screen("eve")["screen"] == "judge" and play.sessions.people["ann"].viewing is None
    frames = play.screen("eve")["frames"]
    assert "Question: Where?\nAnswer: over there" in [f["text"] for f in frames] and frames[-1]["text"] == "The end."
    for nonsense in (6, 0, True, 3.0, "4", None):
        with pytest.raises(ActionError, match="stars"):
            play.do("judged", "eve", stars=nonsense, text="")
    play.do("judged", "eve", stars=4, text="well <b>done</b>", seconds=3.21)
    ResultsWriter(tmp_path, play.sessions)
    (told,) = load_lines(tmp_path / JUDGEMENTS, Judgement)
    assert (told.stars, told.text, told.judge, told.seconds) == (4, "well <b>done</b>", "eve", 3.21)
    assert told.episode.steps[0].reply.text == "over there"


def test_the_agents_screen_does_not_depend_on_the_goal(data):
    """No leak: two tasks alike but for their goal give equal screens under equal actions."""
    screens = []
    for away in (0, 1):
        play = Script(data)
        table = play.tables["together"]
        first, other = list(table.tasks.values())[:2]
        task = dataclasses.replace(first, goal=other.goal, goal_nodes=other.goal_nodes) if away else first
        table.tasks[first.id] = task
        play.join("ann", "bob")
        play.ready("ann", "bob")
        play.play("ann", "moved", candidate=0)
        screens.append({k: v for k, v in play.screen("ann").items() if k != "game"})
    assert screens[0] == screens[1]


def test_when_a_partner_goes_the_task_returns_and_the_other_goes_on(data):
    play = Script(data, TOGETHER)
    play.join("ann", "bob", "eve")
    play.ready("ann", "bob")
    task = play.game("ann").task.id
    bob = play.sessions.people["bob"]
    bob.connected, bob.away_since = 0, play.time
    assert play.sessions.late(play.time + play.study.absent_seconds - 1) == []
    (event,) = play.sessions.late(play.time + play.study.absent_seconds + 1)
    play.take(event)
    assert play.screen("ann")["last"] == "broken" and play.sessions.people["ann"].game is None
    play.ready("eve", "ann")
    facts = part_summary(play.sessions, "together")
    assert facts["broken off"] == 1 and facts["running"] == 1
    assert play.sessions.wanted(play.study.parts[0]) in {task, *play.tables["together"].tasks}
    assert sum(play.sessions._counts["together"].values()) == 1


def test_who_waits_too_long_is_thanked_and_gets_a_code(data):
    play = Script(data, people=["ann"])
    assert play.screen("ann")["screen"] == "wait"
    play.time += play.study.wait_seconds + 1
    play.ready("ann")
    assert (play.screen("ann")["screen"], play.screen("ann")["code"]) == ("done", "CODE")


def test_practice_comes_first_and_does_not_count(data):
    play = Script(data, people=("ann", "bob"), practice=True)
    for name in ("ann", "bob"):
        assert play.screen(name)["practice"] and play.game(name).task.id not in play.tables["together"].tasks
    helper = play.game("bob")
    while not helper.over and helper.turn < 90:
        if helper.question is not None:
            play.answer("bob", "go on")
        else:
            assert play.bot(helper)[0] == "asked" or helper.turn > 1
    assert play.screen("bob")["last"] == "found"
    play.play("ann", "stopped")
    play.ready("ann", "bob")
    assert not play.screen("ann")["practice"] and play.screen("ann")["game"] == play.screen("bob")["game"]
    assert part_summary(play.sessions, "together")["done"] == 0


def test_a_person_is_helped_by_the_data_sets_own_assistant_under_its_own_rule(data):
    play = Script(data, '[[parts]]\nname = "anna"\nassistant = "simulated"\ntasks = 9\nper_person = 9\n')
    play.join("ann")
    play.ready("ann")
    while not play.screen("ann")["canAsk"]:
        play.play("ann", "stopped")
        play.ready("ann")
    play.play("ann", "asked", question="Help!")
    game = play.game("ann")
    play.bot(game)
    route = game.env.last_step.reply.subtask
    screen, told = play.screen("ann"), game.observation.instruction
    assert game.situation.pose == route.start and screen["subtask"]
    assert screen["instruction"] == screen["said"][-1]["text"] == detokenized(told), "people read what learners read,"
    assert " ." in told and " ." not in screen["instruction"], "without its blanks"


class Helpful:
    """An assistant as somebody else would write one."""

    def intentions(self, situation):
        return (Intention.HELP,)

    def answer(self, situation, question, *, rng):
        return spoken_reply(situation, f"you asked {situation.question!r}", None, 1)


def test_an_assistant_of_ones_own_hears_the_question_in_words(data):
    play = Script(data, '[[parts]]\nname = "own"\nassistant = "test_serve:Helpful"\n', ["ann"])
    play.play("ann", "asked", question="Where is it?")
    play.bot(play.game("ann"))
    assert play.screen("ann")["said"][-1]["text"] == "you asked 'Where is it?'"
    with pytest.raises(ValueError, match="module:NAME"):
        set_table(StudyPart("p", assistant="nowhere:Nobody"), data)


def test_an_assistant_by_name_is_given_the_simulated_one_to_reword(data):
    """So a language model comes in: it words what the data set's own assistant knows."""

    class Loud:
        def __init__(self, base):
            self.base, self.intentions = base, base.intentions

        def answer(self, situation, question, *, rng):
            reply = self.base.answer(situation, question, rng=rng)
            return dataclasses.replace(reply, text=f"{reply.text} ({situation.question})".upper())

    table = set_table(StudyPart("p", assistant="loud", tasks=9), data, assistants={"loud": Loud})
    games = (Game("g", table, {"agent": "ann"}, False, 0.0, task, 0) for task in table.tasks.values())
    game = next(g for g in games if g.observation.can_ask)
    game.apply(Event("asked", 1.0, body={"question": "where?"}))
    kind, body = game.think()
    game.apply(Event(kind, 2.0, body=body))
    assert game.said[-1]["text"].endswith("(WHERE?)") and game.situation.subtask.start == game.situation.pose


class Thinker(RandomWalk):
    """A machine that says what it thought."""

    def act(self, observations, memory, *, rngs):
        actions, memory = super().act(observations, memory, rngs=rngs)
        thoughts = [o and Thought(np.full(len(o.candidates) + 1, 0.25), words="onward") for o in observations]
        return [a and dataclasses.replace(a, thought=t) for a, t in zip(actions, thoughts)], memory


def test_a_machine_goes_on_after_a_restart_where_it_was_and_its_thoughts_are_in_the_episode(data, tmp_path):
    parts = '[[parts]]\nname = "help"\nagent = "test_serve:Thinker"\nbudget = 0\n'
    plays = [Script(data, parts, ["bob"]), Script(data, parts)]
    game, thought = plays[0].game("bob"), []
    while not game.over:
        kind, body = game.think()
        if len(thought) == 3:
            plays[1].time = plays[0].time
            for event in plays[0].log:
                plays[1].take(Event(**json.loads(json.dumps(dataclasses.asdict(event)))))
            assert plays[1].sessions.games[game.id].think() == (kind, body)
        thought.append(body["thought"])
        plays[0].do(kind, None, game=game.id, **body)
    ResultsWriter(tmp_path, plays[0].sessions)
    (episode,) = load_lines(tmp_path / "episodes_val_seen_help.jsonl", Episode)
    assert len(thought) > 3 and [parse(to_json(s.action.thought)) for s in episode.steps] == thought


def test_whoever_drives_moves_to_a_viewpoint_when_it_is_the_nearest(data):
    play = Script(data, TOGETHER + 'moves = "drive"\n', ("ann", "bob"))
    game = play.game("ann")
    first, graph = game.env.pose.node, game.situation.world.graph
    room = graph.room_of_node
    near = next(n for n in game.situation.candidate_nodes if room[n] == room[first])
    goal = graph.positions[near]
    before = play.screen("ann")
    assert before["words"] == list(ACTIONS) and before["moves"] == [{"candidate": k} for k in range(3)]
    for _ in range(60):
        dx, dy = goal[:2] - game.drive.position
        off = wrap(math.atan2(dy, dx) - game.drive.yaw)
        play.play("ann", "moved", candidate=0 if abs(off) < 0.2 else 1 if off > 0 else 2)
        assert play.screen("ann")["live"] != before["live"], "there is a picture of every moment"
        assert play.screen("bob")["live"] is None, "who helps looks around"
        if game.env.pose.node != first:
            break
    with pytest.raises(ActionError, match="3 actions"):
        play.play("ann", "moved", candidate=3)
    play.play("ann", "stopped")
    *moves, stop = game.episode.steps
    assert [s.next_pose.node for s in moves] == [near] and math.dist(game.drive.position, goal[:2]) < 0.75 * math.dist(
        graph.positions[first], goal
    )
    with pytest.raises(ValueError, match="viewpoints"):
        set_table(StudyPart("p", assistant="simulated", moves="drive"), data)


def test_who_is_steered_walks_where_the_body_is_in_lit_pictures_and_stands_when_it_turns(data, tmp_path):
    play = Script(data, TOGETHER + 'moves = "drive"\nfigure = "mei"\n', ("ann", "bob"))
    drive, shown = play.game("ann").drive, []
    for action in (1, 0, 0, 1):
        play.play("ann", "moved", candidate=action)
        _, x, y, z, yaw, figure = drive.eye
        to = np.array(figure.place.position) - (x, y, z)
        assert math.dist(figure.place.position[:2], drive.position) < 0.02 and to[2] < -1
        assert math.hypot(*to[:2]) > 0.5 and math.isclose(math.atan2(to[1], to[0]), yaw, abs_tol=0.05)
        shown.append(figure.pose)
        assert play.screen("bob")["live"] == play.screen("ann")["live"]
    alike = lambda a, b: all(np.allclose(a.joints[n], b.joints[n], atol=1e-6) for n in a.joints)
    first, *walking, last = shown
    assert alike(first, last) and not alike(*walking) and not alike(walking[1], last)
    with pytest.raises(ValueError, match="mei"):
        StudyPart("p", figure="nobody", moves="drive")
    study = write_study(data.folder.parent, TOGETHER + 'moves = "drive"\nfigure = "mei"\n', name="unlit")
    with pytest.raises(StudyError, match="'together': figure = 'mei' needs lit pictures"):
        open_study(study, tmp_path / "out", lambda data, name: pytest.fail("nothing is drawn"))
    assert not (tmp_path / "out").exists()


async def fetched(app, path):
    """Status and body of the answer of an ASGI application."""
    sent = []
    scope = {"type": "http", "method": "GET", "path": path, "headers": [], "query_string": b""}

    async def send(message):
        sent.append(message)

    await app(scope, asyncio.sleep, send)
    return sent[0]["status"], b"".join(m.get("body", b"") for m in sent[1:])


def test_live_pictures_are_of_this_moment_and_for_whoever_drives(data, tmp_path, monkeypatch):
    shots = []
    picture = lambda camera, size: shots.append(camera) or np.full((*size, 3), 100, np.uint8)
    world = SimpleNamespace(renderer=SimpleNamespace(rgb=picture))
    study = write_study(data.folder.parent, TOGETHER + 'moves = "drive"\n', name="live")
    panoramas = lambda data, name: data.folder / "houses" / name / "panoramas.pano"
    opened = open_study(study, tmp_path / "out", panoramas, open_world=lambda data, name: world)
    play, server = Script(data), opened.server
    play.sessions, app = server.sessions, app_of(server)
    play.join("ann", "bob")
    play.ready("ann", "bob")

    def live():
        return screen_of(play.sessions, play.sessions.people["ann"], server.pictures, "")["live"]

    async def get(name):
        return await fetched(app, f"/live/{name}.jpg")

    async def look():
        first, before = live(), len(shots)
        for _ in range(2):
            status, body = await get(first)
            assert status == 200 and body[:2] == b"\xff\xd8"
        assert len(shots) == before + 1, "asked for twice, drawn once"
        play.play("ann", "moved", candidate=1)
        assert (await get(live()))[0] == 200 and shots[-1] != shots[-2]
        for gone in (first, f"{play.game('ann').id}/{'0' * 24}", "nobody/nothing"):
            assert (await get(gone))[0] == 404

    asyncio.run(look())
    monkeypatch.setattr("embodied.serve.driving.SLOWEST", 0.0)
    with pytest.raises(UnableError, match="too slow to drive"):
        open_study(study, tmp_path / "slow", panoramas, open_world=lambda data, name: world)


@pytest.mark.parametrize(
    ("wanted", "can_draw", "size", "said"),
    [(64, True, None, ""), (96, True, 96, "blurred"), (96, False, None, "no library of OpenGL")],
)
def test_panoramas_too_small_for_a_page_are_drawn_larger(data, monkeypatch, capsys, wanted, can_draw, size, said):
    @contextlib.contextmanager
    def world_of(data, name, pictures, args):
        if not can_draw:
            raise UnableError("no library of OpenGL")
        yield SimpleNamespace(render_all=lambda progress: pictures)

    monkeypatch.setattr("embodied.cli.serve.world_of", world_of)
    study = dataclasses.replace(load_study(write_study(data.folder.parent)), size=wanted)
    name = data.names("val_seen")[0]
    drawn_as = dataclasses.replace(data.drawn_pictures(name), size=size) if size else data.panoramas(name)
    assert drawn(data, name, study, None) == drawn_as
    assert said in (text := capsys.readouterr().err) and bool(text) == bool(said)


def test_a_summary_needs_no_pictures(data, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("embodied.cli.serve.world_of", None)
    study = write_study(data.folder.parent, TOGETHER + 'moves = "drive"\n', HEAD.replace("64", "96"), "summed")
    assert start(["serve", str(study), "--out", str(tmp_path / "out"), "--summary"]) == 0
    assert "together: wanted 3, done 0" in capsys.readouterr().out


def test_typed_questions_have_prices_that_are_written_down(data):
    part = StudyPart("p", questions=(Question("Which room?", 2.0),), free_question=False, tasks=1)
    env, relay = set_table(part, data).make_env()
    task = next(iter(set_table(part, data).tasks.values()))
    env.reset(task)
    relay.reply = spoken_reply(env.situation, "the kitchen", None, 1)
    env.step(Ask(question="Which room?"))
    assert env.last_step.cost == 2.0 and env.time == 0


def test_alpha_is_krippendorffs():
    """His example of four observers and twelve units; interval data, 0.849."""
    rows = ("1233 2141 2...", "1233 2241 25.3", ".333 2342 251.", "1233 2441 251.")
    units = [(str(i), float(c)) for row in rows for i, c in enumerate(row.replace(" ", "")) if c != "."]
    assert agreement(units) == pytest.approx(0.849, abs=5e-4)
    rng = np.random.default_rng(0)
    assert abs(agreement([(str(i % 400), float(rng.integers(5))) for i in range(1600)])) < 0.08
    assert agreement([("a", 1.0), ("b", 2.0)]) is None


# Where the page is -------------------------------------------------------------------------------


SPELT = {
    "HTTPS://Study.Example.ORG:443/": "https://study.example.org",
    "http://study.example.org:80": "http://study.example.org",
    "https://study.example.org:8443/Kitchen/": "https://study.example.org:8443/Kitchen",
    "http://[0:0::0:1]:8080": "http://[::1]:8080",
    "https://bücher.example/a b": "https://xn--bcher-kva.example/a%20b",
}
NO_ADDRESSES = ["ftp://a", "https://", "http://a:70000", "http://me@a", "http://a?b", "http://a..b"]


def test_an_address_is_spelt_as_browsers_spell_it():
    assert {typed: page_address(typed) for typed in SPELT} == SPELT
    assert [page_address(spelt) for spelt in SPELT.values()] == [*SPELT.values()]


@pytest.mark.parametrize("typed", ["study.example.org", "localhost:8080", *NO_ADDRESSES])
def test_what_is_no_address_of_a_page_is_refused_with_the_remedy(typed, capsys):
    with pytest.raises(SystemExit):
        start(["serve", "STUDY.toml", "--address", typed])
    remedy = "such as https://study.example.org" if "://" in typed else f"write https://{typed}"
    assert remedy in capsys.readouterr().err


@pytest.fixture(scope="module")
def served_at(data, tmp_path_factory):
    study = write_study(data.folder.parent, TOGETHER, name="addressed")
    return lambda *at: open_study(study, tmp_path_factory.mktemp("at"), None, addresses=at or None).server


UNI = "https://uni.example"


@pytest.mark.parametrize(
    ("addresses", "page", "host", "welcome"),
    [
        (["https://Uni.example:443/kitchen"], UNI, "localhost:8080", True),
        *[([UNI], page, "uni.example", False) for page in ("http://uni.example", UNI + ":8443", "null")],
        ([], "http://lab:8080", "LAB:8080", True),
        ([], "https://lab", "lab:443", True),
        *[([], page, "lab", False) for page in ("https://evil.example", "null")],
    ],
)
def test_a_page_of_another_origin_is_told_which_may_connect(served_at, caplog, addresses, page, host, welcome):
    server = served_at(*addresses)
    reasons = [server.refusal(SimpleNamespace(headers={"origin": page, "host": host})) for _ in range(2)]
    if welcome:
        assert reasons == [None, None] and not caplog.messages
    else:
        assert page in reasons[0] and "--address" in reasons[0] and all(a in reasons[0] for a in addresses)
        assert len(caplog.messages) == 1 and page in caplog.messages[0], "said once to whoever runs the study"


def test_a_study_under_a_path_is_served_there_and_where_a_proxy_takes_the_path_away(served_at):
    app = app_of(served_at("https://uni.example/kitchen/"))
    answers = {"/kitchen": 307, "/kitchen/": 200, "/": 200, "/kitchen/static/app.js": 200, "/kitchens/": 404}
    assert {path: asyncio.run(fetched(app, path))[0] for path in answers} == answers
    page = asyncio.run(fetched(app, "/"))[1].decode()
    assert re.findall('(?:src|href)="/', page) == [] and 'src="static/app.js"' in page


# What learners make of it ------------------------------------------------------------------------


def played(data, folder, text, *, far):
    """Two people played: somebody was told `text` at the start of the first task; the folder of their study."""
    play = Script(data, TOGETHER + f"way = {0 if far else 1}\n", ("ann", "bob"))
    play.play("ann", "asked", question="Where?")
    game = play.game("ann")
    reply = spoken_reply(game.situation, text, None, 1, game.table.part.way)
    play.play("bob", "answered", reply=parse(to_json(reply)))
    play.play("ann", "stopped")
    folder.mkdir()
    ResultsWriter(folder, play.sessions)
    return game.task, reply.subtask.path


@pytest.mark.parametrize("only", [False, True])
def test_what_people_answered_is_what_hannas_assistants_say_in_training(data, tmp_path, only):
    task, path = played(data, tmp_path / "people", "past the <b>sofa</b>", far=True)
    made = write_people_dataset(data, worded_by_people(tmp_path / "people"), tmp_path / "made", only=only)
    mine = [r for r in made.routes(task.world) if "people" in r.id]
    assert [(r.path, r.split) for r in mine] == [(path, "train_seen"), (path, "train_unseen")]
    assert len(made.routes(task.world)) == 2 or not only
    train, seen = made.split("train"), made.split("val_seen")
    env = train.make_env()
    env.reset(task)
    env.step(Ask())
    heard = env.last_step.reply
    assert heard.text == "past the <b>sofa</b>" or not only
    env = seen.make_env()
    env.reset(task)
    env.step(Ask())
    assert "sofa" not in env.last_step.reply.text, "what agents learned from is not what they are judged by"
    again = write_people_dataset(data, worded_by_people(tmp_path / "people"), tmp_path / "2", only=only)
    assert again.digest == made.digest


def test_vnlas_advisor_says_what_people_said_of_the_same_actions(tmp_path):
    data = make_data(tmp_path, "vnla")
    task, path = played(data, tmp_path / "people", "over there", far=False)
    words = worded_by_people(tmp_path / "people")
    made = write_people_dataset(data, words, tmp_path / "made")
    (said,) = made.utterances([task.world])
    actions, end = VnlaTeacher().plan(data.place(task.world)).words(task.start, (path[-1],), 99)
    assert (*said.words, "stop") == actions and end.node == path[-1]
    voice = PeoplesWords([said], PlainLanguage())
    assert voice.subgoal(said.words) == "over there" and voice.subgoal(("left", *said.words)) != "over there"
    assert "there" in VnlaLearner.words_of(made, made.split("train")).words


@pytest.mark.slow
def test_iliad_trains_on_what_people_said(tmp_path, shared_cache):
    data = make_data(tmp_path)
    played(data, tmp_path / "people", "hop over yonder", far=True)
    noise_features(data)
    people = ["--people", str(tmp_path / "people"), "--data", str(data.folder), "--out", str(tmp_path / "made")]
    assert start(["dataset", "from-people", *people]) == 0
    learn = ["--data", str(tmp_path / "made"), "--out", str(tmp_path / "out")]
    learn += ["--encoder", str(COMPACT), "--iterations=2"]
    small = ["--hidden-size=16", "--heads=2", "--candidates=2", "--executor-iterations=2", "--more-paths=0"]
    small += ["--describer-iterations=2", "--batch=4", "--teacher-batch=4", "--cache", str(shared_cache)]
    assert start(["train", "iliad", "nav", *learn, *small]) == 0
    (best,) = (tmp_path / "out").rglob("best.safetensors")
    assert "yonder" in load_weights(best, "nav", NavAbout, "")[1].words


def test_descriptions_become_routes_and_stars_a_rater(data, tmp_path):
    parts = "".join(f'[[parts]]\nname = "{k}"\nkind = "{k}"\nof = "together"\n' for k in ("rate", "describe"))
    play = Script(data, TOGETHER + parts)
    play.join("ann", "bob", "eve")
    play.ready("ann", "bob")
    play.play("ann", "moved", candidate=0)
    walked = play.game("ann").env.pose.node
    play.play("ann", "stopped")
    play.sessions.people["eve"].without.add("together")
    play.ready("eve")
    play.do("judged", "eve", stars=2, text="")
    play.ready("eve")
    play.do("judged", "eve", text="one step on")
    ResultsWriter(tmp_path, play.sessions)
    (word,) = worded_by_people(tmp_path)
    assert word.text == "one step on" and word.path[-1] == walked and len(word.path) == 2
    assert [stars for _, stars in rated_by_people(tmp_path, data)] == [2]


def test_the_rater_that_people_resemble_is_found_again():
    rater, rng = Rater(4, 0.3, 2.0), np.random.default_rng(3)
    scores = rng.uniform(0, 1, 4000)
    found = fitted(scores, [rater.rate(s, rng=rng) for s in scores], 4)
    assert found.granularity == 4 and abs(found.skew - 2.0) < 0.3 and 0.2 < found.variance < 0.6
