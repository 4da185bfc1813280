"""Sweet Home 3D furniture libraries (.sh3f): zip files of OBJ models with a catalogue of real sizes.

Nothing is ever extracted: entries are read into memory under limits, and a library whose names
climb out of their folder, or whose entries swell like a zip bomb, is refused as a whole. A row of
the catalogue that makes no sense loses its own model only. `pack_of` finds the library that holds a model.
"""

import collections
import functools
import importlib.util
import logging
import math
import os
import re
import sys
import zipfile
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from types import MappingProxyType

from embodied.assets.cache import digest, write_bytes
from embodied.assets.importing.obj import decoded
from embodied.assets.records import IDENTITY

log = logging.getLogger(__name__)
CATALOGUE = "PluginFurnitureCatalog.properties"
MAX_ENTRY = 64 * 2**20
"""Bytes that one unpacked entry may have; the largest of Debian's five libraries is 9 MiB."""
MAX_RATIO = 200
"""Unpacked over packed size above which a large entry is taken for a bomb; text packs 8 to 1."""
MAX_ENTRIES = 20_000
ESCAPES = {"t": "\t", "n": "\n", "r": "\r", "f": "\f"}
"""Letters that mean a blank after a backslash in Java properties."""


class PackError(ValueError):
    """A pack that is missing, broken or malicious: says what and what to do."""


@dataclass(frozen=True)
class Entry:
    """One model as its library describes it: what the import needs, words and licences are those of our catalogue."""

    key: str
    """Its folder, e.g. 'scopia/bed1'; `_keys` says what it is where that holds several."""
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


@functools.lru_cache(maxsize=8)
def _opened(path: Path, changed: int, process: int) -> zipfile.ZipFile:
    """The archive, opened once in each process: its table of contents takes longer to read than most entries."""
    return zipfile.ZipFile(path)


def open_pack(path: Path) -> Pack:
    """The library at `path`, read again when the file has changed. Rows that give no model are logged.

    Raises:
      PackError: missing, not a zip, unsafe names, a bomb, or a catalogue without a model that can be read.
    """
    path = Path(path).absolute()
    try:
        stat = path.stat()
    except OSError as e:
        raise PackError(f"furniture library {path} does not exist; apt-get install sweethome3d-furniture") from e
    return _read_pack(path, stat.st_size, stat.st_mtime_ns)


@functools.lru_cache(maxsize=16)
def _read_pack(path: Path, size: int, changed: int) -> Pack:
    try:
        with zipfile.ZipFile(path) as z:
            infos = z.infolist()
    except (zipfile.BadZipFile, RuntimeError, OSError, EOFError, ValueError) as e:
        raise PackError(f"{path} is not a .sh3f library ({e}); install it again or name another file") from e
    _check_contents(path, infos)
    toc = digest([[i.filename, i.file_size, i.CRC] for i in infos])
    names = {i.filename for i in infos}
    if CATALOGUE not in names:
        raise PackError(f"{path.name} has no {CATALOGUE}; it is not a furniture library of Sweet Home 3D")
    bare = Pack(path, toc, MappingProxyType({}))
    entries, reasons = _entries(parse_properties(decoded(bare.read(CATALOGUE))), names)
    if reasons:
        which = "; ".join(reasons[:5]) + ("; ..." if len(reasons) > 5 else "")
        words = f"{path.name}: {len(reasons)} of {len(reasons) + len(entries)} models are left out: {which}"
        if not entries:
            raise PackError(f"{words}. Correct its {CATALOGUE}")
        log.warning(words)
    return Pack(path, toc, MappingProxyType(entries))


def parse_properties(text: str) -> dict[str, str]:
    """Java properties as a dict; later keys win, blanks around values are dropped.

    Source: java.util.Properties.load. '=', ':' or blanks end a key; an odd number of backslashes before a line's end
    joins it with the next one.
    """
    fields: dict[str, str] = {}
    joined = ""
    for line in [*re.split(r"\r\n|\r|\n", text), ""]:
        line = line.lstrip(" \t\f")
        if not joined and line[:1] in ("", "#", "!"):
            continue
        if len(line) - len(line.rstrip("\\")) & 1:
            joined += line[:-1]
            continue
        key, value = re.findall(r"(?s)^((?:\\.|[^\\=: \t\f])*)[ \t\f]*[=:]?(.*)$", joined + line)[0]
        fields[_unescaped(key)] = _unescaped(value).strip()
        joined = ""
    return fields


def _unescaped(text: str) -> str:
    plain = re.sub(
        r"\\(?:u([0-9a-fA-F]{4})|(.))", lambda m: chr(int(m[1], 16)) if m[1] else ESCAPES.get(m[2], m[2]), text
    )
    return plain.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


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


def _entries(fields: Mapping[str, str], names: Collection[str]) -> tuple[dict[str, Entry], list[str]]:
    """The models of a catalogue by key, and what is wrong with each of its rows that gives none."""
    rows: dict[int, dict[str, str]] = {}
    for field, value in fields.items():
        if m := re.fullmatch(r"(\w+)#([0-9]{1,9})", field):
            rows.setdefault(int(m[2]), {})[m[1]] = value
    entries, reasons = {}, []
    for number in sorted(rows):
        try:
            entries[number] = _entry(rows[number], names)
        except ValueError as e:
            reasons.append(f"model {number} {e}")
    keys = _keys({n: rows[n] for n in entries})
    return {keys[n]: replace(entry, key=keys[n]) for n, entry in entries.items()}, reasons


