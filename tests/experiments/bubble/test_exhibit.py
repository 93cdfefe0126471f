"""What a bubble puts on the page of a fit: facts, and the tables of its misfit."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble import report as figures
from bubblefit.experiments.bubble.findings import INVERSE_CRIME, SURFACES, match_warnings
from bubblefit.experiments.bubble.objective import FieldObjective, FieldTarget
from bubblefit.experiments.bubble.report import misfit_table, residuals, surface_tables
from bubblefit.experiments.kinds import FittedTest, Output
from bubblefit.project.project import read_project
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...projects import small


def facts(shift: Any = None, pressure: Any = None, doubtful: int = 0, outside: int = 0) -> Any:
    sheet = {
        "measured_rms_mm": None, "modes_mm": {}, "surface_mm": {}, "slack_percent": None,
        "rim_motion_mm": None, "constant_field_rms_mm": None, "from_pressure_kPa": 35.0,
    }  # fmt: skip
    numbers = {
        "mean_abs_mm": 0.125,
        "data": {"doubtful_dropped": doubtful, "outside_dropped": outside},
        "nuisance": {"displacement_offset_mm": shift, "pressure_offset_kPa": pressure},
        "sheet": sheet,
    }
    return figures._facts(None, SimpleNamespace(numbers=numbers))


def test_facts():
    first, last = (
        ("mean |dx| + |dy| + |dz|, mm", 0.125), ("sheet", "displacements counted from 35 kPa")
    )  # fmt: skip
    assert facts() == [first, last]
    assert facts([0.1, -0.2, 0.33333], -1.5, 3, 7) == [
        first, ("points left out", "3 doubtful, 7 beyond the rim"),
        ("displacement offset, mm", "0.100, -0.200, 0.333"), ("pressure offset, kPa", "-1.500"),
        last,
    ]  # fmt: skip
    for one in ({"doubtful": 1}, {"outside": 2}):
        assert len(facts(**one)) == 3


@pytest.mark.parametrize(("objective", "scales"), [("mm", (1, 1, 1)), ("e", (2, 4, 5))])
def test_misfit_by_pressure(objective, scales):
    read = np.array([[[2.0, 4.0, 5.0]], [[2.0, 4.0, -5.0]]])
    moved = read + np.array([[[0.1, 0.2, -0.4]], [[0.5, 0.0, 0.3]]])
    targets = [FieldTarget(p, u) for p, u in zip((0.02, 0.2), read, strict=True)]
    comparison = SimpleNamespace(objective=FieldObjective(targets, objective))
    history = History(np.array([0.02, 0.2]), moved, np.zeros(3), np.zeros(3))
    fitted: Any = SimpleNamespace(comparisons=[comparison], histories=[history], nuisance={})
    prepared: Any = SimpleNamespace(test=SimpleNamespace(objective=objective))
    comparison.model = SimpleNamespace(mesh=SimpleNamespace(points=np.array([[7.0, 8.0, 0.0]])))
    each = residuals(prepared, fitted)
    assert each.index.tolist() == [0, 1, 2, 3, 4, 5]
    assert list(each.columns) == [
        "part", "frame", "pressure_kPa", "x_mm", "y_mm", "quantity", "measured", "modelled",
        "difference", "unit",
    ]  # fmt: skip
    assert each.iloc[5].tolist()[:6] == ["bubble", 2, 200.0, 7.0, 8.0, "dz"]
    assert each.iloc[5].tolist()[6:9] == pytest.approx([-5.0, -4.7, 0.3])
    assert each["frame"].tolist() == [1, 1, 1, 2, 2, 2] and set(each["unit"]) == {"mm"}
    table = misfit_table(prepared, fitted)
    assert (table.title, table.header) == (
        "Misfit by pressure", ["pressure, kPa", "x", "y", "z"]
    )  # fmt: skip
    off = np.array([[0.1, 0.2, 0.4], [0.5, 0.0, 0.3]]) / scales
    np.testing.assert_allclose(table.rows, np.column_stack([[20.0, 200.0], off]), atol=1e-12)
    assert ("in mm" in table.note) is (objective == "mm")


def test_how_well_surfaces_follow():
    surface = SimpleNamespace(r_squared=np.array([0.999994, 0.5, 1.0]))
    test = SimpleNamespace(match_by="points", match_degree=6, pressures=(0.02,))
    prepared: Any = SimpleNamespace(test=test, surfaces=[])
    assert surface_tables(prepared) == []
    prepared.surfaces = [surface]
    (table,) = surface_tables(prepared)
    assert table.title == "R\u00b2 of polynomial surfaces of degree 6"
    assert table.rows == [[20.0, "0.99999", "0.50000", "1.00000"]]
    assert table.note == "for the record: the fit matched the points themselves"
    test.match_by = "surfaces"
    assert surface_tables(prepared)[0].note == ""


#: kPa and mm, as unknowns of a fit.
PRESSURE, SHIFT = 2.0, [0.1, -0.2, 0.3]


def test_offsets_are_what_was_fitted_in_the_units_said(tmp_path):
    on = [
        (f"{name} = false", f"{name} = true") for name in ("displacement_offset", "pressure_offset")
    ]
    project = read_project(small(tmp_path, *on))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,), problem = setup.tests, setup.problem()
    law = prepared.known
    y = problem.unknowns.at(law.beta)
    y[problem.unknowns.size :] = [*SHIFT, PRESSURE]
    point = problem.evaluate(y, False, warm=False)
    # As many kPa are added to every pressure of the model, which is in MPa.
    (history,) = point.histories
    model = prepared.test.model().with_parameters({"pressure_offset": 1e-3 * PRESSURE})
    moved = MembraneSolver().run(model, law)
    np.testing.assert_allclose(history.displacement, moved.displacement, atol=1e-7)
    nuisance = problem.unknowns.nuisance_values("bubble", y)
    reached = np.array([0.1, 0.2, 0.3])
    own = setup.own(prepared)
    fitted = FittedTest(own, (history,), nuisance, law, [law], reached, reached, None)
    findings = figures.findings(prepared, fitted)
    said = findings.numbers["nuisance"]
    assert said["pressure_offset_kPa"] == pytest.approx(PRESSURE)
    assert said["displacement_offset_mm"] == pytest.approx(SHIFT)
    assert "offset_y -0.200 mm" in findings.lines[-1] and "2.000 kPa" in findings.lines[-1]
    # The law is the known solution, over the strain that was reached.
    assert findings.numbers["moduli_error"] == {"E1": 0.0, "E2": 0.0, "G12": 0.0}
    ranges = {"E1": [0.0, 0.1], "E2": [0.0, 0.2], "G12": [0.0, 0.3]}
    assert findings.numbers["moduli_error_range"] == ranges
    (line,) = [one for one in findings.lines if "error of the moduli" in one]
    for words in ("E1 0 % (strain 0 to 0.1)", "E2 0 % (strain 0 to 0.2)", "strain 0 to 0.3"):
        assert words in line
    facts = dict(figures.show(prepared, fitted, findings, Output(tmp_path / "out")).facts)
    assert facts["pressure offset, kPa"] == "2.000"
    assert facts["displacement offset, mm"] == "0.100, -0.200, 0.300"
    # At the known moduli every difference is the offsets': mean |dx| + |dy| + |dz|.
    off = moved.displacement + SHIFT - np.array([f.displacement for f in prepared.fields])
    assert findings.numbers["mean_abs_mm"] == pytest.approx(np.abs(off).sum(axis=2).mean())


@pytest.mark.parametrize("by_this_model", [False, True])
def test_what_is_warned_of_before_the_numbers_are_used(by_this_model):
    def told(by, degree):
        test = SimpleNamespace(match_by=by, match_degree=degree)
        prepared: Any = SimpleNamespace(test=test, by_this_model=by_this_model)
        return [note.kind for note in match_warnings(prepared)]

    crime = [INVERSE_CRIME] * by_this_model
    assert told("points", 4) == told("points", 6) == told("surfaces", 6) == crime
    assert told("surfaces", 5) == [*crime, SURFACES]
