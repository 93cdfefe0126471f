"""materials/exports/curves.py: fabric models of LS-DYNA, Radioss and Abaqus as curves."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.deformation_curves import trellis_angle, trellis_curve, uniaxial_curve
from bubblefit.materials.exports.curves import yarn_of
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.pieces import integral_of
from bubblefit.solvers.export_formats import FORMATS

from ...builders.fortran import LAWS
from ..cases import (
    E1,
    E2,
    EXPORTED_MEMORY,
    MEMORY_CARD,
    NU12,
    export,
    fixed_columns,
    strip_curve,
    text_of,
)


def read_fabric(text):
    found, component = {}, None
    for line in text.splitlines():
        if line.startswith("*UNIAXIAL"):
            component = found.setdefault(line.partition("COMPONENT=")[2], [])
        elif line.startswith("*") and not line.startswith(("**", "*LOADING DATA")):
            component = None
        elif not line.startswith("*") and component is not None:
            stress, strain = map(float, line.split(","))
            component.append((strain, stress))
    return {name: np.array(rows) for name, rows in found.items()}


def test_abaqus_fabric_has_strip_and_trellis_curves():
    text = export("abaqus-fabric", density=1.25e-9, points=61).files[".inp"]
    assert "*FABRIC, STRESS FREE INITIAL SLACK=NO" in text
    assert "*DENSITY\n1.25e-09\n" in text and "stands in" not in text
    found = read_fabric(text)
    assert set(found) == {"1", "2", "SHEAR"}
    for pulled, component in enumerate("12"):
        strain, stress = found[component].T
        assert strain[0] < 0 and 0 in strain and (np.diff(strain) > 0).all()
        tension = strain >= 0
        _, wanted = strip_curve(pulled, np.log1p(strain[tension]))
        np.testing.assert_allclose(stress[tension], wanted, rtol=1e-5, atol=1e-9)
        # Held in compression: the line through zero to the one point has the modulus at zero
        # but for the change of width and length, some percent at -0.1.
        assert stress[0] / strain[0] == pytest.approx((E1, E2)[pulled](0), rel=0.1)
    angle, stress = found["SHEAR"].T
    assert angle[0] == 0 and angle[-1] == pytest.approx(trellis_angle(0.13), rel=1e-9)
    _, wanted, _ = trellis_curve(LAWS["cubic"], angle, "nominal")
    np.testing.assert_allclose(stress, wanted, rtol=1e-9, atol=1e-12)


def read_k(text):
    """Fields of *MAT_FABRIC by name, and curves by number, sliced by column."""
    blocks, names = {}, {}
    for line in text.splitlines():
        if line.startswith("*"):
            blocks.setdefault(line, []).append([])
            last = blocks[line][-1]
        elif not line.startswith("$"):
            last.append(line)
    (material,) = blocks["*MAT_FABRIC_TITLE"]
    cards = (
        "mid ro ea eb - prba prab", "gab - - cse el prl lratio damp",
        "aopt flc fac ela lnrc form fvopt tsrfac", "- rgbrth a0ref a1 a2 a3 x0 x1",
        "v1 v2 v3 - - - beta isrefg", "lca lcb lcab lcua lcub lcuab rl",
    )  # fmt: skip
    for fields, line in zip(map(str.split, cards), material[1:], strict=True):
        assert len(line) == 10 * len(fields)
        for name, cell in zip(fields, fixed_columns(line, [10] * len(fields)), strict=True):
            assert (name == "-") == (cell.strip() == "")
            names[name] = float(cell.strip() or 0)
    curves = {}
    for title, head, *rows in blocks["*DEFINE_CURVE_TITLE"]:
        assert title in ("warp", "fill", "shear")
        number, _, scale, _, offset, *_ = map(float, fixed_columns(head, [10] * 7))
        assert scale == 1 and offset == 0
        curves[int(number)] = np.array(
            [[float(v) for v in fixed_columns(row, [20, 20])] for row in rows]
        )
    return names, curves


@pytest.mark.parametrize("measure", [None, "green", "nominal", "true"])
def test_mat34_has_strip_and_trellis_curves(measure):
    given = {} if measure is None else {"measure": measure}
    made = export("ls-dyna-mat34", density=1.25e-9, points=61, **given)
    lines = made.files[".k"].splitlines()
    assert (lines[0], lines[-1]) == ("*KEYWORD", "*END")
    (names, curves), law = read_k(made.files[".k"]), LAWS["cubic"]
    wanted = {"form": 14, "cse": 0, "ro": 1.25e-9, "prab": 0.24}
    assert {name: names[name] for name in wanted} == wanted
    moduli = [names[name] for name in ("ea", "eb", "gab")]
    assert moduli == pytest.approx([806.35, 139.437, 20.0439])
    assert names["prba"] / names["eb"] == pytest.approx(names["prab"] / names["ea"], rel=1e-5)
    for pulled, number in enumerate((names["lca"], names["lcb"])):
        strain, stress = curves[int(number)].T
        assert (np.diff(strain) > 0).all() and strain[0] < 0
        strain, stress = strain[strain > 0], stress[strain > 0]
        # Back to nominal, by what the measures mean.
        if measure == "true":
            across = -NU12 * (strain if pulled == 0 else stress / E1(0))
            log_strain, nominal = strain, stress * np.exp(across)
        elif measure == "nominal":
            log_strain, nominal = np.log1p(strain), stress
        else:
            log_strain = 0.5 * np.log1p(2 * strain)
            nominal = stress * np.exp(log_strain)
        np.testing.assert_allclose(nominal, strip_curve(pulled, log_strain)[1], rtol=1e-5)
    shear = curves[int(names["lcab"])]
    np.testing.assert_allclose(shear, -shear[::-1], atol=1e-12)
    assert np.interp(1e-3, *shear.T) / 1e-3 == pytest.approx(float(law.G12(0)), rel=0.02)
    assert ("Green" in made.says.carries[0]) == (measure in (None, "green"))


@pytest.mark.parametrize(("compression", "cse"), [("law", 0), ("none", 1)])
def test_mat34_says_what_a_yarn_in_compression_carries(compression, cse):
    made = export("ls-dyna-mat34", compression=compression, points=15)
    names, curves = read_k(made.files[".k"])
    assert names["cse"] == cse and f"CSE = {cse}" in " ".join(made.says.carries)
    for yarn in ("lca", "lcb"):
        (x0, y0), (x1, _) = curves[int(names[yarn])][:2]
        assert (x0 < 0, y0 < 0, x1 > 0) == (not cse, not cse, bool(cse))
    assert curves[int(names["lcab"])][0, 0] < 0


def unloading_curve(component, measure="nominal"):
    law, end, count = MEMORY_CARD.law, 0.13, 15
    kept, up = EXPORTED_MEMORY.kept(component, end), EXPORTED_MEMORY.unloading[component]
    x = np.linspace(kept, end, count)
    s = (x - kept) / (end - kept)
    own = integral_of(law.pieces, component, 0.0, end) * ((2 - up) * s + (up - 1) * s**2)
    across = -NU12 * (x if component == 0 else own / E1(0))
    nominal = np.stack([np.expm1(x), own * np.exp(across)], axis=1)
    if measure == "green":
        stretch = np.exp(x)
        return np.stack([0.5 * (stretch**2 - 1), nominal[:, 1] / stretch], axis=1)
    return np.stack([x, own], axis=1) if measure == "true" else nominal


@pytest.mark.parametrize("measure", ["green", "nominal", "true"])
def test_mat34_unloads_as_the_memory_does(measure):
    text = FORMATS["ls-dyna-mat34"].export(MEMORY_CARD, measure=measure, points=15).files[".k"]
    assert "$ state of the fabric: first loading" in text
    names, curves = read_k(text.replace(" unloading\n", "\n"))
    assert [names[n] for n in ("lca", "lcb", "lcab", "lcua", "lcub", "lcuab", "rl")] == [
        101, 102, 103, 104, 105, 106, 0]  # fmt: skip
    for pulled, number in enumerate((104, 105)):
        rows, wanted = curves[number], unloading_curve(pulled, measure)
        assert (rows[0] == 0).all()
        np.testing.assert_allclose(rows[1:], wanted, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(rows[-1], curves[number - 3][-1], rtol=1e-6)
    shear, loading = curves[106], curves[103]
    np.testing.assert_allclose(shear, -shear[::-1], atol=1e-12)
    np.testing.assert_allclose(shear[-1], loading[-1], rtol=1e-6)
    inside = np.interp(shear[:, 0], *loading.T)
    assert (np.abs(shear[:, 1]) <= np.abs(inside) * (1 + 1e-9)).all()


def read_functions(text):
    found, last = {}, None
    for line in text.splitlines():
        if line.startswith("/FUNCT/"):
            last = found.setdefault(int(line.removeprefix("/FUNCT/")), [])
        elif last is not None and re.fullmatch(r"[ \d.E+-]{40}", line):
            last.append([float(v) for v in fixed_columns(line, [20, 20])])
    return {number: np.array(rows) for number, rows in found.items()}


def test_law58_unloads_as_the_memory_does():
    text = FORMATS["radioss-law58"].export(MEMORY_CARD, points=15).files[".rad"]
    lines, curves = text.splitlines(), read_functions(text)
    cards = [lines[i + 1] for i, line in enumerate(lines) if line.startswith("#  FCT_ID")]
    assert int(fixed_columns(cards[0], [10, 10, 20])[0]) == 101
    last = [float(v) for v in fixed_columns(cards[1], [10, 10, 20, 20, 10, 20])]
    assert last == [104, 105, 1, 1, 106, 1]
    assert set(curves) == {101, 102, 103, 104, 105, 106}
    for pulled, number in enumerate((104, 105)):
        np.testing.assert_allclose(
            curves[number][1:], unloading_curve(pulled), rtol=1e-9, atol=1e-9
        )
        loading = curves[number - 3]
        np.testing.assert_allclose(loading[:, 1], strip_curve(pulled, np.log1p(loading[:, 0]))[1],
                                   rtol=1e-5, atol=1e-9)  # fmt: skip
    angle = math.degrees(trellis_angle(EXPORTED_MEMORY.kept(2, 0.13)))
    assert curves[106][1] == pytest.approx([angle, 0.0])
    assert curves[106][-1] == pytest.approx(curves[103][-1], rel=1e-6)


def test_abaqus_fabric_unloads_as_the_memory_does():
    text = FORMATS["abaqus-fabric"].export(MEMORY_CARD, points=15).files[".inp"]
    blocks = re.split(r"^\*UNLOADING DATA, DEFINITION=SHIFTED CURVE\n", text, flags=re.M)[1:]
    curves = []
    for block in blocks:
        body = block.split("*")[0].strip().splitlines()
        curves.append(np.array([[float(v) for v in line.split(",")] for line in body])[:, ::-1])
    assert len(curves) == 3
    for pulled in (0, 1):
        wanted = unloading_curve(pulled)
        wanted[:, 0] -= wanted[0, 0]
        np.testing.assert_allclose(curves[pulled], wanted, rtol=1e-9, atol=1e-9)
    assert text.count(", TYPE=PERMANENT DEFORMATION") == 3 and text.count("TYPE=ELASTIC") == 2


def cards_of(text):
    """The numbers of the rows below the title: columns of 20, N1 and N2 of 10."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == "/MAT/LAW58/1" and all(len(row) <= 100 for row in lines)
    found = []
    for row in lines[2:]:
        ends = np.cumsum([0, 10, 10, *[20] * 4] if row[9] == "1" else [0, *[20] * 5])
        cells = [row[i:j].strip() for i, j in pairwise(ends)]
        found.append([float(cell) for cell in cells if cell])
    return found


def softening(slope):
    beta = [0, 0, 0, 30, 0, 0, slope, 600, 0, 0, slope, 900]
    return MaterialCard(HypoelasticLaw(beta, 0.0, [0.07, 0.07, 0.1]), 0.8, "soft")


def test_law58_has_moduli_and_softening_of_the_yarns():
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


def test_law58_of_a_stiffening_yarn_has_no_softening_and_a_note():
    text, says = text_of("radioss-law58", softening(4e3), density=1.2e-9)
    rows = cards_of(text)
    assert rows[1][1] == 0 and rows[1][3] == 0 and rows[0] == [1.2e-9]
    assert "stiffening along warp and fill" in " ".join(says.loses)
    x = np.linspace(0, 0.1, 20)
    straight = yarn_of(x, 500 * x + 2000 * x**2)
    assert straight.stiffens and 500 < straight.modulus < 700 and straight.rms_error > 0.01
    bent = yarn_of(x, 500 * x - 2000 * x**2)
    assert (bent.modulus, bent.softening) == (pytest.approx(500), pytest.approx(4000))
