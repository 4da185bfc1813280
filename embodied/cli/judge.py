"""Judge a learned HANNA agent beside those without learning: Tables 4.3 to 4.5, and why its episodes fail."""

from __future__ import annotations

import argparse

from embodied.cli.common import bar


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    learning.add_eval(parser)


def run(args: argparse.Namespace) -> int:
    from agents import judging

    return judging.run_eval(args, watch=lambda agents: bar(agents, "agents", "agent"))
