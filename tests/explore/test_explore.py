"""The explorer's server without a browser: messages, who may talk to it, and the way back to work."""

from __future__ import annotations

import http.client
import json
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import fastmech as fm
from fastmech.cli.explore import opened
from fastmech.cli.run import mechanism_named
from fastmech.errors import InputError
from fastmech.explore.device import Device
from fastmech.explore.messages import frame, read_message
from fastmech.explore.work import replies
from fastmech.interrupts import Cancelled, work_while
from fastmech.models.drawing import drawing
from fastmech.runner import run_request

pytest.importorskip("starlette")
connection = pytest.importorskip("websockets.sync.client")

ROOT = Path(__file__).parents[2]
AXES = {"phi": [-3.0, 3.0], "theta": [-3.0, 3.0]}


def numbers(content: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a frame, read by its description."""
    length = int.from_bytes(content[:4], "little")
    header = json.loads(content[4 : 4 + length])
    arrays = {
        told["name"]: np.frombuffer(
            content, told["type"], int(np.prod(told["shape"])), 4 + length + told["place"]
        ).reshape(told["shape"])
        for told in header["arrays"]
    }
    return header, arrays


@contextmanager
def serving(*what: str, **settings: str) -> Iterator[tuple[str, int]]:
    """The command's server; Ctrl-C ends it."""
    command = [sys.executable, "-m", "fastmech", "explore", "--no-browser", *what]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | settings)
    assert process.stdout is not None
    found = re.search(r"http://([\d.]+):(\d+)/", process.stdout.readline())
    assert found is not None
    yield found[1], int(found[2])
    process.send_signal(signal.SIGINT)
    process.wait(60)
    process.stdout.close()


@pytest.fixture(scope="module")
def server() -> Iterator[tuple[str, int]]:
    with serving() as told:
        yield told


def talk(server: tuple[str, int], origin: str | None = None) -> Any:
    host = f"{server[0]}:{server[1]}"
    return connection.connect(f"ws://{host}/talk", origin=origin or f"http://{host}", max_size=None)


def answer(socket: Any, kind: str, last: str | None = None) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    while True:
        content = socket.recv(timeout=120)
        if isinstance(content, bytes):
            header, arrays = numbers(content)
            if header["kind"] == kind and (last is None or header[last]):
                return header, arrays
        else:
            assert json.loads(content)["kind"] != "error", content


def test_equilibria_of_a_frame_are_those_of_the_library(server: tuple[str, int]) -> None:
    with talk(server) as socket:
        told = {
            "kind": "equilibria",
            "id": 1,
            "parameters": {"alpha": 0.0, "c2": 200.0},
            "axes": AXES,
            "num": 5,
        }
        socket.send(json.dumps(told))
        header, arrays = answer(socket, "equilibria")
    found = fm.find_equilibria(fm.Scene(alpha=0.0, c2=200.0))
    assert [row["position"] for row in header["rows"]] == [list(e.position) for e in found]
    assert header["complete"]
    scene = fm.Scene(alpha=0.0, c2=200.0)
    phi, theta = np.meshgrid(np.linspace(-3, 3, 5), np.linspace(-3, 3, 5))
    l, F = scene.l, scene.F0
    x1, y1 = l * np.cos(phi), l * np.sin(phi)
    x2, y2 = x1 - l * np.sin(theta), y1 - l * np.cos(theta)
    expected = 0.5 * scene.c1 * (x2**2 + y2**2) + 0.5 * scene.c2 * (x1**2 + (y1 - l) ** 2) - F * x2
    expected = expected + scene.g * (scene.m1 * y1 + scene.m2 * y2)
    np.testing.assert_allclose(arrays["landscape"], expected, rtol=1e-5, atol=1e-3)


def test_motion_of_a_frame_is_the_library_s(server: tuple[str, int]) -> None:
    with talk(server) as socket:
        told = {"kind": "motion", "id": 1, "start": {"phi": 1.0}, "t_end": 2.0, "outputs": 21}
        socket.send(json.dumps(told))
        header, arrays = answer(socket, "motion")
    times = np.linspace(0.0, 2.0, 21)
    every, dt = np.linspace(0.0, 2.0, header["outputs"]), header["dt"]
    run = fm.integrate(fm.Scene(), [[1.0, 0.0, 0.0, 0.0]], 2.0, t_eval=every, dt=dt, method="dop853")
    np.testing.assert_array_equal(arrays["curve"], run.y[:, 0].astype(np.float32))
    np.testing.assert_array_equal(arrays["y"], arrays["curve"][:: header["per"]])
    # The arrow's force fades as the load does.
    np.testing.assert_allclose(arrays["forces"][:, 0], 100.0 * np.exp(-0.7 * times), rtol=1e-6)
    np.testing.assert_allclose(np.diff(arrays["loads"][:, 0], axis=1)[:, 0], [[1.0, 0.0]] * 21, atol=1e-6)


