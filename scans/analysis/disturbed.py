"""What a disturbed-ensemble file says: how large a shock each equilibrium survives.

Usage: python scans/analysis/disturbed.py [FILE.h5]

FILE.h5 is the shipped data/small.h5 unless one is named; `fastmech run scans/paper.toml` makes a larger one,
results/paper.h5.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np

import fastmech as fm

SHIPPED = Path(__file__).parents[2] / "data" / "small.h5"

BINS = 5

#: Outcomes that say nothing of where a motion ends.
FAILED = ("not_finite", "step_too_large", "not_converged")


def main(path: str | Path = SHIPPED) -> None:
    with fm.open_results(path) as results:
        section = results["disturbed"]
        radius = section.attrs["radius"]
        codes = section["outcome"].codes  # as the file itself names them
        names = {code: meaning for meaning, code in codes.items()}
        for index in range(section.sizes["equilibrium"]):
            # One equilibrium at a time: nothing of the others is read.
            one = section.select(
                ["phi", "theta", "outcome", "excursion_phi", "excursion_theta"], equilibrium=index
            )
            outcome = one["outcome"].data
            print(f"phi = {one['phi'].data:.4f} rad, theta = {one['theta'].data:.4f} rad")
            for value in np.unique(outcome):
                failed = "failed, no end known: " if names[int(value)] in FAILED else ""
                print(f"  {failed}{names[int(value)]:14s} {np.mean(outcome == value):7.2%}")
            largest = np.maximum(one["excursion_phi"].data, one["excursion_theta"].data)
            edges = np.nanquantile(largest, np.linspace(0.0, 1.0, BINS + 1))  # failed ones are no numbers
            back = outcome == codes["returned"]
            if not back.any():
                continue
            for low, high in pairwise(edges):
                inside = (largest >= low) & (largest <= high)
                print(f"  excursion {low:6.3f} to {high:6.3f} rad: {np.mean(back[inside]):7.2%} return")
    print(f"disturbances up to {radius:g} rad in the kinetic-energy norm")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except fm.InputError as error:
        print(f"{error}; fastmech run scans/paper.toml makes results/paper.h5, which has it", file=sys.stderr)
        sys.exit(2)
