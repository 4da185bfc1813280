"""Units of work on Ray: what is asked of it, with a stand-in; without Ray the error names the remedy.

By hand, with Ray 2.60 on a local cluster of two nodes (ray.cluster_utils.Cluster, one processor each): when one house
of four was whole and both nodes held a draft, the second node's raylet and worker were killed. Ray ran its task again
on the first node, the command ended with 0, and `diff -r` found no difference from a build with one process.
"""

from __future__ import annotations

import sys
from types import SimpleNamespace

import pytest

from embodied.datasets.cluster import RETRIES, run_on_ray
from embodied.errors import UnableError


class FakeRay(SimpleNamespace):
    """Runs remote calls when they are waited for, the last first."""

    def __init__(self) -> None:
        super().__init__(log=[])

    def is_initialized(self) -> bool:
        return False

    def init(self, **options) -> None:
        self.log.append(("init", options["address"]))

    def remote(self, **options):
        self.log.append(("remote", options["max_retries"]))
        return lambda job: SimpleNamespace(remote=lambda *arguments: (job, arguments))

    def wait(self, waiting, num_returns):
        return waiting[-num_returns:], waiting[:-num_returns]

    def get(self, call):
        return call[0](*call[1])

    def shutdown(self) -> None:
        self.log.append(("shutdown",))


def test_every_unit_is_run_once_and_may_be_run_again(monkeypatch):
    fake = FakeRay()
    monkeypatch.setitem(sys.modules, "ray", fake)
    assert sorted(run_on_ray(lambda unit, x: f"{unit}{x}", ["a", "b", "c"], ("!",), "local")) == ["a!", "b!", "c!"]
    assert fake.log == [("init", None), ("remote", RETRIES), ("shutdown",)]


def test_without_ray_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(UnableError, match=r"embodied-houses\[ray\]"):
        list(run_on_ray(str, ["a"], (), "local"))
