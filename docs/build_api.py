"""Builds the API pages from the docstrings: `make docs` writes them to docs/api/, which git does not track.

    python docs/build_api.py [folder]

pdoc, because it reads the code as it is: Markdown docstrings, sentences below fields and constants, source beside the
text; it needs no second tree of stub pages, and little that the development tools do not have already. A warning
of pdoc (an annotation that does not resolve, a name of `__all__` that is not there) ends the build with status 1.
"""

from __future__ import annotations

import pkgutil
import sys
import warnings
from pathlib import Path

import pdoc

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("embodied", "assets", "agents", "viz")
SKIPPED = ("embodied.__main__",)
"""Modules that do something when they are imported."""


def modules() -> list[str]:
    """The names of all modules of the four packages, sorted."""
    found = list(PACKAGES)
    for package in PACKAGES:
        found += [m.name for m in pkgutil.walk_packages([str(ROOT / package)], f"{package}.")]
    return sorted(set(found) - set(SKIPPED))


def build(folder: Path) -> list[str]:
    """Write the pages; returns what pdoc warned about."""
    pdoc.render.configure(docformat="google", footer_text="embodied", search=True)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        warnings.filterwarnings("ignore", "The module specification .* already been added")  # packages bring theirs
        warnings.filterwarnings(
            "ignore", "Error parsing type annotation ForwardRef"
        )  # what NamedTuple makes of its fields
        pdoc.pdoc(*modules(), output_directory=folder)
    return [f"{w.filename}:{w.lineno}: {w.message}" for w in said if issubclass(w.category, UserWarning)]


def main() -> int:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "api"
    sys.path.insert(0, str(ROOT))
    wrong = build(folder)
    for text in wrong:
        print(f"error: {text}", file=sys.stderr)
    print(f"{len(list(folder.rglob('*.html')))} pages in {folder}, {len(wrong)} warnings")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
