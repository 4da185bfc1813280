"""One client for all roles: asks a chat-completions server, and keeps every answer in one file.

What was asked before is never asked again. A server that fails is tried again, then it ends the run, which goes on
from there. Keys come from the environment and go into the request's header, nowhere else.
"""

import json
import logging
import random
import re
import sqlite3
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from embodied.agents.common.settings import AtLeastOne, Checked, NotNegative, Positive
from embodied.agents.language_models.completions import TOOL, Answer, StoredAnswer, read_answer, read_completion
from embodied.agents.language_models.transport import Endpoint, ServerError, completions_url
from embodied.assets.cache import digest
from embodied.errors import UnableError
from embodied.interface import Usage
from embodied.options import InputFolder, InputPath, Option, Settings
from embodied.records import from_json, to_json

FORMS = ("schema", "object", "tools", "text")
"""How JSON is asked for: structured output as OpenAI has it, as llama-cpp-python has it, a tool, or in words alone."""
LONGEST_WAIT = 30.0
"""Seconds between two tries."""
UNSUPPORTED = re.compile(r"support|deprecated|only the default|not allowed|not permitted", re.IGNORECASE)
"""Words of a server that does not know a setting, unlike one that finds its value wrong."""
WRITE_WAIT = 60.0
"""Seconds that a process waits for another one that writes to the same file."""
log = logging.getLogger(__name__)

Message = Mapping[str, Any]
"""Of the chat-completions protocol: 'role' and 'content', a text or parts ('text', 'image_url')."""


@dataclass(frozen=True)
class ServerSettings(Checked):
    """Which model answers, and how it is asked."""

    model: str
    """Name of the model, as its server knows it."""
    base_url: str = "https://api.openai.com/v1"
    """Address of the server, which implements OpenAI's chat completions; stored answers do not depend on it."""
    key_variable: str = "OPENAI_API_KEY"
    """Environment variable with the key; a server of your own needs none."""
    form: Annotated[str, Option(words=FORMS)] = "schema"
    """How JSON is requested: structured output of OpenAI (schema) or of llama-cpp-python (object), a tool call (tools),
    or the prompt alone (text)."""
    temperature: float = 0.0
    """Sampling temperature."""
    most_tokens: AtLeastOne = 300
    """Longest answer, tokens."""
    price_in: float = 0.0
    """Price of a million tokens sent."""
    price_out: float = 0.0
    """Price of a million tokens answered."""
    timeout: Positive = 60.0
    """Seconds to wait for a whole answer."""
    tries: AtLeastOne = 6
    """Send a request at most this many times."""
    wait: NotNegative = 1.0
    """Seconds before the second try; doubled before each further one, up to 30."""
    together: AtLeastOne = 8
    """Send at most this many requests at a time."""


class AnswerCache:
    """Owns the SQLite file of answers. Threads may share it, and so may processes, each with its own.

    An answer is written as soon as it comes, so that a run that is cut short goes on where it stopped. The file holds
    no key and no address of a server; pictures stand in it as digests.
    """

    def __init__(self, path: Path) -> None:
        """
        Args:
          path: the file; made where there is none.

        Raises:
          ValueError: another file stands there.
        """
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        try:
            self._file = sqlite3.connect(self.path, timeout=WRITE_WAIT, isolation_level=None, check_same_thread=False)
            self._file.execute(
                "CREATE TABLE IF NOT EXISTS answers (key TEXT PRIMARY KEY, request TEXT NOT NULL, answer TEXT NOT NULL)"
                " WITHOUT ROWID"
            )
        except sqlite3.DatabaseError as e:
            raise ValueError(f"{path} cannot be used to keep answers ({e}); choose another file") from e

    def get(self, key: str) -> str | None:
        """The answer that is kept under a key, as JSON."""
        row = self._execute("SELECT answer FROM answers WHERE key = ?", key)
        return row[0] if row else None

    def put(self, key: str, request: str, answer: str) -> str:
        """Keep an answer; returns the one that is kept from now on, which is the first that came."""
        self._execute("INSERT OR IGNORE INTO answers VALUES (?, ?, ?)", key, request, answer)
        return self.get(key) or answer

    def __len__(self) -> int:
        return int(self._execute("SELECT count(*) FROM answers")[0])

    def close(self) -> None:
        with self._lock:
            self._file.close()

    def _execute(self, command: str, *values: str) -> Any:
        """The first row that a command gives."""
        try:
            with self._lock:
                return self._file.execute(command, values).fetchone()
        except sqlite3.Error as e:
            raise UnableError(
                f"{self.path} cannot be read and written ({e}); see to it and run the command again"
            ) from e


