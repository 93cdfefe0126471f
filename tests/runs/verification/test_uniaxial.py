"""runs/verification/uniaxial.py: end loads of linear strips in closed form, and bars off Marc's."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import WIDTH
from bubblefit.runs.verification import uniaxial
from bubblefit.runs.verification.uniaxial import THICKNESS, end_load, marc_bars
from bubblefit.solvers.bars import BARS


@pytest.mark.parametrize(
    ("direction", "modulus", "contraction"), [("warp", 400, 0.24), ("fill", 300, 0.18)]
)
def test_end_load_of_a_linear_strip(monkeypatch, direction, modulus, contraction):
    law = HypoelasticLaw.linear(400.0, 300.0, 20.0, 0.24)
    monkeypatch.setattr(uniaxial, "table_4_2_law", lambda: law)
    width = WIDTH * np.exp(-contraction * 0.1)
    assert end_load(direction, 0.1) == pytest.approx(modulus * 0.1 * THICKNESS * width)


def test_stresses_beside_those_of_marc():
    stresses = [bar.stress for bar in BARS]
    assert all(number.met for number in marc_bars(stresses))
    first, *others = marc_bars([1.1 * stresses[0], *stresses[1:]], "other: ")
    assert not first.met and first.deviation == pytest.approx(0.1)
    assert first.quantity.startswith("other: end stress") and all(n.met for n in others)
