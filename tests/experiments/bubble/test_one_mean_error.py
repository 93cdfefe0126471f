"""One error of a bubble: that of `fit` is that of the displacements that `simulate test` writes."""

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.runs.simulation import simulate_cards

from ...builders.projects import known_bubble_of_form


def leaves_of(numbers):
    """Yield every key of nested dictionaries."""
    for key, value in numbers.items():
        yield str(key)
        if isinstance(value, dict):
            yield from leaves_of(value)


def test_simulated_displacements_have_the_mean_error_of_the_fit(tmp_path):
    path = known_bubble_of_form(tmp_path, 'form = "constant"')
    project = bf.read_project(path).with_fit(jobs=1, mesh_error="told")
    fit = bf.fit(project, starts=1)
    ((name, findings),) = fit.findings.items()
    tests = [project.tests[name]]
    simulation = simulate_cards(project, tests, {"fitted": fit.card}, tmp_path / "out")
    table = pd.read_csv(tmp_path / "out" / "displacement.csv")
    simulated = [
        frame.sort_values("node")[["dx_mm", "dy_mm", "dz_mm"]].to_numpy()
        for _, frame in table.groupby("pressure_kPa")
    ]
    (prepared,) = fit.setup.tests
    (comparison,) = fit.problem.comparisons
    error = comparison.objective.mean_absolute(np.array(simulated))
    assert prepared.known is not None and error > 0
    assert findings.numbers["mean_abs_mm"] == pytest.approx(error, rel=1e-3)
    # A simulation compares with nothing: it has no error that could differ from that of the fit.
    keys = set(leaves_of(simulation.numbers))
    assert not {key for key in keys if "rms" in key or "mean_abs" in key}
