"""materials/exports/designers.py: constants for designers' programs."""

import io

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports.base import UNIT_SYSTEMS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.export_formats import FORMATS

from ...builders.biaxial_tests import BENT_LAW
from ...support.refusals import complaint_with
from ..cases import LINEAR_CARD, few_points, text_of

BENT_CARD = MaterialCard(BENT_LAW, 0.8, "bent")


def fields_of(text):
    rows = [line for line in text.splitlines() if line and not line.startswith("#")]
    cells = {row[:34].strip(): row[34:].split(maxsplit=1) for row in rows}
    assert all(len(pair) == 2 for pair in cells.values() if pair[0] != "not")
    return {name: float(value) for name, (value, _) in cells.items() if value != "not"}


def test_gsa_and_rfem_have_stiffnesses_per_width_and_poissons_ratio():
    text, says = text_of("gsa", highest=1e-2)
    found = fields_of(text)
    names = ["Warp modulus", "Weft modulus", "Poisson's ratio (warp-weft)", "Shear modulus"]
    assert list(found) == names and "Poisson" in says.confirm[0]
    np.testing.assert_allclose(list(found.values()), [800, 640, 0.24, 24], rtol=1e-4)
    found = fields_of(text_of("rfem", highest=1e-2)[0])
    np.testing.assert_allclose(list(found.values()), [1000, 800, 0.24, 0.192, 30, 0.8], rtol=1e-4)
    # Coupled so strongly that both contractions multiply to more than one.
    strong = MaterialCard(HypoelasticLaw.linear(100.0, 99.9, 30.0, 0.99), 0.8, "")
    assert fields_of(text_of("gsa", strong, highest=1e-3)[0])[names[2]] < 1.0


@pytest.mark.parametrize("name", ["gsa", "rfem"])
def test_prestress_and_compensation_are_listed_beside_the_stiffness(name):
    text, says = text_of(name, highest=1e-2)
    assert text.count("not given") == 4
    assert all(word in " ".join(says.loses) for word in ("prestress", "compensation"))
    given = {"prestress_warp": 2.0, "prestress_fill": 1.5, "kept_warp": 0.4, "kept_fill": -1.2}
    text, says = text_of(name, highest=1e-2, **given)
    found = [*fields_of(text).values()][-6:]
    elastic = [100 * (2 / 800 - 0.24 / 800 * 1.5), 100 * (1.5 / 640 - 0.24 / 800 * 2)]
    np.testing.assert_allclose(found, [2, 1.5, *elastic, 0.4, -1.2], rtol=2e-3)
    assert "not given" not in text and "prestress: a card" not in " ".join(says.loses)
    complaint_with(["--kept-warp, --kept-fill", "both"], text_of, name, highest=1.0, kept_warp=1.0)


def test_table_of_constants_lists_options_and_both_forms():
    text, says = text_of(
        "constants", BENT_CARD, lowest=2.0, highest=20.0, paths="10", minimise="load"
    )
    table = pd.read_csv(io.StringIO(text), comment="#")
    assert list(table.chosen.fillna("")) == ["yes"] + 10 * [""]
    one = table.iloc[0]
    chosen = (one.minimise, one.reciprocal, one.unloaded_yarns, one.paths)
    assert chosen == ("load", "yes", "yes", 10)
    across = one.A_warp_fill_kN_per_m
    c = np.linalg.inv([[one.A_warp_kN_per_m, across], [across, one.A_fill_kN_per_m]])
    assert 1 / c[0, 0] == pytest.approx(one.E_warp_kN_per_m, rel=1e-7)
    assert -c[0, 1] / c[1, 1] == pytest.approx(one.nu_warp, rel=1e-6)
    assert one.G_kN_per_m == pytest.approx(24.0)
    words = " ".join(says.carries + says.loses)
    assert all(said in words for said in ("2 to 20 kN/m", "loads", "10 paths", "RMS", "choices"))


