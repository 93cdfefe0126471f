"""materials/exports/curves.py: fabric models of LS-DYNA, Radioss and Abaqus as curves."""

import math
import re
from itertools import pairwise

import numpy as np
import pytest
from bubblefit.materials.card import CardCertainty, MaterialCard
from bubblefit.materials.deformation_curves import (
    equibiaxial_curve,
    trellis_angle,
    trellis_curve,
)
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.pieces import integral_of
from bubblefit.solvers.export_formats import FORMATS
from scipy.optimize import brentq

from ...builders.fortran import LAWS
from ...support.explicit_decks import read_functions, read_k
from ...support.refusals import complaint
from ..cases import (
    E1,
    E2,
    EXPORTED_CARD,
    EXPORTED_MEMORY,
    MEMORY_CARD,
    NU12,
    export,
    few_points,
    fixed_columns,
    quadratic_law,
    strip_curve,
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


@pytest.mark.parametrize("measure", [None, "green", "nominal", "true"])
def test_mat34_has_strip_and_trellis_curves(measure):
    given = {} if measure is None else {"measure": measure}
    made = export("ls-dyna-mat34", density=1.25e-9, points=61, **given)
    lines = made.files[".k"].splitlines()
    assert (lines[0], lines[-1]) == ("*KEYWORD", "*END")
    (names, curves), law = read_k(made.files[".k"]), LAWS["cubic"]
    wanted = {"form": -14, "cse": 0, "ro": 1.25e-9, "prab": 0.24}
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
    assert ("Green" in made.remarks.carries[0]) == (measure in (None, "green"))


@pytest.mark.parametrize(("compression", "cse"), [("law", 0), ("none", 1)])
def test_mat34_says_what_a_yarn_in_compression_carries(compression, cse):
    made = export("ls-dyna-mat34", compression=compression, points=15)
    names, curves = read_k(made.files[".k"])
    assert names["cse"] == cse and f"CSE = {cse}" in " ".join(made.remarks.carries)
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
            curves[number][1:], unloading_curve(pulled), rtol=1e-6, atol=1e-4
        )
        loading = curves[number - 3]
        np.testing.assert_allclose(loading[:, 1], strip_curve(pulled, np.log1p(loading[:, 0]))[1],
                                   rtol=1e-5, atol=1e-9)  # fmt: skip
    angle = math.degrees(trellis_angle(EXPORTED_MEMORY.kept(2, 0.13)))
    assert curves[106][curves[106][:, 0] > 0][0] == pytest.approx([angle, 0.0], abs=1e-4)
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


EQUAL = 0.05


@pytest.mark.parametrize(
    ("form", "curve", "off"), [("-14", "lca lcb lcaa lcbb", 0.0), ("14", "lca lcb", 1.0)]
)
def test_mat34_is_as_stiff_as_the_card_at_equal_strain(form, curve, off):
    made = export("ls-dyna-mat34", form=form, points=81)
    names, curves = read_k(made.files[".k"])
    assert names["form"] == int(form)
    green = 0.5 * np.expm1(2 * EQUAL)
    # Both yarns at once, by the law's own increments.
    law, stress = LAWS["cubic"], np.zeros(3)
    path = np.linspace(0, EQUAL, 401)[:, None] * [1, 1, 0]
    for old, new in pairwise(path):
        stress = law.increment(old, new, stress)[0][0]
    errors = []
    for yarn, name in enumerate(curve.split()[-2:]):
        second = np.interp(green, *curves[int(names[name])].T)
        # Force per reference width: Cauchy stress on the other yarn's length.
        nominal = stress[yarn] * np.exp(EQUAL)
        errors.append(second * np.exp(EQUAL) / nominal - 1)
    assert errors == pytest.approx([-0.13 * off, -0.25 * off], abs=1e-4 if not off else 5e-3)
    assert ("FORM -14 goes straight" in " ".join(made.remarks.loses)) == (form == "-14")


def test_equal_strain_of_both_yarns_of_a_linear_law_is_the_closed_form():
    law, e = HypoelasticLaw.linear(800.0, 140.0, 20.0), np.array([0.02, 0.05])
    minor = NU12 * 140 / 800
    for yarn, stiffness in enumerate((800 * (1 + minor), 140 * (1 + NU12))):
        cauchy = stiffness / (1 - NU12 * minor) * e
        for measure, strain, stress in (
            ("true", e, cauchy),
            ("nominal", np.expm1(e), cauchy * np.exp(e)),
            ("green", 0.5 * np.expm1(2 * e), cauchy),
        ):
            found = equibiaxial_curve(law, yarn, e, measure)
            np.testing.assert_allclose(found, [strain, stress], rtol=1e-9)
    fails = HypoelasticLaw.linear(100.0, 140.0, 20.0, 0.9)
    assert "equal strain of both yarns" in complaint(equibiaxial_curve, fails, 0, e, "true")


#: Strain and stress of a point, back to those of a strip, as each program reads them.
def as_ls_dyna(strain, stress):
    stretch = np.sqrt(1 + 2 * strain)
    return stretch - 1, stress * stretch


