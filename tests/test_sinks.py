"""What is served to a browser can be reached from this machine only, unless somebody asks for more by name."""

from __future__ import annotations

import socket
import subprocess
from pathlib import Path

import pytest

from embodied.errors import UnableError
from embodied.viz import sinks


@pytest.fixture
def ports(monkeypatch) -> tuple[int, int]:
    """Free ports in place of Rerun's own."""
    with socket.socket() as a, socket.socket() as b:
        for s in (a, b):
            s.bind(("127.0.0.1", 0))
        found = a.getsockname()[1], b.getsockname()[1]
    monkeypatch.setattr(sinks, "PORT", found[0])
    monkeypatch.setattr(sinks, "WEB_PORT", found[1])
    return found


def listening(port: int) -> set[str]:
    """Addresses at which somebody on this machine listens, as the kernel writes them."""
    files = [p for p in (Path("/proc/net/tcp"), Path("/proc/net/tcp6")) if p.exists()]
    rows = [line.split() for p in files for line in p.read_text().splitlines()[1:]]
    return {r[1].split(":")[0] for r in rows if r[3] == "0A" and int(r[1].split(":")[1], 16) == port}


class Enough(Exception):
    """Leaves the server, which would wait for Ctrl-C."""


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="asks the Linux kernel who listens")
def test_serving_listens_on_the_loopback_address_only(ports, capsys):
    with pytest.raises(Enough), sinks.open_viewers(serve=True) as viewers:
        assert viewers == (f"rerun+http://127.0.0.1:{ports[0]}/proxy",)
        assert [listening(p) for p in ports] == [{"0100007F"}, {"0100007F"}]
        raise Enough
    assert not any(map(listening, ports)), "it ends with the work"
    said = capsys.readouterr()
    assert f"http://127.0.0.1:{ports[1]}/" in said.out and not said.err


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="asks the Linux kernel who listens")
def test_serving_to_others_is_said_aloud(ports, capsys):
    with pytest.raises(Enough), sinks.open_viewers(serve=True, bind="0.0.0.0"):
        assert listening(ports[0]) == {"00000000"}
        raise Enough
    assert "warning: everybody who reaches 0.0.0.0 can look at what is served" in capsys.readouterr().err


def test_every_viewer_that_is_started_is_told_to_listen_on_the_loopback_address(ports, monkeypatch, tmp_path):
    (tmp_path / "a.rrd").write_bytes(b"RRF2" + bytes(12))
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "run", lambda c, **_: (commands.append(c), subprocess.CompletedProcess(c, 0))[1])
    monkeypatch.setattr(subprocess, "Popen", lambda c, **_: commands.append(c))
    monkeypatch.setattr(sinks, "_wait_for", lambda *_: None)
    monkeypatch.setenv("DISPLAY", ":7")
    sinks.open_file(tmp_path / "a.rrd", serve=True)
    sinks.open_file(tmp_path / "a.rrd")
    with sinks.open_viewers(spawn=True):
        pass
    assert [c[c.index("--bind") + 1] for c in commands] == ["127.0.0.1"] * 3


def test_an_address_of_another_machine_is_refused(ports):
    remedy = r"look whether 192\.0\.2\.1 is an address of this machine"
    with pytest.raises(UnableError, match=remedy), sinks.open_viewers(serve=True, bind="192.0.2.1"):
        raise AssertionError("nothing can be served there")
