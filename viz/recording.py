"""An episode as a Rerun recording: the house, the graph, the agent, its views, the dialogue.

Entity tree (timeline 'step'):
  house/<room>/<owner>   meshes, once              graph/...        viewpoints and edges, once
  task/goal              where the goal is, once   agent/camera     pose, pinhole and what it sees
  agent/path, agent/route  walked, spoken of       view/panorama, view/target
  people/NAME            who moves about
  view/panorama/recognised   what the agent's encoder recognises
  text/...               request, instruction, dialogue, goals (HARI's stack)
  plot/...               distance to the goal, requests, HARI's cost, probabilities     events   a log
"""

import dataclasses
import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import rerun as rr
from scipy.spatial.transform import Rotation

from embodied.action_spaces import doors_moved
from embodied.assets.decoding import jpeg
from embodied.house.moment import Moment
from embodied.interface import Ask, Close, Episode, Mode, Move, Open, Pose, Step, Stop, Task
from embodied.kinds.task_kind import kind_named
from embodied.language.plain_language import detokenized
from embodied.navigation.doors import place_named, seen_name
from embodied.navigation.free_space import EYE
from embodied.people.strolls import noticing
from embodied.render.camera import camera_at
from embodied.render.panorama import Panorama, Recognised
from embodied.render.photograph import PhotoCamera
from embodied.viz.episode_log import LOOKS, EpisodeLog, question_of
from embodied.viz.house3d import light_meshes, lit_meshes, log_meshes, log_people
from embodied.viz.sinks import Sinks, blueprint_of, open_recording
from embodied.world import World

PALETTE = {name: tuple(colour) for name, colour in LOOKS["colours"].items()}
HEIGHTS = {"node": 0.05, "mark": 0.06, "path": 0.10, "route": 0.13, "body": 0.20}
"""Metres above the floor that things are drawn at, so that none hides another."""
VIEW_VFOV, ONE_VIEW = np.deg2rad(75.0), np.deg2rad(60.0)
"""How high the picture along the gaze reaches: for people, and for an agent that sees this one view only (VNLA)."""
Recognise = Callable[[Panorama], Sequence[Recognised]]
"""Names what is in a panorama (embodied.agents.vision.detector.Detector.recognise)."""
RECORDED_QUALITY = 85
"""Of JPEG pictures, 1 to 100."""
SHORT = 60
"""Letters of a request that is shown as a heading."""


@dataclass(frozen=True)
class PictureSizes:
    """How large the pictures in a recording are; it decides the size of the file."""

    view: tuple[int, int] = (360, 480)
    """Height and width of the first-person view, pixels."""
    panorama: int = 256
    """Height of the equirectangular panorama; twice as wide."""
    camera: PhotoCamera = PhotoCamera()
    """The camera of the first-person views; panoramas and targets stay as they are drawn."""


@dataclass(frozen=True, eq=False)
class Views:
    """Sources of the pictures in a recording."""

    seen: World
    """The house as the agent sees it: its features come from these very panoramas, where it looks at any."""
    sizes: PictureSizes
    vfov: float = VIEW_VFOV
    """Of the picture along the gaze, radians."""
    recognise: Recognise | None = None
    """Names what the agent's encoder recognises."""

    def with_closed(self, node: int, closed: frozenset[str]) -> Self:
        """The same from a node while some doors are closed."""
        name = seen_name(self.seen.house, self.seen.graph, node, closed)
        return dataclasses.replace(self, seen=place_named({self.seen.name: self.seen}, name))


def record(
    recording: rr.RecordingStream,
    world: World,
    task: Task,
    steps: Iterable[Step],
    *,
    eyes: World | None = None,
    pictures: PictureSizes = PictureSizes(),
    budget: int | None = None,
    recognise: Recognise | None = None,
    living: Callable[[int], Moment] | None = None,
) -> Iterator[Step]:
    """Pass `steps` on while logging each: put it between a rollout and whoever consumes it.

    Args:
      recording: where to log; the caller has connected it to a file or a viewer.
      world: the world of the task; its panoramas are drawn when a step needs them.
      eyes: the world whose panoramas the agent looks at; None for an agent that looks at none.
      budget: requests that the episode allowed; None where they were not counted.
      recognise: names what the agent recognises in a panorama of `eyes`.
    """
    log_world(recording, world)
    log_task(recording, world, task)
    vfov = ONE_VIEW if kind_named(task.kind).monocular else VIEW_VFOV
    state, views = EpisodeLog(task, budget), Views(eyes or world, pictures, vfov, recognise)
    closed = world.graph.closed.union(task.closed)
    for index, step in enumerate(steps):
        recording.set_time("step", sequence=index)
        if step.seconds is not None:  # people took part
            recording.set_time("seconds", duration=step.seconds)
        if living is not None:
            log_people(recording, noticing(living(index), world.graph.positions[step.pose.node], world.house))
        log_step(recording, world, task, step, state, views.with_closed(step.pose.node, closed))
        closed ^= doors_moved(step, world.graph, closed)
        yield step
    if state.last is not None:
        recording.set_time("step", sequence=state.count)
        log_end(recording, world, task, state, views.with_closed(state.last.next_pose.node, closed))


