"""What hangs: curtains, pictures, mirrors, clocks, radiators, switches, sockets, lamps on ceilings and walls."""

from __future__ import annotations

import math
from collections import Counter

from assets.records import Asset
from embodied.generate.furnish.arrange import Thing
from embodied.generate.furnish.context import Context, free_stretch, has_window
from embodied.generate.furnish.looks import looks
from embodied.generate.furnish.space import Wall, box, overlap

EYE = 1.5
"""Height of the middle of a picture, metres."""
WET = ("bathroom", "toilet")
PLAIN = ("garage", "workshop", "pantry", "closet", "laundry_room", "stairwell")


def hang_all(ctx: Context) -> None:
    """Everything on walls and ceiling, after the furniture stands."""
    ceiling_lamps(ctx)
    detectors(ctx)
    switches(ctx)
    if ctx.chance(0.5):
        radiators(ctx)
        curtains(ctx)
    else:
        curtains(ctx)
        radiators(ctx)
    above_furniture(ctx)
    if ctx.kind == "hall":
        hooks(ctx)
        intercom(ctx)
    if ctx.kind in WET:
        towels(ctx)
    mirrors(ctx)
    pictures(ctx)
    clock(ctx)
    wall_lamps(ctx)
    sockets(ctx)
    oddities(ctx)


def mount(
    ctx: Context,
    asset: Asset | None,
    wall: Wall,
    s: float,
    z: float,
    group: str,
    *,
    size: tuple[float, float, float] | None = None,
    margin: float = 0.0,
    passage: bool = False,
    role: str = "",
    away: float = 0.0,
) -> Thing | None:
    """Hang `asset` on the wall with the middle of its back at `s` and its underside at `z`, if it fits.

    Args:
      z: height above the floor, metres.
      margin: free strip that it wants around it, metres.
      passage: whether it may hang before openings.
      away: gap to the wall, metres.
    """
    if asset is None:
        return None
    w, d, h = size or asset.size
    x, y = wall.point(s, away + d / 2 + 0.001)
    base = ctx.space.bottom + z
    if s - w / 2 < 0.01 or s + w / 2 > wall.length - 0.01:
        return None
    wide = box(x, y, w + 2 * margin, d, wall.yaw, base - margin, base + h + margin)
    exact = box(x, y, w, d, wall.yaw, base, base + h)
    if not ctx.space.fits(exact, passage=passage) or any(overlap(wide, q) for q in ctx.space.solids):
        return None
    thing = Thing(
        asset, x, y, base, wall.yaw, (w, d, h), looks(ctx, asset), None, None, f"{group}", role or group, wall
    )
    ctx.space.add([exact])
    ctx.things.append(thing)
    ctx.stock.note([asset])
    return thing


def ceiling_lamps(ctx: Context) -> None:
    """A lamp over the table or the middle of the room, several in large rooms, rows in long ones."""
    space = ctx.space
    lamp = _ceiling_lamp(ctx)
    if lamp is None:
        return
    tables = ctx.roles("dining table", "kitchen island")
    x0, y0, x1, y1 = space.polygon.bounds
    wx, wy = x1 - x0, y1 - y0
    nx = max(1, round(wx / 3.6)) if wx > 4.6 else 1
    ny = max(1, round(wy / 3.6)) if wy > 4.6 else 1
    if ctx.kind in ("corridor", "hall"):
        nx, ny = max(1, round(wx / 3.0)), max(1, round(wy / 3.0))
    spots = []
    for table in tables:
        pendant = ctx.pick("fine pendant", most=(1.4, 1.4, 1.8)) or lamp
        if _ceiling(ctx, pendant, table.x, table.y, table.z + table.size[2] + 0.7):
            spots.append((table.x, table.y))
    centre = (
        space.polygon.representative_point()
        if not space.polygon.contains(space.polygon.centroid)
        else space.polygon.centroid
    )
    for i in range(nx):
        for j in range(ny):
            x, y = x0 + (i + 0.5) * wx / nx, y0 + (j + 0.5) * wy / ny
            if nx * ny == 1:
                x, y = centre.x, centre.y
            if any(math.hypot(x - a, y - b) < 1.5 for a, b in spots):
                continue
            if _ceiling(ctx, lamp, x, y, None):
                spots.append((x, y))
    if not spots:
        for lamp in sorted(ctx.stock.of_role("ceiling lamp"), key=lambda a: a.size[2]):
            if _ceiling(ctx, lamp, centre.x, centre.y, None):
                return