def truss(t_end: float, start: dict[str, float], **parameters: float) -> tuple[Any, Any, Any]:
    """A truss's motion of the explorer, and that of its equations by SciPy."""
    told = {"kind": "motion", "id": 1, "start": start, "t_end": t_end, "parameters": parameters}
    told["outputs"] = round(60 * t_end) + 1
    (content,) = replies(opened("von_mises_truss"), read_message(json.dumps(told)))
    values = {"m": 1.0, "k": 1000.0, "b": 0.0} | parameters
    m, k, b = values["m"], values["k"], values["b"]

    def rates(_: float, state: Any) -> list[float]:
        (x, y), v = state[:2], state[2:]
        total = -b * v
        for support in (-1.0, 1.0):
            bar = np.array([x - support, y])
            total = total - k * (np.hypot(*bar) - np.sqrt(1.25)) * bar / np.hypot(*bar)
        return [*v, *total / m]

    y0 = [start.get(name, 0.0) for name in ("x", "y", "x_dot", "y_dot")]
    return *numbers(content), solve_ivp(
        rates, (0.0, t_end), y0, "DOP853", rtol=1e-12, atol=1e-12, dense_output=True
    )


@pytest.mark.parametrize(
    ("t_end", "start", "parameters"),
    [
        (1.0, {"x": 0.159, "y": 0.2778}, {"m": 0.03, "k": 2500.0}),
        (20.0, {"y": 0.3, "y_dot": 5.0}, {"b": 80.0}),
        (1.0, {"x": 0.159, "y": 0.2778}, {"m": 0.03, "k": 2500.0, "b": 1.0}),
    ],
)
def test_steps_outputs_and_works_follow_a_fast_motion(
    t_end: float, start: dict[str, float], parameters: dict[str, float]
) -> None:
    header, arrays, solved = truss(t_end, start, **parameters)
    assert header["status"] == ""
    t = np.linspace(0.0, t_end, header["outputs"])
    curve, expected = arrays["curve"], solved.sol(t).T
    np.testing.assert_allclose(curve, expected, atol=1e-4 * np.abs(expected).max(axis=0).min() + 1e-6)
    # Lines between outputs are the motion.
    middle = 0.5 * (curve[1:] + curve[:-1])
    off = np.abs(middle - solved.sol(0.5 * (t[1:] + t[:-1])).T)
    assert (off <= 0.01 * np.ptp(expected, axis=0) + 1e-6).all()
    # Dampers take what is gone, b v^2 all the time; nothing else takes or brings anything.
    energy = arrays["kinetic"] + arrays["potential"]
    b = parameters.get("b", 0.0)
    power = b * (solved.sol(t)[2:] ** 2).sum(axis=0)
    taken = np.append(0.0, np.cumsum(0.5 * np.diff(t) * (power[1:] + power[:-1])))
    np.testing.assert_allclose(arrays["brought"], 0.0, atol=1e-12)
    np.testing.assert_allclose(arrays["lost"], taken, atol=0.01 * energy[0])
    np.testing.assert_allclose(energy + arrays["lost"], energy[0], rtol=1e-6)


def test_a_motion_that_depends_on_the_step_says_from_when() -> None:
    told = {"kind": "motion", "id": 1, "start": {"upper": 3.0, "lower": 2.0}, "t_end": 30.0, "outputs": 1801}
    device = opened("double_pendulum")
    (content,) = replies(device, read_message(json.dumps(told)))
    header, arrays = numbers(content)
    until = float(re.search(r"part at ([\d.]+) s", header["status"])[1])  # type: ignore[index]
    y0, times = [[3.0, 2.0, 0.0, 0.0]], arrays["times"].astype(float)
    finer = fm.integrate(device.system, y0, 30.0, t_eval=times, dt=header["dt"] / 8, method="dop853").y[:, 0]
    apart = np.abs(finer - arrays["y"]).max(axis=1)
    assert apart[times < until].max() < 0.01
    assert apart[times > until].max() > 0.5


