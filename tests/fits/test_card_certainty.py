"""What the card of a fit keeps of how sure it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.materials.card import read_card
from bubblefit.project.project import read_project
from bubblefit.runs.fit import fit

from ..projects import constant_strips


def test_the_card_of_a_fit_is_as_sure_as_the_fit(tmp_path: Path) -> None:
    found = fit(read_project(constant_strips(tmp_path)), starts=1)
    found.card.write(tmp_path / "card.toml")
    card = read_card(tmp_path / "card.toml")
    sure = found.best.certainty
    assert sure is not None and card.certainty is not None
    for name in ("E1", "E2"):
        strain = sure.strain[name]
        expected = sure.total[name] * found.law.modulus(name, strain)
        own = card.certainty.sigma(card.law, name, strain)
        np.testing.assert_allclose(own, expected, rtol=0.06)
        low, high = card.certainty.band(card.law, name, strain)
        # Ends of a thousand draws are sure to a twentieth of the band's half.
        half = 0.5 * float(np.max(high - low))
        np.testing.assert_allclose([low, high], sure.band[name], atol=0.1 * half, rtol=0)
    # No bias strip: the shear modulus is anywhere within its bounds, 5 to 200 MPa.
    shear = float(card.certainty.sigma(card.law, "G12", [0.0])[0])
    assert 40 < shear < 120
    values = sum(sum(c.objective.sizes) for c in found.problem.comparisons)
    assert card.certainty.words == (
        f"noise of the data and error of the mesh; {values} values of one, two; the form of the "
        "law is taken for right"
    )
    drawn = card.certainty.laws(card.law, 300, np.random.default_rng(0))
    moduli = np.array([float(law.E1(0.05)) for law in drawn])
    assert moduli.std() == pytest.approx(float(card.certainty.sigma(card.law, "E1", [0.05])[0]),
                                         rel=0.12)  # fmt: skip
