"""Things that hang in a room: curtains, radiators, lamps, switches, sockets, pictures, mirrors and wall televisions.

Pictures come over furniture first, then on what is left of free wall; what else hangs is in smalls.toml.
"""

from collections import Counter

from embodied.assets.records import Asset, Size
from embodied.generate.furnish import mounting
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.likes import free_stretch, has_window
from embodied.generate.furnish.smalls import leave
from embodied.generate.furnish.space import Thing, Wall
from embodied.house.house import Opening


def hang_all(ctx: Context) -> None:
    """Everything on walls and ceiling, after the furniture stands."""
    mounting.ceiling_lamps(ctx)
    mounting.detectors(ctx)
    switches(ctx)
    for hang in (radiators, curtains) if ctx.chance(0.5) else (curtains, radiators):
        hang(ctx)
    above_furniture(ctx)
    leave(ctx, ctx.tables.hung)
    mirrors(ctx)
    pictures(ctx)
    wall_lamps(ctx)
    sockets(ctx)


def curtains(ctx: Context) -> None:
    """Curtains at the windows of rooms one lives in, blinds where curtains do not fit."""
    if ctx.has("bare windows"):
        return
    curtain = ctx.pick("curtain", most=(9.0, 0.2, 9.0), avoid=())
    blind = ctx.pick("window blind", avoid=())
    if ctx.chance(0.12):
        return
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind not in ("window", "french_window"):
                continue
            done = None
            if curtain is not None and not ctx.has("blinds only"):
                done = _curtain(ctx, curtain, wall, s0, s1, o)
            if done is None and blind is not None and o.kind == "window" and ctx.chance(0.8):
                drop = (o.head - o.sill) * ctx.rng.uniform(0.35, 1.0)
                size = (s1 - s0 + 0.06, blind.size[1], drop)
                hanging = mounting.Hanging(blind, o.head + 0.04 - drop, "blind", size=size, passage=True)
                mounting.mount(ctx, hanging, wall, (s0 + s1) / 2)


def _curtain(ctx: Context, asset: Asset, wall: Wall, s0: float, s1: float, o: Opening) -> Thing | None:
    """A curtain down to the floor, or to the sill where something stands before the window."""
    middle, width = (s0 + s1) / 2, s1 - s0
    top = min(o.head + 0.16, ctx.space.height - 0.02)
    grow = min(0.25, middle - width / 2 - 0.03, wall.length - middle - width / 2 - 0.03)
    if grow < 0.03:
        return None
    for bottom in (0.015, max(o.sill - 0.12, 0.02)):
        size = (width + 2 * grow, asset.size[1], top - bottom)
        done = mounting.mount(ctx, mounting.Hanging(asset, bottom, "curtain", size=size, passage=True), wall, middle)
        if done:
            return done
    return None


def radiators(ctx: Context) -> None:
    """A radiator under a window, else on what is free of an outer wall."""
    if ctx.has("no radiators") or ctx.roles("towel radiator"):
        return
    left = 1 + (ctx.space.area > 16)
    outer = [w for w in ctx.space.walls if has_window(w)]
    for wall in outer:
        for s0, s1, o in wall.openings:
            if left and o.kind == "window" and o.sill >= 0.75:
                asset = ctx.pick("radiator", most=(s1 - s0 + 0.2, 0.3, o.sill - 0.14), avoid=())
                left -= _radiator(ctx, asset, wall, (s0 + s1) / 2)
    for wall in outer:
        for a, b in mounting.stretches(wall):
            if left and b - a > 0.7:
                asset = ctx.pick("radiator", most=(min(b - a - 0.2, 1.5), 0.25, 1.0), avoid=())
                left -= _radiator(ctx, asset, wall, (a + b) / 2)


def _radiator(ctx: Context, asset: Asset | None, wall: Wall, s: float) -> bool:
    return mounting.mount(ctx, mounting.Hanging(asset, 0.1, "heating", "radiator", away=0.015), wall, s) is not None


