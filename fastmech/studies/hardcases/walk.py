"""Every method through the same motion: which step it takes, to what error it claims the end, and whether so.

A method claims an end to twice what halving its own step tells (Richardson; Hairer, Norsett, Wanner, *Solving
ODEs I*, section II.4): no knowledge of the true motion goes into a claim, the oracle then judges it. The step
is the motion's, or a shorter one where the package would warn of that; it is halved until the claim is worth
something. A method that would need too many steps claims nothing and must end with a status at a step that is
far too long.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fastmech.arrays import Floats
from fastmech.basins.labels import Labels
from fastmech.callee import callee
from fastmech.ensembles.integrate import Trajectories, integrate
from fastmech.ensembles.status import Status
from fastmech.errors import InputError
from fastmech.integrators.explicit import Batch, observe_nothing
from fastmech.integrators.implicit import difference_jacobian
from fastmech.integrators.methods import METHODS, Adams, ImplicitRungeKutta, find_method
from fastmech.integrators.tableaus.implicit import IMPLICIT_TABLEAUS
from fastmech.scene import Scene
from fastmech.slider.coefficients import reduce
from fastmech.slider.kernels.select import right_hand_side
from fastmech.slider.kernels.work import CALLS, counting_lagrange
from fastmech.slider.lagrange import kinetic_energy, potential_energy
from fastmech.slider.motion import lagrange_inverse
from fastmech.step_limits.warning import stable_step, step_limit, step_warning
from fastmech.studies.reporting import content

#: In place of a status: the request was refused before the run.
REFUSED = "refused"


class CaseRow(NamedTuple):
    """What one method did in a case.

    A method claims a case to an error, at a step; one that claims nothing must end with a status (or be
    refused), not with a number.
    """

    method: str
    dt: float  #: step [s]
    steps: int
    error: float  #: against the oracle, see the case; NaN where there is none
    allowed: float = np.nan  #: error to which the method claims the case; NaN where it does not
    drift: float = np.nan  #: largest change of energy over that above the lowest; NaN where it is not kept
    status: str = "ok"  #: worst status of the trajectories, or REFUSED
    remark: str = ""
    why: str = ""  #: why it claims the case so far and no further, or not

    @property
    def claimed(self) -> bool:
        """Whether the method claims the case."""
        return not np.isnan(self.allowed)

    @property
    def passed(self) -> bool:
        """A claimed case within its error and without failures; a case not claimed with a status."""
        fine = self.status == "ok"
        return fine and self.error <= self.allowed if self.claimed else not fine

    @property
    def verdict(self) -> str:
        """What a reader must know: whether the number may be taken, and to how many digits."""
        if self.claimed:
            return "passed" if self.passed else f"FAILED: claimed to {self.allowed:.0e}"
        return "a status, as it must" if self.passed else f"FAILED: not claimed, error {self.error:.1e}"


class HardCase(NamedTuple):
    """A case of the gallery; ``run(quick)`` gives its rows, ``quick`` in about a second."""

    name: str
    hard: str  #: what makes it hard
    oracle: str  #: where the expected value comes from, and what the error is
    must: str  #: what must happen
    run: Callable[[bool], Sequence[CaseRow]]


def worst(status: ArrayLike) -> str:
    """Name of the gravest status among trajectories: any failure before OK."""
    return Status(int(np.max(status))).name.lower()


def energy(scene: Scene, y: Floats) -> Floats:
    """T + U [J] of states (..., 4) under a constant force, or none."""
    force = scene.F0 if scene.alpha == 0.0 else 0.0
    return kinetic_energy(scene, y) + potential_energy(scene, y[..., :2], force)


def row_of(
    run: Trajectories, error: float, allowed: float = np.nan, drift: float = np.nan, **texts: str
) -> CaseRow:
    """A row of what ``integrate`` gave, with remark and why; without ``allowed`` it claims nothing."""
    status = worst(run.status)
    return CaseRow(run.method, run.dt, run.steps, error, allowed, drift=drift, status=status, **texts)


def refused_row(method: str, dt: float, refusal: InputError, why: str) -> CaseRow:
    """A row of a request that was refused before the run."""
    return CaseRow(method, dt, 0, np.nan, status=REFUSED, remark=str(refusal), why=why)


def labels_row(method: str, found: Labels, wrong: int, told: str = "") -> CaseRow:
    """A row of what ``fm.label_starts`` gave: the error is how many are wrong, and none may be."""
    remark = "labels: " + ", ".join(f"{n} {name}" for name, n in found.counts.items() if n) + told
    return CaseRow(method, np.nan, found.steps, float(wrong), 0.0, remark=remark, why="fm.label_starts")


#: Relative error that rounding explains, of motions that are not chaotic.
ROUNDED = 1e-10


class Goal(NamedTuple):
    """A motion whose end is known, of a reference to better than double precision."""

    scene: Scene
    start: Floats  #: (4,): rad, rad/s
    t_end: float  #: s
    expected: Floats  #: (4,), state at that time
    rounded: float = ROUNDED  #: error that rounding explains, of the largest entry

    def error(self, state: Floats) -> float:
        """Largest difference from the known end, relative to its largest entry, 1 at least."""
        return float(np.abs(state - self.expected).max() / max(1.0, np.abs(self.expected).max()))


def motion(name: str, rounded: float = ROUNDED) -> Goal:
    """The reference of this name; its scene is the paper's with a few changes."""
    entry = content(__package__, "references.toml")[name]
    scene, end = Scene(c2=1100 / 3).replace(**entry["scene"]), np.array([float(x) for x in entry["state"]])
    return Goal(scene, np.array(entry["start"]), entry["t"], end, rounded)


