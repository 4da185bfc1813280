"""SmolLM2-135M in the line. It is weak: what is tested is that its answers are taken as they are."""

from __future__ import annotations

import dataclasses
import socket
import subprocess
import time
import urllib.request

import pytest
from hand_worlds import grid_world

pytest.importorskip("llama_cpp", reason="the optional extra [smollm] is not installed")

from embodied.agents.language_models.agent import LanguageModelAgent, ModelAssistant
from embodied.agents.language_models.client import AnswerCache, Client, ServerSettings
from embodied.cli.llm import SMOLLM, serving
from embodied.evaluation.evaluate import play
from embodied.interface import Ask, Intention
from embodied.kinds.metrics import usage
from embodied.kinds.shipped.ask import ask_environments
from embodied.kinds.shipped.find import FIND
from embodied.kinds.task_kind import EnvInputs
from embodied.language import PlainLanguage
from embodied.records import to_json
from embodied.tasks.ask import ask_pool, ask_tasks, look_of
from embodied.tasks.goals import find_pool, find_task

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def served():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        port = s.getsockname()[1]
    server = subprocess.Popen(serving(port), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
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
    find = FIND.environments(EnvInputs({"grid": world}))
    task = find_task(find_pool(world, seed=0), 0, seed=0, language=PlainLanguage())
    tasks = [dataclasses.replace(task, horizon=1)]
    settings = ServerSettings(SMOLLM, served, form="object", most_tokens=60, together=1, timeout=300.0)
    client = Client(settings, AnswerCache(tmp_path / "answers.sqlite"))
    (first,) = play(find, LanguageModelAgent(client), tasks, seed=0)
    used = usage(first)
    assert used is not None and used.tokens_in > 50 and used.calls == len(first.steps) == 1
    env = ask_environments({"grid": world}, look_of(None))()
    env.assistant = ModelAssistant(env.assistant, client)
    env.reset(ask_tasks(ask_pool(world, look_of(None), seed=0), 1, seed=0)[0])
    env.step(Ask(Intention.REGION))
    assert env.last_step.reply.text and env.last_step.reply.usage.tokens_out > 0
    offline = Client(settings, AnswerCache(tmp_path / "answers.sqlite"), offline=True)
    assert to_json(play(find, LanguageModelAgent(offline), tasks, seed=0)[0]) == to_json(first)