def wall_lamps(ctx: Context) -> None:
    """Sconces in halls, corridors and living rooms."""
    if not ctx.has("wall lamps") or not ctx.chance(0.45):
        return
    hanging = mounting.Hanging(
        ctx.pick("wall lamp", most=(0.5, 0.35, 0.7)), 1.75, "wall_lamp", "wall lamp", margin=0.15
    )
    for wall, s in mounting.along_walls(ctx.space.longest_walls[:2], mounting.at(0.25, 0.75)):
        mounting.mount(ctx, hanging, wall, s)


def switches(ctx: Context) -> None:
    """A light switch beside the latch of each door, 1.1 m high."""
    asset = ctx.pick("switch", avoid=())
    if asset is None:
        return
    double = ctx.pick("dimmer switch" if ctx.chance(0.3) else "double light switch", avoid=())
    if double is not None and ctx.chance(0.25) and ctx.space.area > 12:
        asset = double
    hanging = mounting.Hanging(asset, 1.06, "electric", "light switch")
    left = 2 if ctx.kind not in ("hall", "corridor") else 3
    for wall in ctx.space.walls:
        for s0, s1, o in wall.openings:
            if o.kind in ("window", "french_window", "passage") or not left:
                continue
            hinge_at_s0 = abs(wall.along_of(*(o.a if o.hinge == "a" else o.b)) - s0) < 1e-6
            sides = (s1 + 0.2, s0 - 0.2) if hinge_at_s0 else (s0 - 0.2, s1 + 0.2)
            left -= mounting.hang_first(ctx, hanging, ((wall, s) for s in sides)) is not None


def sockets(ctx: Context) -> None:
    """Sockets 0.3 m above the floor on free wall, over the worktop in kitchens."""
    asset = ctx.pick("socket", avoid=())
    if asset is None or ctx.has("no sockets"):
        return
    z = 1.1 if ctx.kind == "kitchen" else 0.26
    if ctx.kind == "kitchen" and ctx.chance(0.5):
        asset = ctx.pick("double socket", avoid=()) or asset
    hanging = mounting.Hanging(asset, z, "electric", "wall socket")
    left = 1 + (ctx.space.area > 9) + (ctx.space.area > 20)
    for wall, s in mounting.along_walls(ctx.space.longest_walls, mounting.at(0.12, 0.88)):
        if left and wall.length > 1.2:
            left -= mounting.mount(ctx, hanging, wall, s) is not None


MIDDLE = 1.5
"""Height of the middle of a picture, metres."""


def above_furniture(ctx: Context) -> None:
    """Pictures and mirrors over sofas, beds, sideboards, desks and consoles; a television over its bench."""
    for thing in ctx.things:
        if thing.role not in ctx.tables.alike["below pictures"]:
            continue
        spot = mounting.spot_behind(ctx, thing)
        top = thing.z - ctx.space.bottom + thing.size[2]
        if spot is None or top > 1.45:
            continue
        if thing.role == "tv stand":
            if not any(t.parent is thing and t.role == "television" for t in ctx.things):
                screen = ctx.pick("wall television", most=(1.8, 0.2, 1.1))
                mounting.mount(ctx, mounting.Hanging(screen, max(top + 0.2, 0.85), "television"), *spot)
            continue
        if thing.role in ctx.tables.alike["below mirrors"] and ctx.chance(0.6) and _mirror_over(ctx, thing, top, *spot):
            continue
        if ctx.chance(0.8):
            _picture_group(ctx, *spot, thing.size[0], max(top + 0.18, 1.15))


def _mirror_over(ctx: Context, thing: Thing, top: float, wall: Wall, s: float) -> Thing | None:
    mirror = ctx.pick("mirror", most=(1.4, 0.2, 1.4))
    if mirror is None:
        return None
    size = _mirror_size(mirror, min(thing.size[0] * 0.8, 1.0), 0.8)
    return mounting.mount(
        ctx, mounting.Hanging(mirror, max(top + 0.25, 1.1), "mirror", size=size, margin=0.05), wall, s
    )


