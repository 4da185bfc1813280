"""Features of panoramas as they are seen: what Gymnasium environments show where no features were made before."""

import numpy as np

from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.vision.encoder import Encoder, load_encoder
from embodied.agents.vision.features import encode_panoramas
from embodied.gym.sensors import PanoramaStore
from embodied.interface import VIEWS, Sight, Viewpoint, viewpoint


class LiveFeatures:
    """A FeatureSource that looks at each panorama once, when it is first asked for, and remembers."""

    def __init__(self, encoder: Encoder, store: PanoramaStore) -> None:
        self._encoder, self._store = encoder, store
        self._known: dict[Viewpoint, np.ndarray] = {}
        self.size = encoder.size

    def features(self, sight: Sight) -> np.ndarray:
        """(36, D) float32; about 25 ms of processor time the first time, 100 kB for ever."""
        key = viewpoint(sight)
        if key not in self._known:
            made = encode_panoramas(self._encoder, [self._store.at(sight)])[0]
            self._known[key] = made.astype(np.float32).reshape(VIEWS, self.size)
        return self._known[key]


def shipped_features(store: PanoramaStore) -> LiveFeatures:
    """The shipped encoder's features: entry point 'default' of the group 'embodied.encoders'."""
    return LiveFeatures(load_encoder(SHIPPED_ENCODER), store)
