"""Pictures, mirrors and wall televisions: over furniture first, then on what is left of free wall."""

from __future__ import annotations

from collections import Counter

from embodied.assets.records import Asset, Size
from embodied.generate.furnish.context import Context
from embodied.generate.furnish.likes import free_stretch
from embodied.generate.furnish.mounting import Hanging, along_stretches, at, hang_first, mount, spot_behind, stretches
from embodied.generate.furnish.space import Thing, Wall

MIDDLE = 1.5
"""Height of the middle of a picture, metres."""


def above_furniture(ctx: Context) -> None:
    """Pictures and mirrors over sofas, beds, sideboards, desks and consoles; a television over its bench."""
    for thing in ctx.things:
        if thing.role not in ctx.tables.alike["below pictures"]:
            continue
        spot = spot_behind(ctx, thing)
        top = thing.z - ctx.space.bottom + thing.size[2]
        if spot is None or top > 1.45:
            continue
        if thing.role == "tv stand":
            if not any(t.parent is thing and t.role == "television" for t in ctx.things):
                screen = ctx.pick("wall television", most=(1.8, 0.2, 1.1))
                mount(ctx, Hanging(screen, max(top + 0.2, 0.85), "television"), *spot)
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
    return mount(ctx, Hanging(mirror, max(top + 0.25, 1.1), "mirror", size=size, margin=0.05), wall, s)


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
    for a, b in stretches(wall):
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
            hanging = Hanging(piece, z, "picture", size=(w, piece.size[1], h), margin=0.04)
            hung += mount(ctx, hanging, wall, s + (k - (count - 1) / 2) * (w + 0.1)) is not None
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
        hanging = Hanging(mirror, low, "mirror", size=_mirror_size(mirror, w, h), margin=0.03)
        if hang_first(ctx, hanging, along_stretches(ctx.space.longest_walls, at(0.5, 0.25, 0.75))):
            return


def _mirror_size(mirror: Asset, width: float, height: float) -> Size:
    """Parameters that a mirror is made with; those from packs keep their own size."""
    if mirror.key.startswith("built/"):
        side = min(width, height, 0.8)
        return (side, mirror.size[1], side) if "round" in mirror.tags else (width, mirror.size[1], height)
    return mirror.size
