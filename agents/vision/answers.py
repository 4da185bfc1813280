"""A small network that answers questions about videos (embodied.datasets.vqa): the words of a question say which finds
of the shipped detector matter. Where it beats its twin that sees nothing, sight is worth something."""

import functools
import itertools
import math
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from embodied.agents.common.weights import seeded
from embodied.agents.vision import encoder
from embodied.agents.vision.detector import Detector
from embodied.assets.catalogue import Catalogue
from embodied.datasets.vqa.build import VqaData
from embodied.datasets.vqa.scoring import LETTERS, VqaQuestion, folds, score
from embodied.datasets.vqa.walks import LENS, TURN, Walk, read_frame
from embodied.geometry import wrap
from embodied.house.house import House
from embodied.language.lexicon import lexicon_of
from embodied.language.plain_language import plural
from embodied.records import from_plain, read_json
from embodied.seeds import stream

FRAMES_AROUND, MENTIONS, MOST_STOPS, THERE, DAMPED = round(2 * math.pi / TURN), 3, 4, 0.3, 10.0
"""Frames of a look; things of a question and looks of a walk that count; least probability; ridge of distances."""
SIZE, WORDS, EPOCHS, BATCH, RATE, DECAY, DROPOUT = 64, 2**12, 12, 64, 2e-3, 0.05, 0.3


class LookAround(NamedTuple):
    """Probabilities of classes and features in (12, 36) cells of a strip along `yaw`; `frame`: share of the walk."""

    position: np.ndarray
    yaw: float
    frame: float
    sure: np.ndarray
    maps: np.ndarray


def stops_of(data: VqaData, walk: str, detector: Detector) -> list[LookAround]:
    """The looks around of a walk."""
    files, stops, k = data.frames(walk), list[LookAround](), -1
    frames = from_plain(Walk, read_json(files[0].with_name("walk.json"))).frames
    while (k := k + 1) + FRAMES_AROUND <= len(frames) and len(stops) < MOST_STOPS:
        if len({f.position for f in frames[k : k + FRAMES_AROUND]}) > 1:
            continue
        strip = strip_of_frames([read_frame(f)[..., ::-1] for f in files[k : k + FRAMES_AROUND]])
        with torch.no_grad():
            sure = detector.network(maps := detector.encoder.pyramid(strip[None]))[0][0].sigmoid()
        spot, cells = np.array(frames[k].position), torch.cat(maps[1:], 1)[0]
        stops.append(LookAround(spot, frames[k].yaw, k / len(frames), sure.half().numpy(), cells.half().numpy()))
        k += FRAMES_AROUND - 1
    return stops