def detectors(ctx: Context) -> None:
    """A smoke detector on the ceiling of halls, corridors and bedrooms; now and then a fan between the lamps."""
    if ctx.kind in ("living_room", "sun_room", "main_bedroom", "family_room") and ctx.chance(0.12):
        fan = ctx.pick("ceiling fan")
        if fan is not None:
            _ceiling(ctx, fan, ctx.space.polygon.centroid.x, ctx.space.polygon.centroid.y, None)
    if ctx.kind not in ("hall", "corridor", "main_bedroom", "kids_room") or not ctx.chance(0.6):
        return
    asset = ctx.pick("smoke detector")
    c = ctx.space.polygon.representative_point()
    if asset is not None:
        for dx, dy in ((0.6, 0.0), (0.0, 0.6), (-0.6, 0.0)):
            if _ceiling(ctx, asset, c.x + dx, c.y + dy, None):
                return


def _ceiling_lamp(ctx: Context) -> Asset | None:
    """One model for the whole room; flat ones where people walk close beneath."""
    height = ctx.space.height
    if ctx.kind in ("garage", "workshop"):
        found = ctx.pick("fluorescent lamp", avoid=())
        if found is not None:
            return found
    if ctx.kind in ("living_room", "study", "kitchen", "gym") and ctx.chance(0.12):
        found = ctx.pick("track light", most=(1.3, 1.3, 0.45), avoid=())
        if found is not None:
            return found
    low = ctx.kind in (*WET, "corridor", "pantry", "closet", "laundry_room", "toilet", "gym", "stairwell")
    if low or ctx.chance(0.45):
        return ctx.pick("ceiling lamp", most=(0.9, 0.9, 0.35), avoid=())
    return ctx.pick("ceiling light", most=(0.9, 0.9, height - 2.0), avoid=()) or ctx.pick("ceiling lamp", avoid=())


def _ceiling(ctx: Context, lamp: Asset, x: float, y: float, underside: float | None) -> bool:
    """Hang `lamp` from the ceiling over (x, y); `underside` is the z its lowest point should have."""
    w, d, h = lamp.size
    top = ctx.space.bottom + ctx.space.height
    scale = 1.0
    if underside is not None and lamp.object_class != "ceiling lamp":
        scale = min(max((top - underside) / h, 0.6), 1.35)
        if scale < 1 or lamp.object_class != "chandelier":
            h = h * scale
            if scale < 1:
                w, d = w * scale, d * scale
    b = box(x, y, w, d, 0.0, top - h, top)
    low = underside is not None and any(overlap(b, k) for k in ctx.space.keepouts)  # before a window or in a doorway
    if low or not ctx.space.fits(b, passage=True):
        return False
    ctx.space.add([b])
    ctx.things.append(
        Thing(lamp, x, y, top - h, 0.0, (w, d, h), looks(ctx, lamp), None, None, "ceiling", "ceiling lamp", None)
    )
    return True


def curtains(ctx: Context) -> None:
    """Curtains at the windows of rooms one lives in, blinds where curtains do not fit."""
    if ctx.kind in (*PLAIN, "toilet", "gym"):
        return
    asset = ctx.pick("curtain", most=(9.0, 0.2, 9.0), avoid=())
    blind = ctx.pick("window blind", avoid=())
    bare = ctx.chance(0.12)
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind not in ("window", "french_window") or bare:
                continue
            middle, width = (s0 + s1) / 2, s1 - s0
            done = None
            if asset is not None and ctx.kind not in ("kitchen", "bathroom"):
                top = min(o.head + 0.16, ctx.space.height - 0.02)
                grow = min(0.25, middle - width / 2 - 0.03, wall.length - middle - width / 2 - 0.03)
                for bottom in (0.015, max(o.sill - 0.12, 0.02)):
                    if grow < 0.03:
                        break
                    size = (width + 2 * grow, asset.size[1], top - bottom)
                    done = mount(ctx, asset, wall, middle, bottom, "curtain", size=size, passage=True)
                    if done:
                        break
            if done is None and blind is not None and o.kind == "window" and ctx.chance(0.8):
                drop = (o.head - o.sill) * ctx.rng.uniform(0.35, 1.0)
                size = (width + 0.06, blind.size[1], drop)
                mount(ctx, blind, wall, middle, o.head + 0.04 - drop, "blind", size=size, passage=True)


