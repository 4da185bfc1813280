"""Writes into docs/moving.md which classes of furniture open, from the models that are installed.

python docs/build_openings.py
"""

from __future__ import annotations

import collections
import re
from pathlib import Path

from embodied.assets.catalogue import load_catalogue
from embodied.assets.moving_parts import OPENING_CLASSES, taken_apart

PAGE = Path(__file__).parent / "moving.md"


def main() -> None:
    catalogue = load_catalogue()
    counts: dict[str, collections.Counter] = collections.defaultdict(collections.Counter)
    for key, a in catalogue.assets.items():
        if a.object_class in OPENING_CLASSES:
            thing = taken_apart(a.object_class, catalogue.mesh(key))
            found = counts[a.object_class]
            found["models"] += 1
            found["opens"] += thing is not None
            for m in thing.moving if thing is not None else ():
                found["doors" if m.kind in ("door", "flap") else f"{m.kind}s"] += 1
    columns = ("models", "opens", "doors", "drawers", "lids")
    rows = ["| class | models | that open | doors | drawers | lids |", "|---|---|---|---|---|---|"]
    rows += [f"| {name} | {' | '.join(str(counts[name][c]) for c in columns)} |" for name in sorted(counts)]
    text = "\n".join(rows)
    page = re.sub(r"(<!-- openings -->\n).*?(<!-- end -->)", rf"\1\n{text}\n\n\2", PAGE.read_text(), flags=re.DOTALL)
    PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
