"""German and English sentences that LibreOffice's help and menus say in both languages.

They come from three packages of Debian and Ubuntu (MPL-2.0) and are never shipped: `fetch` asks the
distribution's own client for them, `read` finds them in a folder.
"""

from __future__ import annotations

import gettext
import re
import shutil
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import lxml.etree  # type: ignore[import-untyped]
import lxml.html  # type: ignore[import-untyped]

from embodied.agents.bandit.corpus import CorpusError, Pair
from embodied.errors import UnableError

PACKAGES = ("libreoffice-help-de", "libreoffice-help-en-us", "libreoffice-l10n-de")
HELP = Path("usr/share/libreoffice/help")
MENUS = Path("usr/lib/libreoffice/program/resource/de/LC_MESSAGES")
BY_HAND = (
    f"get the packages {', '.join(PACKAGES)} on a Debian or Ubuntu machine (`apt-get download {' '.join(PACKAGES)}`) "
    "and name the folder with --from"
)
_OWN = re.compile(r"par_|hd_|$")
_SENTENCE = re.compile(r"(?<=[.!?])\s+(?=[A-ZÄÖÜ\"„])")
_ACCELERATOR = re.compile(r"~(?=\w)|(?<!\w)_(?=\w)|(?<=\w)_(?=\w)")


def fetch(folder: Path) -> Path:
    """Have apt download the packages into `folder`; those that are there already stay.

    Raises:
      UnableError: no apt here, or it failed; says how to do it by hand.
    """
    folder.mkdir(parents=True, exist_ok=True)
    missing = [name for name in PACKAGES if not list(folder.glob(f"{name}_*.deb"))]
    if not missing:
        return folder
    if shutil.which("apt-get") is None:
        raise UnableError(f"there is no apt-get here to fetch {', '.join(missing)}; {BY_HAND}")
    done = subprocess.run(["apt-get", "download", *missing], cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise UnableError(
            f"apt-get could not download {', '.join(missing)} ({reason}); try `apt-get update`, or {BY_HAND}"
        )
    return folder


def read(folder: Path) -> list[Pair]:
    """All pairs of the packages in `folder`, in a fixed order, unfiltered.

    Args:
      folder: holds the .deb files, or what they hold (`usr/share/libreoffice/help/...`), e.g. `/`.

    Raises:
      CorpusError: a package is missing or damaged.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise CorpusError(f"{folder} is not a folder; {BY_HAND}")
    root = _unpacked(folder)
    for path, package in ((HELP / "de", PACKAGES[0]), (HELP / "en-US", PACKAGES[1]), (MENUS, PACKAGES[2])):
        if not (root / path).is_dir():
            raise CorpusError(f"{folder} lacks package {package} (neither a .deb nor {path}); {BY_HAND}")
    return [*_help(root / HELP), *_menus(root / MENUS)]


def versions(folder: Path) -> list[str]:
    """Names of the .deb files in `folder`, which carry their versions."""
    return sorted(p.name for name in PACKAGES for p in Path(folder).glob(f"{name}_*.deb"))


def _unpacked(folder: Path) -> Path:
    """The folder with the content of the packages: `folder` itself, or below it after unpacking."""
    packages = [p for name in PACKAGES for p in sorted(folder.glob(f"{name}_*.deb"))[-1:]]
    if not packages:
        return folder
    if shutil.which("dpkg-deb") is None:
        raise UnableError(
            f"dpkg-deb is needed to unpack {folder}; unpack it elsewhere and name that folder with --from"
        )
    root = folder / "unpacked"
    root.mkdir(parents=True, exist_ok=True)
    for path in packages:
        done = root / f".{path.name}"
        if not done.exists():
            tool = subprocess.run(["dpkg-deb", "-x", str(path), str(root)], capture_output=True, text=True, check=False)
            if tool.returncode:
                reason = tool.stderr.strip().splitlines()[-1]
                raise CorpusError(f"{path}: damaged ({reason}); delete it and fetch it again")
            done.touch()
    return root


def _help(folder: Path) -> Iterator[Pair]:
    """Headings and paragraphs of the help, by sentences where both languages have as many; a page is a document.

    Both languages of a page are made from one source, so its blocks come in the same order; where
    their ids differ nevertheless, the block is left out.
    """
    for page in sorted((folder / "de" / "text").rglob("*.html")):
        name = page.relative_to(folder / "de").as_posix()
        other = folder / "en-US" / name
        if other.exists():
            for (i, german), (j, english) in zip(_blocks(page), _blocks(other), strict=False):
                if i == j:
                    yield from (Pair(a, b, name) for a, b in _sentences(german, english))


def _blocks(page: Path) -> list[tuple[str, str]]:
    """(id, text without markup) of the headings and paragraphs of a page.

    Many have no id; other ids than these are of the page's frame.
    """
    try:
        body = lxml.html.fromstring(page.read_bytes().decode("utf-8"))
    except (UnicodeDecodeError, lxml.etree.ParserError) as e:
        raise CorpusError(f"{page}: not a page of the help ({e}); fetch the packages again") from e
    blocks = [
        e
        for e in body.iter("p", "h1", "h2", "h3", "h4", "h5", "h6")
        if e.get("class") != "bug" and _OWN.match(e.get("id", ""))
    ]
    return [(e.get("id", ""), " ".join(e.text_content().split())) for e in blocks]


def _sentences(german: str, english: str) -> list[tuple[str, str]]:
    """The sentences of a paragraph side by side, or the paragraph whole where their numbers differ."""
    sides = _SENTENCE.split(german), _SENTENCE.split(english)
    return list(zip(*sides, strict=True)) if len(sides[0]) == len(sides[1]) else [(german, english)]


def _menus(folder: Path) -> Iterator[Pair]:
    """Messages of the program; a dialog or a list of strings is a document."""
    for path in sorted(folder.glob("*.mo")):
        try:
            with open(path, "rb") as f:
                messages = vars(gettext.GNUTranslations(f))["_catalog"]  # the only way to all of them
        except (OSError, ValueError, struct.error, LookupError) as e:  # empty, cut short, or of another encoding
            raise CorpusError(f"{path}: damaged ({e}); fetch package {PACKAGES[2]} again") from e
        for key, german in messages.items():
            if isinstance(key, str) and "\x04" in key:
                context, english = key.split("\x04", 1)
                document = f"{path.stem}:{context.split('|')[0]}"
                yield from (Pair(a, b, document) for a, b in _sentences(_plain(german), _plain(english)))


def _plain(message: str) -> str:
    """Without the marks of keyboard accelerators."""
    return " ".join(_ACCELERATOR.sub("", message).split())