def boundary() -> tuple[Scene, float, Floats, Floats]:
    """Where a line of starts at rest, theta = 0, crosses a basin boundary, and where motions end.

    Returns:
        The scene; phi [rad] of the crossing, by bisection in extended precision, rounded to 1e-16; phi and
        theta [rad] at the end of motions from smaller phi, (2,), and from greater.
    """
    entry = content(__package__, "references.toml")["boundary"]
    below, above = (np.array(end) for end in entry["ends"])
    return Scene(c2=1100 / 3).replace(**entry["scene"]), float(entry["phi"]), below, above


#: One method of each family: what quick versions walk.
FAMILIES = ("euler", "rk4", "dop853", "abm8", "gauss6", "radau5", "sdirk4")

#: Those whose labels quick versions look at.
LABELLERS = ("rk4", "dop853", "radau5")

#: Share of the step limit that is taken where the limit is shorter than the motion's step.
WITHIN = 0.9

#: An Adams method's history is this much shorter than the step of a method without memory.
SHORTER = 4.0

#: Relative error beyond which a number is worth nothing, and steps that are too many to get one.
WORTHLESS, MOST_STEPS = 0.1, 200_000


def walked(quick: bool, euler: bool = True) -> tuple[str, ...]:
    """Names of the methods that a case tries; ``euler``: whether the quick version has time for its steps."""
    return FAMILIES[not euler :] if quick else tuple(METHODS)


def labellers(quick: bool) -> tuple[str, ...]:
    """Names of the methods by which a case looks for labels."""
    return LABELLERS if quick else tuple(METHODS)


def admitted_step(scene: Scene, method: str, longest: float, starts: ArrayLike | None = None) -> float:
    """The longest step [s], ``longest`` at most, that the package lets pass without a warning; 0: none."""
    dt = longest / (SHORTER if isinstance(find_method(method), Adams) else 1.0)
    if step_warning(scene, dt, method, starts) is None:
        return dt
    return min(dt, WITHIN * step_limit(scene, method))


def halved(dt: float, length: float, most: int) -> Iterator[float]:
    """Steps [s] from ``dt`` on, each half of the last, with which a run takes ``most`` at most."""
    while 0.0 < length <= most * dt:
        yield dt
        dt *= 0.5