def test_basins_refine_to_the_library_s(server: tuple[str, int]) -> None:
    with talk(server) as socket:
        told = {"kind": "basins", "id": 1, "axes": AXES, "halvings": 1, "parameters": {"alpha": 0.0}}
        socket.send(json.dumps(told))
        known = np.full((51, 51), -2)
        while True:
            header, arrays = answer(socket, "basins")
            assert header["final"] == (header["divisions"] == 50 and header["last"])
            if header["divisions"] == 50:
                known[header["from"] : header["from"] + len(arrays["well"])] = arrays["well"]
                if header["last"]:
                    break
    axes = {name: np.linspace(-3.0, 3.0, 51) for name in AXES}
    found = fm.map_basins(fm.Scene(alpha=0.0), axes, header["t_end"])
    np.testing.assert_array_equal(known, found.well)


def duffing(force: float) -> Device:
    """Two swings about either well, each with a basin of its own."""
    x = fm.lengths("x")
    made = fm.Mechanism(
        x,
        {"F": force, "b": 0.3},
        points={"M": (x, 0)},
        masses={"M": 1.0},
        potential=-(x**2) / 2 + x**4 / 4,
        dampers=[fm.Damper((0, 0), "M", sympy.Symbol("b"))],
        forces=[fm.Force("M", fm.loads.Harmonic(sympy.Symbol("F"), 1.2), (1, 0))],
    )
    return Device(made, "duffing.py:made")


def test_starts_under_a_load_that_repeats_are_labelled_by_attractors() -> None:
    device, ranges = duffing(0.05), {"x": [-1.5, 1.5], "x_dot": [-1.0, 1.0]}
    told = {"kind": "basins", "id": 1, "axes": ranges, "halvings": 0}
    frames = [numbers(one) for one in replies(device, read_message(json.dumps(told)))]
    header = frames[-1][0]
    assert [about["final"] for about, _ in frames] == [False] * (len(frames) - 1) + [True]
    assert len(header["attractors"]) >= 2
    known = np.full((26, 26), -2)
    for about, arrays in frames:
        known[about["from"] : about["from"] + len(arrays["well"])] = arrays["well"]
    axes = {name: np.linspace(*ends, 26) for name, ends in ranges.items()}
    found = fm.map_basins(device.system, axes, header["t_end"])
    names = [one.name for one in found.tree]
    assert {name.split(" at ")[0] for name in names} == {n.split(" at ")[0] for n in header["attractors"]}
    for k, name in enumerate(header["attractors"]):
        place = np.array(re.findall(r"-?[\d.]+(?:e-?\d+)?(?=[,)])", name), dtype=float)
        (same,) = (j for j, one in enumerate(found.tree) if np.allclose(one.points[0], place, atol=1e-3))
        assert np.mean((known == k) == (found.well == same)) > 0.99


def test_arrows_are_the_loads_at_each_time() -> None:
    told = {"kind": "motion", "id": 1, "start": {"x": 0.5}, "t_end": 3.0, "outputs": 31}
    (content,) = replies(duffing(0.2), read_message(json.dumps(told)))
    arrays = numbers(content)[1]
    np.testing.assert_allclose(arrays["forces"][:, 0], 0.2 * np.sin(1.2 * np.linspace(0, 3, 31)), atol=1e-6)
    np.testing.assert_allclose(arrays["loads"][:, 0, 0, 0], arrays["y"][:, 0], atol=1e-6)


@pytest.mark.parametrize("what", [None, "double_pendulum"])
def test_parameters_say_whether_they_can_be_zero_or_negative(what: str | None) -> None:
    told = opened(what).about()["parameters"]
    sure = {"m1": (False, False), "g": (True, what is not None)}
    sure |= {"l1": (False, True)} if what else {"l": (False, False), "F0": (True, True), "c1": (True, False)}
    assert {name: (told[name]["zero"], told[name]["negative"]) for name in sure} == sure


@pytest.mark.parametrize("what", [None, "von_mises_truss"])
def test_an_atlas_is_the_library_s_with_its_curves(what: str | None) -> None:
    device = opened(what)
    ranges = {"P": [0.0, 120.0], "rise": [0.2, 0.8]} if what else {"F0": [-200.0, 200.0], "c2": [0.0, 400.0]}
    parameters = {} if what else {"alpha": 0.0}
    told = {"kind": "atlas", "id": 1, "axes": ranges, "halvings": 0, "parameters": parameters}
    *_, last = replies(device, read_message(json.dumps(told)))
    header, arrays = numbers(last)
    system = device.at(parameters)
    axes = {name: np.linspace(*ends, header["divisions"] + 1) for name, ends in ranges.items()}
    curves: Any = (fm.critical_curves if what else fm.trace_folds)(system, *axes.items())
    np.testing.assert_array_equal(arrays["count"], fm.map_equilibria(system, axes).count)
    assert header["curves"] == [curve.kind for curve in curves.curves]
    assert "fold" in header["curves"]
    np.testing.assert_array_equal(arrays["curve0"][0], curves.curves[0].x.astype(np.float32))


