"""The server as a process: nothing that was acknowledged is lost, and nobody reaches what is not theirs."""

from __future__ import annotations

import json
import shutil
import socket
import ssl
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from hand_serve import TOGETHER, Human, Served, make_data, pair, write_study
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.vision.encoder import load_encoder
from embodied.agents.vision.features import feature_path, save_features
from embodied.cli.serve import agents_of
from embodied.datasets.store import Dataset
from embodied.evaluation.evaluate import play
from embodied.interface import Episode
from embodied.records import load_lines
from embodied.render.pictures import Unlit

ROOT = Path(__file__).resolve().parent.parent
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("served")
    make_data(folder)
    return folder


@pytest.fixture(scope="module")
def server(folder):
    served = Served(write_study(folder, TOGETHER + "answers = 9\n"))
    yield served
    served.stop()


def get(address: str) -> tuple[int, dict, bytes]:
    try:
        with urllib.request.urlopen(address, timeout=600) as answer:
            return answer.status, dict(answer.headers), answer.read()
    except urllib.error.HTTPError as e:
        return e.code, dict(e.headers), e.read()


def test_a_server_killed_in_the_middle_loses_no_answer_that_was_acknowledged(folder):
    server = Served(write_study(folder, name="killed"))
    agent, helper = pair(server)
    agent.until("agent")
    for k in range(2):
        agent.until("agent", lambda s: s["yours"])
        agent.play("asked", text=f"question {k}?")
        helper.until("assistant", lambda s: s["yours"])
        assert "error" not in helper.play("answered", text=f"answer {k}")
        server.kill()
        server.start()
        agent.enter()
        helper.enter()
        assert [s["text"] for s in agent.screen["said"]][-2:] == [f"question {k}?", f"answer {k}"]
        agent.play("moved", candidate=agent.screen["moves"][0]["candidate"])
        agent.until("agent", lambda s: s["turn"] % 3 == 0)
        helper.until("assistant", lambda s: s["turn"] % 3 == 0)
    agent.play("stopped")
    server.kill()
    server.start()  # the episode is in the log, whatever was written beside it
    (episode,) = load_lines(server.people / "episodes_val_seen_together.jsonl", Episode)
    server.stop()
    assert [s.reply.text for s in episode.steps if s.reply] == ["answer 0", "answer 1"]
    assert len(episode.steps) == 5


def test_a_message_that_is_sent_again_counts_once(server):
    agent, _ = pair(server)
    agent.until("agent")
    old = dict(agent.screen)
    move = {"game": old["game"], "turn": old["turn"], "candidate": old["moves"][0]["candidate"], "id": "same"}
    assert "error" not in agent.say("moved", **move)
    assert "error" not in agent.say("moved", **move)
    assert agent.screen["turn"] == old["turn"] + 1
    assert "meantime" in agent.say("moved", **{**move, "id": "other"})["error"]


def test_nobody_acts_for_another_or_out_of_turn(server):
    agent, helper = pair(server)
    stranger = Human(server)
    agent.until("agent")
    theirs = {"game": agent.screen["game"], "turn": agent.screen["turn"]}
    assert "error" in stranger.say("moved", candidate=0, **theirs)
    helper.until("assistant")
    assert "error" in helper.say("moved", candidate=0, **theirs)
    assert "error" in helper.say("answered", text="nobody asked", **theirs)
    assert "error" in agent.say("house"), "the plan is the assistant's"
    assert "error" not in helper.say("house") and helper.plan["rooms"]
    for nonsense in ("apply_event", "_joined", "broken", "began", None, 7):
        assert "error" in agent.say(nonsense, **theirs)
    assert "error" not in agent.play("asked", text="Where?")
    helper.until("assistant", lambda s: s["yours"])
    for picture in (2.0, True, -1, 10**30, "1", [1]):
        assert "error" in helper.play("answered", text="there", picture=picture), picture
    assert "error" not in helper.play("answered", text="there", picture=2)


def test_strangers_pages_and_words_are_refused(server):
    address = f"ws://127.0.0.1:{server.port}/ws"
    with pytest.raises(InvalidStatus):
        connect(address, origin=None)
    with connect(address, origin="https://evil.example") as socket:
        told = json.loads(socket.recv(10))
        assert told["screen"] == "refused" and "https://evil.example" in told["text"] and server.address in told["text"]
    for hello in ({"token": "guessed"}, {"join": "guessed"}, {"admin": "guessed"}, {"admin": server.word}, {}, []):
        with connect(address, origin=server.address) as socket:
            socket.send(json.dumps(hello))
            assert json.loads(socket.recv(10))["screen"] == "refused"


def test_five_megabytes_and_other_rubbish_close_only_their_own_connection(server):
    agent, helper = pair(server)
    agent.until("agent")
    for rubbish in ("x" * 5_000_000, "[" * 5000, "not json", b"\xff\x00"):
        other = Human(server)
        with pytest.raises((ConnectionClosed, TimeoutError)):
            other.socket.send(rubbish)
            while True:
                other.socket.recv(timeout=600)
    assert "characters" in agent.play("asked", text="y" * 2001)["error"]
    assert "error" not in agent.play("asked", text="still here?")


