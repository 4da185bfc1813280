"""The three stages of BANDITNMT (3.1.5.1): pre-training the translator, then its critic, then learning from ratings.

    pretrain      supervised, Eq A.7 -> weak.safetensors (one pass), full.safetensors (lowest dev perplexity)
    train_critic  the critic, on translations sampled from the frozen translator
    bandit        NED-A2C (Algorithm 2), or its two controls: learning nothing, learning from references

Every draw is named by seed, pass and sentence, so a stage that was stopped goes on exactly as if it had not been.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from embodied.agents.bandit import network as networks
from embodied.agents.bandit.corpus import corpus_digest, load
from embodied.agents.bandit.ratings import CLEAN, Rater, corpus_bleu, sentence_bleu
from embodied.agents.common.session import Note, Session, descend
from embodied.agents.common.tensors import Decisions, actor_loss, critic_loss, padded, sampled_choice
from embodied.agents.common.vocabulary import Vocabulary, most_frequent
from embodied.agents.common.weights import Stateful, weights_digest
from embodied.agents.learners.bandit import BanditConfig
from embodied.records import Identity, identity_of
from embodied.seeds import stream

Step = Callable[[np.ndarray, int, int], Mapping[str, float]]
"""Is given sentences, the pass and the number of the update, does it, and returns numbers to add up."""
History = Sequence[Mapping[str, float]]
Finish = Callable[[int, Mapping[str, float], History], Mapping[str, float]]
"""Is given a pass, the sums of its numbers and what the passes before gave; returns what is kept of it."""
BANDIT_LEARNERS = ("reference", "supervised", "a2c")
"""'reference' learns nothing; 'supervised' is shown the references of the same sentences; 'a2c' their ratings."""
RATED = "bandit_overlap"
"""The split that is rated, the dissertation's case."""
DECAY_FROM = 5
"""Epoch from which the learning rate halves when the perplexity of the dev set rises."""
_LATER = ("critic_passes", "bandit_rate", "checkpoint_minutes")
"""Settings on which pre-training does not depend."""


@dataclass(frozen=True, eq=False)
class TokenizedCorpora:
    """A corpus in numbers, ready to be learned from."""

    config: BanditConfig
    splits: Mapping[str, networks.TokenizedCorpus]
    lexicons: tuple[Vocabulary, Vocabulary]
    digest: str
    """Of the sets for pre-training and judging."""
    bandit_digest: str
    """Of the set that is rated."""

    def translator(self) -> networks.Translator:
        """An untrained translator; its weights follow from the seed."""
        return self._begun(networks.Translator, "translator")

    def critic(self) -> networks.Critic:
        return self._begun(networks.Critic, "critic")

    def identity(self, stage: str, *fields: str, **more: object) -> dict[str, object]:
        """The identity of a stage: settings of pre-training and those named, and the corpus."""
        settings = {k: v for k, v in vars(self.config).items() if k not in _LATER or k in fields}
        return identity_of(
            "embodied.agents.bandit.training", stage=stage, settings=settings, corpus=self.digest, **more
        )

    def _begun(self, kind: Callable[..., networks.Network], name: str) -> networks.Network:
        generator = torch.Generator().manual_seed(int(stream(self.config.seed, "begin", name).integers(2**31)))
        return networks.begin(kind(*map(len, self.lexicons), self.config.hidden_size), generator)


def load_corpus(folder: Path, config: BanditConfig) -> TokenizedCorpora:
    """Read a corpus folder; words are those of its supervised set.

    Raises:
      CorpusError: see embodied.agents.bandit.corpus.load.
    """
    names = ("supervised", "dev", "test")
    corpus = load(folder, (*names, RATED), longest=config.longest)
    source = most_frequent((w for a, _ in corpus["supervised"] for w in a), most=config.source_words)
    target = most_frequent((w for _, b in corpus["supervised"] for w in b), most=config.target_words)
    splits = {name: networks.tokenized(pairs, source, target) for name, pairs in corpus.items()}
    return TokenizedCorpora(
        config, splits, (source, target), corpus_digest(folder, names), corpus_digest(folder, (RATED,))
    )


