"""What linear readers make of an encoder's features of a data set's houses."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from agents.vision.encoder import Encoder
from agents.vision.labels import HouseStrips, mean_log_depth_of_views, visible_in_views
from agents.vision.probe import LabelledFeatures, ProbeScores
from embodied.datasets.store import Dataset


def labelled(
    data: Dataset, houses: Sequence[HouseStrips], encoder: Encoder, classes: Sequence[str]
) -> LabelledFeatures:
    """Features of houses and what a linear reader should read from them."""
    columns = [houses[0].classes.index(c) for c in classes]
    features = [encoder.encode_strips(h.rgb[i : i + 8]) for h in houses for i in range(0, len(h.rgb), 8)]
    return LabelledFeatures(
        np.concatenate(features),
        np.concatenate([visible_in_views(h.share[..., columns]) for h in houses]),
        np.concatenate([h.room for h in houses]).astype(np.int64),
        np.concatenate([mean_log_depth_of_views(h.log_depth) for h in houses]),
        np.concatenate([np.full(len(h.rgb), i) for i, h in enumerate(houses)]),
        np.concatenate([data.place(h.name).graph.positions for h in houses]),
    )


def as_numbers(reading: ProbeScores, classes: Sequence[str]) -> dict[str, Any]:
    """A reading for JSON; None for a class that no judged house shows."""
    numbers = {k: v for k, v in dataclasses.asdict(reading).items() if k != "ap"}
    ap = [None if math.isnan(x) else x for x in reading.ap]
    return numbers | {"ap by class": dict(zip(classes, ap, strict=True))}
