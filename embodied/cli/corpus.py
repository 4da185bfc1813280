"""Make a corpus of German and English sentences for learning to translate.

    embodied corpus --out CORPUS
    embodied corpus --out CORPUS --from FOLDER

The first fetches LibreOffice's help and menus with apt (three Debian or Ubuntu packages of 6 MB, MPL-2.0), the second
finds them in a folder. No document is in two splits. A corpus of your own text is a folder with the same files.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from embodied.agents.learners.bandit import Sizes
from embodied.cli.common import note
from embodied.options import Cached, Option, OutputFolder, Settings, any_path


@dataclass(frozen=True, kw_only=True)
class CorpusOptions(Cached):
    out: OutputFolder
    """Folder of the corpus."""
    folder: Annotated[Path | None, Option(any_path, "DIR", name="--from")] = None
    """Folder with the packages, or with what they hold (default: fetch the packages)."""
    seed: int = 0
    """Random seed of the splits."""
    sizes: Annotated[Sizes, Settings("sizes of the splits", Sizes())]


def run(args: CorpusOptions) -> None:
    from embodied.agents.bandit import corpus

    folder = args.folder or corpus.fetch(args.cache / "libreoffice")
    facts = {"source": "LibreOffice (MPL-2.0)", "packages": corpus.versions(folder)}
    corpus.make_corpus(corpus.read(folder), args.out, args.sizes, seed=args.seed, note=note, **facts)