def pretrain(m: TokenizedCorpora, folder: Path, *, note: Note = print) -> list[dict[str, float]]:
    """Supervised pre-training (3.1.5.2); writes weak.safetensors and full.safetensors into `folder`.

    Differs from the text in what 'full' is: not the tenth pass but the one of lowest dev perplexity,
    because small corpora are learned by heart before the tenth (docs/sources.md, S69).
    """
    config, data = m.config, m.splits["supervised"]
    translator = m.translator()
    optimizer = adam(translator, config.pretraining_rate)
    identity = m.identity("pretrain")
    parts: dict[str, Stateful] = {"translator": translator, "translator optimizer": optimizer}

    def step(chosen: np.ndarray, turn: int, update: int) -> dict[str, float]:
        source, target = rows(data.source, chosen), rows(data.target, chosen)
        loss = supervised_loss(translator, source, target)
        descend(loss, optimizer, f"pre-training, update {update}", config.clip)
        return {"loss": float(loss.detach()) * len(chosen), "sentences": len(chosen)}

    def finish(turn: int, sums: Mapping[str, float], history: History) -> dict[str, float]:
        dev_perplexity = networks.perplexity(translator, m.splits["dev"])
        before = [h["dev perplexity"] for h in history]
        if turn == 0:
            networks.save_network(translator, m.config, m.lexicons, folder / "weak.safetensors", identity)
        if dev_perplexity < min(before, default=math.inf):
            networks.save_network(translator, m.config, m.lexicons, folder / "full.safetensors", identity)
        if turn + 1 >= DECAY_FROM and before and dev_perplexity > before[-1]:
            for group in optimizer.param_groups:
                group["lr"] /= 2
        return {
            "loss": sums["loss"] / sums["sentences"],
            "dev perplexity": dev_perplexity,
            "dev BLEU": judged(translator, m, "dev"),
            "learning rate": optimizer.param_groups[0]["lr"],
        }

    passes = config.pretraining_passes
    return _run("pretrain", passes, step, finish, folder, identity, parts, config, data, note)


def train_critic(m: TokenizedCorpora, reference: Path, folder: Path, *, note: Note = print) -> list[dict[str, float]]:
    """Teach a critic what ratings the translator in `reference` gets (Eq 3.7); writes critic.safetensors.

    Ratings are unperturbed here, as in the text (3.1.5.1).
    """
    config, data = m.config, m.splits["supervised"]
    translator, critic = m.translator(), m.critic()
    networks.load_network(translator, reference)
    optimizer = adam(critic, config.pretraining_rate)
    identity = m.identity("critic", "critic_passes", begin=weights_digest(reference))
    parts: dict[str, Stateful] = {"critic": critic, "critic optimizer": optimizer}

    def step(chosen: np.ndarray, turn: int, update: int) -> dict[str, float]:
        source = rows(data.source, chosen)
        samples, scores = rated_samples(translator, m, data, chosen, "critic", turn)
        target = padded(samples)
        values = critic(source, target)
        rated = Decisions(torch.zeros_like(values), values, torch.tensor(scores), target != 0)
        loss = critic_loss(rated)
        descend(loss, optimizer, f"critic, update {update}", config.clip)
        return {"error": 2 * float(loss.detach()) * len(chosen), "words": int(rated.mask.sum())}

    def finish(turn: int, sums: Mapping[str, float], history: History) -> dict[str, float]:
        networks.save_network(critic, m.config, m.lexicons, folder / "critic.safetensors", identity)
        return {"mean square error": sums["error"] / sums["words"]}

    return _run("critic", config.critic_passes, step, finish, folder, identity, parts, config, data, note)


