"""A project as a whole: units, law and bounds, tests, cards, and one-line errors."""

import subprocess
import sys
from functools import partial

import numpy as np
import pytest
from bubblefit.experiments.base import Reach
from bubblefit.inference.search import allowed, coefficients_at, dimensions
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.card import read_card
from bubblefit.materials.forms.base import form_names
from bubblefit.project.project import read_project
from bubblefit.runs.law_setup import bounds_of, law_of

from ..builders.projects import edited_project, project_file
from ..support.paths import EXAMPLES, KNOWN
from ..support.refusals import complaint, complaint_with

STRIPS = EXAMPLES / "uniaxial-valmex7318" / "project.toml"


#: Table 3.1: gauge and final lengths, mm.
LENGTHS = {"warp": (20.022, 23.329), "fill": (22.780, 28.721), "bias": (19.767, 30.734)}


ENDS = {direction: float(np.log(b / a)) for direction, (a, b) in LENGTHS.items()}


BOUNDS = "E1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.001, 0.2]"


CUBIC = 'form = "cubic"'


BREAKS = "breaks = { warp = [0.1, 0.15], fill = %s%s }"


TRILINEAR = f'form = "trilinear"\n{BREAKS}'


SECOND = """
[[bubble]]
name = "larger"
radius = 150.0
pressures = [20, 40]
[bubble.data.known_solution]
beta = [0, 0, 0, 0.02, 0, 0, 0, 0.1, 0, 0, 0, 0.5]
"""


@pytest.fixture
def edit(tmp_path):
    return partial(edited_project, tmp_path)


@pytest.fixture
def example(tmp_path):
    (tmp_path / "curves.csv").write_bytes((STRIPS.parent / "curves.csv").read_bytes())
    return lambda *changes, source=STRIPS: read_project(
        project_file(tmp_path, source.read_text(), *changes)
    )


def law(project):
    return law_of(project, [test.reach for test in project.chosen(None, fitted=True)])


def unknowns(project):
    own = law(project)
    return Unknowns.of(own.form, own.nu12, own.strain_range, bounds_of(project, own.form))


def test_examples_have_documented_fabric_law_and_fit(example):
    least, largest = {"E1": 20, "E2": 20, "G12": 1}, {"E1": 2000, "E2": 1000, "G12": 200}
    # Log strains at the ends; shear of a 45-degree strip that keeps its area: 2 ln(l_f/l_i).
    ends = [ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]]
    for p, starts, reach, low, high in (
        (read_project(KNOWN), 50, [0.13] * 3, {"E1": 5.0, "E2": 5.0, "G12": 0.5}, None),
        (example(), 20, ends, least, largest),
    ):
        assert (p.fabric.thickness, p.fabric.thickness_change) == (0.81, "constant")
        own, limits = law(p), bounds_of(p, law(p).form)
        assert (own.form.name, own.nu12, own.thickness_change) == ("cubic", 0.24, "constant")
        assert own.strain_range == pytest.approx(reach) and not own.beta.any()
        assert limits.smallest == pytest.approx(low)
        assert limits.largest == (None if high is None else pytest.approx(high))
        if high is None:
            assert limits.lower.shape == limits.upper.shape == (12,)
            assert limits.upper[11] == pytest.approx(1500.0)
        assert (p.fit.starts, p.fit.seed, p.fit.method) == (starts, 1, "lm")
        assert p.fit.solver == "membrane"


def test_law_is_the_same_in_any_units(example):
    mpa = example(
        ('modulus = "GPa"', 'modulus = "MPa"'), ("E1 = [0.02, 2.0]", "E1 = [20.0, 2000.0]"),
        ("E2 = [0.02, 1.0]", "E2 = [20.0, 1000.0]"), ("G12 = [0.001, 0.2]", "G12 = [1.0, 200.0]"),
    )  # fmt: skip
    for ours, theirs in zip(unknowns(mpa).box, unknowns(example()).box, strict=True):
        assert ours == pytest.approx(theirs)
    metres = example(
        ('length = "mm"', 'length = "m"'), ("thickness = 0.81", "thickness = 0.81e-3"),
        ("width = 25.0", "width = 25.0e-3"), ("grip_distance = 75.0", "grip_distance = 75.0e-3"),
    )  # fmt: skip
    assert metres.fabric.thickness == pytest.approx(0.81)
    assert metres.tests["strips"].place.fabric.thickness == pytest.approx(0.81)
    small = unknowns(example(('modulus = "GPa"', 'modulus = "MPa"'), source=KNOWN)).bounds
    assert small.upper[11] == pytest.approx(1.5) and small.smallest["E1"] == pytest.approx(0.005)


