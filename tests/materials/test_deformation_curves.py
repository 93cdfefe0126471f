"""materials/deformation_curves.py: strips and trellis in all measures."""

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.deformation_curves import trellis_angle, trellis_curve, uniaxial_curve
from bubblefit.materials.law import HypoelasticLaw
from scipy.integrate import cumulative_trapezoid, trapezoid

from ..builders.fortran import GONE, LAWS
from ..support.refusals import complaint


@pytest.mark.parametrize("name", ["cubic", "incompressible", "tri-linear", "spline"])
def test_curves_of_all_measures_do_equal_work(name):
    """The stress over the trellis' angle is work-conjugate, too."""
    law, log_strain = LAWS[name], np.linspace(0, 0.12, 100)
    curves = {m: uniaxial_curve(law, 1, log_strain, m) for m in ("true", "nominal", "green")}
    work = {measure: trapezoid(y, x) for measure, (x, y) in curves.items()}
    assert work["green"] == pytest.approx(work["nominal"], rel=1e-4)
    areas = curves["nominal"][1][1:] * np.exp(log_strain[1:]) / curves["true"][1][1:]
    stress = curves["true"][1] * np.concatenate([[1.0], areas])
    assert trapezoid(stress, log_strain) == pytest.approx(work["green"], rel=1e-4)
    angles = np.linspace(0, 0.25, 251)
    _, stress, _ = trellis_curve(law, angles, "nominal")
    green, pk2, _ = trellis_curve(law, angles, "green")
    work = cumulative_trapezoid(pk2, green)
    np.testing.assert_allclose(cumulative_trapezoid(stress, angles), work, rtol=1e-4, atol=1e-9)
    gamma, _, _ = trellis_curve(law, angles[1:], "true")
    assert [trellis_angle(g) for g in gamma] == pytest.approx(list(angles[1:]), rel=1e-9)


def test_law_that_fails_on_the_way_has_no_curve():
    with pytest.raises(InputError, match=r"is not positive at 4\.95 % of log strain"):
        uniaxial_curve(GONE, 0, np.linspace(0, 0.1, 101), "true")
    weak = HypoelasticLaw(np.r_[0, 0, -1e3, 20.0, 0, 0, 0, 100.0, 0, 0, 0, 500.0])
    assert "trellis" in complaint(trellis_curve, weak, np.linspace(0, 0.2, 5), "true")
