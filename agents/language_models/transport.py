"""One request to a chat-completions server: its address, key, proxy and certificates, and bounds on what is read.

Every failure is a ServerError that names its cause and says what to do; no more than MOST_BYTES are read of a response.
"""

import contextlib
import html
import http.client
import json
import os
import re
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit, urlunsplit

from embodied.assets.json_file import RecordError, parse

MOST_BYTES = 1_000_000
"""Of a response; more is not read."""
PASSING = (408, 409, 425, 429)
"""Status codes beside those from 500 on after which the same request is sent again."""
ENDING = "/chat/completions"
SCHEMES = ("http", "https")
THIS_MACHINE = ("localhost", "0.0.0.0", "::1")

Response = tuple[int, Mapping[str, str], bytes]
"""Status, headers and content."""


class ServerError(Exception):
    """A server gave no answer; the message says why and what to do."""

    def __init__(self, problem: str, *, passing: bool = False, wait: float = 0.0, words: str = "") -> None:
        """
        Args:
          passing: the same request may succeed later.
          wait: seconds that the server asks to be waited for.
          words: the server's own.
        """
        super().__init__(problem)
        self.passing, self.wait, self.words = passing, wait, words


@dataclass(frozen=True)
class Endpoint:
    """The chat completions of a server."""

    url: str
    """Address, as `completions_url` gives it."""
    key_variable: str
    """Environment variable with the key."""
    timeout: float
    """Seconds to wait for a whole answer."""

    def post(self, body: Mapping[str, Any]) -> bytes:
        """The content of the response to `body`, which is sent as JSON.

        Raises:
          ServerError: no answer, or a status that is none.
        """
        key, proxy = self._key(), proxy_of(self.url)
        try:
            status, headers, content = self._exchange(body, key, proxy)
        except (OSError, http.client.HTTPException, ValueError) as e:
            raise self._unreachable(e, proxy) from None
        if 200 <= status < 300:
            return content
        words, wait = server_words(content), headers.get("retry-after") or ""
        advice = f"{self._advice(status, headers, words)}{_through(proxy, self._host)}"
        raise failure(status, words, advice, float(wait) if wait.isdigit() and len(wait) < 6 else 0.0)

    def hidden(self, text: object) -> str:
        """A text without the key, however the server repeats it."""
        key = os.environ.get(self.key_variable, "").strip()
        return str(text).replace(key, "***") if len(key) > 4 else str(text)

    @property
    def _host(self) -> str:
        return urlsplit(self.url).hostname or ""

    def _key(self) -> str:
        key = os.environ.get(self.key_variable, "").strip()
        if not (key.isascii() and key.isprintable()) or " " in key:
            raise ServerError(f"{self.key_variable} holds characters that no key has; copy the key into it again")
        return key

    def _exchange(self, body: Mapping[str, Any], key: str, proxy: str | None) -> Response:
        deadline = time.monotonic() + self.timeout
        headers = {"Content-Type": "application/json", "Accept": "application/json", "User-Agent": "embodied"}
        if key:
            headers["Authorization"] = f"Bearer {key}"
        request = urllib.request.Request(self.url, json.dumps(body).encode(), headers)
        opener = urllib.request.OpenerDirector()
        opener.add_handler(urllib.request.ProxyHandler({} if proxy is None else dict.fromkeys(SCHEMES, proxy)))
        opener.add_handler(urllib.request.HTTPSHandler())
        opener.add_handler(urllib.request.HTTPHandler())
        with opener.open(request, timeout=self.timeout) as response:
            parts, size = [], 0
            while part := response.read1(1 << 16):
                parts.append(part)
                size += len(part)
                if size > MOST_BYTES:
                    raise ServerError(f"its answer (status {response.status}) has more than {MOST_BYTES} bytes")
                if time.monotonic() > deadline:
                    raise TimeoutError
            return response.status, response.headers, b"".join(parts)

    def _unreachable(self, error: Exception, proxy: str | None) -> ServerError:
        """The cause of an error of the network, in words."""
        cause = error.reason if isinstance(error, urllib.error.URLError) else error
        if isinstance(cause, TimeoutError):
            problem = f"no whole answer within {self.timeout:g} s; for a slow model raise timeout (--timeout)"
        elif isinstance(cause, ssl.SSLCertVerificationError):
            return ServerError(
                f"the certificate of {self._host} cannot be verified ({cause.verify_message}); {_trusted()}"
            )
        elif isinstance(cause, ssl.SSLError) and "WRONG_VERSION_NUMBER" in str(cause):
            return ServerError(f"{self._host} does not speak TLS; write http:// instead of https://")
        elif isinstance(cause, ConnectionRefusedError):
            problem = "nobody listens there; start the server, or correct base_url (--base-url)"
        else:
            problem = f"{cause or type(cause).__name__}; check base_url (--base-url; http or https?) and the network"
        return ServerError(problem + _through(proxy, self._host), passing=True)

    def _advice(self, status: int, headers: Mapping[str, str], words: str) -> str:
        """How a status may be mended."""
        if status in (401, 403):
            known = "" if os.environ.get(self.key_variable) else ", which is not set"
            return f"; check the key in the environment variable {self.key_variable}{known}"
        if status in (404, 405):
            return "; check model (--model) and base_url (--base-url), which often ends in /v1"
        if 300 <= status < 400:
            return f"; it sends on to {str(headers.get('location'))[:200]!r}: give base_url (--base-url) accordingly"
        if any(word in words for word in ("response_format", "json_schema", "tool", "grammar")):
            return "; another form (--form) may suit this server"
        return ""


