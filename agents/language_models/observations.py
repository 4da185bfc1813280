"""An observation in words and in pictures: what is in sight, where one can go, what can be done.

No word tells one place from another. A picture is one numbered strip of candidate views, or the panorama with numbered
markers.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from PIL import Image, ImageDraw

from embodied.action_spaces import door_actions
from embodied.assistants.descriptions import side
from embodied.geometry import wrap
from embodied.gym.sensors import PanoramaStore
from embodied.house.floor_plan import font
from embodied.interface import STEP, VIEW_PITCHES, Action, Ask, Move, Observation, SeenPlace, Sight, Stop, viewpoint
from embodied.navigation.doors import place_named
from embodied.render.panorama import Panorama

MOST_NAMES = 12
"""Things that are named of one place."""
SMALLEST_SIGHTING = 20
"""Fewest pixels of a sighting (of 24576 around) of what is named."""
VIEW_SIZE = 224
"""Height and width of a candidate's view, pixels."""
VIEW_ANGLE = np.radians(75.0)
"""Its vertical field of view, radians."""
PANORAMA_HEIGHT = 384
"""Height of the panorama, pixels."""
PICTURE_FORMS = ("strip", "panorama")


Names = Callable[[Sight], Sequence[tuple[str, float, float]]]
"""Names what can be seen of a sight, a stand-in for eyes: (object class, yaw in radians, metres), the largest in view
first."""


def oracle_names(worlds: Mapping[str, SeenPlace]) -> Names:
    """The true names of what can be seen: an oracle in place of pictures."""

    def names(sight: Sight) -> list[tuple[str, float, float]]:
        here = viewpoint(sight)
        seen = place_named(worlds, here.world).sightings(here.node)
        return [(s.object_class, s.yaw, s.distance) for s in seen if s.pixels >= SMALLEST_SIGHTING][:MOST_NAMES]

    return names


def actions_by_name(o: Observation) -> dict[str, Action]:
    """Every possible action by the name that a model calls it by."""
    c = o.candidates
    moves: dict[str, Action] = {
        (c.words[i] if c.words else f"go {i}"): Move(i) for i in range(len(c)) if bool(c.allowed[i])
    }
    return {**moves, **door_actions(o), **{f"ask {i.value}": Ask(i) for i in o.can_ask}, "stop": Stop()}


def candidates_in_words(o: Observation, names: Sequence[tuple[str, float, float]] = ()) -> str:
    """The candidates: 'go 0: straight ahead, towards the sofa; go 1: ...'."""
    if o.candidates.words:
        return ", ".join(w for w, ok in zip(o.candidates.words, o.candidates.allowed) if ok)
    yaw, clauses = o.turn * STEP, []
    for i, bearing in enumerate(o.candidates.bearing):
        off = [(abs(float(wrap(y - yaw - bearing))), name) for name, y, _ in names]
        towards = f", towards the {min(off)[1]}" if off and min(off)[0] < STEP / 2 else ""
        slope = float(o.candidates.slope[i])
        stairs = "" if abs(slope) < math.radians(15) else f", {'up' if slope > 0 else 'down'} the stairs"
        door = ", behind a closed door" if i in o.can_open else ""
        clauses.append(f"go {i}: {side(float(bearing))}{towards}{stairs}{door}")
    return "; ".join(clauses) or "nowhere"


def observation_in_words(o: Observation, names: Sequence[tuple[str, float, float]] = ()) -> str:
    """The place in words: names of what is in sight, and what the kind of task adds."""
    yaw = o.turn * STEP
    parts = [f"{name} ({side(y - yaw)}, {d:.0f} m)" for name, y, d in names]
    if o.extras is not None:
        parts += o.extras.lines(o.turn)
    return "; ".join(parts) or "nothing that has a name"


def pictures_for(o: Observation, panoramas: PanoramaStore, how: str) -> tuple[str, ...]:
    """The pictures of an observation as data URLs; the image that is looked for (HANNA) last.

    Args:
      how: one of PICTURE_FORMS.

    Raises:
      ValueError: another word.
    """
    if how not in PICTURE_FORMS:
        raise ValueError(f"pictures should be one of {PICTURE_FORMS}, got {how!r}")
    here = panoramas.at(o.sight)
    first = strip(o, here) if how == "strip" else marked_panorama(o, here)
    target = () if o.target is None else (_url(around(panoramas.at(o.target), 0.0, PANORAMA_HEIGHT // 2)),)
    return (_url(first), *target)


def strip(o: Observation, panorama: Panorama) -> Image.Image:
    """The view towards each candidate, side by side, its number in the corner; of VNLA, the view ahead."""
    yaw, numbers = o.turn * STEP, list(range(len(o.candidates)))
    looks = [(yaw + float(o.candidates.bearing[i]), float(o.candidates.slope[i])) for i in numbers]
    if o.candidates.words or not looks:
        numbers, looks = [], [(yaw, float(VIEW_PITCHES[12 * (o.tilt + 1)]))]
    sheet = Image.new("RGB", (VIEW_SIZE * len(looks) + 4 * (len(looks) - 1), VIEW_SIZE), "white")
    pen = ImageDraw.Draw(sheet)
    for k, (along, pitch) in enumerate(looks):
        view = panorama.view_rgb(along, pitch, VIEW_ANGLE, size=(VIEW_SIZE, VIEW_SIZE))
        sheet.paste(Image.fromarray(view), (k * (VIEW_SIZE + 4), 0))
        if numbers:
            _label(pen, k * (VIEW_SIZE + 4) + 20, 20, numbers[k])
    return sheet


def marked_panorama(o: Observation, panorama: Panorama) -> Image.Image:
    """Everything around, the gaze in the middle, a numbered marker towards each candidate."""
    yaw = o.turn * STEP
    sheet = around(panorama, yaw, PANORAMA_HEIGHT)
    pen = ImageDraw.Draw(sheet)
    if not o.candidates.words:
        for i, bearing in enumerate(o.candidates.bearing):
            x = (0.5 - float(bearing) / (2 * np.pi)) * 2 * PANORAMA_HEIGHT
            _label(pen, round(x), round(PANORAMA_HEIGHT * (0.62 - float(o.candidates.slope[i]) / np.pi)), i)
    return sheet


def around(panorama: Panorama, yaw: float, height: int) -> Image.Image:
    """The panorama as one picture (height, 2 height) with `yaw` (radians) in its middle."""
    whole = panorama.equirect(height)
    return Image.fromarray(np.roll(whole, round(yaw / (2 * np.pi) * 2 * height), axis=1))


def _label(pen: ImageDraw.ImageDraw, x: int, y: int, number: int) -> None:
    pen.ellipse((x - 13, y - 13, x + 13, y + 13), fill="white", outline="black", width=2)
    pen.text((x, y), str(number), font=font(18), fill="black", anchor="mm")


def _url(picture: Image.Image) -> str:
    """A JPEG as a data URL: the same picture gives the same bytes with one version of Pillow."""
    out = io.BytesIO()
    picture.save(out, "JPEG", quality=85)
    return "data:image/jpeg;base64," + base64.b64encode(out.getvalue()).decode()
