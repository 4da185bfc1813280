"""SmolLM2-135M in the line. It is weak: what is tested is that its answers are taken as they are."""

from __future__ import annotations

import dataclasses
import socket
import subprocess
import time
import urllib.request

import pytest
from hand_worlds import grid_world

pytest.importorskip("openai", reason="the optional extra [llm] is not installed")
pytest.importorskip("llama_cpp", reason="the optional extra [smollm] is not installed")

from agents.language_models.agent import LanguageModelAgent
from agents.language_models.assistant import ModelAssistant
from agents.language_models.cache import AnswerCache
from agents.language_models.client import Client, ServerSettings
from agents.language_models.small import NAME, command
from embodied.envs.make import ask_environment_maker, look_of
from embodied.evaluation.metrics import usage
from embodied.evaluation.rollout import play
from embodied.interface import Ask, Intention
from embodied.records import to_json
from embodied.tasks.ask import ask_pool, ask_tasks

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def served():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    server = subprocess.Popen(command(port), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(240):
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/v1/models", timeout=1).read()
                break
            except OSError:
                time.sleep(0.25)
        yield f"http://127.0.0.1:{port}/v1"
    finally:
        server.terminate()
        server.wait(10)


def test_a_real_model_acts_and_answers_and_replays_without_its_server(served, tmp_path):
    world = grid_world()
    make_env = ask_environment_maker({"grid": world}, look_of(None))
    tasks = [dataclasses.replace(t, horizon=2) for t in ask_tasks(ask_pool(world, look_of(None), seed=0), 1, seed=0)]
    settings = ServerSettings(NAME, served, form="object", most_tokens=100, together=1, timeout=300.0)
    client = Client(settings, AnswerCache(tmp_path / "answers.sqlite"))
    first = play(make_env, LanguageModelAgent(client), tasks, seed=0)
    used = [usage(e) for e in first]
    assert all(u is not None and u.tokens_in > 0 and u.calls == len(e.steps) for u, e in zip(used, first, strict=True))
    env = make_env()
    env.assistant = ModelAssistant(env.assistant, client)
    env.reset(tasks[0])
    env.step(Ask(Intention.REGION))
    assert env.last_step.reply.text and env.last_step.reply.usage.calls == 1
    offline = Client(settings, AnswerCache(tmp_path / "answers.sqlite"), offline=True)
    again = play(make_env, LanguageModelAgent(offline), tasks, seed=0)
    assert [to_json(e) for e in again] == [to_json(e) for e in first]
