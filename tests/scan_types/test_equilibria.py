"""The section of equilibria: every variable from reference angles, the oracle and textbook definitions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mpmath
import numpy as np
import pytest
import scipy.linalg
from oracles import oracle
from scan_types.values import Floats, array, check_labels, decoded, deepest_first, stored, together

from fastmech.results import Dataset
from fastmech.scan_types.equilibria import EquilibriaScan
from fastmech.scene import Scene

#: Four and six equilibria, one and two minima, springs, loads and masses of many sizes.
NAMES = ("table_1", "bistable", "no_spring_2", "random_05", "random_23")

VERDICTS = ("verdict_sylvester", "verdict_hurwitz", "verdict_eigenvalues", "verdict")

UNITS = {
    "equilibrium": "1", "phi": "rad", "theta": "rad", "energy": "J", "kind": "1", "morse_index": "1",
    "hessian_phi_phi": "J", "hessian_phi_theta": "J", "hessian_theta_theta": "J",
    "minor_1": "J", "minor_2": "J2", **{f"polynomial_{k}": f"s-{k}" for k in range(1, 5)},
    **{f"hurwitz_{k}": f"s-{k * (k + 1) // 2}" for k in range(1, 5)},
    **{f"eigenvalue_re_{k}": "1/s" for k in range(1, 5)},
    **{f"eigenvalue_im_{k}": "rad/s" for k in range(1, 5)},
    "natural_frequency_1": "rad/s", "natural_frequency_2": "rad/s", "decay_time": "s",
    "explanation": "1", **dict.fromkeys(VERDICTS, "1"),
}  # fmt: skip

TABLE_2 = {
    (0.68803, -2.91483): "unstable",
    (1.45058, -0.23257): "asymptotically_stable",
    (-1.35581, -2.52980): "unstable",
    (-2.44693, 1.52262): "unstable",
}


@dataclass
class Case:
    """A stored section and where its equilibria are."""

    scene: Scene
    angles: Floats
    section: Dataset

    def __post_init__(self) -> None:
        self.params = self.scene.parameters
        self.hessians = array([oracle().hessian(self.params, q, self.scene.F0) for q in self.angles])
        self.metrics = array([oracle().metric(self.params, q) for q in self.angles])
        self.polynomials = [
            oracle().characteristic_polynomial(self.params, q, self.scene.F0) for q in self.angles
        ]
        self.negative = (np.linalg.eigvalsh(self.hessians) < 0.0).sum(axis=1)

    def roots(self) -> list[list[complex]]:
        """Roots of the characteristic polynomials, largest real part first, then the largest imaginary."""
        with mpmath.workdps(40):
            roots = [mpmath.polyroots(p, maxsteps=200, extraprec=400) for p in self.polynomials]
            # Digits far below doubles are cut so that the two of a pair have one real part.
            return [sorted(map(_cut, r), key=lambda z: (-z.real, -z.imag)) for r in roots]


def _cut(z: mpmath.mpc) -> complex:
    return complex(round(float(mpmath.re(z)), 12), round(float(mpmath.im(z)), 12))


@pytest.fixture(scope="module", params=NAMES)
def case(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Case:
    scene, angles = deepest_first(request.param)
    return Case(scene, angles, stored(EquilibriaScan(), scene, tmp_path_factory.mktemp("equilibria")))


def close(found: Floats, right: Floats) -> None:
    """Equal to a few units in 1e12 of the largest of the same kind."""
    scale = np.abs(right).max()
    np.testing.assert_allclose(found, right, rtol=1e-9, atol=1e-12 * scale)


def hurwitz_determinants(coefficients: Floats) -> list[float]:
    """Leading minors of Hurwitz's matrix H[i, j] = a(2 j - i), i, j = 1 to 4, with a(0) = 1."""
    a = {k: mpmath.mpf(c) for k, c in enumerate(coefficients)}
    with mpmath.workdps(40):
        H = mpmath.matrix(4, 4)
        for i in range(4):
            for j in range(4):
                H[i, j] = a.get(2 * (j + 1) - (i + 1), mpmath.mpf(0))
        return [float(mpmath.det(H[:k, :k])) for k in range(1, 5)]


def test_labels(case: Case) -> None:
    check_labels(case.section, UNITS)
    assert all(case.section[name].dims[0] == "equilibrium" for name in UNITS)


def test_places_and_energies(case: Case) -> None:
    found = np.stack([case.section["phi"].data, case.section["theta"].data], axis=-1)
    np.testing.assert_allclose(found, case.angles, rtol=0, atol=1e-12)
    energies = array([oracle().potential(case.params, q, case.scene.F0) for q in case.angles])
    close(case.section["energy"].data, energies)
    assert case.section.attrs["force"] == case.scene.F0
    assert case.section.attrs["outcome"] == "complete"
    assert f"all {len(case.angles)} " in case.section.attrs["certificate"]


def test_hessian_minors_and_kind(case: Case) -> None:
    close(together(case.section, "hessian"), case.hessians[:, [0, 0, 1], [0, 1, 1]])
    minors = np.stack([case.hessians[:, 0, 0], np.linalg.det(case.hessians)], axis=-1)
    for column in range(2):
        close(together(case.section, "minor")[:, column], minors[:, column])
    assert case.section["morse_index"].data.tolist() == case.negative.tolist()
    kinds = [("minimum", "saddle", "maximum")[n] for n in case.negative]
    assert decoded(case.section["kind"]) == kinds
    attrs = case.section["kind"].attrs
    codes = ([0, 1, 2, 3], "minimum saddle maximum degenerate")
    assert (attrs["flag_values"].tolist(), attrs["flag_meanings"]) == codes
    for kind, sentence in zip(kinds, case.section["explanation"].data, strict=True):
        assert kind in sentence


