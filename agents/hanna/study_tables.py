"""The dissertation's tables of 4.2 as data: which agents they compare, how each is trained, and what was printed.

Agents are named by what is different about their training; agents that several tables share are trained once.
`printed` holds the dissertation's numbers (Matterport3D houses, human routes): comparable in shape, not in level.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from agents.hanna.evaluation import PLAINER, PRICED

VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "final": {},
    "no ask": {"ask_rule": "never", "alpha": 0.5},
    "random ask": {"ask_rule": "random", "alpha": 0.5},
    "ask every 5": {"ask_rule": "every5", "alpha": 0.5},
    "target image only": {"read_assistance": False},
    "no curiosity": {"alpha": 0.0},
    "lstm": {"model": "lstm", "alpha": 0.0, "predict_reasons": False},
    "no reset": {"reset_inter_task": False},
    "no conditions": {"predict_reasons": False},
    "no similarity": {"similarity_attention": False},
    "8 houses": {"training_houses": 8},
    "32 houses": {"training_houses": 32},
    "128 houses": {"training_houses": 128},
    "256 houses": {"training_houses": 256},
    "3 lightings": {"lights": 3},
    "half curiosity": {"alpha": 0.5},
    "no curiosity, no conditions": {"alpha": 0.0, "predict_reasons": False},
    "price 0.25": {"ask_price": 0.25},
    "price 4": {"ask_price": 4.0},
    "no guided asking": {"guided_asking": 0.0},
    "no curiosity floor": {"curiosity_floor": 0.0},
    "no environment dropout": {"environment_dropout": 0.0},
    "no falling rate": {"cooldown": 0.0},
}
"""What differs from the chosen settings, by agent. Alpha is 0.5 with heuristic askers (Table D.1, note). Half curiosity
(learned asking with the alpha of heuristic askers) and our model without what the LSTM lacks are in no printed row, but
agents that are compared should differ in one thing."""
PRICES = ("price 0.25", "price 4")
DEPARTURES = ("no guided asking", "no curiosity floor", "no environment dropout", "no falling rate")
"""Agents trained with one thing less that `mini` does otherwise than Table D.1 (docs/sources.md, S32 to S35)."""
HOUSES = ("8 houses", "32 houses", "128 houses", "256 houses")
SHORTER = {f"{name}, equal passes": name for name in HOUSES}
"""Agents that are trained like those of VARIANTS, but see each of their tasks only as often as the agent of all houses
sees one of its own."""


@dataclass(frozen=True)
class Line:
    """One row of a table."""

    label: str
    variant: str
    """Key of VARIANTS, or '' for an agent that does not learn."""
    played: str = "learned"
    """Which of agents.hanna.evaluation.hanna_policies, or the name of an agent without learning."""
    printed: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Column to the dissertation's numbers, one per split."""

    @property
    def key(self) -> str:
        return f"{self.variant}, {self.played}" if self.variant else self.played


@dataclass(frozen=True)
class Table:
    """One table of the dissertation."""

    title: str
    splits: tuple[str, ...]
    columns: tuple[str, ...]
    lines: tuple[Line, ...]
    compared: tuple[tuple[str, str], ...] = ()
    """Pairs of VARIANTS that differ in one thing, whose difference is told task by task."""


def _line(label: str, variant: str, played: str = "learned", **printed: Sequence[float]) -> Line:
    return Line(label, variant, played, {name.replace("_", " "): values for name, values in printed.items()})