def record_episode(
    world: World,
    episode: Episode,
    sinks: Sinks,
    *,
    eyes: World | None = None,
    pictures: PictureSizes = PictureSizes(),
    watch: Callable[[Sequence[Step]], Iterable[Step]] = iter,
    recognise: Recognise | None = None,
    living: Callable[[int], Moment] | None = None,
) -> None:
    """Record a finished episode of `world`, with the layout that suits it.

    Args:
      eyes: the world whose panoramas the agent's features were made from; what it sees is drawn from them, and
        said to be. None for an agent that looks at no pictures.
      pictures: their sizes, and the camera.
      watch: wraps the iterator over steps (a progress bar).
      recognise, living: as of `record`.

    Raises:
      OSError: the file could not be written to its end, or a viewer went away.
    """
    about = {name: str(value) for name, value in world.fingerprint.items()}
    seen = None if eyes is None else eyes.pictures
    layout = blueprint_of(world.house, episode, seen)
    with open_recording(sinks, layout, name=detokenized(episode.task.request), properties=about) as recording:
        how: dict[str, Any] = {"eyes": eyes, "pictures": pictures, "recognise": recognise, "living": living}
        for _ in record(recording, world, episode.task, watch(episode.steps), budget=episode.budget, **how):
            pass


def log_world(recording: rr.RecordingStream, world: World) -> None:
    """The house without ceilings, and its navigation graph, for all times."""
    keep = functools.partial(recording.log, static=True)
    keep("/", rr.ViewCoordinates.RIGHT_HAND_Z_UP)
    hung = frozenset(p.id for p in world.house.placements if world.catalogue.assets[p.asset].support == "ceiling")
    log_meshes(recording, light_meshes(world.parts, hung) if world.lit is None else lit_meshes(world.lit, hung))
    floor = on_floor(world.graph.positions, HEIGHTS["node"])
    keep("graph/nodes", rr.Points3D(floor, radii=0.06, colors=PALETTE["graph"]))
    strips = floor[np.asarray(world.graph.edges)]
    keep("graph/edges", rr.LineStrips3D(strips, radii=0.012, colors=(*PALETTE["graph"], 130)))


def log_task(recording: rr.RecordingStream, world: World, task: Task) -> None:
    """Request, goal and start, for all times."""
    keep, at = functools.partial(recording.log, static=True), world.graph.positions
    goals = on_floor(at[list(task.goal_nodes)], HEIGHTS["mark"])
    keep("task/goal", rr.Points3D(goals, radii=0.16, colors=PALETTE["goal"]))
    sought = [
        world.house.placement_by_id[p] for p in getattr(task.goal, "placements", ()) if p in world.house.placement_by_id
    ]
    if sought:
        boxes = rr.Boxes3D(  # a little larger than the things
            centers=[np.add(p.position, (0.0, 0.0, p.size[2] / 2)) for p in sought],
            half_sizes=[np.divide(p.size, 2) + 0.05 for p in sought],
            rotation_axis_angles=[rr.RotationAxisAngle(axis=(0, 0, 1), radians=p.yaw) for p in sought],
            labels=[p.object_class for p in sought],
            colors=PALETTE["goal"],
            radii=0.012,
        )
        keep("task/sought", boxes)
    start = on_floor(at[task.start.node], HEIGHTS["mark"])
    keep("task/start", rr.Points3D(start, radii=0.13, colors=PALETTE["start"]))
    heading = "## " if len(task.request) <= SHORT else ""
    keep("text/request", markdown(f"{heading}“{detokenized(task.request)}”"))
    for name, colour in (("goal", "goal"), ("target", "route")):
        keep(f"plot/distance/{name}", rr.SeriesLines(colors=PALETTE[colour], widths=2))
    if people := [p for p in world.house.placements if p.object_class == "person"]:
        above, labels = [np.add(p.position, (0, 0, p.size[2] + 0.25)) for p in people], ["assistant"] * len(people)
        keep("people", rr.Points3D(above, radii=0.05, colors=PALETTE["person"], labels=labels, show_labels=False))


