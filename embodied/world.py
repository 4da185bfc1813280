"""World: a house with its navigation graph and what is seen from every node, drawn when asked and kept on disk."""

from __future__ import annotations

import dataclasses
import functools
import logging
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
from tqdm import tqdm

from embodied import gl
from embodied.assets.cache import default_cache, digest
from embodied.assets.catalogue import Catalogue, load_catalogue
from embodied.assets.closure import code_digest
from embodied.assets.decoding import load_record, save_record
from embodied.house.contents import stocked
from embodied.house.house import HINGED, House, Opening
from embodied.house.moment import WIDEST, Moment, RigidPose, apart
from embodied.house.validation import load_lit_house
from embodied.interface import Sighting
from embodied.navigation.floor_ways import FreePoses
from embodied.navigation.free_space import closed_doors
from embodied.navigation.graph import NavGraph, build_graph
from embodied.people.day import Day, day_of, lived_in, seconds_of
from embodied.people.strolls import noticing
from embodied.records import differences
from embodied.render.camera import View
from embodied.render.classic import Renderer
from embodied.render.panorama import VFOV36, Panorama
from embodied.render.panorama_file import PanoramaFile, PanoramaFileError, write_panoramas
from embodied.render.pictures import Baked, PictureSettings, Traced, Unlit, parse_pictures, recorded
from embodied.render.sightings import FACE, SightingTable, sightings_table
from embodied.scene.house_meshes import Part, house_parts, instance_classes, owners
from embodied.scene.lit_pages import LitPages

if TYPE_CHECKING:
    import mujoco

    from embodied.light import Bake
    from embodied.light.moving import MovingHouse
    from embodied.light.tracing.reference import Tracer
    from embodied.render.gloss import Gloss

PANORAMAS_KEPT = 8
"""Decoded panoramas held in memory; one of 512 pixels takes 18 MB."""
STATES_KEPT = 4
"""Worlds with other doors closed that are held open, each with a renderer once it is drawn."""
SLACK = 0.05
"""Metres (and three times as many radians) that a body goes until its light is computed anew."""
SETTLED = 0.01
"""Metres, and share of an openness, that physics may shift what stands still without its being drawn anew."""
log = logging.getLogger(__name__)


