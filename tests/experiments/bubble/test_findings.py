"""experiments/bubble/findings.py: numbers of a fitted sheet in their units."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.base import FittedTest
from bubblefit.experiments.bubble import findings as sheet_report
from bubblefit.experiments.bubble.section import SheetSettings
from bubblefit.experiments.data_files import Output
from bubblefit.meshes.disk import disk_mesh
from bubblefit.reports.kinds import bubble as report
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup, known_bubble
from .cases import fitted_sheet

MESH = disk_mesh(100.0, 16)
#: mm, the surface in the reference picture; that of the two modes is 1 and x in radii.
Z0 = 0.02 * MESH.points[:, 0] - 0.5
METRIC = {"metric_warp_1": 0.1, "metric_fill_1": 0.2, "metric_shear_1": 0.3}
ALL = SheetSettings(
    measured=True,
    modes=2,
    slack=True,
    moving_rim=True,
    constant=(0, 2),
    reference_frame=0,
    metric=1,
)  # of a project never all at once


def test_numbers_of_a_fitted_sheet():
    found = sheet_report.sheet_numbers(*fitted_sheet(ALL))
    heights = Z0 + 2.0 + 0.03 * MESH.points[:, 0]
    assert found == {
        "used": [
            "measured surface", "modes", "slack", "metric", "measured rim", "constant field",
            "loaded reference frame",
        ],
        "surface_mm": pytest.approx({"least": heights.min(), "largest": heights.max()}),
        "measured_rms_mm": 0.0456, "modes_mm": {"z0_1": 2.0, "z0_x": 3.0},
        "metric_percent": METRIC,
        "slack_percent": pytest.approx([0.05, -0.1]), "tension_N_per_mm": None,
        "rim_motion_mm": pytest.approx(1.3),
        "constant_field_rms_mm": pytest.approx({"dx": 0.3, "dz": 0.4}),
        "from_pressure_kPa": pytest.approx(20.0),
    }  # fmt: skip
    (line,) = sheet_report.sheet_lines(found)
    for words in ("0.046 mm", "2 modes", "-3.50 to 6.50 mm", "0.050 % in warp, -0.100 % in fill",
                  "3 unknowns: 0.100 % in warp, 0.200 % in fill, 0.300 % in shear", "1.30 mm",
                  "dx 0.30 mm RMS, dz 0.40 mm RMS", "20 kPa"):  # fmt: skip
        assert words in line
    nothing = sheet_report.sheet_numbers(*fitted_sheet(SheetSettings()))
    assert nothing.pop("surface_mm") == {"least": 0.0, "largest": 0.0}
    assert nothing.keys() < found.keys() and not any(nothing.values())


@pytest.mark.parametrize(
    ("sheet", "known", "warned"),
    [
        (SheetSettings(), None, 1), (SheetSettings(slack=True), None, 1),
        (SheetSettings(moving_rim=True), None, 1), (SheetSettings(measured=True), None, 0),
        (SheetSettings(modes=1), None, 0), (SheetSettings(reference_frame=0), None, 0),
        (SheetSettings(constant=(0,)), None, 0), (SheetSettings(), "a law", 0),
    ],
)  # fmt: skip
def test_sheet_without_settings_has_no_numbers(sheet, known, warned):
    own = SimpleNamespace(sheet=sheet, match_by="points")
    test = SimpleNamespace(known=known, test=own, by_this_model=False)
    assert [n.kind for n in sheet_report.warnings_of(test)] == [sheet_report.FLAT_SHEET] * warned


#: kPa and mm, as unknowns of a fit.
PRESSURE, SHIFT = 2.0, [0.1, -0.2, 0.3]


def test_offsets_are_reported_in_their_units(tmp_path):
    on = [
        (f"{name} = false", f"{name} = true") for name in ("displacement_offset", "pressure_offset")
    ]
    setup = fit_setup(known_bubble(tmp_path, *on))
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
    own = setup.comparisons_of(prepared)
    fitted = FittedTest(own, (history,), nuisance, law, [law], reached, reached, None)
    findings = report.findings(prepared, fitted)
    said = findings.numbers["nuisance"]
    assert said["pressure_offset_kPa"] == pytest.approx(PRESSURE)
    assert said["displacement_offset_mm"] == pytest.approx(SHIFT)
    assert "offset_y -0.200 mm" in findings.lines[-1] and "2.000 kPa" in findings.lines[-1]
    # The law is the known solution, over the strain that was reached.
    assert findings.numbers["moduli_error"] == {"E1": 0.0, "E2": 0.0, "G12": 0.0}
    ranges = {"E1": [0.0, 0.1], "E2": [0.0, 0.2], "G12": [0.0, 0.3]}
    assert findings.numbers["moduli_error_range"] == ranges
    facts = dict(report.show(prepared, fitted, findings, Output(tmp_path / "out")).facts)
    assert facts["pressure offset, kPa"] == "2.000"
    assert facts["displacement offset, mm"] == "0.100, -0.200, 0.300"
    # At the known moduli every difference is the offsets': mean |dx| + |dy| + |dz|.
    off = moved.displacement + SHIFT - np.array([f.displacement for f in prepared.fields])
    assert findings.numbers["mean_abs_mm"] == pytest.approx(np.abs(off).sum(axis=2).mean())
