"""Folds: a fit is not given the points left out, and is judged at those."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.fits.project import read_project
from bubblefit.fits.setup import prepare_fit
from bubblefit.studies.folds import validate

#: Without contraction the load is the fabric's 0.8 mm times 25 mm times E ln(1 + elongation / 20).
PROJECT = """
[fabric]
thickness = 0.8
[law]
form = "constant"
nu12 = 0.0
strain_range = [0.14, 0.14, 0.1]
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.02, 1.0]
G12 = [0.005, 0.2]
[[strips]]
increments = 4
match = "points"
warp = { gauge_length = 20, final_length = 22.9 }
fill = { gauge_length = 20, final_length = 22.9 }
[strips.data]
files = ["points.csv"]
"""
#: MPa, of two specimens a direction; each fits a constant modulus exactly.
MODULI = {"warp": (300.0, 360.0), "fill": (200.0, 180.0)}
ELONGATION = np.linspace(0.2, 2.9, 8)


def test_a_fold_errs_by_what_the_specimens_differ_by(tmp_path: Path) -> None:
    """A fit of one specimen is wrong by the other's difference; one of both by half of it."""
    lines, strain = ["direction,specimen,elongation (mm),load (N)"], np.log1p(ELONGATION / 20)
    for direction, moduli in MODULI.items():
        for specimen, modulus in zip("ab", moduli, strict=True):
            loads = 20 * modulus * strain
            lines += [
                f"{direction},{specimen},{u!r},{load!r}"
                for u, load in zip(ELONGATION.tolist(), loads.tolist(), strict=True)
            ]
    (tmp_path / "points.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "project.toml").write_text(PROJECT)
    project = read_project(tmp_path / "project.toml")
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    folds = [fold for fold in validate(setup, 5, 1, 1) if fold is not None]
    assert [fold.fold for fold in folds] == [0, 1]  # as many as specimens
    root_mean_square = float(np.sqrt(np.mean(strain**2)))
    for fold in folds:
        expected = {f"strips: {d}": 20 * abs(a - b) * root_mean_square
                    for d, (a, b) in MODULI.items()}  # fmt: skip
        assert fold.rms == pytest.approx(expected, rel=1e-3)
        assert fold.value == pytest.approx(sum(expected.values()), rel=1e-3)