def log_step(
    recording: rr.RecordingStream, world: World, task: Task, step: Step, state: EpisodeLog, views: Views
) -> None:
    """One step: what is seen before the action, then the action and the reply to it."""
    log_sight(recording, views, step.pose)
    goal_distance = min(float(world.graph.distance[step.pose.node, g]) for g in task.goal_nodes)
    recording.log("plot/distance/goal", rr.Scalars(goal_distance))
    if step.targets and tuple(step.targets) != tuple(task.goal_nodes):
        target = min(float(world.graph.distance[step.pose.node, g]) for g in step.targets)
        recording.log("plot/distance/target", rr.Scalars(target))
    state.before(step)
    mode = "asks" if isinstance(step.action, Ask) else "sub-task" if step.mode is Mode.SUB else "main task"
    recording.log("mode", rr.StateChange(state=mode))
    recording.log("text/instruction", markdown(instruction_text(step, state.left)))
    if kind_named(task.kind).story.goal_stack:
        recording.log("text/goals", markdown(state.stack(world, step)))
        recording.log("plot/cost", rr.Scalars(state.cost + step.cost))
    log_thought(recording, step)
    log_path(recording, world, state.nodes)
    state.after(step)
    recording.log("plot/requests", rr.Scalars(state.requests))
    if state.left is not None:
        recording.log("plot/budget/left", rr.Scalars(state.left))
    level = "WARN" if isinstance(step.action, Ask) else "INFO"  # asking stands out
    recording.log("events", rr.TextLog(event_text(world, step), level=level))
    recording.log("text/dialogue", markdown(state.dialogue_text()))
    log_aim(recording, world, state, views)


def log_end(recording: rr.RecordingStream, world: World, task: Task, state: EpisodeLog, views: Views) -> None:
    """Log where it ended, and whether that was right; `state` has seen a step."""
    assert state.last is not None
    end = state.last.next_pose
    log_sight(recording, views, end)
    log_path(recording, world, state.nodes)
    distance = min(float(world.graph.distance[end.node, g]) for g in task.goal_nodes)
    recording.log("plot/distance/goal", rr.Scalars(distance))
    verdict = "reached the goal" if distance <= task.radius else f"missed the goal by {distance:.1f} m"
    state.dialogue.append(f"**Judge:** the agent {verdict}, after {state.count} steps and {state.requests} requests.")
    recording.log("text/dialogue", markdown(state.dialogue_text()))
    recording.log("events", rr.TextLog(verdict, level="INFO" if distance <= task.radius else "ERROR"))


def log_sight(recording: rr.RecordingStream, views: Views, pose: Pose) -> None:
    """The agent's pose, what it sees ahead, and the panorama around it with its gaze in the middle."""
    world, sizes = views.seen, views.sizes
    panorama = world.panorama(pose.node)
    height, width = sizes.view
    eye = world.graph.positions[pose.node]
    turn = Rotation.from_matrix(camera_axes(pose.yaw, pose.pitch)).as_quat()
    recording.log("agent/camera", rr.Transform3D(translation=eye, quaternion=rr.Quaternion(xyzw=turn)))
    frame: dict[str, Any] = {
        "width": width,
        "height": height,
        "focal_length": float(height / 2 / np.tan(views.vfov / 2)),
    }
    shown: dict[str, Any] = {
        "camera_xyz": rr.ViewCoordinates.RDF,
        "image_plane_distance": 0.6,
        "color": PALETTE["agent"],
    }
    recording.log("agent/camera/image", rr.Pinhole(**frame, **shown), ahead(panorama, pose, sizes, views.vfov))
    equirect = panorama.equirect(sizes.panorama)
    shift = round(pose.yaw / (2 * np.pi) * equirect.shape[1])
    recording.log("view/panorama", encoded(np.roll(equirect, shift, axis=1)))
    if views.recognise is not None:
        log_recognised(recording, views.recognise(panorama), pose, sizes.panorama)
    at, colour = [on_floor(eye, HEIGHTS["body"])], (*PALETTE["agent"], 200)
    recording.log("agent/body", rr.Capsules3D(lengths=1.0, radii=0.2, translations=at, colors=colour))


def log_recognised(recording: rr.RecordingStream, objects: Sequence[Recognised], pose: Pose, height: int) -> None:
    """Log what an agent recognises around it, in its panorama of (height, 2 height) pixels."""
    at = pixels_towards(np.array([f.yaw for f in objects]), np.array([f.pitch for f in objects]), pose, height)
    names, colour = [f"{f.name.replace('_', ' ')} {f.probability:.0%}" for f in objects], PALETTE["recognised"]
    recording.log("view/panorama/recognised", rr.Points2D(at, labels=names, show_labels=True, radii=3.0, colors=colour))


