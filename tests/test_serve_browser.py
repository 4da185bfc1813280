"""The page in a real browser: two people play an episode, whatever happens to the network, the page and the server."""

from __future__ import annotations

import dataclasses
import math
import re
import shutil
import urllib.request

import cv2
import numpy as np
import pytest
from hand_data import built
from hand_serve import HEAD, Served, gradient, make_data, write_study
from test_moving_parts import HOUSE

from embodied.envs.base import HelpEnv
from embodied.envs.continuous import NavMeshCache
from embodied.evaluation.evaluate import play
from embodied.geometry import wrap
from embodied.interface import Episode
from embodied.navigation.graph import build_graph
from embodied.policies.baselines import Forward10
from embodied.records import load_lines, save_lines
from embodied.serve.driving import BrowserBody
from embodied.serve.results import Judgement

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here; `make browser` installs Debian's"),
]
FLAGS = "no-sandbox disable-gpu enable-unsafe-swiftshader disable-quic no-first-run disable-background-networking"
PARTS = """
[[parts]]
name = "together"
tasks = 1
per_person = 1
answers = 99
advice = "Work together."
"""


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, args=[f"--{flag}" for flag in FLAGS.split()])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    folder = tmp_path_factory.mktemp("browsed")
    data = make_data(folder)
    served = Served(write_study(folder, PARTS), "--address", "http://127.0.0.1:PORT/kitchen")
    served.data, served.tasks = data, data.tasks("val_seen")
    yield served
    served.stop()


class Someone:
    """A person with a browser of their own."""

    def __init__(self, browser, server, **options):
        self.context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
        self.page, self.problems = self.context.new_page(), []
        self.page.set_default_timeout(600_000)
        self.page.on("pageerror", lambda e: self.problems.append(str(e)))
        self.page.on("dialog", lambda d: d.accept())
        self.page.goto(server.links["join"][0])
        self.press("I have read this and take part")
        self.press("Begin")

    def press(self, name):
        self.page.get_by_role("button", name=name, exact=True).click()

    def sees(self, text):
        playwright.expect(self.page.get_by_text(text).first).to_be_visible(timeout=600_000)

    def write(self, label, text, button):
        self.page.get_by_label(label).fill(text)
        self.press(button)

    def close(self):
        assert self.problems == []
        self.context.close()


def pair(browser, server):
    agent = Someone(browser, server)
    agent.sees("Waiting for a partner")
    helper = Someone(browser, server)
    agent.sees("Your task")
    helper.sees("Watch the agent")
    return agent, helper


@pytest.fixture
def two(browser, server):
    both = pair(browser, server)
    yield both
    for one in both:
        one.close()


def test_two_browsers_play_to_the_end_through_a_reload_and_a_dead_server(two, server):
    agent, helper = two
    agent.page.locator(".panorama").focus()
    before = agent.page.get_by_text("steps left").inner_text()
    mark = agent.page.locator(".mark").first
    mark.focus()
    mark.press("Enter")  # by keyboard alone
    agent.sees("Your task")
    playwright.expect(agent.page.get_by_text("steps left")).not_to_have_text(before)
    agent.write("Ask in your own words", "Which door?", "Ask")
    helper.sees("Which door?")
    helper.page.get_by_label("Your answer").fill("The left one, ")
    helper.page.reload()
    playwright.expect(helper.page.get_by_label("Your answer")).to_have_value("The left one, ")
    helper.page.get_by_label("Your answer").press_sequentially("please")
    helper.page.locator(".plan .node").nth(5).click()
    helper.sees("The view you look at goes with your answer")
    server.kill()
    helper.press("Send answer")  # into the void; it is sent again
    helper.sees("nothing that you sent is lost")
    server.start()
    agent.sees("The left one, please")
    agent.page.reload()
    agent.sees("The left one, please")
    agent.press("I am there: stop here")
    for one in two:
        one.sees("Ready for the next one?")
    episode = list(load_lines(server.people / "episodes_val_seen_together.jsonl", Episode))[-1]
    replies = [s.reply for s in episode.steps if s.reply]
    assert [r.text for r in replies] == ["The left one, please"] and replies[0].image.node == 5


def test_whoever_sees_no_way_is_shown_where_ways_are_and_told_the_keys(two):
    agent, _ = two
    seen = """[...document.querySelectorAll('.mark span')].filter(mark => {
      const [m, s] = [mark, document.querySelector('.stage')].map(e => e.getBoundingClientRect());
      return m.left < s.right && m.right > s.left && m.top < s.bottom && m.bottom > s.top; }).length"""
    agent.sees("to look around")
    for _ in range(6):
        agent.page.keyboard.press("ArrowUp")  # nothing was clicked before
    assert agent.page.evaluate(seen) == 0
    agent.page.locator(".edge:visible").first.click()
    assert agent.page.evaluate(seen) > 0