def completions_url(base_url: str) -> str:
    """The address of a server's chat completions, below the address that a person wrote.

    Raises:
      ValueError: no address; says how one is written.
    """
    text = base_url.strip()
    with contextlib.suppress(ValueError):  # of the host or the port
        parts = urlsplit(text)
        host, _ = (parts.hostname or "").encode("idna"), parts.port
        if host and parts.scheme in SCHEMES and "@" not in parts.netloc and re.fullmatch("[!-~]+", text):
            path = parts.path.rstrip("/").removesuffix(ENDING) + ENDING
            return urlunsplit((parts.scheme, parts.netloc, path, parts.query, ""))
    example = f"http://{text}" if re.match(r"[\w.-]+(:\d+)?(/|$)", text) else "http://127.0.0.1:8000/v1"
    raise ValueError(f"base_url should be an address such as {example}, got {base_url!r}")


def proxy_of(url: str) -> str | None:
    """The address of the proxy that the environment or the system names for an address; None for the direct way, as to
    this machine and to hosts of NO_PROXY.

    Raises:
      ServerError: a proxy that cannot be used.
    """
    parts, named = urlsplit(url), urllib.request.getproxies()
    host, proxy = parts.hostname or "", named.get(parts.scheme) or named.get("all")
    if not proxy or host in THIS_MACHINE or host.startswith("127.") or urllib.request.proxy_bypass(parts.netloc):
        return None
    proxy = proxy if "://" in proxy else f"http://{proxy}"
    with contextlib.suppress(ValueError):  # of the port
        wanted = urlsplit(proxy)
        if wanted.scheme == "http" and wanted.hostname and wanted.port != 0:
            return proxy
    raise ServerError(
        f"the proxy {_shown(proxy)} cannot be used: a proxy is written http://HOST:PORT; unset it, or add {host} to "
        "NO_PROXY"
    )


def failure(status: int, words: str, advice: str = "", wait: float = 0.0) -> ServerError:
    """The error that a status, or an error inside of a response, is."""
    return ServerError(
        f"status {status}{': ' if words else ''}{words}{advice}",
        passing=status >= 500 or status in PASSING,
        wait=wait,
        words=words,
    )


def server_words(content: bytes) -> str:
    """The words for people in a response that is no answer: its error message, or its text without tags, cut."""
    try:
        value: Any = parse(content, "an error")
    except RecordError:
        text = content.decode("utf-8", "replace")
        value = html.unescape(re.sub(r"(?is)<(script|style).*?</\1>|<[^>]*>", " ", text)) if "<" in text else text
    for name in ("error", "message", "detail"):
        if isinstance(value, dict) and value.get(name):
            value = value[name]
    text = value if isinstance(value, str) else json.dumps(value)
    return " ".join(text.split())[:300]


def _trusted() -> str:
    """How the certificates that are trusted are chosen, and which variables choose them now."""
    names = ("SSL_CERT_FILE", "SSL_CERT_DIR")
    chosen = ", ".join(f"{name}={os.environ[name]}" for name in names if os.environ.get(name))
    return f"name a file with the certificates that you trust in SSL_CERT_FILE{f' (now: {chosen})' if chosen else ''}"


def _through(proxy: str | None, host: str) -> str:
    if proxy is None:
        return ""
    return f" (asked through the proxy {_shown(proxy)}; if that is wrong, unset it or add {host} to NO_PROXY)"


def _shown(proxy: str) -> str:
    """A proxy without its password."""
    return f"{re.sub(r'//[^/@]*@', '//***@', proxy)} of HTTP_PROXY, HTTPS_PROXY or ALL_PROXY"
