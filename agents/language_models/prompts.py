"""Prompts are files: what the model is (above a line of three dashes), and what it is told each time (below). A schema
holds the actions that an agent may answer with.

An agent is told its observation in words and in pictures: what is in sight, where one can go, what can be done. No word
tells one place from another. A picture is one numbered strip of candidate views, or the panorama with numbered markers.
"""

import base64
import dataclasses
import io
import math
import string
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from embodied import interface
from embodied.agents.language_models.client import Message
from embodied.agents.language_models.completions import object_schema
from embodied.assets.json_file import read_text
from embodied.assistants.descriptions import side
from embodied.geometry import wrap
from embodied.gym.sensors import PanoramaStore
from embodied.house.floor_plan import font
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


Names = Callable[[interface.Sight], Sequence[tuple[str, float, float]]]
"""Names what can be seen of a sight, a stand-in for eyes: (object class, yaw in radians, metres), the largest in view
first."""


def oracle_names(worlds: Mapping[str, interface.SeenPlace]) -> Names:
    """The true names of what can be seen: an oracle in place of pictures."""

    def names(sight: interface.Sight) -> list[tuple[str, float, float]]:
        here = interface.viewpoint(sight)
        seen = place_named(worlds, here.world).sightings(here.node)
        return [(s.object_class, s.yaw, s.distance) for s in seen if s.pixels >= SMALLEST_SIGHTING][:MOST_NAMES]

    return names


def actions_by_name(o: interface.Observation) -> dict[str, interface.Action]:
    """Every possible action by the name that a model calls it by."""
    c = o.candidates
    moves: dict[str, interface.Action] = {
        (c.words[i] if c.words else f"go {i}"): interface.Move(i) for i in range(len(c)) if bool(c.allowed[i])
    }
    return {
        **moves,
        **{f"open {k}": interface.Open(k) for k in o.can_open},
        **{f"close {k}": interface.Close(k) for k in o.can_close},
        **{f"ask {i.value}": interface.Ask(i) for i in o.can_ask},
        "stop": interface.Stop(),
    }


def candidates_in_words(o: interface.Observation, names: Sequence[tuple[str, float, float]] = ()) -> str:
    """The candidates: 'go 0: straight ahead, towards the sofa; go 1: ...'."""
    if o.candidates.words:
        return ", ".join(w for w, ok in zip(o.candidates.words, o.candidates.allowed) if ok)
    yaw, clauses = o.turn * interface.STEP, []
    for i, bearing in enumerate(o.candidates.bearing):
        off = [(abs(float(wrap(y - yaw - bearing))), name) for name, y, _ in names]
        towards = f", towards the {min(off)[1]}" if off and min(off)[0] < interface.STEP / 2 else ""
        slope = float(o.candidates.slope[i])
        stairs = "" if abs(slope) < math.radians(15) else f", {'up' if slope > 0 else 'down'} the stairs"
        door = ", behind a closed door" if i in o.can_open else ""
        clauses.append(f"go {i}: {side(float(bearing))}{towards}{stairs}{door}")
    return "; ".join(clauses) or "nowhere"


def observation_in_words(o: interface.Observation, names: Sequence[tuple[str, float, float]] = ()) -> str:
    """The place in words: names of what is in sight, and what the kind of task adds."""
    yaw = o.turn * interface.STEP
    parts = [f"{name} ({side(y - yaw)}, {d:.0f} m)" for name, y, d in names]
    if o.extras is not None:
        parts += o.extras.lines(o.turn)
    return "; ".join(parts) or "nothing that has a name"


def pictures_for(o: interface.Observation, panoramas: PanoramaStore, how: str) -> tuple[str, ...]:
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


def strip(o: interface.Observation, panorama: Panorama) -> Image.Image:
    """The view towards each candidate, side by side, its number in the corner; of VNLA, the view ahead."""
    yaw, numbers = o.turn * interface.STEP, list(range(len(o.candidates)))
    looks = [(yaw + float(o.candidates.bearing[i]), float(o.candidates.slope[i])) for i in numbers]
    if o.candidates.words or not looks:
        numbers, looks = [], [(yaw, float(interface.VIEW_PITCHES[12 * (o.tilt + 1)]))]
    sheet = Image.new("RGB", (VIEW_SIZE * len(looks) + 4 * (len(looks) - 1), VIEW_SIZE), "white")
    pen = ImageDraw.Draw(sheet)
    for k, (along, pitch) in enumerate(looks):
        view = panorama.view_rgb(along, pitch, VIEW_ANGLE, size=(VIEW_SIZE, VIEW_SIZE))
        sheet.paste(Image.fromarray(view), (k * (VIEW_SIZE + 4), 0))
        if numbers:
            _label(pen, k * (VIEW_SIZE + 4) + 20, 20, numbers[k])
    return sheet


