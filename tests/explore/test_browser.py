"""The explorer's page in Debian's chromium: its numbers are the library's, and it is quick."""

from __future__ import annotations

import json
import random
import re
import shutil
import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import fastmech as fm

pytest.importorskip("starlette", reason="the extra explore is not installed")
driver = pytest.importorskip("playwright.sync_api", reason="no Playwright: make test-browser")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium: make test-browser needs it")

FLAGS = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
FLAGS += ["--disable-component-update", "--disable-sync"]


class Opened:
    """A page, what it asked of the network and what its console said."""

    def __init__(self, page: Any, address: str) -> None:
        self.page, self.address, self.asked, self.said = page, address, list[str](), list[str]()
        page.on("request", lambda request: self.asked.append(request.url))
        page.on("console", lambda line: self.said.append(line.text))
        page.on("pageerror", lambda error: self.said.append(str(error)))
        page.goto(address)
        page.wait_for_selector("#equilibria td", timeout=120_000)

    def until(self, what: str, seconds: float = 120.0) -> None:
        """Wait: the page's policy forbids Playwright's own waiting, which evaluates text."""
        end = time.monotonic() + seconds
        while not self.page.evaluate(what):
            assert time.monotonic() < end, (what, self.page.inner_text("#error"))
            self.page.wait_for_timeout(30)

    def settle(self) -> None:
        self.until("document.querySelector('#basins canvas').dataset.divisions === '400'")
        self.until("document.querySelector('#atlas canvas').dataset.divisions === '80'")
        self.page.wait_for_timeout(1500)

    def press(self, where: str, x: float, y: float) -> None:
        box = self.page.locator(f"{where} canvas").first.bounding_box()
        self.page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


@pytest.fixture(scope="module")
def opened() -> Iterator[Opened]:
    command = [sys.executable, "-m", "fastmech", "explore", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    found = re.search(r"http\S+", process.stdout.readline())
    assert found is not None
    with driver.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        made = Opened(browser.new_page(viewport={"width": 1600, "height": 1000}), found[0])
        made.settle()
        yield made
        browser.close()
    process.send_signal(signal.SIGINT)
    process.wait(10)
    process.stdout.close()


def positions(opened: Opened) -> list[list[float]]:
    cells = "[...document.querySelectorAll('#equilibria tbody tr')]"
    return opened.page.evaluate(f"{cells}.map(r => [1, 2].map(k => Number(r.children[k].textContent)))")


def test_the_table_follows_a_slider_and_the_library(opened: Opened) -> None:
    slider = opened.page.get_by_label(re.compile("^c2: .*N/m.$")).first
    slider.evaluate("e => { e.value = 200; e.dispatchEvent(new Event('input')); }")
    value = opened.page.evaluate("explorer.state.parameters.c2")
    opened.page.wait_for_timeout(1500)
    found = fm.find_equilibria(fm.Scene(c2=value))
    np.testing.assert_allclose(positions(opened), found.position, atol=1e-6)
    assert "proved" in opened.page.inner_text("#landscape .note")


def test_a_typed_number_counts_and_a_wrong_one_gives_a_line(opened: Opened) -> None:
    number = opened.page.get_by_label(re.compile("^m1: .*value$"))
    number.fill("-3")
    number.press("Enter")
    opened.until("document.querySelector('#error').textContent.includes('scene.m1 = -3')", 10)
    number.fill("9")
    number.press("Enter")
    opened.until("document.querySelector('#error').textContent === ''", 20)
    opened.page.get_by_text("reset all").click()
    opened.until("explorer.state.parameters.m1 === 10 && explorer.state.parameters.c2 === 366.67", 10)


def test_a_press_on_the_map_starts_the_motion_of_its_lines(opened: Opened) -> None:
    opened.press("#basins", 0.7, 0.3)
    opened.until("explorer.motion && explorer.histories.header && explorer.mechanism.playing", 30)
    start = opened.page.evaluate("explorer.state.start")
    last = opened.page.evaluate("Array.from(explorer.motion.data.slice(-4))")
    y0 = [[start.get(name, 0.0) for name in ("phi", "theta", "phi_dot", "theta_dot")]]
    run = fm.integrate(fm.Scene(), y0, 20.0, dt=0.01, method="dop853")
    np.testing.assert_allclose(last, run.y[-1, 0], atol=1e-6)


def test_a_reload_restores_the_state(opened: Opened) -> None:
    opened.page.wait_for_timeout(400)
    before = opened.page.evaluate("JSON.stringify(explorer.state)")
    opened.page.reload()
    opened.page.wait_for_selector("#equilibria td")
    assert json.loads(before) == opened.page.evaluate("explorer.state")


def test_budgets(opened: Opened) -> None:
    opened.settle()
    opened.page.evaluate("explorer.choose(0); explorer.waits.equilibria = []")
    for k in range(40):
        opened.page.evaluate(f"explorer.parameters.set('c1', {150 + k})")
        opened.page.wait_for_timeout(110)
    slider = statistics.median(opened.page.evaluate("explorer.waits.equilibria"))
    opened.page.wait_for_timeout(6000)
    opened.page.evaluate("explorer.basins.levels = {}; explorer.askBasins()")
    opened.until("explorer.basins.levels[401] !== undefined", 30)
    levels = opened.page.evaluate("explorer.basins.levels")
    opened.page.evaluate("explorer.startAt({phi: 0.5, theta: 1}); explorer.letGo()")
    opened.until("explorer.mechanism.playing", 10)
    opened.page.wait_for_timeout(500)
    opened.page.evaluate("explorer.mechanism.frames = []")
    opened.page.wait_for_timeout(5000)
    shown = np.diff(opened.page.evaluate("explorer.mechanism.frames"))
    print(
        f"\nslider to picture {slider:.0f} ms (median); basins 101 x 101 {levels['101']:.0f} ms,"
        f" 401 x 401 {levels['401']:.0f} ms; {1e3 / shown.mean():.0f} pictures a second,"
        f" longest pause {shown.max():.0f} ms"
    )
    assert slider < 500.0
    assert levels["401"] < 15_000.0
    assert shown.max() < 1000.0


def test_random_actions_leave_no_error_and_no_request_leaves_the_machine(opened: Opened) -> None:
    random_ = random.Random(2)
    views = ["#landscape", "#basins", "#atlas", "#mechanism"]
    names = list(opened.page.evaluate("explorer.state.parameters"))
    for _ in range(200):
        match random_.randrange(5):
            case 0:
                opened.press(random_.choice(views), random_.uniform(0.2, 0.9), random_.uniform(0.1, 0.8))
            case 1:
                name, share = random_.choice(names), random_.uniform(0.2, 1.0)
                opened.page.evaluate(
                    f"{{ const a = explorer.about.parameters['{name}'];"
                    f" explorer.parameters.set('{name}', a.low + {share} * (a.high - a.low)); }}"
                )
            case 2:
                opened.page.keyboard.press(random_.choice(["Tab", "ArrowLeft", "ArrowUp", "Space"]))
            case 3:
                opened.page.evaluate(f"explorer.choose({random_.randrange(4)} % explorer.rows.length)")
            case 4:
                select = opened.page.locator("select[aria-label*=axis]").nth(random_.randrange(6))
                change = "e.dispatchEvent(new Event('change'))"
                select.evaluate(f"e => {{ e.selectedIndex = {random_.randrange(4)}; {change}; }}")
        opened.page.wait_for_timeout(10)
    opened.page.wait_for_timeout(1000)
    assert opened.said == []
    assert all(url.startswith((opened.address, "data:", "blob:")) for url in opened.asked)
