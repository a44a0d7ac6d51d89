"""``fastmech equilibria``: the paper's Table 2 on the screen, and wrong scenes."""

from __future__ import annotations

from pathlib import Path

from cli.refusal import assert_refused

PAPER = ["--c2", "366.6666666666667", "--alpha", "0"]

# Table 2 of the paper, rad.
TABLE_2 = [
    ("1.45058", "-0.23257"),
    ("0.68803", "-2.91483"),
    ("-1.35581", "-2.52980"),
    ("-2.44693", "1.52262"),
]


def test_paper_scene(invoke):
    result = invoke("equilibria", *PAPER)
    assert result.exit_code == 0
    assert result.stderr == ""
    rows = [line.split() for line in result.stdout.splitlines()]
    assert {(row[1], row[2]) for row in rows if len(row) > 5} >= set(TABLE_2)
    for fragment in (
        "force F = 100 N",
        "asymptotically",
        "unstable",
        "minimum",
        "saddle",
        "maximum",
        "All 4 ",
    ):
        assert fragment in result.stdout
    assert max(map(len, result.stdout.splitlines())) <= 100


def test_decaying_force_is_frozen_at_a_time(invoke):
    assert "force F = 0 N" in invoke("equilibria").stdout
    assert "force F = 100 N" in invoke("equilibria", "--at", "0").stdout
    # 100 N exp(-0.7) = 49.6585 N
    assert "force F = 49.6585 N" in invoke("equilibria", "--at", "1").stdout


def test_scene_of_a_file_with_changes(invoke):
    Path("scene.toml").write_text("[scene]\nF0 = 20.0\nalpha = 0.0\n", encoding="utf-8")
    assert "force F = 20 N" in invoke("equilibria", "scene.toml").stdout
    Path("device.toml").write_text("[scene]\nF0 = { value = 20.0, plus_minus = 1.0 }\nalpha = 0.0\n")
    assert "force F = 20 N" in invoke("equilibria", "device.toml").stdout
    assert "force F = -30 N" in invoke("equilibria", "scene.toml", "--F0", "-30").stdout


def test_how_hard_each_stable_position_may_be_struck(invoke):
    """Upright: sqrt(2 m depth) with m2 = 12 kg and m1 + m3 = 18 kg, depth 2 (m2 g l + c1 l^2) = 802.012 J."""
    text = " ".join(invoke("equilibria").stdout.split())
    limits = "less than 169.9 N s on M1, 138.7 N s on M2, 169.9 N s on M3."
    assert f"0: no blow at rest leaves its well with {limits}" in text
    assert text.count("no blow at rest") == 1


def test_the_load_at_which_each_position_disappears(invoke):
    bistable = ["--alpha", "0", "--F0", "85.3", "--c1", "294.9", "--c2", "92.85"]
    # The folds of data/folds.toml.
    text = " ".join(invoke("equilibria", *bistable).stdout.split())
    assert "0: as the load F0 changes, it disappears below -671.163 N (searched from -745.623" in text
    assert "1: as the load F0 changes, it disappears above 671.163 N (searched from -745.623" in text
    assert text.count("disappears") == 2
    for at in ([], ["--at", "0"]):
        text = " ".join(invoke("equilibria", *at).stdout.split())
        assert (
            text.count("does not end at any load (searched from -411.312 to 411.312 N; no end lies beyond")
            == 1
        )


def test_how_another_parameter_may_change(invoke):
    symmetric = ["--alpha", "0", "--F0", "0", "--c1", "20", "--c2", "92.85"]
    result = invoke("equilibria", *symmetric, "--vary", "c1", "--position", "-1.57", "0")
    text = " ".join(result.stdout.split())
    assert "0: as c1 changes, it turns unstable above 43.1747 N/m (searched from 0 to 526.698 N/m; no" in text
    refused = invoke("equilibria", *symmetric, "--vary", "beta")
    assert (refused.exit_code, refused.stderr.count("\n")) == (2, 1)
    assert "parameter = 'beta': must be one that moves equilibria" in refused.stderr


def test_no_isolated_equilibria(invoke):
    result = invoke("equilibria", "--c1", "0", "--F0", "0", "--g", "0")
    assert result.exit_code == 0
    assert "not isolated" in result.stdout


def test_bad_scene_is_one_line(invoke):
    assert_refused(invoke("equilibria", "--m1", "0"), "scene.m1 = 0.0")
    assert_refused(invoke("equilibria", "--m1", "nan"), "scene.m1 = nan")
    assert_refused(invoke("equilibria", "--at", "-1"), "--at", "-1")
    assert_refused(invoke("equilibria", "none.toml"), "none.toml")
    Path("column.toml").write_text("[scene]\nk1 = 14.0\n", encoding="utf-8")
    assert_refused(invoke("equilibria", "column.toml"), "scene.k1: unknown name", "fastmech run, kind =")
    Path("empty.toml").write_text("", encoding="utf-8")
    assert_refused(invoke("equilibria", "empty.toml"), "[scene]")
