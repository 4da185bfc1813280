"""Addresses of the page, spelt as browsers spell them, so that two of one place are equal."""

from __future__ import annotations

import ipaddress
from urllib.parse import quote, urlsplit

DEFAULT_PORTS = {"http": 80, "https": 443}
"""Ports that browsers leave out, by scheme."""


def page_address(text: str) -> str:
    """An address as a browser spells it, without a slash at its end: 'https://study.example.org/kitchen'.

    Raises:
      ValueError: not the address of a page.
    """
    if "://" not in text:
        raise ValueError(f"should begin with https:// or http://, got {text!r}; write https://{text.lstrip('/')}")
    try:
        parts = urlsplit(text.strip())
        host, port = _host(parts.hostname or ""), parts.port
    except ValueError as e:
        raise ValueError(f"should be an address such as https://study.example.org, got {text!r} ({e})") from e
    if parts.scheme not in DEFAULT_PORTS or not host or "@" in parts.netloc or parts.query or parts.fragment:
        raise ValueError(f"should be an address such as https://study.example.org, got {text!r}")
    shown = "" if port in (None, DEFAULT_PORTS[parts.scheme]) else f":{port}"
    return f"{parts.scheme}://{host}{shown}{quote(parts.path, safe='/%:@!$&()*+,;=~')}".rstrip("/")


def origin_of(address: str) -> str:
    """Scheme, host and port of an address, as browsers send them in the header Origin.

    Raises:
      ValueError: not the address of a page.
    """
    parts = urlsplit(page_address(address))
    return f"{parts.scheme}://{parts.netloc}"


def _host(name: str) -> str:
    """A host's name or number as browsers send it: IPv6 in brackets, other letters than English ones in Punycode."""
    if ":" in name:
        return f"[{ipaddress.IPv6Address(name).compressed}]"
    return name.encode("idna").decode().lower()
