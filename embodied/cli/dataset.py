"""Build a data set: houses, graphs, routes, tasks and the lit panoramas of all viewpoints.

Rerun an interrupted command to resume; the files do not depend on the number of workers. --pictures none leaves out the
panoramas, and the same command without it renders them later.

    embodied dataset hanna --out DATA --scale mini
    embodied dataset from-people --people STUDY.people --data DATA --out DIR
    embodied dataset vqa --out DIR --houses 40 --test-houses 10 --area 45 80

The second writes DATA again with the words of people who took part in `embodied serve`: their routes for HANNA, VLN and
ILIAD, their sub-goals for VNLA, and, where they gave stars, rater.json: the simulated rater that resembles them most.
The third films walks through lit houses and asks questions about them, with exact answers: --tasks and
--evaluation-tasks are the most questions to train with and to test with.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Annotated, Any

from embodied.cli.common import Furnished, Printed, check_machine, note, pause, show
from embodied.cli.vqa import VQA, make
from embodied.generate.config import SPECIAL
from embodied.kinds.splits import DATASET_SCALES, DatasetSize, described
from embodied.options import HOUSES, Count, CubeFace, InputFolder, InputPath, Option, OutputFolder, drawn_as, whole
from embodied.render.pictures import PICTURES, PictureSettings, in_words, parse_pictures

FROM_PEOPLE = "from-people"
SCALE_HELP = {name: described(name) for name in DATASET_SCALES}


@dataclass(frozen=True, kw_only=True)
class DatasetOptions(Furnished, Printed):
    kind: Annotated[str, Option(metavar="KIND", name="kind")]
    """The kind of task: find, goat, vln, vnla, hanna, hari, doors, MODULE:NAME of your own, from-people, or vqa."""
    out: OutputFolder
    """Folder of the data set."""
    scale: Annotated[str | None, Option(words=tuple(DATASET_SCALES), helps=SCALE_HELP)] = None
    """Size of the data set: houses to train + validate + test in, and training tasks (default: mini)."""
    houses: Annotated[int | None, Option(whole(1, HOUSES), "N")] = None
    """Instead of --scale: N houses to train in, a tenth to validate and a fifth to test in."""
    tasks: Count | None = None
    """With --houses: N training tasks (default: 100 per house)."""
    test_houses: Annotated[int | None, Option(whole(1, HOUSES), "N")] = None
    """With --houses: N houses to test in, with as many tasks each."""
    evaluation_tasks: Count | None = None
    """With --houses: N tasks in every split to validate and to test in."""
    seed: int = 0
    """Random seed; the same seed gives the same data set."""
    area: Annotated[tuple[float, float], Option(metavar=("LOW", "HIGH"))] = (150.0, 420.0)
    """Size of the houses in square metres."""
    storeys: Annotated[int, Option(whole(0, 3), "N")] = 1
    """Storeys of every house, 0: drawn from its seed."""
    special: Annotated[tuple[str, ...], Option(words=SPECIAL)] = ()
    """Rooms of every house that are no boxes, where there is a place for them (not vqa)."""
    language: Annotated[str, Option(words=("people", "landmarks", "plain"))] = "people"
    """Wording of the routes: varied, with habits and landmarks (people), always with landmarks, of paths on which turns
    alone lead astray (landmarks), or plain turns and rooms (plain)."""
    no_rooms: bool = False
    """Requests name no room: any such object in the house will do (VNLA)."""
    ood: Annotated[int, Option(whole(0, HOUSES), "N")] = 0
    """N further houses out of distribution (split 'test_ood'), with furniture, looks, speakers and words that all other
    houses then lack."""
    no_people: bool = False
    """Leave the assistants' bodies out of the houses (HANNA)."""
    people: InputFolder | None = None
    """from-people: the folder of a study."""
    data: InputFolder | None = None
    """from-people: the data set that the study used."""
    people_only: bool = False
    """from-people: leave out all routes but people's."""
    seed_file: InputPath | None = None
    """vqa: seeds of the houses of a hidden split, one per line, instead of --houses."""
    pictures: Annotated[str | None, drawn_as(("none", *PICTURES))] = None
    """How the panorama of every viewpoint is drawn (default: as existing panoramas are, else fast; hari:
    none)."""
    size: CubeFace | None = None
    """Side of a panorama's cube face (default: as are there, else 256)."""
    workers: Count = 2
    """Build with N processes."""


