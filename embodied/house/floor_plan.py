"""The floor plan as a picture: walls with thickness, door swings, windows, furniture, names and areas, scale and north.

paint_plan(house).save("plan.png")
"""

import functools
import importlib.util
import io
import itertools
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Protocol, cast

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFont

from embodied.assets.cache import write_bytes
from embodied.assets.json_file import from_plain, read_toml
from embodied.geometry import rectangle, rotation
from embodied.house.house import House, Opening, Placement, Room, Stair
from embodied.house.shapes import HEADROOM, footprint, inward, roof_hole, under_slopes

Colour = tuple[int, int, int]
Point = Sequence[float] | np.ndarray
"""x and y, and perhaps more that a plan does not show, metres."""
Line = Iterable[Point] | np.ndarray

PAPER, INK, SOFT, GLASS_COLOUR = (250, 248, 243), (52, 50, 56), (128, 124, 122), (150, 175, 190)
_COLOURS = from_plain(dict[str, dict[str, Colour]], read_toml(Path(__file__).with_name("floor_plan.toml")))
ROOM_COLOURS = _COLOURS["rooms"]
SUPERSAMPLING = 3
"""Draw at this many times the final resolution, then shrink: smooth lines."""


class Graph(Protocol):
    """The part of a navigation graph that a plan shows."""

    @property
    def positions(self) -> np.ndarray:
        """(n, 3) metres, world."""

    @property
    def edges(self) -> np.ndarray:
        """(m, 2) node indices."""


