"""Serve a small language model here, or let one paraphrase the routes of a data set.

embodied llm serve --port 8765
embodied llm paraphrase --data DATA --out FILE --model smollm2 --base-url http://127.0.0.1:8765/v1
"""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from embodied.cli.learning import Threaded
from embodied.cli.model import WithModel, client_of
from embodied.options import Cached, Count, InputFolder, Option, file_to_write, whole


@dataclass(frozen=True, kw_only=True)
class ServeOptions(Threaded):
    """Serve SmolLM2-135M, which pip installs (embodied-houses[smollm]), to this machine alone."""

    port: Annotated[int, Option(whole(0, 65535), "N")] = 8765
    """Port to listen on."""


@dataclass(frozen=True, kw_only=True)
class ParaphraseOptions(WithModel, Cached):
    """Paraphrase every route of a split; keep the paraphrases that lead a scripted listener to the same place."""

    data: InputFolder
    """A data set with routes (HANNA or VLN)."""
    out: Annotated[Path, Option(file_to_write, "FILE")]
    """JSON Lines file of the routes that are kept."""
    split: str = "train"
    """The split whose routes are worded."""
    routes: Count | None = None
    """Word at most N routes."""


def serve(args: ServeOptions) -> int:
    from embodied.agents.language_models.small import command

    return subprocess.run(command(args.port, args.threads), check=False).returncode


def paraphrase(args: ParaphraseOptions) -> None:
    from embodied.agents.language_models.paraphrase import paraphrased
    from embodied.assets.catalogue import load_catalogue
    from embodied.datasets.store import Dataset
    from embodied.records import save_lines

    data, catalogue = Dataset(args.data), load_catalogue(args.cache)
    routes = [(name, r) for name in data.names(args.split) for r in data.routes(name)][: args.routes]
    worlds = {name: data.open_world(name, catalogue, args.cache) for name in {n for n, _ in routes}}
    found = paraphrased(routes, worlds, client_of(args), args.prompts)
    save_lines(args.out, found.routes)
    print(
        f"{len(found.routes)} of {found.asked} kept ({found.failing:.1%} dropped: {found.invalid} invalid, "
        f"{found.unchanged} unchanged, {found.lost} with which a listener gets lost); {found.usage}"
    )


COMMANDS: Mapping[str, Any] = {"serve": (ServeOptions, serve), "paraphrase": (ParaphraseOptions, paraphrase)}