def test_an_atlas_over_what_moves_no_equilibrium_shows_nothing() -> None:
    told = {"kind": "atlas", "id": 1, "axes": {"alpha": [0.0, 2.0], "c2": [1.0, 2.0]}, "halvings": 0}
    with pytest.raises(InputError, match=r"axes\.alpha"):
        next(replies(opened(None), read_message(json.dumps(told))))


def test_newest_wins_and_two_pages_do_not_disturb_each_other(server: tuple[str, int]) -> None:
    big = {"kind": "basins", "axes": AXES, "halvings": 4}
    with talk(server) as one, talk(server) as two:
        two.send(json.dumps({**big, "id": 7, "halvings": 1}))
        for k in range(20):
            one.send(json.dumps({**big, "id": k}))
        one.send(json.dumps({**big, "id": 20, "halvings": 0}))
        assert answer(two, "basins", "final")[0]["id"] == 7
        assert answer(one, "basins", "final")[0]["id"] == 20


@pytest.mark.parametrize("origin", ["http://example.org", "http://127.0.0.1:1", "null"])
def test_other_origins_are_refused(server: tuple[str, int], origin: str) -> None:
    with pytest.raises(Exception, match="403"):
        talk(server, origin)


@pytest.mark.parametrize("host", ["example.org", "127.0.0.1", "localhost:1"])
def test_other_hosts_are_refused(server: tuple[str, int], host: str) -> None:
    asked = http.client.HTTPConnection(*server)
    asked.request("GET", "/", headers={"Host": host})
    assert asked.getresponse().status == 403
    asked.close()


def test_a_policy_forbids_foreign_code(server: tuple[str, int]) -> None:
    asked = http.client.HTTPConnection(*server)
    asked.request("GET", "/")
    got = asked.getresponse()
    assert "script-src 'self';" in got.headers["content-security-policy"]
    assert b"http" not in got.read()
    asked.close()


def wild(random_: random.Random, depth: int = 0) -> Any:
    made = [
        None, True, 0, -1, 1e308, 2**70, "", "equilibria", "phi", "F0", "__class__", "\0", "x" * 50, "../",
        random_.random(), [], {},
    ]  # fmt: skip
    if depth < 3 and random_.random() < 0.4:
        return [wild(random_, depth + 1) for _ in range(random_.randrange(4))]
    if depth < 3 and random_.random() < 0.4:
        keys = ["kind", "id", "axes", "start", "parameters", "phi", "q", "to", "x"]
        return {random_.choice(keys): wild(random_, depth + 1) for _ in range(random_.randrange(5))}
    return random_.choice(made)


def test_ten_thousand_wild_messages_leave_it_running(server: tuple[str, int]) -> None:
    random_ = random.Random(1)
    kinds = ["equilibria", "motion", "basins", "atlas", "pull", "strike", "stop", "x"]
    fields = [
        "axes",
        "start",
        "parameters",
        "fixed",
        "t_end",
        "outputs",
        "num",
        "what",
        "to",
        "q",
        "point",
        "y",
    ]
    with talk(server) as socket:
        for k in range(10_000):
            if k % 10 == 0:
                text: Any = bytes(random_.randrange(256) for _ in range(random_.randrange(1, 60)))
            else:
                message = {"kind": random_.choice(kinds), "id": k}
                message |= {field: wild(random_) for field in random_.sample(fields, 3)}
                text = json.dumps(message)
            socket.send(text)
        lines = 0
        socket.send(json.dumps({"kind": "motion", "id": 99_999, "start": {"phi": 0.5}, "t_end": 1.0}))
        while True:
            content = socket.recv(timeout=120)
            if isinstance(content, bytes) and numbers(content)[0]["id"] == 99_999:
                break
            if isinstance(content, str) and json.loads(content)["kind"] == "error":
                assert "\n" not in json.loads(content)["line"]
                lines += 1
    assert lines > 9_000


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("[]", "must be a JSON object"),
        ('{"kind": "basin"}', "did you mean 'basins'"),
        ('{"kind": "motion", "id": 1, "start": {}, "t_end": -1}', "motion.t_end = -1"),
        ('{"kind": "basins", "id": 1, "axes": {"phi": [1, 0], "theta": [0, 1]}}', "must rise"),
        ('{"kind": "motion", "id": 1, "start": {}, "code": "1"}', "motion.code: unknown name"),
    ],
)
def test_wrong_messages_give_a_line(text: str, line: str) -> None:
    with pytest.raises(InputError, match=re.escape(line)):
        read_message(text)


