"""A server of chat completions in this process that answers as a test wants, also badly."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

Response = tuple[int, dict[str, str], bytes]
Behaviour = Callable[[dict[str, Any]], Response]


def said(text: object, ended: str = "stop", **more: Any) -> Response:
    """A whole chat completion that ended so; `more` are fields of its message."""
    message = {"role": "assistant", "content": text, **more}
    body = {
        "id": "1",
        "object": "chat.completion",
        "created": 0,
        "model": "m",
        "choices": [{"index": 0, "message": message, "finish_reason": ended}],
        "usage": {"prompt_tokens": 100, "completion_tokens": 10, "total_tokens": 110},
    }
    return 200, {"Content-Type": "application/json"}, json.dumps(body).encode()


def first_allowed(request: dict[str, Any]) -> Response:
    """Names the first action that the schema allows, and fills texts."""
    schema = request["response_format"]["json_schema"]["schema"]
    value = {
        name: p["enum"][0] if "enum" in p else p.get("minimum", 3) if p["type"] == "integer" else "because"
        for name, p in schema["properties"].items()
    }
    return said(json.dumps(value))


class Parrot:
    """An assistant of somebody's own."""

    def intentions(self, situation: Any) -> tuple:
        return ()

    def answer(self, situation: Any, question: Any, *, rng: Any) -> Any:
        raise NotImplementedError


class ChatServer:
    """Runs while the `with` block does."""

    def __init__(self, behaviour: Behaviour = first_allowed) -> None:
        self.behaviour, self.requests, self.headers = behaviour, list[dict[str, Any]](), list[dict[str, str]]()
        server = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                request = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                server.requests.append(request)
                server.headers.append({k.lower(): v for k, v in self.headers.items()})
                status, headers, body = server.behaviour(request)
                try:
                    self.send_response(status)
                    for name, value in headers.items():
                        self.send_header(name, value)
                    self.send_header("Content-Length", str(len(body)))
                    self.end_headers()
                    self.wfile.write(body)
                except OSError:  # the client has had enough
                    pass

            def log_message(self, *_: object) -> None:
                pass

        self._http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._http.server_port}/v1"

    def __enter__(self) -> ChatServer:
        threading.Thread(target=self._http.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._http.shutdown()
        self._http.server_close()