def pixels_towards(yaw: np.ndarray, pitch: np.ndarray, pose: Pose, height: int) -> np.ndarray:
    """(n, 2) pixels, column and row, of directions (n,) and (n,) in radians in a panorama whose middle column is the
    agent's gaze."""
    column = (np.pi - (yaw - pose.yaw)) % (2 * np.pi) * height / np.pi
    return np.stack([column, (np.pi / 2 - pitch) * height / np.pi], axis=1)


def ahead(panorama: Panorama, pose: Pose, sizes: PictureSizes, vfov: float = VIEW_VFOV) -> rr.EncodedImage:
    """The first-person view from a panorama along the gaze, `vfov` radians high."""
    rgb = panorama.view_rgb(pose.yaw, pose.pitch, vfov, sizes.view)
    return encoded(sizes.camera.photographed(rgb, vfov, pose.node, round(np.degrees(pose.yaw))))


def on_floor(eyes: np.ndarray, height: float) -> np.ndarray:
    """(..., 3) points `height` metres above the floor below `eyes`, positions of viewpoints."""
    return np.asarray(eyes) - [0.0, 0.0, EYE - height]


def log_path(recording: rr.RecordingStream, world: World, nodes: list[int]) -> None:
    """The path walked so far."""
    points = on_floor(world.graph.positions[nodes if len(nodes) > 1 else 2 * nodes], HEIGHTS["path"])
    recording.log("agent/path", rr.LineStrips3D([points], radii=0.04, colors=PALETTE["path"]))


def log_aim(recording: rr.RecordingStream, world: World, state: EpisodeLog, views: Views) -> None:
    """The route that the agent was told and the picture of what it looks for, while they hold."""
    if state.image is not None:
        picture = views.seen.panorama(state.image.node).equirect(views.sizes.panorama)
        recording.log("view/target", encoded(picture))
    if state.route:
        nodes = list(state.route if len(state.route) > 1 else 2 * state.route)
        points = on_floor(world.graph.positions[nodes], HEIGHTS["route"])
        recording.log("agent/route", rr.LineStrips3D([points], radii=0.035, colors=PALETTE["route"]))
    else:
        recording.log("agent/route", rr.Clear(recursive=False))


def log_thought(recording: rr.RecordingStream, step: Step) -> None:
    """The policy's own probabilities, where it gives them."""
    thought = step.action.thought
    for usage in (thought.usage if thought else None, step.reply.usage if step.reply else None):
        if usage is not None:
            recording.log("events", rr.TextLog(f"language model: {usage}"))
    if thought is None:
        return
    if thought.words:
        recording.log("events", rr.TextLog(f"because: {thought.words}"))
    if thought.moves is not None:
        recording.log("plot/moves", rr.BarChart(np.asarray(thought.moves)))
    for name, p in (thought.asks or {}).items():
        if name != "nothing":  # what remains to one
            recording.log(f"plot/probability/{name}", rr.Scalars(float(p)))
    if thought.match is not None:
        recording.log("plot/probability/match", rr.Scalars(thought.match))


def markdown(text: str) -> rr.TextDocument:
    return rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)


def instruction_text(step: Step, left: int | None = None) -> str:
    """The instruction that the agent carries out now, as Markdown; `left` requests remain where they are counted."""
    mode = "Sub-task, from an assistant" if step.mode is Mode.SUB else "Main task"
    if isinstance(step.action, Ask):
        return f"**{mode}**\n\n> {detokenized(step.instruction)}\n\n**The agent asks for help.**"
    helpers = "\n\n*Somebody is near who can be asked.*" if step.can_ask else ""
    if left is not None:
        helpers = f"\n\n*{left} request{'s' * (left != 1)} left.*"
    return f"**{mode}**\n\n> {detokenized(step.instruction)}{helpers}"


def event_text(world: World, step: Step) -> str:
    """One line of the event log."""
    room = world.graph.room_of_node[step.pose.node].replace("_", " ")
    if isinstance(step.action, Move):
        to = world.graph.room_of_node[step.next_pose.node].replace("_", " ")
        return f"goes on in the {room}" if to == room else f"goes from the {room} to the {to}"
    if isinstance(step.action, Stop):
        return f"stops in the {room}"
    if isinstance(step.action, Open | Close):
        return f"{type(step.action).__name__.lower()}s a door in the {room}"
    return f"asks in the {room}: {question_of(step.action)}"


def camera_axes(yaw: float, pitch: float) -> np.ndarray:
    """(3, 3) with the camera's right (x), down (y) and forward (z) axes as columns, in the world's frame."""
    camera = camera_at((0, 0, 0), yaw, pitch)
    return np.stack([camera.right, -np.array(camera.up), camera.forward], axis=1)


def encoded(rgb: np.ndarray) -> rr.EncodedImage:
    """An RGB picture as JPEG."""
    return rr.EncodedImage(contents=jpeg(rgb, RECORDED_QUALITY), media_type="image/jpeg")
