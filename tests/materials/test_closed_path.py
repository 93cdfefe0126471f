"""materials/closed_path.py: work of a closed path of strain."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.closed_path import closed_path
from bubblefit.materials.law import HypoelasticLaw
from scipy.integrate import quad

from .cases import STIFF, crimp_law


def test_work_of_a_closed_path_in_closed_form(tmp_path):
    """Closed form of E1 constant, E2 = c + k eps2: a^2 (D11(b) - D11(0)) / 2 + a (b D12(b) - int
    D12); none without coupling, of constants, and of crimp alone."""
    a, b, nu, e1, c, k = 0.1, 0.08, 0.3, 500.0, 200.0, 4000.0
    beta = np.zeros(12)
    beta[[3, 6, 7, 11]] = 20.0, k, c, e1

    def d11(x):
        return e1 / (1 - nu**2 * (c + k * x) / e1)

    def d12(x):
        return nu * (c + k * x) / (1 - nu**2 * (c + k * x) / e1)

    exact = a**2 / 2 * (d11(b) - d11(0)) + a * (b * d12(b) - quad(d12, 0, b)[0])
    law = HypoelasticLaw(beta, nu, [0.2] * 3)
    found = closed_path(law, (a, b), increments=400)
    assert found.work == pytest.approx(exact, rel=1e-5) and 0.01 < found.share < 1
    assert closed_path(law, (a, b)).work == pytest.approx(exact, rel=1e-3)
    for none in (replace(law, nu12=0.0), HypoelasticLaw.linear(e1, c, 20.0), crimp_law(STIFF)):
        assert abs(closed_path(none, (a, b), 400).share) < 2e-5
    assert abs(closed_path(crimp_law()).share) > 1e-3
    card = MaterialCard(law, 0.8)
    card.write(tmp_path / "card.toml")
    assert card.closed_path.ends == (0.2, 0.2)
    assert card.closed_path.words in (tmp_path / "card.toml").read_text()