def radiators(ctx: Context) -> None:
    """A radiator under a window, else on what is free of an outer wall."""
    if ctx.kind in ("garage", "pantry", "closet", "corridor", "stairwell", "toilet") or ctx.roles("towel radiator"):
        return
    left = 1 + (ctx.space.area > 16)
    outer = [w for w in ctx.space.walls if has_window(w)]
    for wall in outer:
        for s0, s1, o in wall.openings:
            if left and o.kind == "window" and o.sill >= 0.75:
                asset = ctx.pick("radiator", most=(s1 - s0 + 0.2, 0.3, o.sill - 0.14), avoid=())
                left -= mount(ctx, asset, wall, (s0 + s1) / 2, 0.1, "heating", away=0.015, role="radiator") is not None
    for wall in outer:
        for a, b in _stretches(wall):
            if left and b - a > 0.7:
                asset = ctx.pick("radiator", most=(min(b - a - 0.2, 1.5), 0.25, 1.0), avoid=())
                left -= mount(ctx, asset, wall, (a + b) / 2, 0.1, "heating", away=0.015, role="radiator") is not None


def above_furniture(ctx: Context) -> None:
    """Pictures and mirrors over sofas, beds, sideboards, desks and consoles; a television over its bench."""
    for thing in list(ctx.things):
        if thing.role not in (
            "sofa",
            "bed",
            "sideboard",
            "dresser",
            "console",
            "desk",
            "bench",
            "cupboard",
            "chest",
            "fireplace",
            "dressing",
            "tv stand",
            "storage",
        ):
            continue
        wall, s = _wall_behind(ctx, thing)
        top = thing.z - ctx.space.bottom + thing.size[2]
        if wall is None or top > 1.45:
            continue
        if thing.role == "tv stand":
            if not any(t.parent is thing and t.role == "television" for t in ctx.things):
                screen = ctx.pick("wall television", most=(1.8, 0.2, 1.1))
                mount(ctx, screen, wall, s, max(top + 0.2, 0.85), "television", role="television")
            continue
        if thing.role in ("console", "dressing", "dresser") and ctx.chance(0.6):
            mirror = ctx.pick("mirror", most=(1.4, 0.2, 1.4))
            if mirror is not None:
                size = _mirror_size(ctx, mirror, min(thing.size[0] * 0.8, 1.0), 0.8)
                if mount(ctx, mirror, wall, s, max(top + 0.25, 1.1), "mirror", size=size, margin=0.05):
                    continue
        if ctx.chance(0.8):
            _picture_group(ctx, wall, s, thing.size[0], max(top + 0.18, 1.15))


def _wall_behind(ctx: Context, thing: Thing) -> tuple[Wall | None, float]:
    """The wall a thing has at its back, and where along it."""
    bx, by = -thing.front[0], -thing.front[1]
    for wall in ctx.space.walls:
        if bx * wall.inward[0] + by * wall.inward[1] > -0.98:
            continue
        dx, dy = thing.x - wall.start[0], thing.y - wall.start[1]
        away = dx * wall.inward[0] + dy * wall.inward[1] - thing.size[1] / 2
        s = dx * wall.along[0] + dy * wall.along[1]
        if -0.05 < away < 0.3 and 0 < s < wall.length:
            return wall, s
    return None, 0.0


