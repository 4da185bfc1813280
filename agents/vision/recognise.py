"""Things that a detector recognises in a panorama."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from embodied.agents.common.shipped import SHIPPED_DETECTOR
from embodied.agents.vision.detector import Detector
from embodied.agents.vision.encoder import Encoder
from embodied.agents.vision.features import strip_of
from embodied.agents.vision.labels import SHELL
from embodied.agents.vision.strip import STRIP_COLUMNS, cell_direction
from embodied.render.panorama import Panorama, Recognised


@dataclass(frozen=True, eq=False)
class Recogniser:
    """Names things in panoramas, but not walls, floors and ceilings, and where they are, to a cell of 10 degrees.

    Examples:
      >>> recogniser = Recogniser.load(load_encoder())
      >>> recogniser(world.panorama(0))[0].name
      'sofa'
    """

    detector: Detector
    least: float = 0.3
    """Probability from which on a cell shows a class."""

    @classmethod
    def load(cls, encoder: Encoder, path: Path = SHIPPED_DETECTOR) -> Recogniser:
        """With the detector of a file; errors: as Detector.load."""
        return cls(Detector.load(encoder, path))

    def __call__(self, panorama: Panorama, most: int = 8) -> list[Recognised]:
        """The `most` surest classes in a panorama, the surest first, each where it is seen best."""
        likely = self.detector(strip_of(panorama)[None])[0][0].reshape(len(self.detector.classes), -1)  # (C, 12 * 36)
        best, cells = likely.max(1), likely.argmax(1)
        recognised: list[Recognised] = []
        for k in (-best).argsort(kind="stable").tolist():
            if best[k] < self.least or len(recognised) == most:
                break
            if (name := self.detector.classes[k]) not in SHELL:
                recognised.append(
                    Recognised(name, float(best[k]), *cell_direction(*divmod(int(cells[k]), STRIP_COLUMNS)))
                )
        return recognised
