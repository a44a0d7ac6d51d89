"""The report on a device: what it says, and derivatives against solving again."""

from __future__ import annotations

import math
import re
from functools import partial
from html import unescape
from pathlib import Path

import numpy as np
import pytest
import sympy
from click.testing import CliRunner
from numpy.testing import assert_allclose

import fastmech as fm
from fastmech import device_report
from fastmech.basins.disturbed import return_quantile
from fastmech.cli import main
from fastmech.device_report import Sensitivities
from fastmech.plots import style
from fastmech.plots.basins import basin_name
from fastmech.results import Dataset, Variable
from fastmech.scan_types.request import device_of, tolerances_of
from fastmech.scene import read_toml

SCENE = fm.Scene(F0=10.0, alpha=0.0, c1=300.0, c2=93.0)
NAMES = ["c1", "m2", "F0"]


def shallow() -> fm.Scene | fm.Mechanism:
    """The truss, with a damper and a load."""
    return fm.mechanisms.von_mises_truss().replace(b=3.0, P=5.0)


@pytest.mark.parametrize(("system", "names"), [(SCENE, NAMES), (shallow(), ["k", "rise", "P"])])
def test_positions_and_decay_follow_parameters_as_solving_again_shows(system, names) -> None:
    """Central differences of what find_equilibria and classify give at changed parameters."""
    slopes = Sensitivities(system, names)
    found = fm.find_equilibria(system)
    e = found[0]
    root, change = slopes.slowest(e.position)
    assert_allclose(root.real, fm.classify(system, e).eigenvalues.real.max(), rtol=1e-9)
    for j, name in enumerate(names):
        value = system.described()[name][0]
        h = 1e-4 * abs(value)
        ends = [system.replace(**{name: value + s * h}) for s in (1.0, -1.0)]
        places = [fm.find_equilibria(one)[0] for one in ends]
        expected = (places[0].position - places[1].position) / (2.0 * h)
        assert_allclose(slopes.position(e.position)[:, j], expected, rtol=1e-6, atol=1e-9)
        rates = [fm.classify(one, at).eigenvalues.real.max() for one, at in zip(ends, places, strict=True)]
        assert_allclose(change[j].real, (rates[0] - rates[1]) / (2.0 * h), rtol=1e-5, atol=1e-9)
        far = {name: 1.03 * value}
        place = fm.find_equilibria(system.replace(**far))[0]
        decay = fm.classify(system.replace(**far), place).eigenvalues.real.max()
        assert_allclose(slopes.moved(e.position, far), place.position, atol=1e-9)
        assert_allclose(slopes.decay_rate(e.position, far), -decay, rtol=1e-7)


@pytest.mark.parametrize(
    ("system", "along", "other", "searched"),
    [(SCENE, "F0", "c1", None), (SCENE, "c2", "m2", None), (shallow(), "P", "k", (-100.0, 100.0))],
)
def test_where_a_position_ends_follows_parameters_as_searching_again_shows(
    system, along, other, searched
) -> None:
    e = next(one for one in fm.find_equilibria(system) if one.kind == "minimum")
    snap = fm.find_snap(system, e, searched, parameter=along)
    value = snap.below if snap.below is not None else snap.above
    slopes = Sensitivities(system, [other, along])
    fold = slopes.fold(along, value, e.position)
    assert fold is not None
    row = slopes.end(along, fold)
    assert row is not None
    assert row[1] == 0.0  # the parameter itself is what ends it
    p = system.described()[other][0]
    ends = []
    for s in (1.0, -1.0):
        changed = system.replace(**{other: p * (1.0 + s * 1e-4)})
        found = fm.find_equilibria(changed)
        near = found[int(np.abs(found.position - e.position).sum(axis=1).argmin())]
        again = fm.find_snap(changed, near, searched, parameter=along)
        ends.append(again.below if snap.below is not None else again.above)
    assert_allclose(row[0], (ends[0] - ends[1]) / (2e-4 * p), rtol=1e-5)


def test_a_position_that_ends_before_is_not_followed_to_another() -> None:
    e = next(one for one in fm.find_equilibria(SCENE) if one.kind == "minimum")
    snap = fm.find_snap(SCENE, e)
    value = snap.below if snap.below is not None else snap.above
    slopes = Sensitivities(SCENE, ["F0"])
    before, beyond = (SCENE.F0 + share * (value - SCENE.F0) for share in (0.99, 1.01))
    assert slopes.moved(e.position, {"F0": before}) is not None
    assert slopes.moved(e.position, {"F0": beyond}) is None


