"""solvers/bars.py: bars by which `doctor` proves a solver."""

import csv

import numpy as np
from bubblefit.solvers.bars import BARS

from ..support.paths import PUBLISHED


def test_doctor_bars_are_the_published_ones():
    text = (PUBLISHED / "marc_uniaxial_end_stress.csv").read_text()
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    for row, bar in zip(rows, BARS, strict=True):
        assert (row["model"], row["direction"]) == (bar.model, bar.direction)
        assert [float(row[f"c{i}"]) for i in range(4)] == list(bar.modulus)
        assert float(row["end_strain_engineering"]) == bar.elongation
        assert float(row["marc_end_stress_MPa"]) == bar.stress
    # The integral of the published coefficients itself is up to 6e-5 off the published stress.
    for bar in BARS:
        antiderivative = np.polyint(1e3 * np.array(bar.modulus[::-1]))
        exact = np.polyval(antiderivative, np.log1p(bar.elongation))
        assert abs(exact / bar.stress - 1) < 6e-5
