"""The explorer's page in Debian's chromium: its numbers are the library's, and it is quick.

Times are told in a table beside what is wanted on two processors that are idle; what fails is only what no
loaded machine explains.
"""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import statistics
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fastmech as fm
from fastmech.cli.run import mechanism_named
from fastmech.runner import run_request
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import read_request

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
        """Wait until all is answered, the last change too."""
        self.page.wait_for_timeout(300)  # what is asked for when a slider rests has been asked for
        for view, divisions in (("basins", 400), ("atlas", 80)):
            self.until(f"document.querySelector('#{view} canvas').dataset.divisions === '{divisions}'")
        self.until("explorer.talk.pending.size === 0")
        self.until("document.querySelector('#status').textContent === 'ready'", 5)

    def press(self, where: str, x: float, y: float) -> None:
        self.page.locator(f"{where} canvas").first.scroll_into_view_if_needed()
        box = self.page.locator(f"{where} canvas").first.bounding_box()
        self.page.mouse.click(box["x"] + x * box["width"], box["y"] + y * box["height"])


@contextmanager
def serving(*what: str) -> Iterator[str]:
    """The command's page, ended by Ctrl-C."""
    command = [sys.executable, "-m", "fastmech", "explore", "--no-browser", *what]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    found = re.search(r"http\S+", process.stdout.readline())
    assert found is not None
    try:
        yield found[0]
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(10)
        process.stdout.close()


@contextmanager
def page_of(browser: Any, *what: str) -> Iterator[Opened]:
    """A page of the command's own, closed before the server ends."""
    with serving(*what) as address:
        page = browser.new_page(viewport={"width": 1600, "height": 1000})
        yield Opened(page, address)
        page.close()


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with driver.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def opened(browser: Any) -> Iterator[Opened]:
    with serving() as address:
        context = browser.new_context(viewport={"width": 1600, "height": 1000})
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        made = Opened(context.new_page(), address)
        made.settle()
        yield made
        context.close()


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
    dt = opened.page.evaluate("explorer.histories.header.dt")
    run = fm.integrate(fm.Scene(), y0, 20.0, dt=dt, method="dop853")
    np.testing.assert_allclose(last, run.y[-1, 0], atol=1e-6)


def test_a_reload_restores_the_state(opened: Opened) -> None:
    page = opened.page
    page.get_by_label("coordinate of the phase portrait").select_option("theta")
    page.locator("#mechanism button", has_text="pause").click()
    page.get_by_label("time", exact=True).press("PageUp")
    page.get_by_label("speed", exact=True).select_option("0.25")
    page.wait_for_timeout(400)
    before = json.loads(page.evaluate("JSON.stringify(explorer.state)"))
    assert before["portrait"] == "theta"
    assert before["frame"] > 0
    assert before["speed"] == 0.25
    page.reload()
    opened.until("globalThis.explorer?.histories?.header", 30)
    assert before == page.evaluate("explorer.state")
    assert page.evaluate("[explorer.frame, explorer.mechanism.frame]") == [before["frame"]] * 2
    assert page.get_by_role("timer").inner_text() == f"{before['frame'] / 60.0:.2f} s"
    assert page.get_by_label("coordinate of the phase portrait").input_value() == "theta"
    assert page.get_by_label("speed", exact=True).input_value() == "0.25"
    page.get_by_label("speed", exact=True).select_option("1")
    assert page.evaluate("explorer.histories.views[3].labels[0]") == "theta [rad]"
    page.get_by_label("coordinate of the phase portrait").select_option("phi")


def test_the_atlas_s_point_is_dragged_and_the_table_follows(opened: Opened) -> None:
    opened.page.locator("#atlas canvas").scroll_into_view_if_needed()
    box = opened.page.locator("#atlas canvas").bounding_box()
    x, y = box["x"] + 0.6 * box["width"], box["y"] + 0.5 * box["height"]
    opened.page.mouse.move(x, y)
    opened.page.mouse.down()
    opened.page.mouse.move(x + 40, y + 60, steps=4)
    opened.page.mouse.up()
    opened.page.wait_for_timeout(1000)
    parameters = opened.page.evaluate("explorer.state.parameters")
    assert parameters["F0"] != 100.0
    assert parameters["c2"] != 366.67
    np.testing.assert_allclose(
        positions(opened), fm.find_equilibria(fm.Scene(**parameters)).position, atol=1e-6
    )
    opened.page.get_by_text("reset all").click()


def of_point(opened: Opened, name: str) -> tuple[float, float]:
    """Where a point of the drawing is on the screen."""
    told = opened.page.evaluate(
        f"(() => {{ const m = explorer.mechanism, s = m.shown(), p = s.at[s.names.indexOf('{name}')][0],"
        " r = m.plane.canvas.getBoundingClientRect();"
        " return [r.left + m.plane.x(p[0]), r.top + m.plane.y(p[1])]; })()"
    )
    return float(told[0]), float(told[1])


def test_a_mass_is_dragged_to_a_start(opened: Opened) -> None:
    opened.page.evaluate("explorer.choose(0)")
    opened.page.wait_for_timeout(300)
    opened.page.locator("#mechanism canvas").scroll_into_view_if_needed()
    x, y = of_point(opened, "M1")
    opened.page.mouse.move(x, y)
    opened.page.mouse.down()
    opened.page.mouse.move(x + 40, y + 30, steps=5)
    opened.page.wait_for_timeout(500)
    there = of_point(opened, "M1")
    opened.page.mouse.up()
    opened.until("explorer.mechanism.playing", 20)
    start = opened.page.evaluate("explorer.state.start")
    # M1 moves on a circle about O: the nearest place lies towards the pointer.
    o = of_point(opened, "O")
    expected = np.arctan2(o[1] - y - 30, x + 40 - o[0])
    assert start["phi"] == pytest.approx(expected, abs=0.05)
    assert np.arctan2(o[1] - there[1], there[0] - o[0]) == pytest.approx(expected, abs=0.05)


