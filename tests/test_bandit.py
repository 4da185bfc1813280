"""Ratings, their perturbations, and the advantage actor-critic, against hand-worked cases (dissertation 3.1)."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sacrebleu
import torch

from embodied.agents.bandit.ratings import Rater, corpus_bleu, deviation, granular, sentence_bleu
from embodied.agents.common.session import DivergedError, descend
from embodied.agents.common.tensors import Decisions, actor_loss, advantages, critic_loss
from embodied.seeds import stream


def sacre(words: str, reference: str) -> float:
    """sacrebleu's sentence BLEU in [0, 1], add-one smoothed from bigrams on."""
    metric = sacrebleu.BLEU(tokenize="none", force=True, smooth_method="add-k", smooth_value=1, effective_order=False)
    return metric.sentence_score(words, [reference]).score / 100


def test_sentence_bleu_is_one_for_the_reference_only():
    assert sentence_bleu(["a", "b", "c", "d", "e"], ["a", "b", "c", "d", "e"]) == 1.0
    assert sentence_bleu(["a", "b", "c", "d"], ["a", "b", "c", "d", "e"]) < 1.0


def test_sentence_bleu_by_hand():
    # 'a b x' of 'a b c': unigrams 2 of 3, bigrams 1 of 2, trigrams 0 of 1, 4-grams 0 of 0; one added to each
    assert sentence_bleu(["a", "b", "x"], ["a", "b", "c"]) == pytest.approx((3 / 4 * 2 / 3 * 1 / 2 * 1 / 1) ** 0.25)
    # one word short: brevity penalty with one more on both sides
    assert sentence_bleu(["a", "b"], ["a", "b", "c"]) == pytest.approx(math.exp(1 - 4 / 3))
    assert sentence_bleu([], ["a", "b", "c"]) == pytest.approx(math.exp(1 - 4 / 1))


@pytest.mark.parametrize("words", ["b a d c f e", "a b d c e f", "f e d c b a", "a b c d e f"])
def test_sentence_bleu_is_sacrebleus_where_all_words_are_right(words):
    """There the unigrams, which we smooth and sacrebleu does not, are full in both, and nothing is too short."""
    assert sentence_bleu(words.split(), ["a", "b", "c", "d", "e", "f"]) == pytest.approx(sacre(words, "a b c d e f"))


@pytest.mark.parametrize("words", ["a b c x y z", "a x c d e f g h", "x b c d e y"])
def test_sentence_bleu_differs_from_sacrebleus_by_unigram_smoothing_only(words):
    reference = ["a", "b", "c", "d", "e", "f"]
    right, all_words = len(set(words.split()) & set(reference)), len(words.split())
    ours = sentence_bleu(words.split(), reference) ** 4 / ((right + 1) / (all_words + 1))
    assert ours == pytest.approx(sacre(words, " ".join(reference)) ** 4 / (right / all_words))


def test_repeating_a_right_word_does_not_pay():
    reference = ["a", "b", "c", "d"]
    assert sentence_bleu(["a", "a", "a", "a"], reference) < sentence_bleu(["a", "b", "x", "y"], reference)


def test_corpus_bleu_by_hand():
    references = [("a", "b", "c", "d", "e"), ("f", "g", "h", "i", "j")]
    assert corpus_bleu(references, references) == pytest.approx(100)
    # second sentence without its last word: 9 of 9, 7 of 7, 5 of 5, 3 of 3 n-grams; 9 words for 10
    assert corpus_bleu([references[0], references[1][:4]], references) == pytest.approx(100 * math.exp(1 - 10 / 9))


def test_granularity_has_the_bins_of_the_text():
    """[0, 0.1), [0.1, 0.3), [0.3, 0.5), [0.5, 0.7), [0.7, 0.9), [0.9, 1] for g = 5 (3.1.4.1)."""
    for low, value in ((0, 0), (0.1, 0.2), (0.3, 0.4), (0.5, 0.6), (0.7, 0.8), (0.9, 1)):
        assert granular(low + 1e-9, 5) == pytest.approx(value)
        assert granular(low + 0.0999, 5) == pytest.approx(value)
    assert {granular(s, 1) for s in (0.0, 0.49, 0.5, 1.0)} == {0.0, 1.0}
    assert granular(-0.7, 4) == 0 and granular(1.7, 4) == 1


