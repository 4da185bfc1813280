"""Language models in every role, against a small server in this process that also answers badly."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import threading
from pathlib import Path

import numpy as np
import pytest
from hand_chat import ChatServer, Parrot, said
from hand_worlds import HandWorld, grid_world
from PIL import Image

from embodied.agents.language_models.agent import (
    LanguageModelAgent,
    ModelAssistant,
    PersonAssistant,
    assistant_maker,
    followed_replies,
    listener_arrives,
)
from embodied.agents.language_models.client import AnswerCache, Client, ServerSettings
from embodied.agents.language_models.completions import object_schema
from embodied.agents.language_models.prompts import PromptBuilder, oracle_names, read_prompt
from embodied.agents.language_models.transport import MOST_BYTES, completions_url, proxy_of
from embodied.assets.catalogue import load_catalogue
from embodied.assistants.ask import AskAssistant
from embodied.envs.base import HelpEnv
from embodied.errors import UnableError
from embodied.evaluation import tables
from embodied.evaluation.evaluate import play
from embodied.interface import Ask, Episode, Intention, Mode, Move, Pose, Reply, Route, Sighting, Step, Subtask, Usage
from embodied.kinds import metrics
from embodied.kinds.shipped.ask import ask_environments
from embodied.kinds.shipped.find import FIND
from embodied.kinds.task_kind import EnvInputs
from embodied.language import PlainLanguage
from embodied.records import from_json, to_json
from embodied.render.panorama import Panorama
from embodied.tasks.ask import ask_pool, ask_tasks, look_of
from embodied.tasks.goals import find_pool, find_task

ONE = object_schema(word={"type": "string", "enum": ["yes", "no"]})
ASKED = [{"role": "user", "content": "say it"}]
FAST = {"wait": 0.01, "tries": 3, "timeout": 5.0}


@pytest.fixture
def answers(tmp_path) -> Path:
    return tmp_path / "answers.sqlite"


def client_of(server: ChatServer, answers: Path, **settings) -> Client:
    return Client(ServerSettings("m", server.url, **{**FAST, **settings}), AnswerCache(answers))


def find_tasks(n: int) -> list:
    pool = find_pool(grid_world(), seed=0)
    tasks = [find_task(pool, i, seed=0, language=PlainLanguage()) for i in range(n)]
    return [dataclasses.replace(t, horizon=5) for t in tasks]


def find_env() -> HelpEnv:
    return FIND.environments(EnvInputs({"grid": grid_world()}))()


# The client -------------------------------------------------------------------------------------


def test_an_answer_is_asked_for_once_and_kept_in_one_file_without_the_key(answers, monkeypatch):
    monkeypatch.setenv("A_KEY", "sk-very-secret")
    with ChatServer(lambda r: said('{"word": "yes"}')) as server:
        first = client_of(server, answers, key_variable="A_KEY").ask(ASKED, ONE)
        again = client_of(server, answers, key_variable="A_KEY").ask(ASKED, ONE)
        assert first == again and first.value == {"word": "yes"} and (first.tokens_in, first.tokens_out) == (100, 10)
        assert len(server.requests) == 1 and server.headers[0]["authorization"] == "Bearer sk-very-secret"
        client_of(server, answers, temperature=0.5).ask(ASKED, ONE)
        assert len(server.requests) == 2, "another sampling is another question"
    assert b"sk-very-secret" not in answers.read_bytes()
    assert sorted(p.name for p in answers.parent.iterdir()) == ["answers.sqlite"]


def test_pictures_are_kept_as_digests(answers):
    url = "data:image/jpeg;base64," + "QUJD" * 5000
    with ChatServer(lambda r: said('{"word": "yes"}')) as server:
        shown = [{"role": "user", "content": [{"type": "image_url", "image_url": {"url": url}}]}]
        client_of(server, answers).ask(shown, ONE)
        assert server.requests[0]["messages"][0]["content"][0]["image_url"]["url"] == url
    assert b"QUJDQUJD" not in answers.read_bytes()


GOOD = '{"word": "yes"}'
THOUGHT = '<think>\nI must write {"word": ...}, or {"word": "no"}. The set {0, 1} is allowed.\n</think>\n\n'


def called(*arguments: object, name: str = "answer") -> tuple:
    return said(None, tool_calls=[{"id": "1", "function": {"name": name, "arguments": a}} for a in arguments])


UNDERSTOOD = {
    "in words and a fence": said(f"Sure!\n```json\n{GOOD}\n```\nNote: {{x}} was not needed."),
    "after thoughts": said(THOUGHT + GOOD),
    "after thoughts that the template opens": said(THOUGHT.removeprefix("<think>") + GOOD),
    "twice the same": said(f"{GOOD}\n{GOOD}"),
    "after the schema": said(f"{json.dumps(ONE)} so: {GOOD}"),
    "in parts": said([{"type": "thinking", "thinking": "{}"}, {"type": "text", "text": GOOD}]),
    "where the reasoning stands": said("", reasoning_content=GOOD),
    "arguments as a text": called(GOOD),
    "the same call twice": called(GOOD, {"word": "yes"}),
    "complete at the longest answer": said(GOOD, ended="length"),
}


@pytest.mark.parametrize("reply", UNDERSTOOD.values(), ids=UNDERSTOOD)
def test_a_good_answer_is_understood_however_it_is_written(reply, answers):
    with ChatServer(lambda r: reply) as server:
        answer = client_of(server, answers).ask(ASKED, ONE)
    assert (answer.value, answer.problem) == ({"word": "yes"}, "")


INVALID = {
    "no JSON": (said("I would rather not say"), "expected an object of JSON"),
    "an unknown word": (said('{"word": "maybe"}'), "should be one of"),
    "a field too many": (said('{"word": "yes", "and": "more"}'), "unknown fields"),
    "two different answers": (said(f'{GOOD} or {{"word": "no"}}'), "2 different answers"),
    "NaN": (said('{"word": NaN}'), "NaN is no JSON"),
    "twenty thousand braces": (said("{" * 20_000), "no JSON"),
    "long text": (said("a" * (MOST_BYTES // 2)), "more than 20000 characters"),
    "unknown tools": (called(*["{}"] * 50, name="shell"), "unknown tools"),
    "nothing": (said(None), "empty"),
    "a refusal": (said(None, refusal="I cannot help with that"), ""),
    "cut within the answer": (said('{"word": "ye', ended="length"), "raise most_tokens"),
    "cut within the thoughts": (said(f"<think>Is it {GOOD}? I", ended="length"), "raise most_tokens"),
}


@pytest.mark.parametrize(("reply", "problem"), INVALID.values(), ids=INVALID)
def test_a_broken_answer_is_counted_as_invalid_or_a_refusal_and_is_nothing_else(reply, problem, answers):
    with ChatServer(lambda r: reply) as server:
        client = client_of(server, answers)
        answer = client.ask(ASKED, ONE)
        assert answer.value is None and problem in answer.problem
        usage = client.usage(answer)
        assert (usage.calls, usage.invalid, usage.refusals) == (1, bool(problem), not problem)
        assert client.ask(ASKED, ONE) == answer and len(server.requests) == 1
    assert answers.stat().st_size < 100_000


def sent(text: str | bytes, kind: str = "application/json") -> tuple:
    return 200, {"Content-Type": kind}, text if isinstance(text, bytes) else text.encode()


PARTLY = json.loads(said(GOOD)[2])
FAILURES = {
    "HTML": (sent("<html><style>a {}</style><b>log&nbsp;in</b></html>", "text/html"), 1, r"web page \(log in\)"),
    "ten megabytes": (sent(b"[" + b"1," * 5_000_000 + b"1]"), 1, "more than 1000000 bytes"),
    "a long error": ((400, {}, b'{"error": "' + b"x" * 2 * MOST_BYTES + b'"}'), 1, "more than 1000000 bytes"),
    "deep": (sent(b"[" * 100_000), 3, "no chat completion"),
    "gzip that is none": ((200, {"Content-Encoding": "gzip"}, b"{}"), 3, "no chat completion"),
    "an error": (sent('{"error": "out of memory"}'), 3, "out of memory"),
    "an error that passes": (sent('{"error": {"code": 503, "message": "asleep"}}'), 3, "status 503: asleep"),
    "an error that stays": (sent('{"error": {"code": 402, "message": "no credits"}}'), 1, "status 402: no credits"),
    "an error beside an answer": (sent(json.dumps(PARTLY | {"error": {"message": "lost"}})), 3, "lost"),
    "a message that is none": (sent('{"choices": [{"message": null}]}'), 3, "choices"),
    "an empty body": (sent(""), 3, "its answer is empty"),
    "a stream of events": (sent('data: {"choices": []}\n\ndata: [DONE]', "text/event-stream"), 1, "stream of events"),
    "a moved server whose address is none": ((308, {"Location": "http://[x/v1"}, b""), 1, r"sends on to 'http://\[x"),
    "a moved server": ((307, {"Location": "https://new.example/v1"}, b""), 1, "https://new.example"),
    "an error that repeats the key": (sent('{"error": "no key sk-secret"}'), 3, r"no key \*\*\*"),
    "a form that is unknown": ((400, {}, b'{"error": "no json_schema"}'), 1, "another form \\(--form\\) may suit"),
    "an unknown model": ((404, {}, b'{"detail": "no model m"}'), 1, "status 404: no model m; check model"),
}


@pytest.mark.parametrize(("reply", "tries", "words"), FAILURES.values(), ids=FAILURES)
def test_a_failure_of_the_server_is_no_answer_and_the_run_goes_on_from_it(reply, tries, words, answers, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret")
    with ChatServer(lambda r: reply) as server:
        client = client_of(server, answers)
        with pytest.raises(UnableError, match=rf"{words}.*0 answers are kept"):
            client.ask(ASKED, ONE)
        assert len(server.requests) == tries and client.sent == len(client.cache) == 0
        server.behaviour = lambda r: said(GOOD)
        assert client.ask(ASKED, ONE).value == {"word": "yes"} and client.sent == 1


def test_a_newer_model_is_asked_with_the_settings_that_it_knows(answers):
    def strict(request: dict) -> tuple:
        if "max_tokens" in request:
            words = "Unsupported parameter: 'max_tokens'. Use 'max_completion_tokens' instead."
        elif "temperature" in request:
            words = "Unsupported value: 'temperature' does not support 0.0 with this model. Only the default (1)."
        else:
            return said(GOOD)
        return 400, {}, json.dumps({"error": {"message": words}}).encode()

    with ChatServer(strict) as server:
        client = client_of(server, answers, most_tokens=7)
        assert client.ask(ASKED, ONE).value == {"word": "yes"} and server.requests[-1]["max_completion_tokens"] == 7
        client.ask([{"role": "user", "content": "more"}], ONE)
        assert len(server.requests) == 4, "the second question is asked rightly at once"
        wrong = json.dumps({"error": {"message": "Invalid 'temperature': expected a value <= 2"}}).encode()
        server.behaviour = lambda r: (400, {}, wrong)
        with pytest.raises(UnableError, match="expected a value"):
            client_of(server, answers, temperature=3.0).ask(ASKED, ONE)


# Addresses, keys, proxies, certificates ---------------------------------------------------------


@pytest.mark.parametrize("tail", ["", "/", "/chat/completions", "/chat/completions/"])
def test_an_address_is_taken_as_people_write_it(tail):
    assert completions_url(f" http://127.0.0.1:80/v1{tail}\n") == "http://127.0.0.1:80/v1/chat/completions"
    assert completions_url(f"https://[::1]/a{tail}?v=1") == "https://[::1]/a/chat/completions?v=1"


@pytest.mark.parametrize(
    "url", ["", "localhost:80/v1", "http:/h/v1", "http://h:x/v1", "http://h:99999", "http://[::1", "ftp://h/v1"]
    + ["http://a b/v1", "http://key@h/v1", "http://h/ü", "http://h..a/v1", f"http://{'h' * 64}/v1", "/v1", "\ud800"]
)  # fmt: skip
def test_an_address_that_is_none_is_named_before_anything_is_sent(url, answers):
    with pytest.raises(ValueError, match="base_url should be an address such as http://"):
        Client(ServerSettings("m", url), AnswerCache(answers))


@pytest.mark.parametrize("key", [" sk-abc\r\n", "sk-äöü", "sk-a\nsk-b"])
def test_a_key_is_taken_without_blanks_or_named_by_its_variable(key, answers, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", key)
    with ChatServer(lambda r: said(GOOD)) as server:
        if key.strip() == "sk-abc":
            client_of(server, answers).ask(ASKED, ONE)
            assert server.headers[0]["authorization"] == "Bearer sk-abc"
            return
        with pytest.raises(UnableError, match="OPENAI_API_KEY holds") as e:
            client_of(server, answers).ask(ASKED, ONE)
        assert "sk-" not in str(e.value) and not server.requests


@pytest.fixture
def no_proxies(monkeypatch) -> pytest.MonkeyPatch:
    for name in ("http_proxy", "https_proxy", "all_proxy", "no_proxy"):
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)
    return monkeypatch


@pytest.mark.parametrize(
    ("no_proxy", "host", "direct"),
    [
        ("", "localhost", True),
        ("", "[::1]", True),
        ("", "example.org", False),
        ("*", "example.org", True),
        ("localhost, .example.org", "a.example.org", True),
        ("example.org", "example.org", True),
        ("example.org:80", "example.org:80", True),
        ("example.org:81", "example.org", False),
    ],
)
def test_no_proxy_is_read_as_it_is_written(no_proxy, host, direct, no_proxies):
    no_proxies.setenv("ALL_PROXY", "http://proxy.example:3128")
    no_proxies.setenv("NO_PROXY", no_proxy)
    assert (proxy_of(f"http://{host}/v1") is None) is direct


@pytest.mark.parametrize(
    ("variable", "value", "problem"),
    [
        ("ALL_PROXY", "socks5://127.0.0.1:9", "the proxy socks5://127.0.0.1:9 of .*ALL_PROXY cannot be used"),
        ("all_proxy", "https://h:1", "a proxy is written http://HOST:PORT; unset it"),
        ("http_proxy", "http://me:secret@h:x", r"the proxy http://\*\*\*@h:x of HTTP_PROXY"),
        ("HTTP_PROXY", "127.0.0.1:9", r"nobody listens there.*the proxy http://127.0.0.1:9 of HTTP_PROXY"),
        ("HTTP_PROXY", "PROXY", r"status 503: no such luck \(.*of HTTP_PROXY.*add models.example to NO_PROXY"),
    ],
)
def test_a_proxy_that_fails_is_named(variable, value, problem, no_proxies, answers):
    with ChatServer(lambda r: (503, {}, b"no such luck")) as proxy:
        no_proxies.setenv(variable, value.replace("PROXY", proxy.url.removesuffix("/v1")))
        client = Client(ServerSettings("m", "http://models.example/v1", **FAST), AnswerCache(answers))
        with pytest.raises(UnableError, match=problem) as e:
            client.ask(ASKED, ONE)
        assert "secret" not in str(e.value)


def test_a_server_is_asked_through_the_proxy_that_the_environment_names(no_proxies, answers):
    with ChatServer(lambda r: said(GOOD)) as proxy:
        no_proxies.setenv("ALL_PROXY", proxy.url.removesuffix("/v1"))
        client = Client(ServerSettings("m", "http://models.example/v1", **FAST), AnswerCache(answers))
        assert client.ask(ASKED, ONE).value == {"word": "yes"} and proxy.headers[0]["host"] == "models.example"


def test_certificates_that_are_gone_are_named_and_do_not_matter_without_tls(answers, monkeypatch):
    for name in ("SSL_CERT_FILE", "SSL_CERT_DIR"):
        monkeypatch.setenv(name, "/gone/cacert.pem")
    with ChatServer(lambda r: said(GOOD)) as server:
        assert client_of(server, answers).ask(ASKED, ONE).value == {"word": "yes"}
        server.url = server.url.replace("http", "https")
        with pytest.raises(UnableError, match="does not speak TLS; write http://"):
            client_of(server, answers, temperature=1.0).ask(ASKED, ONE)


# Failures that pass, and those that do not ------------------------------------------------------


def test_a_busy_server_is_asked_again_and_a_dead_one_is_an_error_that_says_what_to_do(answers):
    waiting = [(503, {}, b"busy"), (429, {"Retry-After": "0"}, b"slower"), said('{"word": "no"}')]
    with ChatServer(lambda r: waiting.pop(0)) as server:
        client = client_of(server, answers)
        assert client.ask(ASKED, ONE).value == {"word": "no"} and len(server.requests) == 3
    with pytest.raises(UnableError, match=r"start the server.* 1 answers are kept"):
        client.ask([{"role": "user", "content": "something else"}], ONE)


def test_a_server_that_does_not_answer_in_time_is_given_up(answers):
    done = threading.Event()
    with ChatServer(lambda r: said(GOOD) if done.wait() else None) as server:
        with pytest.raises(UnableError, match=r"after 2 tries: no whole answer within 0.1 s.*--timeout"):
            client_of(server, answers, timeout=0.1, tries=2).ask(ASKED, ONE)
        done.set()


@pytest.mark.parametrize("form", ["schema", "object", "tools", "text"])
def test_four_ways_to_ask_for_json(form, answers):
    with ChatServer(lambda r: called(GOOD) if form == "tools" else said(GOOD)) as server:
        assert client_of(server, answers, form=form).ask(ASKED, ONE).value == {"word": "yes"}
        (request,) = server.requests
        assert ("tools" in request, "response_format" in request) == (form == "tools", form in ("schema", "object"))


def test_another_file_is_not_taken_for_answers(tmp_path):
    (tmp_path / "text").write_text("hello, this is no data base at all, whatever its length may be" * 20)
    with pytest.raises(ValueError, match="cannot be used to keep answers"):
        AnswerCache(tmp_path / "text")


def test_a_prompt_of_ones_own_replaces_the_shipped_one_and_is_checked(tmp_path):
    (tmp_path / "agent.md").write_text("You are a cat.\n---\n$instruction")
    assert read_prompt("agent", ("instruction",), tmp_path).messages(instruction="come")[1]["content"] == "come"
    (tmp_path / "agent.md").write_text("You are a cat.\n---\n$secret")
    with pytest.raises(ValueError, match=r"\$secret"):
        read_prompt("agent", ("instruction",), tmp_path)


# The agent --------------------------------------------------------------------------------------


def test_twenty_tasks_replay_from_the_file_byte_for_byte_without_a_server(answers):
    with ChatServer() as server:
        client = client_of(server, answers, price_in=2.0, price_out=10.0)
        first = play(find_env, LanguageModelAgent(client), find_tasks(20), seed=0, batch=5, agent="llm")
        assert client.sent == len(server.requests) > 0
    offline = Client(dataclasses.replace(client.settings, base_url="http://127.0.0.1:9"), AnswerCache(answers))
    again = play(find_env, LanguageModelAgent(offline), find_tasks(20), seed=0, batch=2, agent="llm")
    assert [to_json(e) for e in again] == [to_json(e) for e in first] and offline.sent == 0
    row = tables.row("llm", "x", first, {"grid": grid_world().graph}, seed=0)
    steps = row.values["steps"].mean
    assert row.values["model calls"].mean == steps and row.values["tokens in"].mean == 100 * steps
    assert row.values["model price"].mean == pytest.approx(steps * (100 * 2 + 10 * 10) / 1e6)
    read = from_json(type(first[0]), to_json(first[0]))
    assert metrics.usage(read) == metrics.usage(first[0]) != Usage()


def test_an_agent_whose_model_talks_nonsense_goes_on_and_then_stops(answers):
    with ChatServer(lambda r: said("blah")) as server:
        (episode,) = play(find_env, LanguageModelAgent(client_of(server, answers)), find_tasks(1), seed=0)
    assert episode.ended == "stop" and len(episode.steps) == 4
    assert all(isinstance(s.action, Move) and s.action.candidate == 0 for s in episode.steps[:-1])
    used = metrics.usage(episode)
    assert used is not None and used.invalid == used.calls == 4


def test_no_message_names_a_place(answers):
    with ChatServer() as server:
        play(find_env, LanguageModelAgent(client_of(server, answers)), find_tasks(2), seed=0)
        told = json.dumps([r["messages"] for r in server.requests])
    assert "grid" not in told and "_node" not in told and "n0" not in told


def test_a_model_is_told_the_names_of_what_is_seen_and_where():
    class Furnished(HandWorld):
        def sightings(self, node: int) -> tuple:
            return (Sighting("sofa_1", "sofa", 0.5236, 0.0, 2.2, 900), Sighting("key_1", "key", 0.0, 0.0, 3.0, 3))

    world = Furnished(grid_world().house, grid_world().graph)
    o = find_env().reset(dataclasses.replace(find_tasks(1)[0], start=Pose(0, 0)))
    text = PromptBuilder(oracle_names({"grid": world})).messages(o)[-1]["content"]
    assert "sofa (30 degrees to the left, 2 m)" in text and "key" not in text


# The assistant ----------------------------------------------------------------------------------


def ask_stage() -> tuple:
    world = grid_world()
    tasks = ask_tasks(ask_pool(world, look_of(None), seed=0), 4, seed=0)
    return world, tasks, ask_environments({"grid": world}, look_of(None))


def test_template_model_and_person_answer_through_one_interface(answers):
    _, tasks, make_env = ask_stage()
    told = []
    with ChatServer(lambda r: said('{"answer": "Look in the kitchen, dear."}')) as server:
        makers = {
            "template": assistant_maker("template", lambda: None, None),
            "llm": assistant_maker("llm", lambda: client_of(server, answers), None),
            "person": lambda base: PersonAssistant(base, lambda text: told.append(text) or "over there"),
            "own": assistant_maker("hand_chat:Parrot", lambda: None, None),
        }
        said_by = {}
        for name in ("template", "llm", "person"):
            env = make_env()
            env.assistant = makers[name](env.assistant)
            env.reset(tasks[0])
            env.step(Ask(Intention.REGION))
            said_by[name] = env.last_step.reply
        (request,) = server.requests
    assert said_by["llm"].text == "Look in the kitchen, dear." and said_by["person"].text == "over there"
    assert {r.ruled_out for r in said_by.values()} == {said_by["template"].ruled_out}, "the facts are the same"
    assert said_by["template"].text in request["messages"][1]["content"] and said_by["template"].text in told[0]
    assert said_by["llm"].usage.calls == 1 and isinstance(makers["own"](AskAssistant(look_of(None))), Parrot)
    with pytest.raises(ValueError, match="module:NAME"):
        assistant_maker("nobody", lambda: None, None)


def test_a_model_words_free_answers_by_true_facts_only_and_one_that_fails_leaves_the_template(answers):
    _, tasks, make_env = ask_stage()
    with ChatServer(lambda r: said("<html>")) as server:
        env = make_env()
        template = env.assistant
        env.assistant = ModelAssistant(template, client_of(server, answers))
        env.reset(tasks[0])
        env.step(Ask(Intention.REGION))
        reply = env.last_step.reply
        assert reply.usage.invalid == 1
        assert reply.text == template.answer(env.situation, Intention.REGION, rng=np.random.default_rng(0)).text
        server.behaviour = lambda r: said('{"answer": "I do not know."}')
        env.step(Ask(Intention.FREE, question="Is there a cat in the house?"))
        content = server.requests[-1]["messages"][1]["content"]
    assert "Is there a cat in the house?" in content and content.count("\n- ") == 3
    assert env.last_step.action.question == "Is there a cat in the house?"


# Other roles ------------------------------------------------------------------------------------


class Seen:
    """The grid with a catalogue, for whoever reads words of things; nothing but rooms is seen."""

    def __init__(self) -> None:
        world = grid_world()
        self.house, self.graph, self.name = world.house, world.graph, world.house.name
        self.catalogue = load_catalogue()

    def sightings(self, node: int) -> tuple:
        return ()


@pytest.fixture(scope="module")
def seen() -> Seen:
    return Seen()


def a_route(world: Seen, k: int) -> Route:
    path = world.graph.path(0, 20)
    return Route(f"grid_{k}", path, 0, 0, PlainLanguage().route(world, path, 0.0, rng=np.random.default_rng(0)))


def test_the_listener_tells_how_often_told_ways_are_understood(seen):
    route = a_route(seen, 0)
    assert listener_arrives(seen, "Go into the living room. Stop in the living room.", route.path, 0.0)
    assert not listener_arrives(seen, "blah blah", route.path, 0.0)
    reply = Reply("blah", subtask=Subtask("r", 20, path=route.path))
    stopped = Step(Pose(0), Mode.MAIN, "", (0,), "none", (), (1,), Ask(), reply, Pose(0))
    episode = Episode(find_tasks(1)[0], (stopped,), "limit")
    assert followed_replies([episode], {"grid": seen}) == (0, 1)


def test_a_model_that_sees_is_shown_numbered_views(answers):
    class Grey:
        def at(self, sight):
            return Panorama(
                np.full((6, 64, 64, 3), 90, np.uint8), np.ones((6, 64, 64), np.float32), np.zeros((6, 64, 64), np.int32)
            )

    with ChatServer() as server:
        for how in ("strip", "panorama"):
            agent = LanguageModelAgent(client_of(server, answers), PromptBuilder(panoramas=Grey(), pictures=how))
            play(find_env, agent, [dataclasses.replace(find_tasks(1)[0], horizon=1)], seed=0)
        sizes = []
        for request in server.requests:
            text, picture = request["messages"][1]["content"]
            data = base64.b64decode(picture["image_url"]["url"].partition(",")[2])
            sizes.append(Image.open(io.BytesIO(data)).size)
            count = text["text"].count("go ") // 2
    assert sizes[0] == (224 * count + 4 * (count - 1), 224) and sizes[1] == (768, 384)
