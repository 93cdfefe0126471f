"""Public strips of a nylon ripstop give the moduli that their authors published."""

import bubblefit as bf
import numpy as np
import pytest

from ..support import needs
from ..support.paths import load_script


@pytest.mark.slow
def test_public_strips_give_moduli_of_their_authors(tmp_path):
    """E1 25.4 and G12 2.99 N/mm published for the same curves; E2 is explained in the document."""
    write = load_script("docs/make_own_strips.py").write
    fit = bf.fit(bf.read_project(write(tmp_path / "nylon", needs.measured_data())), starts=1)
    table = fit.moduli()
    for modulus, expected, within in (("E1", 25.4, 0.02), ("G12", 2.99, 0.03), ("E2", 61.8, 0.02)):
        curve = table[table.modulus == modulus]
        found = 0.17 * np.interp(0.01, curve.strain, curve.MPa)
        assert found == pytest.approx(expected, rel=within), modulus
