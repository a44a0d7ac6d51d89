"""Proved lists of equilibria of random mechanisms beside an independent search: Newton from many starts.

``make proofs``, or ``PYTHONPATH=tests python -m proofs --mechanisms 200``, prints what a multistart finds
that a proved list lacks, and where indices do not add up.
"""

from __future__ import annotations

import time
from argparse import ArgumentParser
from typing import Any

import mpmath
import numpy as np
import sympy
from numpy.typing import NDArray
from random_mechanisms import KINDS

from fastmech.arrays import Floats
from fastmech.cli.progress import ProgressBars
from fastmech.ensembles.run import Progress
from fastmech.models.equilibria import RestingPlaces, prove_equilibria
from fastmech.models.mechanism import Mechanism
from fastmech.models.statics import Statics
from fastmech.outcome import Outcome
from fastmech.studies.reporting import section

#: Mechanisms, and starts of Newton's method for each.
NUMBER, STARTS = 2000, 10_000

#: Steps of Newton's method, and the longest [rad or m].
ITERATIONS, LONGEST = 60, 0.5

#: Forces below this part of their slopes are none as far as double precision tells.
SMALL = 1e-12

#: Zeros nearer than the first are one; a listed place nearer than the second is a zero's.
SAME, LISTED = 1e-6, 1e-5

#: What is counted of the mechanisms of one kind. A list has an index sum if it is complete and the sum must
#: be a known one; a proof's time is without building and compiling.
COUNTED = (
    "mechanisms", "equilibria proved", "lists complete", "left open", "zeros by Newton", "of these missing",
    "index sums", "of these wrong", "ms a proof",
)  # fmt: skip


def table(number: int, starts: int, advance: Progress, drawn: int = 7) -> list[str]:
    """What is counted, kind by kind, as Markdown; ``drawn`` is a seed, ``advance`` is told of each."""
    tallies = {name: np.zeros(len(COUNTED)) for name in KINDS}
    for seed in range(number):
        name = list(KINDS)[seed % len(KINDS)]
        found = examined(KINDS[name](np.random.default_rng([drawn, seed])), starts, seed)
        tallies[name] += [found[each] for each in COUNTED]
        advance(1)
    rows = (
        [name, *(f"{n:,.0f}" for n in tally[:-1]), f"{tally[-1] / max(tally[0], 1):.3g}"]
        for name, tally in tallies.items()
    )
    about = (
        f"{number:,} random mechanisms of one to three coordinates; Newton's method from {starts:,} starts "
        "each. Missing is a zero, confirmed in fifty digits, that is neither listed nor left open."
    )
    return section("# Proved lists beside a multistart", about, ["kind", *COUNTED], rows)


def examined(mechanism: Mechanism, starts: int, seed: int) -> dict[str, float]:
    """Prove, search, compare: what is :data:`COUNTED`."""
    statics, values = mechanism.statics(), list(mechanism.parameters.values())
    prove_equilibria(statics, values, 2)  # compiles
    began = time.process_time()
    found = prove_equilibria(statics, values)
    seconds = time.process_time() - began
    zeros = newton(statics, values, starts, seed)
    lacking, proof = unlisted(statics, values, found, zeros), found.certificate
    known = proof.complete and proof.expected_sum is not None and proof.index_sum is not None
    wrong, left_open = known and proof.index_sum != proof.expected_sum, proof.outcome != Outcome.COMPLETE
    counts = 1, len(found), proof.complete, left_open, len(zeros), len(lacking), known, wrong, 1e3 * seconds
    return dict(zip(COUNTED, counts, strict=True))


