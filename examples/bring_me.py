"""Bring me the blue mug: a robot looks for a thing, may ask, opens what is closed, and brings it to the person.

    python examples/bring_me.py                                      # who plays how well, in three flats
    python examples/bring_me.py --houses 50 --out bring.json
    python examples/bring_me.py --model qwen3 --base-url http://localhost:8000/v1 --answers answers.sqlite
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from embodied.gym.bring import BringEnv
from embodied.gym.drive import chosen_worlds
from embodied.gym.robot import RobotSettings
from embodied.gym.skills import Skills, play_skills
from embodied.interface import Intention, Policy
from embodied.policies.bring import AnyWord, BringSearcher

PLAYERS: dict[str, Policy | None] = {
    "expert, knows the house": None,
    "never asks": BringSearcher(),
    "asks for the room": BringSearcher(Intention.REGION),
    "asks for room and looks": BringSearcher(Intention.REGION, Intention.APPEARANCE),
    "always asks": BringSearcher(Intention.REGION, Intention.APPEARANCE, Intention.ROUTE, Intention.CONFIRM),
    "blind, never asks": BringSearcher(sees=False),
    "blind, always asks": BringSearcher(Intention.REGION, Intention.APPEARANCE, Intention.CONFIRM, sees=False),
    "random": AnyWord(),
}


def play(seeds: range, episodes: int, players: dict[str, Policy | None]) -> Iterator[dict[str, Any]]:
    """Facts of the episodes of each player, in flats of their own."""
    for seed in seeds:
        worlds, _ = chosen_worlds(seed=seed, pictures="unlit")
        env = BringEnv(worlds, RobotSettings(task="bring", observations=()))
        for k in range(episodes):
            for name, agent in players.items():
                yield {"player": name, "house": seed, "episode": k, **play_skills(Skills(env), agent, 1000 * seed + k)}
        env.close()


def language_model(model: str, base_url: str, answers: Path) -> dict[str, Policy | None]:
    """A language model that plays; what it answered before is read again."""
    from embodied.agents.language_models.agent import LanguageModelAgent
    from embodied.agents.language_models.client import AnswerCache, Client, ServerSettings

    client = Client(ServerSettings(model=model, base_url=base_url), AnswerCache(answers))
    return {model: LanguageModelAgent(client)}


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=500)
    parser.add_argument("--houses", type=int, default=3)
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--players", nargs="*", default=list(PLAYERS), choices=list(PLAYERS))
    parser.add_argument("--model")
    parser.add_argument("--base-url", default="https://api.openai.com/v1")
    parser.add_argument("--answers", type=Path, default=Path("answers.sqlite"))
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    players = {name: PLAYERS[name] for name in options.players}
    if options.model:
        players = language_model(options.model, options.base_url, options.answers)
    rows = []
    for row in play(range(options.seed, options.seed + options.houses), options.episodes, players):
        rows.append(row)
        print(json.dumps(row), flush=True)
        if options.out:
            options.out.write_text(json.dumps(rows, indent=1))
    for name in players:
        own = [r for r in rows if r["player"] == name]
        means = {f: float(np.mean([r[f] for r in own])) for f in ("success", "spl", "price", "seconds")}
        print(f"{name:28} n {len(own)} " + " ".join(f"{f} {x:.2f}" for f, x in means.items()))