def test_loads_end_at_the_range_of_the_card_by_default():
    _, says = text_of("constants", BENT_CARD)
    end = float(says.carries[0].split(" to ")[1].split()[0])
    loads = [[end, end], [end, end / 2], [end / 2, end], [end, 0], [0, end]]
    reached = [biaxial_response(BENT_LAW, [load], 0.8).strain.max() for load in loads]
    assert max(reached) == pytest.approx(0.07, rel=2e-3)
    complaint_with(["--highest", "valid_strain"], FORMATS["constants"].export, LINEAR_CARD)
    complaint_with(["increase"], FORMATS["gsa"].export, BENT_CARD, lowest=5.0, highest=2.0)


@pytest.mark.parametrize("name", ["constants", "gsa", "rfem"])
def test_loads_beyond_the_range_of_the_card_are_noted(name):
    def loses(**options):
        return " ".join(text_of(name, BENT_CARD, **options)[1].loses)

    assert "above" not in loses() and "does not hold" not in loses()
    assert "loads above" in loses(highest=60.0) and "shear above 10 %" in loses(shear=0.4)
    if name != "constants":
        loads = {"prestress_warp": 2.0, "prestress_fill": 2.0}
        assert "strain at the prestress: the card" not in loses(**loads)
        loads = {"prestress_warp": 60.0, "prestress_fill": 60.0}
        assert "strain at the prestress: the card does not hold so far" in loses(**loads)


@pytest.mark.parametrize("units", UNIT_SYSTEMS)
def test_heading_of_constants_names_the_units_of_no_other_system(units):
    text, _ = text_of("constants", BENT_CARD, units=units)
    assert "# units: as beside each value" in text and "N, MPa" not in text


def test_card_without_sheared_data_is_noted():
    blind = MaterialCard(
        HypoelasticLaw(BENT_LAW.beta, 0.24, [0.07, 0.07, 1e-6]), 0.8, "biaxial only"
    )
    curves = ("csv", "marc", "radioss-law58", "radioss-law158", "ls-dyna-mat34", "abaqus-fabric")
    for name in ("constants", "gsa", "rfem", *curves):
        for card in (blind, BENT_CARD):
            said = "sheared the fabric" in " ".join(
                text_of(name, card, **few_points(name))[1].loses
            )
            assert said == (card is blind), name


#: One kN/m, one MPa and one mm in other units, and the names of these.
UNITS = {
    "m-kg-s": (1e3, 1e6, 1e-3, ("N/m", "Pa", "m")),
    "in-lbf-s": (5.71014716, 145.037738, 1 / 25.4, ("lbf/in", "psi", "in")),
    "mm-kg-ms": (1e-3, 1e-3, 1.0, ("kN/mm", "GPa", "mm")),
}


@pytest.mark.parametrize("units", UNITS)
def test_units_stand_beside_values_of_designers_programs(units):
    per_width, stress, length, names = UNITS[units]
    for program in ("gsa", "rfem"):
        plain, text = (
            text_of(program, highest=1e-2, **chosen)[0] for chosen in ({}, {"units": units})
        )
        factors = {"kN/m": per_width, "N/mm^2": stress, "mm": length}
        for row, line in zip(plain.splitlines(), text.splitlines(), strict=True):
            if row.startswith("#") or "not given" in row:
                continue
            value, unit = row[34:].split(maxsplit=1)
            scaled, name = line[34:].split(maxsplit=1)
            assert float(scaled) == pytest.approx(float(value) * factors.get(unit, 1.0), rel=1e-5)
            assert name in names if unit in factors else name == unit
    tables = [
        pd.read_csv(io.StringIO(text_of("constants", highest=1e-2, **chosen)[0]), comment="#")
        for chosen in ({}, {"units": units})
    ]
    column = f"A_warp_{names[0].replace('/', '_per_')}"
    np.testing.assert_allclose(tables[1][column], tables[0].A_warp_kN_per_m * per_width, rtol=1e-6)
    np.testing.assert_allclose(tables[1].nu_warp, tables[0].nu_warp)
