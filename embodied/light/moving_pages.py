"""Pages of a baked house in which things move: the light that these take from it, give it back, and carry along.

Pages near where a thing was get the light back that it hid, pages near where it is lose light, in the tiles concerned.
The sun is asked for by rays, and so is the light of lamps that are carried.
"""

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from embodied.house.house import House
from embodied.house.moment import RigidPose
from embodied.house.shapes import room_at
from embodied.light.gather import Blocked, LitRays, SentBack, behind, direct, fitting_of, lamp_at, sent_back, without
from embodied.light.movers import DISCS, Placed, Surface, cloud_of, hidden_by, hiding, kernels, shadow_box, unhidden
from embodied.light.pages.colours import linear
from embodied.light.pages.files import Bake
from embodied.light.pages.tone import displayed, shown_table
from embodied.light.pages.unwrap import areas_of
from embodied.light.probes import CORNERS, harmonics, radiance
from embodied.light.tiles import HALF_TILE, SAMPLES, TILE, Receiver, Tile, blocks_of, luxels_in, read_receiver, sampled
from embodied.light.tracing.emitters import GLAZING, Lamp, portals_of, read_lamps
from embodied.light.tracing.rays import rays_among
from embodied.light.tracing.sky import outdoors, sun_direction, sun_height, sun_strength
from embodied.render.gloss import Rays
from embodied.scene.lit_pages import LitMesh

FAINT = 0.025
"""Share of what a place sees, hidden by a thing, below which that is not shown."""
SLIGHT, SLIGHT_MOVING = 0.01, 0.03
"""Change of the share of its light that a place gets which goes unnoticed, in a picture and in one of many."""
BODIES, LAMPS = "*", "+"
"""Names of the groups of all that is no part of the house, and of all that changes the light of carried lamps."""
DARKER = 1e-3
"""e that goes unnoticed, of a lamp that is carried elsewhere."""
FEW_FROM, FEW_DISCS = 0.3, 12
"""Metres from a thing from which on so few discs stand for it."""
SHADOW_REACH = 0.8
"""Metres from a thing up to which it is asked what light it hides."""
BRIGHT = (0.3, 2.0)
"""Bounds of how bright what a thing hides is, beside the rest: nine harmonics are no more sure of one direction."""
SKY_ROWS = 64
"""Rows of the picture of the sky that rays meet."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Part of a page that is shown anew."""

    page: int
    row: int
    column: int
    picture: np.ndarray
    """(h, w, 3) uint8."""


@dataclass(frozen=True, eq=False)
class _Hides:
    """Light that things which belong together hide where they are."""

    things: tuple[Placed, ...]
    tiles: Mapping[Tile, np.ndarray]
    """(HALF_TILE, HALF_TILE, 4) float32: the share of its light that every second luxel gets past the thing, and the
    light that the thing sends it."""
    direct: frozenset[Tile]
    """Tiles from which they may hide the sun, or which a carried lamp lights."""

    def holds(self, things: Sequence[Placed], slack: float) -> bool:
        """True for the same things in about the same places."""
        return len(things) == len(self.things) and all(
            new.surface is old.surface and new.pose.apart(old.pose) <= slack
            for new, old in zip(things, self.things, strict=True)
        )