def marked_panorama(o: interface.Observation, panorama: Panorama) -> Image.Image:
    """Everything around, the gaze in the middle, a numbered marker towards each candidate."""
    yaw = o.turn * interface.STEP
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


PROMPTS = Path(__file__).parent / "prompts"
REMEMBERED_STEPS = 8
"""Past steps that the model is told of."""
AGENT_VARIABLES = ("instruction", "history", "sees", "ways", "actions", "time")
"""Names in the template of prompts/agent.md."""


@dataclass(frozen=True)
class Prompt:
    """A system message and a template with `$names`."""

    system: str
    template: string.Template

    def messages(self, pictures: tuple[str, ...] = (), **facts: str) -> list[Message]:
        """The messages of one request.

        Args:
          pictures: data URLs, shown after the text.
          facts: values of the template's variables.
        """
        text = self.template.substitute(facts)
        content: object = text
        if pictures:
            shown = [{"type": "image_url", "image_url": {"url": url}} for url in pictures]
            content = [{"type": "text", "text": text}, *shown]
        return [{"role": "system", "content": self.system}, {"role": "user", "content": content}]


def read_prompt(name: str, names: tuple[str, ...], folder: Path | None = None) -> Prompt:
    """The prompt `name`.md of a folder, or the shipped one where the folder has none.

    Args:
      names: variables that its template may hold.

    Raises:
      ValueError: no line of three dashes, or a name that is not among `names`.
    """
    own_path = None if folder is None else Path(folder) / f"{name}.md"
    path = own_path if own_path is not None and own_path.exists() else PROMPTS / f"{name}.md"
    system, dashes, template = read_text(path).partition("\n---\n")
    parsed = string.Template(template)
    if not dashes or not parsed.is_valid():
        raise ValueError(f"{path} should hold a system message, a line of three dashes, and a template with $names")
    if unknown := sorted(set(parsed.get_identifiers()) - set(names)):
        raise ValueError(f"{path} names {['$' + n for n in unknown]}; it may name {['$' + n for n in names]}")
    return Prompt(" ".join(system.split()), parsed)


@dataclass(frozen=True, eq=False)
class PromptBuilder:
    """Builds the prompt of an agent's model from an observation."""

    namer: Names | None = None
    """Names the things in sight; None for a model that is told only where it can go."""
    panoramas: PanoramaStore | None = None
    """Pictures for a model that sees; None for one that reads only."""
    pictures: str = "strip"
    """One of embodied.agents.language_models.prompts.PICTURE_FORMS."""
    prompt: Prompt = dataclasses.field(default_factory=lambda: agent_prompt())

    def messages(self, o: interface.Observation, history: Sequence[str] = ()) -> list[Message]:
        """The observation in words, with pictures where there are any.

        Args:
          history: what was done before, step by step.
        """
        names = () if self.namer is None else self.namer(o.sight)
        return self.prompt.messages(
            () if self.panoramas is None else pictures_for(o, self.panoramas, self.pictures),
            instruction=o.instruction,
            history=" ".join(history[-REMEMBERED_STEPS:]) or "nothing yet",
            sees=observation_in_words(o, names),
            ways=candidates_in_words(o, names),
            actions=", ".join(actions_by_name(o)),
            time=str(o.time),
        )


def agent_prompt(folder: Path | None = None) -> Prompt:
    """The prompt of an agent; `folder` may hold an agent.md of one's own."""
    return read_prompt("agent", AGENT_VARIABLES, folder)


def schema_of(o: interface.Observation) -> dict[str, Any]:
    """A schema of the possible answers."""
    text = lambda most: {"type": "string", "maxLength": most}
    free = {"question": text(300)} if interface.Intention.FREE in o.can_ask else {}
    return object_schema(reason=text(100), action={"type": "string", "enum": list(actions_by_name(o))}, **free)


def action_in(o: interface.Observation, value: Mapping[str, Any]) -> interface.Action:
    """The action that a valid answer names."""
    action = actions_by_name(o)[value["action"]]
    if isinstance(action, interface.Ask) and action.intention is interface.Intention.FREE:
        return dataclasses.replace(action, question=value["question"])
    return action


def action_in_words(o: interface.Observation, action: interface.Action) -> str:
    """An action that was taken, for the history."""
    if isinstance(action, interface.Ask):
        return f"You asked: {action.question or action.intention.value}."
    if isinstance(action, interface.Stop):
        return "You stopped."
    if o.candidates.words:
        return f"You did {o.candidates.words[action.candidate]}."
    where = side(float(o.candidates.bearing[action.candidate]))
    if isinstance(action, interface.Move):
        return f"You went {where}."
    return f"You {'opened' if isinstance(action, interface.Open) else 'closed'} the door {where}."