def strip_of_frames(frames: Sequence[np.ndarray]) -> np.ndarray:
    """(192, 576, 3) uint8: a look around as a strip (embodied.agents.vision.encoder), its first frame in the middle."""
    (tilt, vfov, (height, width)), columns, middle = LENS, encoder.WIDTH // FRAMES_AROUND, FRAMES_AROUND // 2
    rays = encoder.directions()[:, (encoder.WIDTH - columns) // 2 :][:, :columns]
    x, y, z = np.moveaxis(rays, 2, 0)
    ahead, up = x * math.cos(tilt) + z * math.sin(tilt), z * math.cos(tilt) - x * math.sin(tilt)
    scale = height / 2 / math.tan(vfov / 2) / np.maximum(ahead, 0.1)
    at = (np.float32(width / 2 - 0.5 - y * scale), np.float32(height / 2 - 0.5 - up * scale))
    parts = [cv2.remap(f, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for f in frames]
    return np.roll(
        np.concatenate([parts[(middle - k) % FRAMES_AROUND] for k in range(FRAMES_AROUND)], 1), -columns // 2, 1
    )


class FoundThing(NamedTuple):
    """Places where a thing of some classes seems to be, from each of s spots: (s, 12, 36) probabilities, and the
    largest `near` each cell; (s, 3) metres; (11,) when it is seen first, how surely, how many, where, and how much more
    surely, and how far from there, at last."""

    sure: np.ndarray
    near: np.ndarray
    spots: np.ndarray
    facts: np.ndarray


class Eyes:
    """Looks up what the words of a question mean in what the detector found."""

    def __init__(self, data: VqaData, walks: Iterable[str], catalogue: Catalogue) -> None:
        self.data, self.detector = data, Detector.load(encoder.load_encoder())
        self.index = {name: k for k, name in enumerate(self.detector.classes)}
        self.nouns = {w: c for n, c in lexicon_of(catalogue).classes_of.items() for w in (n, plural(n))}
        self.named = re.compile(rf"\b(?:{'|'.join(sorted(map(re.escape, self.nouns), key=len, reverse=True))})\b")
        self.stops = {walk: stops_of(data, walk, self.detector) for walk in walks}

    def learn(self, walks: Iterable[str]) -> None:
        """Fit the weights that read the logarithm of a distance, metres, from a cell, by ridge regression on walks."""
        rows, logs = [np.zeros(1 + sum(self.detector.encoder.network.channels[1:]))], [0.0]
        for walk in sorted({*walks}):
            house = House.load(self.data.frames(walk)[0].parents[1] / "house.json")
            for stop, p in itertools.product(self.stops[walk], house.placements):
                x, y, z = np.add(p.position, (0, 0, p.size[2] / 2)) - stop.position
                row = int((encoder.HALF - math.atan2(z, math.hypot(x, y))) / (2 * encoder.HALF) * encoder.STRIP_ROWS)
                column = int((math.pi - float(wrap(math.atan2(y, x) - stop.yaw))) / math.tau * encoder.STRIP_COLUMNS)
                cell = np.s_[:, min(max(row, 0), encoder.STRIP_ROWS - 1), column % encoder.STRIP_COLUMNS]
                if p.object_class in self.index and stop.sure[cell][self.index[p.object_class]] > THERE:
                    rows.append(np.append(stop.maps[cell], 1.0).astype(np.float64))
                    logs.append(math.log(math.hypot(x, y, z)))
        of = np.array(rows)
        self.far = np.linalg.solve(of.T @ of + DAMPED * np.eye(of.shape[1]), of.T @ np.array(logs))
        self.seen = functools.cache(self.look)

    def look(self, walk: str, noun: str) -> FoundThing | None:
        """None if the detector knows no such thing, or there was no look around."""
        known, stops = [self.index[c] for c in self.nouns[noun] if c in self.index], self.stops[walk]
        if not known or not stops:
            return None
        sure = np.stack([s.sure[known].max(0).astype(np.float32) for s in stops])
        most, best = sure.max((1, 2)), sure.reshape(len(stops), -1).argmax(1).tolist()
        cells = [s.maps.reshape(len(s.maps), -1)[:, c].astype(np.float32) for s, c in zip(stops, best)]
        logs = np.clip(np.array(cells) @ self.far[:-1] + self.far[-1], -1, 2.5).tolist()
        spots, seen = list[np.ndarray](), 1.0
        for k in reversed(range(len(stops))):
            to_left, pitch = encoder.cell_direction(*divmod(best[k], encoder.STRIP_COLUMNS))
            yaw, flat = to_left + stops[k].yaw, math.cos(pitch)
            ray = np.array([flat * math.cos(yaw), flat * math.sin(yaw), math.sin(pitch)])
            spots.insert(0, stops[k].position + math.exp(logs[k]) * ray)
            later = max(to_left % math.tau / TURN - 1, 0) if to_left % math.tau < FRAMES_AROUND * TURN - TURN else 0
            seen = stops[k].frame + later / (2 * FRAMES_AROUND * len(stops)) if most[k] > THERE else seen
        near = np.stack([cv2.dilate(s, np.ones((3, 3), np.uint8)) for s in sure])
        peaks, k = ((sure == near) & (sure > THERE)).sum((1, 2)), int(most.argmax())
        facts = [seen, most.max(), most.mean(), peaks.max() / 4, peaks.sum() / 8, sure.sum((1, 2)).max() / 8]
        facts += [float(divmod(best[k], encoder.STRIP_COLUMNS)[0]), logs[k], math.log(sure[k].sum() + 0.1)]
        facts += [most[-1] - most[0], float(np.linalg.norm(spots[-1] - spots[0]))]
        return FoundThing(sure, near, np.array(spots), np.array(facts))

    def facts(self, q: VqaQuestion) -> Tensor:
        """(options, F) float32: what was seen of the things of a question and of each option."""
        seen = lambda text: [self.seen(q.walk, w) for w in self.named.findall(text.lower())]
        about, rows = [*seen(q.text), *[None] * MENTIONS][:MENTIONS], list[np.ndarray]()
        for option in q.options or ("",):
            slots = [*about, *(offered := [*seen(option), None])[:1]]
            parts = [s.facts if s else np.zeros(11) for s in slots]
            parts += [_pair(a, b) for a, b in itertools.combinations(slots, 2)]
            rows.append(np.concatenate([*parts, _side(*slots[:3]), _order(offered)]))
        return torch.from_numpy(np.array(rows, np.float32))


def _pair(a: FoundThing | None, b: FoundThing | None) -> np.ndarray:
    """(7,) how two things lie to each other, from where both are seen best, and how often in neighbouring cells."""
    if a is None or b is None:
        return np.zeros(7)
    both, near, off = a.sure.max((1, 2)) * b.sure.max((1, 2)), a.near * b.sure, a.spots - b.spots
    x, y, z = off[k := int(both.argmax())]
    return np.array([1, both[k], math.hypot(x, y, z), math.hypot(x, y), z, near.max(), near.sum((1, 2)).max() / 8])


def _side(a: FoundThing | None, b: FoundThing | None, c: FoundThing | None) -> np.ndarray:
    """(3,) sine and cosine of where c lies for who stands at a and faces b, and how sure that is."""
    if a is None or b is None or c is None:
        return np.zeros(3)
    weights = np.prod([x.sure.max((1, 2)) for x in (a, b, c)], 0)
    (ahead, left), (x, y) = (b.spots - a.spots).T[:2], (c.spots - a.spots).T[:2]
    angles = np.arctan2(y, x) - np.arctan2(left, ahead)
    return np.append(np.array([np.sin(angles), np.cos(angles)]) @ weights / max(weights.sum(), 1e-6), weights.max())


def _order(things: Sequence[FoundThing | None]) -> np.ndarray:
    """(2,) by how much each thing is seen after the one before, at least and on average."""
    gaps = np.append(np.diff([t.facts[0] for t in things if t]), [0] * (len(things) < 4))
    return np.array([gaps.min(), np.tanh(8 * gaps).mean()])


class AnswerNetwork(nn.Module):
    """Scores of options, and logarithms of numbers."""

    def __init__(self, facts: int) -> None:
        super().__init__()
        self.words = nn.EmbeddingBag(WORDS, SIZE, mode="mean")
        self.see = nn.Sequential(nn.Linear(facts, SIZE), nn.ReLU(), nn.Dropout(DROPOUT), nn.Linear(SIZE, SIZE))
        self.join = nn.Sequential(nn.Linear(2 * SIZE, SIZE), nn.ReLU(), nn.Dropout(DROPOUT))
        self.score = nn.Sequential(nn.Linear(3 * SIZE, SIZE), nn.ReLU(), nn.Dropout(DROPOUT), nn.Linear(SIZE, 1))

    def forward(self, questions: Sequence[VqaQuestion], facts: Mapping[str, Tensor]) -> Tensor:
        """(n, options): scores of the options of questions of one type and one number of options; (n, 1) of numbers."""
        options = max(len(questions[0].options), 1)
        asked = self.words(*_bags([f"{q.type}: {q.text}" for q in questions])).repeat_interleave(options, 0)
        asked = self.join(torch.cat([asked, self.words(*_bags([o for q in questions for o in q.options or ("",)]))], 1))
        seen = self.see(torch.cat([facts[q.id] for q in questions]))
        scores: Tensor = self.score(torch.cat([asked, seen, asked * seen], 1)).view(-1, options)
        return scores


def _bags(texts: Sequence[str]) -> tuple[Tensor, Tensor]:
    words = [[zlib.crc32(w.encode()) % WORDS for w in re.findall(r"[a-z_]+", text.lower())] or [0] for text in texts]
    return torch.tensor(np.concatenate(words)), torch.tensor(np.cumsum([0, *map(len, words[:-1])]))


def answers_of(
    learned: Sequence[VqaQuestion], asked: Sequence[VqaQuestion], facts: Mapping[str, Tensor], *, seed: int
) -> list[str]:
    """Learn from questions with their answers, and answer others: letters, or numbers."""
    numbers = {q.type for q in learned if not q.options}
    logs = {t: np.log([float(q.answer) for q in learned if q.type == t]) for t in numbers}
    scale = {t: (float(x.mean()), float(x.std()) + 1e-6) for t, x in logs.items()}
    spread, usual = torch.std_mean(known := torch.cat([facts[q.id] for q in learned]), 0)
    facts = {k: ((x - usual) / (spread + 1e-4)).clamp(-4, 4) for k, x in facts.items()}
    with seeded(seed):
        network, rng = AnswerNetwork(known.shape[1]), stream(seed, "answers")
        optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=DECAY)
        orders = ([learned[i] for i in rng.permutation(len(learned))] for _ in range(EPOCHS))
        for group in itertools.chain.from_iterable(_groups(order, BATCH) for order in orders):
            (mean, off), scores = scale.get(group[0].type, (0.0, 1.0)), network(group, facts)
            if group[0].options:
                loss = functional.cross_entropy(scores, torch.tensor([q.options.index(q.answer) for q in group]))
            else:
                true = torch.tensor([(math.log(float(q.answer)) - mean) / off for q in group])
                loss = functional.smooth_l1_loss(scores[:, 0], true)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
    network.eval()
    with torch.no_grad():
        rows = {q.id: r for g in _groups(asked, BATCH) for q, r in zip(g, network(g, facts).numpy(), strict=True)}
    number = lambda row, mean=0.0, off=1.0: f"{math.exp(mean + off * row[0]):.2f}"
    say = lambda q, row: LETTERS[int(row.argmax())] if q.options else number(row, *scale.get(q.type, ()))
    return [say(q, rows[q.id]) for q in asked]


def guessed(questions: Sequence[VqaQuestion], seed: int) -> np.ndarray:
    """(2, n) scores of the network that sees nothing and learned from questions about other houses; a random order."""
    facts, of = {q.id: torch.zeros(max(len(q.options), 1), 1) for q in questions}, folds(questions, seed)
    judged = np.stack([np.zeros(len(questions)), stream(seed, "guessed").random(len(questions))])
    for fold in sorted({*of.tolist()}):
        asked = [q for q, k in zip(questions, of) if k == fold]
        answers = answers_of([q for q, k in zip(questions, of) if k != fold], asked, facts, seed=seed)
        judged[0, of == fold] = [score(q, a) for q, a in zip(asked, answers, strict=True)]
    return judged


def _groups(questions: Sequence[VqaQuestion], most: int) -> Iterator[list[VqaQuestion]]:
    """All questions in groups of one type and one number of options, mixed."""
    alike: dict[tuple[str, int], list[VqaQuestion]] = {}
    for q in questions:
        alike.setdefault((q.type, len(q.options)), []).append(q)
    parts = [some[i : i + most] for some in alike.values() for i in range(0, len(some), most)]
    yield from sorted(parts, key=lambda group: group[0].id)
