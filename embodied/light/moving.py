"""A baked house in which things move: what is drawn of it at a moment.

What has moved away from where it was baked is left out of the house and drawn as a thing of its own, with light from
the probes; `moving_pages` has what becomes of the house's own pages.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from embodied.assets.catalogue import Catalogue
from embodied.assets.moving_parts import TakenApart, closed, openness_of
from embodied.assets.people import people
from embodied.house.contents import STORED, contents
from embodied.house.house import House, Opening
from embodied.house.moment import WIDEST, Moment, RigidPose, apart
from embodied.house.shapes import room_at
from embodied.light.movers import Placed, Surface, SurfacePage, shading, surface_of
from embodied.light.moving_pages import BODIES, HousePages, Patch
from embodied.light.pages.files import Bake
from embodied.light.pages.tone import displayed
from embodied.light.probes import turned
from embodied.light.settings import LightSettings
from embodied.light.skins import Skin, person_parts
from embodied.light.tracing.rays import gloss_data_of
from embodied.render.gloss import GlossData, texels_at
from embodied.scene.cupboards import lit_apart
from embodied.scene.house_meshes import object_parts
from embodied.scene.joinery import FIXED_FRAME, opening_parts
from embodied.scene.lit_pages import ANYWHERE, LitMesh, LitPages
from embodied.scene.part import Part

BODY_LUXELS = 0.25
"""Luxels of a body, of those of a piece of furniture: robots have many."""
PEOPLE_SLACK = 2.0
"""How much farther than other things people move until their light is computed anew."""
INSIDE_NAME = "/"
"""End of the name of the inside of a thing that is open; before the name of a part of it stands the same."""
BEFORE = 0.15
"""Metres before the front of a thing from which its inside has its light."""
AWAY = RigidPose((0.0, 0.0, -1e3))
"""Pose of a body that the moment does not have."""


@dataclass(frozen=True, eq=False)
class SceneChange:
    """Changes of what is drawn, by a moment."""

    corners: Mapping[int, np.ndarray]
    """By number of mesh in `MovingHouse.lit`: (n, 3) float32 where its vertices are."""
    patches: tuple[Patch, ...]


class MovingHouse:
    """Owns what has moved so far, its surfaces, and the light of the pages that changed."""

    def __init__(
        self,
        bake: Bake,
        house: House,
        catalogue: Catalogue,
        cache: Path,
        *,
        carriers: Mapping[str, str] = {},
        dark: Bake | None = None,
    ) -> None:
        """
        Args:
          cache: the folder that everything expensive is kept in.
          carriers: what carries a lamp that is on, by light id (embodied.light.gather.carried_lamps).
          dark: the house with these lamps off, where there are any.
        """
        self.bake, self.house, self.catalogue = bake, house, catalogue
        self.pages = HousePages(bake, house, carriers, dark)
        self._cache = Path(cache) / "light"
        self._settings = LightSettings(**bake.manifest["settings"])
        self._things: dict[str, _Thing] = {}
        self._placed: dict[str, Placed] = {}
        self._shown_things: dict[str, np.ndarray] = {}
        self._drawn_at: dict[str, RigidPose] = {}
        self._extra: dict[str, tuple[Part, ...]] = {}
        self._skins: dict[str, Skin] = {}
        self._bent: dict[str, list[np.ndarray]] = {}
        self._lit_bent: dict[str, np.ndarray] = {}
        poses = lambda o: {name: RigidPose.upright(p.position, p.yaw) for name, p in self._leaf_parts(o)}
        self._leaf_poses = functools.lru_cache(maxsize=64)(poses)
        self.contents: dict[str, str] = {}
        """Classes of what lies in furniture that was opened, by id."""

    def add(self, name: str, parts: Sequence[Part]) -> None:
        """Tell of a body that is no part of the house, in its own frame; it is drawn where `Moment.bodies` says."""
        if name not in self._things:
            self._extra[name] = tuple(dataclasses.replace(p, owner=p.owner or name) for p in parts)

    def needs(self, moment: Moment) -> bool:
        """True where `show` will change which meshes there are, and with them `lit`."""
        return any(name not in self._things for name in self._wanted(moment))

    def _wanted(self, moment: Moment) -> dict[str, RigidPose]:
        """RigidPose of every thing by name: what moved, as a whole with what it carries; leaves of doors; bodies."""
        out = dict(moment.moved)
        for o in self.house.openings:
            if o.id in moment.openness:
                out |= self._leaf_poses(dataclasses.replace(o, angle=moment.openness[o.id] * WIDEST))
        for thing, openness in moment.open_parts(self.house).items():
            placement = self.house.placement_by_id[thing]
            if moment.carrier(self.house, placement) is not None:
                raise ValueError(f"{thing!r} was moved; its doors and drawers open where it stands at rest only")
            whole, rest = self._apart(thing), RigidPose.upright(placement.position, placement.yaw)
            assert whole is not None, "checked by World.show"
            out[thing + INSIDE_NAME] = rest
            for m in whole.moving:
                if m.name in openness:
                    out[f"{thing}/{m.name}"] = rest.then(*m.turn(openness[m.name]), m.top)
        return out | dict(moment.bodies) | {name: figure.place for name, figure in moment.people.items()}

    def _apart(self, thing: str) -> TakenApart | None:
        return apart(self.catalogue.mesh, self.house.placement_by_id[thing])

    def show(self, moment: Moment, *, slack: float = 0.0, shadows: bool = True) -> SceneChange:
        """Bring everything to a moment.

        Args:
          slack: metres, and thrice as many radians, that a thing may have moved since its light was computed, to keep
            it.
          shadows: without, bodies hide no light from the house and send none back.

        Raises:
          ValueError: the moment is none of this house.
        """
        moment.check(self.house)
        wanted = self._wanted(moment)
        new = [name for name in wanted if name not in self._things]
        for name in new:
            self._things[name] = self._thing(name, moment)
        if new:
            self.__dict__.pop("lit", None)
            self._shown_things, self._drawn_at = {}, {}
            self.pages.stand([m for m, _ in self._still])
            for name in new:
                self._take_out(name)
        self._bend(moment, slack)
        surfaces = {name: s for name in wanted if (s := self._things[name].surface) is not None}
        dark = {name: Placed(s, wanted[name], wanted[name], np.zeros((0, 3))) for name, s in surfaces.items()}
        rests = {name: thing.rest for name, thing in self._things.items() if thing.rest is not None}
        shining = self.pages.shine(dark, rests, slack)
        unlit = {}
        for name, thing in self._things.items():
            pose = wanted.get(name, thing.rest)
            if pose is None:
                self._placed.pop(name, None)
            elif thing.surface is not None:
                known = self._placed.get(name)
                new_light = known is None or shining or known.surface is not thing.surface
                is_person = name in self._skins
                if known is None or new_light or (known.lit_at.apart(pose) > slack and not is_person):
                    unlit[name] = thing.surface, pose
                elif known.pose != pose and not is_person:
                    self._placed[name] = Placed(known.surface, pose, known.lit_at, known.e)
        self._placed |= self._lit_at(unlit)
        groups = self._groups()
        if not shadows:
            groups.pop(BODIES, None)
        return SceneChange(self._corners(), (*self._own_patches(), *self.pages.changed(groups, slack)))

    def _bend(self, moment: Moment, slack: float) -> None:
        """Bring people into their poses, and their light along where their skin has moved by more than `slack`."""
        for name, figure in moment.people.items():
            meshes = self._skins[name].meshes(figure.pose)
            self._bent[name] = [figure.place.points(v) for v in meshes]
            at, before = np.concatenate(self._bent[name]), self._lit_bent.get(name)
            if before is None or np.sqrt(((at - before) ** 2).sum(1).mean()) > PEOPLE_SLACK * slack:
                self._lit_bent[name] = at
                surface = self._skins[name].surface(figure.pose, meshes)
                self._things[name] = dataclasses.replace(self._things[name], surface=surface)

    def _thing(self, name: str, moment: Moment) -> _Thing:
        if name in moment.people:
            person = moment.people[name].person
            surface = self._surface([dataclasses.replace(p, owner=name) for p in person_parts(people()[person])])
            assert surface is not None, "people can be seen"
            self._skins[name] = Skin(person, surface)
            return _Thing(surface, None, frozenset())
        if name in self._extra:
            return _Thing(self._surface(self._extra[name]), None, frozenset())
        if "@" in name:
            return self._leaf(name)
        if "/" in name:
            return self._part(*name.split("/"))
        root = self.house.placement_by_id[name]
        carried = [p for p in self.house.placements if moment.carrier(self.house, p) == name]
        rest = RigidPose.upright(root.position, root.yaw)
        some = dataclasses.replace(self.house, placements=tuple(carried))
        parts = [_in_frame(p, rest) for p in object_parts(some, self.catalogue)]
        return _Thing(self._surface(parts), rest, frozenset(p.id for p in carried))

    def _surface(self, parts: Sequence[Part]) -> Surface | None:
        settings = self._settings
        if parts and parts[0].room == "":
            settings = dataclasses.replace(settings, budget=settings.budget * BODY_LUXELS)
        return surface_of(parts, settings, self._cache, self.house, self.pages.lamps)

    def _leaf_parts(self, o: Opening) -> Iterator[tuple[str, Part]]:
        """The parts of an opening that are drawn apart, with names of the things they belong to, by their hinges."""
        for p in opening_parts(self.house, o, self.catalogue.finish, True):
            if p.mesh_key.startswith("leaf/") or p.mesh_key.endswith(FIXED_FRAME):
                yield f"{o.id}@{p.position[0]:.3f} {p.position[1]:.3f}", p

    def _leaf(self, name: str) -> _Thing:
        o = next(x for x in self.house.openings if x.id == name.partition("@")[0])
        parts = [p for leaf, p in self._leaf_parts(o) if leaf == name]
        rest = RigidPose.upright(parts[0].position, parts[0].yaw)
        owners = frozenset(p.owner for p in parts)
        return _Thing(self._surface([_in_frame(p, rest) for p in parts]), rest, owners)

    def _part(self, thing: str, name: str) -> _Thing:
        """A door or drawer of furniture, or its inside, which has no name."""
        p, whole = self.house.placement_by_id[thing], self._apart(thing)
        assert whole is not None, "checked by World.show"
        meshes = whole.parts[name] if name else whole.within
        keys = [f"{p.asset}/{p.size}/{p.params}/{name}#{k}" for k in range(len(meshes))]
        parts = [Part(p.id, "object", p.room, m, k) for m, k in zip(meshes, keys, strict=True)]
        rest = RigidPose.upright(p.position, p.yaw)
        drawers = {f"{STORED}{m.name}": m.name for m in whole.moving if m.slides}
        shut = tuple(dataclasses.replace(q, params=closed(q.params)) for q in self.house.placements)
        inside = contents(dataclasses.replace(self.house, placements=shut), self.catalogue, hidden=True)
        lying = tuple(c for c in inside if c.parent == thing and drawers.get(c.group or "", "") == name)
        self.contents |= {c.id: c.object_class for c in lying}
        some = dataclasses.replace(self.house, placements=lying)
        parts += [_in_frame(x, rest) for x in object_parts(some, self.catalogue)]
        surface = self._surface(parts)
        for m in whole.moving:
            if m.name == name:
                rest = rest.then(*m.turn(openness_of(p.params).get(name, 0.0)), m.top)
        return _Thing(surface, rest, frozenset())

    @property
    def _still(self) -> list[tuple[LitMesh, np.ndarray]]:
        """The house's own meshes without what is drawn apart, and, of each face, the number that it had."""
        away = frozenset().union(*(t.owners for t in self._things.values()))
        open_ = {name.partition("/")[0] for name in self._things if "/" in name}
        whole = lambda m: self._opened(m) if m.owner in open_ else (m, np.arange(len(m.faces)))
        return [(_nothing(m), np.zeros(0, int)) if m.owner in away else whole(m) for m in self.bake.lit.meshes]

    def _opened(self, m: LitMesh) -> tuple[LitMesh, np.ndarray]:
        """A mesh of furniture that is open: cut open, without its inside and the parts that moved."""
        p, whole = self.house.placement_by_id[m.owner], self._apart(m.owner)
        assert whole is not None, "checked by World.show"
        at = RigidPose.upright(p.position, p.yaw)
        still, source, label = lit_apart(m, p, whole)
        parted = [k for k, part in enumerate(whole.moving) if f"{m.owner}/{part.name}" in self._things]
        others = np.flatnonzero((label >= 0) & ~np.isin(label, parted))
        faces = np.concatenate([still.faces, m.faces[others]])
        both = dataclasses.replace(still, vertices=at.points(still.vertices), faces=faces)
        return both, np.concatenate([source, others])

    def _lit_at(self, things: Mapping[str, tuple[Surface, RigidPose]]) -> dict[str, Placed]:
        """Things where they are to be, and the light on them."""
        soft = lambda name, s, pose: self._soft_light(s, pose, name.endswith(INSIDE_NAME))
        lit = {n: soft(n, s, pose) + self.pages.lamplight(s, pose) for n, (s, pose) in things.items()}
        placed = {n: Placed(s, pose, pose, lit[n]) for n, (s, pose) in things.items()}
        if not self.pages.is_sunny or not placed:
            return placed
        every = list(placed.values())
        position = np.concatenate([p.pose.points(p.surface.position) for p in every])
        normal = np.concatenate([p.surface.normal @ p.pose.rotation.T.astype(np.float32) for p in every])
        thin = np.concatenate([p.surface.thin for p in every])
        others = [p for name, p in self._placed.items() if name not in things]
        share = self.pages.sun_share(position, normal, thin, [*others, *every])
        parts = np.split(share, np.cumsum([len(p.e) for p in every])[:-1])
        return {
            name: dataclasses.replace(p, e=p.e + part[:, None] * self.pages.sun)
            for (name, p), part in zip(placed.items(), parts, strict=True)
        }

    def _soft_light(self, s: Surface, pose: RigidPose, is_inside: bool) -> np.ndarray:
        """(n, 3) light of luxels but the sun's own; an inside has it from before its front."""
        local = s.box_corners.copy()
        if is_inside:
            local[:, 1] = local[:, 1].min() - BEFORE
        corners = pose.points(local)
        home = self.pages.room_around(corners.mean(0))
        rooms = [room_at(self.house, c) or home for c in corners]
        if set(rooms) == {home}:
            coefficients = self.pages.radiance(corners, home)
        else:
            coefficients = np.concatenate([self.pages.radiance(c[None], room) for c, room in zip(corners, rooms)])
        return shading(s, turned(coefficients, pose.rotation.T).astype(np.float32))

    def _take_out(self, name: str) -> None:
        """Give pages the light back that a thing hid where it was baked."""
        thing = self._things[name]
        if thing.surface is not None and thing.rest is not None and not name.endswith(INSIDE_NAME):
            others = [placed for other, placed in self._placed.items() if other != name]
            self.pages.take_out(self._lit_at({name: (thing.surface, thing.rest)})[name], others)

    def _groups(self) -> dict[str, list[Placed]]:
        """Things that move together; the insides of furniture hide no more than the whole does."""
        groups: dict[str, list[Placed]] = {}
        for name, placed in self._placed.items():
            if not name.endswith(INSIDE_NAME):
                is_body = self._things[name].rest is None and name not in self._skins
                groups.setdefault(BODIES if is_body else name, []).append(placed)
        return groups

    @functools.cached_property
    def lit(self) -> LitPages:
        """The house without what moved, and all that moved: as it is drawn."""
        meshes = [m for m, _ in self._still]
        pages = list(self.bake.lit.pages)
        for thing in self._things.values():
            if thing.surface is None:
                continue
            for m in thing.surface.meshes:
                meshes.append(dataclasses.replace(m, page=m.page + len(pages), room=ANYWHERE))
            pages += [np.zeros((*p.albedo.shape[:2], 3), np.uint8) for p in thing.surface.pages]
        return LitPages(tuple(meshes), tuple(pages), self.bake.lit.digest, ())

    @property
    def surfaces(self) -> list[Surface]:
        """Of all that moved, in the order of their meshes and pages in `lit`."""
        return [t.surface for t in self._things.values() if t.surface is not None]

    def as_shown(self) -> LitPages:
        """The house as `show` had it last, for what draws or writes it elsewhere."""
        meshes, pages = list(self.lit.meshes), [page.copy() for page in self.lit.pages]
        number, page = len(self.bake.lit.meshes), len(self.bake.lit.pages)
        for name, thing in self._things.items():
            own = thing.surface.meshes if thing.surface is not None else ()
            if (placed := self._placed.get(name)) is not None:
                room = room_at(self.house, np.mean(placed.box, axis=0)) or ANYWHERE
                for k, m in enumerate(own):
                    vertices = placed.pose.points(m.vertices)
                    meshes[number + k] = dataclasses.replace(meshes[number + k], vertices=vertices, room=room)
                for k, painted in enumerate(placed.surface.pages):
                    pages[page + k] = self._own_picture(placed, painted)
            else:
                meshes[number : number + len(own)] = [_nothing(m) for m in meshes[number : number + len(own)]]
            number, page = number + len(own), page + len(thing.surface.pages if thing.surface is not None else ())
        for patch in self.pages.shown:
            h, w = patch.picture.shape[:2]
            pages[patch.page][patch.row : patch.row + h, patch.column : patch.column + w] = patch.picture
        return dataclasses.replace(self.lit, meshes=tuple(m for m in meshes if len(m.faces)), pages=tuple(pages))

    @property
    def people(self) -> tuple[str, ...]:
        """Names of those who have been in the house so far."""
        return tuple(self._skins)

    @property
    def moving(self) -> range:
        """Numbers in `lit` of the meshes that move."""
        return range(len(self.bake.lit.meshes), len(self.lit.meshes))

    @functools.cached_property
    def _gloss_at_rest(self) -> GlossData:
        return gloss_data_of(self.bake)

    @property
    def gloss(self) -> GlossData:
        """Gloss of `lit`."""
        still, kept = self._gloss_at_rest, [source for _, source in self._still]
        cut = lambda known: [a if a is None else a[source] for a, source in zip(known, kept)]
        surfaces = self.surfaces
        own = [(s, m, g) for s in surfaces for m, g in zip(s.meshes, s.gloss, strict=True)]
        middles = ((s.pages[m.page].albedo, m.uv[m.faces].mean(1), g[:, 2].any()) for s, m, g in own)
        return dataclasses.replace(
            still,
            gloss=[*cut(still.gloss), *(g[:, :3] for _, _, g in own)],
            tint=[*cut(still.tint), *(texels_at(albedo, at) if metal else None for albedo, at, metal in middles)],
            glow=[*still.glow, *(None for s in surfaces for _ in s.pages)],
            detail=[*cut(still.detail), *(np.zeros(len(g), np.uint8) for _, _, g in own)],
        )

    def _corners(self) -> dict[int, np.ndarray]:
        """By number of mesh in `lit`, where vertices are of what is not where it was drawn last."""
        out: dict[int, np.ndarray] = {}
        number = len(self.bake.lit.meshes)
        for name, thing in self._things.items():
            placed = self._placed.get(name)
            meshes = thing.surface.meshes if thing.surface is not None else ()
            pose = AWAY if placed is None else placed.pose
            if name in self._skins and placed is not None:
                self._drawn_at.pop(name, None)
                out |= dict(enumerate(self._bent[name], number))
            elif self._drawn_at.get(name) != pose:
                self._drawn_at[name] = pose
                out |= {number + k: pose.points(m.vertices) for k, m in enumerate(meshes)}
            number += len(meshes)
        return out

    def _own_patches(self) -> Iterator[Patch]:
        """Pages of things that are not where they were shown last."""
        number = len(self.bake.lit.pages)
        for name, thing in self._things.items():
            placed = self._placed.get(name)
            pages = thing.surface.pages if thing.surface is not None else ()
            if placed is not None and self._shown_things.get(name) is not placed.e:
                self._shown_things[name] = placed.e
                for k, page in enumerate(pages):
                    yield Patch(number + k, 0, 0, self._own_picture(placed, page))
            number += len(pages)

    def _own_picture(self, placed: Placed, page: SurfacePage) -> np.ndarray:
        gain = self.bake.exposure.near(placed.pose.points(placed.surface.position[page.luxels]))
        size = page.albedo.shape[1::-1]
        e, glow = (cv2.resize((a[page.luxels] * gain)[page.shown_by], size) for a in (placed.e, placed.surface.glow))
        return displayed(page.albedo * e + glow)


@dataclass(frozen=True, eq=False)
class _Thing:
    surface: Surface | None
    rest: RigidPose | None
    """Pose in which it was baked; None for what was not."""
    owners: frozenset[str]
    """Of what is drawn no longer in the house."""


def _in_frame(p: Part, frame: RigidPose) -> Part:
    """A part of the house placed in the frame of an upright pose."""
    x, y, z = (np.subtract(p.position, frame.position) @ frame.rotation).tolist()
    return dataclasses.replace(p, position=(x, y, z), yaw=p.yaw - frame.yaw)


def _nothing(m: LitMesh) -> LitMesh:
    return dataclasses.replace(m, faces=m.faces[:0])