def pictures(ctx: Context) -> None:
    """Pictures on what is left of free wall."""
    if ctx.has("no pictures") or (ctx.has("few pictures") and ctx.chance(0.5)):
        return
    target = sum(w.length for w in ctx.space.walls) / (4.5 if ctx.kind in ("corridor", "hall") else 6.0)
    hung = sum(t.role in ("picture", "mirror") for t in ctx.things)
    for wall in ctx.space.longest_walls:
        for s in _picture_spots(wall) if wall.length >= 0.9 else ():
            if hung >= target:
                return
            a, b = free_stretch(wall, s, windows=True)
            if b - a < 0.7:
                continue
            size = float(ctx.rng.uniform(0.45, 1.0))
            hung += _picture_group(ctx, wall, s, min(size * 1.2, (b - a) * 0.7), 1.15)


def _picture_spots(wall: Wall) -> list[float]:
    """The middles of a wall and of its free stretches and, in long ones, two more; from the wall's middle outwards."""
    spots = {wall.length / 2}
    for a, b in mounting.stretches(wall):
        if b - a > 0.8:
            spots.add((a + b) / 2)
            if b - a > 3.2:
                spots.update((a + (b - a) * 0.3, a + (b - a) * 0.7))
    return sorted(spots, key=lambda s: abs(s - wall.length / 2))


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
    z = max(lowest, MIDDLE - h / 2)
    hung = 0
    for k in range(count):
        piece = asset if k == 0 else _art(ctx)
        if piece is not None:
            hanging = mounting.Hanging(piece, z, "picture", size=(w, piece.size[1], h), margin=0.04)
            hung += mounting.mount(ctx, hanging, wall, s + (k - (count - 1) / 2) * (w + 0.1)) is not None
    return hung


def _art(ctx: Context) -> Asset | None:
    """Something to hang whose image is not in the room yet and the rarest in the house."""
    hung: Counter[str] = Counter()
    for key, n in ctx.used.items():
        hung[_image(key)] += n
    here = {_image(t.asset.key) for t in ctx.things if t.role == "picture"}
    options = [a.key for a in ctx.stock.of_role("art") if _image(a.key) not in here]
    least = min((hung[_image(k)] for k in options), default=0)
    rare = frozenset(k for k in options if hung[_image(k)] == least)
    return ctx.pick("art", where=lambda a: a.key in rare)


def _image(key: str) -> str:
    """The image that a picture shows: the poster and the framed print of one image are alike."""
    return key.rsplit("/", 1)[-1].removeprefix("paper_")


def mirrors(ctx: Context) -> None:
    """A tall mirror where one dresses or goes out."""
    if not ctx.has("tall mirrors") or ctx.roles("mirror") or (ctx.kind == "bedroom" and ctx.chance(0.5)):
        return
    mirror = ctx.pick("mirror", most=(2.5, 0.2, 2.2))
    if mirror is None:
        return
    sizes = [(2.4, 1.6), (1.6, 1.6)] if ctx.kind == "gym" else []
    low = 1.2 if "round" in mirror.tags else 0.25
    for w, h in (*sizes, (0.6, 1.6), (0.5, 1.3)):
        hanging = mounting.Hanging(mirror, low, "mirror", size=_mirror_size(mirror, w, h), margin=0.03)
        if mounting.hang_first(
            ctx, hanging, mounting.along_stretches(ctx.space.longest_walls, mounting.at(0.5, 0.25, 0.75))
        ):
            return


def _mirror_size(mirror: Asset, width: float, height: float) -> Size:
    """Parameters that a mirror is made with; those from packs keep their own size."""
    if mirror.key.startswith("built/"):
        side = min(width, height, 0.8)
        return (side, mirror.size[1], side) if "round" in mirror.tags else (width, mirror.size[1], height)
    return mirror.size
