"""Agents of people's own, from a folder or by name, and the lists of seeds that they are judged on."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from embodied.interface import Agent
from embodied.kinds.plugins import made_by_name


def read_seeds(path: Path) -> list[int]:
    """The seeds of a list: one whole number a line, '#' begins a remark.

    Raises:
      ValueError: names the line.
    """
    seeds = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        word = line.partition("#")[0].strip()
        if word:
            try:
                seeds.append(int(word))
            except ValueError:
                raise ValueError(f"{path}:{number} should be a whole number, got {word[:40]!r}") from None
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"{path} should hold at least one seed and none twice")
    return seeds


def submitted(where: str) -> Agent:
    """An agent of somebody's own: a folder whose agent.py has `make_agent()`, or 'module:Policy'.

    Its code is run as it is: run agents that you do not trust in a container.

    Raises:
      ValueError: none of them, or an agent of a folder that wants to be shown the situations.
    """
    if ":" in where:
        return made_by_name(where)
    file = Path(where) / "agent.py"
    if not file.exists():
        raise ValueError(f"{where} should be a folder with an agent.py with make_agent()")
    spec = importlib.util.spec_from_file_location("submission", file)
    assert spec is not None and spec.loader is not None, "a .py file"
    module = importlib.util.module_from_spec(spec)
    sys.path.insert(0, str(file.parent.resolve()))
    try:
        spec.loader.exec_module(module)
    finally:
        sys.path.pop(0)
    if not callable(getattr(module, "make_agent", None)):
        raise ValueError(f"{file} should define make_agent(), which gives an embodied.interface.Policy")
    agent = module.make_agent()
    if hasattr(agent, "act_privileged") or not hasattr(agent, "act"):
        raise ValueError(f"{file}: an agent has `act` and is not shown the situations")
    return agent
