"""What is kept from learning is kept: no model, look, speaker or word of `test_ood` occurs anywhere else."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hand_data import DATA_KINDS, build

from embodied.assets.catalogue import load_catalogue
from embodied.datasets.build import DatasetConfig
from embodied.generate import HouseConfig, generate_house
from embodied.generate.novelty import NOVEL_STYLE, STYLE_FINISHES, finishes_of, furnishable
from embodied.house.house import HouseError
from embodied.language import People
from embodied.language.clauses import Enter, Forward, StopBy, To, Turn
from embodied.language.grammar import NOVEL_TEMPLATES, NOVEL_WORDS, Phrase, say
from embodied.language.lexicon import lexicon_of
from embodied.language.templates import SPEAKERS, TEMPLATES, draw_speaker

AREA = (50.0, 80.0)
SEEDS = range(4)


@pytest.fixture(scope="module")
def catalogue():
    return load_catalogue()


@pytest.fixture(scope="module")
def houses(catalogue):
    return {
        novelty: [generate_house(s, HouseConfig(area=AREA, novelty=novelty), catalogue) for s in SEEDS]
        for novelty in ("familiar", "novel")
    }


def test_no_model_of_a_divided_class_is_in_houses_of_both_kinds(catalogue, houses):
    catalogue = catalogue.furnishing
    familiar, novel = (set(furnishable(catalogue, n).assets) for n in ("familiar", "novel"))
    assert familiar | novel == set(catalogue.assets)
    divided = {catalogue.assets[k].object_class for k in set(catalogue.assets) - familiar}
    seen = {n: {p.asset for h in houses[n] for p in h.placements} for n in houses}
    assert seen["familiar"] <= familiar and seen["novel"] <= novel
    both = {catalogue.assets[k].object_class for k in seen["familiar"] & seen["novel"]}
    kitchen = {catalogue.assets[k].object_class for k in catalogue.assets if "line_" in str(catalogue.assets[k].tags)}
    assert not (both & divided) - kitchen
    new = seen["novel"] - familiar
    assert len(new) > 0.35 * len(seen["novel"])  # a small thing of few models is in houses of both kinds


def test_kitchen_units_of_one_line_stay_together(catalogue):
    lines = {}
    for asset in catalogue.assets.values():
        mine = [tag for tag in asset.tags if tag.startswith("line_")]
        if len(mine) == 1:
            lines.setdefault(mine[0], set()).add(asset.key)
    for novelty, some in (("familiar", 7), ("novel", 2)):
        kept = set(furnishable(catalogue, novelty).assets)
        assert all(units <= kept or not units & kept for units in lines.values())
        assert sum(units <= kept for units in lines.values()) == some


def test_looks_of_novel_houses_are_not_those_that_agents_learn_in(houses):
    assert {h.style for h in houses["novel"]} == {NOVEL_STYLE}
    assert NOVEL_STYLE not in {h.style for h in houses["familiar"]}
    floors = {n: {r.floor_finish for h in houses[n] for r in h.rooms if r.kind != "garage"} for n in houses}
    carpets = {k for taste in STYLE_FINISHES.values() for k in taste.carpets}
    assert not (floors["novel"] & floors["familiar"]) - carpets


def test_novel_tastes_leave_something_to_choose():
    taste = finishes_of(NOVEL_STYLE, "novel")
    others = {
        k for name, t in STYLE_FINISHES.items() if name != NOVEL_STYLE for k in (*t.woods, *t.stones, *t.wet_walls)
    }
    assert not {*taste.woods, *taste.stones, *taste.wet_walls} & others
    assert min(map(len, (taste.woods, taste.stones, taste.wet_floors, taste.wet_walls, taste.papers))) > 1
    assert finishes_of("warm", "familiar") is STYLE_FINISHES["warm"]


def test_a_house_refuses_novelties_that_cannot_be():
    with pytest.raises(HouseError, match="novelty should be one of"):
        HouseConfig(novelty="new")
    with pytest.raises(HouseError, match="familiar houses have the styles"):
        HouseConfig(novelty="familiar", style=NOVEL_STYLE)
    with pytest.raises(ValueError, match="novelty should be None or one of"):
        People(novelty="new")


def test_people_to_learn_from_never_speak_as_the_others_do(catalogue):
    lexicon = lexicon_of(catalogue)
    sofa, plant = (catalogue.of_class(name)[0] for name in ("sofa", "potted plant"))
    said = {"familiar": [], "novel": []}
    for novelty, texts in said.items():
        for seed in range(150):
            rng = np.random.default_rng(seed)
            speaker = draw_speaker(rng, novelty)
            to, by = (lexicon.words_for(a, rng, adjectives=0, novelty=novelty) for a in (sofa, plant))
            begin = [Phrase(c) for c in (Turn("left"), Enter("living_room"), Forward())]
            phrases = [*begin, Phrase(To(lexicon.thing(to)), to), Phrase(StopBy(lexicon.thing(by)), by)]
            texts.append((speaker.habit, {to.noun, by.noun}, say(phrases, speaker, rng=rng).lower()))
    assert "formal" not in {habit for habit, *_ in said["familiar"]}
    assert "formal" in {habit for habit, *_ in said["novel"]}
    assert not any(nouns & lexicon.novel_nouns for _, nouns, _ in said["familiar"])
    heard = {n: " ".join(re.sub("[.,]", " ", text) for *_, text in texts) for n, texts in said.items()}
    rooms = [w for w in NOVEL_WORDS if w in ("parlor", "lounge", "sitting room", "front room")]
    assert any(r in heard["novel"] for r in rooms) and not any(r in heard["familiar"] for r in rooms)
    for kinds in (("turn",), ("forward",)):
        unheard = [t.text for t in TEMPLATES if t.kinds == kinds and t in NOVEL_TEMPLATES and "{" not in t.text]
        assert [text for text in unheard if f" {text} " in heard["familiar"]] == []


def test_every_clause_can_be_said_by_everybody():
    for kinds in {t.kinds for t in TEMPLATES}:
        same = [t for t in TEMPLATES if t.kinds == kinds and not t.habit]
        assert any(t not in NOVEL_TEMPLATES for t in same), kinds
    assert sum(s.share for s in SPEAKERS if s.habit == "formal") > 0


@pytest.mark.parametrize("kind", DATA_KINDS)
def test_a_data_set_keeps_novel_houses_for_their_own_split(tmp_path, kind):
    data = build(tmp_path / "data", tmp_path / "cache", kind, ood=2)
    assert data.splits[-1] == "test_ood"
    assert data.names("test_ood") == ("ood_0000", "ood_0001")
    assert data.ood == ("test_ood",)
    unseen = "test_unseen_env" if kind == "hari" else "test_unseen"
    assert len(data.tasks("test_ood")) == 2 * len(data.tasks(unseen))
    assert {r.split for r in data.routes("ood_0000")} <= {"test"}
    data.split("test_ood").make_env()
    assert not set(data.names("test_ood")) & {n for s in data.splits[:-1] for n in data.names(s)}


def test_data_sets_without_novel_houses_are_what_they_were():
    assert "ood" not in DatasetConfig("hanna").facts()
    assert DatasetConfig("hanna").novelty_of("train") is None
    config = DatasetConfig("hanna", ood=3)
    assert (config.novelty_of("train"), config.novelty_of("ood")) == ("familiar", "novel")
    assert config.plan.houses["ood"] == 3
    with pytest.raises(ValueError, match="should not be negative"):
        DatasetConfig("hanna", ood=-1)