def test_the_truss_ends_where_geometry_says() -> None:
    """Springs of length L0 over a half span a: P = 2 k y (L0/L - 1), greatest at L = (L0 a^2)^(1/3)."""
    truss = fm.mechanisms.von_mises_truss()
    p = truss.parameters
    a, rest = 0.5 * p["span"], np.hypot(0.5 * p["span"], p["rise"])
    per_k = 2.0 * (rest ** (2 / 3) - a ** (2 / 3)) ** 1.5
    e = fm.find_equilibria(truss)[0]
    snap = fm.find_snap(truss, e, (-100.0, 100.0), parameter="P")
    value = snap.below if snap.below is not None else snap.above
    assert_allclose(abs(value), p["k"] * per_k, rtol=1e-6)
    slopes = Sensitivities(truss, ["k"])
    fold = slopes.fold("P", value, e.position)
    slope = slopes.end("P", fold)
    assert_allclose(abs(slope[0]), per_k, rtol=1e-6)


def test_a_single_coordinate_ends_where_its_cubic_says() -> None:
    """x^3 - a x + F = 0 has a double root at F = (2 a / 3) sqrt(a / 3), of the slope sqrt(a / 3) over a."""
    x, (a, force) = fm.lengths("x", -3.0, 3.0), sympy.symbols("a F")
    device = fm.Mechanism(
        x, {"a": 0.02, "F": 0.0}, kinetic=x.dot**2 / 2, potential=x**4 / 4 - a * x**2 / 2 + force * x
    )
    e = max(fm.find_equilibria(device), key=lambda one: one.position[0])
    value = 2.0 * 0.02 / 3.0 * np.sqrt(0.02 / 3.0)
    assert_allclose(fm.find_snap(device, e, (-1.0, 1.0), parameter="F").above, value, rtol=1e-6)
    slopes = Sensitivities(device, ["a"])
    fold = slopes.fold("F", value, e.position)
    assert fold is not None
    row = slopes.end("F", fold)
    assert row is not None
    assert_allclose(row, [np.sqrt(0.02 / 3.0)], rtol=1e-6)


def test_disturbances_that_begin_beyond_a_range_are_counted(small) -> None:
    """Sizes are up to 0.5 rad: most begin beyond 0.1 rad, none beyond 9 rad; of a length none does."""
    beyond, sizes = {}, {}
    for end, of in ((0.1, fm.angles), (9.0, fm.angles), (0.2, fm.lengths)):
        x = of("x", -end, end)
        device = fm.Mechanism(
            x, kinetic=x.dot**2 / 2, potential=x**2 / 2, dissipation=x.dot**2 / 4, name="slide"
        )
        lines = device_report._Report(device, {}, None).disturbances()
        beyond[end] = [line for line in lines if line.endswith("begin beyond the range of a coordinate.")]
        # Of a size s, s^2/2; the end of the range is as high.
        energies = f"up to {0.5 * min(end, 0.5) ** 2:.2g} J" if of is fm.lengths else "up to 0.12 J"
        assert any(f"position 0 are given {energies}, barrier at least" in line for line in lines)
        sizes[end] = lines[0].partition(", up to ")[2].partition(" in the norm")[0]
    assert not beyond[9.0] + beyond[0.2]
    least = "0.2 m (0.5, or the largest size at which none begins beyond a range)"
    assert sizes == {0.1: "0.5 rad", 9.0: "0.5 rad", 0.2: least}
    (line,) = beyond[0.1]
    assert 0.5 * device_report.DISTURBANCES < int(line.split()[0]) <= device_report.DISTURBANCES


def rows_of(lines: list[str]) -> dict[str, list[str]]:
    """Cells of tables by their first one; later tables come after the earlier ones' cells."""
    found: dict[str, list[str]] = {}
    for first, *cells in (line.strip("| ").split(" | ") for line in lines if " | " in line):
        found.setdefault(first, []).extend(cells)
    return found