def test_deviation_is_the_lines_of_equation_3_9():
    assert deviation(0.25) == pytest.approx(0.64 * 0.25 - 0.0002)
    assert deviation(0.8) == pytest.approx(0.67 * 0.2)
    assert deviation(0.0) == 0 and deviation(1.0) == pytest.approx(0)


@pytest.mark.parametrize("strength", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("score", [0.1, 0.4, 0.7])
def test_noise_keeps_the_mean_and_has_lambda_times_the_variance(score, strength):
    rater, rng = Rater(variance=strength), stream(0, "noise")
    ratings = np.array([rater.rate(score, rng=rng) for _ in range(20_000)])
    sigma = math.sqrt(strength) * deviation(score)
    assert ratings.mean() == pytest.approx(score, abs=4 * sigma / math.sqrt(len(ratings)))
    assert ratings.var() == pytest.approx(strength * deviation(score) ** 2, rel=0.05)


def test_skew_by_hand_and_without_variance():
    # "a score of 0.3 is suppressed to be less than 0.08" (3.1.6.2)
    assert Rater(skew=4).rate(0.3, rng=stream(0)) == pytest.approx(0.0081)
    assert Rater(skew=0.5).rate(0.25, rng=stream(0)) == pytest.approx(0.5)
    assert {Rater(skew=2).rate(0.5, rng=stream(i, "x")) for i in range(5)} == {0.25}


def test_raters_refuse_negative_settings():
    with pytest.raises(ValueError, match="must not be negative"):
        Rater(variance=-1)


def two_sequences() -> tuple[Decisions, torch.Tensor, torch.Tensor]:
    log_p = torch.tensor([[-1.0, -2.0, -3.0], [-0.5, -1.5, 0.0]], requires_grad=True)
    values = torch.tensor([[0.2, 0.4, 0.9], [0.5, 0.1, 7.0]], requires_grad=True)
    mask = torch.tensor([[True, True, True], [True, True, False]])
    return Decisions(log_p, values, torch.tensor([0.6, 0.3]), mask), log_p, values


def test_advantage_is_rating_less_value_and_nothing_behind_the_end():
    rated, _, _ = two_sequences()
    assert torch.allclose(advantages(rated), torch.tensor([[0.4, 0.2, -0.3], [-0.2, 0.2, 0.0]]))


def test_actor_gradient_is_equation_3_5():
    rated, log_p, values = two_sequences()
    actor_loss(rated).backward()
    assert torch.allclose(log_p.grad, -torch.tensor([[0.4, 0.2, -0.3], [-0.2, 0.2, 0.0]]) / 2)
    assert values.grad is None


def test_critic_gradient_is_equation_3_7():
    rated, log_p, values = two_sequences()
    critic_loss(rated).backward()
    assert torch.allclose(values.grad, torch.tensor([[-0.4, -0.2, 0.3], [0.2, -0.2, 0.0]]) / 2)
    assert log_p.grad is None


@pytest.mark.slow
def test_a_loss_that_is_no_number_changes_no_weight():
    weight = torch.nn.Parameter(torch.ones(2))
    optimizer = torch.optim.Adam([weight], 0.1)
    with pytest.raises(DivergedError, match="lower the learning rate"):
        descend((weight * float("nan")).sum(), optimizer, "test, update 3", 5.0)
    assert weight.tolist() == [1.0, 1.0]


@pytest.mark.slow
def test_actor_critic_finds_the_better_of_two_arms_from_coarse_ratings():
    """A bandit with scores 0.3 and 0.8, rated 0 or 1: the shared learner must prefer the second."""
    logits, value = torch.nn.Parameter(torch.zeros(2)), torch.nn.Parameter(torch.zeros(1))
    optimizers = torch.optim.Adam([logits], 0.05), torch.optim.Adam([value], 0.05)
    rater, rng = Rater(granularity=1), stream(0, "arms")
    for _ in range(150):
        arms = rng.random(16) < logits.softmax(-1)[1].item()
        ratings = torch.tensor([rater.rate(0.8 if a else 0.3, rng=rng) for a in arms], dtype=torch.float32)
        chosen = logits.log_softmax(-1)[torch.tensor(arms).long()][:, None]
        rated = Decisions(chosen, value.expand(16)[:, None], ratings, torch.ones(16, 1, dtype=torch.bool))
        descend(actor_loss(rated), optimizers[0], "actor", 5.0)
        descend(critic_loss(rated), optimizers[1], "critic", 5.0)
    assert logits.softmax(-1)[1] > 0.9
    assert value.item() > 0.7
