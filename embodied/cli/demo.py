"""From a seed to recorded episodes, in one command.

Generates a furnished house with people in it, lights it and renders the panorama of every viewpoint. Then one agent
looks for an object along the shortest path, and a trained agent that has never seen this house finds another one by
asking the people, while others walk about. Both episodes are recorded for Rerun; --video also films the second. At last
somebody who lives there walks and sits down, filmed as DIR/walk.mp4.
"""

from __future__ import annotations

import contextlib
import functools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from embodied.cli.common import Furnished, Printed, bar, catalogue_of, check_machine, fetch, note, show
from embodied.cli.rollout import Filmed, Viewers, check_viewer, film
from embodied.options import CubeFace, Option, OutputFolder, OutputRrd, drawn_as, whole
from embodied.render.pictures import DRAWN

if TYPE_CHECKING:
    from embodied.assets.catalogue import Catalogue
    from embodied.house.house import House
    from embodied.interface import Episode, Route
    from embodied.navigation.graph import NavGraph
    from embodied.people.day import Day
    from embodied.viz.sinks import Sinks
    from embodied.world import World

WALK_SECONDS, WALK_SIZE = 20.0, (240, 320)
"""Of the walk that is filmed, at most, and height and width of its frames, pixels."""
SEED = 3
"""The demo house: a flat that is lit and drawn in a few minutes on two cores."""


@dataclass(frozen=True, kw_only=True)
class DemoOptions(Filmed, Viewers, Furnished, Printed):
    seed: int = SEED
    """Seed of the house."""
    task: Annotated[int, Option(whole(0), "N")] = 0
    """Number of the task in the house."""
    size: CubeFace = 384
    """Side of a panorama's cube face in pixels."""
    pictures: Annotated[str, drawn_as(DRAWN)] = "normal"
    """How the house is drawn."""
    out: OutputFolder = Path("out/demo")
    """Folder to write."""
    small: bool = False
    """Only light one small flat and show a room of it, as DIR/room.png."""
    rrd: OutputRrd | None = None
    """Write the Rerun recording here (default: DIR/episode.rrd)."""


def run(args: DemoOptions) -> None:
    check_machine("fast" if args.small else args.pictures)
    if args.small:
        show_a_room(args)
        return
    check_viewer(args)
    from embodied.generate import generate_house
    from embodied.house.floor_plan import save_plan

    catalogue = catalogue_of(args)
    seconds: dict[str, float] = {}
    args.out.mkdir(parents=True, exist_ok=True)
    with timed("a house with people in it", seconds):
        house = generate_house(args.seed, catalogue=catalogue)
        fetch(catalogue, house)
        house, graph, routes = inhabited(house, catalogue, args)
        house.save(args.out / "house.json")
        save_plan(house, args.out / "plan.png", graph=graph)
    note(f"{house.name}: {len(house.rooms)} rooms, {len(house.placements)} objects, {len(graph.ids)} viewpoints")
    from embodied.world import open_world

    with open_world(house, catalogue, args.cache, graph=graph, size=args.size, pictures=args.pictures) as world:
        with timed("light and panoramas", seconds):
            world.render_all(progress=True)
        with timed("the first task: find something", seconds):
            walk = find_something(args, world)
        with timed("the second task: ask for help", seconds):
            help_facts = ask_for_help(args, world, routes)
        with timed("somebody walks", seconds):
            mp4 = film_a_walk(args.out / "walk.mp4", world)
        facts: dict[str, object] = {"walk": walk, "help": help_facts, "plan": str(args.out / "plan.png")}
        facts |= {"seconds": seconds, "renderer": world.fingerprint["renderer"]}
    look = f"look at a recording with: rerun {help_facts['recording']}"
    lines = [told(walk), told(help_facts), f"floor plan  {facts['plan']}", *([f"a walk  {mp4}"] if mp4 else []), look]
    show(args, facts, "\n".join(lines))


SMALL_FLAT = (32.0, 36.0)
"""Area of the flat of --small, square metres."""