def test_a_single_use_link_admits_one(folder):
    server = Served(write_study(folder, name="invited"), "--invitations", "2")
    words = [link.split("=")[1] for link in server.links["invitations"]]
    assert len(words) == 2 and not server.links["join"]
    first = Human(server, join=words[0])
    assert first.screen["screen"] == "consent"
    assert Human(server, join=words[0]).screen["screen"] == "refused"
    first.enter()
    assert first.screen["screen"] == "consent", "whoever took it up may come back"
    server.kill()
    server.start()
    assert Human(server, join=words[0]).screen["screen"] == "refused"
    assert Human(server, join=words[1]).screen["screen"] == "consent"
    server.stop()


def test_only_the_pages_and_pictures_of_the_study_can_be_reached(server):
    status, headers, body = get(server.address + "/")
    assert status == 200 and b"<script" in body and "default-src 'none'" in headers["content-security-policy"]
    assert get(server.address + "/static/app.js")[0] == 200
    for path in ("static/../study.toml", "static/..%2f..%2fapp.py", "people.db", "static/index.html%00.js", "pano/"):
        assert get(f"{server.address}/{path}")[0] == 404, path
    agent, _ = pair(server)
    name = agent.until("agent")["pano"]
    for size in ("small", "large"):
        status, headers, body = get(f"{server.address}/pano/{name}/{size}.jpg")
        assert status == 200 and body[:2] == b"\xff\xd8" and "immutable" in headers["cache-control"]
    for wrong in (f"/pano/{name}/huge.jpg", f"/pano/{'0' * 24}/small.jpg", "/pano/..%2fx/small.jpg"):
        assert get(server.address + wrong)[0] == 404


@pytest.mark.skipif(not shutil.which("caddy"), reason="Debian's caddy is not installed")
def test_the_caddyfile_of_the_tutorial_serves_a_study_behind_tls(folder, tmp_path):
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        address = f"https://localhost:{s.getsockname()[1]}"
    server = Served(write_study(folder, name="proxied"), "--address", address.upper() + "/")
    assert server.links["join"][0].startswith(address + "/#join=")
    text = (ROOT / "examples" / "Caddyfile").read_text().replace("127.0.0.1:8080", f"127.0.0.1:{server.port}")
    text = text.replace("study.example.org {", address.removeprefix("https://") + " {\n\ttls internal")
    text = "{\n\tadmin off\n\tskip_install_trust\n\tauto_https disable_redirects\n}\n" + text
    (tmp_path / "Caddyfile").write_text(text)
    env = {"HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path), "PATH": "/usr/bin:/bin"}
    command = ["caddy", "run", "--config", str(tmp_path / "Caddyfile"), "--adapter", "caddyfile"]
    log = tmp_path / "caddy.log"  # a file: a pipe that nobody reads stops it when full
    caddy = subprocess.Popen(command, env=env, stderr=log.open("wb"))
    try:
        lax = ssl.create_default_context()
        lax.check_hostname, lax.verify_mode = False, ssl.CERT_NONE  # its certificate is its own here
        for _ in range(100):
            try:
                with urllib.request.urlopen(address + "/health", context=lax, timeout=5) as answer:
                    assert answer.read() == b"ok"
                break
            except (OSError, urllib.error.URLError):
                assert caddy.poll() is None, log.read_text()
                time.sleep(0.1)
        for at in ("/", "/static/app.js"):
            with urllib.request.urlopen(address + at, context=lax, timeout=5) as answer:
                assert answer.status == 200
        with connect(address.replace("https", "wss") + "/ws", origin=address, ssl=lax, open_timeout=300) as ws:
            ws.send(json.dumps({"join": server.word}))
            assert "token" in json.loads(ws.recv(300))
        with connect(
            address.replace("https", "wss") + "/ws", origin="https://evil.example", ssl=lax, open_timeout=300
        ) as ws:
            assert json.loads(ws.recv(300))["screen"] == "refused"
    finally:
        caddy.terminate()
        server.stop()


def test_the_shipped_agent_takes_part_with_what_embodied_features_left(folder):
    data = Dataset(folder / "data")
    encoder, places = load_encoder(SHIPPED_ENCODER), data.split("val_seen").worlds
    for name, place in places.items():
        blank, pictures = np.zeros((len(place.graph.ids), 36, encoder.size)), Unlit(size=64)
        path = feature_path(data.folder / "features", encoder.digest, name, pictures)
        save_features(path, blank, encoder, place.house.digest, pictures)
    agent = agents_of(data.folder, lambda: None)["shipped"](data.split("val_seen"))
    (episode,) = play(data.split("val_seen").make_env, agent, data.tasks("val_seen")[:1], seed=0)
    assert episode.steps[0].action.thought is not None
