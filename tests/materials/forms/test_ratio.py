"""materials/forms/ratio.py: yarns that exchange crimp."""

import numpy as np
import pytest
from bubblefit.materials.admissibility import is_positive
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.card import MaterialCard, certainty_of, read_card
from bubblefit.materials.deformation_curves import bar
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.forms.ratio import SplineCrimp
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import Memory

from ...support.refusals import complaint
from ..cases import CRIMP, crimp_law, lengthened, stress_along

RATIOS = ((1, 0), (0, 1), (1, 1), (2, 1), (1, 2), (5, 1))
FORM = SplineCrimp.at([[0.0, 0.06, 0.12]] * 3)


def test_crimp_lengthens_a_yarn_pulled_alone_and_stiffens_two():
    _, stress = bar(crimp_law(), 1, np.linspace(0.0, 0.1, 40)[1:])
    np.testing.assert_allclose(stress[:, 0], 0.0, atol=1e-9)
    gained = lengthened(stress[-1, :2])
    assert 0 < gained[1] < (2.5 / 12.0) ** 2 and gained[0] < 0
    alone = biaxial_response(crimp_law(), [[0.0, 5.0]], 1.0).strain[-1, 1]
    assert biaxial_response(crimp_law(), [[5.0, 5.0]], 1.0).strain[-1, 1] < 0.7 * alone
    none = crimp_law([*CRIMP[:-3], 1e-9, 1e-9, 12.0])
    plain = HypoelasticLaw(CRIMP[:-3], 0.2, [0.12] * 3, form=Spline(FORM.knots))
    path = np.random.default_rng(1).normal(0.0, 0.02, (6, 3))
    np.testing.assert_allclose(stress_along(none, path), stress_along(plain, path), rtol=1e-7)


def test_crimp_law_round_trip_certainty_rows_and_no_memory(tmp_path):
    MaterialCard(crimp_law(), 0.8, "crimp").write(tmp_path / "card.toml", "MPa")
    back = read_card(tmp_path / "card.toml").law
    assert back.form == FORM and is_positive(back) and back.of_load_ratio
    assert not is_positive(crimp_law([*CRIMP[:-3], -1.5, 2.5, 12.0]))
    drawn = CRIMP + np.random.default_rng(1).normal(0.0, 0.1, (50, 12)) * (np.arange(12) > 8)
    sure = certainty_of(crimp_law(), drawn)
    assert np.sqrt(np.diag(sure.covariance)[9:]) == pytest.approx(0.1, rel=0.3)
    assert all(
        min(law.coupling[3:]) > 0 for law in sure.laws(crimp_law(), 20, np.random.default_rng(1))
    )
    np.testing.assert_allclose(back.coupling, [0.2, 0.0, 0.0, 1.5, 2.5, 12.0])
    assert form_named("spline-crimp", {"knots": 3}, [0.1] * 3).size == 12
    assert FORM.own_rows("S").shape == (3, 12)
    assert (FORM.own_rows("S") @ CRIMP == [12.0, 9.0, 7.0]).all()
    memory = Memory((0.1,) * 3, (1.5,) * 3)
    assert complaint(HypoelasticLaw, CRIMP, form=FORM, memory=memory).startswith("memory: ")