def show_a_room(args: DemoOptions) -> None:
    """A small flat from the seed, lit, and the view of it that shows most objects; needs neither torch nor Rerun."""
    import cv2
    import numpy as np

    from embodied.generate import generate_house
    from embodied.generate.config import HouseConfig
    from embodied.world import open_world

    catalogue = catalogue_of(args)
    seconds: dict[str, float] = {}
    args.out.mkdir(parents=True, exist_ok=True)
    with timed("a small flat (about 10 s)", seconds):
        house = generate_house(args.seed, HouseConfig(area=SMALL_FLAT, hour=11.0, weather="clear"), catalogue)
        house.save(args.out / "house.json")
        fetch(catalogue, house)
    note(f"{house.name}: {len(house.rooms)} rooms, {len(house.placements)} objects")
    with open_world(house, catalogue, args.cache, size=args.size, pictures="fast") as world:
        with timed("light, followed through the flat once", seconds):
            seen = {n: world.panorama(n) for n in range(len(world.graph.ids))}
        best = max(
            ((n, yaw) for n in seen for yaw in np.arange(12) * np.pi / 6),
            key=lambda at: len(np.unique(seen[at[0]].view(at[1], -0.15, np.radians(60), (90, 160))[2])),
        )
        picture = world.camera(world.graph.positions[best[0]], best[1], -0.15, np.radians(60), (720, 1280)).rgb
    cv2.imwrite(str(args.out / "room.png"), np.ascontiguousarray(picture[..., ::-1]))
    facts = {"room": str(args.out / "room.png"), "house": str(args.out / "house.json"), "seconds": seconds}
    show(args, facts, f"a room of it: {facts['room']}")


def inhabited(house: House, catalogue: Catalogue, args: DemoOptions) -> tuple[House, NavGraph, tuple[Route, ...]]:
    """The house with people at the starts of the routes they know, its graph, and the routes in their words."""
    from embodied.assistants.route_system import WORDINGS, worded
    from embodied.datasets.build import with_people
    from embodied.language import People
    from embodied.navigation.graph import build_graph
    from embodied.world import open_world

    graph = build_graph(house)
    house, paths = with_people(house, graph, catalogue, args.seed, "test")
    with open_world(house, catalogue, args.cache, graph=graph) as world:
        return house, graph, worded(world, paths, WORDINGS["test"], seed=args.seed, language=People())


def find_something(args: DemoOptions, world: World) -> dict:
    """The shortest-path agent walks to an object; recorded to episode.rrd."""
    from embodied.evaluation.evaluate import play
    from embodied.kinds.shipped.find import FIND
    from embodied.kinds.task_kind import EnvInputs
    from embodied.language import People
    from embodied.policies.baselines import Shortest
    from embodied.tasks.goals import find_pool, find_task
    from embodied.viz.sinks import Sinks

    task = find_task(find_pool(world, seed=args.seed), args.task, seed=args.seed, language=People())
    make = FIND.environments(EnvInputs({world.name: world}))
    episode = play(make, Shortest(), [task], seed=args.seed, agent="shortest path")[0]
    return recorded(world, episode, Sinks(args.rrd or args.out / "episode.rrd", args.connect))


def ask_for_help(args: DemoOptions, world: World, routes: Sequence[Route]) -> dict:
    """The trained agent, seeing the world's own pictures, does a HANNA task in a house it has never seen; recorded to
    help.rrd."""
    from embodied.agents.common.settings import SHIPPED_AGENT
    from embodied.agents.hanna.agent import HannaAgent, hanna_policies
    from embodied.agents.vision.detector import Detector
    from embodied.agents.vision.encoder import load_encoder
    from embodied.agents.vision.features import FeatureBank, encode_panoramas
    from embodied.evaluation.evaluate import play
    from embodied.kinds.shipped.hanna import HANNA, hanna_pool, hanna_task
    from embodied.kinds.task_kind import EnvInputs
    from embodied.language import People
    from embodied.viz.sinks import Sinks

    agent, encoder = HannaAgent.load(SHIPPED_AGENT), load_encoder()
    nodes = bar(range(len(world.graph.ids)), "what the agent sees", "node")
    features = encode_panoramas(encoder, (world.panorama(n) for n in nodes))
    bank = FeatureBank({world.name: features}, encoder.digest)
    pool = hanna_pool(world, seed=args.seed)
    task = hanna_task(pool, args.task % len(pool), seed=args.seed, language=People())
    make = HANNA.environments(EnvInputs({world.name: world}, lambda _: routes))
    episode = play(make, hanna_policies(agent, bank)["learned"], [task], seed=args.seed, agent="learned")[0]
    if args.video:
        film(world, episode, args.video, args.video_size)
    how: dict[str, Any] = {"eyes": world, "recognise": Detector.load(encoder).recognise}
    if (walker := somebody_walks(world)) is not None:
        day, _, begin, end = walker
        how["living"] = lambda step: day.at(begin + (end - begin) * step / len(episode.steps))
    return recorded(world, episode, Sinks(args.out / "help.rrd", args.connect), **how)