@pytest.mark.parametrize("what", ["no_such_mechanism", "missing.toml", "missing.py:arm", "missing.h5"])
def test_what_cannot_be_opened_gives_a_line(what: str) -> None:
    with pytest.raises(InputError, match=r"missing|no_such"):
        opened(what)


def test_numbers_travel_as_bytes() -> None:
    values = np.linspace(0.0, 1.0, 250_000).reshape(500, 500)
    content = frame({"kind": "test"}, {"field": values, "codes": np.arange(5, dtype=np.int8)})
    assert len(content) < 4 * values.size + 300
    header, arrays = numbers(content)
    assert header["kind"] == "test"
    np.testing.assert_array_equal(arrays["field"], values.astype(np.float32))
    np.testing.assert_array_equal(arrays["codes"], np.arange(5))


def test_a_pulled_point_follows_and_a_strike_brings_its_energy(server: tuple[str, int]) -> None:
    scene = fm.Scene()
    with talk(server) as socket:
        q = [1.2, 0.3]
        place = [
            scene.l * (np.cos(1.25) - np.sin(0.35)),
            scene.l * (np.sin(1.25) - np.cos(0.35)),
        ]
        socket.send(json.dumps({"kind": "pull", "id": 1, "point": "M2", "to": place, "q": q}))
        state = answer(socket, "pull")[0]["state"]
        assert state["phi"] == pytest.approx(1.25, abs=1e-6)
        assert state["theta"] == pytest.approx(0.35, abs=1e-6)
        blow = {"kind": "strike", "point": "M2", "mass": scene.m2, "velocity": [0.5, -0.2], "q": q}
        socket.send(json.dumps({**blow, "id": 2, "rates": [0.0, 0.0]}))
        told = answer(socket, "strike")[0]
        socket.send(json.dumps({**blow, "id": 3, "rates": [0.7, -1.1]}))
        moving = answer(socket, "strike")[0]
    y = np.array([told["state"][name] for name in ("phi", "theta", "phi_dot", "theta_dot")])
    mechanism = fm.mechanisms.slider_pendulum()
    energies = mechanism.energies(y)
    assert told["energy"] == pytest.approx(float(energies.kinetic), rel=1e-12)
    # In motion the blow is added to the rates that are there.
    after = np.array([moving["state"][name] for name in ("phi", "theta", "phi_dot", "theta_dot")])
    np.testing.assert_allclose(after[2:], y[2:] + np.array([0.7, -1.1]), rtol=1e-12)
    before = np.array([*q, 0.7, -1.1])
    gained = mechanism.energies(after).kinetic - mechanism.energies(before).kinetic
    assert moving["energy"] == pytest.approx(float(gained), rel=1e-9)
    assert told["energy"] < 0.5 * scene.m2 * (
        0.5**2 + 0.2**2
    )  # rods hold back a part of what a free mass takes


@pytest.mark.parametrize("alpha", [0.0, 0.7])
def test_works_are_what_the_energy_changes_by(alpha: float) -> None:
    told = {"kind": "motion", "id": 1, "start": {"phi": 1.0, "theta_dot": 2.0}, "t_end": 5.0, "outputs": 3001}
    (content,) = replies(opened(None), read_message(json.dumps({**told, "parameters": {"alpha": alpha}})))
    _, arrays = numbers(content)
    energy = arrays["kinetic"].astype(float) + arrays["potential"]
    balance = energy - energy[0] - (arrays["brought"] - arrays["lost"])
    assert np.abs(balance).max() < 1e-4 * np.ptp(energy)
    assert np.all(np.diff(arrays["lost"]) >= 0.0)
    # The force's work on M2 by its own path.
    scene, t, (phi, theta, *_) = fm.Scene(alpha=alpha), arrays["curve_times"], arrays["curve"].T.astype(float)
    x2 = scene.l * (np.cos(phi) - np.sin(theta))
    force = scene.F0 * np.exp(-alpha * t)
    work = np.append(0.0, np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(x2)))
    np.testing.assert_allclose(arrays["brought"], work, atol=1e-3 * np.abs(work).max())


