"""Validation: the fabric coupon RD-V:0230 of Altair's Radioss, in cards for explicit programs.

320 mm x 160 mm x 1 mm, pulled by 20 mm along a yarn of 0.3 or 0.5 GPa (G 0.05 GPa, nu 0). Published
in the measure of small strain: E A u / L = 3 and 5 kN. Moduli of a card are of log strain and give
Cauchy stress; the width is kept at nu = 0, so that the force is E A ln(1 + u / L), 3 % less.
"""

import math

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.export_formats import FORMATS
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.explicit_decks import read_functions, read_k

LENGTH, WIDTH, THICKNESS, PULL = 320.0, 160.0, 1.0, 20.0
STRAIN = PULL / LENGTH
MODULI = {"warp": 300.0, "fill": 500.0}
#: N, in small strain.
PUBLISHED = {"warp": 3000.0, "fill": 5000.0}
LAW = HypoelasticLaw.linear(*MODULI.values(), 50.0, 0.0)


def force_of_curve(strain, stress):
    return WIDTH * THICKNESS * np.interp(STRAIN, strain, stress)


def forces_of_export(name, law, **options):
    """Force along warp and fill, from the curves as the program that is meant reads them."""
    card = MaterialCard(law, THICKNESS, "coupon")
    (text,) = FORMATS[name].export(card, points=121, **options).files.values()
    if name.startswith("radioss"):
        curves = read_functions(text)
        return [force_of_curve(*curves[number].T) for number in (101, 102)]
    names, curves = read_k(text)
    forces = []
    for key in ("lca", "lcb"):
        strain, stress = curves[int(names[key])].T
        if options.get("for_") == "radioss":  # true strain and stress; the width is kept
            strain = np.expm1(strain)
        elif options.get("for_") == "openradioss":
            strain, stress = np.log1p(np.maximum(strain, -0.5)), stress * (1 + strain)
        else:  # Green-Lagrange
            stretch = np.sqrt(1 + 2 * strain)
            strain, stress = stretch - 1, stress * stretch
        forces.append(force_of_curve(strain, stress))
    return forces


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("ls-dyna-mat34", {}),
        ("ls-dyna-mat34", {"for_": "radioss"}),
        ("ls-dyna-mat34", {"for_": "openradioss"}),
        ("radioss-law58", {}),
        ("radioss-law158", {}),
    ],
)
def test_coupon_of_exported_cards_has_the_force_of_log_strain(name, options):
    expected = [force * math.log1p(STRAIN) / STRAIN for force in PUBLISHED.values()]
    assert expected == pytest.approx([2910, 4850], rel=1e-4)
    assert forces_of_export(name, LAW, **options) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("direction", MODULI)
def test_coupon_of_the_membrane_has_the_force_of_log_strain(direction):
    model = straight_strip(
        direction,
        LENGTH,
        LENGTH + PULL,
        THICKNESS,
        WIDTH,
        increments=2,
        across=2,
        along=2,
    )
    load = MembraneSolver().run(model, LAW).load[-1]
    assert load == pytest.approx(PUBLISHED[direction] * math.log1p(STRAIN) / STRAIN, rel=1e-6)


def test_coupon_has_the_published_force_where_the_modulus_is_of_nominal_strain():
    """Stress E (exp(eps) - 1) is E times nominal strain: its modulus E exp(eps), as a cubic."""
    series = np.array([1 / 6, 1 / 2, 1.0, 1.0])
    beta = np.concatenate([50 * np.array([0, 0, 0, 1.0]), *(e * series for e in (500.0, 300.0))])
    law = HypoelasticLaw(beta, 0.0, [0.1] * 3)
    assert forces_of_export("radioss-law58", law) == pytest.approx(
        list(PUBLISHED.values()), rel=2e-5
    )