def claimed_row(goal: Goal, method: str, longest: float, refused: float) -> CaseRow:
    """The end by one method, to the error that it claims itself, or the status that it must end with.

    The claim is twice Richardson's estimate, rounding added. A method that claims nothing is run with the
    step ``refused`` [s], which is far too long.
    """
    scene, start, t_end, _, rounded = goal
    for dt in halved(admitted_step(scene, method, longest, start), t_end, MOST_STEPS):
        run, half = (integrate(scene, start, t_end, h, method) for h in (dt, 0.5 * dt))
        end, finer = run.y[-1, 0], half.y[-1, 0]
        size = max(1.0, float(np.abs(finer).max()))
        claim = 2.0 * halving_tells(method, end, finer) / size + rounded
        if worst(run.status) == "ok" and claim <= WORTHLESS:
            why = "twice what halving the step tells" if claim > 2.0 * rounded else "rounding"
            return row_of(run, goal.error(end), claim, why=why)
    return status_row(goal, method, refused, f"no claim with {MOST_STEPS:,} steps")


def status_row(goal: Goal, method: str, dt: float, why: str, dtype: str = "float64") -> CaseRow:
    """A row of a method that claims nothing with this step."""
    try:
        return fixed_row(goal, method, dt, np.nan, why, dtype=dtype)._replace(remark="")
    except InputError as error:
        return refused_row(method, dt, error, why)


def fixed_row(
    goal: Goal, method: str, dt: float, allowed: float, why: str, dtype: str = "float64"
) -> CaseRow:
    """A row of a method that claims the end to an error that is known beforehand."""
    run = integrate(goal.scene, goal.start, goal.t_end, dt, method, dtype=dtype)
    remark = "" if dtype == "float64" else dtype
    return row_of(run, goal.error(run.y[-1, 0]), allowed, why=why, remark=remark)


def halving_tells(method: str, state: Floats, half: Floats) -> float:
    """The error of a result by the same with half the steps: Richardson's estimate, of the largest entry."""
    return float(np.abs(state - half).max()) / (1.0 - 0.5 ** find_method(method).order)


def counted(goal: Goal, method: str, steps: int) -> tuple[int, Floats]:
    """Right-hand sides of an implicit method's run in equal steps, and its states (steps + 1, 4)."""
    params = np.array([*reduce(goal.scene), 0.0])
    batch = Batch(
        times=np.linspace(0.0, goal.t_end, steps + 1),
        steps=np.ones(steps, dtype=np.int64),
        params=params[None, :, None].copy(),
        observer_params=np.zeros(0),
        Y=goal.start[None, :, None].copy(),
        record=np.zeros((1, 0, 1)),
        out=np.empty((1, steps, 4, 1)),
    )
    formula = ImplicitRungeKutta(IMPLICIT_TABLEAUS[method], lagrange_inverse)
    formula.run(counting_lagrange, observe_nothing, batch)
    return int(batch.params[0, CALLS, 0]), np.concatenate([goal.start[None], batch.out[0, :, :, 0]])


def path_eigenvalues(goal: Goal, path: Floats) -> Floats:
    """Eigenvalues (states, 4) [1/s] of the motion linearized along a path (states, 4)."""
    J = np.empty((16, len(path)))
    own = np.repeat(np.array(reduce(goal.scene), dtype=np.float64)[:, None], len(path), axis=1)
    rhs = callee(right_hand_side(reduce(goal.scene)))
    difference_jacobian(rhs, 0.0, np.ascontiguousarray(path.T), J, own)
    return np.asarray(np.linalg.eigvals(J.T.reshape(-1, 4, 4)))


def explicit_calls(goal: Goal, path: Floats) -> float:
    """Right-hand sides of RK4 whose step is the stability limit all along a path.

    Fewer than with any fixed step, which the narrowest place on the path sets.
    """
    limits = np.array([stable_step(METHODS["rk4"], values) for values in path_eigenvalues(goal, path)])
    return 4.0 * goal.t_end * float(np.mean(1.0 / limits))
