from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastmech.errors import InputError
from fastmech.scene import Scene, nearest, read_toml

pytestmark = pytest.mark.nojit

#: Table 1 of the paper as printed; g is the standard gravity (ISO 80000-3).
TABLE_1 = {
    "m1": 10.0,
    "m2": 12.0,
    "m3": 8.0,
    "l": 1.25,
    "c1": 162.5,
    "c2": 366.67,
    "beta": 121.0,
    "g": 9.80665,
    "F0": 100.0,
    "alpha": 0.7,
}
POSITIVE = ("m1", "m2", "l")
NOT_NEGATIVE = ("m3", "c1", "c2", "beta", "g", "alpha")


def refused(start: str, allowed: str, **parameters: Any) -> None:
    """One line: field and value, then what is allowed."""
    with pytest.raises(InputError, match=f"^{re.escape(start)}: .*{re.escape(allowed)}") as error:
        Scene(**parameters)
    assert "\n" not in str(error.value)


def test_defaults_are_table_1() -> None:
    assert Scene().parameters == TABLE_1


def test_every_parameter_has_a_unit_and_a_description() -> None:
    described = Scene(m1=3.0).described()
    assert {name: value for name, (value, _, _) in described.items()} == TABLE_1 | {"m1": 3.0}
    assert {name: unit for name, (_, unit, _) in described.items()} == {
        "m1": "kg",
        "m2": "kg",
        "m3": "kg",
        "l": "m",
        "c1": "N/m",
        "c2": "N/m",
        "beta": "N s/m",
        "g": "m/s2",
        "F0": "N",
        "alpha": "1/s",
    }
    assert all(text for _, _, text in described.values())


@pytest.mark.parametrize("name", POSITIVE)
@pytest.mark.parametrize("value", [0.0, -3.0, -5e-324])
def test_what_must_be_positive(name: str, value: float) -> None:
    refused(f"scene.{name} = {value!r}", "greater than 0", **{name: value})
    assert getattr(Scene(**{name: 1e-30}), name) == 1e-30
    with pytest.raises(InputError, match=rf"^scene\.{name} = 9e-31: must not be less than 1e-30$"):
        Scene(**{name: 9e-31})


@pytest.mark.parametrize("name", NOT_NEGATIVE)
def test_what_must_not_be_negative(name: str) -> None:
    refused(f"scene.{name} = -1.0", "greater than or equal to 0", **{name: -1.0})
    assert getattr(Scene(**{name: 0.0}), name) == 0.0


def test_the_force_may_have_either_sign() -> None:
    assert [Scene(F0=F0).F0 for F0 in (-100.0, 0.0, 100.0)] == [-100.0, 0.0, 100.0]


@pytest.mark.parametrize("name", TABLE_1)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, np.float64("nan"), np.float32("inf")])
def test_numbers_must_be_finite(name: str, value: float) -> None:
    refused(f"scene.{name} = {float(value)!r}", "finite number", **{name: value})


@pytest.mark.parametrize("name", TABLE_1)
@pytest.mark.parametrize(
    "value",
    [True, False, "10", "ten", None, [1.0], (1.0,), {"kg": 1}, 1j, np.bool_(True), np.array([1.0, 2.0])],
)
def test_numbers_must_be_numbers(name: str, value: Any) -> None:
    shown = value.item() if isinstance(value, np.bool_) else value
    refused(f"scene.{name} = {shown!r}", "number", **{name: value})


@pytest.mark.parametrize("value", [7, np.float64(7.0), np.float32(7.0), np.int64(7), np.uint8(7)])
def test_numbers_of_any_kind_become_floats(value: Any) -> None:
    scene = Scene(m1=value)
    assert type(scene.m1) is float
    assert scene.m1 == 7.0
    assert scene == Scene(m1=7.0)


@pytest.mark.parametrize(
    ("name", "hint"),
    [("betta", "beta"), ("aplha", "alpha"), ("M1", "m1"), ("f0", "F0")],
)
def test_unknown_name_hints_at_the_nearest(name: str, hint: str) -> None:
    with pytest.raises(InputError, match=rf"^scene\.{name}: unknown name; did you mean '{hint}'\?$"):
        Scene(**{name: 1.0})


def test_unknown_name_hints_at_all_that_are_as_near_and_begin_alike() -> None:
    refused("scene.c3", "unknown name; did you mean 'c1' or 'c2'?", c3=1.0)
    refused("scene.m4", "unknown name; did you mean 'm1' or 'm2' or 'm3'?", m4=1.0)


def test_a_file_s_tolerances_are_left_out_of_its_scene(tmp_path: Path) -> None:
    text = "[scene]\nm1 = { value = 3.0, plus_minus = 0.5 }\nF0 = -20.5\n"
    assert Scene.from_toml(toml(tmp_path, text)) == Scene(m1=3.0, F0=-20.5)


def test_unknown_name_without_a_near_one_lists_all() -> None:
    refused("scene.stiffness", f"unknown name; allowed: {', '.join(TABLE_1)}", stiffness=1.0)
    assert nearest("zzz", ["a", "b"]) == "allowed: a, b"


def test_the_first_of_several_mistakes_is_named() -> None:
    refused("scene.m1 = -1.0", "greater than 0", m2="x", m1=-1.0)


def test_frozen() -> None:
    scene = Scene()
    with pytest.raises(InputError, match=r"^scene\.m1: .*write scene = scene\.replace\(m1=2\.0\)$"):
        scene.m1 = 2.0  # type: ignore[misc]
    with pytest.raises(InputError, match=r"^scene\.M1: unknown name; did you mean 'm1'\?$"):
        scene.M1 = 2.0  # type: ignore[attr-defined]
    assert scene.m1 == 10.0


