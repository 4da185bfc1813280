"""Paraphrases say the same in sentences that no speaker of the corpus says."""

from __future__ import annotations

import importlib
import re

import pytest

from embodied.agents.common.paraphrases import UNHEARD, VARIED, Wordings, paraphrase, varied
from embodied.agents.common.vocabulary import tokenize
from embodied.agents.studies import wordings as studied
from embodied.agents.studies.wordings import PARAPHRASED, SYNONYMS, WORDING, code_of
from embodied.assets.catalogue import load_catalogue
from embodied.assets.closure import code_digest
from embodied.language import parse
from embodied.language.clauses import Enter, Exit, Past, StopIn, Turn
from embodied.language.grammar import Phrase, say
from embodied.language.lexicon import ROOM_NOUNS, Word, lexicon_of
from embodied.language.speakers import draw_speaker
from embodied.language.templates import TEMPLATES
from embodied.seeds import stream


@pytest.fixture(scope="module")
def lexicon():
    return lexicon_of(load_catalogue())


def test_every_clause_has_frames_and_none_is_a_template():
    pairs = {" ".join(t.kinds) for t in TEMPLATES}
    for wordings in (UNHEARD, VARIED):
        assert {k for t in TEMPLATES for k in t.kinds} <= set(wordings.frames) <= pairs
        assert not frames_of(wordings) & {t.text for t in TEMPLATES}


def test_no_frame_of_the_tests_and_none_of_its_words_in_their_places_are_heard_in_training():
    """Synonyms of the tests are chosen among the words that an agent does not know."""
    assert not frames_of(UNHEARD) & frames_of(VARIED)
    words = [
        {" ".join(tokenize(j)).strip(".,;- ") for j in x.joints} - {"", "then", "and", "and then"}
        for x in (UNHEARD, VARIED)
    ]
    assert not words[0] & words[1]
    assert not set(UNHEARD.requests) & set(VARIED.requests) and not set(UNHEARD.where) & set(VARIED.where)
    pairs = [{(word, w) for word, like in x.synonyms.items() for w in like} for x in (UNHEARD, VARIED)]
    assert not pairs[0] & pairs[1]
    texts = " ".join((*frames_of(UNHEARD), *UNHEARD.requests, *UNHEARD.where, *UNHEARD.joints))
    assert not {w for like in VARIED.synonyms.values() for w in like} & set(tokenize(re.sub(r"{\w+}", "", texts)))


def test_synonyms_of_training_name_no_other_room(lexicon):
    kinds = {noun.lower(): kind for kind, nouns in ROOM_NOUNS.items() for noun in nouns}
    for word, like in VARIED.synonyms.items():
        assert {kinds.get(w, kinds.get(word)) for w in like} <= {kinds.get(word)}, word


def frames_of(wordings: Wordings) -> set[str]:
    return {frame for frames in (*wordings.frames.values(), *wordings.actions.values()) for frame in frames}


def test_frames_name_what_the_templates_of_their_clauses_name():
    slots = lambda text: set(re.findall(r"{(\w+)}", text)) - {"walk", "soon"}
    for kinds, frames in (*UNHEARD.frames.items(), *VARIED.frames.items()):
        named = {
            "metres" if s == "steps" else s for t in TEMPLATES if " ".join(t.kinds) == kinds for s in slots(t.text)
        }
        for frame in frames:
            assert slots(frame) == named, (kinds, frame)


def test_nouns_sides_and_numbers_stay_and_the_sentence_does_not(lexicon):
    text = "Turn left and walk 3 meters. Go past the brown armchair. Stop by the looking glass."
    said = paraphrase(text, lexicon, UNHEARD)
    for word in ("left", "three meters", "brown armchair", "looking glass"):
        assert word in said, word
    assert said == paraphrase(text, lexicon, UNHEARD) != text
    order = [said.lower().index(word) for word in ("brown armchair", "looking glass")]
    assert order == sorted(order)


def test_what_people_say_is_said_otherwise_at_about_the_same_length(lexicon):
    sofa = Word("sofa", ("brown",))
    route = (Turn("left"), Exit("bedroom"), Past(lexicon.thing(sofa)), Enter("kitchen"), StopIn("kitchen"))
    phrases = [Phrase(c, sofa if isinstance(c, Past) else None) for c in route]
    rngs = [stream(k, "test") for k in range(30)]
    texts = [tokenize(say(phrases, draw_speaker(rng), rng=rng)) for rng in rngs]
    said = [tokenize(paraphrase(" ".join(t), lexicon, UNHEARD)) for t in texts]
    triples = lambda t: set(zip(t, t[1:], t[2:], strict=False))
    shared = [len(triples(a) & triples(b)) / len(triples(b)) for a, b in zip(texts, said)]
    assert max(shared) < 0.5 and sum(shared) / len(shared) < 0.2
    assert 0.6 < sum(map(len, said)) / sum(map(len, texts)) < 1.5


def test_requests_and_sub_goals_of_vnla_are_said_otherwise(lexicon):
    said = paraphrase("turn 60 degrees left , go forward 2 steps . find a mug in a kitchen", lexicon, UNHEARD)
    goal, request = said.split(" . ")
    assert "60 degrees" in goal and "left" in goal and "2 paces" in goal and "forward" not in goal
    assert "a mug" in request and "a kitchen" in request and "find" not in request
    assert paraphrase("hm", lexicon, UNHEARD) == "hm", "what says nothing stays"
    for advice in ("turn sharply left", "look around", "walk over to the fridge", "go forward two steps"):
        said = paraphrase(f"{advice} . find a mug", lexicon, UNHEARD)
        assert said.startswith(f"{advice} . "), "a person's words stay"


def test_the_grammar_cannot_read_them(lexicon):
    """Else they would be no news to an agent that learned from its sentences."""
    text = "Turn left. Leave the bedroom. Walk past the sofa. Stop by the bed."
    clauses = parse(text, lexicon).clauses
    try:
        again = parse(paraphrase(text, lexicon, UNHEARD), lexicon).clauses
    except ValueError:
        again = ()
    assert len(again) < len(clauses)


def test_training_texts_are_varied_and_each_always_alike():
    say = varied(load_catalogue())
    texts = [f"Walk past the sofa. Turn left. Leave the {room}. Stop by the bed." for room in ROOM_NOUNS]
    said = [say(text) for text in texts]
    assert said == [varied(load_catalogue())(text) for text in texts]
    as_it_was = sum(a.lower() == b.lower() for a, b in zip(texts, said, strict=True)) / len(texts)
    assert 0.1 < as_it_was < 0.6, "some people speak as the corpus does"
    assert len({say(f"turn 60 degrees left . find a mug in a {room}").split(" . ")[0] for room in ROOM_NOUNS}) > 3


@pytest.mark.parametrize("learner", ["vln", "hanna", "vnla"])
def test_every_reader_is_judged_in_all_wordings(learner):
    table = getattr(importlib.import_module(f"embodied.agents.{learner}.study"), f"{learner.upper()}_TABLES")["words"]
    assert [r.judge.get(WORDING) for r in table.rows] == [None, SYNONYMS, PARAPHRASED] * 3
    assert [bool(r.train) for r in table.rows] == [False] * 3 + [True] * 6
    assert [r.train.get("varied_words", False) for r in table.rows] == [False] * 6 + [True] * 3


def test_what_was_judged_names_the_code_that_words_it():
    assert not code_of({"played": "learned"})
    assert code_of({WORDING: SYNONYMS}) == {"wording": code_digest(studied.__name__)}