def from_people(args: DatasetOptions) -> None:
    """A data set with what people said."""
    from embodied.agents.bandit.ratings import fitted
    from embodied.assets.cache import write_json
    from embodied.datasets.store import Dataset
    from embodied.serve.results import rated_by_people, worded_by_people, write_people_dataset
    from embodied.serve.sessions import STARS

    if args.people is None or args.data is None:
        raise ValueError("from-people needs --people, the folder of a study, and --data, the data set it was played in")
    source, words = Dataset(args.data), worded_by_people(args.people)
    rated = rated_by_people(args.people, source)
    data = write_people_dataset(source, words, args.out, only=args.people_only)
    facts: dict[str, object] = {"folder": str(args.out), "digest": data.digest, "wordings": len(words)}
    text = f"{data.table()}\n{len(words)} wordings by people; digest {data.digest[:16]}, in {args.out}"
    if len(rated) > 1:
        rater = fitted([s for s, _ in rated], [(n - 1) / (STARS - 1) for _, n in rated], STARS - 1)
        write_json(args.out / "rater.json", dataclasses.asdict(rater))
        facts["rater"] = dataclasses.asdict(rater)
        text += f"\n{len(rated)} ratings resemble {rater}, in rater.json"
    show(args, facts, text)


def run(args: DatasetOptions) -> None:
    if args.kind == FROM_PEOPLE:
        from_people(args)
        return
    if args.kind == VQA:
        make(args)
        return
    from tqdm import tqdm

    from embodied.datasets.build import DatasetConfig, build_dataset, draw_panoramas
    from embodied.datasets.store import Dataset
    from embodied.generate import HouseConfig

    HouseConfig(area=args.area, storeys=args.storeys or None)  # refuses what no house can have, before a folder is made
    words: dict[str, Any] = {"language": args.language, "rooms": not args.no_rooms, "special": args.special}
    words["storeys"] = args.storeys or None
    people = not args.no_people
    config = DatasetConfig(args.kind, chosen_scale(args), args.seed, args.area, people=people, ood=args.ood, **words)
    watch = lambda jobs, total: tqdm(jobs, "houses", total=total, unit="house", mininterval=pause())
    if not (args.out / "dataset.json").exists():
        wanted = chosen_pictures(args.kind, args.pictures, args.size, None)
        check_machine("none" if wanted is None else wanted.word)
    how: dict[str, Any] = {"workers": args.workers, "watch": watch}
    build_dataset(config, args.out, args.cache, own=args.own, **how)
    data = Dataset(args.out)
    pictures = chosen_pictures(args.kind, args.pictures, args.size, data.pictures)
    if pictures is not None:
        note(f"drawing panoramas: {pictures.word}, faces of {pictures.size} pixels; what is drawn already is kept")
        draw_panoramas(config, args.out, args.cache, pictures=pictures, **how)
    splits = {name: dataclasses.asdict(counts) for name, counts in data.index.splits.items()}
    facts: dict[str, Any] = {"folder": str(args.out), "digest": data.digest, "splits": splits}
    facts["pictures"] = None if pictures is None else in_words(pictures)
    show(args, facts, f"{data.table()}\ndigest {data.digest[:16]}, in {args.out}")


def chosen_pictures(
    kind: str, pictures: str | None, size: int | None, held: PictureSettings | None
) -> PictureSettings | None:
    """How the panoramas of a data set are drawn; None: not at all.

    Args:
      pictures, size: what --pictures and --size say; None where they are left out.
      held: how those that the data set holds were drawn, None where it holds none. They are gone on with rather than
        drawn again in another way that nobody asked for.
    """
    from embodied.kinds.task_kind import kind_named

    if pictures is None and held is not None:
        return parse_pictures(held, size)
    word = pictures or ("fast" if kind_named(kind).pictures else "none")
    return None if word == "none" else parse_pictures(word, size)


def chosen_scale(args: DatasetOptions) -> str | DatasetSize:
    """The scale that --scale, or --houses and --tasks, name.

    Raises:
      ValueError: both of them, or --tasks alone.
    """
    sizes = (args.tasks, args.test_houses, args.evaluation_tasks)
    if args.houses is None:
        if any(n is not None for n in sizes):
            raise ValueError("--tasks, --test-houses and --evaluation-tasks want --houses, or choose a --scale")
        return args.scale or "mini"
    if args.scale:
        raise ValueError("--scale and --houses say the same thing twice; leave one out")
    return DatasetSize(args.houses, args.tasks or 100 * args.houses, args.test_houses, args.evaluation_tasks)