@functools.cache
def somebody_walks(world: World) -> tuple[Day, str, float, float] | None:
    """The day of the household, and who walks in it from and until when, through a door if one is closed, far, and
    sits down; None where nobody does."""
    from embodied.people.day import day_of

    day, walks = day_of(world.house, world.catalogue, seed=0), []
    for name, own in day.pieces.items():
        doors = [p.begin for p in own if p.leg and p.leg.door]
        for a, b in pairwise(p for p in own if p.leg is None and p.settled[0] == p.settled[1]):
            if b.spot.seat and a.spot.activity != "out" and 0 < b.begin - a.end < WALK_SECONDS:
                opens = any(a.end < t < b.begin for t in doors)
                walks.append((opens, math.dist(a.spot.stand, b.spot.stand), name, a.end, b.begin))
    return (day, *max(walks)[2:]) if walks else None


def film_a_walk(path: Path, world: World) -> Path | None:
    """Film `somebody_walks`; None where nobody does, or in a house that is not lit."""
    import numpy as np
    import shapely

    from embodied.cli.rollout import VIDEO_ANGLE
    from embodied.house.moment import Moment
    from embodied.navigation.free_space import sight_floor
    from embodied.viz.video import FPS, write_video
    from embodied.world import SLACK

    if world.pictures.quality is None or (walker := somebody_walks(world)) is None:
        return None
    day, name, begin, end = walker
    eyes, sight = world.graph.positions, sight_floor(world.house, 0)

    def frames() -> Iterator[np.ndarray]:
        node = -1
        for now in np.arange(begin, end + 1, 2 / FPS):
            world.show(moment := day.at(now), slack=SLACK)
            at = np.array(moment.people[name].place.position)
            far = np.hypot(*(eyes - at)[:, :2].T)
            line = shapely.linestrings([[eye[:2], at[:2]] for eye in eyes])
            near = np.flatnonzero((far > 1.2) & (far < 6) & shapely.covers(sight, line))
            node = node if node in near or not len(near) else int(min(near, key=lambda n: abs(far[n] - 2.5)))
            yaw = math.atan2(*(at - eyes[node])[1::-1])
            yield from [world.camera(eyes[node], yaw, -0.25, VIDEO_ANGLE, WALK_SIZE).rgb] * 2

    write_video(path, frames(), WALK_SIZE)
    world.show(Moment())
    return path


def recorded(world: World, episode: Episode, sinks: Sinks, **how: Any) -> dict:
    """Record an episode, `how` as of `record_episode`; what is worth telling about it."""
    from embodied.kinds.metrics import navigation_error, spl, success
    from embodied.viz.recording import record_episode

    assert sinks.rrd is not None, "a file is always written"
    watch = lambda steps: bar(steps, "recording", "step")
    record_episode(world, episode, sinks, watch=watch, **how)
    return {
        "agent": episode.agent,
        "request": episode.task.request,
        "success": bool(success(episode, world.graph)),
        "spl": round(spl(episode, world.graph), 3),
        "navigation_error_m": round(navigation_error(episode, world.graph), 2),
        "steps": len(episode.steps),
        "requests": episode.requests,
        "recording": str(sinks.rrd),
        "recording_mib": round(sinks.rrd.stat().st_size / 2**20, 1),
    }


def told(facts: dict) -> str:
    """One line about a recorded episode."""
    outcome = "found" if facts["success"] else f"missed by {facts['navigation_error_m']} m"
    return (
        f"“{facts['request']}”  {facts['agent']}: {outcome}, {facts['steps']} steps, "
        f"{facts['requests']} request{'s' * (facts['requests'] != 1)} for help"
        f"  -> {facts['recording']} ({facts['recording_mib']} MiB)"
    )


@contextlib.contextmanager
def timed(name: str, seconds: dict[str, float]) -> Iterator[None]:
    """Write down how long the body took under `name`."""
    start = time.perf_counter()
    yield
    seconds[name] = round(time.perf_counter() - start, 1)
    note(f"[{seconds[name]:6.1f} s] {name}")
