"""Answers of language models: one object of a JSON schema in what a chat-completions server sent.

A server's failure (an error, an empty body, no chat completion) is an error. An answer of the model that is none
(wrong JSON, an unknown tool, cut short) is an answer with a problem, which is kept and counted like any other.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from embodied.agents.language_models.transport import ServerError, failure, server_words
from embodied.assets.json_file import RecordError, parse

MOST_TEXT = 20_000
"""Characters of an answer that are kept; a longer one is invalid."""
MOST_BRACES = 200
"""Opening braces of an answer at which an object is looked for."""
TOOL = "answer"
"""Name of the one tool that is offered with the form 'tools'."""
JSON_TYPES = {"string": str, "integer": int}
"""Types of JSON Schema that answers are made of."""
THOUGHTS = re.compile(r"(?s)^.*</(think|thinking|thought|reasoning)>|^\s*<(think|thinking|thought|reasoning)>.*")
"""Reasoning before an answer: up to its end, which a template may have opened, or without an end."""


@dataclass(frozen=True)
class StoredAnswer:
    """An answer as the cache holds it."""

    text: str = ""
    """Written by the model."""
    problem: str = ""
    """Reason why it is no answer."""
    refused: bool = False
    tokens_in: int = 0
    tokens_out: int = 0
    cut: bool = False
    """The model was stopped at the longest answer that is allowed."""


@dataclass(frozen=True)
class Answer(StoredAnswer):
    """The answer to one request."""

    value: Mapping[str, Any] | None = None
    """The object that was wanted; None for an answer that is none."""


def object_schema(**properties: Mapping[str, Any]) -> dict[str, Any]:
    """A JSON schema of an object that has exactly these properties, in their order."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(properties),
        "additionalProperties": False,
    }


def read_completion(content: bytes) -> StoredAnswer:
    """The model's answer in the content of a response.

    Raises:
      ServerError: the content is no chat completion, or tells of an error; says the server's own words.
    """
    try:
        whole: Any = parse(content, "a chat completion")
        choice = whole["choices"][0]
        message = choice["message"]
        error = whole.get("error") or choice.get("error")
        ended, refusal = choice.get("finish_reason"), message.get("refusal")
    except (RecordError, KeyError, IndexError, TypeError, AttributeError):
        raise _no_completion(content) from None
    if error or ended == "error":
        raise _no_completion(content)
    refused, cut = bool(refusal) or ended == "content_filter", ended == "length"
    text, problem = (str(refusal or "")[:MOST_TEXT], "") if refused else _text_of(message)
    used = whole.get("usage")
    tokens_in, tokens_out = _count(used, "prompt_tokens"), _count(used, "completion_tokens")
    return StoredAnswer(text, problem, refused, tokens_in, tokens_out, cut)


def read_answer(stored: StoredAnswer, schema: Mapping[str, Any]) -> Answer:
    """The answer as the object of a schema, or why it is none."""
    value, problem = None, stored.problem
    if not problem and not stored.refused:
        value, problem = _object_in(stored.text, schema)
    if value is None and stored.cut:
        problem = "cut at the longest answer that is allowed; raise most_tokens (--most-tokens)"
    return Answer(stored.text, problem, stored.refused, stored.tokens_in, stored.tokens_out, stored.cut, value)


def misfit(value: object, schema: Mapping[str, Any]) -> str:
    """The first fault of a value by a schema of `object_schema`, whose properties are texts or whole numbers; '' for
    none."""
    known = schema["properties"]
    if not isinstance(value, dict):
        return "the answer should be an object"
    if missing := [n for n in known if n not in value]:
        return f"the answer lacks {missing}"
    if unknown := [str(n)[:40] for n in value if n not in known]:
        return f"the answer has unknown fields {unknown[:5]}"
    for name, wanted in known.items():
        field = value[name]
        if type(field) is not JSON_TYPES[wanted["type"]]:
            return f"{name} should be of type {wanted['type']}"
        if "enum" in wanted and field not in wanted["enum"]:
            return f"{name} should be one of {list(wanted['enum'])[:20]}"
        if isinstance(field, str) and len(field) > wanted.get("maxLength", MOST_TEXT):
            return f"{name} is too long"
        if isinstance(field, int) and not wanted["minimum"] <= field <= wanted["maximum"]:
            return f"{name} is out of range"
    return ""


