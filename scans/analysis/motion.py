"""What a motion file says: how fast the swing dies out and which rod is loaded most.

Usage: python scans/analysis/motion.py [FILE.h5]

FILE.h5 is the shipped data/small.h5 unless one is named; `fastmech run scans/paper.toml` makes a larger one,
results/paper.h5.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import fastmech as fm

SHIPPED = Path(__file__).parents[2] / "data" / "small.h5"


def main(path: str | Path = SHIPPED) -> None:
    with fm.open_results(path) as results:
        motion = results["motion"]
        t = motion["time"].data
        energy = motion["kinetic_energy"].data + motion["potential_energy"].data
        rods = {name: motion[name] for name in ("rod_om1", "rod_m1m2", "rod_m1m3", "slider_normal")}
        error = motion.attrs["error_estimate"]
    half = np.argmax(energy - energy[-1] <= 0.5 * (energy[0] - energy[-1]))
    print(f"{path}: {t.size} instants to t = {t[-1]:g} s, error estimate {error:.1e}")
    print(f"half of the energy that is lost in the end is lost after {t[half]:.2f} s")
    for name, force in rods.items():
        worst = np.argmax(np.abs(force.data))
        print(
            f"{name:14s} {force.data[worst]:10.1f} {force.units} at t = {t[worst]:5.2f} s  {force.long_name}"
        )


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except fm.InputError as error:
        print(f"{error}; fastmech run scans/paper.toml makes results/paper.h5, which has it", file=sys.stderr)
        sys.exit(2)
