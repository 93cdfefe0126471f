"""materials/law.py: the law, its moduli within and beyond their range, and its bars."""

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS, EVEN
from bubblefit.materials.forms.polynomial import LoadRatio
from bubblefit.materials.law import HypoelasticLaw, definite_rows

from ..builders.fortran import BETA, BREAKS, MODULI
from ..support.refusals import complaint
from .cases import EVERY_FORM, STRAIN_LAW_OF_FORM, integral_of_modulus, stress_along, turning_points

RANGE = [0.13, 0.13, 0.13]
WARP_MODULUS, FILL_MODULUS, SHEAR_MODULUS, NU = 300.0, 220.0, 5.0, 0.24
TRILINEAR_LAW = HypoelasticLaw.trilinear(*MODULI, BREAKS, NU)


def cubic_law(thickness_change: str = "constant", strain_range: list[float] | None = None):
    return HypoelasticLaw(BETA, NU, strain_range, thickness_change)


def test_moduli_are_held_outside_the_range():
    law = cubic_law(strain_range=RANGE)
    for name, first in (("G12", 0), ("E2", 4), ("E1", 8)):
        end = np.polyval(BETA[first : first + 4], 0.13)
        assert law.modulus(name, 0.4) == pytest.approx(end)
        below = end if name == "G12" else BETA[first + 3]
        assert law.modulus(name, -0.4) == pytest.approx(below)
        inside = np.linspace(0, 0.13, 9)
        curve = np.polyval(BETA[first : first + 4], inside)
        assert law.modulus(name, inside) == pytest.approx(curve)
    assert law.G12(-0.05) == law.G12(0.05)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("beta", np.zeros(11)), ("beta", np.full(12, np.nan)),
        ("nu12", 1.0), ("nu12", -0.1), ("nu12", float("nan")),
        *(("strain_range", [0.1, *rest]) for rest in ([0.1], [0.0, 0.1], [float("nan"), 0.1])),
        ("thickness_change", "thin"),
    ],
)  # fmt: skip
def test_bad_constants_name_their_field(field, value):
    assert field in complaint(HypoelasticLaw, **{"beta": BETA, field: value})


@pytest.mark.parametrize("place", [0, 4, 8])
def test_coefficient_that_the_law_does_not_have_is_named(place):
    beta = TRILINEAR_LAW.beta + (np.arange(12) == place)
    assert f"beta_{place}" in complaint(TRILINEAR_LAW.with_beta, beta)
    assert "E2" in complaint(HypoelasticLaw.trilinear, MODULI[0], (1.0, 2.0), MODULI[2], BREAKS)


@EVERY_FORM
@pytest.mark.parametrize("steps", [1, 2, 7, 50])
@pytest.mark.parametrize("end", [0.005, 0.06, 0.11, 0.16])
def test_bars_are_exact_in_any_number_of_increments(form, steps, end):
    """Along warp, fill and in shear; E of the yarn across is held, because it gets shorter."""
    law, along = STRAIN_LAW_OF_FORM[form], np.linspace(0.0, end, steps + 1)
    warp, fill, shear = (integral_of_modulus(law, name, 0.0, end) for name in COMPONENTS)
    across = [-law.nu12 * integral_of_modulus(law, "E2", 0.0, x) / law.E1(0.0) for x in along]
    for path, stress in (
        ([along, -law.nu12 * along, 0 * along], [warp, 0, 0]),
        ([across, along, 0 * along], [0, fill, 0]),
        ([0 * along, 0 * along, -along], [0, 0, -shear]),
    ):
        assert stress_along(law, np.transpose(path)) == pytest.approx(stress, rel=1e-13, abs=1e-10)


@EVERY_FORM
def test_tangent_of_the_law_is_derivative_of_its_stress(form):
    law, step = STRAIN_LAW_OF_FORM[form], 1e-7
    random = np.random.default_rng(3)
    old, new = random.uniform(-0.15, 0.15, (2, 300, 3))
    near = [np.abs(np.subtract.outer(new[:, c], turning_points(law, n))).min(axis=1)
            for n, c in COMPONENTS.items()]  # fmt: skip
    keep = (np.array(near) > 1e-5).all(axis=0)
    assert keep.sum() > 200
    old, new, stress = old[keep], new[keep], random.standard_normal((300, 3))[keep]
    _, tangent = law.increment(old, new, stress)
    for j in range(3):
        shift = step * np.eye(3)[j]
        ahead, behind = (law.increment(old, new + s, stress)[0] for s in (shift, -shift))
        off = tangent[:, :, j] - (ahead - behind) / (2 * step)
        assert np.abs(off).max() < 1e-6 * np.abs(tangent).max()


def test_definite_rows_of_load_ratio_law_hold_for_a_pull_along_either_yarn():
    nu = 0.9
    beta = np.array([30.0, 800.0, 0.0, 1000.0, 800.0])
    rows = definite_rows(LoadRatio(), nu, [0.1, 0.1, 0.1])
    assert 1000.0 > 1.02 * nu**2 * 800.0  # at equal loads
    none = np.array([1000.0 - 800.0 * EVEN])
    assert none < 1.02 * nu**2 * 800.0  # in a pull along the fill
    assert (rows @ beta).min() == pytest.approx(none[0] - 1.02 * nu**2 * 800.0)
    assert (rows @ [30.0, 800.0, 0.0, 1000.0, 0.0]).min() > 0
