"""The inflated bubble beside Marc's published profiles: compared, not asserted.

Usage: bench_marc_profiles.py [PROFILES_CSV]. Table 4.2's coefficients, the published pressures.
The published curves are read off a figure (good to about 5 %), and their load steps are not
known: coarse steps change the apex at low pressure by as much.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from bubblefit.solvers.membrane.solver import MembraneSolver
from known_solution import known_model_and_law

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT / "tests" / "published" / "marc_bubble_profiles.csv"


def main() -> None:
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DATA
    published = pd.read_csv(path, comment="#")
    model, law = known_model_and_law()
    history = MembraneSolver().run(model, law)
    place = model.mesh.points
    print("apex heights in mm; cuts: RMS difference of z over the apex height")
    print(f"{'kPa':>5s}{'apex':>9s}{'Marc':>9s}{'apex, %':>9s}{'x cut, %':>10s}{'y cut, %':>10s}")
    for pressure, u in zip(history.load, history.displacement, strict=True):
        kpa = round(1e3 * pressure)
        frame = published[published.p_kPa == kpa]
        apex = float(frame.groupby("copy").z_mm.max().mean())
        ours = float(u[model.mesh.node_sets["apex"][0], 2])
        cuts = []
        for axis, line in (("x", "symmetry_y"), ("y", "symmetry_x")):
            nodes = model.mesh.node_sets[line]
            column = "xy".index(axis)
            along = place[nodes, column] + u[nodes, column]
            order = np.argsort(along)
            cut = frame[frame.axis == axis]
            z = np.interp(np.abs(cut.coord_mm), along[order], u[nodes, 2][order])
            cuts.append(float(np.sqrt(np.mean((z - cut.z_mm) ** 2))) / apex)
        print(
            f"{kpa:5d}{ours:9.2f}{apex:9.2f}{100 * (ours / apex - 1):9.1f}"
            f"{100 * cuts[0]:10.1f}{100 * cuts[1]:10.1f}"
        )


if __name__ == "__main__":
    main()
