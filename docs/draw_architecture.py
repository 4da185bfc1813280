"""Draws docs/architecture.png: the line from seed to recording, and the folders with what may import what.

    python docs/draw_architecture.py

`tests/test_architecture.py` compares FLOORS with the folders that are there.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

OUT = Path(__file__).with_name("architecture.png")
PLACE, PLAY, USE, LEARN, SHOW, GROUND = "#dbeafe", "#fef3c7", "#dcfce7", "#fae8ff", "#ffe4e6", "#e5e7eb"
INK, SOFT = "#1f2937", "#6b7280"
PITCH = 4.5
"""From floor to floor."""
HEAD = {"arrowstyle": "-|>", "color": INK, "lw": 1.4, "shrinkA": 0, "shrinkB": 1}


@dataclass(frozen=True)
class Box:
    """A noun or a folder, at the middle (x, y) of a canvas of 100 by 60."""

    name: str
    says: str
    x: float
    y: float
    colour: str
    width: float = 11.0
    height: float = 4.6


LINE = (
    Box("seed", "seeds.stream", 5.5, 54, GROUND, 8),
    Box("House", "generate/ house/", 21.5, 54, PLACE),
    Box("NavGraph", "navigation/", 38, 57.4, PLACE),
    Box("MjModel, light", "scene/ light/", 38, 50.6, PLACE),
    Box("Panorama", "render/", 54, 50.6, PLACE),
    Box("World", "world.py", 54, 57.4, PLACE),
    Box("Task", "tasks/", 70, 57.4, PLAY, 10),
    Box("data set", "datasets/", 70, 50.6, USE, 10),
    Box("Observation", "envs/", 91, 57.4, PLAY),
    Box("Action", "policies/ agents/", 91, 50.6, PLAY),
    Box("Reply", "assistants/ language/", 91, 43.8, PLAY, 12.5),
    Box("weights", "agents/", 70, 43.8, LEARN, 10),
    Box("Episode", "evaluation/rollout", 54, 43.8, USE, 11.5),
    Box("table", "evaluation/", 38, 43.8, USE),
    Box("recording", "viz/", 21.5, 43.8, SHOW),
)
FLOW = (
    ("seed", "House", "generate"),
    ("House", "NavGraph", ""),
    ("House", "MjModel, light", "once"),
    ("MjModel, light", "Panorama", "per node"),
    ("NavGraph", "World", ""),
    ("Panorama", "World", ""),
    ("World", "Task", "sample"),
    ("Task", "Observation", "env.reset"),
    ("Task", "data set", "of many houses"),
    ("data set", "weights", "train"),
    ("weights", "Action", ""),
    ("Observation", "Action", "policy.act"),
    ("Action", "Reply", "Ask"),
    ("Episode", "table", ""),
)
"""From, to, and the word on the arrow."""

FLOORS: tuple[tuple[str, str, tuple[tuple[str, str], ...]], ...] = (
    (
        "ground",
        GROUND,
        (
            ("seeds", "streams"),
            ("geometry", "angles"),
            ("errors", ""),
            ("distribution", "our name"),
            ("novelty", "what is held out"),
            ("gl", "EGL"),
            ("locks", "one writer"),
        ),
    ),
    ("place", PLACE, (("house", "the record"),)),
    ("place", PLACE, (("navigation", "graph, floor"), ("scene", "MjModel"))),
    ("place", PLACE, (("generate", "seed to house"), ("interface", "the nouns of play"))),
    ("place", PLACE, (("render", "pixels"),)),
    ("place", PLACE, (("light", "baked once"), ("mattersim", "Matterport's API"))),
    ("place", PLACE, (("world", "all of a place"),)),
    ("play", PLAY, (("action_spaces", "moves"), ("language", "words"))),
    ("play", PLAY, (("teachers", "labels"), ("records", "JSON"))),
    ("play", PLAY, (("tasks", "who wants what"), ("identity", "what it hangs on"))),
    ("play", PLAY, (("policies", "baselines"), ("assistants", "who answers"))),
    ("play", PLAY, (("envs", "rules of play"),)),
    ("use", USE, (("datasets", "build, export"),)),
    ("use", USE, (("evaluation", "rollout, judges"),)),
    ("use", USE, (("gym", "Gymnasium"),)),
    ("use", USE, (("bench", "speed, digests"),)),
    ("use", USE, (("cli", "alone composes agents and viz"),)),
)
"""Column, colour, and the rooms (name in embodied/, what it is about) of one floor; each imports only from floors
that stand to its left, or above it in its own column. The nouns of play stand with the place because pictures count
their views; what is play sees a place through their protocols."""


def draw(path: Path = OUT) -> None:
    """Write the picture."""
    figure = Figure(figsize=(14, 9.5), dpi=110)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(0, 100)
    axes.set_ylim(-5.4, 63)
    axes.axis("off")
    draw_line(axes)
    draw_floors(axes)
    figure.savefig(path)


def draw_line(axes: Axes) -> None:
    """The upper half: nouns, the folders that make them, and the arrows between."""
    heading(axes, 61.3, "From seed to recording", "each noun, and the folder of embodied/ that makes it")
    boxes = {b.name: b for b in LINE}
    for start, end, word in FLOW:
        arrow(axes, boxes[start], boxes[end], word)
    bent(axes, ((97.2, 43.8), (98.8, 43.8), (98.8, 57.4), (96.5, 57.4)), "env.step", (97.3, 47.2))
    bent(axes, ((91, 41.5), (91, 39.3), (54, 39.3), (54, 41.5)), "Steps", (80.5, 39.3))
    bent(axes, ((54, 41.5), (54, 40.4), (21.5, 40.4), (21.5, 41.5)), "", (0, 0))
    for b in LINE:
        draw_box(axes, b)


def draw_floors(axes: Axes) -> None:
    """The lower half: the folders, in columns; imports go up within a column and to the left between columns."""
    heading(
        axes,
        35.6,
        "Folders, and what may import what",
        "a module imports from above it in its column and from columns left of it; "
        "of place, play knows house, navigation, scene only",
    )
    columns = {"ground": (14.5, 10.0), "place": (35.0, 23.0), "play": (62.0, 23.0), "use": (87.5, 20.0)}
    titles = {"ground": "embodied: ground", "place": "place: from seed to pixels", "play": "play", "use": "use"}
    level = dict.fromkeys(columns, 0)
    for column, colour, rooms in FLOORS:
        x, width = columns[column]
        if column == "ground":
            for name, says in rooms:
                draw_box(axes, Box(name, says, x, 29 - PITCH * level[column], colour, width, 3.6))
                level[column] += 1
            continue
        each = width / len(rooms)
        for k, (name, says) in enumerate(rooms):
            middle, ink = x - width / 2 + each * (k + 0.5), PLAY if name == "interface" else colour
            draw_box(axes, Box(name, says, middle, 29 - PITCH * level[column], ink, each - 0.8, 3.6))
        level[column] += 1
    for column, (x, _) in columns.items():
        axes.text(x, 32.0, titles[column], ha="center", va="center", fontsize=11, color=INK, weight="bold")
    sides(axes)


def sides(axes: Axes) -> None:
    """What stands beside embodied: assets, agents, viz."""
    draw_box(axes, Box("assets", "furniture,\nmaterials;\nno heavy\nlibrary", 3.9, 17.5, GROUND, 6.6, 27))
    draw_box(axes, Box("agents", "what learns; torch, and only here", 71, -2.6, LEARN, 40, 4.2))
    draw_box(axes, Box("viz", "recordings, plots; Rerun, and only here", 28, -2.6, SHOW, 40, 4.2))
    for x, word in ((28, "imports"), (71, "imports")):
        axes.annotate("", (x, 1.6), (x, -0.4), arrowprops={"arrowstyle": "->", "color": SOFT, "lw": 1.5})
        axes.text(x + 0.6, 0.6, word, fontsize=8, color=SOFT, va="center")
    axes.annotate("", (7.3, 17.5), (9.2, 17.5), arrowprops={"arrowstyle": "->", "color": SOFT, "lw": 1.5})


def heading(axes: Axes, y: float, text: str, below: str) -> None:
    axes.text(1, y, text, fontsize=15, weight="bold", color=INK, va="center")
    axes.text(34, y, below, fontsize=10, color=SOFT, va="center")


def draw_box(axes: Axes, b: Box) -> None:
    """A rounded box with the name and, smaller below it, what it says."""
    corner = (b.x - b.width / 2, b.y - b.height / 2)
    axes.add_patch(
        FancyBboxPatch(corner, b.width, b.height, "round,pad=0,rounding_size=0.6", fc=b.colour, ec=SOFT, lw=1, zorder=3)
    )
    lines = b.says.count("\n") + bool(b.says)
    axes.text(
        b.x, b.y + 0.75 * lines, b.name, ha="center", va="center", fontsize=11, color=INK, weight="bold", zorder=4
    )
    axes.text(b.x, b.y - 1.1, b.says, ha="center", va="center", fontsize=8.5, color=SOFT, zorder=4)


def arrow(axes: Axes, start: Box, end: Box, word: str) -> None:
    """From box to box, with a word at its middle."""
    dx, dy = end.x - start.x, end.y - start.y
    if abs(dx) / (start.width + end.width) >= abs(dy) / (start.height + end.height):
        side = 1 if dx > 0 else -1
        a, b = (start.x + side * start.width / 2, start.y), (end.x - side * end.width / 2, end.y)
    else:
        side = 1 if dy > 0 else -1
        a, b = (start.x, start.y + side * start.height / 2), (end.x, end.y - side * end.height / 2)
    axes.annotate(
        "", b, a, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.4, "shrinkA": 0, "shrinkB": 1}, zorder=2
    )
    if word:
        flat = abs(dy) < 1
        middle = ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2 + (0.9 if flat else 0))
        say(axes, middle, word)


def bent(axes: Axes, corners: tuple[tuple[float, float], ...], word: str, place: tuple[float, float]) -> None:
    """An arrow round corners, with its word at `place`."""
    axes.plot(*zip(*corners[:-1], strict=True), color=INK, lw=1.4, zorder=2, solid_joinstyle="round")
    axes.annotate("", corners[-1], corners[-2], arrowprops=HEAD, zorder=2)
    if word:
        say(axes, place, word)


def say(axes: Axes, place: tuple[float, float], word: str) -> None:
    """A word on an arrow."""
    back = {"fc": "white", "ec": "none", "pad": 0.6, "alpha": 0.9}
    axes.text(*place, word, fontsize=8.5, color=INK, ha="center", va="center", zorder=5, bbox=back)


if __name__ == "__main__":
    draw()
