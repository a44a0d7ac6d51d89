"""What is released: wheel and sdist hold what they need and work where nothing else of the project is."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Files that are no modules, which the package reads.
DATA = [path for path in (ROOT / "fastmech").rglob("*.*") if path.suffix not in (".py", ".pyc")]


def run(*command: str | Path, cwd: Path) -> str:
    """Output of a command in an environment that does not know the source's folder."""
    own = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(list(map(str, command)), cwd=cwd, env=own, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Wheel and sdist, built from a copy of the sources."""
    folder = tmp_path_factory.mktemp("built")
    shutil.copytree(ROOT / "fastmech", folder / "fastmech", ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    made = "from setuptools import build_meta as b; b.build_sdist('out'); b.build_wheel('out')"
    (folder / "out").mkdir()
    run(sys.executable, "-c", made, cwd=folder)
    return {kind: next((folder / "out").glob(f"*{kind}")) for kind in (".whl", ".tar.gz")}


@pytest.mark.parametrize("kind", [".whl", ".tar.gz"])
def test_it_works_in_an_environment_of_its_own(built: dict[str, Path], kind: str, tmp_path: Path) -> None:
    """The libraries are those of this environment, the package is the one that was built."""
    own = tmp_path / "environment"
    venv.create(own, with_pip=False)
    python = own / "bin/python"
    packages = Path(
        run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=own).strip()
    )
    (packages / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", python]
    run(*pip, "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index", built[kind], cwd=own)
    said = run(python, "-c", "import fastmech; print(fastmech.__file__, fastmech.__version__)", cwd=own)
    assert said.split() == [str(packages / "fastmech/__init__.py"), PROJECT["version"]]
    assert run(own / "bin/fastmech", "--version", cwd=own) == f"fastmech {PROJECT['version']}\n"
    assert "All 4 are proved to exist and to be all" in run(
        own / "bin/fastmech", "equilibria", "--alpha", "0", cwd=own
    )
    assert len(DATA) > 10
    for path in DATA:
        assert (packages / path.relative_to(ROOT)).exists(), path


def test_the_wheel_holds_the_package_alone(built: dict[str, Path]) -> None:
    names = zipfile.ZipFile(built[".whl"]).namelist()
    assert {name.split("/")[0] for name in names} == {"fastmech", f"fastmech-{PROJECT['version']}.dist-info"}


def test_every_place_names_one_version_and_the_same_bounds() -> None:
    texts = {name: (ROOT / name).read_text(encoding="utf-8") for name in ("CHANGELOG.md", "CITATION.cff")}
    assert re.search(r"^## (\S+)", texts["CHANGELOG.md"], re.M)[1] == PROJECT["version"]  # type: ignore[index]
    assert f"version: {PROJECT['version']}\n" in texts["CITATION.cff"]
    recipe = (ROOT / "docs/conda/recipe.yaml").read_text(encoding="utf-8")
    assert f"version: {PROJECT['version']}\n" in recipe
    for needed in PROJECT["dependencies"]:
        name, least = needed.lower().split(">=")
        conda = {"matplotlib": "matplotlib-base"}.get(name, name)
        assert re.search(rf"- {conda} >={least}[,\n]", recipe), needed