def two_walls() -> fm.Mechanism:
    """Two pendulums, their ends on springs with a free length to walls: folds come and go in cusps."""
    q1, q2 = fm.angles("q1 q2")
    n1, k1, F = sympy.symbols("n1 k1 F")
    x, y = 0.6 * sympy.sin(q1), -0.6 * sympy.cos(q1)
    points = {"A": (x, y), "B": (x + 0.5 * sympy.sin(q2), y - 0.5 * sympy.cos(q2))}
    return fm.Mechanism(
        (q1, q2),
        {"n1": 1.1, "k1": 400.0, "F": 0.0},
        points=points | {"W": (0.9, 0.2), "V": (-0.9, 0.2)},
        masses={"A": 3.0, "B": 2.0},
        springs=[fm.Spring("W", "A", k1, free_length=n1), fm.Spring("V", "B", 30.0, free_length=0.4)],
        forces=[fm.Force("B", F, (1, 0))],
        gravity=9.81,
    )


@pytest.mark.slow
def test_an_end_whose_fold_vanishes_is_searched_again(small) -> None:
    """The fold at -31.2 N ends in a cusp near n1 = 1.088; before that, another one is the first end."""
    system = two_walls()
    made = device_report._Report(system, {"n1": 0.02}, None)
    made.snaps()
    made.snapped = {key: made.snapped[key] for key in [(made.wells[1], "F")]}
    rows = rows_of(made.tolerances())
    (what,) = (first for first in rows if first.endswith("ends below at F"))
    value, _, *ends = rows[what][:4]
    assert rows[what][4:] == ["not linear", "not linear"]
    assert rows[f"{what} [1]"][-1] == str(device_report.MEMBERS)  # all devices have it
    for n1, told in ((1.1, value), (1.08, ends[0]), (1.12, ends[1])):
        changed = system.replace(n1=n1)
        e = [e for e in fm.find_equilibria(changed) if e.kind == "minimum"][1]
        found = fm.find_snap(changed, e, parameter="F")
        assert found.below == pytest.approx(float(told), rel=1e-5)
        for load, there in ((found.below + 0.05, True), (found.below - 0.05, False)):
            places = fm.find_equilibria(changed.replace(F=load))
            assert (sum(e.kind == "minimum" for e in places) == 2) is there


