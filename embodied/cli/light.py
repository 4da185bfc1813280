"""Light a generated house once, so that rendering it is fast and photo-realistic.

Bakes global illumination (sky, sun and lamps, several bounces) into textures, which the cache keeps. Rerun an
interrupted command to resume. Another hour, weather, landscape, season or lamps are kept in lights.json beside
house.json, and pictures and exports of the folder show them; delete the file to go back. --lights also lights the
house at other hours, each in less than half of the time, and lists them there.
"""

from __future__ import annotations

import argparse
import dataclasses
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from embodied.cli.common import Furnished, Printed, catalogue_of, show
from embodied.house.house import LANDSCAPES, SEASONS, WEATHERS
from embodied.options import Option, house_folder, whole

if TYPE_CHECKING:
    from embodied.house.house import House

TIMES = {"dawn": 6.5, "morning": 9.0, "noon": 12.5, "afternoon": 15.5, "dusk": 19.2, "night": 23.0}
"""Words for --hour, as local solar hours."""


def hour_of_day(text: str) -> float:
    """Hours in [0, 24) of a word, a number, or hours and minutes."""
    try:
        clock = re.fullmatch(r"(\d{1,2}):([0-5]\d)", text)
        hours = int(clock[1]) + int(clock[2]) / 60 if clock else TIMES[text] if text in TIMES else float(text)
    except ValueError:
        hours = -1.0
    if not 0 <= hours < 24:
        raise argparse.ArgumentTypeError(
            f"should be one of {', '.join(TIMES)} or an hour from 0 to 24 such as 17:30 or 17.5, got {text[:40]!r}"
        )
    return hours


@dataclass(frozen=True, kw_only=True)
class LightOptions(Furnished, Printed):
    folder: Annotated[Path, Option(house_folder, "DIR", name="folder")]
    """Folder that `embodied house` wrote."""
    hour: Annotated[float | None, Option(hour_of_day, "HOUR")] = None
    """Hour of the day: dawn, morning, noon, afternoon, dusk, night, or one such as 17:30 or 17.5."""
    weather: Annotated[str | None, Option(words=WEATHERS)] = None
    """The sky."""
    landscape: Annotated[str | None, Option(words=LANDSCAPES)] = None
    """Landscape that the windows show."""
    season: Annotated[str | None, Option(words=SEASONS)] = None
    """The season of the landscape."""
    lamps: Annotated[str | None, Option(words=("on", "off"))] = None
    """Switch all lamps."""
    quality: Annotated[str, Option(words=("fast", "normal", "high"))] = "normal"
    """Quality of the light: fast for data sets, normal for videos, high for single pictures."""
    lights: Annotated[int, Option(whole(1, 100), "K")] = 1
    """Light it K times: as it is, and with hour, weather and lamps drawn from its seed."""


def run(args: LightOptions) -> None:
    from embodied.house.validation import load_lit_house, save_lightings
    from embodied.light import bake_all, lightings_of, progress_bar
    from embodied.light.backend import device
    from embodied.locks import locked

    device()  # or LightError, before any work
    catalogue = catalogue_of(args)
    house = load_lit_house(args.folder, catalogue)
    changed = with_sky(house, args)
    lightings = lightings_of(changed, args.lights)
    if args.lights > 1 or changed != house:
        with locked(args.folder):
            save_lightings(args.folder, lightings)
    with progress_bar() as progress:
        bakes = bake_all(lightings, catalogue, args.cache, args.quality, progress=progress)
    facts = [
        {"house": h.digest, "hour": h.sky.hour, "weather": h.sky.weather, "lamps": sum(x.on for x in h.lights)}
        | {"quality": args.quality, "light": b.manifest["key"], "seconds": b.manifest["total_seconds"]}
        | {"processor_seconds": b.manifest["processor_seconds"], "check": b.manifest["check"]}
        for h, b in zip(lightings, bakes)
    ]
    text = "; ".join(f"{h.sky.hour:g} h, {h.sky.weather}" for h in lightings)
    message = (
        f"{changed.name} is lit at {text}\n"
        f"pictures: embodied render {args.folder} --pictures {'fast' if args.quality == 'fast' else 'normal'}\n"
        f"MuJoCo:   embodied export mjcf --house {args.folder} --light {args.quality} --out {args.folder / 'lit'}"
    )
    show(args, facts[0] if args.lights == 1 else {"lights": facts}, message)


def with_sky(house: House, args: LightOptions) -> House:
    """`house` as the options want its sky, surroundings and lamps."""
    given = {name: getattr(args, name) for name in ("hour", "weather", "landscape", "season")}
    sky = dataclasses.replace(house.sky, **{name: value for name, value in given.items() if value is not None})
    lights = house.lights
    if args.lamps is not None:
        lights = tuple(dataclasses.replace(light, on=args.lamps == "on") for light in lights)
    return dataclasses.replace(house, sky=sky, lights=lights)
