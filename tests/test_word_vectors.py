"""Pre-trained vectors let an agent read words that it never heard; without them nothing changes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from torch import nn

from embodied.agents.common import vocabulary
from embodied.agents.common.vocabulary import (
    PretrainedVocabulary,
    WordEmbedding,
    build_vocabulary,
    use_vectors,
    vocabulary_with,
)
from embodied.agents.hanna.attention import TextEncoder
from embodied.agents.vln.config import FollowerSettings
from embodied.agents.vln.policy import VlnAbout, VlnAgent
from embodied.errors import UnableError

WORDS = build_vocabulary(["walk to the hall, turn left", "stop near the bed"]).words
ALIKE = {"stroll": "walk", "corridor": "hall"}


def hand_vectors(words):
    """A vector of each word; words of ALIKE share theirs."""
    same = [ALIKE.get(w, w) for w in words]
    return np.stack([np.random.default_rng(list(w.encode())).standard_normal(8).astype(np.float32) for w in same])


@pytest.fixture(autouse=True)
def by_hand(monkeypatch):
    monkeypatch.setattr(PretrainedVocabulary, "vectors", staticmethod(hand_vectors))


def embedding(words=WORDS) -> tuple[WordEmbedding, PretrainedVocabulary]:
    torch.manual_seed(0)
    part, lexicon = WordEmbedding(len(words), 6), PretrainedVocabulary(words)
    use_vectors(nn.Sequential(part), lexicon)
    return part.eval(), lexicon


def test_a_word_never_heard_is_embedded_like_a_known_one_that_means_the_same():
    part, lexicon = embedding()
    part.weight.data.zero_()  # what was learned of single words; the rest is the vectors'
    said, meant = (torch.from_numpy(lexicon.encode(text, 6)) for text in ("stroll to the corridor", "walk to the hall"))
    assert said[0] != meant[0] and torch.allclose(part(said), part(meant))
    other = torch.from_numpy(lexicon.encode("bed to the hall", 6))
    assert not torch.allclose(part(said)[0], part(other)[0])
    assert not part(torch.from_numpy(lexicon.encode("", 6)))[1:].any(), "padding stays nothing"


def test_the_order_in_which_new_words_are_heard_changes_nothing():
    (one, first), (two, second) = embedding(), embedding()
    first.encode("zeppelin yacht", 4)
    a, b = (torch.from_numpy(v.encode("yacht zeppelin bed", 5)) for v in (first, second))
    assert a[0] != b[0] and torch.allclose(one(a), two(b))


def test_a_text_is_read_from_its_end_and_its_own_end_stays_where_it_is_too_long():
    words = build_vocabulary(["a b c d"])
    number, end = words.number, words.number("<EOS>")
    assert list(words.encode("a b", 4, backwards=True)) == [number("b"), number("a"), end, 0]
    assert list(words.encode("a b c d", 3, backwards=True)) == [number("b"), number("a"), end]
    assert list(words.encode("a b c d", 3)) == [number("a"), number("b"), number("c")], "and the same text as it is"


def test_without_vectors_an_embedding_is_torchs():
    torch.manual_seed(3)
    ours = WordEmbedding(9, 4)
    torch.manual_seed(3)
    torchs = nn.Embedding(9, 4, padding_idx=0)
    numbers = torch.tensor([[1, 8, 0]])
    assert torch.equal(ours(numbers), torchs(numbers)) and set(ours.state_dict()) == {"weight"}
    assert not isinstance(vocabulary_with(WORDS, "learned"), PretrainedVocabulary)


def test_in_training_a_word_is_at_times_known_by_its_vector_alone():
    part, lexicon = embedding()
    part.meaning.weight.data.zero_()
    part.train()
    rows = part(torch.full((400,), lexicon.number("bed")))
    assert 120 < int((rows == 0).all(1).sum()) < 280


def test_a_trained_agent_is_stored_with_its_vectors_and_hears_new_words_again(tmp_path):
    config = FollowerSettings(hidden_size=16, word_vectors="minilm")
    agent = VlnAgent.new(VlnAbout(config=config, encoder="hand", feature_size=8, words=WORDS))
    agent.network.half().float().eval()
    agent.save(tmp_path / "a.safetensors")
    again = VlnAgent.load(tmp_path / "a.safetensors")
    heard = [
        a.network.begin(torch.from_numpy(a.vocabulary.encode("tread left", 5))[None]).hidden for a in (agent, again)
    ]
    plain = VlnAgent.new(dataclasses.replace(agent.about, config=FollowerSettings(hidden_size=16)))
    assert torch.equal(*heard) and len(plain.network.state_dict()) == len(agent.network.state_dict()) - 1


def test_hannas_and_navs_text_encoder_reads_new_words():
    reader, lexicon = TextEncoder(len(WORDS), 8, 2, 0.0), PretrainedVocabulary(WORDS)
    use_vectors(reader, lexicon)
    tread, nothing = (torch.from_numpy(lexicon.encode(t, 3))[None] for t in ("tread", "%"))
    assert torch.isfinite(reader(tread)).all() and not torch.allclose(reader(tread)[0, 0], reader(nothing)[0, 0])


def test_settings_name_the_vectors_there_are_and_a_missing_package_is_named(monkeypatch):
    with pytest.raises(ValueError, match="word_vectors must be one of .*'minilm'.* got 'glove'"):
        FollowerSettings(word_vectors="glove")
    monkeypatch.setattr(vocabulary, "PACKAGE", "no_such_package")
    with pytest.raises(UnableError, match="sentences"):
        vocabulary.minilm.__wrapped__()


def test_minilms_vectors_know_that_words_are_alike():
    pytest.importorskip(vocabulary.PACKAGE)
    vectors = vocabulary.minilm()(["sofa", "couch", "window"])
    couch, window = (float(vectors[0] @ v / np.linalg.norm(v)) for v in vectors[1:])
    assert couch > window