@pytest.mark.parametrize(
    "wrong",
    [{"m1": "x" * 3_000_000}, {"m1": [0.0] * 1_000_000}, {"m1": 10**5000}, {"x" * 3_000_000: 1.0}],
    ids=["text", "list", "integer", "name"],
)
def test_huge_values_are_shown_short(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError) as error:
        Scene(**wrong)
    assert len(str(error.value)) < 250


def test_replace_validates_and_leaves_the_original() -> None:
    scene = Scene(F0=50.0)
    changed = scene.replace(m1=1, alpha=0.0)
    assert changed.parameters == TABLE_1 | {"F0": 50.0, "m1": 1.0, "alpha": 0.0}
    assert scene.parameters == TABLE_1 | {"F0": 50.0}
    assert scene.replace() == scene
    for change, message in (
        ({"m1": -3.0}, "scene.m1 = -3.0: "),
        ({"alpa": 0.0}, "scene.alpa: unknown name; did you mean 'alpha'?"),
        ({"C1": 900.0}, "scene.C1: unknown name; did you mean 'c1'?"),
        ({"c1": "900 N/m"}, "scene.c1 = '900 N/m': must be a number in N/m"),
    ):
        with pytest.raises(InputError, match=f"^{re.escape(message)}"):
            scene.replace(**change)


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ("{ value = 3.0, plusminus = 1.0 }", "scene.c1.plusminus: unknown name; did you mean 'plus_minus'?"),
        ("{ value = 3.0 }", "scene.c1.plus_minus: missing"),
        ("{ plus_minus = 1.0 }", "scene.c1.value: missing"),
    ],
)
def test_wrong_tolerances_name_their_keys(entry: str, line: str, tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(f"[scene]\nc1 = {entry}\n", encoding="utf-8")
    with pytest.raises(InputError, match=f"^{re.escape(line)}$"):
        Scene.from_toml(tmp_path / "scene.toml")


def test_only_near_names_are_suggested() -> None:
    known = list(Scene().parameters)
    assert nearest("phi", known).startswith("allowed: ")
    assert nearest("alph", known) == nearest("lpha", known) == "did you mean 'alpha'?"


def test_equal_scenes_are_equal_and_hash_alike() -> None:
    scenes = {Scene(), Scene(m1=10), Scene(m1=np.float64(10.0)), Scene(m1=11.0)}
    assert len(scenes) == 2
    assert Scene() != Scene(alpha=0.0)
    assert hash(Scene()) == hash(Scene().replace(g=9.80665))


def toml(folder: Path, text: str) -> Path:
    path = folder / "scan.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_from_toml(tmp_path: Path) -> None:
    path = toml(tmp_path, 'title = "x"\n[scene]\nm1 = 3\nF0 = -20.5\n[run]\nn = 1\n')
    for given_path in (path, str(path)):
        assert Scene.from_toml(given_path) == Scene(m1=3.0, F0=-20.5)
    assert Scene.from_toml(toml(tmp_path, "[scene]\n")) == Scene()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[other]\nm1 = 1\n", "{path}: has no table [scene]"),
        ("scene = 3\n", "{path}: has no table [scene]"),
        ("[scene]\nm1 = 0\n", "scene.m1 = 0: "),
        ("[scene]\nm1 = true\n", "scene.m1 = True: "),
        ("[scene]\nm1 = nan\n", "scene.m1 = nan: "),
        ('[scene]\nm1 = "10 kg"\n', "scene.m1 = '10 kg': "),
        ("[scene]\nmass = 1\n", "scene.mass: unknown name; "),
        ("[scene\n", "{path}: is not valid TOML: "),
        ("[scene]\nm1 = 1\nm1 = 2\n", "{path}: is not valid TOML: "),
        (f"[scene]\nm1 = {'9' * 5000}\n", "{path}: is not valid TOML: an integer has more than 4,300 digits"),
        (f"[scene]\nm1 = 0x{'f' * 5000}\n", "scene.m1 = an integer of 20,000 bits: "),
    ],
)
def test_wrong_files_are_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = toml(tmp_path, text)
    with pytest.raises(InputError, match=f"^{re.escape(message.format(path=path))}") as error:
        Scene.from_toml(path)
    assert "\n" not in str(error.value)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    missing = tmp_path / "missing.toml"
    with pytest.raises(InputError, match=f"^{re.escape(str(missing))}: cannot be read: No such file"):
        Scene.from_toml(missing)
    with pytest.raises(InputError, match=r": cannot be read: Is a directory$"):
        read_toml(tmp_path)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe[scene]")
    with pytest.raises(InputError, match=r"binary\.toml: is not valid TOML: "):
        read_toml(binary)
    binary.write_bytes(b"\x89HDF\r\n\x1a\n\0\0")
    with pytest.raises(InputError, match=r"binary\.toml: is an HDF5 file, not TOML; fastmech run --from"):
        read_toml(binary)


@given(
    st.fixed_dictionaries(
        {name: st.floats(1e-3, 1e6) for name in POSITIVE}
        | {name: st.floats(0.0, 1e6) for name in NOT_NEGATIVE}
        | {"F0": st.floats(-1e6, 1e6)}
    )
)
def test_every_valid_scene_keeps_its_numbers(parameters: dict[str, float]) -> None:
    scene = Scene(**parameters)
    assert scene.parameters == {name: parameters[name] for name in TABLE_1}
    assert Scene(**scene.parameters) == scene
