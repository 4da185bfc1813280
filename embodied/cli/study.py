"""Train agents for each row of a table of the dissertation, evaluate them, and write the table.

    embodied study hanna 4.5 houses --data DATA --out STUDY --iterations 600
    embodied study hanna houses --data DATA --judged-in OTHER --out STUDY --seeds 3
    embodied study vision encoders pictures --data DATA --out STUDY
    embodied study realism --data DATA --out STUDY --agents unlit=A.safetensors lit=B.safetensors
    embodied study hari 4.7 4.8 --data DATA --out STUDY
    embodied study vnla askers interventions rules --data DATA --out STUDY
    embodied study bandit 3.2 3.4 3.5 --data CORPUS --out STUDY
    embodied study stars --data DATA --out STUDY
    embodied study iliad 3.4 3.5 C.1 --out STUDY
    embodied study iliad 3.4 3.5 --world nav --data DATA --out STUDY
    embodied study --check STUDY

HANNA's tables are 4.3, 4.4, 4.5, 4.6, D.1, D.2, `houses`, `lights` (needs `embodied features --lights 3`),
`departures` and `requests`. HARI's are 4.7, 4.8, `moves`, `sight` (needs `embodied features`), 'figure 4.5', 'figure
4.5b' and 'figure 4.6'. VNLA's are the first paper's: `askers`, `interventions`, `rooms` (needs --without-rooms) and
`rules`. `bandit` has Table 3.2, Figures 3.4 and 3.5, and `held-out`; ILIAD has Tables 3.4, 3.5 and C.1, 'figure 3.7',
`describer` and `speakers`. --check says which stored tables no longer belong to this code. Rows that tables share are
trained once, each table is written as JSON, Markdown and, where it has one, as a figure. Interrupt it whenever you
like: the same command goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from embodied.cli.common import note
from embodied.cli.options import any_folder, chosen

if TYPE_CHECKING:
    from agents.studies.engine import StudyLearner


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    parser.add_argument(
        "--check", type=any_folder, metavar="DIR", help="say which tables stored in DIR no longer belong to this code"
    )
    kinds = parser.add_subparsers(dest="what", metavar="WHAT")
    learning.add_study_hanna(kinds.add_parser("hanna", help="agents that ask people for help and follow their routes"))
    learning.add_study_realism(
        kinds.add_parser("realism", help="HANNA agents that learned from some pictures, in others")
    )
    learning.add_study_vision(kinds.add_parser("vision", help="encoders that turn pictures into features"))
    learning.add_study_hari(kinds.add_parser("hari", help="agents that learn which question to ask"))
    learning.add_study_vnla(kinds.add_parser("vnla", help="agents that ask an advisor within a budget"))
    learning.add_study_bandit(kinds.add_parser("bandit", help="a translator that learns from ratings"))
    learning.add_study_stars(kinds.add_parser("stars", help="HANNA agents that learn from ratings of their walks"))
    learning.add_study_iliad(kinds.add_parser("iliad", help="students that learn from descriptions"))


def run(args: argparse.Namespace) -> int:
    from agents.studies.engine import check, run_study

    if args.check is not None:
        print("\n".join(check(args.check)) or f"no stored tables in {args.check}")
        return 0
    if args.what is None:
        raise ValueError("say which study, such as `embodied study hanna 4.5`, or --check DIR; --help lists them")
    makers = {
        "hanna": hanna,
        "realism": realism,
        "vision": vision,
        "hari": hari,
        "vnla": vnla,
        "bandit": bandit,
        "stars": stars,
        "iliad": iliad,
    }
    learner: StudyLearner = makers[args.what](args)
    names = getattr(args, "tables", None) or list(learner.tables())
    made = run_study(
        learner,
        names,
        args.out,
        rows=getattr(args, "rows", None),
        workers=args.workers,
        report=args.report,
        command=" ".join(["embodied", *sys.argv[1:]]),
        note=note,
    )
    for path in made.values():
        print(path.read_text(encoding="utf-8"))
    if args.what == "realism":
        from agents.hanna.realism import ranks

        print("\n".join(ranks(json.loads((args.out / "realism-realism.json").read_text()), args.pictures)))
    return 0


def by_name(files: Sequence[tuple[str, Path]]) -> dict[str, list[Path]]:
    """The files of each name, in the order in which they were given."""
    arms: dict[str, list[Path]] = {}
    for name, path in files:
        arms.setdefault(name, []).append(path)
    return arms


def seeds_of(args: argparse.Namespace, first: int) -> tuple[int, ...]:
    """Training seeds: as many as --seeds says, from the first one on."""
    return tuple(range(first, first + args.seeds))


def hanna(args: argparse.Namespace) -> StudyLearner:
    from agents.hanna.study import HannaStudy
    from agents.hanna.training_config import EVALUATIONS, SCALES

    config = chosen(args, SCALES[args.scale])
    return HannaStudy(
        args.data,
        seeds_of(args, config.seed),
        args.tasks,
        (args.judge_seed,),
        args.threads,
        encoder=args.encoder,
        config=config,
        evaluation=chosen(args, EVALUATIONS[args.scale]),
        device=args.device,
        picture_kind=args.pictures,
        begin=args.begin,
        elsewhere=args.judged_in,
    )


def realism(args: argparse.Namespace) -> StudyLearner:
    from agents.hanna.realism import RealismStudy

    return RealismStudy(
        args.data,
        (0,),
        args.tasks,
        (args.judge_seed,),
        args.threads,
        arms=by_name(args.agents),
        pictures=tuple(args.pictures),
        split=args.split,
        houses=args.houses,
        encoders=by_name(args.encoders),
    )


def vision(args: argparse.Namespace) -> StudyLearner:
    from agents.common.device import check_device
    from agents.vision.config import VisionConfig
    from agents.vision.drawn import StripSource
    from agents.vision.study import EncoderStudy

    check_device(args.device)
    config = chosen(args, VisionConfig())
    args.rows = args.rows or (list(by_name(args.encoders)) or None)
    return EncoderStudy(
        StripSource(args.data, args.strips or args.out / "strips", args.cache, args.pictures, args.lights),
        config,
        seeds_of(args, config.seed),
        args.split,
        tuple(args.pictures),
        args.threads,
        args.device,
        args.workers,
        by_name(args.encoders),
    )


def hari(args: argparse.Namespace) -> StudyLearner:
    from agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES
    from agents.hari.study import HariStudy
    from agents.vision.run import encoder_of

    config = chosen(args, INTENTION_SCALES[args.scale])
    return HariStudy(
        args.data,
        seeds_of(args, config.seed),
        args.tasks,
        (config.seed,),
        args.threads,
        execution=EXECUTION_SCALES[args.scale],
        intention=config,
        executor=args.execution,
        encoder=encoder_of(args.encoder, args.network).digest if "sight" in args.tables else "",
        picture_kind=args.pictures,
    )


def vnla(args: argparse.Namespace) -> StudyLearner:
    from agents.common.settings import EvaluationSettings
    from agents.vnla.config import SCALES
    from agents.vnla.study import VnlaStudy

    config = chosen(args, SCALES[args.scale])
    return VnlaStudy(
        args.data,
        seeds_of(args, config.seed),
        args.tasks,
        threads=args.threads,
        encoder=args.encoder,
        network=args.network,
        config=config,
        evaluation=chosen(args, EvaluationSettings()),
        without_rooms=args.without_rooms,
        others=args.others or args.seeds,
        picture_kind=args.pictures,
    )


def bandit(args: argparse.Namespace) -> StudyLearner:
    from agents.bandit.config import SCALES
    from agents.bandit.study import BanditStudy

    config = chosen(args, SCALES[args.scale])
    return BanditStudy(args.data, config, seeds_of(args, config.seed), args.threads)


def stars(args: argparse.Namespace) -> StudyLearner:
    from agents.bandit.rating_config import RatingConfig
    from agents.bandit.stars_study import StarsStudy
    from agents.vision.run import encoder_of

    config = chosen(args, RatingConfig())
    return StarsStudy(
        args.data,
        seeds_of(args, config.seed),
        args.tasks,
        tuple(range(args.judgings)),
        args.threads,
        agent=args.agent,
        encoder=encoder_of(args.encoder, args.network).digest,
        config=config,
        split=args.split,
        rated=args.rated,
        decisions=args.decisions,
    )


def iliad(args: argparse.Namespace) -> StudyLearner:
    from agents.iliad.nav.config import NAV_LEARNER_SCALES, NAV_SCALES
    from agents.iliad.nav.run import NavSource
    from agents.iliad.regex.config import LEARNER_SCALES, REGEX_SCALES
    from agents.iliad.study import IliadStudy, NavStudyWorld, RegexStudyWorld, StudyWorld
    from agents.vision.run import encoder_of

    world: StudyWorld
    if args.world == "nav":
        refuse_regex_settings(args)
        learner = chosen(args, NAV_LEARNER_SCALES[args.scale])
        source = NavSource(args.data, encoder_of(args.encoder, args.network).digest, args.pictures, args.cache)
        world = NavStudyWorld(chosen(args, NAV_SCALES[args.scale]), source)
    else:
        learner = chosen(args, LEARNER_SCALES[args.scale])
        world = RegexStudyWorld(chosen(args, REGEX_SCALES[args.scale]), args.words, args.templates)
    return IliadStudy(world, learner, seeds_of(args, learner.seed), args.threads)


def refuse_regex_settings(args: argparse.Namespace) -> None:
    """
    Raises:
      ValueError: settings of REGEX, or no data set, for NAV.
    """
    from embodied.cli.learning import ONLY_REGEX

    given = [n for n in (*ONLY_REGEX, "words", "templates") if getattr(args, n, None) is not None]
    if given:
        raise ValueError(f"--{given[0].replace('_', '-')} belongs to --world regex; leave it out with --world nav")
    if args.data is None:
        raise ValueError(
            "--world nav wants --data, a folder that `embodied dataset vln` or `hanna` built, with features"
        )