def test_strain_range_of_law_follows_data_or_file(example):
    given = "strain_range = [0.1, 0.2, 0.3]"
    own = law(example(("# strain_range = [0.153, 0.232, 0.883]", given)))
    assert own.strain_range.tolist() == [0.1, 0.2, 0.3]
    # Two directions say nothing about the third strain.
    two = ("[strips.data]", "[strips.warp]\n[strips.fill]\n[strips.data]")
    assert "law.strain_range: this key is missing" in complaint(unknowns, example(two))
    # What is known is used, and only the rest is missing.
    constant = law(example(two, (CUBIC, 'form = "constant"')))
    assert constant.strain_range == pytest.approx([ENDS["warp"], ENDS["fill"], 1.0])
    known = example(two, ("# strain_range", "strain_range"))
    assert list(known.tests["strips"].strips) == ["warp", "fill"]


@pytest.mark.parametrize("form, size", [("constant", 1), ("linear", 2), ("cubic", 4)])
def test_bounds_on_coefficients_are_read(example, form, size):
    n = 3 * size
    low = ", ".join(["-0.5"] * (size - 1) + ["0.01"])
    lists = f"lower = [{', '.join([low] * 3)}]\nupper = [{', '.join(['2.0'] * n)}]"
    p = unknowns(example((CUBIC, f'form = "{form}"'), (BOUNDS, lists)))
    lower, upper = p.box
    assert lower.shape == upper.shape == (n,) and p.bounds.largest is None
    assert lower[size - 1 :: size] == pytest.approx([10] * 3) and (upper == 2000).all()
    assert p.bounds.smallest == {"E1": 5.0, "E2": 5.0, "G12": 0.5}
    assert p.free == tuple(4 * m + k for m in range(3) for k in range(4 - size, 4))


@pytest.mark.parametrize("form", sorted({*form_names()} - {"none"}))
def test_bounds_on_moduli_hold_for_every_form(example, form):
    knots = "\nknots = 5" if form.startswith("spline") else ""
    p = example(
        (CUBIC, f'form = "{form}"{knots}'), ("E1 = [0.02, 2.0]", "E1 = [0.1, 2.0]"),
        ("G12 = [0.001, 0.2]", "G12 = [0.003, 0.2]"),
    )  # fmt: skip
    own = unknowns(p)
    values = np.linalg.inv(own.form.from_values(own.strain_range))
    of = np.array(own.form.modulus_of)

    def constant(e1, e2, g12):
        moduli = {"E1": e1, "E2": e2, "G12": g12, "T": 1.0, "S": 10.0}
        return np.linalg.solve(values, [moduli[name] for name in of])

    inside = [(100.1, 20.1, 3.1), (1999, 999, 199)]
    outside = [(99, 30, 4), (150, 19, 4), (150, 30, 2.9), (2001, 30, 4), (150, 1001, 4)]
    for moduli, good in [(m, True) for m in inside] + [(m, False) for m in outside]:
        coefficients = constant(*moduli)
        a, c = own.inequalities
        assert allowed(own, coefficients[None])[0] == good, moduli
        assert (a @ own.at(coefficients) >= c).all() == good, moduli
    # Starts too: the moduli at the control strains, each between its own.
    drawn = coefficients_at(own, np.random.default_rng(1).random((500, dimensions(own)))) @ values.T
    for name, (low, high) in {"G12": (3, 200), "E2": (20, 1000), "E1": (100, 2000)}.items():
        part = drawn[:, of == name]
        assert (part > low * (1 - 1e-9)).all() and (part < high * (1 + 1e-9)).all()
        assert part.min() < 1.1 * low and part.max() > 0.9 * high


def test_breaks_of_trilinear_form_are_read_or_placed(example):
    trilinear = (CUBIC, 'form = "trilinear"')
    project = example(trilinear)
    own = law(project)
    breaks = np.array(own.form.breaks)
    # Where three lines follow the load curves best; the warp curve is stiff, soft, stiff.
    assert (0 < breaks[:, 0]).all() and (breaks[:, 1] < own.strain_range).all()
    assert (breaks[:, 0] < breaks[:, 1]).all()
    assert breaks[0] == pytest.approx([0.022, 0.11], abs=0.006)
    # Thirds where no test tells them.
    ends = (0.12, 0.24, 0.6)
    thirds = law_of(project, [Reach(ends)]).form.breaks
    np.testing.assert_allclose(thirds, np.outer(ends, [1 / 3, 2 / 3]))
    given = "[law.breaks]\nwarp = [0.02, 0.1]\nfill = [0.03, 0.2]\nshear = [0.1, 0.5]\n"
    own = law(example(trilinear, ("# [least, largest]", f"{given}# [least, largest]")))
    np.testing.assert_array_equal(own.form.breaks, [[0.02, 0.1], [0.03, 0.2], [0.1, 0.5]])