def _picture_group(ctx: Context, wall: Wall, s: float, width: float, lowest: float) -> int:
    """One large picture, a pair or a row of three, centred at `s`; returns how many hang."""
    asset = _art(ctx)
    if asset is None:
        return 0
    count = 1 if width < 0.9 else int(ctx.rng.choice([1, 2, 3], p=[0.5, 0.25, 0.25]))
    w = min(width * 0.85 / count - 0.06 * (count - 1), ctx.rng.uniform(0.7, 1.2) if count == 1 else 0.55)
    w = max(w, 0.26)
    shape = ctx.rng.choice([0.7, 0.75, 1.0, 1.35]) if count == 1 else ctx.rng.choice([1.0, 1.3, 1.4])
    if asset.object_class == "poster":
        shape = 1.4
    h = min(w * shape, 0.95, ctx.space.height - lowest - 0.25)
    if h < 0.2:
        return 0
    z = max(lowest, EYE - h / 2)
    hung = 0
    for k in range(count):
        piece = asset if k == 0 else _art(ctx)
        at = s + (k - (count - 1) / 2) * (w + 0.1)
        hung += (
            mount(ctx, piece, wall, at, z, "picture", size=(w, piece.size[1], h), margin=0.04, role="picture")
            is not None
        )
    return hung


def _art(ctx: Context) -> Asset | None:
    """Something to hang whose image is not in the room yet and the rarest in the house."""
    hung: Counter[str] = Counter()
    for key, n in ctx.stock.used.items():
        hung[_image(key)] += n
    here = {_image(t.asset.key) for t in ctx.things if t.role == "picture"}
    options = [a.key for a in ctx.stock.of_role("art") if _image(a.key) not in here]
    least = min((hung[_image(k)] for k in options), default=0)
    rare = frozenset(k for k in options if hung[_image(k)] == least)
    return ctx.pick("art", where=lambda a: a.key in rare)


def _image(key: str) -> str:
    """What a picture shows: the poster and the framed print of one image are alike."""
    return key.rsplit("/", 1)[-1].removeprefix("paper_")


def pictures(ctx: Context) -> None:
    """Pictures on what is left of free wall."""
    if ctx.kind in (*WET, "garage", "pantry", "closet", "workshop", "laundry_room") or (
        ctx.kind in ("kitchen", "gym") and ctx.chance(0.5)
    ):
        return
    target = sum(w.length for w in ctx.space.walls) / (4.5 if ctx.kind in ("corridor", "hall") else 6.0)
    hung = sum(t.role in ("picture", "mirror") for t in ctx.things)
    walls = sorted(ctx.space.walls, key=lambda w: -w.length)
    for wall in walls:
        if hung >= target:
            return
        if wall.length < 0.9:
            continue
        spots = {wall.length / 2}
        for a, b in _stretches(wall):
            if b - a > 0.8:
                spots.add((a + b) / 2)
                if b - a > 3.2:
                    spots.update((a + (b - a) * 0.3, a + (b - a) * 0.7))
        for s in sorted(spots, key=lambda s: abs(s - wall.length / 2)):
            if hung >= target:
                return
            a, b = free_stretch(wall, s, windows=True)
            if b - a < 0.7:
                continue
            size = float(ctx.rng.uniform(0.45, 1.0))
            hung += _picture_group(ctx, wall, s, min(size * 1.2, (b - a) * 0.7), 1.15)


def _stretches(wall: Wall) -> list[tuple[float, float]]:
    edges = [0.0, *(e for s0, s1, _ in wall.openings for e in (s0, s1)), wall.length]
    return list(zip(edges[::2], edges[1::2]))


def _mirror_size(ctx: Context, mirror: Asset, width: float, height: float) -> tuple[float, float, float]:
    if mirror.key.startswith("built/"):
        side = min(width, height, 0.8)
        return (side, mirror.size[1], side) if "round" in mirror.tags else (width, mirror.size[1], height)
    return mirror.size


def mirrors(ctx: Context) -> None:
    """A tall mirror where one dresses or goes out."""
    if ctx.kind not in ("hall", "closet", "main_bedroom", "gym", "bedroom") or ctx.roles("mirror"):
        return
    if ctx.kind == "bedroom" and ctx.chance(0.5):
        return
    mirror = ctx.pick("mirror", most=(2.5, 0.2, 2.2))
    if mirror is None:
        return
    sizes = [(2.4, 1.6), (1.6, 1.6)] if ctx.kind == "gym" else []
    low = 1.2 if "round" in mirror.tags else 0.25
    for w, h in (*sizes, (0.6, 1.6), (0.5, 1.3)):
        size = _mirror_size(ctx, mirror, w, h)
        for wall in sorted(ctx.space.walls, key=lambda w: -w.length):
            for a, b in _stretches(wall):
                for share in (0.5, 0.25, 0.75):
                    if mount(ctx, mirror, wall, a + share * (b - a), low, "mirror", size=size, margin=0.03):
                        return


