"""``fm.group_by_features``: starts grouped by what their motions look like, not by where they come to.

Features of the later part of a motion are grouped by density, with the radius of the clearest groups
(Stender and Hoffmann, Nonlinear Dynamics 107 (2022), 2003; DBSCAN: Ester and others, KDD 1996), or with a
radius of each group's own (HDBSCAN: Campello and others, PAKDD 2013). A group may be more than one attractor,
or a part of one. It is the way to see what recurrences do not, such as motions that differ in a feature of
your own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.stats import binomtest

from fastmech.arrays import Floats
from fastmech.attractors.flow import Flow, flow_of, require_flow, statuses
from fastmech.ensembles import checks
from fastmech.ensembles.status import Status
from fastmech.ensembles.system import System
from fastmech.errors import InputError, shown
from fastmech.models.mechanism import Mechanism
from fastmech.objects import Field, Result, counted
from fastmech.samplers import Starts

#: Starts by default and integrated together; outputs in a period, and periods that are looked at: motions of
#: one, two, three, four or six of them are seen whole.
STARTS, TOGETHER, OUTPUTS, LOOKED = 2000, 2048, 32, 24

#: Starts that make a group at least, and their share of all.
FEWEST, LEAST = 5, 0.002

#: Ways of grouping, by their names in lower case.
METHODS = ("dbscan", "hdbscan")

#: Radii of neighbourhoods that are tried, in typical sizes of states, and starts that tell the best.
RADII, JUDGES = tuple(0.02 * 2.0**k for k in range(5)), 1000

#: Features of states, by name, of the motion (outputs, n, dim) of states that are no angles.
FEATURES: dict[str, Callable[[Floats], Floats]] = {
    "least": lambda y: y.min(axis=0),
    "greatest": lambda y: y.max(axis=0),
    "mean": lambda y: y.mean(axis=0),
    "spread": lambda y: y.std(axis=0),
}

#: Groups that are printed.
LINES = 5


@dataclass(frozen=True, repr=False)
class FeatureGroups(Result):
    """Starts in groups of like motions; printed, their shares and middles."""

    label: NDArray[np.int64]  #: group of each start, the most frequent is 0; -1: like no others (n,)
    status: NDArray[np.int8]  #: OK, ESCAPED, UNSURE (in no group) or NOT_FINITE (n,)
    features: Floats  #: of each start, usual ones in typical sizes of the states and periods (n, features)
    names: tuple[str, ...]  #: of the features
    t_end: float  #: s

    @property
    def fractions(self) -> Floats:
        """Share of the starts in each group."""
        return np.bincount(self.label[self.label >= 0]) / self.label.size

    KIND = "feature_groups"
    FIELDS = {
        "label": Field("start", "1", "group of the start, -1: none", codes=-1),
        "status": Field("start", "1", "what is known of the start", codes=Status),
        "features": Field("start feature", "1", "features of its motion"),
        "names": Field("feature", "1", "name of the feature"),
        "t_end": Field("", "s", "when motions have settled"),
    }

    def told(self) -> str:
        """Shares and middles of the groups."""
        n, number = self.label.size, np.bincount(self.label[self.label >= 0])
        without, lost = np.count_nonzero(self.label < 0), ~np.isfinite(self.features).all(axis=1)
        unknown = np.count_nonzero(lost & (self.status == Status.UNSURE))
        lines = [
            f"{counted(number.size, 'group')} of {counted(n, 'start')}, {without:,} in none"
            + (f"; features of {unknown:,} are not finite" if unknown else "")
        ]
        for k in range(min(number.size, LINES)):
            low, high = binomtest(int(number[k]), n).proportion_ci(method="wilson")
            middle = np.median(self.features[self.label == k], axis=0)
            told = ", ".join(f"{a} {b:.3g}" for a, b in list(zip(self.names, middle, strict=True))[:3])
            lines.append(f"  {number[k] / n:.4f} ({low:.4f} to {high:.4f}): {told}")
        return "\n".join(lines)


def group_by_features(
    system: System | Mechanism,
    starts: Starts,
    n: int | None = None,
    *,
    t_end: float,
    features: Callable[[Floats, Floats], ArrayLike] | None = None,
    method: str = "dbscan",
    radius: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
) -> FeatureGroups:
    """Group starts by features of their motions (needs the extra ``features``: scikit-learn).

    Args:
        system: a system of your own or a mechanism, as for :func:`fastmech.find_attractors`.
        starts: ranges by name, a sampler or states (n, dim).
        n: how many starts, by default the sampler's, or 2,000; of states given all.
        t_end: when motions have settled [s]; 24 periods from then on are looked at, of a system that does not
            depend on the time 24 times as long as states take to change by their size.
        features: ``features(t, y)`` of times (m,) and one motion (m, dim) gives numbers; by default least,
            greatest and mean value, spread and strongest frequency of each state; of angles the mean sine and
            cosine and the turns a second.
        method: ``"dbscan"``, or ``"hdbscan"`` where some groups are much denser than others.
        radius: neighbours lie nearer than so many typical sizes of a state (standard deviations of features
            of your own); by default the one, of five from 0.02 to 0.32, with the greatest silhouette. With
            ``"hdbscan"`` groups that are nearer to each other are one, by default than 0.02.
        seed, threads: as for :func:`fastmech.find_attractors`.

    Raises:
        InputError: an argument is wrong, or scikit-learn is not installed.
    """
    try:
        from sklearn.cluster import DBSCAN, HDBSCAN
        from sklearn.metrics import silhouette_score
    except ImportError:
        raise InputError("group_by_features: needs scikit-learn; pip install 'fastmech[features]'") from None
    require_flow(system)
    until = checks.number("t_end", t_end, "s", above=0.0)
    if method not in METHODS:
        raise InputError(f"method = {shown(method)}: must be one of {', '.join(METHODS)}")
    tried = RADII if method == "dbscan" else RADII[:1]
    if radius is not None:
        tried = (checks.number("radius", radius, "", above=0.0),)
    y = checks.starts("starts", starts, system.state, n=n, seed=seed, default=STARTS)
    flow = flow_of(system, y[np.isfinite(y).all(axis=1)][:256], {}, threads=threads)
    times = until / flow.period + np.arange(1.0, OUTPUTS * LOOKED + 1.0) / OUTPUTS
    rows: list[Any] = []
    status = np.empty(len(y), dtype=np.int8)
    names: tuple[str, ...] = ()
    for first in range(0, len(y), TOGETHER):  # memory holds the motions of so many
        reached = flow.run(y[first : first + TOGETHER], times)
        status[first : first + TOGETHER] = statuses(flow, reached)
        if features is None:
            found, names = _usual(flow, reached.y, tuple(system.state))
            rows += list(found)
        else:
            rows += _own(features, times * flow.period, reached.y)
    table = _as_table(rows)
    names = names or tuple(f"feature {k}" for k in range(table.shape[1]))
    usable = np.isfinite(table).all(axis=1) & (status == Status.OK)
    label = np.full(len(y), -1, dtype=np.int64)
    if np.count_nonzero(usable) >= 2 * FEWEST:
        points = table[usable]
        if features is not None:
            points = points / np.maximum(points.std(axis=0), 1e-9 * np.abs(points).max(axis=0) + 1e-300)
        least = max(FEWEST, int(LEAST * len(points)))
        best, label[usable] = -np.inf, 0
        for eps in tried:
            if method == "hdbscan":
                found = HDBSCAN(min_cluster_size=least, copy=True).fit_predict(points)
                found = _joined(found, DBSCAN(eps=eps, min_samples=1).fit_predict(points), least)
            else:
                found = DBSCAN(eps=eps, min_samples=least).fit_predict(points)
            judged = np.flatnonzero(found >= 0)[:JUDGES]
            several = np.unique(found[judged]).size > 1
            clear = float(silhouette_score(points[judged], found[judged])) if several else 0.0
            if clear > best:
                best, label[usable] = clear, found
    number = np.bincount(label[label >= 0])
    rank = np.append(np.argsort(np.argsort(-number, kind="stable")), -1)
    label = rank[label]
    status[(label < 0) & (status == Status.OK)] = Status.UNSURE
    return FeatureGroups(label, status, table, names, until).of(system)


def _joined(group: Any, near: Any, least: int) -> Any:
    """Groups (n,), -1: none, of which those are one that have starts of the same neighbourhood ``near`` (n,).

    Motions on one attractor differ by rounding and by what is left of their way there, in which HDBSCAN sees
    groups, or none: a neighbourhood of at least so many starts without one is a group.
    """
    kept, size = group >= 0, int(near.max() + group.max() + 2)
    links = coo_matrix((np.ones(kept.sum()), (near[kept], near.max() + 1 + group[kept])), shape=(size, size))
    grouped = np.isin(near, near[kept]) | (np.bincount(near)[near] >= least)
    return np.where(grouped, connected_components(links, directed=False)[1][near], -1)


def _own(features: Callable[[Floats, Floats], ArrayLike], t: Floats, y: Floats) -> list[Any]:
    """What a function of times (m,) and a motion gives of each of motions (m, n, dim), None of lost ones."""
    kept = np.atleast_1d(np.isfinite(y).all(axis=(0, 2)))
    try:
        return [np.ravel(features(t, y[:, i])) if kept[i] else None for i in range(kept.size)]
    except Exception as error:
        raise InputError(f"features: raises {type(error).__name__}: {error}") from None


def _as_table(rows: list[Any]) -> Floats:
    """Features of all motions (n, features), NaN of those that have none; they must be equally many."""
    known = [k for k, row in enumerate(rows) if row is not None]
    try:
        of_known = np.array([rows[k] for k in known], dtype=np.float64)
        of_known = of_known.reshape(len(known), -1 if known else 1)
    except (TypeError, ValueError):
        raise InputError("features: must give numbers, and as many of each motion") from None
    table = np.full((len(rows), of_known.shape[1]), np.nan)
    table[known] = of_known
    return table


def _usual(flow: Flow, y: Floats, states: tuple[str, ...]) -> tuple[Floats, tuple[str, ...]]:
    """The features of motions (outputs, n, dim) in typical sizes and periods, and their names."""
    columns, names = [], []
    for d, state in enumerate(states):
        one = y[:, :, d]
        if flow.angles[d]:
            turns = (one[-1] - one[0]) / (2.0 * np.pi * LOOKED)
            columns += [np.sin(one).mean(axis=0), np.cos(one).mean(axis=0), turns]
            names += [f"mean sine of {state}", f"mean cosine of {state}", f"turns of {state} in a period"]
            continue
        columns += [feature(one) / flow.scale[d] for feature in FEATURES.values()]
        names += [f"{name} {state}" for name in FEATURES]
        spectrum = np.abs(np.fft.rfft(one - one.mean(axis=0), axis=0))
        moves = one.std(axis=0) > 1e-4 * flow.scale[d]
        columns.append(np.where(moves, np.argmax(spectrum, axis=0) / LOOKED, 0.0))
        names.append(f"frequency of {state} in a period")
    return np.stack(columns, axis=1), tuple(names)