def test_a_kick_tells_speed_and_energy(opened: Opened) -> None:
    opened.page.evaluate("explorer.choose(0)")
    opened.page.wait_for_timeout(300)
    opened.page.locator("#mechanism canvas").scroll_into_view_if_needed()
    x, y = of_point(opened, "M2")
    opened.page.keyboard.down("Shift")
    opened.page.mouse.move(x, y)
    opened.page.mouse.down()
    opened.page.mouse.move(x + 50, y - 20, steps=4)
    opened.until("explorer.mechanism.struck?.words.includes(' J')", 20)
    words = opened.page.evaluate("explorer.mechanism.struck.words")
    scale = opened.page.evaluate("explorer.mechanism.plane.x(1) - explorer.mechanism.plane.x(0)")
    opened.page.mouse.up()
    opened.page.keyboard.up("Shift")
    opened.until("explorer.mechanism.playing", 20)
    start = opened.page.evaluate("explorer.state.start")
    state = [[start[name] for name in ("phi", "theta", "phi_dot", "theta_dot")]]
    energy = float(fm.mechanisms.slider_pendulum().energies(state).kinetic[0])
    speed, told = map(float, re.findall(r"[\d.]+", words))
    assert told == pytest.approx(energy, rel=1e-2)
    assert speed == pytest.approx(4.0 * np.hypot(50, 20) / scale, rel=0.1)


def test_the_keyboard_reaches_and_works_everything(opened: Opened) -> None:
    page = opened.page
    page.evaluate("explorer.choose(0); document.activeElement.blur()")
    every = "button, select, input, canvas, summary"
    count = page.evaluate(f"document.querySelectorAll('{every}').length")
    seen = "(e => { e.seen = true; return e === document.body || getComputedStyle(e).outlineStyle; })"
    for _ in range(count + 3):  # it may begin at the end
        page.keyboard.press("Tab")
        assert page.evaluate(f"{seen}(document.activeElement)") != "none"
    unseen = f"[...document.querySelectorAll('{every}')].filter(e => !e.seen && !e.disabled)"
    assert page.evaluate(f"{unseen}.map(e => e.outerHTML.slice(0, 80))") == []
    for view, value in [
        ("#landscape canvas", "explorer.state.start"),
        ("#basins canvas", "explorer.state.start"),
        ("#mechanism canvas", "explorer.state.start"),
        ("#atlas canvas", "explorer.state.parameters.F0"),
        ("#parameters input[type=range]", "explorer.state.parameters.m1"),
    ]:
        before = page.evaluate(f"JSON.stringify({value} ?? null)")
        page.locator(view).first.focus()
        page.keyboard.press("ArrowRight")
        opened.until(f"JSON.stringify({value} ?? null) !== {before!r}", 20)
    page.evaluate("explorer.choose(0)")
    page.get_by_label("velocity of the kick upwards [m/s]").fill("")
    page.get_by_text("kick [m/s]").press("Enter")
    assert "needs both velocities" in page.inner_text("#mechanism")
    assert page.evaluate("explorer.state.start") is None
    page.get_by_label("velocity of the kick upwards [m/s]").fill("1e12")
    page.get_by_text("kick [m/s]").press("Enter")
    opened.until("explorer.mechanism.kick.textContent.includes('strike.velocity')", 20)
    page.get_by_label("velocity of the kick upwards [m/s]").fill("0.5")
    page.get_by_text("kick [m/s]").press("Enter")
    opened.until("explorer.state.start?.theta_dot && explorer.mechanism.playing", 20)
    page.get_by_text("reset all").click()


