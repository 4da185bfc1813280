"""Pairs of sentences: filtering, splitting by document, and the folder that a learner reads.

A corpus is a folder of plain text, one sentence a line, words apart by blanks (Moses format):
`supervised`, `bandit_overlap`, `bandit_disjoint`, `dev` and `test`, each with a file per language,
and corpus.json, which says where it came from. Own files work as well if they have these names.

German and English sentences are what LibreOffice's help and menus say in both languages. They come from three packages
of Debian and Ubuntu (MPL-2.0) and are never shipped: `fetch` asks the distribution's own client for them, `read` finds
them in a folder.
"""

import gettext
import re
import shutil
import struct
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import lxml.etree  # type: ignore[import-untyped]
import lxml.html  # type: ignore[import-untyped]

from embodied.agents.learners.bandit import Sizes
from embodied.assets.cache import digest, write_bytes, write_json
from embodied.errors import UnableError
from embodied.locks import locked
from embodied.records import read_json
from embodied.seeds import stream

SOURCE, TARGET = "de", "en"
CORPUS_SPLITS = ("supervised", "bandit_overlap", "bandit_disjoint", "dev", "test")
CORPUS_FORMAT, MADE = "embodied-corpus-2", "corpus.json"
_TOKEN = re.compile(r"\w+(?:[-'’]\w+)*|[^\w\s]")


class CorpusError(ValueError):
    """A corpus that cannot be used: says what was expected, what came and what to do."""


@dataclass(frozen=True)
class Pair:
    """One sentence in two languages."""

    source: str
    target: str
    document: str
    """The document that it was taken from; documents are never shared between splits that must not know each other."""


Corpus = Mapping[str, Sequence[tuple[tuple[str, ...], tuple[str, ...]]]]
"""Split to pairs of (source words, target words)."""


def tokenize(text: str) -> list[str]:
    """Lower-case words (with their hyphens and apostrophes) and single punctuation marks, in order."""
    return _TOKEN.findall(text.lower())


def filtered(pairs: Iterable[Pair], shortest: int = 3) -> list[Pair]:
    """Tokenized pairs of `shortest` to 50 words a side, neither twice as long as the other, each source once.

    The dissertation drops sentences of more than 50 words (3.1.5); the rest of the filter keeps
    menus and headings, of which this source is full, from ruling the ratings (docs/sources.md, S65).
    """
    seen, kept = set(), []
    for pair in pairs:
        source, target = tokenize(pair.source), tokenize(pair.target)
        sizes = sorted((len(source), len(target)))
        if sizes[0] < shortest or sizes[1] > 50 or sizes[1] >= 2 * sizes[0]:
            continue
        text = " ".join(source)
        if text not in seen:
            seen.add(text)
            kept.append(Pair(text, " ".join(target), pair.document))
    return kept


def split(pairs: Sequence[Pair], sizes: Sizes, *, seed: int) -> dict[str, list[Pair]]:
    """Pairs of each split. Test, dev, supervised and bandit_disjoint share no document.

    Raises:
      CorpusError: too few pairs.
    """
    documents: dict[str, list[Pair]] = {}
    for pair in pairs:
        documents.setdefault(pair.document, []).append(pair)
    names = sorted(documents)
    rng = stream(seed, "corpus", "documents")
    order = iter([names[i] for i in rng.permutation(len(names))])
    pairs_by_document: dict[str, list[Pair]] = {}
    wanted = {"test": sizes.test, "dev": sizes.dev, "supervised": sizes.supervised, "bandit_disjoint": sizes.bandit}
    for name, count in wanted.items():
        pairs_by_document[name] = []
        while len(pairs_by_document[name]) < count:
            document = next(order, None)
            if document is None:
                raise CorpusError(
                    f"{len(pairs)} pairs in {len(names)} documents are too few for {sizes}; ask for smaller splits"
                )
            pairs_by_document[name] += documents[document]
    for name in ("supervised", "bandit_disjoint"):
        pairs_by_document[name] = pairs_by_document[name][: wanted[name]]
    known = min(round(sizes.overlap * sizes.bandit), sizes.supervised)
    rng = stream(seed, "corpus", "overlap")
    chosen = [pairs_by_document["supervised"][i] for i in sorted(rng.permutation(sizes.supervised)[:known])]
    pairs_by_document["bandit_overlap"] = chosen + pairs_by_document["bandit_disjoint"][: sizes.bandit - known]
    return {name: pairs_by_document[name] for name in CORPUS_SPLITS}