def bandit(
    m: TokenizedCorpora,
    reference: Path,
    critic_file: Path,
    folder: Path,
    learner: str,
    *,
    rater: Rater = CLEAN,
    passes: int = 1,
    note: Note = print,
) -> list[dict[str, float]]:
    """Passes over the bandit set; each sentence is translated once per pass, before it is learned from.

    Returns, for each pass: 'per-sentence BLEU' of the sampled translations (true scores, whatever the
    rater says), 'held-out BLEU' and 'dev BLEU' of greedy translations after it.

    Args:
      reference: the pre-trained translator to begin with.
      learner: one of BANDIT_LEARNERS.
    """
    if learner not in BANDIT_LEARNERS:
        raise ValueError(f"learner must be one of {BANDIT_LEARNERS}, got {learner!r}")
    config, data = m.config, m.splits[RATED]
    translator, critic = m.translator(), m.critic()
    networks.load_network(translator, reference)
    optimizers = {"translator": adam(translator, config.bandit_rate)}
    parts: dict[str, Stateful] = {"translator": translator, "translator optimizer": optimizers["translator"]}
    about = {"begin": weights_digest(reference), "learner": learner, "rater": dataclasses.asdict(rater)}
    if learner == "a2c":
        networks.load_network(critic, critic_file)
        optimizers["critic"] = adam(critic, config.bandit_rate)
        parts |= {"critic": critic, "critic optimizer": optimizers["critic"]}
        about["critic"] = weights_digest(critic_file)
    identity = m.identity("bandit", "critic_passes", "bandit_rate", ratings=m.bandit_digest, **about)

    def step(chosen: np.ndarray, turn: int, update: int) -> dict[str, float]:
        samples, scores = rated_samples(translator, m, data, chosen, "bandit", turn)
        numbers = {"score": float(sum(scores)), "sentences": len(chosen)}
        source, where = rows(data.source, chosen), f"{learner}, update {update}"
        if learner == "supervised":
            loss = supervised_loss(translator, source, rows(data.target, chosen))
            descend(loss, optimizers["translator"], where, config.clip)
        if learner == "a2c":  # lines 5 and 6 of Algorithm 2
            rngs = [stream(config.seed, "rating", turn, int(i)) for i in chosen]
            ratings = [rater.rate(s, rng=rng) for s, rng in zip(scores, rngs)]
            target, returns = padded(samples), torch.tensor(ratings, dtype=torch.float32)
            rated = Decisions(translator(source, target), critic(source, target), returns, target != 0)
            descend(actor_loss(rated), optimizers["translator"], f"{where}, translator", config.clip)
            descend(critic_loss(rated), optimizers["critic"], f"{where}, critic", config.clip)
            numbers["rating"] = float(sum(ratings))
        return numbers

    def finish(turn: int, sums: Mapping[str, float], history: History) -> dict[str, float]:
        run = {"per-sentence BLEU": 100 * sums["score"] / sums["sentences"]}
        run |= {"held-out BLEU": judged(translator, m, "test"), "dev BLEU": judged(translator, m, "dev")}
        return run | ({"rating": 100 * sums["rating"] / sums["sentences"]} if "rating" in sums else {})

    run = _run("bandit", passes, step, finish, folder, identity, parts, config, data, note)
    networks.save_network(translator, m.config, m.lexicons, folder / "best.safetensors", identity)
    return run


def supervised_loss(translator: networks.Translator, source: Tensor, target: Tensor) -> Tensor:
    """Negative log-likelihood (A.7), summed over words, averaged over sentences."""
    return -translator(source, target).sum() / len(source)


def rated_samples(
    translator: networks.Translator,
    m: TokenizedCorpora,
    data: networks.TokenizedCorpus,
    chosen: np.ndarray,
    purpose: str,
    turn: int,
) -> tuple[list[list[int]], list[float]]:
    """One sampled translation of each chosen sentence (line 3 of Algorithm 2), and what a perfect rater would say:
    smoothed sentence BLEU of the words. Learners draw alike."""
    longest = m.config.longest
    uniforms = np.stack([stream(m.config.seed, purpose, "sample", turn, int(i)).random(longest) for i in chosen])
    samples = networks.decode(translator, rows(data.source, chosen), sampled_choice(uniforms), longest)
    words = map(m.lexicons[1].decode, samples)
    return samples, [sentence_bleu(w, data.references[i]) for w, i in zip(words, chosen, strict=True)]


def judged(translator: networks.Translator, m: TokenizedCorpora, split: str) -> float:
    """Corpus BLEU of greedy translations (A.6), 0 to 100."""
    data = m.splits[split]
    return corpus_bleu(networks.greedy(translator, data, m.lexicons[1], m.config.longest), data.references)


def rows(sentences: Sequence[Sequence[int]], chosen: np.ndarray) -> Tensor:
    return padded([sentences[i] for i in chosen])


def adam(module: torch.nn.Module, rate: float) -> torch.optim.Adam:
    return torch.optim.Adam(module.parameters(), rate, fused=True)


def _run(
    purpose: str,
    passes: int,
    step: Step,
    finish: Finish,
    folder: Path,
    identity: Identity,
    parts: Mapping[str, Stateful],
    config: BanditConfig,
    data: networks.TokenizedCorpus,
    note: Note,
) -> list[dict[str, float]]:
    """Go on with a run until it has had its passes over `data`, whose random orders are named by `purpose`; returns
    what `finish` said of each.

    Raises:
      KeyboardInterrupt: after Ctrl-C, once the update at hand is done and saved.
    """
    lengths = [len(s) for s in data.source]
    each, order = -(-len(lengths) // config.batch), None
    minutes = config.checkpoint_minutes
    with Session(folder, identity, parts, passes * each, checkpoint_minutes=minutes, every=each, note=note) as session:
        for update in session:
            turn, place = divmod(update, each)
            if order is None or place == 0:
                order = networks.batches(lengths, config.batch, stream(config.seed, purpose, "order", turn))
            session.add(step(order[place], turn, update))
            if place + 1 == each:
                session.record({"pass": turn + 1, **finish(turn, session.sums, session.history)})
                session.sums = {}
    return session.history[:passes]