def test_screen_readers_find_a_name_of_everything(opened: Opened) -> None:
    session = opened.page.context.new_cdp_session(opened.page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    roles = {"button", "slider", "spinbutton", "combobox", "img", "image", "region", "DisclosureTriangle"}
    told = [(n["role"]["value"], n.get("name", {}).get("value", "")) for n in nodes if not n["ignored"]]
    named = [(role, name) for role, name in told if role in roles]
    assert len(named) > 60
    assert [role for role, name in named if not name.strip()] == []
    buttons = [name for role, name in named if role == "button"]
    assert len(buttons) == len(set(buttons))  # none is called as another


def test_pictures_requests_and_python_are_taken_along(opened: Opened, tmp_path: Path) -> None:
    page = opened.page
    opened.press("#landscape", 0.6, 0.4)
    opened.until("explorer.mechanism.playing", 30)
    opened.settle()  # lines follow a map that is refined
    for view in ("mechanism", "landscape", "basins", "atlas", "motion", "energies", "portrait"):
        for form in ("PNG", "SVG"):
            with page.expect_download() as got:
                page.locator(f"#{view} button", has_text=form).click()
            path = tmp_path / f"{view}.{form.lower()}"
            assert got.value.suggested_filename == path.name  # all canvases of a view in one picture
            got.value.save_as(path)
            if form == "PNG":
                assert path.read_bytes().startswith(b"\x89PNG")
            else:
                marks = [e.tag.rpartition("}")[2] for e in ElementTree.parse(path).getroot().iter()]
                assert marks.count("path") > 10
                assert "text" in marks
        with page.expect_download() as got:
            page.locator(f"#{view} button", has_text="save request").click()
        got.value.save_as(tmp_path / f"{view}.toml")
        page.locator(f"#{view} button", has_text="copy Python").click()
        page.wait_for_timeout(350)  # chromium drops what a page saves beyond ten files a second
        lines = page.evaluate("navigator.clipboard.readText()")
        assert lines == page.evaluate(f"document.querySelector('#{view} pre').textContent")


def lines_of(
    opened: Opened, view: str, folder: Path, monkeypatch: pytest.MonkeyPatch, own: Any = None
) -> dict[str, Any]:
    """What the Python lines of a view leave, and its request, if it is valid."""
    import matplotlib.pyplot as plt

    python, request = opened.page.locator(f"#{view} pre").all_text_contents()
    monkeypatch.chdir(folder)
    names: dict[str, Any] = {}
    with redirect_stdout(StringIO()):
        exec(python, names)
    plt.close("all")
    assert len(read_request("request.toml", scan_kinds(), request, own).scans) == 1
    return names | {"request": request}


def test_lines_of_every_view_make_what_it_shows(
    opened: Opened, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = opened.page
    page.evaluate("explorer.choose(3); explorer.parameters.set('c2', 200)")
    opened.until("explorer.mechanism.panel.python.includes('c2=200.0')", 30)
    rest = lines_of(opened, "mechanism", tmp_path, monkeypatch)
    assert (tmp_path / "mechanism.png").stat().st_size > 5000
    np.testing.assert_allclose(positions(opened), rest["found"].position, atol=1e-6)
    page.evaluate("explorer.change({ t_end: 1 }, 't_end'); explorer.startAt({ phi: 1, theta_dot: -2 })")
    opened.until("explorer.motion && explorer.mechanism.panel.python.includes('animate')", 30)
    opened.settle()
    shown = np.float32(page.evaluate("Array.from(explorer.motion.data)"))
    for view in ("mechanism", "motion", "energies", "portrait"):
        found = lines_of(opened, view, tmp_path, monkeypatch)
        per = page.evaluate("explorer.per") if view == "mechanism" else 1  # moments alone
        expected = shown.reshape(-1, 4)[::per]
        np.testing.assert_array_equal(np.float32(found["run"].y[:, 0]), expected)
        if view == "energies":
            for name in ("kinetic", "potential", "brought", "lost"):
                drawn = page.evaluate(f"Array.from(explorer.histories.arrays.{name}.data)")
                np.testing.assert_array_equal(np.float32(drawn), np.float32(found[name]))
    assert all((tmp_path / f"{v}.png").is_file() for v in ("motion", "energies", "portrait"))
    assert (tmp_path / "motion.gif").is_file()
    (tmp_path / "motion.toml").write_text(found["request"], encoding="utf-8")
    run_request(tmp_path / "motion.toml", tmp_path / "motion.h5")
    with fm.open_results(tmp_path / "motion.h5") as results:
        computed = np.stack([results["swing"][name].data for name in ("phi", "theta")], axis=-1)
    np.testing.assert_array_equal(np.float32(computed), shown.reshape(-1, 4)[:, :2])
    found = lines_of(opened, "landscape", tmp_path, monkeypatch)
    low, high = page.evaluate("explorer.landscape.span")
    assert float(found["heights"].min()) == pytest.approx(low, rel=1e-6)
    assert float(found["heights"].max()) == pytest.approx(high, rel=1e-6)
    found = lines_of(opened, "basins", tmp_path, monkeypatch)
    wells = page.evaluate("Array.from(explorer.basins.grid.well)")
    np.testing.assert_array_equal(found["found"].well.ravel(), wells)
    assert (tmp_path / "basins.png").stat().st_size > 5000
    found = lines_of(opened, "atlas", tmp_path, monkeypatch)
    assert len(found["curves"].curves) == page.evaluate("explorer.atlas.curves.length") > 0
    assert found["found"].count.shape == (81, 81)
    page.get_by_text("reset all").click()
    page.evaluate("explorer.change({ t_end: 20 }, 't_end'); explorer.choose(0)")


@pytest.mark.parametrize("what", ["von_mises_truss", "pendulum_chain_3"])
@pytest.mark.slow
def test_a_mechanism_without_dampers_says_so_where_the_basins_would_be(
    browser: Any, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with page_of(browser, what) as made:
        made.until("document.querySelector('#basins .refusal').textContent.includes('has no dampers')", 60)
        assert made.page.inner_text("#error") == ""
        assert made.page.locator("#basins button", has_text="copy Python").is_disabled()
        made.until("document.querySelector('#atlas canvas').dataset.divisions", 60)
        made.page.evaluate("explorer.change({ t_end: 0.5 }, 't_end')")
        made.page.evaluate("explorer.startAt({ [explorer.about.coordinates[0]]: 0.3 })")
        made.until("explorer.motion", 60)
        views = ["equilibria", "mechanism", "landscape", "motion", "energies", "portrait"]
        names = {}
        for view in [*views, *(["atlas"] if what == "von_mises_truss" else [])]:
            names[view] = lines_of(made, view, tmp_path, monkeypatch)
        if what == "von_mises_truss":
            shallow_wells_have_lines_between_them(made, names["landscape"]["levels"])
        if what == "pendulum_chain_3":
            assert "q3 = 0 rad" in made.page.inner_text("#landscape .note")
            elsewhere = made.page.evaluate("explorer.rows.filter(r => !explorer.landscape.within(r)).length")
            assert elsewhere == sum(abs(np.sin(r[2] / 2)) > 1e-6 for r in fm.find_equilibria(
                fm.mechanisms.pendulum_chain(3)).position)  # fmt: skip
        assert made.said == []


def test_an_atlas_over_a_mass_begins_above_zero(opened: Opened) -> None:
    select = opened.page.get_by_label("Atlas of parameters, horizontal axis")
    select.select_option("m1")
    opened.until("explorer.atlas.current && explorer.atlas.shown.m1[0] > 0", 60)
    assert opened.page.inner_text("#atlas .refusal") == ""
    # Axes are those that are chosen even where nothing can be answered.
    opened.page.evaluate("explorer.change({ atlas: ['alpha', 'c2'] }, 'atlas')")
    opened.until("document.querySelector('#atlas .refusal').textContent.includes('alpha')", 60)
    assert opened.page.evaluate("explorer.atlas.plane.labels") == ["alpha [1/s]", "c2 [N/m]"]
    assert not opened.page.evaluate("explorer.atlas.current")
    opened.page.evaluate("explorer.change({ atlas: ['m1', 'c2'] }, 'atlas')")
    # What is typed beyond the range widens slider and atlas.
    number = opened.page.get_by_label(re.compile("^m1: .*value$"))
    number.fill("70")
    number.press("Enter")
    opened.until("explorer.atlas.shown.m1[1] === 70", 60)
    # Back at the first values the first ranges are there again.
    opened.page.get_by_text("reset all").click()
    opened.until("explorer.atlas.shown.m1[1] === 30", 60)
    slider = opened.page.get_by_label(re.compile("^m1: .*]$"))
    number.fill("100000")
    number.press("Enter")
    opened.until("explorer.about.parameters.m1.high === 100000", 60)
    opened.page.get_by_label("reset m1 to 10").click()
    opened.page.wait_for_timeout(600)
    assert [slider.get_attribute(end) for end in ("min", "max")] == ["0.3", "30"]
    select.select_option("F0")
    opened.settle()


def test_what_was_chosen_last_counts(opened: Opened) -> None:
    page = opened.page
    page.evaluate("explorer.change({ t_end: 300 }, 't_end'); explorer.startAt({ phi: 0.5, theta: 1 })")
    page.wait_for_timeout(20)
    page.evaluate("explorer.choose(1)")
    page.wait_for_timeout(4000)
    assert page.evaluate("[explorer.state.start, explorer.motion, explorer.mechanism.motion]") == [None] * 3
    assert page.get_by_role("timer").inner_text() == ""
    assert "Press on" in page.inner_text("#motion .note")
    # A link that is opened in the open page is all that counts.
    page.evaluate("explorer.startAt({ phi: 0.5, theta: 1 })")
    opened.until("explorer.motion", 60)
    link = "encodeURIComponent(JSON.stringify({ ...explorer.state, start: null, t_end: 7 }))"
    page.evaluate(f"location.hash = '#' + {link}")
    opened.until("explorer.state.start === null && explorer.motion === null", 10)
    assert page.get_by_label("length of the motion [s]").input_value() == "7"
    page.evaluate("explorer.change({ t_end: 20 }, 't_end'); explorer.choose(0)")


def test_paused_views_show_one_moment_and_a_kick_adds_to_what_moves(opened: Opened) -> None:
    page = opened.page
    page.evaluate("explorer.startAt({ phi: 0.5, theta: 1 }); explorer.letGo()")
    opened.until("explorer.mechanism.playing && explorer.mechanism.frame > 20", 30)
    page.evaluate(
        "{ const l = explorer.landscape.plane, m = explorer.mechanism.plane, a = l.over, b = m.over;"
        " l.over = (p) => { globalThis.there = explorer.frame; a(p); };"
        " m.over = (p) => { globalThis.here = explorer.mechanism.frame; b(p); }; }"
    )
    for _ in range(4):
        page.locator("#mechanism button", has_text="pause").click()
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_timeout(300)
        here, there = page.evaluate("[globalThis.here, globalThis.there]")
        assert here == there
        page.locator("#mechanism button", has_text="play").click()
        page.wait_for_timeout(150)
    page.locator("#mechanism button", has_text="pause").click()
    before = page.evaluate("[...explorer.mechanism.position(), ...explorer.mechanism.rates()]")
    page.get_by_label("velocity of the kick upwards [m/s]").fill("0.5")
    page.get_by_text("kick [m/s]").click()
    opened.until("explorer.state.start.phi !== 0.5 && explorer.mechanism.playing", 20)
    start = page.evaluate("explorer.state.start")
    point, mechanism = page.evaluate("explorer.mechanism.points.value"), fm.mechanisms.slider_pendulum()
    mass = mechanism.parameters["m2" if point == "M2" else "m1"]
    blow = mechanism.moved(point, before[:2]).T @ (mass * np.array([1.0, 0.5]))
    expected = np.array(before[2:]) + np.linalg.solve(mechanism.metric(before[:2]), blow)
    np.testing.assert_allclose([start["phi_dot"], start["theta_dot"]], expected, rtol=1e-5)
    page.evaluate("explorer.choose(0)")


def test_the_scrub_moves_a_paused_motion(opened: Opened) -> None:
    page = opened.page
    page.evaluate("explorer.startAt({ phi: 0.5, theta: 1 }); explorer.letGo()")
    opened.until("explorer.mechanism.playing && explorer.mechanism.frame > 5", 30)
    page.locator("#mechanism button", has_text="pause").click()
    scrub, timer = page.get_by_label("time", exact=True), page.get_by_role("timer")
    for key, frame, time_ in (("End", 1200, "20.00 s"), ("Home", 0, "0.00 s"), ("ArrowRight", 1, "0.02 s")):
        scrub.press(key)
        assert page.evaluate("explorer.frame") == frame
        assert timer.inner_text() == time_
    box = scrub.bounding_box()
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    assert page.evaluate("explorer.frame") == pytest.approx(600, abs=30)
    page.locator("#mechanism button", has_text="play").click()
    opened.until("explorer.mechanism.frame > 640", 10)  # and goes on from there
    page.evaluate("explorer.choose(0)")


def test_a_change_of_a_parameter_cancels_the_atlas(opened: Opened) -> None:
    page = opened.page
    page.evaluate(
        "{ globalThis.older = 0; const a = explorer.atlas, take = a.take.bind(a); a.take = (h, s) => {"
        " globalThis.older += h.asked.parameters.m1 !== explorer.state.parameters.m1; take(h, s); }; } null"
    )
    for axes in ("explorer.state.atlas", "['m2', 'c1']"):
        page.evaluate(f"explorer.change({{ atlas: {axes} }}, 'atlas')")
        for k in range(20):
            page.evaluate(f"explorer.parameters.set('m1', {10 + 0.1 * k})")
            assert not page.evaluate("explorer.talk.pending.has('atlas')")
            page.wait_for_timeout(30)
    opened.until("!explorer.talk.pending.has('atlas') && !explorer.uncounted", 60)
    # The dragged point stops it too, and it is counted again when the point rests.
    page.evaluate("explorer.askAtlas(); explorer.parameters.set('m2', 13)")
    assert not page.evaluate("explorer.talk.pending.has('atlas')")
    opened.until("document.querySelector('#atlas canvas').dataset.divisions === '80'", 60)
    assert page.evaluate("globalThis.older") == 0
    page.get_by_text("reset all").click()
    page.evaluate("explorer.change({ atlas: ['F0', 'c2'] }, 'atlas')")
    opened.settle()


def test_a_drag_within_the_last_level_of_the_basins_stops_them(opened: Opened) -> None:
    page = opened.page
    page.evaluate(
        "{ globalThis.late = 0, globalThis.before = null; const b = explorer.basins, take = b.take.bind(b);"
        " const pending = () => explorer.talk.pending.has('basins'), m1 = () => explorer.state.parameters.m1;"
        " b.take = (h, s) => { take(h, s); globalThis.late += h.asked.parameters.m1 !== m1();"
        " if (globalThis.before === null && h.divisions === 400 && !h.last) {"
        " globalThis.before = pending(); explorer.parameters.set('m1', 10.5); globalThis.after = pending();"
        " } }; explorer.askBasins(); } null"
    )
    opened.until("globalThis.before !== null", 60)
    assert page.evaluate("[globalThis.before, globalThis.after]") == [True, False]
    opened.until(
        "explorer.basins.panel.request.includes('m1 = 10.5') && !explorer.talk.pending.has('basins')"
    )
    assert page.evaluate("globalThis.late") == 0
    page.get_by_text("reset all").click()


@pytest.mark.slow
def test_slow_equilibria_follow_a_drag(browser: Any) -> None:
    with page_of(browser, "pendulum_chain_4") as made:
        made.page.wait_for_timeout(2000)
        made.page.evaluate("explorer.waits.answers = []")
        end, k = time.monotonic() + 6.0, 0
        while time.monotonic() < end:
            k += 1
            made.page.evaluate(f"explorer.parameters.set('g', {9 + 0.001 * k})")
            made.page.wait_for_timeout(16)
        count = made.page.evaluate("explorer.waits.answers.length")
        print(f"\npendulum_chain_4, dragged: {count / 6.0:.1f} answers a second, wanted 2")
        assert count >= 4
        # However late answers are, one comes in the end.
        asking = "explorer.resting.patience = explorer.resting.least = 1; explorer.parameters.set('g', 9.5)"
        made.page.evaluate(f"{asking}; explorer.parameters.set('g', 9.81)")
        made.until("explorer.landscape.panel.request.includes('g = 9.81')", 30)


def test_a_page_without_a_proved_equilibrium_says_so(
    browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with page_of(browser, "double_pendulum") as made:
        made.page.get_by_label(re.compile("^g: .*]$")).press("Home")
        made.until("document.querySelector('#landscape .note').textContent.includes('not decided')", 30)
        assert made.page.inner_text("#error") == ""
        assert made.page.inner_text("#equilibria tbody") == "No equilibrium is proved."
        assert made.page.locator(".stale").count() == 0
        for view in ("equilibria", "landscape", "mechanism"):
            lines_of(made, view, tmp_path, monkeypatch)
        assert made.said == []


def test_a_mechanism_without_a_potential_has_lines_and_an_atlas_that_names_its_curves(
    browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with page_of(browser, "ziegler_column") as made:
        found = lines_of(made, "landscape", tmp_path, monkeypatch)
        assert len(found["found"]) == made.page.locator("#equilibria tbody tr").count()
        assert (tmp_path / "landscape.png").is_file()
        made.until("explorer.atlas?.curves?.length > 0", 120)
        told = made.page.inner_text("#atlas .note")
        assert "Hopf" in told
        assert "equilibria appear" not in told
        assert made.page.evaluate("explorer.about.parameters.b.low") == 0
        # The legend stands below the picture.
        words = made.page.evaluate("explorer.atlas.plane.legend.map(one => one.words)")
        assert words == ["1 equilibrium, 0 stable", "1 equilibrium, 1 stable", "Hopf"]
        assert re.search(r"Of \d+ changes between neighbouring points 1 lie on no curve", told)
        height, bottom = made.page.evaluate(
            "[explorer.atlas.plane.size()[1], explorer.atlas.plane.box.bottom]"
        )
        assert height - bottom >= 40 + 20


def shallow_wells_have_lines_between_them(made: Opened, levels: list[float]) -> None:
    top = max(e.energy for e in fm.find_equilibria(fm.mechanisms.von_mises_truss()))
    assert made.page.evaluate("explorer.landscape.knee") == pytest.approx(top, rel=1e-6)
    assert f"lines every {top / 9:.3g}"[:15] in made.page.inner_text("#landscape .note")
    assert sum(level < top for level in levels) == 9
    energies = "[...document.querySelectorAll('#equilibria tbody tr')].map(r => r.children[3].textContent)"
    assert "e-" not in "".join(made.page.evaluate(energies))  # rounding is nothing


def test_a_page_whose_server_has_ended_says_so_and_cannot_be_moved(browser: Any) -> None:
    with serving() as address:
        made = Opened(browser.new_page(viewport={"width": 1600, "height": 1000}), address)
    made.until("document.querySelector('#error').textContent.includes('The server has ended')", 10)
    assert made.page.evaluate("[...document.querySelectorAll('section')].every(s => s.matches('.stale'))")
    slider = made.page.get_by_label(re.compile("^m1: .*]$"))
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    made.page.mouse.click(box["x"] + 0.9 * box["width"], box["y"] + 0.5 * box["height"])
    assert made.page.evaluate("explorer.state.parameters.m1") == 10.0
    made.page.close()


OVERLAPS = """(() => {
  const all = explorer.mechanism.labels.words, both = (a, b, k) => Math.min(a[k] + a[k + 2], b[k] + b[k + 2]) - Math.max(a[k], b[k]);
  return all.flatMap((a, i) => all.slice(0, i).filter((b) => both(a, b, 0) > 1 && both(a, b, 1) > 1)).length;
})()"""  # fmt: skip  # noqa: E501


def test_words_in_the_drawing_lie_beside_each_other(opened: Opened) -> None:
    page = opened.page
    for width in (1000, 1600):
        page.set_viewport_size({"width": width, "height": 1000})
        page.evaluate("explorer.startAt({ phi: 1, theta: 0.1 })")
        opened.until("explorer.mechanism.motion?.times.length === 1201", 30)
        page.locator("#mechanism canvas").scroll_into_view_if_needed()
        for frame in range(0, 300, 12):  # the force fades: 32.6 N at 1.6 s
            page.evaluate(f"explorer.mechanism.frame = {frame}; explorer.mechanism.moved()")
            page.wait_for_timeout(40)
            assert page.evaluate("explorer.mechanism.labels.words.length") >= 9
            assert page.evaluate(OVERLAPS) == 0, frame
        page.evaluate("explorer.choose(0)")
        page.wait_for_timeout(200)
        for way in (-30, 30):
            x, y = of_point(opened, "M2")
            page.keyboard.down("Shift")
            page.mouse.move(x, y)
            page.mouse.down()
            page.mouse.move(x + way, y - 20, steps=3)
            opened.until("explorer.mechanism.struck?.words.includes(' J')", 20)
            page.wait_for_timeout(100)
            assert page.evaluate(OVERLAPS) == 0, way
            page.mouse.up()
            page.keyboard.up("Shift")
            page.wait_for_timeout(300)
            page.evaluate("explorer.choose(0)")
            page.wait_for_timeout(200)
    page.set_viewport_size({"width": 1600, "height": 1000})


def test_arrows_are_whole_and_say_under_which_force_the_mechanism_rests(opened: Opened) -> None:
    page = opened.page
    within = (
        "(() => { const m = explorer.mechanism, of = m.shown(), { left, right, top, bottom } = m.plane.box;"
        " const [x, y] = m.push(of, of.which)[1], at = [m.plane.x(x), m.plane.y(y)];"
        " return at[0] > left + 8 && at[0] < right - 8 && at[1] > top + 8 && at[1] < bottom - 8; })()"
    )
    page.evaluate("explorer.choose(0)")
    for force in (-300, -150, 300):
        page.evaluate(f"explorer.parameters.set('F0', {force})")
        opened.until(
            f"explorer.mechanism.resting.forces.data[0] === {force} && !explorer.mechanism.plane.due"
        )
        page.wait_for_timeout(50)
        assert page.evaluate(within), force
        assert page.evaluate(OVERLAPS) == 0, force
        words = page.locator("#mechanism").get_by_text("in the long run").inner_text()
        assert "0 N;" in words
        assert f"{force} N." in words
    page.evaluate("explorer.startAt({ phi: 1, theta: 0.1 })")
    opened.until("explorer.motion", 30)
    for frame in (0, 20, 60):
        page.evaluate(f"explorer.mechanism.frame = {frame}; explorer.mechanism.moved()")
        page.wait_for_timeout(50)
        assert page.evaluate(within), frame
    page.evaluate("explorer.choose(0); explorer.parameters.set('alpha', 0)")
    opened.until("explorer.mechanism.under.textContent === ''", 20)
    page.get_by_text("reset all").click()


def test_a_fast_motion_s_path_ends_at_the_axes(opened: Opened) -> None:
    page = opened.page
    page.evaluate("explorer.change({ landscape: ['phi', 'phi_dot'] }, 'landscape')")
    page.evaluate("explorer.startAt({ phi: 1, phi_dot: 15 })")
    opened.until("explorer.motion && explorer.landscape.current", 30)
    page.locator("#landscape").scroll_into_view_if_needed()
    page.wait_for_timeout(300)
    assert page.evaluate("Math.max(...explorer.landscape.path[1].filter(Number.isFinite))") > 10.0
    # A white line on black is nowhere above the axes.
    outside = page.evaluate(
        "(() => { const p = explorer.landscape.plane, { left, right, top } = p.box, c = p.canvas;"
        " const r = c.width / p.size()[0], y = Math.round((top - 6) * r), h = Math.round(3 * r);"
        " return p.kept.getContext('2d').getImageData(left * r, y, (right - left) * r, h).data"
        ".filter((v, k) => k % 4 === 0 && v < 60).length; })()"
    )
    assert outside == 0
    page.evaluate("explorer.change({ landscape: ['phi', 'theta'] }, 'landscape'); explorer.choose(0)")


def test_nothing_can_be_pressed_that_does_nothing_and_empty_views_say_why(opened: Opened) -> None:
    page = opened.page
    page.evaluate("explorer.choose(0)")
    play, scrub = page.locator("#mechanism button", has_text="play"), page.get_by_label("time", exact=True)
    assert play.is_disabled()
    assert scrub.is_disabled()
    for view in ("motion", "energies", "portrait"):
        assert "Press on" in page.inner_text(f"#{view} .note")
    page.evaluate("explorer.startAt({ phi: 1 })")
    opened.until("explorer.motion", 30)
    assert play.is_enabled()
    assert scrub.is_enabled()
    page.evaluate("explorer.choose(0)")


OWN = """import fastmech as fm, sympy

x, (k, b) = fm.lengths("x", -2, 2), sympy.symbols("k b")
made = fm.Mechanism(x, {"k": 1.0, "b": 0.2}, kinetic=x.dot**2 / 2, potential=k * (-x**2 / 2 + x**4 / 4),
                    dissipation=b * x.dot**2 / 2)
"""


@pytest.mark.slow
def test_a_mechanism_of_energies_lacks_its_drawing_alone(
    browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.py").write_text(OWN)
    with page_of(browser, f"{tmp_path}/own.py:made") as made:
        page = made.page
        assert page.inner_text("#name") == "own.py:made"
        assert "has no points in a plane" in page.inner_text("#mechanism .refusal")
        assert page.inner_text("#error") == ""
        np.testing.assert_allclose(
            page.evaluate("explorer.rows.map(r => r.position[0])"), [-1.0, 1.0, 0.0], atol=1e-9
        )
        assert page.evaluate("explorer.landscape.span[0]") == pytest.approx(-0.25)
        page.evaluate("explorer.startAt({ x: 0.9 })")
        made.until("explorer.motion && explorer.mechanism.motion", 60)
        assert "has no points in a plane" in page.inner_text("#mechanism .refusal")
        own = mechanism_named(f"{tmp_path}/own.py:made")
        lines_of(made, "motion", tmp_path, monkeypatch, own)
        # Ends have the names of the library.
        made.until("document.querySelector('#basins canvas').dataset.divisions === '400'", 120)
        told = page.inner_text("#basins .note")
        found = lines_of(made, "basins", tmp_path, monkeypatch, own)["found"]
        known = {name: count for name, count in found.counts.items() if count and name != "captured"}
        assert known["out_of_range"] > 0
        for name, count in known.items():
            assert f"{name}: {count:,}" in told
        assert told.partition("later. ")[2].count(": ") == len(known)
        assert made.said == []


DUFFING = """import fastmech as fm, sympy

x = fm.lengths("x", -3, 3)
made = fm.Mechanism(x, {"F": 0.05, "b": 0.3}, points={"M": (x, 0)}, masses={"M": 1.0},
                    potential=-(x**2) / 2 + x**4 / 4, dampers=[fm.Damper((0, 0), "M", sympy.Symbol("b"))],
                    forces=[fm.Force("M", fm.loads.Harmonic(sympy.Symbol("F"), 1.2), (1, 0))])
"""


def test_the_request_of_basins_under_a_load_that_repeats_runs(browser: Any, tmp_path: Path) -> None:
    (tmp_path / "duffing.py").write_text(DUFFING)
    with page_of(browser, f"{tmp_path}/duffing.py:made") as made:
        made.until("Number(document.querySelector('#basins canvas').dataset.divisions) >= 25", 120)
        made.until("explorer.basins.panel.request", 30)
        request = made.page.evaluate("explorer.basins.panel.request")
    (tmp_path / "r.toml").write_text(request)
    own = mechanism_named(f"{tmp_path}/duffing.py:made")
    run_request(tmp_path / "r.toml", tmp_path / "r.h5", mechanism=own)
    with fm.open_results(tmp_path / "r.h5") as results:
        assert len(results["basins"].groups["attractors"].sizes) >= 1


def test_a_bad_address_is_told_until_something_changes(browser: Any) -> None:
    with serving() as address:
        made = Opened(browser.new_page(viewport={"width": 1600, "height": 1000}), f"{address}#nothing")
        made.until("document.querySelector('#basins canvas').dataset.divisions", 60)
        assert "holds no state" in made.page.inner_text("#error")
        number = made.page.get_by_label("length of the motion [s]")
        for typed, counts in (("-5", "0.1"), ("1000", "300")):
            number.fill(typed)
            number.press("Enter")
            assert number.input_value() == counts
        assert made.page.inner_text("#error") == ""
        # Over the force the paper's mechanism is counted as its scene is.
        made.until("explorer.atlas.curves", 60)
        assert "held at its first value" in made.page.inner_text("#atlas .note")
        assert made.page.evaluate("explorer.about.scene = false, explorer.held()")
        made.page.close()


def test_a_double_click_on_a_slider_does_not_move_it_and_labels_start_nothing(opened: Opened) -> None:
    page = opened.page
    box = page.get_by_label(re.compile("^m2: .*]$")).first.bounding_box()
    page.mouse.dblclick(box["x"] + 0.8 * box["width"], box["y"] + 0.5 * box["height"])
    opened.until("explorer.state.parameters.m2 === 12", 10)
    assert "m2" in page.evaluate("document.activeElement.getAttribute('aria-label')")
    page.keyboard.press("Tab")
    page.evaluate("explorer.choose(0)")
    opened.press("#landscape", 0.5, 0.98)
    page.wait_for_timeout(300)
    assert page.evaluate("explorer.state.start") is None


def test_a_wrong_value_marks_what_is_still_shown(opened: Opened) -> None:
    number = opened.page.get_by_label(re.compile("^m1: .*value$"))
    number.fill("-3")
    number.press("Enter")
    for view in ("landscape", "equilibria", "mechanism", "basins"):
        stale = f"document.querySelector('#{view}').classList.contains('stale')"
        opened.until(
            f"{stale} && document.querySelector('#{view} .refusal').textContent.includes('last valid')"
        )
    opened.page.get_by_text("reset all").click()
    # A value that is no more is not spoken of.
    assert "m1" not in opened.page.evaluate(
        "[...document.querySelectorAll('.refusal')].map(e => e.textContent).join()"
    )
    opened.until("!document.querySelector('.stale')", 30)


@pytest.mark.parametrize("dark", [False, True])
def test_every_width_and_both_lights_can_be_read(opened: Opened, dark: bool) -> None:
    page = opened.page
    page.emulate_media(color_scheme="dark" if dark else "light")
    for width in (1000, 1600, 3000):
        page.set_viewport_size({"width": width, "height": 1000})
        page.wait_for_timeout(300)
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        sizes = page.evaluate(
            "[...document.querySelectorAll('section')].map(s => [s.clientWidth, s.scrollWidth])"
        )
        assert all(held >= 430 and needed <= held for held, needed in sizes), sizes
        ink, paper = page.evaluate(
            "['--ink', '--paper'].map(n => getComputedStyle(document.documentElement).getPropertyValue(n))"
        )
        assert contrast(ink.strip(), paper.strip()) > 7.0
        for soft in ("--soft", "--blue", "--vermillion", "--green", "--purple"):
            colour = page.evaluate(f"getComputedStyle(document.documentElement).getPropertyValue('{soft}')")
            assert contrast(colour.strip(), paper.strip()) > 3.0, soft
    page.set_viewport_size({"width": 1600, "height": 1000})
    page.emulate_media(color_scheme="light")


def contrast(one: str, other: str) -> float:
    """Ratio of contrast by WCAG 2."""

    def light(colour: str) -> float:
        parts = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        return float(
            np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
            @ [0.2126, 0.7152, 0.0722]
        )

    a, b = sorted((light(one), light(other)))
    return (b + 0.05) / (a + 0.05)


@pytest.mark.slow
def test_a_result_file_opens_with_its_sections_as_panels(browser: Any, tmp_path: Path) -> None:
    (tmp_path / "r.toml").write_text(
        '[scene]\nc2 = 200.0\n[scan.rest]\nkind = "equilibria"\n[scan.swing]\nkind = "motion"\n'
        "start = { phi = 1.0, theta = 0.1 }\nt_end = 2.0\noutputs = 50\n"
    )
    run_request(tmp_path / "r.toml", tmp_path / "r.h5")
    with page_of(browser, str(tmp_path / "r.h5")) as made:
        assert made.page.evaluate("explorer.state.parameters.c2") == 200.0
        for name in ("rest", "swing"):
            made.page.wait_for_selector(f"#section-{name} img", timeout=60_000)
            made.until(f"document.querySelector('#section-{name} img').naturalWidth > 100")
            assert made.page.locator(f"#section-{name} .refusal").inner_text() == ""
            assert f"results['{name}']" in made.page.locator(f"#section-{name} pre").first.text_content()
        assert made.said == []


def test_a_motion_that_a_kernel_cannot_follow_gives_a_line(opened: Opened) -> None:
    opened.page.evaluate("explorer.startAt({phi: 0.5, theta: 1, theta_dot: 1e200})")
    opened.until("explorer.histories.note.textContent.includes('not_finite')", 30)
    opened.page.evaluate("explorer.startAt({phi: 0.5, theta: 1})")
    opened.until("explorer.histories.note.textContent.startsWith('From ')", 30)


def test_the_status_line_says_what_is_compiled(opened: Opened) -> None:
    told = "{ name: 'march', of: ['basins'], number: 3, about: 60 }"
    opened.page.evaluate(f"explorer.compiling({told})")
    assert (
        opened.page.inner_text("#status")
        == "loading or compiling for the basin map: march, kernel 3 of about 60"
    )
    opened.page.evaluate("explorer.compiling({ name: null })")
    opened.until("document.querySelector('#status').textContent === 'ready'")


def started(browser: Any) -> tuple[float, float, float]:
    """Seconds from the command to a usable page and to its first equilibria, and from Ctrl-C to the end."""
    page = browser.new_page(viewport={"width": 1600, "height": 1000})
    begun = time.monotonic()
    with serving() as address:
        page.goto(address)
        page.wait_for_selector("#parameters input")
        usable = time.monotonic() - begun
        page.wait_for_selector("#equilibria td", timeout=120_000)
        first = time.monotonic() - begun
        page.close()
        begun = time.monotonic()
    return usable, first, time.monotonic() - begun


@pytest.mark.slow
def test_budgets(browser: Any, opened: Opened) -> None:
    told = list[tuple[str, float, float, str]]()
    opened.settle()
    opened.page.evaluate("explorer.choose(0)")
    starts = np.median([started(browser) for _ in range(3)], axis=0)
    told.append(("page usable after the command", starts[0], 1.0, "s"))
    told.append(("first equilibria after the command", starts[1], np.nan, "s"))
    told.append(("Ctrl-C to the end of the process", starts[2], 1.0, "s"))
    page = opened.page

    def slide(when: str) -> None:
        page.evaluate("explorer.waits.equilibria = []; explorer.waits.answers = []")
        for k in range(25):
            page.evaluate(f"explorer.parameters.set('c1', {150 + k})")
            page.wait_for_timeout(110)
        answers, drawn = page.evaluate("[explorer.waits.answers, explorer.waits.equilibria]")
        told.append((f"slider to answer{when}", statistics.median(answers), np.nan, "ms"))
        told.append((f"slider to drawn pictures{when}", statistics.median(drawn), 50.0, "ms"))

    page.evaluate("explorer.choose(0)")
    slide("")
    page.evaluate("explorer.startAt({phi: 0.5, theta: 1}); explorer.letGo()")
    opened.until("explorer.mechanism.playing", 10)
    slide(", motion plays")
    page.get_by_text("reset all").click()
    page.evaluate("explorer.choose(0)")
    levels = []
    for _ in range(3):
        page.wait_for_timeout(1000)
        page.evaluate("explorer.basins.levels = {}; explorer.askBasins()")
        opened.until("explorer.basins.levels[401] !== undefined", 30)
        found = page.evaluate("explorer.basins.levels")
        levels.append([found["26"], found["101"], found["401"]])
    first, hundred, all_ = np.median(levels, axis=0)
    told.append(("basins, first picture of 26 x 26", first, np.nan, "ms"))
    told.append(("basins, 101 x 101", hundred, 200.0, "ms"))
    told.append(("basins, 401 x 401", 1e-3 * all_, 3.0, "s"))
    page.evaluate("explorer.startAt({phi: 0.5, theta: 1}); explorer.letGo()")
    opened.until("explorer.mechanism.playing", 10)
    page.wait_for_timeout(500)
    page.evaluate("explorer.mechanism.frames = []")
    page.wait_for_timeout(4000)
    shown = np.diff(page.evaluate("explorer.mechanism.frames"))
    told.append(("time of a picture of a motion", shown.mean(), 1e3 / 60.0, "ms"))
    told.append(("longest pause of a motion", shown.max(), 1e3, "ms"))
    print(f"\nmedians; {os.cpu_count()} processors, load {os.getloadavg()[0]:.1f}")
    for title, value, budget, unit in told:
        print(f"{title:36} {value:8.2f} {unit:2}   wanted {budget:7.2f} {unit}")
        assert np.isnan(budget) or value < 10.0 * budget, title


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
