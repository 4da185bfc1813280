"""Small models and furniture libraries written by hand, for tests."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

CUBE = "\n".join(
    [f"v {x} {y} {z}" for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    + ["f 1 3 4 2", "f 5 6 8 7", "f 1 2 6 5", "f 3 7 8 4", "f 1 5 7 3", "f 2 4 8 6"]
)


def write_pack(path: Path, entries: dict[str, str | bytes], model: str = "mine/box/box.obj") -> Path:
    rows = (
        f"license=CC0-1.0\nid#1=box\nname#1=Box\nmodel#1=/{model}\nwidth#1=40\ndepth#1=30\nheight#1=20\ncreator#1=Me\n"
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as z:
        z.writestr("PluginFurnitureCatalog.properties", rows)
        for name, data in entries.items():
            z.writestr(name, data)
    return path


def write_own(folder: Path, models: dict, classes: dict | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    body = {"pack": "mine", "creator": "Me", "licence": "CC0-1.0", "classes": classes or {}, "models": models}
    (folder / "catalogue.json").write_text(json.dumps(body))
    return folder
