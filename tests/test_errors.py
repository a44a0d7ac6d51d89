from __future__ import annotations

import pytest

from fastmech.errors import InputError, called_here, necessary, shown, shown_name

pytestmark = pytest.mark.nojit


@pytest.mark.parametrize(
    "value",
    ["x" * 3_000_000, list(range(100_000)), 10**5000, "a\nb\x1b[31m", b"\x00" * 500, {"a": 10**5000}],
    ids=["text", "list", "integer", "control", "bytes", "inside"],
)
def test_values_are_shown_on_one_short_line(value: object) -> None:
    line = shown(value)
    assert len(line) <= 80
    assert line.isprintable()


def test_short_values_are_shown_whole() -> None:
    assert shown("rk4") == "'rk4'"
    assert shown(-3.0) == "-3.0"


def test_names_have_no_quotes() -> None:
    assert shown_name("F0") == "F0"
    assert shown_name("a\nb\x1b") == r"a b\x1b"
    assert shown_name("x" * 3_000_000) == "x" * 77 + "..."


def test_a_message_is_one_line_whatever_is_in_it() -> None:
    path = "/".join(["folder" * 10] * 20)  # longer than a name, no name of it too long
    assert str(InputError(f"{path}: cannot be read")) == f"{path}: cannot be read"
    assert str(InputError("a\n\x1b[31mb")) == r"a \x1b[31mb"
    assert str(InputError("z" * 300 + ".h5: cannot be read")) == "z" * 77 + "...: cannot be read"


def test_other_libraries_names_are_told() -> None:
    @called_here(rtol="tol")
    def solve(x: float, *, tol: float = 1e-3) -> float:
        """Solve."""
        return x * tol

    assert solve(2.0, tol=0.5) == 1.0
    assert (solve.__name__, solve.__doc__) == ("solve", "Solve.")
    with pytest.raises(InputError, match=r"^rtol: is called tol here$"):
        solve(2.0, rtol=0.5)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="atol"):
        solve(2.0, atol=0.5)  # type: ignore[call-arg]


def test_what_is_missing_is_told() -> None:
    @necessary(x="a number")
    def twice(x: float, *, by: float = 2.0) -> float:
        """Twice."""
        return x * by

    assert twice(1.5) == twice(x=1.5) == 3.0
    assert (twice.__name__, twice.__doc__) == ("twice", "Twice.")
    with pytest.raises(InputError, match=r"^x: missing; must be a number$"):
        twice(by=1.0)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="unknown"):
        twice(1.0, unknown=0.5)  # type: ignore[call-arg]
