"""What a sheet that was neither flat nor taut does to the moduli, and what makes up for it.

Usage: bench_reference_surface.py [ELEMENTS [WAY ...]]. A computed test (height 4 mm without
symmetry, slack 0.1 %, a rim that moves by 2 mm, 0.05 mm noise in every number, z included) is
fitted with what [bubble.sheet] offers, on the mesh of the data: 112 quads, six points a node.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from bubblefit.fits.fit import fit
from bubblefit.fits.project import read_project
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
    elements = int(sys.argv[1]) if len(sys.argv) > 1 else 112
    ways = {name: WAYS[name] for name in sys.argv[2:]} or WAYS
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        truth = write_test(folder, Uneven(repeats=6), PRESSURES, elements)
        z = truth.mesh.points[:, 2]
        print(f"z0 from {z.min():.2f} to {z.max():.2f} mm; errors of the moduli between a fifth of "
              "the strain reached and all of it")  # fmt: skip
        for name, sheet in ways.items():
            path = folder / "project.toml"
            path.write_text(project_text(PRESSURES, elements, sheet))
            begun = time.perf_counter()
            result = fit(read_project(path))
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