class HousePages:
    """Owns the light of a house's pages: as baked, without what moved, and as it was shown last."""

    def __init__(self, bake: Bake, house: House, carriers: Mapping[str, str], dark: Bake | None) -> None:
        """See MovingHouse."""
        self.bake, self.house = bake, house
        self.lamps = read_lamps(bake.folder / "lamps.npz", bake.manifest["lamps"])
        towards = sun_direction(house.sky)
        self.sun = (sun_strength(house.sky, sun_height(house.sky.hour)) * GLAZING).astype(np.float32)
        self._towards = towards.astype(np.float32)
        self._portals = portals_of(house) if self.sun.any() else ()
        self._dark = dark or bake
        self._still: tuple[LitMesh, ...] = ()
        self._receivers: dict[int, Receiver] = {}
        self._base: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._touched: set[Tile] = set()
        self._shown: dict[Tile, _Shown] = {}
        self._hiding: dict[str, _Hides] = {}
        self._opens: dict[Tile, tuple[np.ndarray, np.ndarray]] = {}
        self._sunlit: dict[int, np.ndarray] = {}
        self._lamplit: _Hides | None = None
        self._burning: list[tuple[Lamp, Blocked]] = []
        self._sent_back: dict[str, SentBack] = {}
        baked = {x.id: x for x in self.lamps}
        self._carried: dict[str, list[Lamp]] = {}
        for name in (n for n in carriers if n in baked):
            self._carried.setdefault(carriers[name], []).append(baked[name])
        for root, lamps in self._carried.items():
            self._carried[root] = [*lamps, *(f for x in lamps if (f := self._fitting(x)) is not None)]

    @property
    def is_sunny(self) -> bool:
        """True where the sun shines into the house."""
        return bool(len(self._portals))

    def stand(self, still: Sequence[LitMesh]) -> None:
        """Tell which meshes of the house stand where they were baked; all is to be shown anew."""
        for name in ("_static", "_lit_rays"):
            self.__dict__.pop(name, None)
        self._still, self._shown, self._sunlit = tuple(still), {}, {}

    def take_out(self, placed: Placed, others: Sequence[Placed]) -> None:
        """Give pages the light back that a thing hid where it was baked.

        Args:
          others: what moves besides.
        """
        if self._dark is not self.bake and not self._touched:
            self._touched = self._of_lamps
        low, high = placed.box
        for page, receiver, tiles in self._pages_near(low - SHADOW_REACH, high + SHADOW_REACH):
            self._give_light_back(placed, page, receiver, tiles)
        if self.is_sunny:
            self._give_sun_back(placed, others)

    @property
    def shown(self) -> Iterator[Patch]:
        """All that looks otherwise than it was baked, as `changed` had it last."""
        return self._patches(list(self._shown))

    def room_around(self, point: np.ndarray) -> str:
        """Id of the room that a point is in, or nearest to."""
        apart = lambda r: float(np.linalg.norm(np.mean(r.polygon, axis=0) - point[:2]))
        return room_at(self.house, point) or min(self.house.rooms, key=apart).id

    def radiance(self, points: np.ndarray, room: str) -> np.ndarray:
        """(n, 9, 3) float32 coefficients of the light that arrives at points of a room."""
        return radiance(self._dark.probes.at(points, room)).astype(np.float32)

    def sun_share(
        self, position: np.ndarray, normal: np.ndarray, thin: np.ndarray, things: Sequence[Placed]
    ) -> np.ndarray:
        """(n,) float32 cosine-weighted share of the sun that points see, past what stands still and these things."""
        cos = normal @ self._towards
        cos = np.where(thin, np.abs(cos) * 0.5, np.maximum(cos, 0)).astype(np.float32)
        which = np.flatnonzero(cos > 0)
        which = which[self._through_windows(position[which])]
        if len(which):
            side = np.sign(normal[which] @ self._towards)[:, None] * normal[which]
            start = (position[which] + side * 4e-3).astype(np.float32)
            met = self._static(start, np.broadcast_to(self._towards, start.shape))[0] >= 0
            for placed in things:
                met |= hidden_by(placed, start, self._towards)
            which = which[~met]
        share = np.zeros(len(position), np.float32)
        share[which] = cos[which]
        return share

    def _through_windows(self, position: np.ndarray) -> np.ndarray:
        """(n,) bool: the way from a point to the sun leads through a window's rectangle."""
        out = np.zeros(len(position), bool)
        for p in self._portals:
            facing = self._towards @ p.normal
            if abs(facing) > 1e-6:
                t = ((p.corner - position) @ p.normal) / facing
                on = position + t[:, None] * self._towards - p.corner
                u, v = on @ p.along / (p.along @ p.along), on @ p.up / (p.up @ p.up)
                out |= (t > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
        return out

    @functools.cached_property
    def _static(self) -> Rays:
        """Rays among the house without what moved."""
        solid = [m.vertices[m.faces] for m in self._still if m.page in self._room_of_page and m.alpha >= 0.9]
        return rays_among(np.concatenate(solid))

    def _blocked(self, things: Sequence[Placed]) -> Blocked:
        """Asks whether the house, or one of these things, is in the way."""

        def blocked(start: np.ndarray, ahead: np.ndarray, reach: np.ndarray) -> np.ndarray:
            hit, far, _, _ = self._static(start, ahead)
            out: np.ndarray = (hit >= 0) & (far < reach)
            for placed in things:
                rest = np.flatnonzero(~out)
                out[rest] = hidden_by(placed, start[rest], ahead[rest], reach[rest])
            return out

        return blocked

    def _pages_near(self, low: np.ndarray, high: np.ndarray) -> Iterator[tuple[int, Receiver, np.ndarray]]:
        """Pages, and tiles of them, (k, 2), that meet a box."""
        corners = np.where(CORNERS > 0, high, low)
        rooms = {room_at(self.house, c) for c in (*corners, (low + high) / 2)}
        for page, room in self._room_of_page.items():
            if room in rooms:
                receiver = self._receiver(page)
                tiles = receiver.near(low, high)
                if len(tiles):
                    yield page, receiver, tiles

    @functools.cached_property
    def _room_of_page(self) -> dict[int, str]:
        own = self.bake.manifest["own_pages"]
        return {m.page: m.room for m in self.bake.lit.meshes if m.page < own and m.alpha >= 0.9 and len(m.faces)}

    def _receiver(self, page: int) -> Receiver:
        if page not in self._receivers:
            self._receivers[page] = read_receiver(self.bake, page)
        return self._receivers[page]

    def _light(self, page: int) -> tuple[np.ndarray, np.ndarray]:
        """(h, w, 3) float32 light in luxels, and (h, w) float32 share of the sun in texels, of a page without what
        moved."""
        if page not in self._base:
            held = self._receiver(page).held if self._dark is self.bake else self._dark.ingredients(page)
            self._base[page] = held.soft.astype(np.float32), held.sun.astype(np.float32) / 255
        return self._base[page]

    def _in_the_open(self, tile: Tile, position: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n,) light that samples of a tile have in an empty room, and (n, 9) coefficients of what arrives there, both
        as means of the colours; remembered."""
        if tile not in self._opens:
            middle = position[len(position) // 2] + 0.05 * normal[len(position) // 2]
            around = self.radiance(position, self.room_around(middle)).mean(2)
            e = np.einsum("nk,nk->n", unhidden(normal, np.zeros(len(normal), bool)), around)
            self._opens[tile] = np.maximum(e, 1e-5), around
        return self._opens[tile]

    @functools.cached_property
    def _of_lamps(self) -> set[Tile]:
        """Tiles that lamps lit which are carried now."""
        out: set[Tile] = set()
        for page in self._room_of_page:
            less = np.abs(self._receiver(page).held.soft.astype(np.float32) - self._light(page)[0]).max(2)
            rows, columns = np.nonzero(less > DARKER)
            out |= {(page, int(i), int(k)) for i, k in {*zip(rows // TILE, columns // TILE)}}
        return out

    def _give_light_back(self, placed: Placed, page: int, r: Receiver, tiles: np.ndarray) -> None:
        """Add to tiles of a page what they see now that a thing stands no longer before them."""
        soft, at = self._light(page)[0], tuple(tiles.T)
        position, normal, old = (a[at].reshape(-1, 3) for a in (r.samples, r.sample_normals, sampled(soft)))
        cloud = cloud_of((placed,), DISCS)
        which = np.flatnonzero(hiding(cloud, position, normal)[0] > FAINT / 2)
        if not len(which):
            return
        some, out = position[which], normal[which]
        whole, more, hid = behind(self._lit_rays, placed, cloud, some, out)
        none = np.zeros(len(which), bool)
        for lamp in self.lamps:
            if lamp.room == self._room_of_page[page] and all(
                lamp is not x for own in self._carried.values() for x in own
            ):
                free, past = (direct(lamp, some, out, none, self._blocked(t)) for t in ((), (placed,)))
                whole, more = whole + free, more + free - past
        gain = np.zeros((*r.samples.shape[:2], SAMPLES, 4), np.float32)
        change = np.zeros((len(position), 4), np.float32)
        change[:, 3] = 1
        change[which, :3] = without(old[which], whole, more, hid) - old[which]
        gain[at] = change.reshape(-1, SAMPLES, 4)
        rows, columns = gain.shape[:2]
        sheet = gain.reshape(rows, columns, HALF_TILE, HALF_TILE, 4).swapaxes(1, 2)
        sheet = cv2.blur(np.ascontiguousarray(sheet.reshape(rows * HALF_TILE, columns * HALF_TILE, 4)), (3, 3))
        sheet = sheet[..., :3] / np.maximum(sheet[..., 3:], 1e-3)
        h, w = soft.shape[:2]
        more = cv2.resize(sheet, (columns * TILE, rows * TILE), interpolation=cv2.INTER_LINEAR)[:h, :w]
        np.maximum(soft + more, 0, out=soft)
        self._touched |= {(page, i, k) for i, k in tiles.tolist()}

    @functools.cached_property
    def _lit_rays(self) -> LitRays:
        """Rays among the house without what moved, as it was lit."""
        meshes = [m for m in self._still if m.page in self._room_of_page and m.alpha >= 0.9]
        sent = {page: self._sent(page) for page in {m.page for m in meshes}}
        return LitRays.among(self._static, meshes, sent, outdoors(self.house, SKY_ROWS).picture)

    def _sent(self, page: int) -> np.ndarray:
        """(h, w, 3) float32 radiance of the luxels of a page, without the glow of lamps."""
        soft, sun = self._light(page)
        h, w = soft.shape[:2]
        small = lambda a: cv2.resize(a, (w, h), interpolation=cv2.INTER_AREA)
        sunlight = small(sun)[..., None] * self.sun if sun.size else np.float32(0)
        return small(LINEAR[self._receiver(page).held.albedo]) * (soft + sunlight)

    def _give_sun_back(self, placed: Placed, others: Sequence[Placed]) -> None:
        low, high = shadow_box(*placed.box, self._towards)
        for page, receiver, tiles in self._pages_near(low, high):
            sun = self._light(page)[1]
            for tile in tiles.tolist():
                position, normal, at = receiver.texels(tile)
                which = np.flatnonzero(hidden_by(placed, position + normal * 2e-3, self._towards))
                if len(which):
                    none = np.zeros(len(which), bool)
                    share = self.sun_share(position[which], normal[which], none, others)
                    part = sun[at].ravel()
                    part[which] = np.maximum(part[which], share)
                    sun[at] = part.reshape(sun[at].shape)
                    self._touched.add((page, tile[0], tile[1]))

    def shine(self, things: Mapping[str, Placed], rests: Mapping[str, RigidPose], slack: float) -> bool:
        """Bring the light that carried lamps send to the house to where they are; False where it stays as it was.

        Args:
          things: what moves, where it is to be; its light is not asked for.
          rests: poses of what carries a lamp, as baked.
          slack: as MovingHouse.show has it.
        """
        every = [*things.values()]
        if not self._carried or (self._lamplit is not None and self._lamplit.holds(every, slack)):
            return False
        self._burning = []
        for root, lamps in self._carried.items():
            for lamp in (lamp_at(x, rests[root], things[root].pose) for x in lamps):
                own = None if lamp.normals.any() else things[root]
                self._burning.append((lamp, self._blocked([t for t in every if t is not own])))
        light = self._shone_on()
        self._lamplit = _Hides(tuple(every), light, frozenset(light))
        return True

    def _shone_on(self) -> dict[Tile, np.ndarray]:
        """Tiles, as `_Hides.tiles`, that carried lamps light, straight and by reflection: of the rooms that they are in
        and those beside them."""
        homes = {self.room_around(lamp.points.mean(0)) for lamp, _ in self._burning}
        rooms = homes | {r for o in self.house.openings if homes & {*o.rooms} for r in o.rooms}
        near = [(page, self._receiver(page)) for page, room in self._room_of_page.items() if room in rooms]
        tiles = [np.argwhere(r.low[..., 0] <= r.high[..., 0]) for _, r in near]
        names = [(page, i, k) for (page, _), own in zip(near, tiles, strict=True) for i, k in own.tolist()]
        take = lambda what: np.concatenate([getattr(r, what)[tuple(t.T)] for (_, r), t in zip(near, tiles)])
        some = lambda a: a.reshape(-1, HALF_TILE, HALF_TILE, 3)[:, 1::2, 1::2].reshape(-1, 3)  # soft enough for lamps
        position, normal = some(take("samples")), some(take("sample_normals"))
        none = np.zeros(len(position), bool)
        e = np.sum([direct(lamp, position, normal, none, blocked) for lamp, blocked in self._burning], axis=0)
        albedo = np.repeat([LINEAR[r.held.albedo].mean((0, 1)) for _, r in near], [len(t) for t in tiles], axis=0)
        boxes = np.sort(take("high") - take("low"), axis=1)[:, 1:].prod(1)
        area = np.minimum(boxes, np.quantile(boxes, 0.75)) / (SAMPLES // 4)  # boxes of several surfaces say too much
        each, self._sent_back = SAMPLES // 4, {}
        for home in homes:
            own = np.repeat([self._room_of_page[name[0]] == home for name in names], each)
            facts = np.repeat(albedo, each, axis=0)[own], position[own], normal[own], np.repeat(area, each)[own]
            self._sent_back[home] = sent_back(e[own], *facts)
            e[own] += self._sent_back[home].e(position[own], normal[own])
        e = e.reshape(-1, HALF_TILE // 2, HALF_TILE // 2, 3)
        passed, fine = np.ones((HALF_TILE, HALF_TILE, 1), np.float32), (HALF_TILE, HALF_TILE)
        lit = np.flatnonzero(e.max((1, 2, 3)) > DARKER)
        return {names[k]: np.dstack([passed, cv2.resize(e[k], fine)]) for k in lit}

    def _fitting(self, lamp: Lamp) -> Lamp | None:
        """The lamp as it sends its own light back, where it was baked; None where it has no surface."""
        owner = next(x.placement for x in self.house.lights if x.id == lamp.id)
        rows, area = [], 0.0
        for page in sorted({m.page for m in self.bake.lit.meshes if m.owner == owner and m.page in self._room_of_page}):
            r = self._receiver(page)
            own = np.isin(r.mesh, [k for k, m in enumerate(r.meshes) if m.owner == owner])
            h, w = own.shape
            albedo = cv2.resize(LINEAR[r.held.albedo], (w, h), interpolation=cv2.INTER_AREA)
            e = np.maximum(r.held.soft.astype(np.float32) - self._dark.ingredients(page).soft, 0)
            rows.append((r.position[own], r.normal[own], (albedo * e)[own]))
            area += sum(float(areas_of(m.vertices[m.faces]).sum()) for m in r.meshes if m.owner == owner)
        if not area:
            return None
        position, normal, sent = (np.concatenate(column) for column in zip(*rows, strict=True))
        return fitting_of(lamp, position, normal, sent, area)

    def lamplight(self, s: Surface, pose: RigidPose) -> np.ndarray | float:
        """(n, 3) light of luxels from lamps that are carried."""
        if not self._burning:
            return 0.0
        position, normal = pose.points(s.position), s.normal @ pose.rotation.T.astype(np.float32)
        back = self._sent_back.get(self.room_around(pose.points(s.box_corners).mean(0)))
        light = sum(direct(lamp, position, normal, s.thin, blocked) for lamp, blocked in self._burning)
        return light if back is None else light + back.e(position, normal)

    def changed(self, groups: Mapping[str, Sequence[Placed]], slack: float) -> Iterator[Patch]:
        """Tiles whose light is not what was shown last, now that these things are where they are.

        Args:
          groups: by name, things that move together.
        """
        moved = [n for n, g in groups.items() if n not in self._hiding or not self._hiding[n].holds(g, slack)]
        before = [self._hiding.pop(n) for n in [*self._hiding] if n in moved or n not in (*groups, LAMPS)]
        self._hiding |= {name: self._hides(groups[name]) for name in moved}
        about = [*before, *(self._hiding[name] for name in moved)]
        if self._lamplit is not None and self._lamplit is not (lit_before := self._hiding.get(LAMPS)):
            about += [self._lamplit] if lit_before is None else [self._lamplit, lit_before]
            self._hiding[LAMPS] = self._lamplit
        if not self._shown:
            about = [*self._hiding.values()]
        tiles = {tile for hides in about for tile in (*hides.tiles, *hides.direct)}
        tiles |= set() if self._shown else self._touched
        new = {}
        for tile in tiles:
            things = [h for h in self._hiding.values() if tile in h.tiles or tile in h.direct]
            new[tile] = _Shown(things, _together([t.tiles[tile] for t in things if tile in t.tiles]))
        changed = []
        for tile, now in new.items():
            shown = self._shown.get(tile)
            if shown is None or not now.things or any(tile in t.direct for t in (*shown.things, *now.things)):
                changed.append(tile)
        if slack == 0:
            changed = list(new)  # as if nothing had been shown before
        same = list(new.keys() - set(changed))
        if same:
            passed = [np.stack([some[tile].light[..., 0] for tile in same]) for some in (self._shown, new)]
            off = np.abs(passed[0] - passed[1]).max((1, 2)) > (SLIGHT if slack == 0 else SLIGHT_MOVING)
            changed += [tile for tile, differs in zip(same, off, strict=True) if differs]
        self._shown |= {tile: new[tile] for tile in changed}
        yield from self._patches(changed)

    def _patches(self, tiles: Sequence[Tile]) -> Iterator[Patch]:
        """Tiles as they are to be shown, near ones in one."""
        by_page: dict[int, list[Tile]] = {}
        for tile in sorted(tiles):
            by_page.setdefault(tile[0], []).append(tile)
        for page, own in by_page.items():
            for block in blocks_of(np.array(own)[:, 1:]):
                yield self._patch(page, block)

    def _hides(self, things: Sequence[Placed]) -> _Hides:
        """The tiles from which things hide light."""
        low, high = np.min([t.box[0] for t in things], axis=0), np.max([t.box[1] for t in things], axis=0)
        near = list(self._pages_near(low - SHADOW_REACH, high + SHADOW_REACH))
        sunlit: list[Tile] = []
        if len(self._portals):
            for page, _, tiles in self._pages_near(*shadow_box(low, high, self._towards)):
                sunlit += [(page, i, k) for i, k in tiles[self._sunny(page)[tuple(tiles.T)]].tolist()]
        if not near:
            return _Hides(tuple(things), {}, frozenset(sunlit))
        names = [(page, i, k) for page, _, tiles in near for i, k in tiles.tolist()]
        take = lambda what: np.concatenate([getattr(r, what)[tuple(t.T)] for _, r, t in near]).reshape(-1, 3)
        position, normal = take("samples"), take("sample_normals")
        away = np.maximum(np.maximum(low - position, position - high), 0)
        far = (away**2).sum(1) > FEW_FROM**2
        share, towards, sent = (np.empty((len(position), *shape), np.float32) for shape in ((), (3,), (3,)))
        for which, most in ((far, FEW_DISCS), (~far, DISCS)):
            share[which], towards[which], sent[which] = hiding(cloud_of(things, most), position[which], normal[which])
        fade = np.clip(share / FAINT - 0.5, 0, 1)  # tiles must not end with a step
        share, sent = share * fade, sent * fade[:, None]
        by_tile = lambda a: a.reshape(len(names), SAMPLES, *a.shape[1:])
        which = np.flatnonzero(by_tile(share).any(1))
        if not len(which):
            return _Hides(tuple(things), {}, frozenset(sunlit))
        position, normal = by_tile(position), by_tile(normal)
        opens = [self._in_the_open(names[k], position[k], normal[k]) for k in which]
        some = lambda a: by_tile(a)[which].reshape(-1, *a.shape[1:])
        open_, around = (np.concatenate([o[i] for o in opens]) for i in (0, 1))
        passed = _passed(some(share), some(towards), open_, around)
        light = np.concatenate([passed, some(sent)], axis=1).reshape(-1, HALF_TILE, HALF_TILE, 4)
        hidden = {names[k]: one for k, one in zip(which, light, strict=True)}
        return _Hides(tuple(things), hidden, frozenset(sunlit))

    def _patch(self, page: int, tiles: np.ndarray) -> Patch:
        """The rectangle around tiles (k, 2); what has no change of light stays as it was baked."""
        r, (soft, _) = self._receiver(page), self._light(page)
        low, high = tiles.min(0), tiles.max(0) + 1
        size, f = np.array(soft.shape[:2]), r.fineness
        begin, end = low * TILE, np.minimum(high * TILE, size)
        first, last = np.maximum(begin - 1, 0), np.minimum(end + 1, size)  # one more, so that tiles join
        around = slice(first[0], last[0]), slice(first[1], last[1])
        both = self._light_past(page, low - 1, high + 1)
        from_, to = first - (low - 1) * TILE, last - (low - 1) * TILE
        both = both[from_[0] : to[0], from_[1] : to[1]]
        exposed = (soft[around] * both[..., :1] + both[..., 1:]) * r.gain[around]
        (h, w), within = (end - begin).tolist(), (slice(begin[0], end[0]), slice(begin[1], end[1]))
        sunny = self._sunny(page)[low[0] : high[0], low[1] : high[1]].any()
        changes, sun = np.zeros((h, w), bool), np.zeros((h * f, w * f) if sunny else (0, 0), np.float32)
        sunlit = []
        for tile in low + np.array([*np.ndindex(*(high - low))]):  # also those that were changed before
            name = (page, int(tile[0]), int(tile[1]))
            if name in self._shown and (self._shown[name].things or name in self._touched):
                part = luxels_in(tile - low)
                changes[part] = r.takes[luxels_in(tile)]
                sunlit += [tile] if self._sunny(page)[name[1:]] else []
        for tile, left in zip(sunlit, self._sun_left(page, sunlit), strict=True):
            row, column = (tile - low) * TILE * f
            sun[row : row + left.shape[0], column : column + left.shape[1]] = left
        texels = slice(within[0].start * f, within[0].stop * f), slice(within[1].start * f, within[1].stop * f)
        picture = r.held.picture[texels].copy()
        _paint(r.held.albedo[texels], exposed, begin - first, f, changes, sun, self.sun * r.gain[within], picture)
        return Patch(page, texels[0].start, texels[1].start, picture)

    def _sunny(self, page: int) -> np.ndarray:
        """(rows, columns) bool: tiles that some sun falls on, without what moved."""
        if page not in self._sunlit:
            sun, side = self._light(page)[1], TILE * self._receiver(page).fineness
            rows, columns = (-(-n // side) for n in sun.shape)
            whole = cv2.copyMakeBorder(
                sun, 0, rows * side - sun.shape[0], 0, columns * side - sun.shape[1], cv2.BORDER_CONSTANT
            )
            self._sunlit[page] = whole.reshape(rows, side, columns, side).any((1, 3))
        return self._sunlit[page]

    def _light_past(self, page: int, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(h, w, 4) float32 as `_together`, but for luxels, of the tiles from `low` to before `high`."""
        rows, columns = (high - low).tolist()
        out = np.zeros((rows * HALF_TILE, columns * HALF_TILE, 4), np.float32)
        out[..., 0] = 1
        for i, k in np.ndindex(rows, columns):
            shown = self._shown.get((page, int(low[0]) + i, int(low[1]) + k))
            if shown is not None:
                out[i * HALF_TILE : (i + 1) * HALF_TILE, k * HALF_TILE : (k + 1) * HALF_TILE] = shown.light
        return cv2.resize(out, (columns * TILE, rows * TILE), interpolation=cv2.INTER_LINEAR)

    def _sun_left(self, page: int, tiles: Sequence[np.ndarray]) -> list[np.ndarray]:
        """(h, w) share of the sun that the texels of each tile see past what moves."""
        r, (_, sun) = self._receiver(page), self._light(page)
        shares, starts = [], []
        for tile in tiles:
            position, normal, at = r.texels(tile.tolist())
            shares.append(sun[at].copy())
            lit = np.flatnonzero(shares[-1])
            starts.append(position[lit] + normal[lit] * 2e-3)
        if not tiles:
            return []
        names = [(page, int(tile[0]), int(tile[1])) for tile in tiles]
        things = {id(p): p for name in names for hides in self._shown[name].things for p in hides.things}
        start, left = np.concatenate(starts), np.concatenate([s.ravel()[np.flatnonzero(s)] for s in shares])
        for placed in things.values():
            left[hidden_by(placed, start, self._towards)] = 0
        for share, part in zip(shares, np.split(left, np.cumsum([len(s) for s in starts])[:-1]), strict=True):
            share.ravel()[np.flatnonzero(share)] = part
        return shares


def _paint(
    albedo: np.ndarray,
    light: np.ndarray,
    margin: np.ndarray,
    f: int,
    changes: np.ndarray,
    sun: np.ndarray,
    sunlight: np.ndarray,
    picture: np.ndarray,
) -> None:
    """Write what texels look like in a light, as `moving_kernels.paint` says."""
    if (compiled := kernels()) is not None:
        light, sunlight = (np.ascontiguousarray(a, np.float32) for a in (light, sunlight))
        compiled.paint(albedo, light, margin, f, changes, sun, sunlight, LINEAR, shown_table(), picture)
        return
    h, w = picture.shape[:2]
    top, left = (margin * f).tolist()
    wide = (light.shape[1] * f, light.shape[0] * f)
    exposed = cv2.resize(light, wide, interpolation=cv2.INTER_LINEAR)[top : top + h, left : left + w]
    exposed = exposed + sun[..., None] * sunlight.repeat(f, 0).repeat(f, 1) if len(sun) else exposed
    fine = changes.repeat(f, 0).repeat(f, 1)[..., None]
    np.copyto(picture, displayed(cv2.LUT(albedo, LINEAR) * exposed), where=fine)


LINEAR = linear(np.arange(256, dtype=np.float32) / 255)


def _together(tiles: Sequence[np.ndarray]) -> np.ndarray:
    """(HALF_TILE, HALF_TILE, 4) as `_Hides.tiles` of several things."""
    if len(tiles) == 1:
        return tiles[0]
    out = tiles[0].copy() if tiles else np.tile(np.array([1, 0, 0, 0], np.float32), (HALF_TILE, HALF_TILE, 1))
    for both in tiles[1:]:
        out[..., :1] *= both[..., :1]
        out[..., 1:] += both[..., 1:]
    return out


@dataclass(frozen=True, eq=False)
class _Shown:
    """Things and light by which a tile was shown."""

    things: list[_Hides]
    light: np.ndarray
    """As `_together`."""


def _passed(share: np.ndarray, towards: np.ndarray, open_: np.ndarray, around: np.ndarray) -> np.ndarray:
    """(n, 1) float32 share of the light that gets past a thing which hides a share of what is seen, `towards` it."""
    there = np.einsum("nk,nk->n", harmonics(towards), around)
    bright = np.clip(there / open_, *BRIGHT)
    return ((1 - share) / (1 - share + share * bright))[:, None].astype(np.float32)