def test_what_people_write_never_becomes_markup(two, server):
    agent, helper = two
    evil = '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>'
    agent.write("Ask in your own words", evil, "Ask")
    helper.sees(evil)
    helper.write("Your answer", evil, "Send answer")
    agent.sees("You were told")
    agent.page.wait_for_timeout(200)
    for one in two:
        assert one.page.evaluate("window.hacked") is None
        assert one.page.locator("img[src=x], main script").count() == 0


def test_on_a_slow_phone_everything_fits_and_works(browser, server):
    slow = {"offline": False, "latency": 300, "downloadThroughput": 60_000, "uploadThroughput": 30_000}
    phones = [
        Someone(browser, server, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
        for _ in range(2)
    ]
    agent, helper = phones
    for phone in phones:
        phone.context.new_cdp_session(phone.page).send("Network.emulateNetworkConditions", slow)
        phone.sees("Stop taking part")
    agent.sees("Your task")
    agent.sees("Tap a ring on the floor")
    assert agent.page.evaluate("document.documentElement.scrollWidth") <= 390
    agent.write("Ask in your own words", "Where?", "Ask")
    helper.sees("The agent asks you something.")
    assert helper.page.evaluate("document.documentElement.scrollWidth") <= 390
    helper.write("Your answer", "There.", "Send answer")
    agent.sees("There.")
    small = "[...document.querySelectorAll('main button.primary')].filter(b => b.getBoundingClientRect().height < 40)"
    assert agent.page.evaluate(small + ".length") == 0
    agent.press("I am there: stop here")
    agent.sees("Ready for the next one?")
    for phone in phones:
        phone.close()


def test_a_judge_watches_to_the_end_then_gives_stars_and_words(browser, server):
    folder, tasks = server.study.parent, server.tasks[:1]
    worlds = {tasks[0].world: server.data.place(tasks[0].world)}
    save_lines(folder / "episodes.jsonl", play(lambda: HelpEnv(worlds), Forward10(), tasks, seed=0))
    judged = "".join(
        f'[[parts]]\nname = "{kind}"\nkind = "{kind}"\nepisodes = "episodes.jsonl"\n' for kind in ("rate", "describe")
    )
    other = Served(write_study(folder, judged, name="judged"))
    judge, seen = Someone(browser, other), browser.new_page()
    judge.sees("How well did the agent do")
    send = judge.page.get_by_role("button", name="Send", exact=True)
    judge.page.get_by_label("4 of 5 stars").check()
    assert send.is_disabled(), "the end was not seen yet"
    judge.page.get_by_label("Step").press("End")
    send.click()
    judge.press("Go on")
    judge.sees("What should one say")
    judge.page.get_by_label("Step").press("End")
    judge.page.get_by_label("Your description").fill("Go on and on.")
    send.click()
    judge.press("Go on")
    judge.sees("You have finished")
    assert re.fullmatch("[0-9A-F]{8}", judge.page.locator(".code").inner_text())
    seen.goto(other.links["results"][0])
    playwright.expect(seen.get_by_text("stars, mean")).to_be_visible()
    playwright.expect(seen.get_by_role("row", name="joined")).to_have_text("joined1")
    seen.close()
    judge.close()
    other.stop()
    told = list(load_lines(other.people / "judgements.jsonl", Judgement))
    assert [(t.stars, t.text) for t in told] == [(4, ""), (None, "Go on and on.")]


NO_WEBGL = """{ const get = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, how) {
    return kind === "webgl2" ? null : get.call(this, kind, how);
  }; }"""


@pytest.mark.parametrize("without_webgl", [False, True])
def test_the_page_shows_what_the_panorama_shows(two, server, without_webgl):
    """Against Panorama.view_rgb: nothing is mirrored, turned or stretched, with WebGL and without."""
    agent, _ = two
    if without_webgl:
        agent.context.add_init_script(NO_WEBGL)
        agent.page.reload()
        agent.sees("Your task")
    agent.page.evaluate(
        "document.querySelectorAll('.marks, .edge, .panorama ~ *').forEach(e => { e.style.display = 'none' })"
    )
    view = agent.page.locator(".panorama")
    view.focus()
    for key in ("ArrowLeft", "ArrowLeft", "ArrowUp", "ArrowUp", "ArrowUp"):
        view.press(key)
    agent.page.locator(".panorama:not([aria-busy])").wait_for()
    agent.page.wait_for_timeout(400)
    shown = cv2.imdecode(np.frombuffer(view.screenshot(), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    start = next(t.start for t in server.tasks if t.id == server.begun()[-1]["task"])
    height, width = shown.shape[:2]
    vfov = 2 * math.atan(math.tan(math.radians(40)) * height / max(width, height))
    yaw, pitch = start.yaw + math.radians(30), -0.12 + math.radians(45)
    true = gradient(start.node).view_rgb(yaw, pitch, vfov, (height, width))
    error = np.abs(shown.astype(int) - true)[20:-20, 20:-20]
    assert np.median(error) < 6 and np.mean(error > 40) < 0.03


def house_that_opens(seed, name, config, catalogue):
    """Two rooms with a fridge, drawers and a wardrobe."""
    house = dataclasses.replace(HOUSE, name=name)
    return house, build_graph(house)


def test_furniture_is_opened_by_a_key_closed_by_a_button_and_seen_open(browser, tmp_path):
    make_data(tmp_path, "stored", house_that_opens)
    part = '[[parts]]\nname = "alone"\ntasks = 1\nper_person = 1\nassistant = "none"\nsplit = "test_unseen"\n'
    served = Served(write_study(tmp_path, part))
    try:
        one = Someone(browser, served)
        fetched, doors = set(), one.page.get_by_role("group", name="Doors").get_by_role("button")
        one.page.on("response", lambda r: fetched.add((r.status, r.url.split("/")[-2])) if "/pano/" in r.url else None)
        one.sees("steps left")
        for _ in range(4):  # until something is within reach
            if doors.count():
                break
            one.page.keyboard.press("Enter")
            one.page.wait_for_timeout(3000)
        known = {name for _, name in fetched}
        what = re.match("Open the (.*?),", doors.first.inner_text())[1]
        with one.page.expect_response(lambda r: "/pano/" in r.url and r.url.split("/")[-2] not in known) as seen:
            one.page.keyboard.press("o")
        assert seen.value.status == 200
        one.sees(f"Close the {what}")
        one.page.get_by_role("button", name=f"Close the {what}").first.click()
        playwright.expect(one.page.get_by_role("button", name=f"Close the {what}")).to_have_count(0, timeout=600_000)
        one.close()
    finally:
        served.stop()


def steered(place, start):
    """Keys that lead from a viewpoint through the door."""
    body = BrowserBody(place, start, NavMeshCache())
    for x in (4.2, 5.8) if body.position[0] < 5 else (5.8, 4.2):
        while math.dist(body.position, (x, 1.05)) > 0.3:
            off = wrap(math.atan2(1.05 - body.position[1], x - body.position[0]) - body.yaw)
            action = 0 if abs(off) < 0.2 else 1 if off > 0 else 2
            body.act(action)
            yield "wad"[action]


def test_both_sides_see_who_is_steered_through_a_door_through_a_reload_and_a_dead_server(browser, tmp_path):
    data = built(tmp_path / "data", "vnla", make_house=house_that_opens)
    steers = PARTS + 'split = "val_unseen"\nmoves = "drive"\nfigure = "anna"\n'
    served, shown = Served(write_study(tmp_path, steers, HEAD + 'pictures = "fast-matte"\n')), []
    try:
        agent, helper = pair(browser, served)
        task = next(t for t in data.tasks("val_unseen") if t.id == served.begun()[-1]["task"])
        place, (live, theirs) = data.place(task.world), (one.page.locator("img.live") for one in (agent, helper))
        for k, key in enumerate(steered(place, task.start)):
            before, see = live.get_attribute("src"), {"name": "src", "timeout": 600_000}
            if k == 4:
                agent.page.reload()
                playwright.expect(live).to_have_attribute(value=before, **see)
            if k == 8:
                picture = fetched(before)
                served.kill()
                served.start()
                assert np.abs(fetched(before) - picture).mean() < 1, "where she was is in the log"
            agent.page.keyboard.press(key)
            playwright.expect(live).not_to_have_attribute(value=before, **see)
            shown.append(live.get_attribute("src"))
            playwright.expect(theirs).to_have_attribute(value=shown[-1], **see)
            blue, _, red = fetched(shown[-1])[40:200, 80:240].transpose(2, 0, 1)
            assert np.mean((blue > red + 12) & (blue < 110)) > 0.01, "her jumper is navy"
        agent.press("I am there: stop here")
        helper.sees("Ready for the next one?")
        agent.close(), helper.close()
    finally:
        served.stop()
    (episode,) = load_lines(served.people / "episodes_val_unseen_together.jsonl", Episode)
    rooms = {place.graph.room_of_node[p.node] for p in (task.start, episode.steps[-1].next_pose)}
    assert len(rooms) == 2 and len(shown) > 12


def fetched(address):
    """A picture, BGR."""
    return cv2.imdecode(np.frombuffer(urllib.request.urlopen(address).read(), np.uint8), 1).astype(int)
