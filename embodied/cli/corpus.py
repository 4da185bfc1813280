"""Make a corpus of German and English sentences to learn to translate with.

    embodied corpus --out CORPUS
    embodied corpus --out CORPUS --from FOLDER
    embodied corpus --out CORPUS --moses TEXT.de TEXT.en

The first fetches LibreOffice's help and menus through the distribution's own client (three Debian
or Ubuntu packages of 6 MB, MPL-2.0), the second finds them in a folder, the third takes any two
plain-text files of equal length. Splits share no document (lines of own files count in blocks).
"""

from __future__ import annotations

import argparse

from embodied.cli.common import add_cache, note
from embodied.cli.options import add_fields, any_path, chosen, folder_to_write, whole


def add(parser: argparse.ArgumentParser) -> None:
    from agents.bandit.sizes import Sizes

    parser.add_argument("--out", type=folder_to_write, required=True, metavar="DIR", help="folder of the corpus")
    given = parser.add_mutually_exclusive_group()
    given.add_argument(
        "--from",
        type=any_path,
        metavar="DIR",
        dest="folder",
        help="where the packages or what they hold are (default: fetch)",
    )
    given.add_argument(
        "--moses", type=any_path, nargs=2, metavar="FILE", help="German and English text, a sentence a line, instead"
    )
    parser.add_argument(
        "--block",
        type=whole(),
        default=100,
        metavar="N",
        help="lines of --moses files per document (default: %(default)s)",
    )
    parser.add_argument("--seed", type=int, default=0, help="the splits follow from this number (default: %(default)s)")
    add_fields(parser, Sizes)
    add_cache(parser)


def run(args: argparse.Namespace) -> int:
    from agents.bandit import corpus, libreoffice
    from agents.bandit.sizes import Sizes

    sizes = chosen(args, Sizes())
    if args.moses:
        facts = {"source": "own text", "files": [p.name for p in args.moses]}
        pairs = corpus.read_moses(args.moses[0], args.moses[1], args.block)
    else:
        folder = args.folder or libreoffice.fetch(args.cache / "libreoffice")
        facts = {"source": "LibreOffice (MPL-2.0)", "packages": libreoffice.versions(folder)}
        pairs = libreoffice.read(folder)
    corpus.make_corpus(pairs, args.out, sizes, seed=args.seed, note=note, **facts)
    return 0