def clock(ctx: Context) -> None:
    """A wall clock in rooms where one looks at it."""
    if ctx.kind not in (
        "kitchen",
        "living_room",
        "study",
        "hall",
        "dining_room",
        "family_room",
        "kids_room",
        "gym",
    ) or not ctx.chance(0.45):
        return
    asset = ctx.pick("wall clock")
    if asset is None:
        return
    for wall in sorted(ctx.space.walls, key=lambda w: -w.length):
        for a, b in _stretches(wall):
            z = min(2.0, ctx.space.height - 0.2) - asset.size[2] / 2
            if mount(ctx, asset, wall, a + (b - a) * ctx.rng.uniform(0.3, 0.7), z, "clock", margin=0.1):
                return


def wall_lamps(ctx: Context) -> None:
    """Sconces in halls, corridors and living rooms."""
    if ctx.kind not in ("corridor", "hall", "living_room", "stairwell", "family_room", "library") or not ctx.chance(
        0.45
    ):
        return
    asset = ctx.pick("wall lamp", most=(0.5, 0.35, 0.7))
    for wall in sorted(ctx.space.walls, key=lambda w: -w.length)[:2]:
        for share in (0.25, 0.75):
            mount(ctx, asset, wall, wall.length * share, 1.75, "wall_lamp", margin=0.15, role="wall lamp")


def switches(ctx: Context) -> None:
    """A light switch beside the latch of each door, 1.1 m high."""
    asset = ctx.stock.pick("switch", rng=ctx.rng)
    if asset is None:
        return
    double = ctx.stock.pick("dimmer switch" if ctx.chance(0.3) else "double light switch", rng=ctx.rng)
    if double is not None and ctx.chance(0.25) and ctx.space.area > 12:
        asset = double
    left = 2 if ctx.kind not in ("hall", "corridor") else 3
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind in ("window", "french_window", "passage") or not left:
                continue
            hinge_at_s0 = abs(_along(wall, o.a if o.hinge == "a" else o.b) - s0) < 1e-6
            for at in (s1 + 0.2, s0 - 0.2) if hinge_at_s0 else (s0 - 0.2, s1 + 0.2):
                if mount(ctx, asset, wall, at, 1.06, "electric", role="light switch"):
                    left -= 1
                    break


def _along(wall: Wall, point: tuple[float, float]) -> float:
    return (point[0] - wall.start[0]) * wall.along[0] + (point[1] - wall.start[1]) * wall.along[1]


def sockets(ctx: Context) -> None:
    """Sockets 0.3 m above the floor on free wall, over the worktop in kitchens."""
    asset = ctx.stock.pick("socket", rng=ctx.rng)
    if asset is None or ctx.kind in (*WET, "closet"):
        return
    z = 1.1 if ctx.kind == "kitchen" else 0.26
    if ctx.kind == "kitchen" and ctx.chance(0.5):
        asset = ctx.stock.pick("double socket", rng=ctx.rng) or asset
    left = 1 + (ctx.space.area > 9) + (ctx.space.area > 20)
    for wall in sorted(ctx.space.walls, key=lambda w: -w.length):
        for share in (0.12, 0.88):
            if (
                left
                and wall.length > 1.2
                and mount(ctx, asset, wall, wall.length * share, z, "electric", role="wall socket")
            ):
                left -= 1


def hooks(ctx: Context) -> None:
    """Coat hooks at shoulder height near the entry."""
    asset = ctx.pick("coat hooks") or ctx.pick("coat rack")
    if asset is None or asset.support != "wall":
        return
    z = 1.62
    benches = ctx.roles("bench")
    for thing in benches:
        wall, s = _wall_behind(ctx, thing)
        if wall is not None and mount(ctx, asset, wall, s, z, "entry", margin=0.05, role="coat hooks"):
            return
    for wall in sorted(ctx.space.walls, key=lambda w: -w.length):
        for a, b in _stretches(wall):
            for share in (0.3, 0.7, 0.5):
                if mount(ctx, asset, wall, a + share * (b - a), z, "entry", margin=0.05, role="coat hooks"):
                    return