def _no_completion(content: bytes) -> ServerError:
    """The error that a response with a good status is, when it is no chat completion."""
    if not content.strip():
        return ServerError("its answer is empty", passing=True)
    words = server_words(content)
    if content.lstrip().startswith(b"<"):
        return ServerError(f"its answer is a web page ({words}); correct base_url (--base-url)")
    if content.startswith((b"data:", b"event:", b":")):
        return ServerError(f"its answer is a stream of events, which was not asked for ({words})")
    try:
        code: Any = parse(content)["error"]["code"]  # type: ignore[index]
    except (RecordError, KeyError, TypeError):
        code = None
    if isinstance(code, int) and 400 <= code < 600:
        return failure(code, words)
    return ServerError(f"its answer is no chat completion: {words}", passing=True)


def _text_of(message: Mapping[str, Any]) -> tuple[str, str]:
    """The text of a message, or else the problem."""
    calls = message.get("tool_calls")
    text = _arguments(calls) if calls else _text(message.get("content"))
    if text is None:
        return "", "calls of unknown tools"
    if not text and not calls:  # some servers put the answer of a reasoning model there
        text = _text(message.get("reasoning_content")) or _text(message.get("reasoning"))
    if len(text) > MOST_TEXT:
        return "", f"more than {MOST_TEXT} characters"
    return text, "" if text else "an empty message"


def _text(content: object) -> str:
    """A message's text: a text, the text among parts, or an object that should have been one."""
    if isinstance(content, list):
        parts = [p for p in content if isinstance(p, dict) and p.get("type", "text") in ("text", "output_text")]
        return "".join(str(p.get("text") or "") for p in parts)
    return content if isinstance(content, str) else json.dumps(content) if isinstance(content, dict) else ""


def _arguments(calls: Any) -> str | None:
    """The arguments of calls of the one tool, one below the other; None for any other calls."""
    try:
        functions = [call["function"] for call in calls]
        if any(f["name"] != TOOL or not isinstance(f["arguments"], str | dict) for f in functions):
            return None
        return "\n".join(dict.fromkeys(_text(f["arguments"]) for f in functions))
    except (KeyError, TypeError):
        return None


def _count(used: object, name: str) -> int:
    value = used.get(name) if isinstance(used, dict) else None
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 10**9 else 0


def _object_in(text: str, schema: Mapping[str, Any]) -> tuple[dict[str, Any] | None, str]:
    """The one object of a schema in a text, which may think, explain and repeat itself; else None and the problem."""
    text, decoder, problem, fitting = THOUGHTS.sub("", text), json.JSONDecoder(), "", list[dict[str, Any]]()
    at = text.find("{")
    for _ in range(MOST_BRACES):
        if at < 0:
            break
        try:
            _, end = decoder.raw_decode(text, at)
            value = parse(text[at:end], "an answer")
            fault = misfit(value, schema)
            problem = fault or problem
            if isinstance(value, dict) and not fault and value not in fitting:
                fitting.append(value)
        except (ValueError, RecursionError) as e:  # RecordError, too
            end, problem = at + 1, problem or f"no JSON in {text[at : at + 60]!r} ({e})"
        at = text.find("{", end)
    if len(fitting) > 1:
        return None, f"{len(fitting)} different answers, such as {json.dumps(fitting[:2])[:200]}"
    return (fitting[0], "") if fitting else (None, problem or f"expected an object of JSON, got {text[:60]!r}")
