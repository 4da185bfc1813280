"""Pairs of sentences: filtering, splitting by document, and the folder that a learner reads.

A corpus is a folder of plain text, one sentence a line, words apart by blanks (Moses format):
`supervised`, `bandit_overlap`, `bandit_disjoint`, `dev` and `test`, each with a file per language,
and corpus.json, which says where it came from. Own files work as well if they have these names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from embodied.agents.bandit.config import Sizes
from embodied.assets.cache import digest, write_bytes, write_json
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
    for name, wanted in (
        ("test", sizes.test),
        ("dev", sizes.dev),
        ("supervised", sizes.supervised),
        ("bandit_disjoint", sizes.bandit),
    ):
        pairs_by_document[name] = []
        while len(pairs_by_document[name]) < wanted:
            document = next(order, None)
            if document is None:
                raise CorpusError(
                    f"{len(pairs)} pairs in {len(names)} documents are too few for {sizes}; ask for smaller splits"
                )
            pairs_by_document[name] += documents[document]
    for name, wanted in (("supervised", sizes.supervised), ("bandit_disjoint", sizes.bandit)):
        pairs_by_document[name] = pairs_by_document[name][:wanted]
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
