"""Train agents for each row of a table of the dissertation, judge them, and print the table.

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

HANNA's tables are 4.3, 4.4, 4.5 (with figures D.1 and D.2), 4.6, D.2, and success against the number of training
`houses`, of their `lights` (wants `embodied features --lights 3`) and of `requests`. `realism` judges trained HANNA
agents in houses drawn in other ways. HARI's tables are 4.7, 4.8, `moves`, `sight` (wants `embodied features`),
'figure 4.5' and 'figure 4.6'. VNLA's are the first paper's: `askers`, `interventions`, `rooms` (wants --without-rooms)
and `rules`.
`bandit` is a translator that learns from ratings, on a corpus of `embodied corpus`: Table 3.2, Figures 3.4 and 3.5;
`stars` lets a HANNA agent learn from ratings in the same way, in houses. `iliad` learns from descriptions of what it
did: Tables 3.4, 3.5 and C.1, 'figure 3.7', and `describer`: success against wrong descriptions, `speakers`: one that
was never heard. `vision` compares encoders, and what one sees in other pictures. Rows that tables share are trained
once. Interrupt it whenever you like: the same command goes on.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from embodied.cli.common import note


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    kinds = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    learning.add_study(kinds.add_parser("hanna", help="agents that ask people for help and follow their routes"))
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
    runs = {
        "hanna": run_hanna,
        "realism": run_realism,
        "vision": run_vision,
        "hari": run_hari,
        "vnla": run_vnla,
        "bandit": run_bandit,
        "stars": run_stars,
        "iliad": run_iliad,
    }
    for path in runs[args.what](args):
        print(path.read_text(encoding="utf-8"))
    return 0


def run_hanna(args: argparse.Namespace) -> list[Path]:
    from agents.hanna.study import StudySetting, run_study
    from agents.hanna.training_config import SCALES
    from embodied.cli.options import chosen

    setting = StudySetting(
        args.data,
        args.encoder,
        args.out,
        chosen(args, SCALES[args.scale]),
        args.tasks,
        args.judge_seed,
        args.device,
        args.threads,
        args.quality,
        args.seeds,
        args.begin,
        args.judged_in,
    )
    return list(run_study(setting, args.tables, rows=args.rows, workers=args.workers, note=note).values())


def run_realism(args: argparse.Namespace) -> list[Path]:
    from agents.hanna.realism import RealismSetting, run_study

    setting = RealismSetting(
        args.data,
        args.out,
        by_name(args.agents),
        tuple(args.pictures),
        args.split,
        args.tasks,
        args.judge_seed,
        args.houses,
        by_name(args.encoders),
    )
    return [run_study(setting, threads=args.threads, note=note)]


def by_name(files: Sequence[tuple[str, Path]]) -> dict[str, list[Path]]:
    """The files of each name, in the order in which they were given."""
    arms: dict[str, list[Path]] = {}
    for name, path in files:
        arms.setdefault(name, []).append(path)
    return arms


def run_vision(args: argparse.Namespace) -> list[Path]:
    from agents.vision.config import VisionConfig
    from agents.vision.drawn import StripSource
    from agents.vision.study import EncoderStudySetting, run_study
    from embodied.cli.options import chosen

    source = StripSource(args.data, args.strips or args.out / "strips", args.cache, args.quality, args.lights)
    setting = EncoderStudySetting(
        source,
        args.out,
        chosen(args, VisionConfig()),
        seeds=args.seeds,
        split=args.split,
        threads=args.threads,
        device=args.device,
        ready=by_name(args.encoders),
    )
    made = run_study(setting, args.tables, rows=args.rows, pictures=args.pictures, workers=args.workers, note=note)
    return list(made.values())


def run_hari(args: argparse.Namespace) -> list[Path]:
    from agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES
    from agents.hari.study import run_study
    from agents.hari.study_setting import HariStudySetting
    from agents.vision.run import encoder_of
    from embodied.cli.options import chosen

    setting = HariStudySetting(
        args.data,
        args.out,
        EXECUTION_SCALES[args.scale],
        chosen(args, INTENTION_SCALES[args.scale]),
        executor=args.execution,
        seeds=args.seeds,
        tasks=args.tasks,
        threads=args.threads,
        encoder=encoder_of(args).digest if "sight" in args.tables else "",
        quality=args.quality,
    )
    return list(run_study(setting, args.tables, workers=args.workers, note=note).values())


def run_vnla(args: argparse.Namespace) -> list[Path]:
    from agents.vision.run import encoder_of
    from agents.vnla.config import SCALES
    from agents.vnla.study import VnlaStudySetting, run_study
    from embodied.cli.options import chosen

    setting = VnlaStudySetting(
        args.data,
        args.out,
        encoder_of(args),
        chosen(args, SCALES[args.scale]),
        without_rooms=args.without_rooms,
        seeds=args.seeds,
        others=args.others or args.seeds,
        tasks=args.tasks,
        quality=args.quality,
        threads=args.threads,
    )
    return list(run_study(setting, args.tables, rows=args.rows, workers=args.workers, note=note).values())


def run_bandit(args: argparse.Namespace) -> list[Path]:
    from agents.bandit.config import SCALES
    from agents.bandit.study import BanditStudySetting, report, run_study
    from embodied.cli.options import chosen

    if args.seeds < 1 or args.workers < 1:
        raise ValueError(f"--seeds and --workers should be at least 1, got {args.seeds} and {args.workers}")
    setting = BanditStudySetting(args.data, args.out, chosen(args, SCALES[args.scale]), args.seeds, args.threads)
    if args.report:
        return list(report(setting, args.tables).values())
    return list(run_study(setting, args.tables, workers=args.workers, note=note).values())


def run_stars(args: argparse.Namespace) -> list[Path]:
    from agents.bandit.navigation_study import NavigationSetting, run_navigation_study
    from agents.bandit.rating_config import RatingConfig
    from agents.vision.run import encoder_of
    from embodied.cli.options import chosen

    if args.seeds < 1:
        raise ValueError(f"--seeds should be at least 1, got {args.seeds}")
    config = chosen(args, RatingConfig())
    setting = NavigationSetting(
        args.data,
        encoder_of(args),
        args.agent,
        args.out,
        config,
        tuple(config.seed + k for k in range(args.seeds)),
        split=args.split,
        rated=args.rated,
        tasks=args.tasks,
        threads=args.threads,
        judgings=args.judgings,
        decisions=args.decisions,
    )
    return [run_navigation_study(setting, args.only, note=note)]


def run_iliad(args: argparse.Namespace) -> list[Path]:
    from agents.iliad.nav.config import NAV_LEARNER_SCALES, NAV_SCALES
    from agents.iliad.nav.run import NavSource
    from agents.iliad.regex.config import LEARNER_SCALES, REGEX_SCALES
    from agents.iliad.study import IliadStudySetting, report, run_study
    from agents.iliad.subjects import NavSubject, RegexSubject, Subject
    from agents.vision.run import encoder_of
    from embodied.cli.options import chosen

    subject: Subject
    if args.world == "nav":
        refuse_regex_settings(args)
        source = NavSource(args.data, encoder_of(args).digest, args.quality, args.cache)
        subject = NavSubject(chosen(args, NAV_SCALES[args.scale]), source)
    else:
        subject = RegexSubject(chosen(args, REGEX_SCALES[args.scale]), args.words, args.templates)
    learners = NAV_LEARNER_SCALES if args.world == "nav" else LEARNER_SCALES
    setting = IliadStudySetting(args.out, subject, chosen(args, learners[args.scale]), args.seeds, args.threads)
    if args.report:
        return list(report(setting, args.tables).values())
    return list(run_study(setting, args.tables, workers=args.workers, note=note).values())


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