def as_the_guide_of_radioss(strain, stress, across):
    return np.expm1(strain), stress * np.exp(across)


def as_openradioss_converts(strain, stress):
    """ln(1 + x) by y (1 + x), of which LAW58 takes the strain for nominal."""
    return np.log1p(strain), stress * (1 + strain)


@pytest.mark.parametrize("program", ["ls-dyna", "radioss", "openradioss"])
def test_mat34_read_back_by_its_program_gives_the_strips_of_the_card(program):
    made = export("ls-dyna-mat34", for_=program, points=31)
    names, curves = read_k(made.files[".k"])
    assert names["form"] == (-14 if program == "ls-dyna" else 14)
    for yarn, number in enumerate((names["lca"], names["lcb"])):
        strain, stress = curves[int(number)].T
        strain, stress = strain[strain > 0], stress[strain > 0]
        if program == "ls-dyna":
            nominal = as_ls_dyna(strain, stress)
        elif program == "openradioss":
            nominal = as_openradioss_converts(strain, stress)
        else:
            across = -NU12 * (strain if yarn == 0 else stress / E1(0))
            nominal = as_the_guide_of_radioss(strain, stress, across)
        wanted = strip_curve(yarn, np.log1p(nominal[0]))
        np.testing.assert_allclose(nominal, wanted, rtol=1e-5)
    if program == "openradioss":
        angle = curves[int(names["lcab"])][-1, 0]
        assert 57 * angle == pytest.approx(math.degrees(trellis_angle(0.13)))
    words = " ".join(made.remarks.carries), " ".join(made.remarks.confirm)
    heading = " ".join(made.files[".k"].replace("$", " ").split())
    reader = {"ls-dyna": "LS-DYNA", "radioss": "Radioss' reader", "openradioss": "converter"}
    assert reader[program] in words[0] and words[0].split(";")[0] in heading
    assert {"ls-dyna": "Green", "radioss": "true", "openradioss": "ln(1 + x)"}[program] in words[1]


def test_strain_of_15_percent_stands_in_the_measure_of_the_program():
    law = HypoelasticLaw([0, 0, 0, 20, 0, 0, 0, 140, 0, 0, 0, 800], NU12, [math.log(1.15)] * 3)
    card = MaterialCard(law, 0.8)
    ends = {}
    for program in ("ls-dyna", "radioss", "openradioss"):
        names, curves = read_k(export("ls-dyna-mat34", card, for_=program, points=5).files[".k"])
        ends[program] = curves[int(names["lca"])][-1, 0]
    wanted = {"ls-dyna": 0.16125, "radioss": 0.139762, "openradioss": math.expm1(0.15)}
    assert ends == pytest.approx(wanted, rel=1e-5)


def test_options_of_mat34_that_no_program_takes_are_refused():
    one = FORMATS["ls-dyna-mat34"]
    assert "--form" in complaint(one.export, EXPORTED_CARD, for_="radioss", form="-14")
    refusal = complaint(one.export, EXPORTED_CARD, for_="abaqus")
    assert refusal.startswith("--for: ") and "openradioss" in refusal
    assert complaint(one.export, EXPORTED_CARD, measure="log").startswith("--measure: ")
    text = export("ls-dyna-mat34", form="24", points=5).files[".k"]
    assert read_k(text)[0]["form"] == 24 and "PRAB and PRBA" in text


def radioss_cards(text):
    """Numbers of the material block: columns of 20, or of 10 where the line is of integers."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert re.fullmatch(r"/MAT/LAW1?58/1", lines[0]) and all(len(row) <= 100 for row in lines)
    rows = []
    for row in lines[2:]:
        if row.startswith("/FUNCT"):
            return rows
        rows.append([float(value) for value in row.split()])


class YarnOfRadioss:
    """A yarn on a crimp, held by a spring across it: elongation, force and equilibrium."""

    def __init__(self, rows, crimp, spring):
        self.rows, self.spring = rows, spring
        self.length = 1 + crimp
        self.height = math.sqrt(self.length**2 - 1)

    def force(self, x):
        strain, stress = self.rows.T
        if x < 0:
            return x * stress[1] / strain[1]
        return np.interp(x, strain, stress)

    def along(self, stretch):
        """Nominal stress of the yarn's direction where the spring is in equilibrium."""

        def off(height):
            length = math.hypot(stretch, height)
            return self.force(length - self.length) * height / length + self.spring(
                height, self.height)  # fmt: skip

        height = brentq(off, 1e-9, 10 * self.height, xtol=1e-15)
        length = math.hypot(stretch, height)
        return self.force(length - self.length) * stretch / length


