"""The voices of the house: a `Language` that speaks as people do, and a describer of what an agent did."""

import dataclasses
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from embodied.interface import Language, SeenPlace
from embodied.language.clauses import STOPS, Forward, RouteInstruction, StopHere, Turn
from embodied.language.grammar import parse, say
from embodied.language.lexicon import lexicon_of
from embodied.language.listener import carry_out
from embodied.language.plain_language import PlainLanguage
from embodied.language.route_clauses import plan, shortened
from embodied.language.surroundings import Lookout
from embodied.language.templates import draw_speaker
from embodied.seeds import check_novelty, stream

GROWTH = (0, 0, 1, 1, 2, 3, 4, 6)
"""Clauses beyond the speaker's own wish, try by try, while an imagined listener gets lost: other words, then more."""
ARRIVED = 3.0
"""Metres within which the imagined listener has understood, as in R2R's success."""


class People:
    """A `Language` in which several speakers with their own habits describe routes.

    Like people who know the way, a speaker checks in his mind whether somebody who reads the words
    would arrive (the rational speaker of ILIAD, dissertation 3.2.4), and says it otherwise if not.
    """

    habits: Mapping[str, Any] = {}
    """In which these speakers differ from others: fields of Speaker."""
    request, subgoal = PlainLanguage().request, PlainLanguage().subgoal

    def __init__(self, tries: int = len(GROWTH), novelty: str | None = None) -> None:
        """
        Args:
          tries: at most len(GROWTH); 1 says the first thing that comes to mind.
          novelty: 'familiar' for people to learn from, 'novel' for those who are kept from it; None for everybody.
        """
        check_novelty(novelty)
        self.tries, self.novelty = tries, novelty

    def route(self, world: SeenPlace, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        """'Leave the bedroom and turn left at once. Walk past the piano. Stop by the coffee table.'

        Args:
          path: nodes to walk along.
          yaw: the walker's first direction, radians.
        """
        speaker = dataclasses.replace(draw_speaker(rng, self.novelty), **self.habits)
        lexicon, best, least = lexicon_of(world.catalogue), "", np.inf
        wanted = max(round(rng.normal(speaker.clauses - 1, 1.0)), 2)
        for more in GROWTH[: self.tries]:
            phrases = shortened(plan(world, path, yaw, speaker, rng=rng), wanted + more)
            text = say(phrases, speaker, rng=rng)
            if self.tries == 1:
                return text
            heard = carry_out(Lookout(world), parse(text, lexicon), path[0], yaw)
            missed = float(world.graph.distance[heard.path[-1], path[-1]])
            if missed <= ARRIVED:
                return text
            if missed < least:
                best, least = text, missed
        return best


class Landmarks(People):
    """People who turn at what they see and count nothing, about paths on which turns alone lead astray."""

    habits = {"landmarks": 1.0, "metres": 0.0, "counts": 0.0, "clauses": 9}

    def route(self, world: SeenPlace, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        """As of People; '' for a path on which who hears only when to turn arrives."""
        text = super().route(world, path, yaw, rng=rng)
        heard = parse(text, lexicon_of(world.catalogue)).clauses
        turns = [c if isinstance(c, Turn) else StopHere() if isinstance(c, STOPS) else Forward() for c in heard]
        blindly = carry_out(Lookout(world), RouteInstruction(tuple(turns)), path[0], yaw).path
        return text if world.graph.distance[blindly[-1], path[-1]] > ARRIVED else ""


class RouteDescriber:
    """Describes any execution in words, P(d | e): ILIAD's teacher while no describer has been learned.

    Differs from the dissertation (3.2.5; docs/sources.md, S63), where the describer is learned from human
    descriptions: this one is the grammar itself, so what it says is always true of the execution.
    """

    def describe(self, world: SeenPlace, path: Sequence[int], yaw: float, *, rng: np.random.Generator) -> str:
        """One description of walking `path` (nodes, repeats allowed) with first direction `yaw`, radians."""
        nodes = [n for i, n in enumerate(path) if i == 0 or n != path[i - 1]]
        speaker = draw_speaker(rng)
        return say(shortened(plan(world, nodes, yaw, speaker, rng=rng), speaker.clauses), speaker, rng=rng)


@dataclass(frozen=True)
class Utterance:
    """Words of somebody and the primitive actions that were meant, without 'stop'."""

    words: tuple[str, ...]
    text: str


class PeoplesWords:
    """A `Language` with people's sub-goals where people meant the same actions, and another language's elsewhere."""

    def __init__(self, utterances: Iterable[Utterance], other: Language) -> None:
        self.request, self.route, self._subgoal = other.request, other.route, other.subgoal
        self._texts: defaultdict[tuple[str, ...], list[str]] = defaultdict(list)
        for u in utterances:
            self._texts[u.words].append(u.text)

    def subgoal(self, words: Sequence[str]) -> str:
        """Of several people's words for these actions, always the same ones."""
        texts = self._texts.get(tuple(w for w in words if w != "stop"))
        if not texts:
            return self._subgoal(words)
        return texts[int(stream(0, "said", *words).integers(len(texts)))]
