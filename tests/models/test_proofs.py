"""The search beside proved lists finds what a list lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from proofs import examined, newton, table, unlisted
from random_mechanisms import KINDS

import fastmech as fm
from fastmech.models.equilibria import prove_equilibria


def test_a_zero_that_a_list_lacks_is_found() -> None:
    chain = fm.mechanisms.pendulum_chain(2)
    statics, values = chain.statics(), list(chain.parameters.values())
    found = prove_equilibria(statics, values)
    zeros = newton(statics, values, 300, 0)
    assert len(zeros) == len(found)
    assert unlisted(statics, values, found, zeros) == []
    short = replace(found, items=found.items[1:])
    (lacking,) = unlisted(statics, values, short, zeros)
    np.testing.assert_allclose(lacking, found[0].position, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_random_mechanisms_of_every_kind(kind: str) -> None:
    tally = examined(KINDS[kind](np.random.default_rng(3)), 300, 3)
    assert (tally["mechanisms"], tally["of these missing"], tally["of these wrong"]) == (1, 0, 0)
    assert tally["lists complete"] + tally["left open"] == 1
    assert tally["equilibria proved"] + tally["left open"] > 0


@pytest.mark.slow
def test_the_table() -> None:
    done: list[int] = []
    lines = table(6, 300, done.append)
    assert sum(done) == 6
    assert [line.split("|")[1].strip() for line in lines[-7:-1]] == list(KINDS)
    assert "6 random mechanisms" in "\n".join(lines)
