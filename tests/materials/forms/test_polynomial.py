"""materials/forms/polynomial.py: control values of polynomials."""

import numpy as np
import pytest
from bubblefit.materials.forms.base import COMPONENTS, ORDER
from bubblefit.materials.forms.polynomial import DEGREES

from ..cases import LAW_OF_FORM

FORM_RANGE = [0.11, 0.12, 0.13]


@pytest.mark.parametrize("name", DEGREES)
def test_control_values_of_a_polynomial_are_moduli(name):
    law, n = LAW_OF_FORM[name], DEGREES.index(name) + 1
    share = 0.5 * (1 - np.cos((2 * np.arange(n) + 1) * np.pi / (2 * n)))
    values = [law.modulus(m, share * FORM_RANGE[COMPONENTS[m]]) for m in ORDER]
    free = list(law.form.free)
    assert law.form.from_values(FORM_RANGE) @ np.ravel(values) == pytest.approx(law.beta[free])