@pytest.mark.parametrize("number", [58, 158])
def test_law58_and_law158_read_back_give_the_strips_and_shear_of_the_card(number):
    made = export(f"radioss-law{number}", density=1.2e-9, points=41)
    text = made.files[".rad"]
    cards, curves = radioss_cards(text), read_functions(text)
    assert cards[0] == [1.2e-9] and set(curves) == {101, 102, 103}
    if number == 58:
        (e1, b1, e2, b2, flex), (*_, crimp, _, _, _) = cards[1], cards[4]
        assert (b1, b2) == (0, 0) and [row[0] for row in cards[5:]] == [101, 102, 103]
        moduli = e1, e2
        springs = [lambda h, h0, e=e: flex * e * h0 / (1 + crimp) * (h - h0) for e in moduli]
    else:
        crimp, _, _, *stiffness = cards[1]
        assert [row[0] for row in cards[3:6]] == [101, 102, 103] and cards[6] == [0, 0]
        springs = [lambda h, h0, k=k: k * math.log(h / h0) for k in stiffness]
    for yarn, spring in enumerate(springs):
        model = YarnOfRadioss(curves[101 + yarn], crimp, spring)
        stretch = 1 + np.array([0.01, 0.05, 0.1])
        found = [model.along(x) for x in stretch]
        wanted = strip_curve(yarn, np.log(stretch))[1]
        # The yarn straightens by its crimp first: 1e-4 of strain.
        slack = 1.05e-4 * (E1, E2)[yarn](0)
        np.testing.assert_allclose(found, wanted, rtol=1e-3, atol=slack)
        pushed = model.along(1 - 1e-3)
        assert -0.02 * 1e-3 * (E1, E2)[yarn](0) < pushed < 0
    degrees = np.array([-5.0, 2.0, 7.0])
    tau = np.sign(degrees) * trellis_curve(
        LAWS["cubic"], np.radians(np.sort(np.abs(degrees))), "nominal")[1][[1, 0, 2]]  # fmt: skip
    np.testing.assert_allclose(np.interp(degrees, *curves[103].T), tau, rtol=1e-3)
    assert f"LAW{number}" in " ".join(made.remarks.confirm)
    assert "stiffening" not in text


def test_functions_of_law58_are_those_that_its_starter_takes():
    """No level part anywhere; unloading meets loading on both sides of zero, to the digit."""
    text = FORMATS["radioss-law58"].export(MEMORY_CARD, points=15).files[".rad"]
    curves = read_functions(text)
    for rows in curves.values():
        assert (np.diff(rows[:, 0]) > 0).all() and (np.diff(rows[:, 1]) > 0).all()
    for number in (101, 102, 103):
        assert (curves[number][-1] == curves[number + 3][-1]).all()
    assert (curves[103][0] == curves[106][0]).all() and curves[103][0, 0] < 0
    assert complaint(FORMATS["radioss-law158"].export, MEMORY_CARD).startswith("memory: ")


#: Units of stress (MPa), length (mm) and density (t/mm3).
SYSTEMS = {
    "mm-g-ms": (1.0, 1.0, 1e-6),
    "mm-kg-ms": (1e3, 1.0, 1e-3),
    "m-kg-s": (1e-6, 1e3, 1e-12),
    "in-lbf-s": (6.894757e-3, 25.4, 1.068689e-5),
}


@pytest.mark.parametrize("units", SYSTEMS)
def test_units_hold_for_moduli_curves_density_thickness_and_band(units):
    stress, length, density = SYSTEMS[units]
    law = quadratic_law()
    sure = CardCertainty(np.diag([1.0, 2.0] + [3.0] * 7), "noise of 10 values")
    card = MaterialCard(law, 0.8, "made in 0.8 mm, MPa", "", sure)
    plain, made = (export("ls-dyna-mat34", card, points=5, units=u) for u in ("mm-t-s", units))
    (names, curves), (other, scaled) = (read_k(one.files[".k"]) for one in (plain, made))
    for name in ("ea", "eb", "gab"):
        assert other[name] * stress == pytest.approx(names[name], rel=1e-4)
    assert other["ro"] * density == pytest.approx(names["ro"], rel=1e-4)
    assert other["prba"] == names["prba"]
    for number, rows in curves.items():
        np.testing.assert_allclose(scaled[number] * [1, stress], rows, rtol=1e-6, atol=1e-9)
    heading = made.files[".k"].split("*MAT_FABRIC_TITLE")[0]
    unit = {1.0: "MPa", 1e3: "GPa", 1e-6: "Pa"}.get(stress, "psi")
    assert f"thickness {0.8 / length:g} {units.split('-')[0]}" in heading
    assert f"E1, {unit}: " in heading and f"{unit} in the card" in " ".join(heading.split())
    assert "card: made in 0.8 mm, MPa" in heading
    band = made.files[".band.csv"].splitlines()
    assert band[1] == f"modulus,log_strain,{unit},lower_{unit},upper_{unit}"
    first, plain_row = (one.files[".band.csv"].splitlines()[2].split(",") for one in (made, plain))
    np.testing.assert_allclose(
        np.array(first[2:], dtype=float) * stress, np.array(plain_row[2:], dtype=float), rtol=1e-6
    )


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_units_of_a_format_stand_in_its_files(name):
    card = MaterialCard(quadratic_law(), 0.8, "made")
    if name in ("constants", "gsa", "rfem"):
        return  # each value has its unit: tests/materials/exports/test_designers.py
    for text in export(name, card, units="m-kg-s", **few_points(name, 5)).files.values():
        if "written by bubblefit" in text:
            assert "units: m, N, Pa; thickness 0.0008 m" in text and "MPa" not in text
