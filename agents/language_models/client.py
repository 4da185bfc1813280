"""One client for all roles: asks a chat-completions server, keeps every answer, and counts what is none.

The network may fail and is tried again; an answer that is none (HTML, wrong JSON, megabytes, an unknown tool) is
counted and kept like any other. Keys come from the environment and go into the request's header, nowhere else.
"""

from __future__ import annotations

import functools
import json
import os
import queue
import random
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from embodied.agents.language_models.cache import AnswerCache
from embodied.assets.cache import digest
from embodied.errors import UnableError
from embodied.interface import Usage
from embodied.records import RecordError, from_json, parse, to_json

FORMS = ("schema", "object", "tools", "text")
"""How JSON is asked for: structured output as OpenAI has it, as llama-cpp-python has it, a tool, or in words alone."""
MOST_BYTES = 1_000_000
"""Of a response; more is not read."""
MOST_TEXT = 20_000
"""Characters of an answer that are kept; a longer one is invalid."""
AGAIN = (408, 409, 425, 429, 500, 502, 503, 504, 529)
"""Status codes after which the same request is sent again."""
TOOL = "answer"
"""Name of the one tool that is offered with the form 'tools'."""

KINDS: Mapping[str, Any] = {"object": dict, "string": str, "integer": int, "number": (int, float), "boolean": bool}
"""Types of JSON Schema that answers are made of."""

Message = Mapping[str, Any]
"""Of the chat-completions protocol: 'role' and 'content', a text or parts ('text', 'image_url')."""


@dataclass(frozen=True)
class ServerSettings:
    """Which model answers, and how it is asked."""

    model: str
    """Name of the model, as its server knows it."""
    base_url: str = "https://api.openai.com/v1"
    """Address of the server, which implements OpenAI's chat completions; stored answers do not depend on it."""
    key_variable: str = "OPENAI_API_KEY"
    """Environment variable with the key; a server of your own needs none."""
    form: str = "schema"
    """How JSON is requested: structured output of OpenAI (schema) or of llama-cpp-python (object), a tool call (tools),
    or the prompt alone (text)."""
    temperature: float = 0.0
    """Sampling temperature."""
    most_tokens: int = 300
    """Longest answer, tokens."""
    price_in: float = 0.0
    """Price of a million tokens sent."""
    price_out: float = 0.0
    """Price of a million tokens answered."""
    timeout: float = 60.0
    """Seconds to wait for a whole answer."""
    tries: int = 6
    """Send a request at most this many times."""
    wait: float = 1.0
    """Seconds before the second try; doubled before each further one, up to 30."""
    together: int = 8
    """Send at most this many requests at a time."""

    def __post_init__(self) -> None:
        if self.form not in FORMS:
            raise ValueError(f"form should be one of {FORMS}, got {self.form!r}")
        if min(self.tries, self.together, self.most_tokens) < 1 or not self.timeout > 0 or self.wait < 0:
            raise ValueError(f"tries, together and most_tokens should be at least 1 and times positive, got {self}")


@dataclass(frozen=True)
class _Kept:
    """An answer as the cache holds it."""

    text: str = ""
    """What the model wrote."""
    problem: str = ""
    """Why it is no answer."""
    refused: bool = False
    tokens_in: int = 0
    tokens_out: int = 0


@dataclass(frozen=True)
class Answer(_Kept):
    """What came back for one request."""

    value: Mapping[str, Any] | None = None
    """The object that was wanted; None for an answer that is none."""

    def usage(self, s: ServerSettings) -> Usage:
        """What it cost and what was wrong with it."""
        price = (self.tokens_in * s.price_in + self.tokens_out * s.price_out) / 1e6
        invalid = self.value is None and not self.refused
        return Usage(1, self.tokens_in, self.tokens_out, round(price, 9), int(invalid), int(self.refused))


