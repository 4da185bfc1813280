"""Words to numbers and back, for one language: whole words as in the dissertation, or SentencePiece's pieces."""

from __future__ import annotations

import collections
import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Protocol

from agents.common.vocabulary import END, PAD, UNKNOWN, Vocabulary
from embodied.errors import UnableError

PAD_NUMBER, UNKNOWN_NUMBER, END_NUMBER = 0, 1, 2
"""Numbers of PAD, UNKNOWN and END; END also stands before the first word of a translation."""


class WordNumbers(Protocol):
    """Turns the words of a sentence into numbers, and numbers into words."""

    def __len__(self) -> int: ...

    def encode(self, words: Sequence[str]) -> list[int]:
        """Numbers of the words, END last."""

    def decode(self, numbers: Sequence[int]) -> tuple[str, ...]:
        """Words of the numbers before the first END."""

    def to_json(self) -> dict[str, Any]:
        """What `lexicon_from_json` reads."""


@dataclass(frozen=True)
class Words:
    """Whole words; those that are too rare are UNKNOWN."""

    vocabulary: Vocabulary

    def __len__(self) -> int:
        return len(self.vocabulary)

    def encode(self, words: Sequence[str]) -> list[int]:
        number = self.vocabulary.number_of
        return [number.get(w, UNKNOWN_NUMBER) for w in words] + [END_NUMBER]

    def decode(self, numbers: Sequence[int]) -> tuple[str, ...]:
        return tuple(self.vocabulary.words[n] for n in before_end(numbers))

    def to_json(self) -> dict[str, Any]:
        return {"kind": "words", "words": list(self.vocabulary.words)}


class Pieces:
    """Parts of words, by the library sentencepiece (`pip install sentencepiece`): no word is unknown."""

    def __init__(self, model: bytes) -> None:
        self.model, self._processor = model, _sentencepiece().SentencePieceProcessor(model_proto=model)

    def __len__(self) -> int:
        return self._processor.get_piece_size()

    def encode(self, words: Sequence[str]) -> list[int]:
        return [*self._processor.encode(" ".join(words)), END_NUMBER]

    def decode(self, numbers: Sequence[int]) -> tuple[str, ...]:
        return tuple(self._processor.decode(before_end(numbers)).split())

    def to_json(self) -> dict[str, Any]:
        return {"kind": "pieces", "model": self.model.hex()}


def before_end(numbers: Sequence[int]) -> list[int]:
    """The numbers before the first END, all if there is none."""
    found = [int(n) for n in numbers]
    return found[: found.index(END_NUMBER)] if END_NUMBER in found else found


def build_words(sentences: Iterable[Sequence[str]], most: int) -> Words:
    """The `most` numbers of a language: PAD, UNKNOWN, END, then words by frequency, ties by alphabet."""
    count = collections.Counter(w for s in sentences for w in s)
    frequent = sorted(count, key=lambda w: (-count[w], w))
    return Words(Vocabulary((PAD, UNKNOWN, END, *frequent[: most - 3])))


def build_pieces(sentences: Iterable[Sequence[str]], most: int) -> Pieces:
    """`most` pieces by byte-pair encoding.

    Raises:
      UnableError: sentencepiece is not installed.
      ValueError: too few sentences for so many pieces.
    """
    buffer, trainer = io.BytesIO(), _sentencepiece().SentencePieceTrainer
    try:
        trainer.train(
            sentence_iterator=iter(" ".join(s) for s in sentences),
            model_writer=buffer,
            vocab_size=most,
            model_type="bpe",
            pad_id=PAD_NUMBER,
            unk_id=UNKNOWN_NUMBER,
            eos_id=END_NUMBER,
            bos_id=-1,
            num_threads=1,
            minloglevel=2,
        )
    except RuntimeError as e:
        raise ValueError(f"{most} pieces cannot be made of these sentences ({e}); ask for fewer") from e
    return Pieces(buffer.getvalue())


BUILDERS: Mapping[str, Callable[[Iterable[Sequence[str]], int], WordNumbers]] = {
    "words": build_words,
    "pieces": build_pieces,
}


def lexicon_from_json(body: dict[str, Any]) -> WordNumbers:
    """What the `to_json` of WordNumbers wrote."""
    if body["kind"] == "words":
        return Words(Vocabulary(tuple(body["words"])))
    return Pieces(bytes.fromhex(body["model"]))


def _sentencepiece() -> ModuleType:
    try:
        import sentencepiece  # optional
    except ImportError as e:
        raise UnableError(
            "pieces need the library sentencepiece; `pip install sentencepiece`, or use --units words"
        ) from e
    return sentencepiece