def test_ends_on_a_kink_or_of_a_range_have_rows(small) -> None:
    """A spring k with a soft stop at 1 that pushes onwards: rest ends on its kink, at F = k; there x = 1.

    Below, x = F / k leaves the range at F = -2 k.
    """
    x = fm.lengths("x", -2.0, 3.0)
    k, F = sympy.symbols("k F")
    device = fm.Mechanism(
        x, {"k": 5.0, "F": 0.0}, kinetic=x.dot**2 / 2,
        potential=k * x**2 / 2 - F * x - 8 * sympy.Max(0, x - 1) ** 2 / 2,
    )  # fmt: skip
    made = device_report._Report(device, {"k": 0.5}, None)
    made.snaps()
    rows = rows_of(made.tolerances())
    for side, factor in (("above", 1.0), ("below", -2.0)):
        value, *told = (float(x) for x in rows[f"0: ends {side} at F (by differences)"] if x)
        assert_allclose(value, factor * 5.0, rtol=1e-6)
        change = abs(factor) * 0.5
        expected = [factor * 4.5, factor * 5.5, change / np.sqrt(3.0), change]
        assert_allclose(told, expected, rtol=2e-3)  # as many digits as are printed


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything quick."""
    for name, value in {
        "MAP": 5,
        "STARTS": 16,
        "ERODED": 16,
        "FEW": 8,
        "LOADS": 3,
        "DISTURBANCES": 8,
        "MEMBERS": 4,
    }.items():
        monkeypatch.setattr(device_report, name, value)


def test_it_says_what_the_functions_say_and_can_be_repeated(small, tmp_path: Path) -> None:
    how = {"tolerances": {"c1": 6.0}, "title": "Our <hinge>, second sample"}
    with pytest.MonkeyPatch.context() as patch:
        titles: list[str] = []
        patch.setattr(style, "title", lambda axes, text, *_: titles.append(text))
        patch.setattr(style, "suptitle", lambda figure, text: titles.append(text))
        page, paper = fm.report(SCENE, tmp_path / "device.html", **how)
    text = page.read_text(encoding="utf-8")
    for about in ("Positions of rest", "Where starts come to rest\n", "Basin stability along F0"):
        told = next(title for title in titles if title.startswith(about))
        assert "parameters as in the table of the device" in told
    assert not any("Table 1" in title or "c1" in title or " more" in title for title in titles)
    assert style.setting(SCENE).startswith("the paper's Table 1 with ")  # elsewhere
    assert paper.read_bytes().startswith(b"%PDF")
    assert text.count("data:image/png;base64,") == 4
    for heading in (
        "Positions of rest",
        "snap loads",
        "Shocks",
        "Basins",
        "Erosion",
        "Tolerances",
        "To repeat this",
    ):
        assert heading in text
    found = fm.find_equilibria(SCENE)
    minimum = next(e for e in found if e.kind == "minimum")
    assert f"{minimum.phi:.6f}" in text
    assert f"{fm.classify(SCENE, minimum).decay_time:.4g}" in text
    assert f"{fm.find_snap(SCENE, minimum).below:.6g}" in text
    assert f"{device_report.proved_limit(SCENE, minimum, 'M2').energy:.4g}" in text
    assert "c1 = { value = 300.0, plus_minus = 6.0 }" in text
    assert "Not for this device" not in text
    assert "Proved to within [rad]" in text
    assert ">erosion<" in text
    assert "full turns away" in text
    call = r"fm\.shock_limit\(device, fm\.find_equilibria\(device\)\[\d\], on='M\d'\)"
    assert re.search(
        f"may leave at less: {call} tells", unescape(text)
    )  # than what was found on one point, along one direction
    assert "At a pitchfork" in text
    assert "and never beyond" in text  # there is no fold beyond the loads that were searched
    assert re.search(r"0\.\d+ s, by the start&#x27;s energy|s, by the start's energy", text)
    assert not re.search(r"([\d.]+) to \1 s, by the start", text)
    first = fm.disturb(SCENE, minimum, device_report.DISTURBANCES)
    assert return_quantile(first, 1.0) == np.inf  # not all are back by default: the page follows them longer
    row = re.search(r"Back by then.*?<tr>(.*?)</tr>", text, re.DOTALL)
    share, at_most, until, back, median = (re.findall(r">([\d.]+)%?<", row[1])[k] for k in (1, 2, 3, 4, 5))
    later = fm.disturb(SCENE, minimum, device_report.DISTURBANCES, t_end=float(until))
    assert float(until) > first.t_end
    assert (share, at_most) == tuple(
        f"{100 * x:.2f}" for x in (later.returned.fraction, later.returned.at_most)
    )
    assert back == share
    assert median == f"{return_quantile(later, 0.5):.4g}"
    assert "ends below at F0" in text
    assert "ends below at c1" not in text  # no end of c1 depends on what c1 is
    assert ">Median<" in text
    assert ">95 %<" in text
    assert "Over 4 devices" in text
    # Its request gives the same device.
    request = unescape(text.split("<pre><code>")[1].split("</code>")[0])
    (tmp_path / "again.toml").write_text(request, encoding="utf-8")
    table = read_toml(tmp_path / "again.toml")
    assert table["title"] == how["title"]
    assert device_of(table) == SCENE
    assert tolerances_of(table) == {"c1": 6.0}


def test_what_a_device_has_not_is_said(small, tmp_path: Path) -> None:
    page, _ = fm.report(fm.mechanisms.von_mises_truss(), tmp_path / "truss.html")
    text = page.read_text(encoding="utf-8")
    assert " b from " not in text  # dampers end nothing
    assert "has no dampers" in text
    assert ">disturbances<" not in text.partition("How each number")[2]
    assert "Proved to within [m]" in text
    assert "Meaning" not in text
    assert "mechanism = &quot;von_mises_truss&quot;" in text or 'mechanism = "von_mises_truss"' in text


def test_starts_that_leave_a_range_are_known_to_end_elsewhere(small) -> None:
    """Started far outside, most leave the truss's range: none is undecided, so no share can be larger."""
    made = device_report._Report(shallow(), {}, None)
    made.window = dict.fromkeys(made.units, (-3.0, 3.0))
    found = fm.label_starts(made.system, made.starts(device_report.STARTS))
    gone = found.counts["out_of_range"]
    assert gone > 0
    assert gone + found.counts["captured"] == device_report.STARTS
    lines = made.basins()
    assert f"{gone} out of range" in lines[0]
    rows = [line.strip("| ").split(" | ") for line in lines if "%" in line][1:]
    assert len(rows) == len(made.stable)
    for k, row in zip(made.stable, rows, strict=True):
        share = f"{np.mean(found.well == k):.2%}"
        assert [cell.strip() for cell in (row[1], row[3])] == [share, share]


