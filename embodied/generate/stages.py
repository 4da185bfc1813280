"""The stages from a seed to a House, each a function from Draft to Draft that can be replaced."""

import dataclasses
import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import SupportsIndex, TypeVar

import numpy as np
import shapely

from embodied.assets.catalogue import Catalogue, load_catalogue
from embodied.generate.access import MOVING
from embodied.generate.config import RETRIES, DeadEndError, HouseConfig
from embodied.generate.finishes import Palette, assign_materials, draw_palette
from embodied.generate.footprint import Footprint, draw_footprint, draw_shape
from embodied.generate.furnish import furnish
from embodied.generate.furnish.tables import tables, tables_of
from embodied.generate.layout import FloorPlan, draw_plan, turned, with_short_corridors
from embodied.generate.modules import Cell
from embodied.generate.novelty import furnishable
from embodied.generate.openings import KNEE, Leaves, draw_openings
from embodied.generate.program import BEDROOMS, WantedRoom, draw_area, draw_program, draw_storeys_of
from embodied.generate.special import with_special_rooms
from embodied.generate.stairwell import SLAB, TALLEST, stair_of
from embodied.generate.storeys import draw_storeys
from embodied.generate.walkways import remove_blocking_objects
from embodied.geometry import wrap
from embodied.house.house import DOORS, House, HouseError, Room, Sky, Stair, Storey, check
from embodied.house.shapes import inward
from embodied.navigation.graph import unreachable_rooms
from embodied.seeds import checked_seed, stream

PLAN_TRIES = 14000
"""Candidate plans per attempt, times rooms wanted: large houses get fewer."""
GALLERY_FROM = 56.0
"""Square metres of a storey; in smaller ones, a gallery that is asked for takes the room of living rooms."""
DEFAULT = HouseConfig()


@dataclass(frozen=True)
class Draft:
    """A house in the making; each stage fills in its field."""

    seed: int
    config: HouseConfig
    catalogue: Catalogue | None
    area: float = 0.0
    shape: str = "rectangle"
    footprints: tuple[Footprint, ...] = ()
    """Alternatives of one shape and area, among which the rooms stage chooses."""
    spaces: tuple[WantedRoom, ...] = ()
    plan: FloorPlan | None = None
    palette: Palette | None = None
    house: House | None = None
    attempt: int = 0
    """How many houses of this seed were drawn before: no doors or no furniture fitted their rooms."""
    redraws: int = 0
    """How many of these had this very plan, so that doors and furniture are drawn anew."""


Stage = Callable[[Draft], Draft]
Made = TypeVar("Made")


def _made(value: Made | None, stage: str) -> Made:
    """The field that a stage has filled in.

    Raises:
      HouseError: it has not run.
    """
    if value is None:
        raise HouseError(
            f"the draft lacks what the stage {stage!r} makes; keep one of this name, before those it serves"
        )
    return value


def footprint(draft: Draft) -> Draft:
    """Total area, shape and thirty footprints of it; houses of several storeys draw theirs with their rooms."""
    area = draw_area(draft.config, rng=stream(draft.seed, "house", "area"))
    rng, config = stream(draft.seed, "house", "footprint"), draft.config
    late = draft.attempt >= RETRIES.house // 2  # what is easier is tried then
    drawn = 1 if late else draw_storeys_of(area, config, rng=stream(draft.seed, "house", "storeys"))
    storeys = config.storeys or drawn
    simple = late and storeys > 1 and config.shape is None
    shape = "rectangle" if simple else draw_shape(area / storeys, config, rng=rng)
    footprints = tuple(draw_footprint(area, shape, rng=rng) for _ in range(30)) if storeys == 1 else ()
    config = dataclasses.replace(config, storeys=storeys)
    return dataclasses.replace(draft, config=config, area=area, shape=shape, footprints=footprints)


def program(draft: Draft) -> Draft:
    """The rooms wanted."""
    return dataclasses.replace(
        draft, spaces=draw_program(draft.area, draft.config, rng=stream(draft.seed, "house", "program"))
    )