class World:
    """Owns, while open, a renderer (made on first need) and the panorama file (where there is one).

    Examples:
      >>> view = world.camera((2.0, 3.0, 1.5), yaw=0.5, size=(120, 160))
      >>> view.rgb.shape, view.depth.shape
      ((120, 160, 3), (120, 160))
      >>> classes = {world.classes[i] for i in set(view.ids.flat)}
      >>> objects = [s.object_class for s in world.sightings(0)]
    """

    def __init__(
        self,
        house: House,
        catalogue: Catalogue,
        graph: NavGraph,
        cache: Path,
        pictures: PictureSettings = Unlit(),
        *,
        file: Path | None = None,
        ignore_fields: Collection[str] = (),
    ) -> None:
        """See `open_world`.

        Args:
          file: where the panoramas go, or lie, instead of the cache.
          ignore_fields: fields of `fingerprint` in which panoramas in `file` may differ from those that would be drawn
            here and now: a data set is read with other drivers ('renderer') and later versions ('code') than drew it.
            With 'renderer' among them, stored ones are read without OpenGL.
        """
        self.house, self.catalogue, self.graph, self.cache = house, catalogue, graph, Path(cache)
        self.pictures = pictures
        self._path, self._ignore_fields = file, frozenset(ignore_fields)
        self._renderer: Renderer | None = None
        self._tracer: Tracer | None = None
        self._file: PanoramaFile | None = None
        self._bake: Bake | None = None
        self._refused = False
        self._moments = [Moment()]
        self._moving: MovingHouse | None = None
        self._bodies: dict[str, tuple[Part, ...]] = {}
        self._followed: mujoco.MjModel | None = None
        self._lender: World | None = None
        self._alone = False
        self._watcher: Renderer | None = None
        self._states: dict[tuple[tuple[str, float], ...], Self] = {}
        self._let_in = set[str]()
        self._lamps: tuple[tuple[bool, ...], Mapping[str, str]] = (), {}
        self._lit_for: tuple[set[str], Mapping[str, bool]] = set(), {}
        self._recent = functools.lru_cache(maxsize=PANORAMAS_KEPT)(self._load)

    @property
    def moment(self) -> Moment:
        """Differences from the house at rest, as of now."""
        return self._moments[-1]

    def move(self, thing: str, position: Sequence[float] | np.ndarray, yaw: float | None = None) -> None:
        """Put a thing and all that stands on it elsewhere; `undo` takes it back.

        Args:
          thing: placement id, 'chair_2'.
          position: (x, y, z) of the middle of its base, metres, world.
          yaw: radians; as it is without.

        Raises:
          ValueError: the house has no such thing, or the pose is not finite.
        """
        known = self.moment.moved.get(thing) or self.house.placement_by_id.get(thing)
        x, y, z = (float(c) for c in position)
        pose = RigidPose.upright((x, y, z), known.yaw if yaw is None and known is not None else float(yaw or 0.0))
        self._next(moved={**self.moment.moved, thing: pose})

    def open(self, name: str, openness: float = 1.0) -> None:
        """Open a door, drawer or lid so far, 0 (closed) to 1 (of doors, a right angle); `undo` takes it back.

        Args:
          name: opening id, 'door_1', or placement id and part, 'wardrobe_1/left_door'; `openable` has all of these.

        Raises:
          ValueError: the house has nothing of this name that opens, or it cannot be open so far.
        """
        self._next(openness={**self.moment.openness, name: float(openness)})

    @functools.cached_property
    def openable(self) -> tuple[str, ...]:
        """Names of all that `open` takes."""
        doors = (o.id for o in self.house.openings if o.opens)
        furniture = ((p.id, apart(self.catalogue.mesh, p)) for p in self.house.placements)
        return (*doors, *(f"{thing}/{m.name}" for thing, whole in furniture if whole for m in whole.moving))

    def switch(self, lamp: str, on: bool) -> None:
        """Turn a lamp on or off; `undo` takes it back. The house is lit once more where it never had these lamps on.

        Args:
          lamp: id of a light, or of the placement whose lights are all meant.

        Raises:
          ValueError: the house has no such lamp.
        """
        lights = [x.id for x in self.house.lights if lamp in (x.id, x.placement)]
        self._next(lamps={**self.moment.lamps, **dict.fromkeys(lights or [lamp], bool(on))})

    def _next(self, **changed: Mapping[str, object]) -> None:
        """Show the moment with these fields changed, and keep the one before for `undo`."""
        before = self.moment
        self.show(dataclasses.replace(before, **changed))  # type: ignore[arg-type]
        self._moments.insert(-1, before)

    def undo(self) -> None:
        """Go back to the moment before the last `move`, `open` or `switch`; nothing where there was none."""
        if len(self._moments) > 1:
            self._moments.pop()
            self._bring_up_to_date()

    def add(self, name: str, parts: Sequence[Part]) -> None:
        """Tell of a body that is no part of the house, such as a link of a robot: its parts, in its own frame. It is
        drawn where `Moment.bodies` has it, in lit pictures, and needs a name that nothing in the house has."""
        if name in self.owners or self.pictures.quality is None:
            raise ValueError(f"body {name!r} needs a name of its own, and lit pictures: unlit ones show no bodies")
        self._bodies[name] = tuple(dataclasses.replace(p, owner=name) for p in parts)

    def follow(self, model: mujoco.MjModel, data: mujoco.MjData, *, slack: float = SLACK, shadows: bool = True) -> None:
        """Show the bodies of a MuJoCo model as they are now: a robot that was attached to the house's own model, or one
        alone. Call it again after the physics; bodies named as placements of the house move these, and doors on hinges
        the house's doors, once they are SETTLED away from where they were shown; `slack` as of `show`; without
        `shadows` the robot takes light and hides none, which takes less time."""
        import mujoco  # late, as these: they read meshes by trimesh

        from embodied.scene.bodies import body_name, body_parts, body_poses
        from embodied.scene.doors import is_of_house, openness

        before, things = self.moment, self.house.placement_by_id
        if self._followed is not model:
            own = {body_name(model, b) for b in range(1, model.nbody) if is_of_house(model, b, self.house)}
            for name, parts in body_parts(model, self.cache / "bodies").items():
                if name not in own:
                    self.add(name, parts)
            rest = mujoco.MjData(model)
            mujoco.mj_forward(model, rest)
            free = sorted({model.body(b).name for b in model.jnt_bodyid[model.jnt_type == 0]} & {*things})
            self._followed, self._resting = model, (openness(model, rest), body_poses(model, rest, things), free)
            self._last: tuple[Mapping[str, RigidPose], Mapping[str, RigidPose]] = {}, {}
        shut, rests, free = self._resting
        poses = body_poses(model, data, (*self._bodies, *free))
        bodies = {name: pose for name, pose in poses.items() if name in self._bodies}
        last, known = self._last
        anew = [i for i in free if before.moved is not known or poses[i] != last.get(i)]  # most things sleep
        moved = {**before.moved}
        moved |= {i: poses[i] for i in anew if poses[i].apart(before.moved.get(i, rests[i])) > SETTLED}
        self._last = poses, moved
        ways = openness(model, data)
        opened = {i: x for i, x in ways.items() if abs(x - before.openness.get(i, shut[i])) > SETTLED}
        now = {"moved": moved, "openness": {**before.openness, **opened}, "bodies": bodies}
        self._moments[-1] = dataclasses.replace(before, **now)  # type: ignore[arg-type]
        self._bring_up_to_date(slack, shadows)

    def show(self, moment: Moment, *, slack: float = 0.0) -> None:
        """Bring the house to a moment, in all that is drawn from now on.

        Args:
          slack: metres, and thrice as many radians, that something may move until its light is computed anew.

        Raises:
          ValueError: the moment is not of this house, or cannot be drawn: by rays, or furniture lit, moved and open.
        """
        moment.check(self.house)
        parts = {n for n in moment.openness if "/" in n}
        if unknown := sorted(parts - {*self.openable} if parts else ()):
            raise ValueError(f"{self.house.name!r} has nothing called {unknown} that opens; World.openable names all")
        if unknown := sorted(set(moment.bodies) - set(self._bodies)):
            raise ValueError(f"bodies {unknown} are unknown; tell of them by World.add first")
        if moment.people and self.pictures.quality is None:
            raise ValueError("people move in lit pictures only; open the world with pictures='fast'")
        if isinstance(self.pictures, Traced):
            raise ValueError("ray-traced pictures show a house at rest: open a world of moment.applied(house)")
        before, self._moments[-1] = self.moment, moment
        try:
            self._bring_up_to_date(slack)
        except ValueError:
            self._moments[-1] = before
            raise

    def at(self, time: str | float, *, seed: int = 0) -> World:
        """The same house at another hour: a world of its own, with light of its own; at a time of day, '18:30', with
        those who live there, where their day has them (in lit pictures).

        Args:
          time: local solar time, '18:30', or hours in [0, 24) for the house at rest.
          seed: of the day.
        """
        hour = seconds_of(time) / 3600 if isinstance(time, str) else time
        if not 0 <= hour < 24:
            raise ValueError(f"hour should lie in [0, 24), got {time}")
        house = dataclasses.replace(self.house, sky=dataclasses.replace(self.house.sky, hour=hour))
        world = World(house, self.catalogue, self.graph, self.cache, self.pictures)
        if isinstance(time, str):
            world.show(day_of(house, self.catalogue, seed=seed).at(time))
        return world

    def with_doors(self, openness: Mapping[str, float]) -> Self:
        """The house with some doors, windows or parts of furniture opened or closed, otherwise at rest: a world of its
        own, in the same light, which this one keeps and closes; itself without any.

        Args:
          openness: as Moment.openness.

        Raises:
          ValueError: as `show`.
        """
        state = tuple(sorted(openness.items()))
        if not state:
            return self
        if state not in self._states:
            moment = Moment(openness=dict(state))
            now = moment.applied(self.house)
            graph = dataclasses.replace(self.graph, closed=closed_doors(now))
            made_of = self.catalogue, graph, self.cache, self.pictures
            if self.pictures.quality is None:
                world = type(self)(stocked(now, self.catalogue), *made_of)
                if {*openness} <= {o.id for o in self.house.openings if o.kind in HINGED}:
                    world._lender = self
                else:
                    world._alone = True
            else:
                world = type(self)(self.house, *made_of)
                world._bake = self.baked()
                world.show(moment)
            self._states[state] = world
            if len(self._states) > STATES_KEPT:
                self._states.pop(next(iter(self._states))).close()
        return self._states[state]

    def living(self, when: tuple[float, int] | None, openness: Mapping[str, float]) -> World:
        """The house without its figures, and, in lit pictures, with those who live there: a world that this one keeps
        and closes.

        Args:
          when: the second of their day, and the node whose viewer they look at if near; None shows nobody.
          openness: of doors that are not at rest, as Moment.openness.
        """
        rest, world = self._homes
        rest = rest.with_doors(openness)
        if when is None or self.pictures.quality is None:
            return rest
        now = noticing(self._day.at(when[0]), self.graph.positions[when[1]], rest.house)
        now = dataclasses.replace(now, openness={**openness, **now.openness})
        world._bake = rest.baked()
        if {*world.moment.openness} != {*now.openness}:
            world.show(Moment())  # leaves that have moved never get their light as baked again
        if world._moving is None:
            everybody = self._day.at(0.0)  # ids do not depend on who is seen first
            world.show(dataclasses.replace(everybody, openness=now.openness))
        world.show(now)
        return world

    @functools.cached_property
    def _homes(self) -> tuple[World, World]:
        """The house without its figures: at rest, and as its people have it."""
        made_of = lived_in(self.house), self.catalogue, self.graph, self.cache, self.pictures
        return World(*made_of), World(*made_of)

    @functools.cached_property
    def _day(self) -> Day:
        return day_of(self._homes[0].house, self.catalogue, seed=0)

    def _bring_up_to_date(self, slack: float = 0.0, shadows: bool = True) -> None:
        """Draw the moment from now on."""
        self._recent.cache_clear()
        for name in ("_poses", "parts", "shown", "owners", "_classes"):
            self.__dict__.pop(name, None)
        if self.pictures.quality is None or self.moment.is_rest:
            if self._renderer is not None:
                self._renderer.close()
            self._renderer = self._moving = None
            return
        open_now = self._open_outwards()
        if self._moving is not None and self._let_in - open_now:  # the light that came in is not taken away again
            self.renderer.close()
            self._renderer = self._moving = None
        self._let_in = open_now
        renderer = self.renderer
        fresh = self._light_for_moment()
        moving = self._moving
        assert moving is not None  # made by the line above
        for name, parts in self._bodies.items():
            moving.add(name, parts)
        shut = {o.id for o in self._outer_doors} - open_now
        openness = {d: x for d, x in self.moment.openness.items() if d not in shut}
        now = dataclasses.replace(self.moment, openness=openness)
        anew = fresh or moving.needs(now)
        drawn = moving.show(now, slack=slack, shadows=shadows)
        patches = [(p.page, p.row, p.column, p.picture) for p in drawn.patches]
        if anew:
            overlay = gloss_of(moving.bake, moving=moving) if _reflects(self.pictures) else None
            renderer.replace(moving.lit, moving.moving, self.drawn, overlay)
        renderer.change(drawn.corners, patches)

    @property
    def _outer_doors(self) -> list[Opening]:
        return [o for o in self.house.openings if o.rooms[1] is None and o.kind in HINGED]

    def _open_outwards(self) -> set[str]:
        """Outer doors that are not as the house at rest has them."""
        ways = self.moment.openness
        return {o.id for o in self._outer_doors if abs(ways.get(o.id, o.angle / WIDEST) * WIDEST - o.angle) > 1e-6}

    def _light_for_moment(self) -> bool:
        """Make what moves anew where other lamps are on, or carried, than before; True where that was so."""
        from embodied.light import bake  # late: these load the path tracer
        from embodied.light.gather import carried_lamps
        from embodied.light.moving import MovingHouse

        moved = {*self.moment.moved}, self.moment.lamps
        if self._moving is not None and moved == self._lit_for:
            return False
        carriers = carried_lamps(self.house, self.moment)
        self._lit_for = moved
        lamps = tuple(x.on for x in self.moment.switched(self.house).lights), carriers
        if self._moving is not None and lamps == self._lamps:
            return False
        self._lamps = lamps
        lit = self.moment.switched(self.house)
        house, quality = (self.house if lit == self.house else lit), self.pictures.quality or "normal"
        light = self.baked() if house is self.house else bake(house, self.catalogue, self.cache, quality)
        off = Moment(lamps={**self.moment.lamps, **dict.fromkeys(carriers, False)}).switched(self.house)
        dark = bake(off, self.catalogue, self.cache, quality) if carriers else None
        self._moving = MovingHouse(light, house, self.catalogue, self.cache, carriers=carriers, dark=dark)
        return True

    def __reduce__(self) -> tuple[Callable[[], World], tuple[()]]:
        """Pickled as what it was made of; nothing is open in the process that reads it."""
        made_of = self.house, self.catalogue, self.graph, self.cache, self.pictures
        return functools.partial(World, *made_of, file=self._path, ignore_fields=self._ignore_fields), ()

    def __deepcopy__(self, memo: object) -> World:
        """Copies of an environment share its houses."""
        return self

    @property
    def name(self) -> str:
        return self.house.name

    @functools.cached_property
    def shown(self) -> House:
        """The house as it is now, with what lies in furniture that was opened."""
        return self.house if self.moment.is_rest else stocked(self.moment.applied(self.house), self.catalogue)

    @functools.cached_property
    def parts(self) -> tuple[Part, ...]:
        """Everything visible in the house as it is now, as meshes."""
        return house_parts(self.shown, self.catalogue)

    @functools.cached_property
    def owners(self) -> tuple[str, ...]:
        """Instance id i + 1 belongs to owners[i]; where things lie in open furniture, the ids after theirs differ."""
        return owners(self.house if self.pictures.quality else self.shown)

    @property
    def drawn(self) -> tuple[str, ...]:
        """The owners, and what else is drawn now: instance id i + 1 is that of drawn[i]."""
        m = self._moving
        return (*self.owners, *self._bodies, *(() if m is None else (*m.people, *m.contents)))

    @property
    def classes(self) -> tuple[str, ...]:
        """The class of each instance id: `world.classes[view.ids[y, x]]` is what a pixel shows."""
        m = self._moving
        moving = () if m is None else (*("person" for _ in m.people), *m.contents.values())
        return (*self._classes, *("body" for _ in self._bodies), *moving)

    @functools.cached_property
    def _classes(self) -> tuple[str, ...]:
        return instance_classes(self.house if self.pictures.quality else self.shown)

    @functools.cached_property
    def _poses(self) -> FreePoses:
        return FreePoses(self.moment.applied(self.house), self.graph)

    def is_free(self, position: Sequence[float] | np.ndarray) -> bool:
        """True where the agent can stand at (x, y) of the ground floor, or at (x, y, z) of the storey that z is in."""
        return self._poses.is_free(position)

    def random_pose(self, *, rng: np.random.Generator) -> tuple[np.ndarray, float]:
        """(3,) of an eye, metres, and yaw, radians, drawn evenly over the floor where the agent can stand:
        `world.renderer.view(*world.random_pose(rng=rng))` is a picture from there."""
        return self._poses.draw(rng=rng)

    @functools.cached_property
    def _origin(self) -> dict[str, object]:
        """Facts that the world's geometry depends on."""
        return {
            "house": self.house.digest,
            "nodes": digest(self.graph.positions.tolist()),
            "own": self.catalogue.own_digests(p.asset for p in self.house.placements),
        }

    @functools.cached_property
    def _made_of(self) -> dict[str, object]:
        """All that the panoramas depend on but what draws them."""
        return self._origin | recorded(self.pictures) | {"code": code_digest(*makers(self.pictures))}

    @functools.cached_property
    def fingerprint(self) -> dict[str, object]:
        """All that the panoramas depend on, and what draws them, or drew those that are stored where that may differ.
        Opens OpenGL only where nothing is stored."""
        stored = self._open_file() if "renderer" in self._ignore_fields and self._path is not None else None
        return self._made_of | {"renderer": str(gl.info()) if stored is None else stored.meta.get("renderer")}

    @functools.cached_property
    def path(self) -> Path:
        """File of the panoramas of this world, there or not."""
        return self._path or self.cached_path

    @functools.cached_property
    def cached_path(self) -> Path:
        """File in which the cache keeps panoramas of this very world, whoever had them drawn."""
        return self.cache / "panoramas" / f"{digest(self.fingerprint)[:32]}.pano"

    @property
    def lit(self) -> LitPages | None:
        """The house as it is now with its light painted on; None where it is not lit. Bakes on first use."""
        if self.pictures.quality is None:
            return None
        return self.baked().lit if self._moving is None else self._moving.as_shown()

    def darkness(self, position: Sequence[float] | np.ndarray) -> float:
        """How much darker than one where white paper has 100 cd/m2 the room at `position` is, by its exposure; 1 where
        the house is not lit."""
        if self.pictures.quality is None:
            return 1.0
        shown = self.baked() if self._moving is None else self._moving.bake
        return float(shown.exposure.at(np.asarray(position, float)[None]).mean())

    @property
    def renderer(self) -> Renderer:
        """The renderer of this world, for pictures from anywhere; opened on first use."""
        if self._lender is not None:
            shared = self._lender.renderer
            shared.turn(self.house)
            return shared
        if self._renderer is None:
            overlay = gloss_of(self.baked()) if _reflects(self.pictures) else None
            house = self.house if self.pictures.quality else self.shown
            lit = self.baked().lit if self.pictures.quality else None
            self._renderer = Renderer(house, self.catalogue, size=self.pictures.size, lit=lit, overlay=overlay)
            self._drawn = house
        if self.pictures.quality is None:
            self._renderer.turn(self._drawn)  # another world may have turned its doors
        return self._renderer

    def baked(self, progress: bool = False) -> Bake:
        """The light of this world, baked on first use.

        Args:
          progress: show a progress bar.
        """
        if self._bake is None:
            from embodied import light  # late: loads the path tracer

            name = self.pictures.quality or "normal"
            stages: list[str] = []
            with light.progress_bar(shown=progress) as show:

                def tell(stage: str, done: float) -> None:
                    if stage not in stages:
                        stages.append(stage)
                        log.info("lighting %s: %s", self.name, stage)
                    show(stage, done)

                self._bake = light.bake(self.house, self.catalogue, self.cache, name, progress=tell)
        return self._bake

    def _source(self, progress: bool = False) -> Renderer | Tracer:
        """Source of the panoramas; what it needs is made first, with progress bars if wanted."""
        p = self.pictures
        if p.quality is not None:
            self.baked(progress)
        if not isinstance(p, Traced):
            return self.renderer
        if self._tracer is None:
            from embodied.light.tracing.reference import Tracer  # late: loads the path tracer

            quality = "reference" if p.reference else "glossy"
            self._tracer = Tracer(self.baked(), self.house, quality=quality, size=p.size, rays=p.rays)
        return self._tracer

    def panorama(self, node: int) -> Panorama:
        """The panorama of a node: from the file where it is there, else drawn now."""
        if not 0 <= node < len(self.graph.positions):
            raise IndexError(f"world {self.name!r} has the nodes 0 to {len(self.graph.positions) - 1}, not {node}")
        return self._recent(node)

    def camera(
        self,
        position: Sequence[float] | np.ndarray,
        yaw: float,
        pitch: float = 0.0,
        vfov: float = VFOV36,
        size: tuple[int, int] = (480, 640),
    ) -> View:
        """View of a camera anywhere, drawn now: rgb, depth and ids.

        Args:
          position: (x, y, z) metres, world.
          yaw, pitch: radians, counter-clockwise from +x and up.
          vfov: vertical field of view, radians.
          size: (height, width), pixels.

        Raises:
          ValueError: the world was opened without pictures.
        """
        return self.renderer.view(position, yaw, pitch, vfov, size)

    def sightings(self, node: int) -> tuple[Sighting, ...]:
        """The objects that can be seen from a node, the largest in view first. Needs no panoramas."""
        if self._alone and self._watcher is None:
            self._watcher = Renderer(self.house, self.catalogue, size=FACE, colours=False)
        if self._watcher is None and self._lender is None and self.moment.is_rest:
            return self._sightings.at(node, self.house)
        now, renderer = self.shown if self.moment.open_parts(self.house) else self.house, self._watcher or self.renderer
        depth, ids = renderer.seen(self.graph.positions[node], FACE)
        number = {p.id: k + 1 for k, p in enumerate(now.placements)}
        numbers = np.array([0, *(number.get(name, 0) for name in renderer.owners)], np.int32)
        return sightings_table([(depth, numbers[ids])], len(number)).at(0, now)

    def render_all(self, progress: bool = False) -> Path:
        """Draw the panoramas of all nodes into the file, unless a whole one is there; returns its path."""
        file = self._open_file()
        if file is not None and (damaged := file.damaged()):
            log.warning("%s: %s of its pictures are damaged; drawing again", self.path, len(damaged))
            file.close()
            file, self._file, self._refused = None, None, True
        if file is None:
            self.__dict__.pop("fingerprint", None)  # what was stored may have been drawn by others
            write_panoramas(self.path, self._draw_all(progress), self.fingerprint)
            self._refused = False
            self._recent.cache_clear()
        return self.path

    def close(self) -> None:
        """Free the renderer and the file; a later use opens them again."""
        for renderer in (self._renderer, self._watcher):
            if renderer is not None:
                renderer.close()
        self._renderer = self._watcher = self._tracer = self._moving = None
        self._moments = [Moment()]
        self.close_states()
        if self._file is not None:
            self._file.close()
            self._file = None
        self._recent.cache_clear()

    def close_states(self) -> None:
        """Free what draws the house in other states than this: with other doors, or among who lives there."""
        for world in (*self._states.values(), *self.__dict__.pop("_homes", ())):
            world.close()
        self._states = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _load(self, node: int) -> Panorama:
        file = self._open_file() if self.moment.is_rest else None
        return self._source().panorama(self.graph.positions[node]) if file is None else file.read(node)

    def _draw_all(self, progress: bool) -> Iterator[Panorama]:
        source = self._source(progress)
        for position in tqdm(self.graph.positions, "panoramas", disable=not progress, unit="node"):
            yield source.panorama(position)

    def _open_file(self) -> PanoramaFile | None:
        """The panorama file, if it is whole and of this very world."""
        if self._file is None and not self._refused and self.path.exists():
            self._refused = True
            try:
                file = PanoramaFile(self.path)
            except PanoramaFileError as e:
                log.warning("%s", e)
                return None
            wanted = self._made_of if "renderer" in self._ignore_fields else self.fingerprint
            if others := differences(file.meta, wanted, self._ignore_fields):
                log.warning("%s holds other pictures (%s); drawing again", self.path, ", ".join(others))
                file.close()
                return None
            self._file, self._refused = file, False
        return self._file

    @functools.cached_property
    def _sightings(self) -> SightingTable:
        code = code_digest(*makers(Unlit()), "embodied.render.sightings")
        path = self.cache / "sightings" / f"{digest(self._origin, code)[:32]}.npz"
        table = load_record(SightingTable, path)
        if table is None:
            table = sightings_table(self._seen_from_nodes(), len(self.house.placements))
            save_record(table, path)
        return table

    def _seen_from_nodes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Depth and ids of the cube faces of FACE pixels around every node."""
        positions = self.graph.positions
        if not gl.available():
            from embodied.render.geoms import RayCaster  # late: compiles the house

            log.warning("no OpenGL here: rays find what is seen in %s, a second a viewpoint", self.name)
            caster = RayCaster(self.house, self.catalogue)
            return [caster.seen(p, FACE) for p in positions]
        with Renderer(self.house, self.catalogue, size=FACE, colours=False) as renderer:
            return [renderer.seen(p, FACE) for p in positions]


def open_world(
    house: House,
    catalogue: Catalogue | None = None,
    cache: Path | None = None,
    pictures: PictureSettings | str = Unlit(),
    *,
    graph: NavGraph | None = None,
    size: int | None = None,
) -> World:
    """A world over `house`; nothing is drawn until asked for.

    Args:
      catalogue: where meshes and materials come from; the shipped one where not given.
      cache: folder for what is expensive, which may be deleted at any time; the user's cache folder where not given.
      pictures: how the house is drawn: "unlit", "fast", "normal", "fast-matte", ..., one of
        embodied.render.pictures.PICTURES, or Unlit, Baked or Traced.
      graph: the navigation graph; built when not given.
      size: side of a cube face, pixels, instead of that of `pictures`.

    Examples:
      >>> world = embodied.open_world(house, size=64)  # pictures='fast' lights it first
      >>> world.panorama(0).rgb.shape
      (6, 64, 64, 3)
    """
    graph, cache = graph or build_graph(house), cache or default_cache()
    return World(house, catalogue or load_catalogue(cache), graph, cache, parse_pictures(pictures, size))


def scene_spec(
    house: House | World,
    pictures: PictureSettings | str | None = "fast",
    *,
    catalogue: Catalogue | None = None,
    cache: Path | None = None,
) -> mujoco.MjSpec:
    """A house as an MjSpec to which robots are added (`place`): doors, drawers and lids move, and so does what a hand
    can take.

    Args:
      house: or its world, whose pictures these are then.
      pictures: as of `open_world`; lit first where they are lit. None for what touches alone, which is drawn by
        `World.follow`.

    Examples:
      >>> model = embodied.scene_spec(house, pictures=None).compile()
    """
    from embodied.scene import model, robots  # late: compilers of MuJoCo

    world = house if isinstance(house, World) else open_world(house, catalogue, cache, pictures or Unlit())
    free, lit = model.takeable(world.house, world.catalogue), world.lit if pictures else None
    parts = None if pictures else ()
    spec = model.build_spec(world.house, world.catalogue, free=free, lit=lit, hinged=True, parts=parts)
    spec.add_text(name=robots.HOUSE, data=world.house.to_json())
    return spec


def open_folder(
    folder: Path,
    catalogue: Catalogue | None = None,
    cache: Path | None = None,
    pictures: PictureSettings | str = Unlit(),
    *,
    size: int | None = None,
) -> World:
    """The world of a folder that `embodied house` wrote, as `embodied light` lit it; its panoramas go to panoramas.pano
    there.

    Args:
      catalogue, cache, pictures, size: as in `open_world`.

    Examples:
      >>> with embodied.open_folder(Path('.')) as stored:  # where house.json is
      ...     stored.house == house
      True
    """
    folder, cache = Path(folder), cache or default_cache()
    catalogue = catalogue or load_catalogue(cache)
    house = load_lit_house(folder, catalogue)
    graph, pictures = build_graph(house), parse_pictures(pictures, size)
    file = folder / "panoramas.pano"
    return World(house, catalogue, graph, cache, pictures, file=file, ignore_fields=("renderer",))


def gloss_of(bake: Bake, *, detail: bool = True, moving: MovingHouse | None = None) -> Gloss:
    """Overlay of a baked house's reflections over its pictures, and, unless told otherwise, what matter shows from
    nearby.

    Args:
      moving: the house as it is with what moves in it.
    """
    from embodied.light.tracing.rays import (
        gloss_data_of,  # late: loads the path tracer
        rays_among,
    )
    from embodied.render.gloss import Gloss

    if moving is not None:
        return Gloss(moving.lit, moving.gloss, rays_among, moving.moving)
    data = gloss_data_of(bake)
    return Gloss(bake.lit, data if detail else dataclasses.replace(data, detail=()), rays_among)


def makers(pictures: PictureSettings) -> tuple[str, ...]:
    """Modules that draw and keep such pictures; cached pictures made by other code than theirs are not used."""
    modules = ["embodied.assets.catalogue", "embodied.render.classic", "embodied.render.panorama_file"]
    if pictures.quality is not None:
        modules.append("embodied.light.baking.house")
    if _reflects(pictures):
        modules += ["embodied.render.gloss", "embodied.light.tracing.rays"]
    if isinstance(pictures, Traced):
        modules.append("embodied.light.tracing.reference")
    return tuple(modules)


def _reflects(pictures: PictureSettings) -> bool:
    return isinstance(pictures, Baked) and pictures.gloss
