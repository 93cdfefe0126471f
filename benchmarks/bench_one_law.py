"""Fit one law to strips and bubbles of one fabric, form by form, and beside each of them alone.

One line a fit: `FORM, of what: strips X N (scatter Y), test K Z mm`. Any bubble in the folder is
taken (grid/testK_00.csv ...), at the pressures of grid_pressures.csv.
"""

import re

import numpy as np
import pandas as pd
from bench_valmex import DATA, FEW, JOINT, measured, moduli, project
from bubblefit.errors import BubblefitError
from bubblefit.runs.fit import fit
from common import SHARED, start_on

FORMS = ("spline", "spline-ratio", "load-ratio")
#: Increments of a strip: 100 change its load by less than 0.01 N.
INCREMENTS = 25


def joint(*forms, data=DATA, elements=112, modes=10, starts=1, unknowns=""):
    """Print the misfit of strips and of every bubble, joint and alone, for each form."""
    folder = measured(data)
    known = sorted({re.match(r"test(.+)_\d+", f.name)[1] for f in (folder / "grid").glob("test*")})
    scatter = scatter_of_strips()
    for form in forms or FORMS:
        law = JOINT.replace('"spline"', f'"{form}"')
        law = law if "spline" in form else re.sub(r"(?m)^knots.*\n(.*)$", "", law)
        for of, tests, strips in [
            ("joint", known, INCREMENTS), ("strips alone", [], INCREMENTS),
            *((f"test {k} alone", [k], 0) for k in known),
        ]:  # fmt: skip
            names = {f"test {k}": k for k in tests}
            own = project(law, names, folder, FEW, elements, modes, starts, strips, unknowns)
            try:
                found = fit(own.with_fit(mesh_error="told"))
            except BubblefitError as error:
                print(f"{form}, {of}: {error}", flush=True)
                continue
            parts = []
            for name, findings in found.findings.items():
                numbers = findings.numbers
                if name == "strips":
                    parts.append(f"strips {numbers['e_uniaxial_N']:.1f} N (scatter {scatter:.1f})")
                else:
                    parts.append(f"{name} {numbers['mean_abs_mm']:.3f} mm")
            print(f"{form}, {of}: {', '.join(parts)}; {moduli(found.law)}; "
                  f"{found.result['analyses']} analyses", flush=True)  # fmt: skip


def scatter_of_strips():
    """Return the sum over the directions of the RMS distance of points from their polynomial, N."""
    file = SHARED / "uniaxial" / "valmex7318_load_gauge.csv"
    if not file.is_file():
        return float("nan")
    table, total = pd.read_csv(file, comment="#"), 0.0
    for _, own in table.groupby("series"):
        u, load = own.gauge_disp_mm.to_numpy(), own.load_N.to_numpy()
        terms = u[:, None] ** np.arange(1, 5)
        left = load - terms @ np.linalg.lstsq(terms, load, rcond=None)[0]
        total += float(np.sqrt(np.mean(left**2)))
    return total


if __name__ == "__main__":
    start_on(joint)
