"""BANDITNMT from corpus to table: it learns from ratings alone, resumes exactly, and fails clearly."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path

import numpy as np
import pytest
import torch

from embodied.agents.bandit import corpus
from embodied.agents.bandit.corpus import CorpusError, Pair, Sizes
from embodied.agents.bandit.network import (
    TRANSLATOR_REMEDY,
    BanditAbout,
    Critic,
    EncoderDecoder,
    Translator,
    batches,
    begin,
    decode,
    greedy,
    load_network,
    perplexity,
)
from embodied.agents.bandit.ratings import Rater
from embodied.agents.bandit.study import BanditStudy
from embodied.agents.bandit.training import bandit, load_corpus, pretrain, train_critic
from embodied.agents.common.session import Session
from embodied.agents.common.tensors import padded, sampled_choice
from embodied.agents.common.vocabulary import END_NUMBER, PAD_NUMBER, most_frequent
from embodied.agents.common.weights import load_weights, read_checkpoint
from embodied.agents.learners.bandit import BanditConfig
from embodied.agents.studies.engine import run_study
from embodied.cli import main
from embodied.errors import UnableError
from embodied.locks import LockedError, locked
from embodied.seeds import stream

pytestmark = pytest.mark.slow

GERMAN = ["null", "eins", "zwei", "drei", "vier", "fünf", "sechs", "sieben"]
ENGLISH = ["zero", "one", "two", "three", "four", "five", "six", "seven"]
TOY = BanditConfig(
    hidden_size=32,
    source_words=20,
    target_words=20,
    longest=8,
    batch=32,
    pretraining_passes=6,
    critic_passes=2,
    pretraining_rate=1e-2,
    bandit_rate=3e-3,
)
silent = lambda line: None


def toy_pairs(n: int, seed: int = 0) -> list[Pair]:
    """Numbers in German and English, four a document, each source once."""
    rng, found = stream(seed, "toy"), {}
    while len(found) < n:
        digits = rng.integers(8, size=int(rng.integers(3, 7)))
        found.setdefault(tuple(digits), len(found))
    return [
        Pair(" ".join(GERMAN[d] for d in k), " ".join(ENGLISH[d] for d in k), f"page {i // 4}")
        for k, i in found.items()
    ]


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("corpus")
    corpus.make_corpus(toy_pairs(800), folder, Sizes(supervised=320, bandit=320, dev=60, test=60), seed=0, note=silent)
    return folder


@pytest.fixture(scope="module")
def trained(data, tmp_path_factory) -> Path:
    """A weakly trained toy translator with its critic."""
    m, home = load_corpus(data, TOY), tmp_path_factory.mktemp("trained")
    pretrain(m, home / "pretrain", note=silent)
    for reference in ("weak", "full"):
        train_critic(m, home / "pretrain" / f"{reference}.safetensors", home / reference, note=silent)
    return home


# Corpus ------------------------------------------------------------------------------------------


def test_splits_share_no_document_and_overlap_is_as_asked():
    pairs = corpus.filtered(toy_pairs(800))
    splits = corpus.split(pairs, Sizes(supervised=300, bandit=200, dev=40, test=40, overlap=0.95), seed=1)
    apart = ("supervised", "bandit_disjoint", "dev", "test")
    documents = {name: {p.document for p in splits[name]} for name in splits}
    for i, a in enumerate(apart):
        for b in apart[i + 1 :]:
            assert not documents[a] & documents[b], f"{a} and {b} share documents"
    known = {p.source for p in splits["supervised"]}
    assert sum(p.source in known for p in splits["bandit_overlap"]) == 190
    assert {name: len(splits[name]) for name in apart[:2]} == {"supervised": 300, "bandit_disjoint": 200}
    assert splits == corpus.split(pairs, Sizes(supervised=300, bandit=200, dev=40, test=40, overlap=0.95), seed=1)


def test_filter_by_length_ratio_and_unique_source():
    kept = corpus.filtered(
        [
            Pair("Eins zwei.", "One two.", "d"),
            Pair("EINS zwei .", "again two three", "d"),
            Pair("zu kurz", "too short", "d"),
            Pair("a b c", "a b c d e f", "d"),
            Pair("w " * 51, "w " * 50, "d"),
        ]
    )
    assert kept == [Pair("eins zwei .", "one two .", "d")]


@pytest.mark.parametrize(
    ("german", "english", "message"),
    [
        (b"eins zwei\ndrei\n", b"one two\n", "2 lines.*1; line n"),
        (b"eins\n\ndrei\n", b"one\ntwo\nthree\n", ":2: an empty side"),
        (b"eins\nf\xfcnf\n", b"one\nfive\n", ":2: not UTF-8.*iconv"),
        (b"", b"", "is empty"),
        (None, b"one\n", "is missing.*embodied corpus"),
    ],
)
def test_bad_files_are_named_with_line_and_remedy(tmp_path, german, english, message):
    for language, text in (("de", german), ("en", english)):
        if text is not None:
            (tmp_path / f"dev.{language}").write_bytes(text)
    with pytest.raises(CorpusError, match=message):
        corpus.load(tmp_path, ["dev"])


def mo(messages: dict[str, str]) -> bytes:
    """A gettext catalogue as msgfmt would write it."""
    entries = sorted({"": "Content-Type: text/plain; charset=UTF-8\n", **messages}.items())
    at, tables, body = 28 + 16 * len(entries), ([], []), b""
    for k in range(2):
        for entry in entries:
            text = entry[k].encode()
            tables[k].append(struct.pack("<2I", len(text), at + len(body)))
            body += text + b"\0"
    head = struct.pack("<7I", 0x950412DE, 0, len(entries), 28, 28 + 8 * len(entries), 0, 0)
    return head + b"".join(tables[0]) + b"".join(tables[1]) + body


def libreoffice_folder(root: Path) -> Path:
    """What the three packages hold, small."""
    page = '<html><body><h1 id="hd_id1">{}</h1><p id="par_id2">{}</p><p id="bm_module">{}</p></body></html>'
    for language, texts in (
        ("de", ("Datum <i>und</i> Zeit", "Wählen Sie ein Datum. Drücken Sie OK.", "Rahmen")),
        ("en-US", ("Date <i>and</i> time", "Choose a date. Press OK.", "frame")),
    ):
        path = root / corpus.HELP / language / "text" / "page.html"
        path.parent.mkdir(parents=True)
        path.write_text(page.format(*texts), encoding="utf-8")
    menus = root / corpus.MENUS
    menus.mkdir(parents=True)
    (menus / "sw.mo").write_bytes(mo({"dialog|label\x04_Open a file…": "Datei ö~ffnen…"}))
    return root


def test_help_and_menus_are_read_sentence_by_sentence(tmp_path):
    assert corpus.read(libreoffice_folder(tmp_path)) == [
        Pair("Datum und Zeit", "Date and time", "text/page.html"),
        Pair("Wählen Sie ein Datum.", "Choose a date.", "text/page.html"),
        Pair("Drücken Sie OK.", "Press OK.", "text/page.html"),
        Pair("Datei öffnen…", "Open a file…", "sw:dialog"),
    ]


def test_a_missing_or_damaged_package_is_named(tmp_path):
    with pytest.raises(CorpusError, match="lacks package libreoffice-help-de .*apt-get download"):
        corpus.read(tmp_path)
    root = libreoffice_folder(tmp_path / "whole")
    whole = (root / corpus.MENUS / "sw.mo").read_bytes()
    for damaged in (b"no catalogue", b"", whole[:10], whole[:30], whole[:-20]):
        (root / corpus.MENUS / "sw.mo").write_bytes(damaged)
        with pytest.raises(CorpusError, match="sw.mo: damaged"):
            corpus.read(root)
    (tmp_path / "libreoffice-help-de_1_all.deb").write_bytes(b"!<arch>\ncut")
    with pytest.raises((CorpusError, UnableError), match="damaged|dpkg-deb is needed"):
        corpus.read(tmp_path)


def test_without_apt_the_packages_are_asked_for(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UnableError, match="no apt-get here.*--from"):
        corpus.fetch(tmp_path / "packages")


# Words and networks ------------------------------------------------------------------------------


def test_words_are_numbered_by_frequency_and_come_back():
    lexicon = most_frequent("babcab", most=5)
    assert lexicon.words[3:] == ("b", "a")
    assert lexicon.sentence(["a", "c", "b"]) == [4, 1, 3, END_NUMBER]
    assert lexicon.decode([4, 3, END_NUMBER, 4]) == ("a", "b")


def networks() -> tuple[Translator, Critic]:
    return tuple(begin(kind(12, 9, 16), torch.Generator().manual_seed(1)) for kind in (Translator, Critic))


SOURCE = [[3, 4, 5, 2], [6, 2], [7, 8, 9, 10, 11, 2]]


def word_by_word(network: EncoderDecoder, source: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
    """What `read` computes, by `step` with all sentences to the end."""
    encoded, now = network.encode(source)
    before, outputs = torch.cat([torch.full_like(target[:, :1], END_NUMBER), target[:, :-1]], 1), []
    for words in before.unbind(1):
        now = network.step(encoded, now, network.word_before(words))
        outputs.append(now.output)
    return torch.stack(outputs, 1)


def test_known_words_are_read_as_they_are_one_by_one():
    network = networks()[0].body.double()
    with torch.no_grad():
        for p in network.parameters():
            p.mul_(5)
    source, target = padded(SOURCE), padded([[7, 2], [3, 3, 3, 4, 2], [5, 6, 2]])
    weights = torch.from_numpy(stream(0, "w").normal(size=(3, 5, 16)))
    found = []
    read, places = network.read(source, target)
    assert sorted(places.tolist()) == (target.flatten() != PAD_NUMBER).nonzero()[:, 0].tolist()
    for outputs in (read, word_by_word(network, source, target).flatten(0, 1)[places]):
        network.zero_grad()
        (outputs * weights.flatten(0, 1)[places]).sum().backward()
        found.append((outputs.detach(), {n: p.grad.clone() for n, p in network.named_parameters()}))
    assert torch.allclose(found[0][0], found[1][0], atol=1e-12)
    assert all(torch.allclose(found[0][1][n], g, atol=1e-12) and g.abs().max() > 1e-6 for n, g in found[1][1].items())


def test_what_is_sampled_does_not_depend_on_the_batch():
    translator, _ = networks()
    source, uniforms = SOURCE * 11, stream(0, "u").random((33, 20))

    def drawn(batch: int) -> list[list[int]]:
        parts = [slice(k, k + batch) for k in range(0, 33, batch)]
        return [s for p in parts for s in decode(translator, padded(source[p]), sampled_choice(uniforms[p]), 20)]

    together = drawn(32)
    assert together == drawn(5) == drawn(1)
    assert all(PAD_NUMBER not in s and len(s) <= 20 for s in together)


def test_samples_follow_the_distribution():
    translator, _ = networks()
    n = 4000
    uniforms = stream(1, "u").random((n, 1))
    first = [s[0] for s in decode(translator, padded([SOURCE[0]] * n), sampled_choice(uniforms), 1)]
    logits = translator.out(translator.body.read(padded([SOURCE[0]]), torch.tensor([[3]]))[0])[0]
    logits[PAD_NUMBER] = -torch.inf
    wanted = logits.softmax(-1).detach().numpy()
    assert np.abs(np.bincount(first, minlength=9) / n - wanted).max() < 4 * np.sqrt(0.25 / n)


def test_every_sentence_is_in_one_batch():
    lengths = list(range(1, 131))
    found = batches(lengths, 8, stream(0, "b"))
    assert sorted(i for b in found for i in b) == list(range(130))
    assert len(found) == 17
    assert np.mean([np.ptp([lengths[i] for i in b]) for b in found]) < 20


# Learning ----------------------------------------------------------------------------------------


def test_pretraining_learns_to_translate(data, trained):
    m = load_corpus(data, TOY)
    translator, weak = m.translator(), m.translator()
    for network, name in ((translator, "full"), (weak, "weak")):
        load_network(network, trained / "pretrain" / f"{name}.safetensors")
    about = load_weights(trained / "pretrain" / "full.safetensors", "bandit", BanditAbout, TRANSLATOR_REMEDY)[1]
    assert about.config == TOY and about.target == m.lexicons[1].words
    assert perplexity(translator, m.splits["dev"]) < 0.7 * perplexity(weak, m.splits["dev"])
    said = greedy(translator, m.splits["dev"], m.lexicons[1], 8)
    assert np.mean([s[0] == r[0] for s, r in zip(said, m.splits["dev"].references, strict=True)]) > 0.5


def test_ratings_alone_improve_translations(data, trained, tmp_path):
    m = load_corpus(data, TOY)
    files = trained / "pretrain" / "weak.safetensors", trained / "weak" / "critic.safetensors"
    none = bandit(m, *files, tmp_path / "none", "reference", passes=6, note=silent)
    clean = bandit(m, *files, tmp_path / "clean", "a2c", passes=6, note=silent)
    assert clean[-1]["per-sentence BLEU"] > none[-1]["per-sentence BLEU"] + 5
    assert none[-1]["held-out BLEU"] == none[0]["held-out BLEU"]


def weights(folder: Path) -> dict[str, torch.Tensor]:
    return {
        f"{k}.{n}": t
        for k, m in read_checkpoint(folder / "checkpoint.pt")["parts"].items()
        if k in ("translator", "critic")
        for n, t in m.items()
    }


def test_a_killed_run_goes_on_exactly(data, trained, tmp_path, monkeypatch):
    config = dataclasses.replace(TOY, checkpoint_minutes=1e-9)
    m = load_corpus(data, config)
    files = trained / "pretrain" / "weak.safetensors", trained / "weak" / "critic.safetensors"
    rater = Rater(granularity=5, variance=0.5)
    whole = bandit(m, *files, tmp_path / "whole", "a2c", rater=rater, passes=2, note=silent)
    save = Session.save

    def killed(session):
        save(session)
        if session.progress.update == 13:
            raise SystemExit

    monkeypatch.setattr(Session, "save", killed)
    with pytest.raises(SystemExit):
        bandit(m, *files, tmp_path / "parts", "a2c", rater=rater, passes=2, note=silent)
    monkeypatch.setattr(Session, "save", save)
    parts = bandit(m, *files, tmp_path / "parts", "a2c", rater=rater, passes=2, note=silent)
    untimed = lambda passes: [{k: v for k, v in p.items() if k != "seconds"} for p in passes]
    assert untimed(parts) == untimed(whole)
    one, other = weights(tmp_path / "whole"), weights(tmp_path / "parts")
    assert all(torch.equal(one[k], other[k]) for k in one)


def test_a_study_writes_its_table_and_runs_nothing_twice(data, tmp_path):
    study = BanditStudy(data, dataclasses.replace(TOY, pretraining_passes=1, critic_passes=1), (0, 1))
    text = run_study(study, ["3.2"], tmp_path, note=silent)["3.2"].read_text()
    assert "(2.82)" in text and "| weakly pre-trained, Δ NED-A2C |" in text
    first = {p: p.stat().st_mtime_ns for p in tmp_path.rglob("checkpoint.pt")}
    assert len(first) == 2 * (1 + 2 + 6)
    run_study(study, ["3.2"], tmp_path, note=silent)
    assert {p: p.stat().st_mtime_ns for p in tmp_path.rglob("checkpoint.pt")} == first
    people = dataclasses.replace(study, repeats=(0,), rater=Rater(granularity=4, skew=2.0))
    assert "| as people rate |" in run_study(people, ["people"], tmp_path, note=silent)["people"].read_text()
    (home,) = tmp_path.glob("runs/*rater*")
    (rated,) = read_checkpoint(home / "checkpoint.pt")["history"]
    assert rated["rating"] < rated["per-sentence BLEU"], "a harsh rater"


def test_a_corpus_that_was_stopped_in_between_is_not_believed(tmp_path, monkeypatch):
    sizes = Sizes(supervised=40, bandit=20, dev=8, test=8)
    make = lambda seed: corpus.make_corpus(toy_pairs(200), tmp_path, sizes, seed=seed, note=silent)
    make(0)
    assert corpus.load(tmp_path, ["dev"])
    write, written = corpus.write_bytes, []

    def stopped(path, data):
        if len(written) == 3:
            raise KeyboardInterrupt
        written.append(path)
        write(path, data)

    monkeypatch.setattr(corpus, "write_bytes", stopped)
    with pytest.raises(KeyboardInterrupt):
        make(1)
    assert not (tmp_path / "corpus.json").exists(), "nothing vouches for the mix"
    with pytest.raises(CorpusError, match="is missing"):
        corpus.load(tmp_path, ["supervised", "test"])
    with locked(tmp_path), pytest.raises(LockedError):
        make(0)


def test_the_command_says_when_sentences_are_too_few_and_a_study_how_a_corpus_is_made(tmp_path, capsys):
    source = str(libreoffice_folder(tmp_path / "whole"))
    assert main(["corpus", "--out", str(tmp_path / "c"), "--from", source]) == 2
    assert "too few" in capsys.readouterr().err
    assert main(["study", "bandit", "3.2", "--data", str(tmp_path / "none"), "--out", str(tmp_path / "s")]) == 2
    assert "embodied corpus" in capsys.readouterr().err