def rooms(draft: Draft) -> Draft:
    """The best of many plans."""
    rng = stream(draft.seed, "house", "rooms", draft.attempt)
    footprints, spaces = draft.footprints, draft.spaces
    storeys = draft.config.storeys or 1
    if draft.attempt:
        if storeys == 1:
            footprints = tuple(draw_footprint(draft.area, draft.shape, rng=rng) for _ in range(24))
        spaces = draw_program(draft.area, draft.config, rng=rng)
    tries = min(1500, max(550, PLAN_TRIES // len(spaces)))
    if storeys == 1:
        drawn = draw_plan(footprints, spaces, tries, rng=rng)
        plan = None if drawn is None else drawn[1]
    else:
        gallery = "gallery" in (draft.config.special or ()) and draft.area >= GALLERY_FROM * storeys
        plan = draw_storeys(draft.area, draft.shape, spaces, storeys, tries, gallery=gallery, rng=rng)
    if plan is None:
        raise DeadEndError(
            f"no walkable plan of {draft.area:.0f} m2 with {len(draft.spaces)} rooms on a {draft.shape} footprint; "
            "widen HouseConfig.area or ask for fewer rooms"
        )
    plan, special = turned(with_short_corridors(plan), rng=rng), draft.config.special
    if special or (special is None and storeys > 1):
        plan = with_special_rooms(plan, special, rng=stream(draft.seed, "house", "special", draft.attempt))
    return dataclasses.replace(draft, plan=plan, spaces=spaces)


def with_plan(plan: FloorPlan) -> Stage:
    """A stage that takes the place of `rooms`: this plan in every attempt."""
    cells = [c for p in plan.storeys for k, c in enumerate(p.cells) if not any(map(c.is_with, p.cells[:k]))]
    spaces = tuple(WantedRoom(c.kind, c.area) for c in cells)
    area = sum(s.area for s in spaces)
    return lambda draft: dataclasses.replace(
        draft, redraws=draft.attempt, plan=plan, spaces=spaces, area=area, shape="rectangle"
    )


def openings(draft: Draft) -> Draft:
    """The bare house: rooms with ids, doors and windows; drawn again while a leaf shuts a room off."""
    config = draft.config
    palette = draw_palette(config.style, config.novelty, rng=stream(draft.seed, "house", "palette"))
    for attempt in range(RETRIES.doors):
        number = draft.redraws * RETRIES.doors + attempt
        house = _bare_house(draft, palette, stream(draft.seed, "house", "openings", number))
        if not unreachable_rooms(house):
            return dataclasses.replace(draft, palette=palette, house=house)
    raise DeadEndError(f"no doors of seed {draft.seed} leave every room open; widen HouseConfig.area")


def _bare_house(draft: Draft, palette: Palette, rng: np.random.Generator) -> House:
    disorder = draft.config.disorder
    if disorder is None:
        disorder = round(float(stream(draft.seed, "house", "disorder").beta(1.6, 2.2)), 3)
    plans = _made(draft.plan, "rooms").storeys
    names = _names(plans)
    height = round(float(rng.choice([2.45, 2.5, 2.6, 2.7, 2.9, 3.0], p=[0.15, 0.25, 0.3, 0.17, 0.08, 0.05])), 2)
    if len(plans) > 1 or any(c.slopes for c in plans[-1].cells):
        height = min(height, TALLEST)
    open_plan = draft.config.open_plan
    if open_plan is None:
        open_plan = bool(rng.random() < 0.6)
    leaves = Leaves(palette.door, palette.front_door, palette.frame)
    storeys = tuple(Storey(round(k * (height + SLAB), 2), height) for k in range(len(plans)))
    openings = draw_openings(plans, names, leaves, height, open_plan, rng=rng)
    return House(
        seed=draft.seed,
        name=_title(draft),
        storeys=storeys,
        rooms=tuple(
            _bare_room([c for c, own in zip(p.cells, names[k]) if own == name], name, palette, k)
            for k, p in enumerate(plans)
            for name in dict.fromkeys(names[k])
        ),
        openings=openings,
        placements=(),
        lights=(),
        style=palette.style,
        disorder=disorder,
        stairs=_stairs(draft, names, storeys, rng),
    )


def _names(plans: Sequence[FloorPlan]) -> list[tuple[str, ...]]:
    """'<kind>_<number>' for each cell of each storey; cells of one room share theirs."""
    numbers: defaultdict[str, Iterator[int]] = defaultdict(lambda: itertools.count(1))
    storeys: list[list[str]] = [[] for _ in plans]
    for names, plan in zip(storeys, plans):
        for c in plan.cells:
            same = next((name for name, other in zip(names, plan.cells) if c.is_with(other)), None)
            names.append(same or f"{c.kind}_{next(numbers[c.kind])}")
    return list(map(tuple, storeys))


def _stairs(
    draft: Draft, names: Sequence[tuple[str, ...]], storeys: Sequence[Storey], rng: np.random.Generator
) -> tuple[Stair, ...]:
    """The stairs between each storey and the next, above each other."""
    plans, special = _made(draft.plan, "rooms").storeys, draft.config.special
    wells = [(c, name) for p, own in zip(plans, names) for c, name in zip(p.cells, own) if c.kind == "stairwell"]
    mirrored, open_ = bool(rng.random() < 0.5) if wells else False, special is None or "gallery" in special
    joined = zip(itertools.pairwise(wells), itertools.pairwise(storeys))
    return tuple(stair_of(low[0], (low[1], high[1]), pair, mirrored, open_) for (low, high), pair in joined)


def _bare_room(cells: Sequence[Cell], name: str, palette: Palette, storey: int) -> Room:
    x0, y0, x1, y1 = (v / 10 for v in cells[0].rect)
    polygon: tuple[tuple[float, float], ...] = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    if len(cells) > 1:
        whole = shapely.union_all([shapely.box(*(v / 10 for v in c.rect)) for c in cells]).normalize().simplify(0)
        polygon = tuple(shapely.orient_polygons(whole).exterior.coords[:-1])
    return Room(
        id=name,
        kind=cells[0].kind,
        polygon=polygon,
        floor_finish=palette.floor,
        wall_finish=palette.walls[0],
        ceiling_finish=palette.ceiling,
        skirting_finish=palette.skirting,
        storey=storey,
        slopes=tuple((side, KNEE) for side in cells[0].slopes),
    )


def finishes(draft: Draft) -> Draft:
    """Floors, walls and other materials of every room, and the weather outside."""
    bare = _made(draft.house, "openings")
    sky = draw_sky(draft.config, bare, rng=stream(draft.seed, "house", "sky"))
    house = assign_materials(bare, _made(draft.palette, "openings"), rng=stream(draft.seed, "house", "finishes"))
    return dataclasses.replace(draft, house=dataclasses.replace(house, sky=sky))


def draw_sky(config: HouseConfig, house: House, *, rng: np.random.Generator) -> Sky:
    """Daytime mostly, the living room's largest window more or less to the south; `config` may fix hour, weather,
    landscape and season."""
    outside = (config.landscape, config.season)
    hour = config.hour if config.hour is not None else round(float(rng.triangular(8.0, 12.0, 18.0)), 2)
    weather = config.weather or str(rng.choice(["clear", "hazy", "overcast"], p=[0.55, 0.25, 0.2]))
    living = [o for o in house.openings if o.rooms[1] is None and house.room_by_id[o.rooms[0]].kind == "living_room"]
    if not living:
        return Sky(hour, weather, round(float(rng.uniform(-math.pi, math.pi)), 4), *outside)
    into = inward(house, max(living, key=lambda o: (math.dist(o.a, o.b) * (o.head - o.sill), o.id)))
    north = math.atan2(into[1], into[0]) + float(rng.normal(0, 0.8))
    return Sky(hour, weather, round(float(wrap(north)), 4), *outside)


def furnishing(draft: Draft) -> Draft:
    """Furniture, wall and ceiling things, small things and lights."""
    catalogue = draft.catalogue if draft.catalogue is not None else load_catalogue()
    stock = furnishable(catalogue, draft.config.novelty)
    seed = draft.seed
    if draft.redraws:
        seed = int(stream(seed, "house", "furniture", draft.redraws).integers(2**31))
    return dataclasses.replace(draft, house=furnish(_made(draft.house, "openings"), stock, seed=seed))


def clearing(draft: Draft) -> Draft:
    """Every room can be entered on foot; whatever stood in the way is gone."""
    return dataclasses.replace(draft, house=remove_blocking_objects(_made(draft.house, "openings")))


def checking(draft: Draft) -> Draft:
    """Refuse what cannot be."""
    check(_made(draft.house, "openings"))
    return draft


STAGES: Mapping[str, Stage] = {
    "footprint": footprint,
    "program": program,
    "rooms": rooms,
    "openings": openings,
    "finishes": finishes,
    "furnish": furnishing,
    "clear": clearing,
    "check": checking,
}


def generate_house(
    seed: SupportsIndex,
    config: HouseConfig = DEFAULT,
    catalogue: Catalogue | None = None,
    stages: Mapping[str, Stage] = STAGES,
) -> House:
    """The house that belongs to `seed`: the same in every process and on every machine.

    Of up to `RETRIES.house` houses, the first that lacks nothing that makes its rooms what they are
    (`missing_requirements`), or the one that lacks least. A plan that lacks the same twice is not tried again.

    Args:
      seed: any integer.
      config: what to fix; the rest is drawn.
      catalogue: assets to furnish with; the reviewed one by default.
      stages: name to stage, run in order; replace one with {**STAGES, "rooms": mine}, which then holds
        for every attempt.

    Raises:
      HouseError: the configuration cannot be built, or a stage lacks what an earlier one should make.
      TypeError: a seed that is no whole number.

    Examples:
      >>> house = embodied.generate_house(7, config)
    """
    seed, catalogue = checked_seed(seed), (catalogue or load_catalogue()).furnishing
    best: tuple[int, House] | None = None
    tried: list[object] = []
    for attempt in range(RETRIES.house):
        draft = Draft(seed, config, catalogue, attempt=attempt)
        try:
            for stage in stages.values():
                draft = stage(draft)
        except DeadEndError as e:
            dead_end = e
            continue
        house = _made(draft.house, "openings")
        short = missing_requirements(house, catalogue)
        if best is None or len(short) < best[0]:
            best = len(short), house
        if not short or not house.placements or (draft.plan, short) in tried:
            break
        tried.append((draft.plan, short))
    if best is None:
        raise dead_end
    return best[1]


def _title(draft: Draft) -> str:
    beds = sum(s.kind in ("main_bedroom", "bedroom", "kids_room", "guest_room") for s in draft.spaces)
    shape = "" if draft.shape == "rectangle" else f"{draft.shape}-shaped "
    what = "flat" if draft.area < 75 else "house"
    storeys = len(_made(draft.plan, "rooms").storeys)
    high = f"{storeys}-storey " if storeys > 1 else ""
    return f"{shape}{high}{what} with {beds} bedroom{'s' if beds != 1 else ''}, {draft.area:.0f} m2"


FLAT = 75.0
"""Up to here bedrooms may open off the living room, square metres."""


def missing_requirements(house: House, catalogue: Catalogue | None = None) -> tuple[str, ...]:
    """'kitchen_1: fridge' for everything that a room of `house` lacks, 'bedroom_1: way from a hall or corridor'.

    Counted are the needs of the table of rooms that name object classes. The furnisher tries for
    more; and it is asked of the finished house, because clearing the ways may take a bed out again.

    Args:
      catalogue: one whose own groups have needs, too.
    """
    there: dict[str, set[str]] = {}
    for p in house.placements:
        there.setdefault(p.room, set()).add(p.object_class)
    known = tables_of(catalogue) if catalogue is not None else tables()
    short = [
        f"{r.id}: {need.roles[0]}"
        for r in house.rooms
        for need in (known.rooms[r.kind].needs if r.kind in known.rooms else ())
        if need.classes and not any({*known.classes(c)} & there.get(r.id, set()) for c in need.classes)
    ]
    if house.area <= FLAT:
        return tuple(short)
    moving = {r.id for r in house.rooms if r.kind in MOVING}
    entered = {name for o in house.openings if o.kind in DOORS and moving & {*o.rooms} for name in o.rooms}
    through = (r.id for r in house.rooms if r.kind in BEDROOMS and r.id not in entered)
    return (*short, *(f"{name}: way from a hall or corridor" for name in through))
