"""What a start's result depends on is in the fingerprint of its fit: each thing by itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.materials.forms.trilinear import TriLinear
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs.setup import FitSetup, fingerprints, prepare_fit

from ..projects import small, with_form

Change = Callable[[HypoelasticLaw], HypoelasticLaw]
RANGE = [0.13, 0.13, 0.13]
BREAKS = [[0.03, 0.08]] * 3


def prepared(path: Path) -> FitSetup:
    project = read_project(path)
    return prepare_fit(project, project.chosen(None, fitted=True))


@pytest.fixture(scope="module")
def cubic(tmp_path_factory: pytest.TempPathFactory) -> FitSetup:
    return prepared(small(tmp_path_factory.mktemp("cubic")))


@pytest.fixture(scope="module")
def regions(tmp_path_factory: pytest.TempPathFactory) -> FitSetup:
    breaks = "breaks = { warp = [0.03, 0.08], fill = [0.03, 0.08], shear = [0.03, 0.08] }"
    form = f'form = "trilinear"\n{breaks}'
    return prepared(with_form(tmp_path_factory.mktemp("regions"), form))


def changed(setup: FitSetup, **other: object) -> list[str]:
    """Which parts of the fingerprint another setup has otherwise, its data being the same."""
    problem = setup.problem()
    one, two = fingerprints(setup, problem), fingerprints(replace(setup, **other), problem)  # type: ignore[arg-type]
    assert list(one) == list(two) == ["law", "fit settings", "tests", "data", "solver"]
    return [name for name in one if one[name] != two[name]]


@pytest.mark.parametrize(
    "change",
    [
        {"nu12": 0.25},
        {"strain_range": np.array([0.13, 0.13, 0.14])},
        {"strain_range": np.array([0.12, 0.13, 0.13])},
        {"thickness_change": "incompressible"},
    ],
    ids=["nu12", "shear range", "warp range", "thickness"],
)
def test_every_part_of_the_law_counts(
    cubic: FitSetup, regions: FitSetup, change: dict[str, object]
) -> None:
    for setup in (cubic, regions):
        assert changed(setup, law=replace(setup.law, **change)) == ["law"]  # type: ignore[arg-type]


def test_breaks_count(regions: FitSetup) -> None:
    assert changed(regions, law=replace(regions.law, form=TriLinear.at(BREAKS))) == []
    for component in range(3):
        breaks = np.array(BREAKS)
        breaks[component, 1] = 0.09
        assert changed(regions, law=replace(regions.law, form=TriLinear.at(breaks))) == ["law"]


def test_bounds_settings_tests_and_solver_count(cubic: FitSetup) -> None:
    project, limits = cubic.project, cubic.bounds
    assert limits.upper is not None
    wider = replace(limits, upper=1.01 * limits.upper)
    assert changed(cubic) == []
    assert changed(cubic, bounds=wider) == ["law"]
    thicker = replace(project, fabric=replace(project.fabric, thickness=0.9))
    assert changed(cubic, project=thicker) == ["law"]
    assert changed(cubic, project=project.with_fit(seed=77)) == ["fit settings"]
    assert changed(cubic, project=project.with_fit(solver="calculix")) == ["solver"]
    # More starts, or other processes, leave those that ended as they are.
    assert changed(cubic, project=project.with_fit(starts=3, jobs=1)) == []
    (test,) = cubic.tests
    finer = replace(test, test=replace(test.test, elements=108))
    assert changed(cubic, tests=(finer,)) == ["tests"]


def test_measured_values_count(cubic: FitSetup) -> None:
    one, two = cubic.problem(), cubic.problem()
    (comparison,) = two.comparisons
    target = comparison.objective.targets[0]
    target.displacement[3, 2] += 1e-9
    assert fingerprints(cubic, one)["data"] != fingerprints(cubic, two)["data"]
