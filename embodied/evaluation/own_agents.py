"""Agents of people's own, from a folder, by name or over HTTP, and the lists of seeds that they are judged on."""

from __future__ import annotations

import http.client
import importlib.util
import json
import sys
import urllib.parse
from pathlib import Path
from typing import Any

import numpy as np

from embodied.action_spaces import door_actions
from embodied.errors import UnableError
from embodied.interface import Action, Actions, Agent, Ask, Intention, Move, Observation, Observations, Rngs, Stop
from embodied.kinds.plugins import made_by_name
from embodied.records import RecordError, parse

MOST_BYTES = 100_000
"""Of an answer over HTTP; more is not read."""
ANSWER_SECONDS = 60.0
"""Time for an answer over HTTP."""


def read_seeds(path: Path) -> list[int]:
    """The seeds of a list: one whole number a line, '#' begins a remark.

    Raises:
      ValueError: names the line.
    """
    seeds = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        word = line.partition("#")[0].strip()
        if word:
            try:
                seeds.append(int(word))
            except ValueError:
                raise ValueError(f"{path}:{number} should be a whole number, got {word[:40]!r}") from None
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"{path} should hold at least one seed and none twice")
    return seeds


def submitted(where: str) -> Agent:
    """An agent of somebody's own: a folder whose agent.py has `make_agent()`, 'module:Policy', or an HTTP address.

    Its code is run as it is: run agents that you do not trust in a container.

    Raises:
      ValueError: none of them, or an agent of a folder that wants to be shown the situations.
    """
    if where.startswith(("http://", "https://")):
        return HttpAgent(where)
    if ":" in where:
        return made_by_name(where)
    file = Path(where) / "agent.py"
    if not file.exists():
        raise ValueError(
            f"{where} should be an agent's http:// address, or a folder with an agent.py with make_agent()"
        )
    spec = importlib.util.spec_from_file_location("submission", file)
    assert spec is not None and spec.loader is not None, "a .py file"
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(file.parent.resolve()))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    if not callable(getattr(module, "make_agent", None)):
        raise ValueError(f"{file} should define make_agent(), which gives an embodied.interface.Policy")
    agent = module.make_agent()
    if hasattr(agent, "act_privileged") or not hasattr(agent, "act"):
        raise ValueError(f"{file}: an agent has `act` and is not shown the situations")
    return agent


class HttpAgent:
    """Asks a server for every action: POST of an observation as JSON, answered by {"action": "go 0"}.

    An answer that is none stops the episode.
    """

    def __init__(self, url: str) -> None:
        self._url = urllib.parse.urlsplit(url)
        if not self._url.hostname:
            raise ValueError(f"{url!r} is no address; write http://HOST:PORT/PATH")

    def act(self, observations: Observations, memory: Any, *, rngs: Rngs) -> tuple[Actions, Any]:
        names = memory or [f"{rng.integers(2**63):x}" for rng in rngs]
        return [None if o is None else self._one(o, name) for o, name in zip(observations, names, strict=True)], names

    def _one(self, o: Observation, episode: str) -> Action:
        kind = http.client.HTTPSConnection if self._url.scheme == "https" else http.client.HTTPConnection
        try:
            server = kind(self._url.hostname or "", self._url.port, timeout=ANSWER_SECONDS)
            try:
                body = json.dumps({"episode": episode, **observed(o)})
                server.request("POST", self._url.path or "/", body, {"Content-Type": "application/json"})
                answer = server.getresponse().read(MOST_BYTES + 1)
            finally:
                server.close()
        except (OSError, http.client.HTTPException) as e:
            raise UnableError(f"no answer from {self._url.geturl()} ({e}); start the agent's server") from e
        return acted(o, answer)


def observed(o: Observation) -> dict[str, object]:
    """An observation as JSON, without anything that names the place."""
    c = o.candidates
    return {
        "instruction": o.instruction,
        "time": o.time,
        "turn": o.turn,
        "candidates": [
            {"bearing": round(float(b), 4), "slope": round(float(s), 4)}
            for b, s in zip(c.bearing, c.slope, strict=True)
        ],
        "can_ask": [i.value for i in o.can_ask],
        **({"can_open": list(o.can_open), "can_close": list(o.can_close)} if o.can_open or o.can_close else {}),
        **({} if o.extras is None else o.extras.as_json()),
    }


def acted(o: Observation, answer: bytes) -> Action:
    """The action of an answer: 'go 0', 'open 1', 'ask region', 'stop'; with 'question' for a free one; else a stop."""
    try:
        body = parse(answer[: MOST_BYTES + 1], "an action")
    except RecordError:
        return Stop()
    word = body.get("action") if isinstance(body, dict) else None
    verb, _, what = word.partition(" ") if isinstance(word, str) else ("", "", "")
    if verb == "go" and what.isdigit() and len(what) < 4 and int(what) in np.flatnonzero(o.candidates.allowed):
        return Move(int(what))
    if word in (doors := door_actions(o)):
        return doors[word]
    if verb == "ask" and what in {i.value for i in o.can_ask}:
        question = body.get("question") if isinstance(body, dict) else None
        return Ask(Intention(what), question=question[:300] if isinstance(question, str) else None)
    return Stop()
