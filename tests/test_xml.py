"""XML: what we read of it opens no other file and does not swell; what we write holds names as names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from embodied.agents.bandit.corpus import _blocks
from embodied.scene.glb import prim_name
from embodied.scene.robots import _loaded

ROOT = Path(__file__).parents[1]
PARSERS = re.compile(
    r"ElementTree|lxml|minidom|expat|BeautifulSoup|from_xml_(path|string)|MjSpec\.from|mjcf\.from|Stage\.Open|Layer\.FindOrOpen"
)
READERS = {
    "agents/bandit/corpus.py",  # pages of LibreOffice's help, as HTML: attacked below
    "embodied/envs/driven.py",  # our own file
    "embodied/scene/robots.py",  # attacked below
}


def test_nobody_else_parses_xml_or_usd():
    """Whoever does so first adds the attack on it here."""
    sources = [p for top in ("assets", "embodied", "agents", "viz") for p in (ROOT / top).rglob("*.py")]
    found = {str(p.relative_to(ROOT)) for p in sources if PARSERS.search(p.read_text(encoding="utf-8"))}
    assert found == READERS


LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
ATTACKS = {
    "another file": ('<!ENTITY e SYSTEM "{secret}">', "&e;"),
    "another file by parameter": ('<!ENTITY % p SYSTEM "{secret}"> %p;', "&p;"),
    "a billion laughs": (f'<!ENTITY l0 "ha">{LAUGHS}', "&l11;"),
}


@pytest.mark.parametrize("name", ATTACKS)
def test_entities_of_a_page_of_help_are_not_followed(tmp_path, name):
    (tmp_path / "secret.txt").write_text("the secret")
    dtd, used = ATTACKS[name]
    page = tmp_path / "page.html"
    page.write_text(
        f"<!DOCTYPE html [{dtd.format(secret=(tmp_path / 'secret.txt').as_uri())}]>"
        f'<html><body><p id="par_id1234567">before {used} after</p></body></html>'
    )
    text = str(_blocks(page))
    assert "before" in text and "secret" not in text and len(text) < 1000


@pytest.mark.parametrize("name", ATTACKS)
def test_entities_of_a_robot_are_not_followed(tmp_path, name):
    (tmp_path / "secret.txt").write_text("the secret")
    dtd, used = ATTACKS[name]
    robot = tmp_path / "robot.xml"
    robot.write_text(
        f"<!DOCTYPE mujoco [{dtd.format(secret=(tmp_path / 'secret.txt').as_uri())}]>"
        f'<mujoco model="before {used} after"><worldbody/></mujoco>'
    )
    try:
        text = _loaded(robot).modelname
    except ValueError:
        text = ""
    assert "secret" not in text and len(text) < 1000


@pytest.mark.parametrize("owner", ['a"><b>/c', "Stühle_1/leaf", "../x", "1", "a b", "椅子_1", "</Mesh>", "{}\n", ""])
def test_names_of_prims_are_ascii_words_whatever_owners_are_called(owner):
    assert re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", prim_name(owner))
