"""Bubble tests 1 to 3 of VALMEX 7318, of which the surface of the reference picture is unknown.

Usage: bench_real_tests.py [--data DIR] [--elements N] [--modes N] [--starts N]
[--without-strips | --with-strips] [TEST ...].
For every test one line of its fit with z0 of few modes, without the strips (G12 from the bubble
alone) and with them, and z0 at the three points where it was measured. Moduli are quadratic in
the strain (with the strips: splines, because the strips go to far larger strains); pressures are
eleven of the twenty, thickness incompressible. A flat sheet: --modes 0.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from bubblefit.experiments.bubble.findings import fitted_model
from bubblefit.meshes.mesh import sampling_matrix
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit
from bubblefit.runs.result import Fit
from valmex_tests import DATA, FABRIC, FEW, FIT, bubbles, published_strips

STRAIN = 0.06

ALONE = 'form = "quadratic"\nstrain_range = [0.13, 0.13, 0.13]'
JOINT = """\
form = "spline"
strain_range = [0.18, 0.232, 0.883]
knots = { warp = [0.0, 0.03, 0.06, 0.12, 0.18], fill = [0.0, 0.03, 0.06, 0.12, 0.232],\
 shear = [0.0, 0.1, 0.3, 0.6, 0.883] }"""


def fitted(test: int, data: Path, elements: int, modes: int, starts: int, strips: bool) -> Fit:
    """The fit of one test."""
    law = JOINT if strips else ALONE
    own = bubbles({"bubble": test}, data, FEW, elements, modes)
    also = published_strips() if strips else ""
    text = f"{FABRIC}{law}\n{own}{also}{FIT.format(starts=starts)}"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "project.toml"
        path.write_text(text)
        return fit(read_project(path, data={"bubble": data}))


def heights(result: Fit, test: int, data: Path) -> str:
    """z0 at the three points, found and measured."""
    first = pd.read_csv(data / f"points_test{test}.csv", comment="#").iloc[0]
    places = np.array([[first[f"x{k}"], first[f"y{k}"]] for k in "ABC"])
    mesh = fitted_model(result.tests["bubble"]).mesh
    z = sampling_matrix(mesh, places)[0] @ mesh.points[:, 2]
    pairs = [f"{own:.2f} ({first[f'z{k}']:.2f})" for own, k in zip(z, "ABC", strict=True)]
    return "z0 at A, B, C (measured) " + ", ".join(pairs)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("tests", nargs="*", type=int)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--elements", type=int, default=112)
    parser.add_argument("--modes", type=int, default=10)
    parser.add_argument("--starts", type=int, default=3)
    parser.add_argument("--without-strips", action="store_true")
    parser.add_argument("--with-strips", action="store_true")
    given = parser.parse_args()
    kinds = [False] * (not given.with_strips) + [True] * (not given.without_strips)
    for strips in kinds:
        print("with strips" if strips else "without strips", flush=True)
        for test in given.tests or (1, 2, 3):
            result = fitted(test, given.data, given.elements, given.modes, given.starts, strips)
            e1, e2 = (float(result.law.modulus(n, STRAIN)) / 1e3 for n in ("E1", "E2"))
            g12 = float(result.law.modulus("G12", STRAIN))
            left = result.findings["bubble"].numbers["mean_abs_mm"]
            print(f"test {test}: E1 {e1:.3f} GPa, E2 {e2:.3f} GPa at {STRAIN}, residual "
                  f"{left:.2f} mm", flush=True)  # fmt: skip
            print(f"    G12 {g12:.1f} MPa; {heights(result, test, given.data)}; "
                  f"{result.result['analyses']} analyses", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
