"""Units of work on Ray: what is asked of it, with a stand-in and, where Ray is installed, with two nodes of which one
is killed; without Ray the error names the remedy.

With houses that are generated it was run by hand with Ray 2.60 on a local cluster of two nodes
(ray.cluster_utils.Cluster, one processor each), `embodied dataset hanna --scale tiny --area 60 90 --seed 4
--ray ADDRESS`. When one house of four was whole and both nodes held a draft, the second node's raylet and worker were
killed with SIGKILL. Ray reported "Task build_unit failed because the node it was running on is dead ... will be
retried", the first node built the rest, the command ended with 0, no draft was left, and `diff -r`
found no difference from a build with one process (digest 4b6783e58d002317).
"""

from __future__ import annotations

import functools
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from hand_data import build, content, small_house

from embodied.datasets.build import DatasetConfig, build_dataset
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


def patient_house(houses: Path, killed: Path, *arguments):
    """A small house that, once another is whole, is not begun before a node was killed."""
    while list(houses.glob("*/unit.json")) and not killed.exists():
        time.sleep(0.05)
    return small_house(*arguments)


@pytest.mark.slow
def test_a_node_that_is_killed_in_the_middle_changes_nothing(tmp_path, monkeypatch):
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    here = Path(__file__).resolve().parent
    monkeypatch.setenv("PYTHONPATH", f"{here.parent}:{here}:{':'.join(p for p in sys.path if p)}")
    whole = build(tmp_path / "whole", tmp_path / "cache", "find", make_house=small_house)
    config = DatasetConfig("find", "tiny", seed=4, language="plain")
    houses, killed = tmp_path / "ray" / "houses", tmp_path / "killed"
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    doomed, drafts = cluster.add_node(num_cpus=1), []

    def kill() -> None:
        """As soon as a house is whole and both nodes are at work on another."""
        while not (list(houses.glob("*/unit.json")) and len(found := list(houses.glob(".*"))) == 2):
            time.sleep(0.05)
        drafts.extend(found)
        cluster.remove_node(doomed, allow_graceful=False)
        killed.touch()

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    try:
        make = functools.partial(patient_house, houses, killed)
        build_dataset(config, tmp_path / "ray", tmp_path / "cache", make_house=make, ray_address=cluster.address)
    finally:
        cluster.shutdown()
    assert len(drafts) == 2, "both nodes were at work when one was killed"
    left = {k: v for k, v in content(tmp_path / "ray").items() if not k.startswith(".")}
    assert left == {k: v for k, v in content(whole.folder).items() if not k.startswith(".")}
    assert not list(houses.glob(".*")), "what the killed node left unfinished is swept away"
