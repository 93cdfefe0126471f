"""Folds of a cross-validation: nothing of the specimens that are left out is in a fold's fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.project.project import read_project
from bubblefit.runs.compare import fit_of, folds, specimens_of
from bubblefit.runs.setup import FitSetup, prepare_fit

PROJECT = """
[fabric]
name = "made"
thickness = 0.8
[law]
form = "trilinear"
strain_range = [0.14, 0.18, 0.1]
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.02, 1.0]
G12 = [0.005, 0.2]
[[strips]]
increments = 4
match = "points"
objective = "OBJECTIVE"
warp = { gauge_length = 20 }
fill = { gauge_length = 20 }
[strips.data]
files = ["points.csv"]
[fit]
seed = 3
jobs = 1
"""
#: mm at the last point of specimens a, b and c.
ENDS = (2.9, 2.8, 3.0)
LEFT_OUT = 2


def setup_in(folder: Path, factor: float = 1.0, objective: str = "N") -> FitSetup:
    """Three specimens a direction; the loads of the last are bent up by a factor at their end."""
    lines = ["direction,specimen,elongation (mm),load (N)"]
    for direction, stiff in (("warp", 400.0), ("fill", 250.0)):
        for number, end in enumerate(ENDS):
            u = np.linspace(0.2, end, 9)
            strain = np.log1p(u / 20) * (1 + 0.01 * number)
            load = 20 * stiff * strain * (1 - 3 * strain + 14 * strain**2)
            if number == LEFT_OUT:
                load *= 1 + (factor - 1) * (u / end) ** 3
            name = "abc"[number]
            points = zip(u, load.tolist(), strict=True)
            lines += [f"{direction},{name},{a:.4f},{b!r}" for a, b in points]
    (folder / "points.csv").write_text("\n".join(lines) + "\n")
    (folder / "project.toml").write_text(PROJECT.replace("OBJECTIVE", objective))
    project = read_project(folder / "project.toml")
    return prepare_fit(project, list(project.tests.values()))


def without_the_last(setup: FitSetup) -> dict[str, np.ndarray]:
    """The masks of the fold that leaves the last specimen of both directions out."""
    return {name: np.array(whose) != LEFT_OUT for name, whose in specimens_of(setup).items()}


@pytest.mark.parametrize("objective", ["N", "relative"])
def test_a_fold_knows_nothing_of_what_it_leaves_out(tmp_path: Path, objective: str) -> None:
    """Law (strain range, breaks), starts and optimum: the very same whatever the others show."""
    fits = []
    for factor in (1.0, 1.8):
        setup = setup_in(tmp_path, factor, objective)
        fits.append((setup, *fit_of(setup, without_the_last(setup), starts=1)))
    (whole, own, unknowns), (other_whole, other, same) = fits
    assert own.law.form.to_card() == other.law.form.to_card()
    np.testing.assert_array_equal(own.law.strain_range, other.law.strain_range)
    np.testing.assert_array_equal(unknowns, same)
    # What is left out does change the fit of all points, and the breaks of its law.
    assert whole.law.form.to_card() != other_whole.law.form.to_card()


def test_the_strains_of_a_fold_are_its_own_specimens_(tmp_path: Path) -> None:
    setup = setup_in(tmp_path)
    (test,) = setup.tests
    reach = test.reach(without_the_last(setup))
    assert test.test.reach.strain[:2] == pytest.approx((np.log1p(3.0 / 20),) * 2)
    assert reach.strain[:2] == pytest.approx((np.log1p(2.9 / 20),) * 2)


def test_every_specimen_is_left_out_once(tmp_path: Path) -> None:
    setup = setup_in(tmp_path)
    parts, whose = folds(setup, 5), specimens_of(setup)
    assert len(parts) == len(ENDS)
    for name, numbers in whose.items():
        left = [{numbers[i] for i in np.flatnonzero(~part[name])} for part in parts]
        assert sorted(map(list, left)) == [[0], [1], [2]]
