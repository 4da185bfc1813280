"""Every document and every difference that code or docs cite can be opened by whoever has the repository."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CITED = re.compile(r"\bS(\d+)\b")
LIST = re.compile(r"sources\.md((?:[,\s#*]|and|to|\bS\d+\b)+)")
"""What follows the name of the page, also on the next line of a comment: 'docs/sources.md, S3 and S4'."""
DOCUMENT = re.compile(r"\b[\w./-]+\.md\b")


def texts() -> list[tuple[str, str]]:
    """(path, text) of every Python and Markdown file that git tracks, but for this one."""
    names = subprocess.run(["git", "ls-files", "*.py", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    files = [n for n in names.stdout.split() if n != "tests/test_sources.py" and (ROOT / n).is_file()]
    return [(n, (ROOT / n).read_text(encoding="utf-8")) for n in files]


def rows() -> list[int]:
    """The numbers of the rows of docs/sources.md, in its order."""
    return [int(n) for n in re.findall(r"^\| S(\d+) \|", (ROOT / "docs/sources.md").read_text(encoding="utf-8"), re.M)]


def missing(text: str, known: set[int]) -> list[int]:
    """Numbers of differences that `text` cites and docs/sources.md does not have."""
    return [int(n) for m in LIST.finditer(text) for n in CITED.findall(m[1]) if int(n) not in known]


def test_every_difference_has_a_number_of_its_own():
    assert len(rows()) == len(set(rows())) > 0


def test_every_cited_difference_exists():
    known = set(rows())
    wrong = [f"{name}: S{n}" for name, text in texts() for n in missing(text, known)]
    assert not wrong, "\n".join(wrong)


def documents(text: str) -> set[str]:
    """What `text` sends its reader to: below a folder of ours or in capitals; other names are what commands write."""
    found = DOCUMENT.findall(re.sub(r"https?://\S+", "", text))
    ours = {p.name for p in ROOT.iterdir() if p.is_dir()} - {"out", "data"}
    return {d for d in found if d.split("/")[0] in ours or ("/" not in d and Path(d).stem.isupper())}


def test_no_document_is_cited_that_the_repository_does_not_have():
    here = {name for name, _ in texts()}
    wrong = [
        f"{name}: {cited}"
        for name, text in texts()
        for cited in sorted(documents(text))
        if not {cited, (Path(name).parent / cited).as_posix(), os.path.normpath(Path(name).parent / cited)} & here
    ]
    assert not wrong, "\n".join(wrong)


MADE = ("details.md", "command_line.md")
"""Pages that `make docs` makes, and checks the links to."""


def test_every_link_between_pages_leads_somewhere():
    broken = [
        f"{name}: {target}"
        for name, text in texts()
        if name.endswith(".md")
        for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", re.sub(r"`[^`]*`", "", text))
        if "://" not in target and Path(target).name not in MADE and not (ROOT / name).parent.joinpath(target).exists()
    ]
    assert not broken, "\n".join(broken)


def test_a_page_of_results_can_be_read_in_five_minutes():
    pages = [p for p in (ROOT / "docs/results").glob("*.md") if p.name != "details.md"]  # which is generated
    assert {p.name: n for p in pages if (n := len(p.read_text(encoding="utf-8").split())) > 1200} == {}
