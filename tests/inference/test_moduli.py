"""inference/moduli.py: relative errors of moduli over the strains reached."""

import numpy as np
import pytest
from bubblefit.inference.moduli import moduli_error
from bubblefit.materials.law import HypoelasticLaw


def test_moduli_error_looks_at_every_strain_reached():
    breaks = [[0.03, 0.06]] * 3
    known = HypoelasticLaw.trilinear([300.0] * 3, [220.0] * 3, [4.0] * 3, breaks)
    e1, e2, g12 = [300.0, 330.0, 300.0], [231.0, 220.0, 220.0], [4.0, 4.0, 5.0]
    law = HypoelasticLaw.trilinear(e1, e2, g12, breaks)
    whole = moduli_error(law, known, np.array([0.1, 0.1, 0.1]))
    assert whole == pytest.approx({"E1": 0.1, "E2": 0.05, "G12": 0.25})
    part = moduli_error(law, known, np.array([0.02, 0.02, 0.05]))
    assert part == pytest.approx({"E1": 0.0, "E2": 0.05, "G12": 0.0})