@pytest.mark.parametrize(
    "source, old, new, words",
    [
        (KNOWN, "[law]", "[lwa]", ["lwa", "did you mean 'law'"]),
        (KNOWN, '"kPa"', '"psi"', ["units.pressure", "'kPa', 'MPa', 'bar' or 'Pa'", "'psi'"]),
        (KNOWN, 'modulus = "GPa"', 'modulus = "kPa"', ["units.modulus", "'GPa', 'MPa' or 'Pa'"]),
        (KNOWN, "-1.0e-2,  0.0,", "nan, 0.0,", ["law.bounds.lower[0]", "finite", "nan"]),
        (KNOWN, "strain_range = [0.13, ", "strain_range = [", ["law.strain_range", "3 items"]),
        (KNOWN, "nu12 = 0.24", "nu12 = true", ["law.nu12", "number"]),
        (KNOWN, 'constraints = "margin"', 'constraints = "boolean"', ["fit.constraints", "slsqp"]),
        (KNOWN, "radius = 100.0", "radius = ", ["TOML syntax", "line"]),
        (KNOWN, "starts = 50", "starts = 0", ["fit.starts", "1"]),
        (KNOWN, "thickness = 0.81", "# thickness", ["fabric.thickness", "missing"]),
        (KNOWN, "[fabric]", '[project]\nkind = "bubble"\n[fabric]', ["project.kind", "0.1"]),
        (KNOWN, "[fit]", SECOND.replace("larger", "bubble 1") + "[fit]",
         ["bubble[1].name", "twice"]),
        (KNOWN, "1.0e2, 1.0e2, 1.0, 5.0e-1", "1.0e2, -20.0, 1.0, 5.0e-1", ["lower[5]", "beta_5"]),
        (KNOWN, "-1.0e-2,  0.0,", "0.0,", ["law.bounds.lower", "12 coefficients", "got 11"]),
        (KNOWN, CUBIC, 'form = "quadratic"', ["law.bounds.lower", "9 coefficients"]),
        (KNOWN, CUBIC, 'form = "quartic"', ["law.form", "'quartic'", "cubic"]),
        (KNOWN, CUBIC, f"{CUBIC}\nbreaks = [1]", ["law.breaks", "cubic"]),
        (KNOWN, "strain_range", "# strain_range", ["law.strain_range", "missing"]),
        (KNOWN, "elements = 800", "elements = 400000000", ["bubble[0].elements"]),
        (KNOWN, "thickness = 0.81", "thickness = 810.0", ["fabric.thickness", "um"]),
        (KNOWN, "radius = 100.0", "radius = 0.6", ["bubble[0].radius"]),
        (KNOWN, "7.0e-3,     # G12", "7.0e-1,     # G12", ["beta_3"]),
        (KNOWN, "[[bubble]]", "[[bubble]]\nweight = -1", ["bubble[0].weight"]),
        (KNOWN, "lower = [", "E1 = [0.1, 1.0]\nlower = [", ["law.bounds", "some of both"]),
        (STRIPS, BOUNDS, "", ["law.bounds", "[least, largest] of E1, E2 and G12"]),
        (STRIPS, "G12 = [0.001, 0.2]", "", ["law.bounds.G12", "missing"]),
        (STRIPS, "G12 = [0.001, 0.2]", "G12 = [0.2, 0.2]", ["law.bounds.G12", "[least, largest]"]),
        (STRIPS, BOUNDS, "lower = [0.1]", ["law.bounds.upper", "missing"]),
        (STRIPS, BOUNDS, "lower = [0.1]\nupper = [1]", ["law.bounds.lower", "got 1"]),
        (STRIPS, CUBIC, f"{CUBIC}\nmargin = {{ E = 1, G12 = 1 }}", ["law.margin"]),
        (STRIPS, CUBIC, f"{CUBIC}\n{BREAKS % ('[1, 2]', ', shear = [1, 2]')}", ["law.breaks"]),
        (STRIPS, CUBIC, TRILINEAR % ("[0.1, 0.05]", ", shear = [0.1, 0.2]"), ["law.breaks.fill"]),
        (STRIPS, CUBIC, 'form = "trilinear"\nbreaks = { warp = [0.1, 0.15] }', ["law.breaks.fill"]),
        (STRIPS, "G12 = [0.001, 0.2]", "G12 = [0.001]", ["law.bounds.G12", "at least 2 items"]),
        (STRIPS, "G12 = [0.001, 0.2]", "G12 = [-1, 0.2]", ["law.bounds.G12[0]", "greater than 0"]),
        (STRIPS, "thickness = 0.81", "thickness = 0", ["fabric.thickness", "greater than 0"]),
        (STRIPS, "[[strips]]", "[[strips]]\nthickness = 0.9", ["strips[0].thickness"]),
        (STRIPS, "thickness = 0.81", "thikness = 0.81",
         ["fabric.thikness", "did you mean 'thickness'"]),
        (STRIPS, 'modulus = "GPa"', 'load = "kN"', ["units.load", "unknown key"]),
        (STRIPS, "[fit]", "[fit]\nnuisance = {}", ["fit.nuisance", "unknown key"]),
        (STRIPS, "[fit]", "[bubbles]\n[fit]", ["bubbles", "did you mean 'bubble'"])
    ],
)  # fmt: skip
def test_bad_input_names_file_and_field(example, tmp_path, source, old, new, words):
    said = complaint_with(words, lambda: unknowns(example((old, new), source=source)))
    assert said.startswith(str(tmp_path / "project.toml"))


