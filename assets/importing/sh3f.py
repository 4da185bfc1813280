"""Sweet Home 3D furniture libraries (.sh3f): zip files of OBJ models with a catalogue of real sizes.

Nothing is ever extracted: entries are read into memory under limits, and a library whose names
climb out of their folder, or whose entries swell like a zip bomb, is refused as a whole.
"""

from __future__ import annotations

import functools
import math
import os
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from types import MappingProxyType

from embodied.assets.cache import digest
from embodied.assets.records import IDENTITY

CATALOGUE = "PluginFurnitureCatalog.properties"
MAX_ENTRY = 64 * 2**20
"""Bytes that one unpacked entry may have; the largest of Debian's five libraries is 9 MiB."""
MAX_RATIO = 200
"""Unpacked over packed size above which a large entry is taken for a bomb; text packs 8 to 1."""
MAX_ENTRIES = 20_000


class PackError(ValueError):
    """A pack that is missing, broken or malicious: says what and what to do."""


@dataclass(frozen=True)
class Entry:
    """One model as its library describes it: what the import needs, words and licences are those of our catalogue."""

    key: str
    """'<folder>/<model>', e.g. 'scopia/bed1'."""
    model: str
    """Path of the OBJ file inside the zip."""
    size: tuple[float, float, float]
    """Width, depth, height, metres."""
    rotation: tuple[float, ...]
    """Row-major 3x3 rotation applied to the OBJ's own (y up) axes before it is sized."""


@dataclass(frozen=True)
class Pack:
    """An opened library; its bytes are read on demand."""

    path: Path
    digest: str
    """Hex digest of the table of contents (names, sizes, CRC-32 sums)."""
    entries: Mapping[str, Entry]

    def read(self, name: str) -> bytes:
        """The bytes of the zip entry `name`, never more than MAX_ENTRY.

        Raises:
          PackError: no such entry, damaged, encrypted, or larger than it claims.
        """
        entry = _safe_name(self.path, name)
        try:
            with _opened(self.path, self.path.stat().st_mtime_ns, os.getpid()).open(entry) as f:
                data = f.read(MAX_ENTRY + 1)
        except KeyError as e:
            raise PackError(f"{self.path.name} has no entry {name!r}; install the pack again") from e
        except (zipfile.BadZipFile, zlib.error, RuntimeError, OSError, EOFError, ValueError) as e:
            raise PackError(f"{self.path.name}: entry {name!r} cannot be read ({e}); install the pack again") from e
        if len(data) > MAX_ENTRY:
            raise PackError(f"{self.path.name}: entry {name!r} unpacks to over {MAX_ENTRY} bytes; do not use this pack")
        return data

    def names(self) -> tuple[str, ...]:
        with zipfile.ZipFile(self.path) as z:
            return tuple(z.namelist())


@functools.lru_cache(maxsize=8)
def _opened(path: Path, changed: int, process: int) -> zipfile.ZipFile:
    """The archive, opened once in each process: its table of contents takes longer to read than most entries."""
    return zipfile.ZipFile(path)


def open_pack(path: Path) -> Pack:
    """Read the table of contents and the catalogue of the library at `path`.

    Raises:
      PackError: missing, not a zip, unsafe names, a bomb, or a catalogue that makes no sense.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as z:
            infos = z.infolist()
    except FileNotFoundError as e:
        raise PackError(f"furniture library {path} does not exist; apt-get install sweethome3d-furniture") from e
    except (zipfile.BadZipFile, RuntimeError, OSError, EOFError, ValueError) as e:
        raise PackError(f"{path} is not a .sh3f library ({e}); install it again or name another file") from e
    _check_contents(path, infos)
    toc = digest([[i.filename, i.file_size, i.CRC] for i in infos])
    bare = Pack(path, toc, MappingProxyType({}))
    if CATALOGUE not in {i.filename for i in infos}:
        raise PackError(f"{path.name} has no {CATALOGUE}; it is not a furniture library of Sweet Home 3D")
    fields = parse_properties(bare.read(CATALOGUE).decode("latin-1"))
    return Pack(path, toc, MappingProxyType(_entries(path, fields)))


def parse_properties(text: str) -> dict[str, str]:
    """Java properties as a dict; later keys win."""
    text = re.sub(r"(?<!\\)\\\r?\n[ \t]*", "", text)
    found = {}
    for line in text.splitlines():
        line = line.strip()
        if not line or line[0] in "#!" or "=" not in line:
            continue
        key, value = line.split("=", 1)
        value = re.sub(r"\\u([0-9a-fA-F]{4})", lambda m: chr(int(m[1], 16)), value)
        found[key.strip()] = re.sub(r"\\(.)", r"\1", value.strip())
    return found


def key_of(model: str) -> str:
    """'scopia/bed1/bed1.obj' gives 'scopia/bed1'; an OBJ outside any folder gives its stem."""
    p = PurePosixPath(model)
    return str(p.parent) if len(p.parts) > 1 else p.stem


def _check_contents(path: Path, infos: list[zipfile.ZipInfo]) -> None:
    if len(infos) > MAX_ENTRIES:
        raise PackError(f"{path.name} has {len(infos)} entries, at most {MAX_ENTRIES} are read; do not use this pack")
    for i in infos:
        _safe_name(path, i.filename)
        if i.file_size > MAX_ENTRY or (i.file_size > 2**20 and i.file_size > MAX_RATIO * max(1, i.compress_size)):
            raise PackError(
                f"{path.name}: entry {i.filename!r} unpacks from {i.compress_size} to {i.file_size} bytes, "
                "which looks like a zip bomb; do not use this pack"
            )


def _safe_name(path: Path, name: str) -> str:
    parts = PurePosixPath(name).parts
    if name.startswith("/") or "\\" in name or ".." in parts or "\0" in name or (parts and ":" in parts[0]):
        raise PackError(f"{path.name}: entry {name!r} points outside the library; do not use this pack")
    return name


def _entries(path: Path, fields: Mapping[str, str]) -> dict[str, Entry]:
    rows: dict[int, dict[str, str]] = {}
    for key, value in fields.items():
        if m := re.fullmatch(r"(\w+)#(\d+)", key):
            rows.setdefault(int(m[2]), {})[m[1]] = value
    entries = {}
    for number in sorted(rows):
        try:
            entry = _entry(path, number, rows[number])
        except PackError:
            raise
        except ValueError as e:
            raise PackError(f"{path.name}: model {number} has no numbers where they belong ({e}); it is damaged") from e
        entries[entry.key] = entry
    return entries


def _entry(path: Path, number: int, row: Mapping[str, str]) -> Entry:
    where = f"{path.name}: model {number}"
    if not row.get("model"):
        raise PackError(f"{where} names no model file; the library is damaged")
    model = _safe_name(path, row["model"].lstrip("/"))
    width, depth, height = (_number(where, row, f) / 100.0 for f in ("width", "depth", "height"))
    if min(width, depth, height) <= 0:
        raise PackError(f"{where} should have a positive size, got {width} x {depth} x {height} m")
    rotation: tuple[float, ...] = IDENTITY
    if row.get("modelRotation"):
        rotation = tuple(float(x) for x in row["modelRotation"].split())
        if len(rotation) != 9 or not all(math.isfinite(x) for x in rotation):
            raise PackError(f"{where} should have a modelRotation of nine numbers, got {row['modelRotation']!r}")
    return Entry(key_of(model), model, (width, depth, height), rotation)


def _number(where: str, row: Mapping[str, str], name: str) -> float:
    text = row.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PackError(f"{where} should have a number for {name}, got {text!r}; the library is damaged")
    return value
