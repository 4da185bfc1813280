"""Would a stranger recognise it? Crops of our objects before a judge that has seen photographs only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import cv2
import numpy as np

from assets.cache import write_bytes, write_json
from embodied.bench.crops import Crop, kept_crops
from embodied.bench.light import TIMES as SKIES
from embodied.bench.views import ViewPair, kept_pair, likeness, write_pairs
from embodied.generate import HouseConfig, generate_house
from embodied.render.pictures import PictureSettings
from embodied.world import open_world

if TYPE_CHECKING:
    from collections.abc import Callable

    from assets.catalogue import Catalogue

HOUSES = 3
"""How many are looked at unless told otherwise."""
AREA = (35.0, 70.0)
"""Square metres of each, as in `bench light`."""
TIMES = (("night", 6.0), ("morning", 11.0), ("noon", 16.0), ("evening", 20.0), ("night", math.inf))
"""Times of the day, each with the hour it ends at."""
WORST, EACH, SMALL = 30, 4, 168
"""Classes that are shown, crops of each of them, and their pixels."""

_CHAIR = (423, 559, 765, 857)
_LAMP = (619, 818, 846)
_SOFA = (831,)
_DRAWERS = (493, 526, 553)
_PLANT = (738, 883)
MAPPED: dict[str, tuple[int, ...]] = {
    "alarm clock": (409, 530, 892),
    "armchair": (*_CHAIR, 831),
    "backpack": (414,),
    "bathroom vanity": (896, 648),
    "bathtub": (435, 876),
    "bed": (564, 750, 831),
    "bedside table": _DRAWERS,
    "beer bottle": (440, 907),
    "bookcase": (453,),
    "bowl": (659, 809),
    "ceiling lamp": _LAMP,
    "coffee cup": (504, 967, 968),
    "coffee maker": (505, 550),
    "coffee table": (532,),
    "computer": (508, 527, 664),
    "cooker": (827,),
    "cooking pot": (521, 567),
    "cooktop": (827,),
    "corner sofa": _SOFA,
    "crib": (520,),
    "cup": (504, 968),
    "desk": (526,),
    "desk lamp": _LAMP,
    "dining chair": _CHAIR,
    "dining table": (532,),
    "dishwasher": (534,),
    "doormat": (539,),
    "drawer cabinet": _DRAWERS,
    "dresser": _DRAWERS,
    "espresso machine": (505, 550),
    "ficus": _PLANT,
    "floor lamp": _LAMP,
    "floor vase": (883, 738),
    "fridge": (760,),
    "frying pan": (567,),
    "glass-door cabinet": (453, 495),
    "grand piano": (579,),
    "hanging towel": (434,),
    "kettle": (505, 725, 849),
    "laptop": (620, 681),
    "laundry basket": (588, 790),
    "media cabinet": (548,),
    "microwave": (651,),
    "mixing bowl": (659, 809),
    "mobile phone": (487, 590),
    "mug": (504, 968),
    "office chair": _CHAIR,
    "office table": (526,),
    "orchid": _PLANT,
    "oven": (651, 827),
    "pendant lamp": _LAMP,
    "potted plant": _PLANT,
    "printer": (742,),
    "radiator": (753,),
    "remote control": (761,),
    "salad bowl": (659, 809),
    "shelving unit": (453,),
    "side table": (493, 526, 532),
    "sideboard": (493, 495, 526),
    "small plant": _PLANT,
    "soap dispenser": (631, 804),
    "sofa": _SOFA,
    "sofa bed": _SOFA,
    "speaker": (632,),
    "suitcase": (414, 636),
    "table fan": (545,),
    "table lamp": _LAMP,
    "teapot": (849,),
    "teddy bear": (850,),
    "telephone": (487, 528, 707),
    "television": (548, 664, 851),
    "toaster": (859,),
    "toilet": (861,),
    "towel": (434,),
    "trash can": (412, 463),
    "umbrella": (879,),
    "upright piano": (881,),
    "vase": (883, 738),
    "wall lamp": _LAMP,
    "wall television": (548, 664, 851),
    "wall washbasin": (896,),
    "wardrobe": (894,),
    "washbasin": (896,),
    "washing machine": (897,),
    "waste bin": (412, 463),
    "watch": (409, 531),
    "wicker basket": (588, 790),
    "wine bottle": (907,),
}
"""Our classes, and ImageNet's (challenge of 2012, numbered from 0) that name the same thing or hold it. What
ImageNet has no word for is not judged: its "plate" (923) is a main course."""


class PhotographJudge(Protocol):
    """A network that knows photographs (agents.vision.stranger)."""

    def first_five(self, pictures: np.ndarray) -> np.ndarray:
        """(n, 5) classes of ImageNet, the likeliest first, of pictures (n, SIDE, SIDE, 3) uint8."""
        ...

    def features(self, pictures: np.ndarray) -> np.ndarray:
        """(n, k) of pictures (n, h, w, 3) uint8."""
        ...


@dataclass(frozen=True)
class LookReport:
    """What `embodied bench look` shows."""

    facts: dict
    text: str


def recognised(
    catalogue: Catalogue,
    cache: Path,
    out: Path,
    judge: PhotographJudge,
    *,
    seed: int,
    pictures: PictureSettings,
    houses: int = HOUSES,
    traced: bool = True,
    progress: Callable[[str], None] = lambda text: None,
) -> LookReport:
    """Show every mapped object of some houses to a judge, and a whole view of each beside the path tracer's.

    Writes look.json, the worst crops to look_worst.jpg and the views to look_views.jpg. What `out`/crops and
    `out`/views hold already, drawn by the same code, is not drawn again.

    Args:
      seed: of the first house.
      houses: how many, with consecutive seeds, and the times of day of `bench light` in turn.
      traced: whether views are compared with the path tracer's; it takes a bake and a minute of two cores per house.
    """
    crops: list[Crop] = []
    pairs: list[ViewPair] = []
    times: list[str] = []
    for k in range(houses):
        hour, weather = SKIES[k % len(SKIES)]
        house = generate_house(seed + k, HouseConfig(area=AREA, hour=hour, weather=weather), catalogue=catalogue)
        with open_world(house, catalogue, cache, pictures) as world:
            crops += kept_crops(world, MAPPED, out / "crops")
            if traced:
                pairs.append(kept_pair(world, out / "views"))
        times += [time_of(house.sky.hour)] * (len(crops) - len(times))
        progress(f"house {seed + k}: {len(house.placements)} objects, {len(crops)} crops so far")
    five = judge.first_five(np.stack([c.rgb for c in crops])) if crops else np.zeros((0, 5), int)
    right = np.array([bool(set(MAPPED[c.object_class]) & set(map(int, f))) for c, f in zip(crops, five, strict=True)])
    by_class = {}
    for name in sorted({c.object_class for c in crops}):
        mine = _of(crops, name)
        by_class[name] = (right[mine].tolist(), mine)
    worst = sorted(by_class, key=lambda n: (np.mean(by_class[n][0]), -len(by_class[n][0])))[:WORST]
    facts = {
        "houses": [seed + k for k in range(houses)],
        "quality": pictures.quality,
        "look": pictures.shown_with,
        "crops": len(crops),
        "objects": float(right.mean()) if len(right) else None,
        "classes": float(np.mean([np.mean(r) for r, _ in by_class.values()])) if by_class else None,
        "by_class": {name: {"shown": len(r), "recognised": int(np.sum(r))} for name, (r, _) in by_class.items()},
        "by_time": {
            name: {"shown": times.count(name), "recognised": int(sum(r for r, t in zip(right, times) if t == name))}
            for name in dict.fromkeys(times)
        },
        "views": likeness(pairs, judge.features),
        "guesses": [{"object": c.owner, "class": c.object_class, "five": f.tolist()} for c, f in zip(crops, five)],
        "worst": worst,
    }
    write_json(out / "look.json", facts, indent=1)
    if pairs:
        write_pairs(pairs, out / "look_views.jpg")
    if worst:
        rows = [sorted(by_class[name][1], key=lambda i: bool(right[i]))[:EACH] for name in worst]
        picture = sheet([[crops[i] for i in row] for row in rows], [right[row].tolist() for row in rows])
        jpeg = cv2.imencode(".jpg", picture[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
        write_bytes(out / "look_worst.jpg", jpeg.tobytes())
    return LookReport(facts, table(facts))


def time_of(hour: float) -> str:
    """The name in TIMES of an hour of the day."""
    return next(name for name, end in TIMES if hour < end)


def _of(crops: Sequence[Crop], name: str) -> list[int]:
    return [i for i, c in enumerate(crops) if c.object_class == name]


def table(facts: dict) -> str:
    """The shares in words, and the worst classes."""
    if facts["objects"] is None:
        return "no object was large enough to be shown"
    worst = (f"{n} {facts['by_class'][n]['recognised']}/{facts['by_class'][n]['shown']}" for n in facts["worst"])
    return (
        f"{facts['objects']:.0%} of {facts['crops']} objects and {facts['classes']:.0%} on average over "
        f"{len(facts['by_class'])} classes are among the judge's first five ({facts['quality']}, {facts['look']}, "
        f"houses {facts['houses']})\nby the house's hour: "
        + ", ".join(f"{n} {t['recognised']}/{t['shown']}" for n, t in facts["by_time"].items())
        + f"\n{_views(facts['views'])}worst: "
        + ", ".join(worst)
    )


def _views(views: dict) -> str:
    if not views["views"]:
        return ""
    text = f"whole views ({views['views']}): {views['own']:.3f} from the path tracer's of the same view"
    if views["others"] is not None:
        text += (
            f", whose pictures of other houses are {views['others']:.3f} apart; {views['nearest']:.0%} are nearest to "
            "their own (cosine distance of the judge's features)"
        )
    return text + "\n"


def sheet(rows: Sequence[Sequence[Crop]], right: Sequence[Sequence[bool]], across: int = 3) -> np.ndarray:
    """(h, w, 3) uint8: a strip of up to EACH small crops per class, `across` strips side by side.

    Args:
      right: whether the judge has each; the others have a red rim.
    """
    strips = []
    for crops, known in zip(rows, right, strict=True):
        cells = [_small(crop, ok) for crop, ok in zip(crops, known, strict=True)]
        cells += [np.full_like(cells[0], 255)] * (EACH - len(cells))
        strip = np.concatenate([np.full((18, SMALL * EACH, 3), 255, np.uint8), np.concatenate(cells, axis=1)])
        place = (4, 13)
        cv2.putText(strip, crops[0].object_class, place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA)
        strips.append(strip)
    strips += [np.full_like(strips[0], 255)] * (-len(strips) % across)
    return np.concatenate([np.concatenate(strips[k : k + across], axis=1) for k in range(0, len(strips), across)])


def _small(crop: Crop, known: bool) -> np.ndarray:
    cell = cv2.resize(crop.rgb, (SMALL, SMALL), interpolation=cv2.INTER_AREA)
    if not known:
        cv2.rectangle(cell, (0, 0), (SMALL - 1, SMALL - 1), (220, 30, 30), 2)
    return cell