class Client:
    """Owns the cache and asks the server; threads may share it."""

    def __init__(self, settings: ServerSettings, cache: AnswerCache, *, offline: bool = False) -> None:
        """
        Args:
          offline: only what is kept may be answered.

        Raises:
          ValueError: the settings hold no address of a server.
        """
        self.settings, self.cache, self.offline = settings, cache, offline
        self.sent = 0
        """Requests that were answered by the server, not from the cache."""
        self._lock, self._gate = threading.Lock(), threading.Semaphore(settings.together)
        self._endpoint = Endpoint(completions_url(settings.base_url), settings.key_variable, settings.timeout)
        self._changes: dict[str, str] = {}
        """New names of settings in the body; '' for one that is left out."""
        self._warned = set[str]()

    def ask(self, messages: Sequence[Message], schema: Mapping[str, Any]) -> Answer:
        """The object of `schema` that the model answers with, from the cache where it was asked before.

        Raises:
          UnableError: the server cannot be reached, fails, or refuses the request.
        """
        request = self._request(messages, schema)
        key = digest(request)
        kept = self.cache.get(key)
        if kept is None:
            with self._gate:
                completion = self._send(request)
            with self._lock:
                self.sent += 1
            kept = self.cache.put(key, json.dumps(_without_pictures(request), sort_keys=True), to_json(completion))
        answer = read_answer(from_json(StoredAnswer, kept), schema)
        if answer.cut and answer.value is None:
            self._warn(f"an answer was {answer.problem}")
        return answer

    def ask_all(self, asked: Sequence[tuple[Sequence[Message], Mapping[str, Any]]]) -> list[Answer]:
        """Several at a time, in order."""
        if len(asked) < 2:
            return [self.ask(*a) for a in asked]
        with ThreadPoolExecutor(min(self.settings.together, len(asked))) as pool:
            return list(pool.map(lambda a: self.ask(*a), asked))

    def usage(self, answer: Answer) -> Usage:
        """Costs and faults of an answer."""
        s, invalid = self.settings, answer.value is None and not answer.refused
        price = (answer.tokens_in * s.price_in + answer.tokens_out * s.price_out) / 1e6
        return Usage(1, answer.tokens_in, answer.tokens_out, round(price, 9), int(invalid), int(answer.refused))

    def _request(self, messages: Sequence[Message], schema: Mapping[str, Any]) -> dict[str, Any]:
        """The body of the request, which is also the key of its answer."""
        s = self.settings
        body: dict[str, Any] = {
            "model": s.model,
            "messages": list(messages),
            "temperature": s.temperature,
            "max_tokens": s.most_tokens,
        }
        if s.form == "schema":
            wanted = {"name": TOOL, "schema": dict(schema), "strict": True}
            body["response_format"] = {"type": "json_schema", "json_schema": wanted}
        elif s.form == "object":
            body["response_format"] = {"type": "json_object", "schema": dict(schema)}
        elif s.form == "tools":
            about = {"name": TOOL, "description": "Give the answer.", "parameters": dict(schema)}
            body["tools"] = [{"type": "function", "function": about}]
            body["tool_choice"] = {"type": "function", "function": {"name": TOOL}}
        else:
            wish = f"Answer with one JSON object of this schema and nothing else: {json.dumps(schema)}"
            body["messages"] = [*body["messages"], {"role": "system", "content": wish}]
        return body

    def _send(self, request: Mapping[str, Any]) -> StoredAnswer:
        if self.offline:
            raise UnableError(f"{self.cache.path} does not hold the answer to this request; leave --offline out")
        s, last = self.settings, ServerError("")
        for attempt in range(s.tries):
            if attempt:
                pause = min(max(s.wait * 2 ** (attempt - 1), last.wait), LONGEST_WAIT)
                time.sleep(pause * random.uniform(0.75, 1.25))  # so that clients do not come back together
            try:
                return read_completion(self._posted(request))
            except ServerError as e:
                last = e
                if not e.passing:
                    break
                self._warn(f"{s.base_url}: {self._endpoint.hidden(e)}; it is tried again")
        tries = f" after {s.tries} tries" if last.passing else ""
        raise UnableError(
            f"no answer from {s.base_url}{tries}: {self._endpoint.hidden(last)}. Run the same command again: "
            f"{len(self.cache)} answers are kept in {self.cache.path}, it goes on from there"
        )

    def _posted(self, request: Mapping[str, Any]) -> bytes:
        """The content of the response, asked for with the settings that this server and its model know."""
        while True:
            changes = dict(self._changes)
            body = {changes.get(n, n): v for n, v in request.items() if changes.get(n, n)}
            try:
                return self._endpoint.post({**body, "stream": False})
            except ServerError as e:
                if "max_completion_tokens" in e.words and "max_tokens" in body:
                    self._changes["max_tokens"] = "max_completion_tokens"
                elif "temperature" in e.words and UNSUPPORTED.search(e.words) and "temperature" in body:
                    self._changes["temperature"] = ""
                    self._warn(f"{self.settings.model} takes no temperature: it samples with its own")
                else:
                    raise

    def _warn(self, text: str) -> None:
        """Warn of something once."""
        with self._lock:
            is_new = text not in self._warned
            self._warned.add(text)
        if is_new:
            log.warning("%s", text)


@dataclass(frozen=True, kw_only=True)
class WithModel:
    """The language model."""

    server: Annotated[ServerSettings, Settings("the language model", ServerSettings(""), skip=("wait",))]
    answers: InputPath = Path("answers.sqlite")
    """File that keeps every answer: the same question is not asked twice."""
    offline: bool = False
    """Use only stored answers; send nothing to a server."""
    prompts: InputFolder | None = None
    """Folder with prompts of your own (agent.md, ...)."""


def client_of(args: WithModel) -> Client:
    """The client that the options describe.

    Raises:
      ValueError: no model was named.
    """
    if not args.server.model:
        raise ValueError("a language model takes part: name it with --model NAME (and its server with --base-url URL)")
    return Client(args.server, AnswerCache(args.answers), offline=args.offline)


def _without_pictures(value: Any) -> Any:
    """A request with digests in place of pictures."""
    if isinstance(value, dict):
        return {k: _without_pictures(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_without_pictures(v) for v in value]
    return f"picture {digest(value)[:32]}" if isinstance(value, str) and value.startswith("data:image/") else value
