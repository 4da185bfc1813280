"""A small network that answers questions about videos: words attend to features of frames (embodied.datasets.vqa).

It judges a set of questions: where it beats its twin that sees black frames, sight is worth something.
"""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from embodied.agents.common.settings import SHIPPED_ENCODER
from embodied.agents.common.weights import seeded
from embodied.agents.vision.encoder import load_encoder
from embodied.datasets.vqa.scoring import LETTERS, VqaQuestion
from embodied.datasets.vqa.walks import read_frame
from embodied.seeds import stream

FRAMES, TILES, VIEW = 32, 3, (128, 96)
"""Frames of a walk, the columns that each is cut into, and width and height of these, pixels."""
SIZE, WORDS, EPOCHS, BATCH, RATE, DECAY, DROPOUT = 128, 2**13, 24, 64, 1e-3, 0.05, 0.3


def frame_features(files: Callable[[str, int], list[Path]], walks: Iterable[str]) -> dict[str, Tensor]:
    """(FRAMES * TILES, D) features of the shipped encoder by walk.

    Args:
      files: VqaData.frames.
    """
    encoder, out = load_encoder(SHIPPED_ENCODER), dict[str, Tensor]()
    for walk in walks:
        frames = [read_frame(f)[..., ::-1] for f in files(walk, FRAMES)]
        tiles = [cv2.resize(part, VIEW) for f in frames for part in np.array_split(f, TILES, axis=1)]
        features = torch.from_numpy(encoder.encode_views(np.stack(tiles)[None]))[0]
        out[walk] = functional.pad(features, (0, 0, 0, FRAMES * TILES - len(features)))
    return out


class AnswerNetwork(nn.Module):
    """Scores of options, and logarithms of numbers."""

    def __init__(self, features: int) -> None:
        super().__init__()
        self.words = nn.EmbeddingBag(WORDS, SIZE, mode="mean")
        self.frames, self.times = nn.Linear(features, SIZE), nn.Parameter(torch.zeros(FRAMES * TILES, SIZE))
        self.look = nn.MultiheadAttention(SIZE, 4, batch_first=True)
        self.join = nn.Sequential(nn.Linear(2 * SIZE, SIZE), nn.ReLU(), nn.Dropout(DROPOUT))
        self.score = nn.Sequential(nn.Linear(3 * SIZE, SIZE), nn.ReLU(), nn.Dropout(DROPOUT), nn.Linear(SIZE, 1))

    def forward(self, batch: QuestionBatch) -> Tensor:
        """(n, options): a score of every option; (n, 1) of numbers."""
        n, options = len(batch.frames), batch.options
        question = self.words(*batch.question).repeat_interleave(options, 0)
        asked = self.join(torch.cat([question, self.words(*batch.option)], 1)).view(n, options, SIZE)
        seen = self.frames(batch.frames) + self.times
        context = self.look(asked, seen, seen, need_weights=False)[0]
        scores: Tensor = self.score(torch.cat([asked, context, asked * context], 2))[..., 0]
        return scores


@dataclass(frozen=True)
class QuestionBatch:
    """Questions of one type and one number of options."""

    frames: Tensor
    question: tuple[Tensor, Tensor]
    option: tuple[Tensor, Tensor]
    """Numbers of words, and where those of each text begin."""
    options: int

    @staticmethod
    def of(questions: Sequence[VqaQuestion], frames: Mapping[str, Tensor]) -> QuestionBatch:
        return QuestionBatch(
            torch.stack([frames[q.walk] for q in questions]),
            _bags([f"{q.type}: {q.text}" for q in questions]),
            _bags([o for q in questions for o in q.options or ("",)]),
            max(len(questions[0].options), 1),
        )


def _bags(texts: Sequence[str]) -> tuple[Tensor, Tensor]:
    words = [[zlib.crc32(w.encode()) % WORDS for w in re.findall(r"[a-z_]+", text.lower())] or [0] for text in texts]
    return torch.tensor(np.concatenate(words)), torch.tensor(np.cumsum([0, *map(len, words[:-1])]))


def answers_of(
    learned: Sequence[VqaQuestion], asked: Sequence[VqaQuestion], frames: Mapping[str, Tensor], *, seed: int
) -> list[str]:
    """Learn from questions with their answers, and answer others: letters, or numbers."""
    numbers = {q.type for q in learned if not q.options}
    logs = {t: np.log([float(q.answer) for q in learned if q.type == t]) for t in numbers}
    scale = {t: (float(x.mean()), float(x.std()) + 1e-6) for t, x in logs.items()}
    with seeded(seed):
        network = _taught(learned, frames, scale, seed)
    answers: dict[str, str] = {}
    with torch.no_grad():
        for group in _groups(asked, BATCH):
            for q, row in zip(group, network(QuestionBatch.of(group, frames)).numpy(), strict=True):
                mean, spread = scale.get(q.type, (0.0, 1.0))
                answers[q.id] = LETTERS[int(row.argmax())] if q.options else f"{np.exp(mean + spread * row[0]):.2f}"
    return [answers[q.id] for q in asked]


def _taught(
    learned: Sequence[VqaQuestion], frames: Mapping[str, Tensor], scale: Mapping[str, tuple[float, float]], seed: int
) -> AnswerNetwork:
    network, rng = AnswerNetwork(next(iter(frames.values())).shape[1]), stream(seed, "answers")
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
    for _ in range(EPOCHS):
        for group in _groups([learned[i] for i in rng.permutation(len(learned))], BATCH):
            scores, first = network(QuestionBatch.of(group, frames)), group[0]
            if first.options:
                loss = functional.cross_entropy(scores, torch.tensor([q.options.index(q.answer) for q in group]))
            else:
                mean, spread = scale[first.type]
                true = torch.tensor([(math.log(float(q.answer)) - mean) / spread for q in group])
                loss = functional.smooth_l1_loss(scores[:, 0], true)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    return network.eval()


def _groups(questions: Sequence[VqaQuestion], most: int) -> Iterator[list[VqaQuestion]]:
    """All questions in groups of one type and one number of options, mixed."""
    alike: dict[tuple[str, int], list[VqaQuestion]] = {}
    for q in questions:
        alike.setdefault((q.type, len(q.options)), []).append(q)
    parts = [some[i : i + most] for some in alike.values() for i in range(0, len(some), most)]
    yield from sorted(parts, key=lambda group: group[0].id)
