"""README and documentation hold what they say: links lead somewhere, commands exist, examples run."""

from __future__ import annotations

import importlib.util
import re
import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from fastmech.cli import COMMANDS, main

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("[a-z]*.md"))]
PAGES = [page for page in PAGES if not {"made", "_build"} & {*page.relative_to(ROOT).parts}]
TEXTS = {str(page.relative_to(ROOT)): page.read_text(encoding="utf-8") for page in PAGES}
TEXT = TEXTS["README.md"]


def blocks(kind: str) -> list[tuple[str, int, str]]:
    """Page, number and text of every block of code of a kind."""
    found = {name: re.findall(rf"^```{kind}\n(.*?)^```", text, re.M | re.S) for name, text in TEXTS.items()}
    return [(name, k, block) for name, each in found.items() for k, block in enumerate(each)]


EXAMPLES, REQUESTS = blocks("python"), blocks("toml")

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


@pytest.mark.parametrize("name", TEXTS)
def test_links_and_anchors_lead_somewhere(name: str) -> None:
    folder = (ROOT / name).parent
    for link in re.findall(r"\]\(([^)]+)\)", TEXTS[name]):
        where, _, place = link.partition("#")
        if link.startswith("http"):
            continue
        target = folder / where if where else ROOT / name
        assert target.exists(), link
        if place:
            headings = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert place in {anchor(heading) for heading in headings}, link


def test_what_commands_name_exists() -> None:
    text = "\n".join(TEXTS.values())
    for name in re.findall(r"(?:^ {4}|`|^)fastmech ([a-z]+)", text, re.MULTILINE):
        assert name in COMMANDS or name == "answers", name
    paths = re.findall(r"\b(?:tests|scans|data)/[\w/]+(?:\.py|\.toml|\.png|\.h5)?\b", text)
    assert len(paths) > 40
    for path in paths:
        assert (ROOT / path).exists(), path
    assert {name for name in COMMANDS if f"`fastmech {name}" not in TEXT} == set()


def test_every_shipped_request_has_its_picture() -> None:
    pictures = {path.stem for path in (ROOT / "docs/pictures/gallery").glob("*.png")}
    assert pictures == {path.stem for path in (ROOT / "scans").rglob("*.toml")}


def test_the_readme_is_short_draws_and_cites() -> None:
    assert len(TEXT.splitlines()) <= 150
    code = next(block for page, _, block in EXAMPLES if page == "README.md")
    assert ".decay_time" in code
    assert ".plot()" in code.splitlines()[-1]
    paper = "Behaviour, examination and stability of the constrained mechanical system described with"
    for text in (TEXT, TEXTS["docs/mechanism.md"], (ROOT / "CITATION.cff").read_text(encoding="utf-8")):
        assert paper in " ".join(text.split())


@pytest.mark.parametrize(("page", "number", "code"), EXAMPLES, ids=[f"{p}-{k}" for p, k, _ in EXAMPLES])
def test_examples_run(
    page: str, number: int, code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if "results/" in code:
        run(PAPER, tmp_path, "paper")
    if "mine.toml" in code:
        (tmp_path / "mine.toml").write_text(REQUESTS[0][2], encoding="utf-8")
    script = tmp_path / "example.py"
    script.write_text(code, encoding="utf-8")
    runpy.run_path(str(script))


@pytest.mark.parametrize(("page", "number", "request_text"), REQUESTS, ids=[p for p, _, _ in REQUESTS])
def test_requests_run(
    page: str, number: int, request_text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run(request_text, tmp_path, "mine")


@pytest.mark.skipif(importlib.util.find_spec("sphinx") is None, reason="Sphinx is not installed")
def test_the_documentation_builds_without_a_warning(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(tmp_path / "trees")]
    built = subprocess.run(
        [*command, str(ROOT / "docs"), str(tmp_path / "pages")], capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    for page in (tmp_path / "pages").rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"<(?:script|link)[^>]+(?:src|href)=\"https?:", text), page  # no network