def paint_plan(
    house: House,
    *,
    storey: int = 0,
    pixels_per_metre: float = 48.0,
    graph: Graph | None = None,
    path: tuple[int, ...] = (),
    facing: float | None = None,
    titles: bool = True,
) -> Image.Image:
    """A plan of one storey.

    Args:
      pixels_per_metre: scale of the returned image.
      graph: a NavGraph to lay over the plan.
      path: node indices of `graph` to draw as a walk.
      facing: where somebody at the end of `path` looks, radians counter-clockwise from +x; drawn as an arrowhead.
    """
    rooms = [r for r in house.rooms if r.storey == storey]
    if not rooms:
        raise ValueError(f"house {house.name!r} has no rooms on storey {storey}; it has {len(house.storeys)} storeys")
    sheet = _Sheet(rooms, pixels_per_metre * SUPERSAMPLING, house.outer_wall)
    ids = {r.id for r in rooms}
    for room in rooms:
        sheet.polygon(room.polygon, fill=ROOM_COLOURS.get(room.kind, PAPER))
        if room.kind in ("bathroom", "toilet", "laundry_room", "kitchen"):
            sheet.hatch(room)
    _draw_furniture(sheet, house, ids)
    sheet.shape(walls_of(house, rooms), INK)
    for room in rooms:
        for strip in under_slopes(room, HEADROOM):  # from here on one stoops
            sheet.clipped(strip.exterior.coords, house.floor(room), SOFT)
    for o in house.openings:
        if o.rooms[0] in ids:
            _draw_opening(sheet, house, o)
    for s in house.stairs:
        if s.void and s.rooms[1] in ids:
            a, b, c, d = s.void
            sheet.polygon(s.void, PAPER)
            for line in ((a, b, c, d, a, c), (b, d)):  # crossed out, as openings in floors are
                sheet.line(line, 0.02, SOFT)
        if ids & {*s.rooms}:
            _draw_stair(sheet, s)
    if graph is not None:
        levels = [-np.inf, *(s.elevation for s in house.storeys[1:]), np.inf]
        height = graph.positions[:, 2] - 0.75  # of the waist
        _draw_graph(sheet, graph, path, (levels[storey] <= height) & (height < levels[storey + 1]))
        if path and facing is not None:
            _draw_walker(sheet, graph.positions[path[-1]][:2], facing)
    image = sheet.image.resize(
        (sheet.image.width // SUPERSAMPLING, sheet.image.height // SUPERSAMPLING), Image.Resampling.LANCZOS
    )
    out = _Sheet(rooms, pixels_per_metre, house.outer_wall, image)
    for room in rooms:
        _label(out, house, room)
    _legend(out, house, titles)
    return out.image


def save_plan(house: House, file: Path, *, pixels_per_metre: float = 48.0, graph: Graph | None = None) -> None:
    """Write the plans of all storeys, the lowest on the left, as a PNG, atomically; arguments as for `paint_plan`."""
    data = io.BytesIO()
    plans = [
        paint_plan(house, storey=k, pixels_per_metre=pixels_per_metre, graph=graph) for k in range(len(house.storeys))
    ]
    sheet = Image.new("RGB", (sum(p.width for p in plans), max(p.height for p in plans)), PAPER)
    for k, plan in enumerate(plans):
        sheet.paste(plan, (sum(p.width for p in plans[:k]), 0))
    sheet.save(data, format="PNG")
    write_bytes(Path(file), data.getvalue())


@functools.cache
def _dejavu() -> Path | None:
    """DejaVu Sans as Matplotlib ships it, found without importing Matplotlib."""
    spec = importlib.util.find_spec("matplotlib")
    if spec is None or spec.origin is None:
        return None
    return Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"


def font(size: float) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, so that pictures agree between machines; without Matplotlib the font of Pillow."""
    path = _dejavu()
    if path is None:
        return cast(ImageFont.FreeTypeFont, ImageFont.load_default(max(6.0, size)))
    return ImageFont.truetype(str(path), max(6.0, size))


def _square_metres(area: str) -> str:
    """Pillow's own font has no superscript."""
    return f"{area} m2" if _dejavu() is None else f"{area} m²"


class _Sheet:
    """An image with a metre-to-pixel map; y up in metres, down in pixels."""

    def __init__(self, rooms: list[Room], scale: float, margin: float, image: Image.Image | None = None) -> None:
        corners = np.concatenate([np.asarray(r.polygon) for r in rooms])
        self.low = corners.min(0) - margin - 0.9
        self.high = corners.max(0) + margin + 0.9
        self.low[1] -= 1.0
        self.scale = scale
        size = (np.ceil((self.high - self.low) * scale / SUPERSAMPLING) * SUPERSAMPLING).astype(int)
        self.image = image if image is not None else Image.new("RGB", (int(size[0]), int(size[1])), PAPER)
        self.draw = ImageDraw.Draw(self.image)

    def xy(self, point: Point) -> tuple[float, float]:
        return ((point[0] - self.low[0]) * self.scale, (self.high[1] - point[1]) * self.scale)

    def polygon(self, points: Line, fill: Colour) -> None:
        self.draw.polygon([self.xy(p) for p in points], fill=fill)

    def line(self, points: Line, metres: float, colour: Colour = INK) -> None:
        self.draw.line(
            [self.xy(p) for p in points], fill=colour, width=max(1, round(metres * self.scale)), joint="curve"
        )

    def shape(self, shape: shapely.Geometry, fill: Colour) -> None:
        """Fill a shapely polygon with holes."""
        for g in getattr(shape, "geoms", [shape]):
            if g.is_empty:
                continue
            mask = Image.new("1", self.image.size, 0)
            pen = ImageDraw.Draw(mask)
            pen.polygon([self.xy(p) for p in g.exterior.coords], fill=1)
            for hole in g.interiors:
                pen.polygon([self.xy(p) for p in hole.coords], fill=0)
            self.image.paste(fill, (0, 0), mask)

    def hatch(self, room: Room) -> None:
        """Faint tiles."""
        pale, inside = _darker(ROOM_COLOURS.get(room.kind, PAPER), 9), shapely.Polygon(room.polygon)
        x0, y0, x1, y1 = inside.bounds
        for k in range(1, math.ceil((x1 - x0) / 0.4)):
            self.clipped(((x0 + 0.4 * k, y0), (x0 + 0.4 * k, y1)), inside, pale)
        for k in range(1, math.ceil((y1 - y0) / 0.4)):
            self.clipped(((x0, y0 + 0.4 * k), (x1, y0 + 0.4 * k)), inside, pale)

    def clipped(self, line: Sequence[Point], inside: shapely.Polygon, colour: Colour) -> None:
        cut = inside.intersection(shapely.LineString(line))
        for g in getattr(cut, "geoms", [cut]):
            if g.geom_type == "LineString" and not g.is_empty:
                self.line(g.coords, 0.015, colour)


def walls_of(house: House, rooms: list[Room]) -> shapely.Geometry:
    """The walls' cross-section, openings not cut, metres."""
    cells = [shapely.Polygon(r.polygon) for r in rooms]
    inside = shapely.union_all([c.buffer(-house.inner_wall / 2, join_style="mitre") for c in cells])
    hull = shapely.union_all(cells).buffer(house.outer_wall - house.inner_wall / 2, join_style="mitre")
    return hull.difference(inside)


def _draw_opening(sheet: _Sheet, house: House, o: Opening) -> None:
    a, b, n = np.asarray(o.a, float), np.asarray(o.b, float), inward(house, o)
    high = house.inner_wall / 2  # from here on, along n, the first room begins, and before `low` the other
    low = -(high if o.rooms[1] is not None else house.outer_wall - high)
    rooms = [house.room_by_id[r] for r in o.rooms if r is not None]
    if o.kind == "roof_window":
        ring = np.asarray(roof_hole(rooms[0], o).exterior.coords)
        sheet.polygon(ring, PAPER)
        for line in (ring, ring[[0, 2]], ring[[1, 3]]):
            sheet.line(line, 0.03, (96, 140, 168))
        return
    colour = ROOM_COLOURS.get(rooms[0].kind, PAPER)
    hole = [a + low * n, b + low * n, b + high * n, a + high * n]
    sheet.polygon(hole, fill=PAPER if o.kind in ("window", "french_window") else colour)
    if o.kind in ("window", "french_window"):
        for v in (low, high):
            sheet.line((a + v * n, b + v * n), 0.03)
        middle = (low * 0.45 + high * 0.55) * n
        sheet.line((a + middle, b + middle), 0.05 if o.kind == "window" else 0.03, (96, 140, 168))
        if o.kind == "french_window":
            mid, width = (a + b) / 2, float(np.linalg.norm(b - a))
            sheet.line((mid + low * n, mid + high * n), 0.03)
            for end, sign in ((a, 1), (b, -1)):
                _arc(sheet, end + high * n, (b - a) / width * sign, n, width / 2, 1.4, GLASS_COLOUR)
    elif o.kind == "garage_door":
        for v in np.linspace(low, high, 4):
            sheet.line((a + v * n, b + v * n), 0.02, SOFT)
    elif o.kind in ("door", "front_door", "back_door"):
        hinge, other = (a, b) if o.hinge == "a" else (b, a)
        width = float(np.linalg.norm(other - hinge))
        across = (other - hinge) / width
        shown = o.angle if o.kind == "door" else math.pi / 2
        _arc(sheet, hinge + high * n, across, n, width, max(shown, math.radians(60)), SOFT)
        leaf = math.cos(shown) * across + math.sin(shown) * n
        sheet.line((hinge + high * n, hinge + high * n + width * leaf), 0.045)
        if o.kind != "door":
            sheet.line((a + low * n, b + low * n), 0.05)


def _arc(
    sheet: _Sheet, centre: np.ndarray, start: np.ndarray, normal: np.ndarray, radius: float, angle: float, ink: Colour
) -> None:
    t = np.linspace(0, angle, 24)[:, None]
    sheet.line(centre + radius * (np.cos(t) * start + np.sin(t) * normal), 0.018, ink)


def _draw_furniture(sheet: _Sheet, house: House, ids: set[str]) -> None:
    """Footprints from low to high; floor coverings pale, small things tiny."""
    high = {r: house.storey_of(house.room_by_id[r]).elevation + 1.7 for r in ids}
    things = [p for p in house.placements if p.room in ids and p.position[2] < high[p.room]]
    for p in sorted(things, key=lambda p: (p.position[2] + p.size[2], p.id)):
        corners = rectangle(p.position[0], p.position[1], p.size[0], p.size[1], p.yaw)
        if p.object_class == "person":
            _draw_person(sheet, p)
            continue
        flat = p.size[2] < 0.04
        fill = _tint(p.object_class, 0.5 if flat else 0.0)
        sheet.polygon(corners, fill=fill)
        sheet.line([*corners, corners[0]], 0.016, _darker(fill, 28 if flat else 95))
        _glyph(sheet, p, corners, fill)


def _draw_person(sheet: _Sheet, p: Placement) -> None:
    """Shoulders and a head with the face to the front, as architects draw people from above."""
    t = np.linspace(0, 2 * math.pi, 28)

    def oval(rx: float, ry: float, dy: float) -> np.ndarray:
        return np.asarray(p.position[:2]) + np.stack([rx * np.cos(t), ry * np.sin(t) + dy], 1) @ rotation(p.yaw).T

    for shape, fill in ((oval(0.23, 0.12, 0.0), (233, 138, 60)), (oval(0.1, 0.11, -0.05), (92, 62, 44))):
        sheet.polygon(shape, fill=fill)
        sheet.line(shape, 0.014, (96, 52, 20))


def _draw_walker(sheet: _Sheet, at: np.ndarray, facing: float) -> None:
    """An arrowhead where the agent is."""
    shape = at + np.array([[0.3, 0.0], [-0.2, 0.2], [-0.1, 0.0], [-0.2, -0.2]]) @ rotation(facing).T
    sheet.polygon(shape, fill=(31, 119, 255))
    sheet.line([*shape, shape[0]], 0.02, (255, 255, 255))


def _tint(name: str, pale: float) -> Colour:
    colours = (c for words, c in _COLOURS["furniture"].items() if any(w in name for w in words.split()))
    base = next(colours, (216, 210, 202))
    red, green, blue = (round(c + (255 - c) * pale * 0.6) for c in base)
    return red, green, blue


def _darker(colour: Colour, by: int) -> Colour:
    red, green, blue = (max(0, c - by) for c in colour)
    return red, green, blue


def _glyph(sheet: _Sheet, p: Placement, corners: np.ndarray, fill: Colour) -> None:
    """A stroke or two that make the common things readable."""
    dark = _darker(fill, 60)
    # corners: back runs from corner 3 to 2 (the front looks along -y of the asset)
    front_left, front_right, back_right, back_left = corners

    def at(u: float, v: float) -> np.ndarray:
        """u from left to right, v from front to back, both 0..1."""
        return (front_left * (1 - u) + front_right * u) * (1 - v) + (back_left * (1 - u) + back_right * u) * v

    name = p.object_class
    if name.endswith("bed") and p.size[1] > 1.4:
        sheet.line((at(0, 0.66), at(1, 0.66)), 0.016, dark)
        pillows = ((0.08, 0.92),) if p.size[0] < 1.25 else ((0.07, 0.47), (0.53, 0.93))
        for a, b in pillows:
            box = [at(a, 0.76), at(b, 0.76), at(b, 0.94), at(a, 0.94)]
            sheet.polygon(box, fill=(246, 246, 248))
            sheet.line([*box, box[0]], 0.014, dark)
    elif "sofa" in name or "armchair" in name:
        arm = min(0.2, 0.17 / p.size[0])
        sheet.line((at(arm, 0.0), at(arm, 0.72), at(1 - arm, 0.72), at(1 - arm, 0.0)), 0.016, dark)
    elif "chair" in name and "armchair" not in name:
        sheet.line((at(0.05, 0.85), at(0.95, 0.85)), 0.03, dark)
    elif name in ("wardrobe", "closet"):
        sheet.line((at(0.5, 0), at(0.5, 1)), 0.014, dark)


def _draw_stair(sheet: _Sheet, stair: Stair) -> None:
    """Its steps, and an arrow along it that points up."""
    path = np.asarray(stair.path)
    rise = (path[-1, 2] - path[0, 2]) / stair.risers
    for a, b in itertools.pairwise(path):
        n, way = round((b[2] - a[2]) / rise), (b - a)[:2]
        side = np.array([-way[1], way[0]]) / np.linalg.norm(way) * stair.width / 2
        for p in (a[:2] + k / (n - 1) * way for k in range(n) if n > 1):
            sheet.line((p - side, p + side), 0.02, SOFT)
    sheet.line(path[:, :2], 0.025, SOFT)
    back = (path[-2] - path[-1])[:2] / np.linalg.norm((path[-2] - path[-1])[:2]) * 0.16
    for turn in (np.array([[1, -0.6], [0.6, 1]]), np.array([[1, 0.6], [-0.6, 1]])):
        sheet.line((path[-1, :2], path[-1, :2] + turn @ back), 0.025, SOFT)


def _draw_graph(sheet: _Sheet, graph: Graph, path: tuple[int, ...], here: np.ndarray) -> None:
    """Viewpoints and edges; `here` (n,) bool: those on the storey."""
    for i, j in graph.edges[here[graph.edges].all(1)]:
        sheet.line((graph.positions[i][:2], graph.positions[j][:2]), 0.025, (196, 118, 88))
    for a, b in itertools.pairwise(path):
        if here[a] and here[b]:
            sheet.line((graph.positions[a][:2], graph.positions[b][:2]), 0.08, (200, 60, 50))
    for k in np.flatnonzero(here).tolist():
        p = graph.positions[k]
        x, y = sheet.xy(p)
        r = (0.11 if k in path else 0.075) * sheet.scale
        sheet.draw.ellipse(
            (x - r, y - r, x + r, y + r), fill=(186, 84, 56), outline=(255, 255, 255), width=SUPERSAMPLING
        )


def _label(sheet: _Sheet, house: House, room: Room) -> None:
    """Name and area in the room's freest spot, on a pale plate where furniture lies below."""
    inside = house.floor(room)
    name, area = room.kind.replace("_", " "), _square_metres(f"{inside.area:.1f}")
    x0, y0, x1, y1 = inside.bounds
    centre = _calm_spot(house, room, inside)
    size = float(np.clip(0.24 * sheet.scale, 9, 20))
    turned = False
    for _ in range(12):
        face = font(size)
        width = max(sheet.draw.textlength(name, font=face), 0.8 * sheet.draw.textlength(area, font=face))
        if width < 0.94 * (x1 - x0) * sheet.scale:
            break
        high = y1 - y0 > 1.5 * (x1 - x0) and width < 0.94 * (y1 - y0) * sheet.scale
        if high and 2.4 * size < (x1 - x0) * sheet.scale:
            turned = True
            break
        size *= 0.92
    show_area = inside.area > 2.2 and (x1 - x0 if turned else y1 - y0) * sheet.scale > 2.6 * size
    lines = [(name, font(size), INK)] + ([(area, font(size * 0.82), SOFT)] if show_area else [])
    width = max(sheet.draw.textlength(t, font=f) for t, f, _ in lines)
    height = sum(f.size * 1.15 for _, f, _ in lines)
    tile = Image.new("RGBA", (math.ceil(width) + 6, math.ceil(height) + 4), (*ROOM_COLOURS.get(room.kind, PAPER), 190))
    pen = ImageDraw.Draw(tile)
    y = 1.0
    for text, face, colour in lines:
        pen.text((tile.width / 2, y), text, font=face, fill=colour, anchor="ma")
        y += face.size * 1.15
    if turned:
        tile = tile.rotate(90, expand=True)
    x, y = sheet.xy(centre)
    left, middle, right = (sheet.xy((at, 0))[0] for at in (x0, (x0 + x1) / 2, x1))
    room_for_it = tile.width < (x1 - x0) * sheet.scale
    x = float(np.clip(x, left + tile.width / 2, right - tile.width / 2)) if room_for_it else middle
    sheet.image.paste(tile, (round(x - tile.width / 2), round(y - tile.height / 2)), tile)


def _calm_spot(house: House, room: Room, inside: shapely.Polygon) -> tuple[float, float]:
    """Near the middle, but off furniture where the room leaves a choice."""
    high = house.storey_of(room).elevation + 1.7
    low = (p for p in house.placements if p.room == room.id and p.size[2] > 0.04 and p.position[2] < high)
    things = shapely.union_all([footprint(p) for p in low])
    x0, y0, x1, y1 = inside.bounds
    best, least = ((x0 + x1) / 2, (y0 + y1) / 2), math.inf
    for u in np.linspace(0.5, 0.15, 5):
        for v in np.linspace(0.5, 0.15, 5):
            for x, y in ((x0 + u * (x1 - x0), y0 + v * (y1 - y0)), (x1 - u * (x1 - x0), y1 - v * (y1 - y0))):
                plate = shapely.box(x - 0.7, y - 0.25, x + 0.7, y + 0.25)
                cost = 3.0 * plate.intersection(things).area + 0.12 * math.dist((x, y), ((x0 + x1) / 2, (y0 + y1) / 2))
                if len(room.polygon) > 4:
                    cost += 9.0 * plate.difference(inside).area
                if inside.contains(shapely.Point(x, y)) and cost < least - 1e-9:
                    best, least = (float(x), float(y)), cost
    return best


def _legend(sheet: _Sheet, house: House, titles: bool) -> None:
    """Title, scale bar of metres, north arrow."""
    width, height = sheet.image.size
    s = sheet.scale
    face = font(float(np.clip(0.3 * s, 10, 22)))
    small = font(float(np.clip(0.22 * s, 8, 16)))
    base = height - 0.55 * s
    length = 5 if (sheet.high - sheet.low)[0] > 9 else 2
    at = lambda k: 0.6 * s + k * s
    for k in range(length):
        fill = INK if k % 2 == 0 else PAPER
        sheet.draw.rectangle((at(k), base, at(k + 1), base + 0.1 * s), fill=fill, outline=INK)
    for k, text in ((0, "0"), (length, f"{length} m")):
        sheet.draw.text((at(k), base - 0.08 * s), text, font=small, fill=INK, anchor="md")
    x, y, r = width - 1.0 * s, height - 0.85 * s, 0.5 * s
    d = np.array([math.cos(house.sky.north), -math.sin(house.sky.north)])
    n = np.array([-d[1], d[0]])
    c = np.array([x, y])
    for side, fill in ((1, INK), (-1, PAPER)):
        half = [c + r * d, c - 0.6 * r * d + side * 0.45 * r * n, c - 0.3 * r * d]
        sheet.draw.polygon([tuple(p) for p in half], fill=fill, outline=INK)
    sheet.draw.text(tuple(c + 1.35 * r * d), "N", font=small, fill=INK, anchor="mm")
    if titles:
        floor = sum(house.floor(r).area for r in house.rooms)
        text = f"{house.name}  ·  {_square_metres(f'{floor:.0f}')} floor  ·  seed {house.seed}"
        while sheet.draw.textlength(text, font=face) > width - 1.0 * s and face.size > 7:
            face = font(face.size - 1)
        sheet.draw.text((0.6 * s, 0.25 * s), text, font=face, fill=INK)
