"""Published strips of ETFE foil: modulus and Poisson's ratio beside those of their authors."""

import bubblefit as bf
import numpy as np
import pytest

from ..support import needs
from ..support.paths import EXAMPLES


def test_strips_of_etfe_give_modulus_and_poissons_ratio_of_their_authors():
    """1,119 MPa along MD after 10 s, which is 1 % of strain here, and 0.43."""
    example = EXAMPLES / "etfe-foil" / "isotropic.toml"
    fit = bf.fit(bf.read_project(example, needs.measured_data() / "etfe"), starts=1)
    strain = np.linspace(0.0, 0.00995, 101)
    secant = float(fit.law.E1(strain).mean())
    assert secant == pytest.approx(1119.0, rel=0.03)
    warp = fit.findings["strips"].numbers["directions"]["warp"]
    assert warp["poissons_ratio"] == pytest.approx(0.43, abs=0.02)
    # One law for all directions, and no more misfit than the specimens scatter.
    assert fit.law.E2(0.005) == pytest.approx(fit.law.E1(0.005))
    assert warp["rms_N"] < 1.1 * warp["scatter_N"]
    assert not [note for note in fit.notes if note.kind == "unmatched direction"]


def test_orthotropic_law_of_strips_along_one_direction_leaves_the_others_unknown():
    example = EXAMPLES / "etfe-foil" / "orthotropic.toml"
    fit = bf.fit(bf.read_project(example, needs.measured_data() / "etfe"), starts=1)
    assert float(fit.law.E1(np.linspace(0.0, 0.00995, 101)).mean()) == pytest.approx(1119, rel=0.03)
    assert "E2 at any strain, G12 at any strain" in fit.verdict.unknown