def save(splits: Mapping[str, Sequence[Pair]], folder: Path, **facts: object) -> None:
    """Write the splits in Moses format, and corpus.json last, so that a folder with it is whole; the files of another
    corpus are deleted first.

    Raises:
      LockedError: another process writes a corpus there.
    """
    folder = Path(folder)
    counts = {}
    with locked(folder):
        for name in (MADE, *(f"{split}.{language}" for split in splits for language in (SOURCE, TARGET))):
            (folder / name).unlink(missing_ok=True)
        for name, pairs in splits.items():
            for language, text in ((SOURCE, "source"), (TARGET, "target")):
                write_bytes(folder / f"{name}.{language}", "".join(f"{getattr(p, text)}\n" for p in pairs).encode())
            words = [len(p.target.split()) for p in pairs]
            counts[name] = {
                "pairs": len(pairs),
                "documents": len({p.document for p in pairs}),
                "target words per sentence": round(sum(words) / len(words), 2),
            }
        write_json(folder / MADE, {"format": CORPUS_FORMAT, **facts, "splits": counts}, indent=1)


def load(folder: Path, names: Sequence[str], *, longest: int = 50) -> Corpus:
    """The splits in `names`; sentences of more than `longest` words on either side are left out (3.1.5).

    Raises:
      CorpusError: a file is missing, empty, not UTF-8, or its two sides differ in length; or a side of a pair is empty.
    """
    return {name: _load(Path(folder), name, longest) for name in names}


def _load(folder: Path, name: str, longest: int) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    source, target = folder / f"{name}.{SOURCE}", folder / f"{name}.{TARGET}"
    pairs = paired(moses_lines(source), moses_lines(target), source, target)
    kept = [(tuple(a.split()), tuple(b.split())) for a, b in pairs]
    kept = [(a, b) for a, b in kept if len(a) <= longest and len(b) <= longest]
    if not kept:
        raise CorpusError(f"{folder / name}: no sentence of at most {longest} words")
    return kept


def moses_lines(path: Path) -> list[str]:
    """The lines of a plain-text file.

    Raises:
      CorpusError: missing, or not UTF-8 (with the place).
    """
    path = Path(path)
    if not path.is_file():
        raise CorpusError(
            f"{path} is missing; make a corpus with `embodied corpus`, or put your own file there, one sentence a line"
        )
    data = path.read_bytes()
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as e:
        line = data[: e.start].count(b"\n") + 1
        raise CorpusError(f"{path}:{line}: not UTF-8 ({e.reason}); convert it, e.g. `iconv -f latin1 -t utf-8`") from e
    return text.removesuffix("\n").split("\n") if text else []


def paired(source: Sequence[str], target: Sequence[str], source_path: Path, target_path: Path) -> list[tuple[str, str]]:
    """The two sides side by side.

    Raises:
      CorpusError: of different length, empty, or with an empty sentence.
    """
    if len(source) != len(target):
        raise CorpusError(
            f"{source_path} has {len(source)} lines, {target_path} {len(target)}; "
            "line n of one must translate line n of the other"
        )
    if not source:
        raise CorpusError(f"{source_path} is empty; it must hold one sentence a line")
    for number, (a, b) in enumerate(zip(source, target, strict=True), 1):
        if not a.strip() or not b.strip():
            path = target_path if a.strip() else source_path
            raise CorpusError(f"{path}:{number}: an empty side; remove line {number} from both files")
    return list(zip(source, target, strict=True))


def corpus_digest(folder: Path, names: Sequence[str]) -> str:
    """A fingerprint of the files of these splits."""
    return digest(*(Path(folder) / f"{name}.{language}" for name in names for language in (SOURCE, TARGET)))


def make_corpus(
    pairs: Sequence[Pair], folder: Path, sizes: Sizes, *, seed: int, note: Callable[[str], None], **facts: object
) -> None:
    """Filter, split and save `pairs`, and say how many there are."""
    kept = filtered(pairs)
    note(f"{len(pairs)} pairs, {len(kept)} after the filter, in {len({p.document for p in kept})} documents")
    save(split(kept, sizes, seed=seed), folder, seed=seed, sizes=vars(sizes), pairs=len(kept), **facts)
    for name, counts in read_json(Path(folder) / MADE)["splits"].items():
        note(f"{name}: " + ", ".join(f"{v} {k}" for k, v in counts.items()))


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