@pytest.mark.parametrize("kind", ["motion", "basins", "atlas"])
def test_work_that_is_not_wanted_ends_between_calls_of_kernels(kind: str) -> None:
    device = opened(None)
    told: dict[str, Any] = {"kind": kind, "id": 1, "parameters": {"alpha": 0.0}}
    if kind == "motion":
        told |= {"start": {"phi": 1.0}, "t_end": 300.0}
    else:
        told["axes"] = AXES if kind == "basins" else {"F0": [-200.0, 200.0], "c2": [1.0, 400.0]}
    message = read_message(json.dumps(told))
    begun = time.perf_counter()
    list(replies(device, message))
    begun = time.perf_counter()
    list(replies(device, message))
    whole = time.perf_counter() - begun
    late = list[float]()
    for share in (0.1, 0.3, 0.5):
        unwanted, ended = threading.Event(), list[float]()

        def work(unwanted: threading.Event = unwanted, ended: list[float] = ended) -> None:
            work_while(lambda: not unwanted.is_set())
            try:
                list(replies(device, message))
            except Cancelled:
                ended.append(time.perf_counter())

        thread = threading.Thread(target=work)
        thread.start()
        time.sleep(share * whole)
        unwanted.set()
        asked = time.perf_counter()
        thread.join()
        late += [end - asked for end in ended]
    print(f"\n{kind}: ends after {1e3 * np.median(late):.0f} ms (median of {len(late)}), whole {whole:.2f} s")
    assert late


def test_a_closed_page_s_work_ends() -> None:
    from fastmech.explore.serve import Page

    sent = list[str | bytes]()
    page = Page(opened(None), sent.append)
    told = {"kind": "basins", "id": 1, "parameters": {"alpha": 0.0}, "axes": AXES, "halvings": 4}
    before = set(threading.enumerate())
    page.take(json.dumps(told))
    (working,) = set(threading.enumerate()) - before
    while not sent:
        time.sleep(0.01)
    page.close()
    working.join(5.0)
    assert not working.is_alive()
    assert not any(numbers(content)[0]["final"] for content in sent if isinstance(content, bytes))


def test_whatever_goes_wrong_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    from fastmech.explore import serve

    def broken(*_: object) -> Iterator[bytes]:
        raise FloatingPointError("in a kernel")
        yield b""

    monkeypatch.setattr(serve, "replies", broken)
    sent = list[str | bytes]()
    page = serve.Page(opened(None), sent.append)
    for count in (1, 2):  # it goes on
        page.take(json.dumps({"kind": "motion", "id": 7, "start": {"phi": 1.0}, "t_end": 1.0}))
        end = time.monotonic() + 60.0
        while len(sent) < count and time.monotonic() < end:
            time.sleep(0.01)
    line = {"kind": "error", "line": "FloatingPointError: in a kernel", "of": "motion", "id": 7}
    assert [json.loads(text) for text in sent] == [line] * 2


@pytest.mark.parametrize("kind", ["motion", "basins", "atlas"])
def test_kernels_that_are_made_are_told_with_their_number_and_view(kind: str) -> None:
    asked: dict[str, Any] = {"kind": kind, "id": 1, "parameters": {"alpha": 0.0}}
    if kind == "motion":
        asked |= {"start": {"phi": 1.0}, "t_end": 1.0}
    else:
        asked |= {"axes": AXES if kind == "basins" else {"c1": [1.0, 9.0], "c2": [1.0, 9.0]}, "halvings": 0}
    with serving() as server, talk(server) as socket:
        socket.send(json.dumps(asked))
        told = list[dict[str, Any]]()
        while True:
            content = socket.recv(timeout=120)
            if isinstance(content, bytes):
                break
            told += [json.loads(content)]
    kernels = [one for one in told if one["kind"] == "compiling" and one["name"]]
    assert kernels
    assert all(one["of"] == [kind] for one in kernels)  # threads that a view starts have other names
    assert [one["number"] for one in kernels] == list(range(1, len(kernels) + 1))
    assert all(one["number"] <= one["about"] for one in kernels)


def test_pictures_of_a_result_file_are_gone_with_the_server(tmp_path: Path) -> None:
    (tmp_path / "r.toml").write_text('[scan.rest]\nkind = "equilibria"\n')
    run_request(tmp_path / "r.toml", tmp_path / "r.h5")
    (tmp_path / "made").mkdir()
    with serving(str(tmp_path / "r.h5"), TMPDIR=str(tmp_path / "made")) as (host, port):
        asked = http.client.HTTPConnection(host, port)
        asked.request("GET", "/sections")
        assert [one["name"] for one in json.loads(asked.getresponse().read())] == ["rest"]
        asked.request("GET", "/sections/0")
        assert json.loads(asked.getresponse().read())["pictures"]
        asked.request("GET", "/sections/1")
        assert "has no section 1" in json.loads(asked.getresponse().read())["error"]
        asked.close()
        assert list((tmp_path / "made").glob("fastmech-explore-*"))
    assert not list((tmp_path / "made").glob("fastmech-explore-*"))


