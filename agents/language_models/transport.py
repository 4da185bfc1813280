"""One request to a chat-completions server: its address, key, proxy and certificates, and bounds on what is read.

Every failure is a ServerError that names its cause and says what to do; no more than MOST_BYTES are read of a response.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import html
import http.client
import ipaddress
import json
import os
import re
import ssl
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urljoin, urlsplit, urlunsplit

from embodied.assets.json_file import RecordError, parse

MOST_BYTES = 1_000_000
"""Of a response; more is not read."""
PASSING = (408, 409, 425, 429)
"""Status codes beside those from 500 on after which the same request is sent again."""
ENDING = "/chat/completions"
PORTS = {"http": 80, "https": 443}

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

    def post(self, body: Mapping[str, Any], hops: int = 3) -> bytes:
        """The content of the response to `body`, which is sent as JSON.

        Args:
          hops: at most so many times the request is sent on to another address of the same host.

        Raises:
          ServerError: no answer, or a status that is none.
        """
        key, proxy = self._key(), proxy_of(self.url)
        try:
            status, headers, content = _within(2 * self.timeout, lambda: self._exchange(body, key, proxy))
        except ServerError:
            raise
        except (OSError, http.client.HTTPException, ValueError) as e:
            raise self._unreachable(e, proxy) from None
        if 200 <= status < 300:
            return content
        with contextlib.suppress(ValueError):  # an address that is none
            target = urljoin(self.url, headers.get("location") or "")
            if status in (307, 308) and hops and urlsplit(target)[:2] == urlsplit(self.url)[:2]:
                return dataclasses.replace(self, url=target).post(body, hops - 1)
        wait = headers.get("retry-after") or ""
        raise failure(
            status,
            words := server_words(content),
            f"{self._advice(status, headers, words)}{_through(proxy, self._host)}",
            float(wait) if wait.isdigit() and len(wait) < 6 else 0.0,
        )

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

    def _exchange(self, body: Mapping[str, Any], key: str, proxy: Proxy | None) -> Response:
        deadline = time.monotonic() + self.timeout
        headers = {"Content-Type": "application/json", "Accept": "application/json", "User-Agent": "embodied"}
        if key:
            headers["Authorization"] = f"Bearer {key}"
        request = urllib.request.Request(self.url, json.dumps(body).encode(), headers)
        opener = urllib.request.OpenerDirector()
        opener.add_handler(urllib.request.ProxyHandler({} if proxy is None else dict.fromkeys(PORTS, proxy.address)))
        opener.add_handler(
            urllib.request.HTTPSHandler(context=_certificates())
            if self.url.startswith("https:")
            else urllib.request.HTTPHandler()
        )
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

    def _unreachable(self, error: Exception, proxy: Proxy | None) -> ServerError:
        """The cause of an error of the network, in words."""
        cause = error.reason if isinstance(error, urllib.error.URLError) else error
        if isinstance(error, TimeoutError):
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


@dataclass(frozen=True)
class Proxy:
    """A proxy that the environment names."""

    variable: str
    address: str


def completions_url(base_url: str) -> str:
    """The address of a server's chat completions, below the address that a person wrote.

    Raises:
      ValueError: no address; says how one is written.
    """
    text = base_url.strip()
    with contextlib.suppress(ValueError):  # of the host or the port
        parts = urlsplit(text)
        host, _ = (parts.hostname or "").encode("idna"), parts.port
        if host and parts.scheme in PORTS and "@" not in parts.netloc and re.fullmatch("[!-~]+", text):
            path = parts.path.rstrip("/").removesuffix(ENDING) + ENDING
            return urlunsplit((parts.scheme, parts.netloc, path, parts.query, ""))
    example = f"http://{text}" if re.match(r"[\w.-]+(:\d+)?(/|$)", text) else "http://127.0.0.1:8000/v1"
    raise ValueError(f"base_url should be an address such as {example}, got {base_url!r}")


def proxy_of(url: str) -> Proxy | None:
    """The proxy that the environment names for an address; None for the direct way, as to this machine.

    Raises:
      ServerError: a proxy that cannot be used; names the variable.
    """
    parts = urlsplit(url)
    host, port = parts.hostname or "", parts.port or PORTS[parts.scheme]
    if _is_local(host) or any(_exempts(entry, host, port) for entry in _setting("no_proxy")[1].split(",")):
        return None
    variable, value = _setting(f"{parts.scheme}_proxy", "all_proxy")
    if not value and not urllib.request.proxy_bypass(host):  # macOS, Windows
        variable, value = "the system's network settings", urllib.request.getproxies().get(parts.scheme, "")
    if not value:
        return None
    address = value if "://" in value else f"http://{value}"
    proxy = Proxy(variable, address)
    with contextlib.suppress(ValueError):
        wanted = urlsplit(address)
        if wanted.scheme == "http" and wanted.hostname and wanted.port != 0:
            return proxy
    raise ServerError(
        f"{variable} names the proxy {_without_password(proxy)!r}, which cannot be used: a proxy is written "
        f"http://HOST:PORT; unset {variable}, or add {host} to NO_PROXY"
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


@functools.cache
def _certificates() -> ssl.SSLContext:
    try:
        return ssl.create_default_context()
    except OSError as e:  # the file of SSLKEYLOGFILE
        raise ServerError(f"no certificates can be read ({e}); {_trusted()}") from None


def _trusted() -> str:
    """How the certificates that are trusted are chosen, and which variables choose them now."""
    chosen = {n: os.environ[n] for n in ("SSL_CERT_FILE", "SSL_CERT_DIR", "SSLKEYLOGFILE") if os.environ.get(n)}
    for name, path in chosen.items():
        if not os.path.exists(path):
            return f"{name} names {path!r}, which does not exist: unset it, or correct it"
    set_now = f" (now: {', '.join(f'{n}={p}' for n, p in chosen.items())})" if chosen else ""
    return f"name a file with the certificates that you trust in SSL_CERT_FILE{set_now}"


def _setting(*names: str) -> tuple[str, str]:
    """Name and value of the first of these environment variables that is set, in small letters or capitals."""
    for name in names:
        for variable in (name, name.upper()):
            if value := os.environ.get(variable, "").strip():
                return variable, value
    return "", ""


def _is_local(host: str) -> bool:
    address = _ip(host)
    return host == "localhost" if address is None else address.is_loopback or address.is_unspecified


def _ip(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        return ipaddress.ip_address(host)
    except ValueError:
        return None


def _exempts(entry: str, host: str, port: int) -> bool:
    """True where an entry of NO_PROXY, as '*', '.example.org', 'example.org:8080' or '10.0.0.0/8', is a host's."""
    name = entry.strip().lower().rpartition("://")[2]
    if name.count(":") == 1 or "]:" in name:
        name, _, own_port = name.rpartition(":")
        if own_port != str(port):
            return False
    if (address := _ip(host)) is not None:
        with contextlib.suppress(ValueError):
            return address in ipaddress.ip_network(name.replace("[", "").replace("]", ""), strict=False)
    name = name.removeprefix("*") if name != "*" else name
    return name == "*" or bool(name) and (host == name.lstrip(".") or host.endswith(f".{name.lstrip('.')}"))


def _without_password(proxy: Proxy) -> str:
    return re.sub(r"//[^/@]*@", "//***@", proxy.address)


def _through(proxy: Proxy | None, host: str) -> str:
    if proxy is None:
        return ""
    return (
        f" (asked through the proxy {_without_password(proxy)} of {proxy.variable}; if that is wrong, unset it or add "
        f"{host} to NO_PROXY)"
    )


def _within(seconds: float, call: Callable[[], Response]) -> Response:
    """The value of a call, or TimeoutError; headers that drip are read on by a thread that is left behind."""
    values, errors = list[Response](), list[BaseException]()

    def run() -> None:
        try:
            values.append(call())
        except BaseException as e:  # raised where the call was made
            errors.append(e)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(seconds)
    for error in errors:
        raise error
    for value in values:
        return value
    raise TimeoutError
