"""One computed bubble in every export of image correlation: the same data and the same fit."""

from __future__ import annotations

import re

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.kinds import Weighting
from bubblefit.runs.setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...commands import in_process, result_in
from ...dic_exports import EXPORTS
from ...projects import EASY, small

DATA = re.compile(r"(?m)^\[bubble\.data\.known_solution\].*?(?=^\[fit\])", re.S)


@pytest.fixture(scope="module")
def bubble(tmp_path_factory):
    """The text of a project of computed data, and its frames."""
    return computed(tmp_path_factory.mktemp("computed"), ("elements = 48", "elements = 108"))


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """The same of two pressures and a law of constant moduli, for whole fits."""
    changes = (("[22, 59, 97, 132, 186, 251, 300]", "[59, 186]"),)
    text, frames = computed(tmp_path_factory.mktemp("coarse"), *changes)
    first, last = text.index("# Table 4.2. Order"), text.index("[[bubble]]")
    margin = next(line for line in text.splitlines() if line.startswith("margin"))
    text = (text[:first] + EASY + text[last:]).replace(margin, "")
    return text.replace('form = "cubic"', 'form = "constant"'), frames


def computed(folder, *changes):
    """The text of the known-solution example, whole, and its frames."""
    path = small(folder, *changes)
    path.write_text(path.read_text().replace('symmetry = "quarter"', 'symmetry = "full"'))
    project = bf.read_project(path)
    test = project.tests["bubble"]
    fields = test.prepare(law_of(project, [test.reach]), MembraneSolver).fields
    points = np.column_stack([fields[0].points, np.zeros(len(fields[0].points))])
    return path.read_text(), [(points, field.displacement) for field in fields]


def project_of(bubble, folder, case: str):
    text, frames = bubble
    files = [file.name for file in EXPORTS[case][1](folder, frames)]
    path = folder / "project.toml"
    path.write_text(DATA.sub(f"[bubble.data.points]\nfiles = {files}\n\n", text))
    return path


def targets(path) -> list[np.ndarray]:
    project = bf.read_project(path)
    test = project.tests["bubble"]
    prepared = test.prepare(law_of(project, [test.reach]), MembraneSolver)
    (comparison,) = prepared.comparisons(MembraneSolver, Weighting(False, 1.0))
    return [target.displacement for target in comparison.objective.targets]


@pytest.mark.parametrize("case", [case for case in EXPORTS if case != "plain"])
def test_a_fit_gets_the_same_data_from_every_export(bubble, tmp_path, case):
    (tmp_path / "plain").mkdir()
    expected = targets(project_of(bubble, tmp_path / "plain", "plain"))
    for one, other in zip(targets(project_of(bubble, tmp_path, case)), expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9)


def constant_fit(coarse, folder, case: str) -> np.ndarray:
    """Moduli of a whole fit, one start."""
    result = bf.fit(bf.read_project(project_of(coarse, folder, case)), starts=1, jobs=1)
    return np.array([float(result.law.modulus(name, 0.0)) for name in ("E1", "E2", "G12")])


@pytest.fixture(scope="module")
def plain_moduli(coarse, tmp_path_factory) -> np.ndarray:
    return constant_fit(coarse, tmp_path_factory.mktemp("plain"), "plain")


@pytest.mark.parametrize("case", [case for case in EXPORTS if case != "plain"])
def test_the_moduli_are_the_same_from_every_export(coarse, plain_moduli, tmp_path, case):
    moduli = constant_fit(coarse, tmp_path, case)
    np.testing.assert_allclose(moduli, plain_moduli, rtol=1e-9)


def test_the_fit_is_the_same_and_says_what_was_read(bubble, tmp_path):
    results = []
    for case in ("plain", "pyaldic"):
        folder = tmp_path / case
        folder.mkdir()
        path = project_of(bubble, folder, case)
        done = in_process(
            "bubble", path, "--starts", 1, "--jobs", 1, "--out", folder / "out", cwd=folder
        )
        results.append(result_in(folder / "out"))
    assert "data: y and z are turned over" in done.output
    assert "data: x, y, z are places in the deformed state" in done.output
    plain, other = results
    np.testing.assert_allclose(other["beta"]["values"], plain["beta"]["values"], rtol=1e-6)
    assert plain["data"]["dropped"] == {} and plain["data"]["read"]["format"] == "csv"
    assert other["data"]["dropped"] == {"without a value": 7}
    assert other["data"]["read"]["columns"]["dz"] == "W"