@pytest.mark.parametrize("what", ["double_pendulum", "ziegler_column", None])
def test_angles_of_a_drawing_are_the_coordinates(what: str | None) -> None:
    device = opened(what)
    q = np.random.default_rng(3).uniform(-0.7, 0.7, (5, 2))
    drawn = drawing(device.mechanism({}, still=True), q)
    assert sorted(angle.coordinate for angle in drawn.angles) == [0, 1]
    for rod, end, k, sign, origin in drawn.angles:
        away = drawn.ends[:, rod, 1 - end] - drawn.ends[:, rod, end]
        direction = np.arctan2(away[:, 1], away[:, 0])
        np.testing.assert_allclose(np.exp(1j * direction), np.exp(1j * (origin + sign * q[:, k])), atol=1e-9)


def test_a_section_without_a_picture_says_so_and_leaves_the_others(tmp_path: Path) -> None:
    from fastmech.explore.serve import _section, _sections

    path = ROOT / "data" / "small.h5"
    names = [one["name"] for one in _sections(path)]
    snap, rest = (_section(path, tmp_path, names.index(name)) for name in ("snap", "equilibria"))
    assert "nothing is drawn" in snap["line"]
    assert not snap["pictures"]
    with fm.open_results(path) as results:
        phi = results["snap"]["phi"].data
    shown = {name: (unit, values) for name, unit, values, _ in snap["numbers"]}
    assert shown["phi"] == ("rad", f"{phi[0]:.6g}")
    assert "does not end at any load" in shown["sentence"][1]
    assert rest["pictures"]
    assert not rest["line"]
    assert not rest["numbers"]


def test_a_file_with_tolerances_is_explored_at_its_values(tmp_path: Path) -> None:
    (tmp_path / "d.toml").write_text("[scene]\nc1 = { value = 300.0, plus_minus = 15.0 }\nalpha = 0.0\n")
    assert opened(str(tmp_path / "d.toml")).about()["parameters"]["c1"]["value"] == 300.0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("c2 = 200.0", "c2: unknown name"),
        ("[sceen]", "did you mean 'scene'"),
        ("scene = 3", "scene = 3: must be a table"),
    ],
)
def test_a_file_is_checked_as_every_request(tmp_path: Path, text: str, line: str) -> None:
    (tmp_path / "d.toml").write_text(text)
    with pytest.raises(InputError, match=re.escape(line)):
        opened(str(tmp_path / "d.toml"))


def test_a_request_of_another_mechanism_is_not_shown_as_the_paper_s(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT / "scans" / "systems")
    for file, scan in (("duffing.toml", "basins"), ("driven_slider.toml", "response")):
        with pytest.raises(InputError, match=rf"^{file}: scan\.{scan}.* --mechanism FILE\.py:NAME$"):
            opened(file)
    with pytest.raises(InputError, match=r"^duffing\.toml: scan\.basins.*x"):
        opened("duffing.toml", "driven_slider.py:mechanism")
    assert opened("driven_slider.toml", "driven_slider.py:mechanism").name
    assert opened("../paper.toml").is_scene


OWN = """import fastmech as fm, sympy

def arm():
    q, k, b = fm.angles("q"), sympy.Symbol("k"), sympy.Symbol("b")
    parts = {"points": {"M": (sympy.cos(q), sympy.sin(q))}, "masses": {"M": 1.0}}
    return fm.Mechanism(q, {"k": 50.0, "b": 0.3}, potential=k * sympy.cos(2 * q) + sympy.sin(q), **parts,
                        dampers=[fm.Damper((0, 2), "M", b)])

other = fm.mechanisms.double_pendulum()
"""