TEST, VALIDATION = ("test_seen", "test_unseen"), ("val_seen", "val_unseen")
COMPARED = ("success", "spl", "requests")
"""What pairs of agents are compared by."""
FULL = ("success", "spl", "navigation error", "requests")
TABLES: Mapping[str, Table] = {
    "4.3": Table(
        "Results on the test splits",
        TEST,
        FULL,
        (
            _line(
                "Random walk",
                "",
                "random walk",
                success=(0.54, 0.46),
                spl=(0.33, 0.23),
                navigation_error=(15.38, 15.34),
                requests=(0, 0),
            ),
            _line(
                "Forward 10",
                "",
                "forward 10",
                success=(5.98, 6.36),
                spl=(4.19, 4.78),
                navigation_error=(14.61, 13.81),
                requests=(0, 0),
            ),
            _line(
                "No assistance",
                "no ask",
                success=(17.21, 8.10),
                spl=(13.76, 4.23),
                navigation_error=(11.48, 13.22),
                requests=(0, 0),
            ),
            _line(
                "Learn to interpret assistance",
                "final",
                success=(86.67, 45.43),
                spl=(63.27, 25.02),
                navigation_error=(1.63, 8.04),
                requests=(2.7, 4.4),
            ),
            _line(
                "Shortest", "", "shortest", success=(100, 100), spl=(100, 100), navigation_error=(0, 0), requests=(0, 0)
            ),
            _line(
                "Perfect assistance interpretation",
                "final",
                "learned, perfect interpretation",
                success=(90.19, 79.01),
                spl=(68.76, 54.86),
                navigation_error=(1.16, 2.65),
                requests=(2.4, 3.0),
            ),
        ),
    ),
    "4.4": Table(
        "Types of assistance",
        TEST,
        ("success",),
        (
            _line("Target image only", "target image only", success=(84.29, 29.91)),
            _line("+ language instruction", "final", success=(86.67, 45.43)),
        ),
        (("final", "target image only"),),
    ),
    "4.5": Table(
        "Help-request policies",
        TEST,
        ("success", "requests"),
        (
            _line("No ask", "no ask", success=(17.21, 8.10), requests=(0, 0)),
            _line("Random ask", "random ask", success=(78.40, 35.97), requests=(4.1, 6.6)),
            _line("Ask every 5", "ask every 5", success=(86.63, 33.62), requests=(3.5, 7.1)),
            _line("Learned", "final", success=(86.67, 45.43), requests=(2.7, 4.4)),
        ),
        (("half curiosity", "no ask"), ("half curiosity", "random ask"), ("half curiosity", "ask every 5")),
    ),
    "4.6": Table(
        "Model and curiosity",
        ("test_unseen",),
        ("success", "mistake repeat", "request repeat"),
        (
            _line("LSTM encoder-decoder", "lstm", success=(19.25,), mistake_repeat=(31.09,), request_repeat=(49.37,)),
            _line(
                "Our model, alpha = 0",
                "no curiosity",
                success=(41.92,),
                mistake_repeat=(25.20,),
                request_repeat=(39.85,),
            ),
            _line("Our model, alpha = 1", "final", success=(45.43,), mistake_repeat=(20.53,), request_repeat=(10.80,)),
        ),
        (("no curiosity, no conditions", "lstm"), ("final", "no curiosity")),
    ),
    "D.2": Table(
        "Ablations",
        VALIDATION,
        FULL,
        (
            _line(
                "Final agent",
                "final",
                success=(86.06, 45.39),
                spl=(62.49, 23.33),
                navigation_error=(1.48, 8.21),
                requests=(2.7, 4.5),
            ),
            _line(
                "No inter-task reset",
                "no reset",
                success=(83.62, 40.60),
                spl=(60.44, 19.89),
                navigation_error=(1.44, 8.26),
                requests=(3.2, 7.3),
            ),
            _line(
                "No condition prediction",
                "no conditions",
                success=(69.51, 45.72),
                spl=(44.87, 23.35),
                navigation_error=(3.11, 6.56),
                requests=(4.7, 8.1),
            ),
            _line(
                "No cosine-similarity attention",
                "no similarity",
                success=(80.44, 38.69),
                spl=(56.63, 19.86),
                navigation_error=(1.89, 8.81),
                requests=(3.7, 8.5),
            ),
            _line(
                "No curiosity loss",
                "no curiosity",
                success=(86.66, 39.92),
                spl=(69.66, 21.33),
                navigation_error=(1.28, 8.66),
                requests=(2.0, 7.7),
            ),
        ),
        tuple(("final", other) for other in ("no reset", "no conditions", "no similarity", "no curiosity")),
    ),
    "houses": Table(
        "Success and the number of training houses (no counterpart in the dissertation)",
        TEST,
        FULL,
        (
            *(_line(name, name) for name in HOUSES),
            _line("all houses", "final"),
            *(_line(name, name) for name in SHORTER),
            *(_line(f"{name}, without a trail", name, "learned, without a trail") for name in HOUSES),
            _line("all houses, without a trail", "final", "learned, without a trail"),
        ),
        (*((more, fewer) for fewer, more in itertools.pairwise(HOUSES)), *(("final", fewer) for fewer in HOUSES)),
    ),
    "lights": Table(
        "Success and the number of lightings of each training house (no counterpart in the dissertation)",
        TEST,
        FULL,
        (_line("1 lighting", "final"), _line("3 lightings", "3 lightings")),
        (("3 lightings", "final"),),
    ),
    "departures": Table(
        "What mini does otherwise than Table D.1, one thing less at a time (no counterpart in the dissertation)",
        TEST,
        (*FULL, "mistake repeat", "request repeat"),
        (
            _line("as mini is", "final"),
            *(_line(name, name) for name in DEPARTURES),
            _line("no reasons", "no conditions"),
            *(_line(name.removeprefix("learned, "), "final", name) for name in PLAINER),
        ),
        tuple(("final", other) for other in (*DEPARTURES, "no conditions")),
    ),
    "requests": Table(
        "Success and the number of requests (no counterpart in the dissertation)",
        ("test_unseen",),
        ("success", "spl", "requests"),
        (
            *(_line(name.removeprefix("learned, "), "final", name) for kind in PRICED.values() for name in kind),
            *(_line(f"trained at {name}", name) for name in PRICES),
        ),
    ),
}
"""The studies by name. D.2 is on the validation splits, as in the dissertation."""
