"""``fastmech paper`` and ``fastmech bench`` hand over to the package and tell where the result is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest


@dataclass(frozen=True)
class Report:
    as_expected: bool
    paths: tuple[Path, ...] = (Path("there/report.html"), Path("there/report.md"))
    rows: range = range(99)
    misprints: tuple[str, ...] = ("one", "two")


@pytest.mark.parametrize(("as_expected", "code"), [(True, 0), (False, 1)])
def test_paper(invoke, monkeypatch, as_expected, code):
    asked = []

    def write_paper(out, *, stage):
        asked.append(out)
        stage("pictures", 2)(1)
        return Report(as_expected)

    monkeypatch.setattr("fastmech.studies.paper.report.write_paper", write_paper)
    result = invoke("paper", "--out", "there")
    assert asked == [Path("there")]
    assert result.exit_code == code
    assert "Report: there/report.html" in result.stdout
    assert "99 printed values compared, 2 misprints proved" in result.stdout
    assert len(result.stderr.splitlines()) == (0 if as_expected else 1)


@pytest.mark.parametrize("quick", [True, False])
def test_bench(invoke, monkeypatch, quick):
    asked = []

    def run_bench(out, *, quick, stage):
        asked.append((out, quick))
        stage("entrants", 2)(1)
        return [out / "bench.md", out / "bench.png"]

    monkeypatch.setattr("fastmech.studies.bench.report.run_bench", run_bench)
    result = invoke("bench", *(["--quick"] if quick else []))
    assert result.exit_code == 0
    assert asked == [(Path("results/bench"), quick)]
    assert result.stdout.splitlines() == ["results/bench/bench.md", "results/bench/bench.png"]
    assert result.stderr == ""


def test_one_study_of_the_bench(invoke, monkeypatch):
    asked = []

    def study(quick, stage):
        asked.append(quick)
        return ["# told", ""]

    monkeypatch.setattr("fastmech.studies.bench.report.STUDIES", {"tolerances": study})
    result = invoke("bench", "--only", "tolerances")
    assert result.exit_code == 0
    assert invoke("bench", "--only", "tolerances", "--quick").exit_code == 0
    assert asked == [False, True]
    assert Path("results/bench/tolerances.md").read_text(encoding="utf-8") == "# told\n"
    assert result.stdout.splitlines() == ["results/bench/tolerances.md"]


def test_bench_on_a_problem_of_one_s_own(invoke, monkeypatch):
    def run_problem(where, out, stage):
        assert where == "mine.py:name"
        return ["a table"], [out / "problem.md"]

    monkeypatch.setattr("fastmech.studies.bench.own_problem.run_problem", run_problem)
    result = invoke("bench", "--problem", "mine.py:name")
    assert result.exit_code == 0
    assert result.stdout.splitlines() == ["a table", "", "results/bench/problem.md"]


@pytest.mark.parametrize(
    "args", [("--problem", "none.py:x"), ("--problem", "x"), ("--problem", "x.toml", "--quick")]
)
def test_no_problem_of_one_s_own(invoke, args):
    result = invoke("bench", *args)
    assert result.exit_code == 2
    assert len(result.stderr.splitlines()) == 1