def test_tests_are_chosen_by_name_or_kind(edit):
    project = edit("[fit]", SECOND + "[fit]")
    assert list(project.tests) == ["bubble 1", "larger"]
    assert [t.name for t in project.chosen("bubble", fitted=True)] == ["bubble 1", "larger"]
    assert [t.name for t in project.chosen(["larger"], fitted=True)] == ["larger"]
    said = complaint(project.chosen, "smaller", fitted=True)
    assert "'smaller'" in said and "bubble 1, larger" in said
    assert "[[strips]]" in complaint(project.chosen, "strips", fitted=True)


def test_defaults_hold_for_tests_without_the_key(edit):
    text = "[defaults.bubble]\nelements = 48\nnuisance = { pressure_offset = true }\n"
    one, two = edit("[fit]", SECOND + text + "[fit]").tests.values()
    assert (one.elements, two.elements) == (800, 48)
    assert (one.pressure_offset, two.pressure_offset) == (False, True)


def test_unreadable_project_files_are_refused(tmp_path):
    assert "bubblefit init" in complaint(read_project, tmp_path / "none.toml")
    assert "is a folder; name a file" in complaint(read_project, tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    assert "UTF-8" in complaint(read_project, tmp_path / "binary.toml")


def test_card_of_fit_has_certainty_of_fit(strips_fit, tmp_path):
    strips_fit.card.write(tmp_path / "card.toml")
    card = read_card(tmp_path / "card.toml")
    sure = strips_fit.best.certainty
    for name in ("E1", "E2"):
        strain = sure.strain[name]
        expected = sure.sigma[name] * strips_fit.law.modulus(name, strain)
        own = card.certainty.sigma(card.law, name, strain)
        np.testing.assert_allclose(own, expected, rtol=0.06)
        low, high = card.certainty.band(card.law, name, strain)
        np.testing.assert_allclose([low, high], sure.moduli[name].band, rtol=1e-6)
    # No bias strip: the shear modulus is anywhere within its bounds, 5 to 200 MPa.
    assert 40 < float(card.certainty.sigma(card.law, "G12", [0.0])[0]) < 120
    values = sum(sum(c.objective.sizes) for c in strips_fit.problem.comparisons)
    assert f"{values} values of one, two" in card.certainty.words
    drawn = card.certainty.laws(card.law, 300, np.random.default_rng(0))
    moduli = np.array([float(law.E1(0.05)) for law in drawn])
    sigma = float(card.certainty.sigma(card.law, "E1", [0.05])[0])
    assert moduli.std() == pytest.approx(sigma, rel=0.12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "thickness = 0.81 ",
            "thickness = 0.00081 ",
            ("fabric.thickness: ", "m? Multiply by 1000"),
        ),
        ("radius = 100.0", "radius = 0.1", ("bubble[0].radius: ", "m? Multiply by 1000")),
        ("radius = 100.0", "ellipse = { major = 0.12, minor = 0.08 }", ("ellipse.major: ",)),
        ("251, 300]", "251, 300_000]", ("pressures[6]: ", "is this in Pa? Divide by 1000")),
        ("[22, 59,", "[1e-7, 59,", ("pressures[0]: ", "at least 0.0001, got 1e-07")),
    ],
)
def test_number_in_likely_wrong_unit_is_named_with_its_key(edit, old, new, words):
    text = complaint(edit, old, new)
    assert all(part in text for part in words), text


def test_wrong_unit_is_recognised_in_units_of_file(tmp_path):
    units = ('pressure = "kPa"', 'pressure = "bar"')
    text = complaint(read_project, project_file(tmp_path, KNOWN.read_text(), units))
    assert "bubble[0].pressures" in text and "expected bar, at most 50, got " in text
    assert "is this in kPa? Divide by 100" in text


def test_reading_a_bubble_project_does_not_import_settings_of_marc():
    example = EXAMPLES / "bubble-known-solution" / "project.toml"
    code = f"import sys, bubblefit as bf; bf.read_project({str(example)!r}).chosen(None); "
    code += "print([name for name in sys.modules if name.endswith('marc.settings')])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"