def _keys(rows: Mapping[int, Mapping[str, str]]) -> dict[int, str]:
    """The key of each row, by its number: the model's folder; the path of its file without the suffix where
    the folder holds several; behind that, the name in the row's id where rows share the file, or at last the number."""
    keys: dict[int, str] = {}
    names: dict[int, str] = {}
    waiting = sorted(rows)
    for step in range(4):
        names = {n: _names(n, row)[step] for n, row in rows.items()}
        counts, taken = collections.Counter(names.values()), set(keys.values())
        keys |= {n: names[n] for n in waiting if counts[names[n]] == 1 and names[n] not in taken}
        waiting = [n for n in waiting if n not in keys]
    return keys | {n: f"{names[n]}/{n}" for n in waiting}


def _names(number: int, row: Mapping[str, str]) -> tuple[str, str, str, str]:
    """Names for a row's model, the shortest first."""
    model = row.get("model", "").lstrip("/")
    stem = str(PurePosixPath(model).with_suffix("")) if PurePosixPath(model).name else ""
    name = row.get("id", "").rpartition("#")[2]
    return key_of(model), stem, f"{stem}/{name or number}", f"{stem}/{number}"


def _entry(row: Mapping[str, str], names: Collection[str]) -> Entry:
    """The model of a row, its key apart.

    Raises:
      ValueError: it gives no model that can be read; the words go on after 'model 3'.
    """
    model = row.get("model", "").lstrip("/")
    if not model.lower().endswith(".obj"):
        raise ValueError(f"should name an .obj file, got {model!r}")
    if model not in names:
        raise ValueError(f"names {model!r}, which is not in the library")
    width, depth, height = (_number(row, f) / 100.0 for f in ("width", "depth", "height"))
    if min(width, depth, height) <= 0:
        raise ValueError(f"should have a positive size, got {width} x {depth} x {height} m")
    rotation: tuple[float, ...] = IDENTITY
    if words := row.get("modelRotation"):
        try:
            rotation = tuple(float(x) for x in words.split())
        except ValueError:
            rotation = ()
        if len(rotation) != 9 or not all(math.isfinite(x) for x in rotation):
            raise ValueError(f"should have a modelRotation of nine numbers, got {words!r}")
    return Entry("", model, (width, depth, height), rotation)


def _number(row: Mapping[str, str], name: str) -> float:
    text = row.get(name, "")
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"should have a number for {name}, got {text!r}")
    return value


SYSTEM_FOLDER = Path("/usr/share/sweethome3d/furniture")
"""Folder of the five libraries of Debian's and Ubuntu's package sweethome3d-furniture."""
OWN_FOLDER = Path(sys.prefix, "share", "sweethome3d", "furniture")
"""Folder into which `embodied doctor --fix` puts those of that package, and libraries that --pack names."""
WHEEL = "embodied_furniture"
"""The package of `pip install embodied-houses[furniture]`: the models of those libraries that the catalogue uses."""


def find_packs(packs: Sequence[Path] = ()) -> tuple[Path, ...]:
    """The .sh3f files of `packs` (files or folders), or, if none are given, those of this environment, of the system
    and of the wheel, in this order.

    Raises:
      PackError: a path in `packs` does not exist.
    """
    libraries: list[Path] = []
    for path in packs or _installed():
        path = Path(path)
        if path.is_dir():
            libraries.extend(sorted(path.glob("*.sh3f")))
        elif path.is_file():
            libraries.append(path)
        elif packs:
            raise PackError(f"furniture library {path} does not exist; name a .sh3f file or a folder of them")
    return tuple(libraries)


def _installed() -> tuple[Path, ...]:
    spec = importlib.util.find_spec(WHEEL)
    return OWN_FOLDER, SYSTEM_FOLDER, *map(Path, (spec and spec.submodule_search_locations) or ())


def install_packs(packs: Sequence[Path]) -> Iterator[Path]:
    """Copy .sh3f files to where every command finds them; yields the copies.

    Raises:
      PackError: no such file, or no furniture library.
    """
    for path in find_packs(packs) if packs else ():
        open_pack(path)
        write_bytes(OWN_FOLDER / path.name, path.read_bytes())
        yield OWN_FOLDER / path.name


def pack_of(key: str) -> Pack:
    """The library that holds the model `key`.

    Raises:
      PackError: no library is installed, or none of them holds it.
    """
    libraries = find_packs()
    for path in libraries:
        pack = open_pack(path)
        if key in pack.entries:
            return pack
    if not libraries:
        raise PackError(
            f"no furniture models are installed, so {key!r} cannot be imported; embodied doctor --fix, "
            "or apt-get install sweethome3d-furniture, or embodied doctor --fix --pack FILE.sh3f"
        )
    raise PackError(
        f"no furniture library holds {key!r}, looked in {[p.name for p in libraries]}; "
        "apt-get install sweethome3d-furniture (version 1.8 or later), or embodied doctor --fix --pack FILE.sh3f"
    )
