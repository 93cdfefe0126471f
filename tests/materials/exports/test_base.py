"""materials/exports/base.py: what all exports have: columns, bands, notes of losses, refusals."""

import io
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.card import CardCertainty, MaterialCard
from bubblefit.materials.exports.base import BAND_COLUMNS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.modulus_tables import piece_constants
from bubblefit.solvers.base import check_carries
from bubblefit.solvers.export_formats import FORMATS
from bubblefit.solvers.registry import solver_named

from ...builders.fortran import LAWS
from ...support.refusals import complaint, refused
from ..cases import (
    EXPORTED_CARD,
    MEMORY_CARD,
    NU12,
    export,
    few_points,
    load_ratio_law,
    quadratic_law,
    strip_curve,
)


def test_formats_and_solvers_of_strain_alone_refuse_load_ratio_laws():
    card = MaterialCard(load_ratio_law(), 0.8, "ratio")
    carry = {"constants", "gsa", "rfem", "calculix"}
    assert {f.name for f in FORMATS.values() if f.load_ratios} == carry
    for one in FORMATS.values():
        if one.load_ratios:
            loads = {} if one.name == "calculix" else {"lowest": 0.5, "highest": 10.0}
            assert one.export(card, **loads).files
        else:
            assert complaint(one.export, card).startswith("form: ")
    assert "solvers membrane" in complaint(piece_constants, card.law)
    for name in ("membrane", "calculix"):
        check_carries(solver_named(name), card.law)
    assert "marc" in complaint(check_carries, solver_named("marc"), card.law)


TABULATED = ("marc", "abaqus-fabric", "ls-dyna-mat34", "csv")


def test_csv_has_moduli_and_strip_curves():
    text = export("csv").files[".csv"]
    assert "# nu12: 0.24" in text
    table = pd.read_csv(io.StringIO(text), comment="#")
    assert list(table.direction.unique()) == ["warp", "fill", "shear"]
    for direction, name in (("warp", "E1"), ("fill", "E2"), ("shear", "G12")):
        rows = table[table.direction == direction]
        assert len(rows) == 121 and rows.log_strain.iloc[-1] == 0.13
        np.testing.assert_allclose(
            rows.tangent_modulus_MPa, LAWS["cubic"].modulus(name, rows.log_strain), rtol=1e-10
        )
    for pulled, direction in enumerate(("warp", "fill")):
        rows = table[table.direction == direction]
        x, y = strip_curve(pulled, rows.log_strain.to_numpy())
        np.testing.assert_allclose(rows.test_strain, x, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(rows.test_stress_MPa, y, rtol=1e-5)


def test_exports_name_what_their_target_loses():
    def loses(name, card=EXPORTED_CARD, **options):
        return " ".join(export(name, card, **few_points(name) | options).remarks.loses)

    # The linear law in equal biaxial strain e: E1 (1 + nu21)/(1 - nu12 nu21) e on a width that is
    # exp(e) times the first; the strip: E1 e on exp(-nu12 e) times it. Fill likewise.
    linear = MaterialCard(HypoelasticLaw.linear(800.0, 140.0, 20.0), 0.8)
    nu21, e = NU12 * 140 / 800, 0.05
    both = (1 - NU12 * nu21) / (1 + np.array([nu21, NU12]))
    warp, fill = 100 * (1 - both * np.exp(-e * (1 + np.array([NU12, nu21]))))
    for name, words in (
        ("abaqus-fabric", ["nu12", "Explicit only"]), ("ls-dyna-mat34", ["nu12", "density"])
    ):  # fmt: skip
        assert all(word in loses(name) for word in words)
        assert f"{warp:.2g} % along the warp and {fill:.2g} % along the fill" in loses(
            name, linear, **({"form": "14"} if name == "ls-dyna-mat34" else {})
        )
    assert "measure" in " ".join(export("ls-dyna-mat34", points=15).remarks.confirm)
    assert "density" not in loses("abaqus-fabric", density=1e-9)
    assert "incompressible" in loses("marc", MaterialCard(LAWS["incompressible"], 0.8))
    assert "0.015 %" in loses("marc", points=121)
    unlimited = MaterialCard(LAWS["linear"], 0.8)
    for name in TABULATED:
        said = loses(name, unlimited, reach=0.05)
        assert "no valid_strain" in said and "5 % of log strain" in said
        assert "no valid_strain" not in loses(name)


@pytest.mark.parametrize(
    ("name", "option", "value", "expected"),
    [
        ("ls-dyna-mat34", "density", np.nan, "a finite number"),
        ("ls-dyna-mat34", "density", np.inf, "a finite number"),
        ("abaqus-fabric", "density", 0.0, "more than 0"),
        ("gsa", "prestress_warp", -5.0, "0 or more"),
        ("constants", "shear", 1.5, "1 or less"),
        ("csv", "points", 1, "2 or more"),
    ],
)
def test_values_beyond_the_limits_of_an_option_are_refused(name, option, value, expected):
    raised = refused(FORMATS[name].export, EXPORTED_CARD, **{option: value})
    assert raised.field == f"--{option.replace('_', '-')}"
    assert raised.problem == f"expected {expected}, got {value}"


@pytest.mark.parametrize("mark", ["#", "$", "*", "/", "## "])
@pytest.mark.parametrize("name", ["radioss-law58", "ls-dyna-mat34"])
def test_title_of_a_deck_is_no_comment(name, mark):
    card = replace(EXPORTED_CARD, name=f"{mark}1 PVC")
    lines = next(iter(export(name, card, **few_points(name)).files.values())).splitlines()
    assert "1 PVC" in lines and f"{mark}1 PVC" not in lines


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_formats_without_unloading_refuse_a_memory(name):
    if name in ("ls-dyna-mat34", "radioss-law58", "abaqus-fabric"):
        return
    assert refused(FORMATS[name].export, MEMORY_CARD).field == "memory"


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_exports_have_the_band_in_a_table_beside_them(name):
    few = few_points(name)
    directions = np.zeros((2, 9))
    directions[0, 8], directions[1, 2] = 10.0, 1.0
    sure = CardCertainty(directions, "noise of 100 values")
    files = FORMATS[name].export(MaterialCard(quadratic_law(), 0.8, "made", "", sure), **few).files
    head, columns, *rows = files[".band.csv"].splitlines()
    assert "noise of 100 values" in head and columns == BAND_COLUMNS
    values = [row.split(",") for row in rows]
    # E1 is 330 MPa at rest and 10 MPa uncertain everywhere, G12 10 and 1, E2 sure.
    first = {row[0]: [float(v) for v in row[1:]] for row in reversed(values)}
    assert first["E1"] == pytest.approx([0, 330, 330 - 19.6, 330 + 19.6])
    assert first["G12"] == pytest.approx([0, 10, 10 - 1.96, 10 + 1.96])
    assert first["E2"] == pytest.approx([0, 190, 190, 190])
    last = {row[0]: float(row[1]) for row in values}
    assert last == pytest.approx({"E1": 0.1, "E2": 0.12, "G12": 0.2})
    assert "E1, MPa: 310.4 to 349.6 at 0" in next(iter(files.values()))
    plain = FORMATS[name].export(MaterialCard(quadratic_law(), 0.8, "made"), **few).files
    assert ".band.csv" not in plain
    assert "band of the moduli: not known" in next(iter(plain.values()))