class Client:
    """Owns the connection and the cache; threads may share it."""

    def __init__(self, settings: ServerSettings, cache: AnswerCache, *, offline: bool = False) -> None:
        """
        Args:
          offline: only what is kept may be answered.
        """
        self.settings, self.cache, self.offline = settings, cache, offline
        self.sent = 0
        """Requests that were answered by the server, not from the cache."""
        self._lock, self._gate = threading.Lock(), threading.Semaphore(settings.together)
        self._api: Any = None

    def ask(self, messages: Sequence[Message], schema: Mapping[str, Any]) -> Answer:
        """The object of `schema` that the model answers with, from the cache where it was asked before.

        Raises:
          UnableError: the server cannot be reached, or refuses the request.
        """
        request = self._request(messages, schema)
        key = digest(request)
        kept = self.cache.get(key)
        if kept is None:
            with self._gate:
                said = self._send(request)
            with self._lock:
                self.sent += 1
            kept = self.cache.put(key, json.dumps(_without_pictures(request), sort_keys=True), to_json(said))
        return understood(from_json(_Kept, kept), schema)

    def ask_all(self, asked: Sequence[tuple[Sequence[Message], Mapping[str, Any]]]) -> list[Answer]:
        """Several at a time, in order."""
        if len(asked) < 2:
            return [self.ask(*a) for a in asked]
        with ThreadPoolExecutor(min(self.settings.together, len(asked))) as pool:
            return list(pool.map(lambda a: self.ask(*a), asked))

    def _request(self, messages: Sequence[Message], schema: Mapping[str, Any]) -> dict[str, Any]:
        """The body of the request, which is also what its answer is kept under."""
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
            told = f"Answer with one JSON object of this schema and nothing else: {json.dumps(schema)}"
            body["messages"] = [*body["messages"], {"role": "system", "content": told}]
        return body

    def _send(self, request: Mapping[str, Any]) -> _Kept:
        if self.offline:
            raise UnableError(f"{self.cache.path} does not hold the answer to this request; leave --offline out")
        openai, httpx, s = _openai(), _httpx(), self.settings
        told = 0.0
        for attempt in range(s.tries):
            if attempt:
                pause = min(max(s.wait * 2 ** (attempt - 1), told), 30.0)
                time.sleep(pause * random.uniform(0.75, 1.25))  # so that clients do not come back together
            try:
                body = _within(2 * s.timeout, lambda: self._received(request))
            except openai.APIStatusError as e:
                problem = self._hidden(f"status {e.status_code}: {e}")
                if e.status_code not in AGAIN:
                    raise UnableError(f"{s.base_url} refuses the request: {problem}") from None
                told = _seconds(e.response.headers.get("retry-after"))
            except httpx.DecodingError:
                return _Kept(problem="the response cannot be decompressed")
            except (openai.APIConnectionError, httpx.HTTPError) as e:
                problem = type(e).__name__
            else:
                return _said(body)
        raise UnableError(
            f"no answer from {s.base_url} after {s.tries} tries ({problem}); start the server and run the same command "
            f"again: {len(self.cache)} answers are kept in {self.cache.path}, it goes on from there"
        )

    def _received(self, request: Mapping[str, Any]) -> bytes | None:
        with self._connection().chat.completions.with_streaming_response.create(**request) as response:
            return _body(response.iter_bytes(), time.monotonic() + self.settings.timeout)

    def _connection(self) -> Any:
        with self._lock:
            if self._api is None:
                s = self.settings
                key = os.environ.get(s.key_variable) or "none"
                hooks = {"response": [functools.partial(_cut_short, seconds=s.timeout)]}
                own = _openai().DefaultHttpxClient(base_url=s.base_url, timeout=s.timeout, event_hooks=hooks)
                settings = {"base_url": s.base_url, "timeout": s.timeout, "max_retries": 0}
                self._api = _openai().OpenAI(api_key=key, http_client=own, **settings)
        return self._api

    def _hidden(self, text: str) -> str:
        """A message without the key, however the server repeats it."""
        key = os.environ.get(self.settings.key_variable)
        return (text.replace(key, "***") if key else text)[:500]


def understood(kept: _Kept, schema: Mapping[str, Any]) -> Answer:
    """The answer as the object of a schema, or why it is none."""
    value, problem = None, kept.problem
    if not problem and not kept.refused:
        try:
            value = parse(_object_in(kept.text), "an answer")
            problem = misfit(value, schema)
        except RecordError as e:
            problem = str(e)
    value = value if isinstance(value, dict) and not problem and not kept.refused else None
    return Answer(kept.text, problem, kept.refused, kept.tokens_in, kept.tokens_out, value)


def misfit(value: object, schema: Mapping[str, Any], where: str = "the answer") -> str:
    """What is wrong with a value by the part of JSON Schema that is used here; '' for nothing."""
    kind = KINDS[schema["type"]]
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        return f"{where} should be of type {schema['type']}"
    if "enum" in schema and value not in schema["enum"]:
        return f"{where} should be one of {list(schema['enum'])[:20]}"
    if isinstance(value, str) and len(value) > schema.get("maxLength", MOST_TEXT):
        return f"{where} is too long"
    if isinstance(value, int | float) and not schema.get("minimum", value) <= value <= schema.get("maximum", value):
        return f"{where} is out of range"
    if isinstance(value, dict):
        known = schema.get("properties", {})
        if missing := [n for n in schema.get("required", ()) if n not in value]:
            return f"{where} lacks {missing}"
        if unknown := [str(n)[:40] for n in value if n not in known]:
            return f"{where} has unknown fields {unknown[:5]}"
        return next((m for n, v in value.items() if (m := misfit(v, known[n], n))), "")
    return ""


