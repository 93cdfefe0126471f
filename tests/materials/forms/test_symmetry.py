"""Balanced and isotropic laws: moduli that follow from E, bounds, cards, fits from Python."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.card import MaterialCard, read_card
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.forms.symmetry import (
    modulus_labels,
    pooled_ends,
    pooled_strains,
    symmetric,
)
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.modulus_tables import modulus_table

NU12 = 0.3
STRAIN = np.array([0.0, 0.05, 0.1, 0.2])
FORMS = {
    "cubic": {},
    "spline": {"knots": {"warp": [0.0, 0.1, 0.2], "fill": [0.0, 0.1, 0.2], "shear": [0.0, 0.2]}},
    "trilinear": {"breaks": {"warp": [0.02, 0.12], "fill": [0.02, 0.12], "shear": [0.05, 0.1]}},
}


def law_of(name, symmetry, values):
    form = symmetric(form_named(name, FORMS.get(name, {}), [0.2, 0.2, 0.26]), symmetry, NU12)
    beta = np.resize(values, form.size)
    return HypoelasticLaw(beta, NU12, [0.2, 0.2, 0.26], form=form)


@pytest.mark.parametrize("name", FORMS)
def test_isotropic_moduli_follow_from_one(name):
    law = law_of(name, "isotropic", [30.0, -20.0, -50.0, 200.0])
    np.testing.assert_array_equal(law.E1(STRAIN), law.E2(STRAIN))
    shear = law.G12((1 + NU12) * STRAIN * (1 - 1e-12))
    np.testing.assert_allclose(2 * (1 + NU12) * shear, law.E1(STRAIN))
    assert modulus_labels(law.form) == {"E1": "E"} and "E2" not in law.moduli_words()


def test_other_poissons_ratio_of_an_isotropic_law_changes_its_shear_modulus(tmp_path):
    law = replace(law_of("constant", "isotropic", [100.0]), nu12=0.1)
    assert law.G12(0.05) == pytest.approx(100.0 / 2.2)
    MaterialCard(law, 0.8, "isotropic").write(tmp_path / "card.toml")
    np.testing.assert_allclose(read_card(tmp_path / "card.toml").law.pieces, law.pieces)
    balanced = law_of("constant", "balanced", [20.0, 100.0])
    assert replace(balanced, nu12=0.1).G12(0.05) == balanced.G12(0.05)


def test_balanced_law_keeps_its_shear_modulus():
    law = law_of("linear", "balanced", [7.0, 20.0, -100.0, 200.0])
    np.testing.assert_array_equal(law.E1(STRAIN), law.E2(STRAIN))
    np.testing.assert_allclose(law.E1(STRAIN), 200.0 - 100.0 * STRAIN)
    np.testing.assert_allclose(law.G12(STRAIN), 20.0 + 7.0 * STRAIN)
    assert set(modulus_labels(law.form)) == {"E1", "G12"}


@pytest.mark.parametrize("symmetry", ["balanced", "isotropic"])
def test_gains_by_load_ratio_are_the_same_along_both_yarns_or_refused(symmetry):
    form = form_named("load-ratio", {}, [1.0] * 3)
    if symmetry == "isotropic":
        with pytest.raises(InputError, match="orthotropic"):
            symmetric(form, symmetry, NU12)
        return
    law = HypoelasticLaw(np.array([10.0, 200.0, 50.0]), NU12, form=symmetric(form, symmetry, NU12))
    assert law.modulus("E1", 0.0, 1.0) == law.modulus("E2", 0.0, 1.0) != law.modulus("E1", 0.0)


def test_constant_isotropic_law_is_the_same_in_all_directions():
    law = law_of("constant", "isotropic", [100.0])
    strain = np.array([[0.02, -0.006, 0.0]])
    stress, _ = law.increment(np.zeros((1, 3)), strain, np.zeros((1, 3)))
    mean, half = 0.5 * (0.02 - 0.006), 0.5 * (0.02 + 0.006)
    turned, _ = law.increment(np.zeros((1, 3)), [[mean, mean, 2 * half]], np.zeros((1, 3)))
    tension = 0.5 * (stress[0, 0] + stress[0, 1])
    np.testing.assert_allclose(turned[0], [tension, tension, 0.5 * (stress[0, 0] - stress[0, 1])])


def test_law_of_45_degrees_follows_that_of_the_warp_in_shear():
    # s along 45 degrees is a shear stress s / 2, whose shear is (1 + nu12) times the strain.
    law = law_of("linear", "isotropic", [-300.0, 200.0])
    along, across = np.zeros((41, 3)), np.zeros((41, 3))
    along[:, 0] = np.linspace(0.0, 0.1, 41)
    across[:, 2] = (1 + NU12) * along[:, 0]
    stress = np.trapezoid(law.E1(along[:, 0]), along[:, 0])
    shear = np.trapezoid(law.G12(across[:, 2]), across[:, 2])
    assert shear == pytest.approx(0.5 * stress)


def test_different_knots_and_forms_without_symmetry_are_refused():
    knots = Spline.at([[0.0, 0.1], [0.0, 0.2], [0.0, 0.1]])
    with pytest.raises(InputError, match="same knots"):
        symmetric(knots, "balanced", NU12)
    crimp = form_named("spline-crimp", {"knots": 2}, [0.1] * 3)
    with pytest.raises(InputError, match="orthotropic"):
        symmetric(crimp, "balanced", NU12)


def test_strains_of_moduli_that_follow_are_pooled():
    strains = [[0.1], [], [0.26]]
    assert pooled_strains(strains, "orthotropic", NU12) == ([0.1], [], [0.26])
    assert pooled_strains(strains, "balanced", NU12) == ([0.1], [0.1], [0.26])
    warp, fill, shear = map(max, pooled_strains(strains, "isotropic", NU12))
    assert warp == fill == pytest.approx(0.2) and shear == pytest.approx(0.26)
    form = symmetric(form_named("cubic", {}, [1.0] * 3), "isotropic", NU12)
    np.testing.assert_allclose(pooled_ends(form, np.array([0.1, 0.2, 0.0])), [0.2, 0.2, 0.26])


def test_card_keeps_the_symmetry(tmp_path):
    law = law_of("spline", "isotropic", [100.0, 120.0, 150.0])
    card = MaterialCard(law, 0.5, "foil")
    card.write(tmp_path / "foil.toml", "MPa")
    read = read_card(tmp_path / "foil.toml").law
    assert read.form == law.form and len(read.beta) == 3
    np.testing.assert_allclose(read.G12(STRAIN), law.G12(STRAIN))
    assert "E 100 to 150 MPa" in repr(card) and "E2" not in repr(card)
    table = modulus_table(read, "G12", 5)
    np.testing.assert_allclose(table.modulus, law.G12(table.strain))


def test_unknowns_map_linearly_and_keep_bounds_of_all_moduli():
    form = symmetric(form_named("cubic", {}, [0.2, 0.2, 0.26]), "isotropic", NU12)
    bounds = LawBounds.of_moduli({"E1": (50, 500), "E2": (50, 500), "G12": (20, 190)})
    unknowns = Unknowns.of(form, NU12, [0.2, 0.2, 0.26], bounds)
    assert unknowns.count == 4
    y = np.ones(4)
    law = HypoelasticLaw(unknowns.beta(y), NU12, [0.2, 0.2, 0.26], form=form)
    rows = unknowns.modulus_rows("G12", np.array([0.1]))
    assert (rows @ y)[0] == pytest.approx(law.G12(0.1))


def foil(symmetry, **keys):
    u = np.linspace(0.1, 2.0, 12)
    loads = 900.0 * 0.5 * 25.0 * np.log1p(u / 20.0)
    curves = [(u, f * loads) for f in (0.98, 1.01, 1.0)]
    strips = bf.Strips({"warp": curves}, gauge=20.0, width=25.0, match="points", increments=5)
    law = bf.Law("constant", symmetry=symmetry, nu12=NU12, **keys)
    return strips, law, bf.Fabric("foil", 0.5)


def test_warp_strips_alone_determine_an_isotropic_foil():
    strips, law, fabric = foil("isotropic")
    fit = bf.fit([strips], law, fabric=fabric, starts=1, jobs=1)
    assert fit.law.G12(0.0) == pytest.approx(fit.law.E1(0.0) / 2.6)
    assert fit.verdict.state == "usable" and set(fit.result["reported"]) == {"E1"}
    assert not [note for note in fit.notes if "rests on the other" in str(note)]
    assert fit.best.valid[2] == pytest.approx(1.3 * fit.best.valid[0])


def test_bounds_and_unknowns_that_symmetry_sets_are_refused():
    strips, law, fabric = foil("isotropic", bounds={"E1": [20, 2000], "G12": [1, 200]})
    with pytest.raises(InputError, match="follow from those of E1"):
        bf.fit([strips], law, fabric=fabric, starts=1)
    strips, law, fabric = foil("isotropic")
    with pytest.raises(InputError, match="leave this out, and compare fits"):
        bf.fit([strips], law, fabric=fabric, starts=1, unknowns={"nu12": {}})
