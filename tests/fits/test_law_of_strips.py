"""The law of a fit to strips: its range and breaks follow from the gauges, bounds from the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.kinds import Reach
from bubblefit.inference.unknowns import Unknowns, allowed, draw
from bubblefit.materials.forms.base import form_names
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import Project, read_project
from bubblefit.runs.setup import bounds_of, law_of

from ..complaints import complaint, complaint_with
from ..projects import project_file

EXAMPLE = Path(__file__).parents[2] / "examples" / "uniaxial-valmex7318"
#: Table 3.1: gauge and final lengths, mm.
LENGTHS = {"warp": (20.022, 23.329), "fill": (22.780, 28.721), "bias": (19.767, 30.734)}
ENDS = {direction: float(np.log(b / a)) for direction, (a, b) in LENGTHS.items()}
BOUNDS = "E1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.001, 0.2]"
CUBIC = 'form = "cubic"'

Edit = Callable[..., Project]


@pytest.fixture
def example(tmp_path: Path) -> Edit:
    """Read the example after replacing some texts."""
    (tmp_path / "curves.csv").write_bytes((EXAMPLE / "curves.csv").read_bytes())

    def read(*changes: tuple[str, str]) -> Project:
        return read_project(
            project_file(tmp_path, (EXAMPLE / "project.toml").read_text(), *changes)
        )

    return read


def law(project: Project) -> HypoelasticLaw:
    return law_of(project, [t.reach for t in project.chosen(None, fitted=True)])


def unknowns(project: Project) -> Unknowns:
    own = law(project)
    return Unknowns.of(own.form, own.nu12, own.strain_range, bounds_of(project, own.form))


def test_the_example(example):
    p = example()
    assert (p.fabric.thickness, p.fabric.thickness_change) == (0.81, "constant")
    own, limits = law(p), bounds_of(p, law(p).form)
    assert (own.form.name, own.nu12, own.thickness_change) == ("cubic", 0.24, "constant")
    assert limits.least == pytest.approx({"E1": 20, "E2": 20, "G12": 1})
    assert limits.largest == pytest.approx({"E1": 2000, "E2": 1000, "G12": 200})
    assert (p.fit.starts, p.fit.seed, p.fit.method, p.fit.solver) == (20, 1, "lm", "membrane")
    # Log strains at the ends; shear of a 45-degree strip that keeps its area: 2 ln(l_f/l_i).
    assert own.strain_range == pytest.approx([ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]])


def test_units_of_the_file_do_not_matter(example):
    reference = unknowns(example())
    mpa = unknowns(
        example(
            ('modulus = "GPa"', 'modulus = "MPa"'),
            ("E1 = [0.02, 2.0]", "E1 = [20.0, 2000.0]"),
            ("E2 = [0.02, 1.0]", "E2 = [20.0, 1000.0]"),
            ("G12 = [0.001, 0.2]", "G12 = [1.0, 200.0]"),
        )
    )
    for ours, theirs in zip(mpa.box, reference.box, strict=True):
        assert ours == pytest.approx(theirs)
    metres = example(
        ('length = "mm"', 'length = "m"'),
        ("thickness = 0.81", "thickness = 0.81e-3"),
        ("width = 25.0", "width = 25.0e-3"),
        ("grip_distance = 75.0", "grip_distance = 75.0e-3"),
    )
    assert metres.fabric.thickness == pytest.approx(0.81)
    assert metres.tests["strips"].thickness == pytest.approx(0.81)


def test_strain_range(example):
    given = "strain_range = [0.1, 0.2, 0.3]"
    own = law(example(("# strain_range = [0.153, 0.232, 0.883]", given)))
    assert own.strain_range.tolist() == [0.1, 0.2, 0.3]
    # Two directions say nothing about the third strain.
    two = ("[strips.data]", "[strips.warp]\n[strips.fill]\n[strips.data]")
    assert "law.strain_range: this key is missing" in complaint(unknowns, example(two))
    # What is known is used, and only the rest is missing.
    constant = law(example(two, (CUBIC, 'form = "constant"')))
    assert constant.strain_range == pytest.approx([ENDS["warp"], ENDS["fill"], 1.0])
    assert list(example(two, ("# strain_range", "strain_range")).tests["strips"].strips) == [
        "warp", "fill",
    ]  # fmt: skip


def test_breaks_that_no_test_tells_are_thirds(example):
    project = example((CUBIC, 'form = "trilinear"'))
    own = law_of(project, [Reach((0.12, 0.24, 0.6))])
    for component, end in enumerate((0.12, 0.24, 0.6)):
        assert own.form.breaks[component] == pytest.approx([end / 3, 2 * end / 3])


@pytest.mark.parametrize("form, size", [("constant", 1), ("linear", 2), ("cubic", 4)])
def test_bounds_on_coefficients(example, form, size):
    n = 3 * size
    low = ", ".join(["-0.5"] * (size - 1) + ["0.01"])
    lists = f"lower = [{', '.join([low] * 3)}]\nupper = [{', '.join(['2.0'] * n)}]"
    p = unknowns(example((CUBIC, f'form = "{form}"'), (BOUNDS, lists)))
    lower, upper = p.box
    assert lower.shape == upper.shape == (n,) and p.bounds.largest is None
    assert lower[size - 1 :: size] == pytest.approx([10] * 3) and (upper == 2000).all()
    assert p.bounds.least == {"E1": 5.0, "E2": 5.0, "G12": 0.5}
    assert p.free == tuple(4 * m + k for m in range(3) for k in range(4 - size, 4))


@pytest.mark.parametrize("form", form_names())
def test_each_modulus_has_bounds_of_its_own(example, form):
    """E1 may not go as low as E2, whatever the smaller of the two."""
    knots = "\nknots = 5" if form == "spline" else ""
    p = example(
        (CUBIC, f'form = "{form}"{knots}'),
        ("E1 = [0.02, 2.0]", "E1 = [0.1, 2.0]"),
        ("G12 = [0.001, 0.2]", "G12 = [0.003, 0.2]"),
    )
    own = unknowns(p)
    values = np.linalg.inv(own.form.from_values(own.strain_range))
    of = np.array(own.form.modulus_of)

    def constant(e1: float, e2: float, g12: float) -> np.ndarray:
        moduli = {"E1": e1, "E2": e2, "G12": g12}
        return np.linalg.solve(values, [moduli[name] for name in of])

    inside = [(100.1, 20.1, 3.1), (1999, 999, 199)]
    outside = [(99, 30, 4), (150, 19, 4), (150, 30, 2.9), (2001, 30, 4), (150, 1001, 4)]
    for moduli, good in [(m, True) for m in inside] + [(m, False) for m in outside]:
        coefficients = constant(*moduli)
        a, c = own.inequalities
        assert allowed(own, coefficients[None])[0] == good, moduli
        assert (a @ own.at(coefficients) >= c).all() == good, moduli
    # Starts too: the moduli at the control strains, each between its own.
    drawn = draw(own, np.random.default_rng(1), 500) @ values.T
    for name, (low, high) in {"G12": (3, 200), "E2": (20, 1000), "E1": (100, 2000)}.items():
        part = drawn[:, of == name]
        assert (part > low * (1 - 1e-9)).all() and (part < high * (1 + 1e-9)).all()
        assert part.min() < 1.1 * low and part.max() > 0.9 * high


def test_breaks(example):
    trilinear = (CUBIC, 'form = "trilinear"')
    own = law(example(trilinear))
    breaks = np.array(own.form.breaks)
    # Where three lines follow the load curves best; the warp curve is stiff, soft, stiff.
    assert (0 < breaks[:, 0]).all() and (breaks[:, 1] < own.strain_range).all()
    assert (breaks[:, 0] < breaks[:, 1]).all()
    assert breaks[0] == pytest.approx([0.022, 0.11], abs=0.006)
    given = "[law.breaks]\nwarp = [0.02, 0.1]\nfill = [0.03, 0.2]\nshear = [0.1, 0.5]\n"
    own = law(example(trilinear, ("# [least, largest]", f"{given}# [least, largest]")))
    np.testing.assert_array_equal(own.form.breaks, [[0.02, 0.1], [0.03, 0.2], [0.1, 0.5]])


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("[law.bounds]\n" + BOUNDS, "", ["law.bounds", "[least, largest] of E1, E2 and G12"]),
        (BOUNDS, "", ["law.bounds", "[least, largest] of E1, E2 and G12, or 'lower' and 'upper'"]),
        ("G12 = [0.001, 0.2]", "", ["law.bounds.G12", "missing"]),
        ("G12 = [0.001, 0.2]", "G12 = [0.2, 0.2]", ["law.bounds.G12", "[least, largest]"]),
        (BOUNDS, f"{BOUNDS}\nlower = [1]", ["law.bounds", "some of both"]),
        (BOUNDS, "lower = [0.1]", ["law.bounds.upper", "missing"]),
        (BOUNDS, "lower = [0.1]\nupper = [1]", ["law.bounds.lower", "12 coefficients", "got 1"]),
        (CUBIC, f"{CUBIC}\nmargin = {{ E = 1, G12 = 1 }}", ["law.margin", "leave this out"]),
        (CUBIC, 'form = "quartic"', ["law.form", "cubic"]),
        (
            CUBIC,
            f"{CUBIC}\nbreaks = {{ warp = [1, 2], fill = [1, 2], shear = [1, 2] }}",
            ["law.breaks", "a cubic law has no breaks"],
        ),
        (
            CUBIC,
            'form = "trilinear"\nbreaks = { warp = [0.1, 0.15], fill = [0.1, 0.05], '
            "shear = [0.1, 0.2] }",
            ["law.breaks.fill", "0 < first < second"],
        ),
        (
            CUBIC,
            'form = "trilinear"\nbreaks = { warp = [0.1, 0.15] }',
            ["law.breaks.fill", "missing"],
        ),
    ],
)
def test_a_law_that_cannot_be_is_named(example, tmp_path, old, new, words):
    said = complaint_with(words, unknowns, example((old, new)))
    assert said.startswith(str(tmp_path))


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("G12 = [0.001, 0.2]", "G12 = [0.001]", ["law.bounds.G12", "at least 2 items"]),
        ("G12 = [0.001, 0.2]", "G12 = [-1, 0.2]", ["law.bounds.G12[0]", "greater than 0"]),
        ("thickness = 0.81", "", ["fabric.thickness", "missing"]),
        ("thickness = 0.81", "thickness = 0", ["fabric.thickness", "greater than 0"]),
        ("thickness = 0.81", "thikness = 0.81", ["fabric.thikness", "did you mean 'thickness'"]),
        ('modulus = "GPa"', 'load = "kN"', ["units.load", "unknown key"]),
        ("[fit]", "[fit]\nnuisance = {}", ["fit.nuisance", "unknown key"]),
        (
            "[fit]",
            '[fit]\nconstraints = "boolean"',
            ["fit.constraints", "use 'margin' with method 'lm', or 'slsqp' or 'cobyla'"],
        ),
        ("[fit]", "[bubbles]\n[fit]", ["bubbles", "did you mean 'bubble'"]),
        ("thickness = 0.81", "thickness = ", ["TOML syntax", "line"]),
    ],
)
def test_a_file_that_cannot_be_is_named(example, tmp_path, old, new, words):
    assert complaint_with(words, example, (old, new)).startswith(str(tmp_path))
