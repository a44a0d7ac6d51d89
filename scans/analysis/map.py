"""What an equilibrium map says: for which load and stiffness the mechanism has a choice of resting positions.

Usage: python scans/analysis/map.py [FILE.h5] [map_F0_c1]

FILE.h5 is the shipped data/small.h5 unless one is named; `fastmech run scans/paper.toml` makes a larger one,
results/paper.h5.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import fastmech as fm

SHIPPED = Path(__file__).parents[2] / "data" / "small.h5"


def main(path: str | Path = SHIPPED, name: str = "map_F0_c1") -> None:
    with fm.open_results(path) as results:
        section = results[name]
        x, y = section.attrs["axes"]
        stable = section["count_stable"].data
        print(f"{path}: {stable.size:,} points over {x} and {y}")
        for count in np.unique(stable):
            print(f"  {count} stable positions at {np.mean(stable == count):7.2%} of the points")
        # A line through the map: only this line is read.
        middle = float(section[x].data.mean())
        line = section.select(["count", "count_stable", "decay_time", "depth"], **{x: middle})
        slowest = np.where(np.isfinite(line["decay_time"].data), line["decay_time"].data, np.nan)
        print(f"along {x} = {line[x].data:g} {line[x].units}:")
        steps = max(1, line[y].data.size // 8)
        for place in range(0, line[y].data.size, steps):
            wells = line["depth"].data[place]
            depth = np.nanmin(wells) if np.isfinite(wells).any() else np.inf
            settle = np.nanmax(slowest[place], initial=0.0)
            print(
                f"  {y} = {line[y].data[place]:8.2f} {line[y].units}: {line['count'].data[place]} positions,"
                f" {line['count_stable'].data[place]} stable, shallowest well {depth:8.3g} J,"
                f" slowest decay {settle:6.2f} s"
            )


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except fm.InputError as error:
        print(f"{error}; fastmech run scans/paper.toml makes results/paper.h5, which has it", file=sys.stderr)
        sys.exit(2)
