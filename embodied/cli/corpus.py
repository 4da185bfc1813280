"""Make a corpus of German and English sentences for learning to translate.

    embodied corpus --out CORPUS
    embodied corpus --out CORPUS --from FOLDER
    embodied corpus --out CORPUS --moses TEXT.de TEXT.en

The first fetches LibreOffice's help and menus with apt (three Debian or Ubuntu packages of 6 MB, MPL-2.0), the second
finds them in a folder, the third takes two plain-text files of equal length. No document is in two splits; with
--moses, blocks of lines count as documents.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from embodied.agents.bandit.config import Sizes
from embodied.cli.common import note
from embodied.options import Cached, Count, InputPath, Option, OutputFolder, Settings, any_path


@dataclass(frozen=True, kw_only=True)
class CorpusOptions(Cached):
    out: OutputFolder
    """Folder of the corpus."""
    folder: Annotated[Path | None, Option(any_path, "DIR", name="--from")] = None
    """Folder with the packages, or with what they hold (default: fetch the packages)."""
    moses: tuple[InputPath, InputPath] | None = None
    """Take two text files instead, German and English, with one sentence per line."""
    block: Count = 100
    """Lines of --moses files per document."""
    seed: int = 0
    """Random seed of the splits."""
    sizes: Annotated[Sizes, Settings("sizes of the splits", Sizes())]


def run(args: CorpusOptions) -> None:
    from embodied.agents.bandit import corpus, libreoffice

    if args.folder and args.moses:
        raise ValueError("--from and --moses exclude each other; leave one out")
    if args.moses:
        facts = {"source": "own text", "files": [p.name for p in args.moses]}
        pairs = corpus.read_moses(args.moses[0], args.moses[1], args.block)
    else:
        folder = args.folder or libreoffice.fetch(args.cache / "libreoffice")
        facts = {"source": "LibreOffice (MPL-2.0)", "packages": libreoffice.versions(folder)}
        pairs = libreoffice.read(folder)
    corpus.make_corpus(pairs, args.out, args.sizes, seed=args.seed, note=note, **facts)