def test_without_a_potential_no_energy_is_told() -> None:
    column = fm.mechanisms.ziegler_column().replace(b=0.1)
    (row,) = (line for line in device_report._Report(column, {}, None).rests() if "| positive" in line)
    assert "| - | positive |" in row
    assert str(fm.find_equilibria(column)[0]).endswith(", each within 1e-15")


def test_dampers_and_masses_with_which_a_position_begins_to_flutter_are_told() -> None:
    """It does at P = 41/28 k/l + b^2/(2 m l^3): both are in that, though no position moves with them."""
    column = fm.mechanisms.ziegler_column().replace(P=1.475, b=0.2)
    report = device_report._Report(column, {}, None)
    report.rests()
    excess, rows = 1.475 - 41.0 / 28.0, "\n".join(report.snaps())
    assert f"| b | N m s | 0.2 | {math.sqrt(2.0 * excess):.6g} (begins to flutter)" in rows
    assert f"{0.2**2 / (2.0 * excess):.6g} (begins to flutter)" in rows


@pytest.mark.parametrize(("low", "high", "rest"), [(-2.0, 1.0, 0.0), (-0.5, 3.6, 3.5), (-9.0, 9.0, 4.5)])
def test_motions_of_an_angle_start_in_all_of_its_range(low, high, rest, small) -> None:
    """A lever with stops, on a spring: as the potential has no barrier but them, most starts come to rest."""
    a = fm.angles("a", low, high)
    energies = {"kinetic": a.dot**2, "potential": (a - rest) ** 2, "dissipation": 4 * a.dot**2}
    made = device_report._Report(fm.Mechanism(a, **energies), {}, None)
    assert made.window == {"a": (low, high)}
    line = made.basins()[0]
    assert f"a from {low:g} to {high:g} rad" in line
    x = made.starts(device_report.STARTS)[:, 0]
    assert x.min() < low + 0.1 * (high - low)
    assert x.max() > high - 0.1 * (high - low)
    assert f"{device_report.STARTS} captured" in line  # overdamped, none overshoots


@pytest.mark.slow
def test_under_a_load_that_repeats_every_part_says_one_true_line(small, tmp_path: Path) -> None:
    """Of the symmetric device: phi = pi/2 and theta = 0 whatever c1 is, so nothing changes by it."""
    device = fm.Scene(load=fm.loads.Harmonic(80.0, 4.0))
    page, _ = fm.report(device, tmp_path / "driven.html", tolerances={"c1": 5.0})
    text = page.read_text(encoding="utf-8")
    assert "under the mean of its load" in text
    assert text.count("Not for this device: its load repeats") == 4
    assert "Blows and shares: not for this device: its load repeats" in text
    proofs = text.partition("How each number")[2]
    assert "proved blows" not in proofs
    assert "erosion" not in proofs
    assert 'mechanism = "slider_pendulum"' not in text  # that one has another load
    assert "--mechanism FILE.py:NAME" in text
    for coordinate in "φθ":
        row = re.search(rf">0: {coordinate}</td>(.*?)</tr>", text, re.DOTALL)
        assert row is not None
        value, *others = re.findall(r">([-+.\de]+)<", row[1])
        assert others == [value, value, "0", "0"]  # at both ends, deviation, worst


def flap(**how: object) -> fm.Mechanism:
    """A flap on a spring between stops: its barriers are the ends of its range."""
    a = fm.angles("a", -1.0, 2.0)
    point = {"tip": (sympy.cos(a), sympy.sin(a))}
    energies = {"kinetic": a.dot**2, "potential": a**2, "dissipation": a.dot**2 / 10}
    return fm.Mechanism(a, points=point, **energies, **how)


