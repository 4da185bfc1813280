"""Train the encoder, an agent (hanna, vnla, hari), or the ILIAD student.

Rerun the command to resume an interrupted run; the result is the same. `tensorboard --logdir DIR` shows the curves, and
--rrd records validation episodes. On several GPUs run `torchrun --nproc-per-node N --no-python embodied train hanna
--device cuda ...`, and on several cores the same without --device.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from embodied.cli.common import note

if TYPE_CHECKING:
    from agents.common.lessons import Lessons
    from embodied.interface import Episode

WATCHED = 2
"""Validation episodes that --rrd records each time."""


def add(parser: argparse.ArgumentParser) -> None:
    from embodied.cli import learning

    kinds = parser.add_subparsers(dest="what", metavar="WHAT", required=True)
    vision = kinds.add_parser(
        "vision", help="the encoder, on renders of a data set's training houses", description=run_vision.__doc__
    )
    learning.add_train_vision(vision)
    hanna = kinds.add_parser(
        "hanna", help="the agent, on a HANNA data set with features", description=run_hanna.__doc__
    )
    learning.add_train_hanna(hanna)
    vnla = kinds.add_parser(
        "vnla", help="the agent that asks an advisor, on a VNLA data set with features", description=run_vnla.__doc__
    )
    learning.add_train_vnla(vnla)
    hari = kinds.add_parser("hari", help="the agent that learns which question to ask", description=run_hari.__doc__)
    intention = learning.add_train_hari(hari)
    iliad = kinds.add_parser(
        "iliad", help="a student that learns from descriptions of what it did", description=run_iliad.__doc__
    )
    learning.add_train_iliad(iliad)
    for parser in (hanna, vnla, intention):
        parser.add_argument(
            "--rrd", action="store_true", help=f"record {WATCHED} validation episodes each time, into the run folder"
        )


def run(args: argparse.Namespace) -> int:
    return {"vision": run_vision, "hanna": run_hanna, "vnla": run_vnla, "hari": run_hari, "iliad": run_iliad}[
        args.what
    ](args)


def run_vision(args: argparse.Namespace) -> int:
    """Draw the houses of a data set, teach an encoder to name and place what is in them, and read how well it sees."""
    from agents.common.device import use_threads
    from agents.vision.config import VisionConfig
    from agents.vision.drawn import StripSource
    from agents.vision.run import train_vision
    from embodied.cli.options import chosen

    use_threads(args.threads)
    source = StripSource(args.data, args.strips or args.out / "strips", args.cache, args.pictures, args.lights)
    how = {"like": args.example, "device": args.device, "workers": args.workers}
    train_vision(source, chosen(args, VisionConfig()), args.out, **how, note=note)
    return 0


def run_hanna(args: argparse.Namespace) -> int:
    """Teach an agent by imitation to navigate, to ask for help and to follow it, on data of `embodied features`."""
    from agents.hanna.run import train_agent
    from agents.hanna.training_config import EVALUATIONS, SCALES
    from embodied.cli.options import chosen

    config, evaluation = chosen(args, SCALES[args.scale]), chosen(args, EVALUATIONS[args.scale])
    watch = _recorder(args) if args.rrd else None
    how = {"minutes": args.minutes, "begin": args.begin, "note": note, "on_validation": watch}
    train_agent(_lessons(args, "hanna"), config, evaluation, args.out, **how)
    return 0


def run_vnla(args: argparse.Namespace) -> int:
    """Teach an agent by imitation to navigate by one view, to ask an advisor within a budget and to do what it says."""
    from agents.common.settings import EvaluationSettings
    from agents.vnla.config import SCALES
    from agents.vnla.run import train_agent
    from embodied.cli.options import chosen

    config, evaluation = chosen(args, SCALES[args.scale]), chosen(args, EvaluationSettings())
    watch = _recorder(args) if args.rrd else None
    how = {"minutes": args.minutes, "note": note, "on_validation": watch}
    train_agent(_lessons(args, "vnla"), config, evaluation, args.out, **how)
    return 0


def _lessons(args: argparse.Namespace, kind: str) -> Lessons:
    """What an agent by imitation learns from; PyTorch has its threads and, under torchrun, its device."""
    from agents.common.device import use_threads
    from agents.common.lessons import Lessons
    from agents.common.parallel import join_launcher
    from agents.vision.run import encoder_of
    from embodied.datasets.store import dataset_of

    use_threads(args.threads)
    encoder = encoder_of(args.encoder, args.network)
    return Lessons(dataset_of(args.data, kind), encoder, args.pictures, join_launcher(args.device))


def run_hari(args: argparse.Namespace) -> int:
    """Teach an agent to walk by descriptions (execution), then which question to ask when (intention)."""
    from agents.common.device import use_threads
    from agents.hari.agent import load_executor
    from agents.hari.config import EXECUTION_SCALES, INTENTION_SCALES
    from agents.hari.run import hari_data, train_execution, train_intention, with_eyes
    from agents.vision.run import encoder_of
    from embodied.cli.options import chosen

    use_threads(args.threads)
    data = hari_data(args.data)
    if args.phase == "execution":
        config = chosen(args, EXECUTION_SCALES[args.scale])
        encoder = encoder_of(args.encoder, args.network).digest if config.sees == "features" else ""
        how = {"picture_kind": args.pictures, "begin": args.begin, "minutes": args.minutes}
        train_execution(data, config, args.out, encoder=encoder, note=note, **how)
    else:
        asking = chosen(args, INTENTION_SCALES[args.scale])
        walking = with_eyes(load_executor(args.execution), data, args.pictures)
        watch = _recorder(args, sees=walking.seeing is not None) if args.rrd else None
        train_intention(data, walking, asking, args.out, minutes=args.minutes, note=note, on_validation=watch)
    return 0


def run_iliad(args: argparse.Namespace) -> int:
    """Teach a student to change words or to follow routes as a request says, by descriptions (ADEL), demonstrations or
    rewards."""
    from agents.common.device import use_threads

    use_threads(args.threads)
    return {"regex": run_regex, "nav": run_nav}[args.world](args)


def run_regex(args: argparse.Namespace) -> int:
    from agents.iliad.config import folder_name
    from agents.iliad.regex.config import LEARNER_SCALES, REGEX_SCALES, students_of
    from agents.iliad.regex.run import learn, prepare
    from embodied.cli.options import chosen

    regex, learner = chosen(args, REGEX_SCALES[args.scale]), chosen(args, LEARNER_SCALES[args.scale])
    grounds = prepare(regex, args.out / "shared", words=args.words, templates=args.templates, note=note)
    home = args.out / "students" / students_of(regex) / f"seed_{learner.seed}"
    learn(grounds, learner, home / folder_name(learner), home / "pretraining", minutes=args.minutes, note=note)
    return 0


def run_nav(args: argparse.Namespace) -> int:
    from agents.iliad.config import folder_name
    from agents.iliad.nav.config import NAV_LEARNER_SCALES, NAV_SCALES
    from agents.iliad.nav.run import NavSource, learn, prepare
    from agents.vision.run import encoder_of
    from embodied.cli.options import chosen

    nav, learner = chosen(args, NAV_SCALES[args.scale]), chosen(args, NAV_LEARNER_SCALES[args.scale])
    source = NavSource(args.data, encoder_of(args.encoder, args.network).digest, args.pictures, args.cache)
    grounds = prepare(nav, source, args.out / "shared", note=note)
    home = args.out / "students" / nav.teacher / f"seed_{learner.seed}" / folder_name(learner)
    learn(grounds, learner, home, minutes=args.minutes, note=note)
    return 0


def _recorder(args: argparse.Namespace, *, sees: bool = True) -> Callable[[int, Sequence[Episode]], None]:
    """Writes the first validation episodes of each validation as Rerun recordings, with what it saw if it sees."""
    from agents.vision.drawn import drawn_world, pictures_of
    from embodied.datasets.store import Dataset
    from viz.recording import record_episode
    from viz.sinks import Sinks

    data = Dataset(args.data)

    def keep(update: int, episodes: Sequence[Episode]) -> None:
        for number, episode in enumerate(episodes[:WATCHED]):
            name = episode.task.world
            with drawn_world(data, name, args.cache, pictures_of(data, name, args.pictures)) as world:
                file = args.out / f"validation_{update:06d}_{number}.rrd"
                record_episode(world, episode, Sinks(file), eyes=world if sees else None)

    return keep