def intercom(ctx: Context) -> None:
    """A door phone beside the front door."""
    if not ctx.chance(0.5):
        return
    asset = ctx.pick("intercom")
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind == "front_door":
                for at in (s0 - 0.35, s1 + 0.35):
                    if mount(ctx, asset, wall, at, 1.35, "entry", role="intercom"):
                        return


def towels(ctx: Context) -> None:
    """Towel rails and hanging towels, near the basin or the bath."""
    anchors = ctx.roles("basin", "bathtub", "shower", "corner bathtub")
    left = 1 if ctx.kind == "toilet" else 2
    if ctx.kind == "bathroom":
        asset = ctx.pick("towel radiator", most=(0.7, 0.25, 1.7))
        if asset is not None and ctx.chance(0.7) and _near(ctx, asset, anchors, 0.35 if asset.size[2] > 1.2 else 0.7):
            left -= 1
    for _ in range(left):
        asset = ctx.pick("towel holder", most=(0.8, 0.25, 0.8))
        if asset is not None:
            _near(ctx, asset, anchors, 1.35 - asset.size[2] if asset.size[2] > 0.3 else 1.1)


def _near(ctx: Context, asset: Asset, anchors: list[Thing], z: float) -> Thing | None:
    """Hang `asset` as close to one of the anchors as the walls allow."""
    spots = []
    for wall in ctx.space.walls:
        for k in range(1, int(wall.length / 0.2)):
            x, y = wall.point(0.2 * k, 0.1)
            spots.append((min((math.hypot(x - t.x, y - t.y) for t in anchors), default=1.0), 0.2 * k, wall))
    for _, s, wall in sorted(spots, key=lambda p: p[0]):
        thing = mount(ctx, asset, wall, s, z, "towels", margin=0.04, role=asset.object_class)
        if thing:
            return thing
    return None


def oddities(ctx: Context) -> None:
    """Rarer things on walls: air conditioner, water heater, dartboard, tool racks, clothes on hangers."""
    wanted: list[tuple[str, float, float, float]] = []  # role, chance, underside, margin
    height = ctx.space.height
    if ctx.kind in ("living_room", "main_bedroom", "study", "gym"):
        wanted.append(("air conditioner", 0.2, height - 0.45, 0.05))
    if ctx.kind == "laundry_room":
        wanted.append(("water heater", 0.7, 1.3, 0.05))
    if ctx.kind in ("playroom", "garage"):
        wanted.append(("dartboard", 0.5, 1.5, 0.3))
    if ctx.kind == "kitchen":
        wanted += [("utensil rack", 0.4, 1.1, 0.03), ("knife rack", 0.3, 1.1, 0.03)]
    if ctx.kind == "closet":
        wanted += [("hanging clothes", 0.8, 0.55, 0.02), ("suit", 0.5, 1.2, 0.02), ("hanging clothes", 0.5, 0.55, 0.02)]
    if ctx.kind == "garage":
        wanted.append(("security camera", 0.2, height - 0.4, 0.1))
    if ctx.kind in ("study", "living_room"):
        wanted.append(("network socket" if ctx.kind == "study" else "aerial socket", 0.7, 0.26, 0.0))
    if ctx.kind in ("dining_room", "living_room", "study"):
        wanted.append(("thermometer", 0.05, 1.4, 0.1))
    for role, chance, z, margin in wanted:
        if not ctx.chance(chance):
            continue
        asset = ctx.pick(role, most=(3.0, 0.8, height - z - 0.02), where=lambda a: a.support == "wall")
        for wall in sorted(ctx.space.walls, key=lambda w: (has_window(w), -w.length)):
            if mount(ctx, asset, wall, wall.length * ctx.rng.uniform(0.3, 0.7), z, "wall", margin=margin, role=role):
                break
