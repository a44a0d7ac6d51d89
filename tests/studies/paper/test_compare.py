from __future__ import annotations

import pytest

from fastmech.studies.paper.compare import (
    Agreement,
    agrees,
    agrees_legibly,
    compare,
    evaluate,
    half_unit,
    judged,
    number,
)

pytestmark = pytest.mark.nojit


@pytest.mark.parametrize(("printed", "half"), [("-2.52980", 5e-6), ("125", 0.5), ("147.1", 0.05)])
def test_half_a_unit_of_the_last_place(printed: str, half: float) -> None:
    assert half_unit(printed) == pytest.approx(half)


def test_a_rounding_agrees_and_the_next_digit_does_not() -> None:
    assert agrees("1.45058", 1.450575217)
    assert not agrees("1.45057", 1.450575217)
    assert agrees("0.5", 0.45)
    assert agrees("0.4", 0.45)


def test_lost_characters_match_some_rounding() -> None:
    assert agrees_legibly("-28*.85", -284.8501)
    assert agrees_legibly("0.137*25", 0.13725)
    assert not agrees_legibly("-28*.85", -285.35)
    assert not agrees_legibly("-28*.85", 284.8501)


def test_expressions_see_nothing_but_the_quantities_given() -> None:
    assert evaluate("l*sin(phi)**2", l=2.0, phi=0.0) == 0.0
    with pytest.raises(NameError):
        evaluate("open('x')")


def test_fractions_of_pi() -> None:
    assert number("4 pi / 13") == pytest.approx(0.9666438934122440)
    assert compare("pi / 7", 0.4487989505128276) == Agreement.AGREES


def test_a_difference_needs_a_proved_misprint() -> None:
    row = judged({"known"}, ("Table", "", "x", "J"), "1.0", 2.0, "known")
    assert (row.verdict, row.see) == (Agreement.MISPRINT, "known")
    row = judged(set(), ("Table", "", "x", "J"), "1.0", 2.0, "known")
    assert (row.verdict, row.see) == (Agreement.DIFFERS, "")
