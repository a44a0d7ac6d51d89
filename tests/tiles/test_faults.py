"""The campaigns, short."""

from __future__ import annotations

import os
import random
import subprocess
import sys
from pathlib import Path

import pytest
from faults.fuzz import damaged, fuzz_requests, fuzz_results

from fastmech.errors import InputError
from fastmech.scan_types import scan_kinds
from fastmech.scan_types.request import read_request


@pytest.mark.slow
def test_runs_killed_at_random_moments() -> None:
    """In a process of its own, whose only thread may be forked."""
    command = [sys.executable, "-m", "faults", "--kills", "3", "--disks", "1", "--workers", "0"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(["tests", *filter(None, sys.path)])}
    done = subprocess.run([*command, "--mutations", "0"], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    assert "runs killed" in done.stdout
    assert "full disks told" in done.stdout or "no right to mount" in done.stdout


def test_damaged_requests_are_refused() -> None:
    found = fuzz_requests(400, seed=1)
    assert found.facts["requests"]["tried"] == 400
    assert found.facts["requests"]["refused"] > 100


def test_damaged_results_are_refused_or_have_their_values() -> None:
    found = fuzz_results(150, seed=1)
    assert found.facts["result files"]["tried"] == 150
    assert found.facts["result files"]["refused"] > 100


@pytest.mark.nojit
def test_the_damage_is_damage() -> None:
    rng, data = random.Random(1), bytes(range(256))
    copies = [damaged(data, rng) for _ in range(300)]
    assert sum(copy != data for copy in copies) > 290
    assert len({len(copy) for copy in copies}) > 20


def test_a_nested_request_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text("a = " + "[" * 100_000, encoding="utf-8")
    with pytest.raises(InputError, match=r"deep\.toml: is not valid TOML"):
        read_request(path, scan_kinds())