def newton(statics: Statics, values: list[float], starts: int, seed: int) -> Floats:
    """Distinct zeros (count, n) by Newton's method from random starts, all at once."""
    symbols, forces = _forces(statics, values)
    n = len(symbols)
    f = sympy.lambdify(symbols, forces, "numpy", cse=True)
    slopes = sympy.lambdify(symbols, _slopes(symbols, forces), "numpy", cse=True)
    low, high = (np.array([getattr(c, end) for c in statics.coordinates]) for end in ("low", "high"))
    periodic = np.array([c.periodic for c in statics.coordinates])
    q = np.random.default_rng(seed).uniform(low, high, (starts, n))

    def evaluated(q: Floats) -> tuple[Floats, Floats]:
        F = np.stack(np.broadcast_arrays(*f(*q.T), q[:, 0])[:-1], 1)
        J = np.stack(np.broadcast_arrays(*slopes(*q.T), q[:, 0])[:-1], 1).reshape(-1, n, n)
        return F, J

    with np.errstate(all="ignore"):
        for _ in range(ITERATIONS):
            F, J = evaluated(q)
            usable = np.isfinite(J).all((1, 2)) & np.isfinite(F).all(1)
            q, F, J = q[usable], F[usable], J[usable]
            try:
                step = np.linalg.solve(J, F[..., None])[..., 0]
            except np.linalg.LinAlgError:
                step = (np.linalg.pinv(J) @ F[..., None])[..., 0]
            q = q - np.clip(step, -LONGEST, LONGEST)
        F, J = evaluated(q)
        ends = np.abs(F).max(1) < SMALL * (np.abs(J).max((1, 2)) + 1e-300)
    ends &= np.where(periodic, True, (q >= low) & (q <= high)).all(1)
    left, distinct = q[ends], []
    left = np.where(periodic, np.angle(np.exp(1j * left)), left)
    while len(left):
        distinct.append(left[0])
        left = left[_away(left, left[0], periodic).max(1) >= SAME]
    return np.array(distinct).reshape(-1, n)


def unlisted(statics: Statics, values: list[float], found: RestingPlaces, zeros: Floats) -> list[Floats]:
    """Zeros that the proof neither lists nor leaves open."""
    periodic = np.array([c.periodic for c in statics.coordinates])
    missing = []
    for place in zeros:
        listed = (_away(found.position, place, periodic) < LISTED).all(1).any()
        open_still = any(
            (_away(0.5 * (p.low + p.high), place, periodic) <= 0.5 * (p.high - p.low) + LISTED).all()
            for p in found.certificate.places
        )
        if not listed and not open_still and is_zero(statics, values, place):
            missing.append(place)
    return missing


def is_zero(statics: Statics, values: list[float], place: Floats) -> bool:
    """Whether Newton's method in fifty digits ends nearby: beside a fold forces merely are small."""
    symbols, forces = _forces(statics, values)
    f = sympy.lambdify(symbols, forces, "mpmath")
    n = len(symbols)
    J = sympy.lambdify(symbols, sympy.Matrix(n, n, _slopes(symbols, forces)), "mpmath")
    with mpmath.workdps(50):
        start = mpmath.matrix([mpmath.mpf(float(value)) for value in place])
        q = start.copy()
        for _ in range(80):
            try:
                step = mpmath.lu_solve(J(*q), mpmath.matrix(f(*q)))
            except ZeroDivisionError:
                return False
            q -= step
            if mpmath.norm(step) < 1e-40:
                return bool(mpmath.norm(q - start) < 1e-3)
    return False


def _forces(statics: Statics, values: list[float]) -> tuple[list[Any], list[Any]]:
    given = dict(zip(statics.parameters, map(sympy.Float, values), strict=True))
    return [c.symbol for c in statics.coordinates], [sympy.sympify(f).subs(given) for f in statics.forces]


def _slopes(symbols: list[Any], forces: list[Any]) -> list[Any]:
    """The Jacobian's rows one after the other, without what is infinite where a spring passes length zero."""
    slopes = [force.diff(s) for force in forces for s in symbols]
    return [slope.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0)) for slope in slopes]


def _away(a: Floats, b: Floats, periodic: NDArray[np.bool_]) -> Floats:
    """Distances coordinate by coordinate, angles the short way."""
    return np.abs(np.where(periodic, np.angle(np.exp(1j * (a - b))), a - b))


if __name__ == "__main__":
    parser = ArgumentParser(prog="proofs", description=__doc__)
    parser.add_argument("--mechanisms", type=int, default=NUMBER, metavar="N")
    parser.add_argument("--seed", type=int, default=7, help="that of the mechanisms drawn")
    asked = parser.parse_args()
    with ProgressBars() as bars:
        lines = table(asked.mechanisms, STARTS, bars.stage("random mechanisms", asked.mechanisms), asked.seed)
    print("\n".join(lines))