def object_schema(**properties: Mapping[str, Any]) -> dict[str, Any]:
    """A JSON schema of an object that has exactly these properties, in their order."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(properties),
        "additionalProperties": False,
    }


def _said(body: bytes | None) -> _Kept:
    """What a response says; whatever it holds, it is no error of ours."""
    if body is None:
        return _Kept(problem=f"more than {MOST_BYTES} bytes, or too slow")
    try:
        whole = parse(body, "a chat completion")
    except RecordError:
        return _Kept(problem="the response is not JSON")
    used = whole.get("usage") if isinstance(whole, dict) else None
    tokens = [_count(used, "prompt_tokens"), _count(used, "completion_tokens")]
    try:
        choice: Any = whole["choices"][0]  # type: ignore[index]
        message, ended = choice["message"], choice.get("finish_reason")
        text, calls, refusal = message.get("content"), message.get("tool_calls"), message.get("refusal")
    except (KeyError, IndexError, TypeError, AttributeError):
        return _Kept("", "the response is no chat completion", False, *tokens)
    if refusal or ended == "content_filter":
        return _Kept(str(refusal or "")[:MOST_TEXT], "", True, *tokens)
    if calls:
        text = _called(calls)
    if not isinstance(text, str):
        return _Kept("", "no text, or calls of unknown tools", False, *tokens)
    if len(text) > MOST_TEXT:
        return _Kept("", f"more than {MOST_TEXT} characters", False, *tokens)
    return _Kept(text, "", False, *tokens)


def _seconds(text: str | None) -> float:
    """What a server asks to be waited for; 0 where it does not say so in seconds."""
    return float(text) if text and text.isdigit() and len(text) < 6 else 0.0


def _called(calls: Any) -> str | None:
    """The arguments of the one call of the one tool; None for any other calls."""
    try:
        (call,) = calls
        arguments = call["function"]["arguments"]
        return arguments if call["function"]["name"] == TOOL and isinstance(arguments, str) else None
    except (ValueError, KeyError, TypeError):
        return None


def _count(used: object, name: str) -> int:
    value = used.get(name) if isinstance(used, dict) else None
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 10**9 else 0


def _object_in(text: str) -> str:
    """The part of a text from its first brace to its last: models like to wrap JSON in words or fences."""
    begin, end = text.find("{"), text.rfind("}")
    return text[begin : end + 1] if 0 <= begin < end else text


def _body(chunks: Iterable[bytes], deadline: float) -> bytes | None:
    """The bytes of a response; None for more than MOST_BYTES, or when the time is up."""
    parts, size = [], 0
    for chunk in chunks:
        size += len(chunk)
        if size > MOST_BYTES or time.monotonic() > deadline:
            return None
        parts.append(chunk)
    return b"".join(parts)


def _within(seconds: float, call: Callable[[], bytes | None]) -> bytes | None:
    """What a call returns; None when the time is up: headers that drip are read on, by a thread left behind."""
    done: queue.SimpleQueue[tuple[bytes | None, BaseException | None]] = queue.SimpleQueue()

    def run() -> None:
        try:
            done.put((call(), None))
        except BaseException as e:  # raised where the call was made
            done.put((None, e))

    threading.Thread(target=run, daemon=True).start()
    try:
        value, error = done.get(timeout=seconds)
    except queue.Empty:
        return None
    if error is not None:
        raise error
    return value


def _cut_short(response: Any, seconds: float) -> None:
    """Bound the body of an error or a redirection, which the client's library reads without a limit."""
    if not response.is_success:
        whole = response.stream
        response.stream = _httpx().ByteStream(_body(whole, time.monotonic() + seconds) or b"")
        whole.close()


def _without_pictures(value: Any) -> Any:
    """A request with digests in place of pictures."""
    if isinstance(value, dict):
        return {k: _without_pictures(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_without_pictures(v) for v in value]
    return f"picture {digest(value)[:32]}" if isinstance(value, str) and value.startswith("data:image/") else value


def _openai() -> Any:
    try:
        import openai  # an optional extra
    except ImportError as e:
        raise UnableError("language models need the openai package: pip install 'embodied-houses[llm]'") from e
    return openai


def _httpx() -> Any:
    import httpx2  # comes with openai

    return httpx2
