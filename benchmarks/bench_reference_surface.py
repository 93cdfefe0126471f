"""What a sheet that was neither flat nor taut does to the moduli, and what makes up for it.

Usage: bench_reference_surface.py [--data ELEMENTS] [ELEMENTS [WAY ...]]. A computed test (height
4 mm without symmetry, slack 0.1 %, a rim that moves by 2 mm, 0.05 mm noise in every number, z
included) is fitted with what [bubble.sheet] offers on 112 quads. The data are six at each node of
the mesh of the fit, or about as many in all at the nodes of another, --data.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit
from uneven_test import Uneven, errors, project_text, write_test

PRESSURES = (0.02, 0.05, 0.09, 0.14, 0.19, 0.24)
RIM = 'rim = "measured"'
WAYS = {
    "flat and taut": "",
    "measured rim only": RIM,
    "modes, no rim": "modes = 10\nmisfit = 0.05",
    "modes, measured rim": f"modes = 10\nmisfit = 0.05\n{RIM}",
    "measured surface, no rim": 'surface = "measured"',
    "measured surface and rim": f'surface = "measured"\n{RIM}',
    "and slack": f'surface = "measured"\n{RIM}\nslack = true',
    "modes, rim, slack": f"modes = 10\n{RIM}\nslack = true\nmisfit = 0.05",
}


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("elements", nargs="?", type=int, default=112)
    parser.add_argument("ways", nargs="*")
    parser.add_argument("--data", type=int)
    given = parser.parse_args()
    elements, source = given.elements, given.data or given.elements
    ways = {name: WAYS[name] for name in given.ways} or WAYS
    repeats = 6 if given.data is None else max(1, round(6 * elements / source))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        truth = write_test(folder, Uneven(repeats=repeats), PRESSURES, source)
        z = truth.mesh.points[:, 2]
        print(f"z0 from {z.min():.2f} to {z.max():.2f} mm; errors of the moduli between a fifth of "
              "the strain reached and all of it")  # fmt: skip
        for name, sheet in ways.items():
            path = folder / "project.toml"
            path.write_text(project_text(PRESSURES, elements, sheet))
            begun = time.perf_counter()
            # Several points at each node, the centre too, are no points without correlation.
            result = fit(read_project(path), trust=["zero-points"])
            off = errors(result.law, result.best.reached)
            numbers = result.findings["uneven"].numbers
            said = numbers["sheet"]
            slack = said["slack_percent"]
            words = "" if slack is None else f", slack {slack[0]:.3f} and {slack[1]:.3f} %"
            print(f"{name:26s} E1 {100 * off['E1']:6.1f} %  E2 {100 * off['E2']:6.1f} %  residual "
                  f"{numbers['mean_abs_mm']:.3f} mm, z0 {said['surface_mm']['least']:.2f} to "
                  f"{said['surface_mm']['largest']:.2f} mm{words}; G12 at rest "
                  f"{float(np.asarray(result.law.modulus('G12', 0.0))):.1f} MPa, "
                  f"{result.result['analyses']} analyses, {time.perf_counter() - begun:.0f} s",
                  flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
