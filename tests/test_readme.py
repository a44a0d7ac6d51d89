"""The README holds what it says: links lead somewhere, commands exist, examples run as written."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
from click.testing import CliRunner

from fastmech.cli import COMMANDS, main

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)
REQUESTS = re.findall(r"^```toml\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)

#: The sections of scans/paper.toml that examples read, with fewer points.
PAPER = """
[scan.motion]
kind = "motion"
t_end = 1.0
outputs = 11

[scan.map_F0_c1]
kind = "equilibrium_map"
scene = { alpha = 0.0 }
axes.F0 = { start = -500.0, stop = 500.0, num = 11 }
axes.c1 = { start = 0.0, stop = 400.0, num = 11 }
"""


def anchor(heading: str) -> str:
    """The anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def run(request: str, folder: Path, name: str) -> None:
    (folder / f"{name}.toml").write_text(request, encoding="utf-8")
    result = CliRunner().invoke(main, ["run", f"{name}.toml", "--out", f"results/{name}.h5"])
    assert result.exit_code == 0, result.output


@pytest.mark.nojit
def test_links_and_anchors_lead_somewhere() -> None:
    anchors = {anchor(heading) for heading in re.findall(r"^##+ (.+)$", TEXT, re.MULTILINE)}
    links = re.findall(r"\]\(([^)]+)\)", TEXT)
    assert len(links) > 20
    for link in links:
        if link.startswith("#"):
            assert link[1:] in anchors, link
        elif not link.startswith("http"):
            assert (ROOT / link).exists(), link


@pytest.mark.nojit
def test_what_commands_name_exists() -> None:
    for name in re.findall(r"(?:^ {4}|`)fastmech ([a-z]+)", TEXT, re.MULTILINE):
        assert name in COMMANDS, name
    paths = re.findall(r"\b(?:tests|scans|data)/[\w/]+(?:\.py|\.toml|\.png|\.h5)?\b", TEXT)
    assert len(paths) > 40
    for path in paths:
        assert (ROOT / path).exists(), path
    assert {name for name in COMMANDS if f"`fastmech {name}" not in TEXT} == set()


@pytest.mark.parametrize("number", range(len(EXAMPLES)))
def test_examples_run(number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    if "results/" in EXAMPLES[number]:
        run(PAPER, tmp_path, "paper")
    script = tmp_path / "example.py"
    script.write_text(EXAMPLES[number], encoding="utf-8")
    runpy.run_path(str(script))


def test_the_request_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (request,) = REQUESTS
    run(request, tmp_path, "mine")