@pytest.mark.parametrize("values", ["", "k = 60.0\n"])
def test_a_result_of_one_s_own_mechanism_is_shown_with_it_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, values: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(OWN)
    Path("r.toml").write_text(f'[scene]\n{values}[scan.rest]\nkind = "equilibria"\n')
    run_request("r.toml", "r.h5", mechanism=mechanism_named("mine.py:arm"))
    for wrong in (None, "mine.py:other"):
        with pytest.raises(InputError, match=r"r\.h5: is of another mechanism; .* --mechanism FILE\.py:NAME"):
            opened("r.h5", wrong)
    for what in ("r.h5", "r.toml"):
        told = opened(what, "mine.py:arm").about()
        assert told["parameters"]["k"]["value"] == (60.0 if values else 50.0)
        assert told["source"] == f"{tmp_path.resolve()}/mine.py:arm"  # its lines work in every folder
    with pytest.raises(InputError, match="another one is given"):
        opened("double_pendulum", "mine.py:arm")


@pytest.mark.parametrize(("what", "zero"), [("double_pendulum", "g"), ("cart_pendulum", "k")])
def test_where_no_equilibrium_is_proved_the_page_is_told_why(what: str, zero: str) -> None:
    device = opened(what)
    ranges = {name: [-3.0, 3.0] for name in device.coordinates}
    told = {"kind": "equilibria", "id": 1, "axes": ranges, "parameters": {zero: 0.0}}
    (content,) = replies(device, read_message(json.dumps(told)))
    header, arrays = numbers(content)
    found: Any = fm.find_equilibria(device.at({zero: 0.0}))
    assert header["rows"] == []
    assert header["certificate"] == found.certificate.sentence
    assert "not decided" in header["certificate"]
    assert not header["complete"]
    assert len(arrays["ends"]) == 1  # drawn at zero


def test_a_mechanism_of_energies_has_equilibria_and_starts_that_leave_its_range() -> None:
    x, (k, b) = fm.lengths("x", -2, 2), sympy.symbols("k b")
    energies = {"kinetic": x.dot**2 / 2, "potential": k * (-(x**2) / 2 + x**4 / 4)}
    made = fm.Mechanism(x, {"k": 1.0, "b": 0.2}, **energies, dissipation=b * x.dot**2 / 2)
    device, axes = Device(made, "own.py:made"), {"x": [-1.9, 1.9], "x_dot": [-5.0, 5.0]}
    (content,) = replies(device, read_message(json.dumps({"kind": "equilibria", "id": 1, "axes": axes})))
    header, arrays = numbers(content)
    np.testing.assert_allclose([row["position"] for row in header["rows"]], [[-1.0], [1.0], [0.0]], atol=1e-9)
    assert header["elements"] == []
    assert arrays["landscape"].min() == pytest.approx(-0.25, abs=1e-3)
    told = json.dumps({"kind": "basins", "id": 1, "axes": axes, "halvings": 0})
    *_, last = replies(device, read_message(told))
    header, arrays = numbers(last)
    found = fm.map_basins(
        made, {name: np.linspace(*ends, 26) for name, ends in axes.items()}, header["t_end"]
    )
    np.testing.assert_array_equal(arrays["status"], found.status)
    names = np.array(header["statuses"])[arrays["status"]]
    assert np.count_nonzero(names == "out_of_range") == found.counts["out_of_range"] > 0


def test_an_atlas_says_where_nothing_is_decided() -> None:
    told = {"kind": "atlas", "id": 1, "axes": {"k": [0.0, 20.0], "g": [1.0, 9.0]}, "halvings": 0}
    header, arrays = numbers(next(replies(opened("cart_pendulum"), read_message(json.dumps(told)))))
    assert not header["final"]
    assert not arrays["decided"][0].any()
    assert arrays["decided"][1:].all()


def test_a_kick_beyond_all_numbers_gives_a_line() -> None:
    told = {"kind": "strike", "id": 1, "point": "M2", "mass": 12.0, "velocity": [1e300, 0.0]}
    with pytest.raises(InputError, match=r"strike\.velocity\.0 = 1e\+300"):
        read_message(json.dumps(told | {"q": [0.3, 0.2], "rates": [0.0, 0.0]}))


def test_mechanisms_of_other_parameters_give_what_new_ones_do() -> None:
    device = opened("pendulum_chain_2")
    told = {"kind": "equilibria", "id": 1, "axes": {"q1": [-3.0, 3.0], "q2": [-3.0, 3.0]}}
    message = read_message(json.dumps(told))
    list(replies(device, message))
    name = next(iter(device.system.parameters))
    for value in (2.0, 3.0):
        parameters = {name: value}
        (content,) = replies(device, read_message(json.dumps(told | {"parameters": parameters})))
        (fresh,) = replies(
            opened("pendulum_chain_2"), read_message(json.dumps(told | {"parameters": parameters}))
        )
        assert content == fresh