def test_texts_of_others_are_shown_as_they_are(small, tmp_path: Path) -> None:
    """Neither a page's title nor a point's name is HTML or Markdown."""
    title = "Lid <script>alert(1)</script> & [more](http://x.y) *is* | `it` __so__ &amp; \\_ # <b>"
    a = fm.angles("a", -1.0, 2.0)
    name = "<i>x</i> | *y* [z](http://u.v) $\\foo$"
    device = fm.Mechanism(
        a, points={name: (sympy.cos(a), sympy.sin(a))}, masses={name: 1}, potential=a**2,
        dissipation=a.dot**2 / 10, name="a_flap_b",
    )  # fmt: skip
    page, _ = fm.report(device, tmp_path / "x.html", title=title)
    text = page.read_text(encoding="utf-8")
    for tag in ("script", "i", "b", "em", "strong"):
        assert f"<{tag}>" not in text
    assert "href" not in text
    heads = [re.search(rf"<{tag}[^>]*>(.*?)</{tag}>", text)[1] for tag in ("title", "h1")]
    assert [unescape(head) for head in heads] == [title] * 2
    cells = [unescape(cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", text)]
    assert f"point {name}" in cells
    assert f"at {name}" in cells
    assert name in cells  # what is struck
    with pytest.raises(fm.InputError, match=r"^title = 5: must be a text$"):
        fm.report(device, tmp_path / "x.html", title=5)  # type: ignore[arg-type]


def test_a_barrier_that_may_be_higher_is_said_to(small) -> None:
    """Of the flap it is the end of its range, of which no saddle is known; of the scene it is a saddle."""
    made = device_report._Report(flap(), {}, None)
    assert "Position 0: its barrier is at least" in "\n".join(made.shocks())
    proofs = rows_of(made.proofs())
    assert proofs["proved blows"][-1] == "energy below the barrier; that of position 0 is at least so high"
    made.basins()
    legend = [text.get_text() for text in made.figures["basins"].legends[0].get_texts()]
    assert "energy at the barrier: at least 1 J above the well" in legend
    (e,) = fm.find_equilibria(flap())
    assert "the well's barrier is at least so high" in " ".join(str(fm.shock_limit(flap(), e)).split())
    sure = device_report._Report(SCENE, {}, None)
    assert sure.bounded == []
    assert rows_of(sure.proofs())["proved blows"][-1] == "energy below the lowest saddle of the well"


def test_undecided_starts_are_said_to_be(small, monkeypatch: pytest.MonkeyPatch) -> None:
    """Followed for a moment no motion is captured: a longer end may tell, and no share is lost."""
    short = partial(fm.label_starts, t_end=0.01)
    monkeypatch.setattr(
        device_report, "label_starts", lambda system, starts, *_, threads: short(system, starts)
    )
    made = device_report._Report(shallow(), {}, None)
    late = int(np.sum(short(made.system, made.starts(device_report.STARTS)).well < 0))
    assert late > 0
    assert f"{late} undecided; a longer t_end may decide {late}." in made.basins()[0]
    made.snaps()
    caption = made.erosion()[-2]
    figure = made.figures["erosion"]
    told = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "undecided starts, which each well may have" in told
    (line,) = (line for line in figure.axes[0].lines if line.get_marker() == "x")
    assert f"Up to {np.nanmax(line.get_ydata()):.1f}% are undecided: not lost" in caption
    share = 100.0 * np.mean(short(made.system, made.starts(device_report.ERODED)).well < 0)
    assert_allclose(line.get_ydata()[line.get_xdata() == 5.0], share)  # of the present load


def test_what_rests_nowhere_stably_without_a_potential(small, tmp_path: Path) -> None:
    """Ziegler's column without dampers swings on; its forces have no potential."""
    how = {"tolerances": {"k": 0.1}}
    page, _ = fm.report(fm.mechanisms.ziegler_column(), tmp_path / "x.html", **how)
    text = page.read_text(encoding="utf-8")
    assert "the sign of the stiffness matrix' determinant" in text
    assert "Hessian" not in text
    for heading in ("Where positions end (snap loads)", "Tolerances"):
        part = text.partition(f">{heading}</h2>")[2].partition("<h2")[0]
        assert "Not for this device: it rests nowhere stably." in part
        assert "<table" not in part
    damped = device_report._Report(fm.mechanisms.ziegler_column().replace(b=0.5), {"k": 0.01}, None)
    lines = damped.tolerances()
    assert any("Shares: not for this device: ziegler" in line for line in lines)
    heads = [k for k, line in enumerate(lines) if line.startswith("|---")]
    assert all(lines[k + 1].startswith("| ") for k in heads)  # no table has a head alone


def test_what_cannot_be_struck_is_told_why(tmp_path: Path) -> None:
    q = fm.angles("q")
    bead = fm.Mechanism(q, kinetic=q.dot**2 / 2, potential=-sympy.cos(q), dissipation=q.dot**2)
    with pytest.raises(fm.InputError, match="no blow on a named point of a plane moves it"):
        device_report._Report(bead, {}, None).shocks()
    ramp = fm.Scene(load=fm.loads.Ramp(5.0, 0.0, 1.0))
    with pytest.raises(fm.InputError, match=r"Ramp\(.*\) changes; nothing rests while it does"):
        device_report._Report(ramp, {}, None).shocks()


def test_a_page_is_no_document_of_another_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # messages cut long paths
    for name in ("x.docx", "x.pdf"):
        with pytest.raises(fm.InputError, match=rf"path = '{name}': must end in \.html"):
            fm.report(SCENE, name)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("tolerances", "line"),
    [
        ({"c3": 1.0}, "did you mean 'c1' or 'c2'"),
        ({"c1": -1.0}, "must be a number > 0 N/m"),
        ({"m1": 11.0}, r"tolerances.m1 = 11.0: plus_minus reaches scene.m1 = -1"),
    ],
)
def test_bad_tolerances_are_refused(tolerances, line, tmp_path: Path) -> None:
    with pytest.raises(fm.InputError, match=line):
        fm.report(SCENE, tmp_path / "x.html", tolerances=tolerances)


def test_a_tolerance_keeps_the_sign_of_what_is_positive_but_of_loads(tmp_path: Path) -> None:
    truss = shallow()
    line = r"^tolerances\.k = 2000\.0: plus_minus must be less than the value, 1000 N/m$"
    with pytest.raises(fm.InputError, match=line):
        fm.report(truss, tmp_path / "x.html", tolerances={"k": 2000.0})
    assert device_report._checked(truss, {"P": 20.0}) == {"P": 20.0}


def test_systems_of_states_have_no_report(tmp_path: Path) -> None:
    with pytest.raises(fm.InputError, match="must be a Scene or a Mechanism"):
        fm.report(fm.System(lambda t, x: (-x,), ("x",), {}), tmp_path / "x.html")  # type: ignore[arg-type]


def test_the_command_reads_tolerances_and_refuses_what_it_does_not_know(tmp_path: Path, monkeypatch) -> None:
    def write(system: fm.Scene, out: Path, stage: object, **how: object) -> list[Path]:
        asked.update(how, system=system, out=out)
        return []

    asked: dict[str, object] = {}
    monkeypatch.setattr(device_report, "report", write)
    text = "[scene]\nF0 = 10.0\nalpha = 0.0\nc1 = { value = 300.0, plus_minus = 6.0 }\nc2 = 93.0\n"
    (tmp_path / "device.toml").write_text(text, encoding="utf-8")
    out = tmp_path / "page.html"
    done = CliRunner().invoke(main, ["report", str(tmp_path / "device.toml"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    scene = fm.Scene(F0=10.0, alpha=0.0, c1=300.0, c2=93.0)
    assert asked == {"system": scene, "out": out, "tolerances": {"c1": 6.0}, "title": ""}
    for content, line in (
        ("c1 = 3.0\n", "c1: unknown name"),
        ("title = 5\n[scene]\n", "title = 5: must be a text"),
        ("", "has no device; write a table [scene]"),
        ("title = 'A hinge'\n", "has no device; write a table [scene]"),
    ):
        (tmp_path / "wrong.toml").write_text(content, encoding="utf-8")
        refused = CliRunner().invoke(main, ["report", str(tmp_path / "wrong.toml")])
        assert refused.exit_code == 2
        assert line in refused.output


@pytest.mark.slow
def test_a_mechanism_of_a_file_repeats_with_tolerances(small, tmp_path: Path) -> None:
    own = tmp_path / "twin.py"
    made = "fm.mechanisms.von_mises_truss().replace(b=3.0)"
    own.write_text(f"import fastmech as fm\n\ntruss = {made}\ntruss.name = 'twin'\n", encoding="utf-8")
    request = tmp_path / "twin.toml"
    request.write_text(
        'title = "Our twin"\n[scene]\nk = { value = 90.0, plus_minus = 2.0 }\n', encoding="utf-8"
    )
    command = ["report", str(request), "--mechanism", f"{own}:truss", "--out", str(tmp_path / "twin.html")]
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 0, done.output
    text = (tmp_path / "twin.html").read_text(encoding="utf-8")
    assert "Our twin</h1>" in text
    assert "k = { value = 90.0, plus_minus = 2.0 }" in text
    assert "--mechanism FILE.py:NAME" in text
    assert 'mechanism = "twin"' not in text


def test_a_median_counts_those_that_return_later() -> None:
    """With the end of the runs before most are back, the median is not that of the first ones."""
    scene = fm.Scene(m1=4.0, m2=6.0, m3=3.0, l=0.6, c1=900.0, c2=150.0, beta=40.0, F0=60.0, alpha=0.0)
    e = fm.find_equilibria(scene)[0]
    early, late = (fm.disturb(scene, e, 256, t_end=t) for t in (120.0, 600.0))
    assert np.isfinite(early.time_to_return).any()
    assert return_quantile(early, 0.5) == np.inf
    assert return_quantile(late, 0.5) == pytest.approx(np.median(late.time_to_return), rel=0.05)
    later = 256 - np.isfinite(early.time_to_return).sum()
    assert f"{later} only later" in " ".join(str(early).split())


def test_positions_have_the_numbers_of_lists_and_maps() -> None:
    """A pendulum on a soft spring with stops far away: outer wells lie above the inner barriers."""
    q = fm.angles("q", -20.0, 20.0)
    system = fm.Mechanism(
        q, kinetic=q.dot**2 / 2, potential=0.04 * q**2 - sympy.cos(q), dissipation=0.15 * q.dot**2
    )
    made = device_report._Report(system, {}, None)
    index = Variable(("equilibrium",), np.array([e.morse_index for e in made.found]))
    pictured = Dataset({"equilibrium_morse_index": index})
    wells = [k for k, e in enumerate(made.found) if e.kind == "minimum"]
    assert wells != list(range(len(wells)))
    for number, k in enumerate(wells):
        assert basin_name(pictured, k, (0, 0)) == f"well {number}"
        assert made.name(k) == (f"{k}" if number == k else f"{k} (well {number})")


@pytest.mark.slow
def test_erosion_names_wells_as_the_tables_do_and_looks_beside_snap_loads(monkeypatch) -> None:
    """The same pendulum with a moment: at the inner wells' ends others are left, which have other numbers."""
    monkeypatch.setattr(device_report, "ERODED", 16)
    monkeypatch.setattr(device_report, "LOADS", 3)
    q = fm.angles("q", -20.0, 20.0)
    own = {"P": (0.0, "N m"), "J": (1.0, "kg m2"), "k": (0.08, "N m"), "w": (1.0, "N m"), "b": (0.3, "N m s")}
    P, J, k, w, b = sympy.symbols([*own])
    energies = {"kinetic": J * q.dot**2 / 2, "potential": k * q**2 / 2 - w * sympy.cos(q) - P * q}
    system = fm.Mechanism(q, own, **energies, dissipation=b * q.dot**2 / 2)
    made = device_report._Report(system, {}, None)
    made.snaps()
    made.erosion()
    figure = made.figures["erosion"]
    told = [text.get_text().split(", found")[0] for text in figure.legends[0].get_texts()]
    assert told[: len(made.wells)] == [f"position {made.name(number)}" for number in made.wells]
    assert any("(well" in one for one in told)
    others = [one for one in told if one.startswith("a well of other loads")]
    assert others[:2] == ["a well of other loads, A", "a well of other loads, B"]
    loads = np.unique(np.concatenate([line.get_xdata() for line in figure.axes[0].lines]).astype(float))
    for end in (v for (_, n), s in made.snapped.items() if n == "P" for v in (s.below, s.above)):
        assert np.isclose(loads, 0.98 * end).any()
        assert np.isclose(loads, 1.02 * end).any()