def test_characteristic_polynomial_and_hurwitz(case: Case) -> None:
    right = array(case.polynomials)
    determinants = array([hurwitz_determinants(p) for p in case.polynomials])
    for column in range(4):  # the first coefficient is 1
        close(together(case.section, "polynomial")[:, column], right[:, column + 1])
    for column in range(4):
        np.testing.assert_allclose(
            together(case.section, "hurwitz")[:, column], determinants[:, column], rtol=1e-7
        )


def test_eigenvalues(case: Case) -> None:
    right = np.array(case.roots())
    np.testing.assert_allclose(together(case.section, "eigenvalue_re"), right.real, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(together(case.section, "eigenvalue_im"), right.imag, rtol=1e-8, atol=1e-10)


def test_frequencies_and_decay(case: Case) -> None:
    squares = array(
        [scipy.linalg.eigh(h, a, eigvals_only=True) for h, a in zip(case.hessians, case.metrics, strict=True)]
    )
    frequencies = np.sqrt(np.where(squares > 0.0, squares, np.nan))
    np.testing.assert_allclose(together(case.section, "natural_frequency"), frequencies, rtol=1e-10)
    slowest = np.array(case.roots()).real.max(axis=1)
    times = np.where(case.negative == 0, -1.0 / slowest, np.nan)
    np.testing.assert_allclose(case.section["decay_time"].data, times, rtol=1e-7)


def test_verdicts(case: Case) -> None:
    for name in VERDICTS:
        attrs = case.section[name].attrs
        codes = ([0, 1, 2, 3], "asymptotically_stable stable unstable critical")
        assert (attrs["flag_values"].tolist(), attrs["flag_meanings"]) == codes
    definite = case.negative == 0
    stable = np.array([min(hurwitz_determinants(p)) > 0.0 for p in case.polynomials])
    falling = np.array(case.roots()).real.max(axis=1) < 0.0
    expected = {
        "verdict_sylvester": np.where(definite, "stable", "unstable"),
        "verdict_hurwitz": np.where(stable, "asymptotically_stable", "unstable"),
        "verdict_eigenvalues": np.where(falling, "asymptotically_stable", "unstable"),
        "verdict": np.where(definite, "asymptotically_stable", "unstable"),
    }
    assert {name: decoded(case.section[name]) for name in VERDICTS} == {
        name: verdicts.tolist() for name, verdicts in expected.items()
    }


def test_table_2(tmp_path: Path) -> None:
    # The paper's numbers come from c2 = 1100/3 N/m, which it prints as 366.67.
    section = stored(EquilibriaScan(), deepest_first("table_1")[0], tmp_path)
    found = np.stack([section["phi"].data, section["theta"].data], axis=-1)
    for (phi, theta), verdict in TABLE_2.items():
        i = int(np.argmin(np.abs(found - [phi, theta]).max(axis=1)))
        assert found[i] == pytest.approx([phi, theta], abs=1e-5)
        for name in VERDICTS:
            own = "stable" if name == "verdict_sylvester" and verdict != "unstable" else verdict
            assert decoded(section[name])[i] == own


def test_without_damper(tmp_path: Path) -> None:
    scene, angles = deepest_first("bistable")
    section = stored(EquilibriaScan(), scene.replace(beta=0.0), tmp_path)
    minimum = section["morse_index"].data == 0
    assert minimum.sum() == 2
    for name in VERDICTS:
        at_minimum = "stable" if name in ("verdict_sylvester", "verdict") else "critical"
        assert decoded(section[name]) == np.where(minimum, at_minimum, "unstable").tolist()
    assert (section["decay_time"].data[minimum] == np.inf).all()
    # Nothing damps: the eigenvalues of a minimum are +- i times its natural frequencies.
    frequencies = together(section, "natural_frequency")[minimum]
    pairs = np.sort(together(section, "eigenvalue_im")[minimum], axis=1)
    np.testing.assert_allclose(pairs, np.sort(np.hstack([-frequencies, frequencies]), axis=1), rtol=1e-9)
    assert np.abs(together(section, "eigenvalue_re")[minimum]).max() < 1e-9
    np.testing.assert_allclose(section["phi"].data, angles[:, 0], rtol=0, atol=1e-12)


def test_a_decaying_force_is_gone_at_rest(tmp_path: Path) -> None:
    section = stored(EquilibriaScan(), Scene(), tmp_path)
    assert section.attrs["force"] == 0.0
    phi, theta = section["phi"].data, section["theta"].data
    assert (phi[0], theta[0]) == pytest.approx((np.pi / 2, 0.0), abs=1e-12)
    params = Scene().parameters
    energies = array([oracle().potential(params, q, 0.0) for q in zip(phi, theta, strict=True)])
    close(section["energy"].data, energies)


def test_equilibria_that_merge_are_degenerate(tmp_path: Path) -> None:
    # F0 = (m1 + m2) g - c2 l = 0 and c1 = 0: phi is free.
    scene = Scene(c1=0.0, F0=0.0, l=1.0, g=9.8125, c2=22 * 9.8125)
    section = stored(EquilibriaScan(), scene, tmp_path)
    assert section.attrs["outcome"] == "degenerate"
    assert section.sizes["equilibrium"] == 0
    check_labels(section, UNITS)
