"""Pages of tutorials/ and guides/ that mkdocs.yml does not list stand at the end of their section."""

from __future__ import annotations

from pathlib import Path
from typing import Any


def on_config(config: Any) -> Any:
    """Called by MkDocs once the configuration is read."""
    for section, folder in (("Tutorials", "tutorials"), ("Guides", "guides")):
        pages = next(part[section] for part in config.nav if section in part)
        there = (f"{folder}/{page.name}" for page in sorted((Path(config.docs_dir) / folder).glob("*.md")))
        pages += [page for page in there if page not in pages]
    return config
