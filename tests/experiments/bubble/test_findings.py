"""What a fit says of a bubble: offsets, in the units that it names."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble.findings import _warnings
from bubblefit.experiments.kinds import FittedTest, Output
from bubblefit.notes import NoteKind
from bubblefit.project.project import read_project
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...projects import small

#: kPa and mm, as unknowns of a fit.
PRESSURE, SHIFT = 2.0, [0.1, -0.2, 0.3]


def test_offsets_are_what_was_fitted_in_the_units_said(tmp_path: Path) -> None:
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
    findings = prepared.findings(fitted)
    said = findings.numbers["nuisance"]
    assert said["pressure_offset_kPa"] == pytest.approx(PRESSURE)
    assert said["displacement_offset_mm"] == pytest.approx(SHIFT)
    assert findings.lines[-1] == (
        "nuisance: offset_x 0.100 mm, offset_y -0.200 mm, offset_z 0.300 mm, "
        "pressure_offset 2.000 kPa"
    )
    # The law is the known solution, over the strain that was reached.
    assert findings.numbers["moduli_error"] == {"E1": 0.0, "E2": 0.0, "G12": 0.0}
    ranges = {"E1": [0.0, 0.1], "E2": [0.0, 0.2], "G12": [0.0, 0.3]}
    assert findings.numbers["moduli_error_range"] == ranges
    assert (
        "largest error of the moduli over the strain reached: E1 0 % (strain 0 to 0.1), "
        "E2 0 % (strain 0 to 0.2), G12 0 % (strain 0 to 0.3)"
    ) in findings.lines
    facts = dict(prepared.show(fitted, findings, Output(tmp_path / "out")).facts)
    assert facts["pressure offset, kPa"] == "2.000"
    assert facts["displacement offset, mm"] == "0.100, -0.200, 0.300"
    # At the known moduli every difference is the offsets': mean |dx| + |dy| + |dz|.
    off = moved.displacement + SHIFT - np.array([f.displacement for f in prepared.fields])
    assert findings.numbers["mean_abs_mm"] == pytest.approx(np.abs(off).sum(axis=2).mean())


@pytest.mark.parametrize("by_this_model", [False, True])
def test_what_is_warned_of_before_the_numbers_are_used(by_this_model: bool) -> None:
    """Surfaces of a low degree, where they are what is matched; data of the fit's own model."""

    def told(by: str, degree: int) -> list[NoteKind]:
        test = SimpleNamespace(match_by=by, match_degree=degree)
        prepared: Any = SimpleNamespace(test=test, by_this_model=by_this_model)
        return [note.kind for note in _warnings(prepared)]

    crime = [NoteKind.INVERSE_CRIME] * by_this_model
    assert told("points", 4) == told("points", 6) == told("surfaces", 6) == crime
    assert told("surfaces", 5) == [*crime, NoteKind.SURFACES]
