"""Cards as constants for designers' programs, read back and compared with the law."""

from __future__ import annotations

import io
import math
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports.radioss import yarn_of
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response, trellis_curve, uniaxial_curve
from bubblefit.solvers.exports import FORMATS

from ..biaxial_files import BENT
from ..complaints import complaint_with

LINEAR = MaterialCard(HypoelasticLaw.linear(1000.0, 800.0, 30.0, 0.24), 0.8, "linear")
CARD = MaterialCard(BENT, 0.8, "bent")


def text_of(name, card=LINEAR, **options):
    made = FORMATS[name].export(card, **options)
    ((_, text),) = made.files.items()
    return text, made.says


def fields_of(text: str) -> dict[str, float]:
    rows = [line for line in text.splitlines() if line and not line.startswith("#")]
    return {row[:34].strip(): float(row[34:48]) for row in rows}


def test_gsa_is_told_stiffnesses_per_width_and_the_fill_s_contraction():
    text, says = text_of("gsa", highest=1e-2)
    found = fields_of(text)
    assert list(found) == [
        "Warp modulus",
        "Weft modulus",
        "Poisson's ratio (warp-weft)",
        "Shear modulus",
    ]
    np.testing.assert_allclose(list(found.values()), [800, 640, 0.24, 24], rtol=1e-4)
    assert "Poisson" in says.confirm[0]


def test_rfem_is_told_stresses_of_the_thickness():
    found = fields_of(text_of("rfem", highest=1e-2)[0])
    np.testing.assert_allclose(list(found.values()), [1000, 800, 0.24, 0.192, 30, 0.8], rtol=1e-4)


def test_the_table_holds_every_choice_and_both_forms():
    text, says = text_of("constants", CARD, lowest=2.0, highest=20.0, paths="10", minimise="load")
    table = pd.read_csv(io.StringIO(text), comment="#")
    assert list(table.chosen.fillna("")) == ["yes"] + 10 * [""]
    one = table.iloc[0]
    assert (one.minimise, one.reciprocal, one.unloaded_yarns, one.paths) == (
        "load",
        "yes",
        "yes",
        10,
    )
    across = one.A_warp_fill_kN_per_m
    c = np.linalg.inv([[one.A_warp_kN_per_m, across], [across, one.A_fill_kN_per_m]])
    assert 1 / c[0, 0] == pytest.approx(one.E_warp_kN_per_m, rel=1e-7)
    assert -c[0, 1] / c[1, 1] == pytest.approx(one.nu_warp, rel=1e-6)
    assert one.G_kN_per_m == pytest.approx(24.0)
    words = " ".join(says.carries + says.loses)
    for said in ("2 to 20 kN/m", "loads", "10 paths", "RMS", "choices"):
        assert said in words


def test_loads_end_where_the_card_does_unless_they_are_said():
    _, says = text_of("constants", CARD)
    end = float(says.carries[0].split(" to ")[1].split()[0])
    shares = {"1:1": (1, 1), "2:1": (1, 0.5), "1:2": (0.5, 1), "1:0": (1, 0), "0:1": (0, 1)}
    reached = [
        biaxial_response(BENT, [[end * a, end * b]], 0.8).strain.max() for a, b in shares.values()
    ]
    assert max(reached) == pytest.approx(0.07, rel=2e-3)
    complaint_with(["--highest", "valid_strain"], FORMATS["constants"].export, LINEAR)
    complaint_with(["increase"], FORMATS["gsa"].export, CARD, lowest=5.0, highest=2.0)


def test_what_a_card_does_not_know_of_the_shear_is_said():
    blind = MaterialCard(HypoelasticLaw(BENT.beta, 0.24, [0.07, 0.07, 1e-6]), 0.8, "biaxial only")
    for name in ("constants", "gsa", "rfem", "radioss-law58"):
        assert "sheared the fabric" in " ".join(text_of(name, blind)[1].loses), name
        assert "sheared the fabric" not in " ".join(text_of(name, CARD)[1].loses), name


def test_constants_that_no_program_takes_are_refused():
    # Coupled so strongly that both contractions multiply to more than one.
    law = HypoelasticLaw.linear(100.0, 99.9, 30.0, 0.99)
    found = FORMATS["gsa"].export(MaterialCard(law, 0.8, ""), highest=1e-3)
    assert fields_of(found.files[".txt"])["Poisson's ratio (warp-weft)"] < 1.0


# --- LAW58 --------------------------------------------------------------------------------------


def cards_of(text: str) -> list[list[float]]:
    """The numbers of the rows below the title: columns of 20, N1 and N2 of 10."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "/MAT/LAW58/1" and all(len(row) <= 100 for row in lines)
    found = []
    for row in lines[2:]:
        widths = [10, 10, 20, 20, 20, 20] if row[9] == "1" else [20] * 5
        ends = np.cumsum([0, *widths]).tolist()
        cells = [row[i:j].strip() for i, j in pairwise(ends)]
        found.append([float(cell) for cell in cells if cell])
    return found


def softening(slope: float) -> MaterialCard:
    beta = [0, 0, 0, 30, 0, 0, slope, 600, 0, 0, slope, 900]
    return MaterialCard(HypoelasticLaw(beta, 0.0, [0.07, 0.07, 0.1]), 0.8, "soft")


def test_law58_has_the_yarns_moduli_and_softening():
    card = softening(-4e3)
    text, says = text_of("radioss-law58", card)
    rows = cards_of(text)
    for pulled in (0, 1):
        modulus, b = rows[1][2 * pulled], rows[1][2 * pulled + 1]
        strain, stress = uniaxial_curve(card.law, pulled, np.linspace(0, 0.07, 30), "nominal")
        off = modulus * strain - 0.5 * b * strain**2 - stress
        assert b > 0 and np.abs(off).max() < 0.01 * stress.max()
    assert rows[0] == [1e-9] and rows[1][4] == 1e-3
    assert rows[4] == [1, 1, 1e-4, 1e-4, 1e-3, 1e-3]
    g0, gt, lock = rows[2][:3]
    assert 0 < g0 < gt
    angle, tau, _ = trellis_curve(card.law, np.linspace(0, math.radians(lock), 40), "nominal")
    np.testing.assert_allclose(g0 * np.tan(angle), tau, atol=0.03 * tau.max())
    # Beyond the locking angle the slope over tan(a) is the same.
    assert gt / (1 + math.tan(math.radians(lock)) ** 2) == pytest.approx(g0)
    assert "stiffening" not in " ".join(says.loses) and "density" in " ".join(says.loses)


def test_a_yarn_that_stiffens_has_no_negative_softening_and_it_is_said():
    text, says = text_of("radioss-law58", softening(4e3), density=1.2e-9)
    rows = cards_of(text)
    assert rows[1][1] == 0 and rows[1][3] == 0 and rows[0] == [1.2e-9]
    assert "stiffening along warp and fill" in " ".join(says.loses)
    x = np.linspace(0, 0.1, 20)
    straight = yarn_of(x, 500 * x + 2000 * x**2)
    assert straight.stiffens and 500 < straight.modulus < 700 and straight.off > 0.01
    bent = yarn_of(x, 500 * x - 2000 * x**2)
    assert (bent.modulus, bent.softening) == (pytest.approx(500), pytest.approx(4000))
