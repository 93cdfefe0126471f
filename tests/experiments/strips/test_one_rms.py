"""One RMS error: `fit` and `simulate test` of one card and one set of data have the same."""

import bubblefit as bf
import pytest
from bubblefit.project.project import read_project
from bubblefit.reports.kinds.strips import rms_of_loads

from ...builders.projects import constant_strips


@pytest.mark.parametrize("match", ["points", "polynomial"])
def test_simulated_loads_have_the_rms_error_of_the_fit(tmp_path, match):
    path = constant_strips(tmp_path)
    path.write_text(path.read_text().replace('match = "points"', f'match = "{match}"'))
    project = read_project(path).with_fit(jobs=1)
    fit = bf.fit(project, starts=1)
    solver = fit.setup.make_solver()
    for name, findings in fit.findings.items():
        test = project.tests[name]
        for direction, model in test.models().items():
            history = solver.run(model, fit.card.law)
            end = float(model.elongations[-1])
            found = rms_of_loads(test, test.strips[direction], model, history, end)
            told = findings.numbers["directions"][direction]["rms_N"]
            assert found == pytest.approx(told, rel=1e-5)
