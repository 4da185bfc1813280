"""Clauses that were never heard are read as the nearest one that was; all others as they are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hand_data import built

from agents.common import nearest_clauses, word_vectors
from agents.common.nearest_clauses import NearestClauses, heard_in
from embodied.cli import main
from embodied.datasets.store import Dataset

MEANING = {"rotate": "turn", "leftward": "left", "aisle": "hall"}
HEARD = ["Turn left , go to the hall . find a mug", "turn right , go to the hall . find a bed", "turn left , stop"]


def words(said):
    """A vector of each word; words that mean the same share theirs."""
    meant = [MEANING.get(w, w) for w in said]
    return np.stack([np.random.default_rng(list(w.encode())).standard_normal(16) for w in meant])


def sentences(said):
    rows = np.stack([words(text.split()).sum(0) for text in said])
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


@pytest.fixture
def read():
    return NearestClauses(HEARD, lambda: sentences, lambda: words)


def test_what_was_heard_stays_as_it_is_word_for_word(read):
    assert read("turn right , go to the hall . find a bed") == "turn right , go to the hall . find a bed"
    assert read("stop") == "stop" and read("") == ""


def test_new_clauses_become_the_nearest_heard_and_what_joins_them_stays(read):
    assert read("rotate leftward ; to the aisle you go. stop") == "turn left ; go to the hall. stop"


def test_one_new_pair_among_many_known_ones_is_no_new_clause():
    read = NearestClauses(["walk to the end of the long hall now", "a red bed"], lambda: sentences, lambda: words)
    assert not read.new("walk to the end of the long hall"), "one of nine pairs: hall is followed by the end"
    assert read.new("walk hall now"), "two of four"


def test_a_clause_is_compared_by_its_words_where_sentences_tell_nothing():
    blind = NearestClauses(HEARD, lambda: lambda said: np.ones((len(said), 1)), lambda: words)
    assert blind("rotate leftward") == "turn left" and blind("rotate right") == "turn right"


def test_a_number_that_was_not_said_is_not_read():
    read = NearestClauses(["turn 60 degrees left", "turn left"], lambda: sentences, lambda: words)
    assert read("rotate 30 degrees leftward") == "turn left", "though the other clause shares more words"
    assert read("rotate 60 degrees leftward") == "turn 60 degrees left"
    none = NearestClauses(["turn 60 degrees left"], lambda: sentences, lambda: words)
    assert none("rotate leftward") == "rotate leftward"


def test_a_clause_goes_to_the_side_that_was_said_in_whatever_word():
    heard = ["turn right at the big red door", "turn left"]
    read = NearestClauses(heard, lambda: sentences, lambda: words)
    assert read("rotate left at the big red door") == "turn left", "though the other clause shares more words"
    assert read("rotate leftward at the big red door") == "turn left"
    assert read("now a door") == heard[0], "a word that is unlike both means neither"
    others = NearestClauses(["walk on", heard[0]], lambda: sentences, lambda: words)
    assert others("rotate left at the big red door") == heard[0], "none goes to that side"


def test_what_ends_texts_is_rather_read_at_their_ends():
    heard = ["walk on . the walk ends"] * 9
    alike = NearestClauses(heard, lambda: lambda said: np.ones((len(said), 1)), lambda: words)
    assert alike("the walk . the walk") == "walk on . the walk ends"


def test_two_new_clauses_are_read_as_one_that_is_much_nearer_than_both():
    read = NearestClauses(["find a mug in the hall", "go on", "turn left"], lambda: sentences, lambda: words)
    assert read("seek a mug , it stands in the aisle") == "find a mug in the hall"
    assert read("rotate leftward , march on") == "turn left , go on", "each is near enough"
    assert read("seek a mug . it stands in the aisle").count(".") == 1, "sentences stay apart"
    assert read("seek a mug , . it stands in the aisle").count(".") == 1
    numbers = NearestClauses(["turn 60 degrees left", "go 2 steps"], lambda: sentences, lambda: words)
    assert numbers("walk away , rotate 60 degrees leftward") == "walk away , turn 60 degrees left"


def test_who_heard_nothing_reads_everything_as_it_is():
    assert NearestClauses([], lambda: sentences, lambda: words)("go on , stop") == "go on , stop"


def test_every_clause_is_embedded_once(read):
    counted = []
    once = NearestClauses(HEARD, lambda: lambda said: counted.append(len(said)) or sentences(said), lambda: words)
    for _ in range(3):
        once("rotate leftward . rotate leftward")
    assert counted == [6, 1, 1], "what was heard, and the new clause before others and at the end"


def test_the_training_houses_of_a_data_set_are_what_was_heard(tmp_path, monkeypatch):
    data = built(tmp_path / "data")
    first, *_ = names = data.names("train")
    routes = data.routes(first)
    unheard = {dataclasses.replace(r, instruction=f"tread {r.instruction}") for r in routes if r.split != "train_seen"}
    monkeypatch.setattr(
        Dataset, "routes", lambda self, name: [r for r in routes if r.split == "train_seen"] + [*unheard]
    )
    heard, one = set(heard_in(data)), set(heard_in(data, houses=1))
    assert {t.request for t in data.tasks("train")} <= heard and {r.instruction for r in routes} <= heard
    assert unheard and not {r.instruction for r in unheard} & heard, "wordings that are kept for evaluation"
    others = {t.request for t in data.tasks("train") if t.world != first}
    assert len(names) > 1 and one < heard and heard - one <= others


def test_vnlas_advisor_is_heard_before_requests_in_vnlas_data_sets_alone(tmp_path):
    said, others = (heard_in(built(tmp_path / kind, kind)) for kind in ("vnla", "hanna"))
    assert any(text.startswith("turn 60 degrees left , stop . find ") for text in said)
    assert not any("degrees" in text for text in others)


def test_minilm_reads_sentences_that_share_no_word_with_what_was_heard():
    pytest.importorskip(word_vectors.PACKAGE)
    read = NearestClauses(["turn left", "turn right", "go forward 2 steps", "find a mug in a kitchen", "stop"])
    assert read("point yourself right ; keep your direction for 2 paces") == "turn right ; go forward 2 steps"


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setattr(word_vectors, "PACKAGE", "no_such_package")
    word_vectors.minilm.cache_clear()
    with pytest.raises(word_vectors.UnableError, match="sentences"):
        nearest_clauses.minilm_sentences.__wrapped__()


@pytest.mark.parametrize("order", [["vnla"], ["hari", "--agent", "shortest"]])
def test_agents_that_read_nothing_refuse_another_reading(order, capsys):
    assert main(["evaluate", *order, "--reading", "nearest-clauses"]) == 2
    assert "trained agents of hanna, vln, vnla" in capsys.readouterr().err
