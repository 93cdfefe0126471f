"""Project files of uniaxial and joint fits: units, defaults, data by direction, one-line errors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.cli.main import main
from bubblefit.errors import InputError
from bubblefit.projects.joint import JointProject, read_joint
from bubblefit.projects.uniaxial import UniaxialProject, read_uniaxial
from bubblefit.studies.setup import parameters_of
from click.testing import CliRunner

EXAMPLES = Path(__file__).parents[1] / "examples"
CURVES = EXAMPLES / "uniaxial-valmex7318"
JOINT = EXAMPLES / "joint-valmex7318" / "test1.toml"
#: Table 3.1: gauge and final lengths, mm.
LENGTHS = {"warp": (20.022, 23.329), "fill": (22.780, 28.721), "bias": (19.767, 30.734)}
ENDS = {direction: float(np.log(b / a)) for direction, (a, b) in LENGTHS.items()}

#: As little as there can be, and machine exports as they come: one file a direction.
SMALL = """
[project]
kind = "uniaxial"

[uniaxial]
thickness = 0.81

[uniaxial.warp]
gauge_length = 20.0

[uniaxial.fill]
gauge_length = 22.0

[uniaxial.bias]
gauge_length = 19.0

[uniaxial.data]
files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }

[bounds]
E1 = [0.02, 2.0]
E2 = [0.01, 1.0]
G12 = [0.001, 0.2]
"""


def rows(separator: str, *columns: np.ndarray, comma: bool = False) -> str:
    lines = [separator.join(f"{v:.6f}" for v in row) for row in zip(*columns, strict=True)]
    text = "\n".join(lines)
    return text.replace(".", ",") if comma else text


def write_exports(folder: Path) -> None:
    """MTS (warp, 200 N/mm, in kN), ZwickRoell (fill, 80 N/mm), Instron (bias, 50 N/mm)."""
    u = np.linspace(0, 4, 21)
    head = (
        "Test: cut strip\nTest Run: 3\n\nAxial Displacement,Axial Force,Running Time\nmm,kN,sec\n"
    )
    (folder / "w1.csv").write_text(head + rows(",", u, 0.2 * u, u))
    (folder / "w2.csv").write_text(head + rows(",", 0.9 * u, 0.18 * u, u))
    zwick = (
        '"Prüfgeschwindigkeit"\t300\t"mm/min"\n"Prüfzeit"\t"Standardkraft"\t"Standardweg"\n'
        '"s"\t"N"\t"mm"\n'
    )
    text = zwick + rows("\t", u, 80 * u, u, comma=True)
    (folder / "f.TXT").write_bytes(text.encode("latin-1"))
    instron = "Specimen label,,\n\nTime,Extension,Load,Tensile stress\n(s),(mm),(N),(MPa)\n"
    # Two specimens one after the other.
    two = np.concatenate([u, u[:11]])
    (folder / "b.csv").write_text(instron + rows(",", two, two, 50 * two, two))


Edit = Callable[..., UniaxialProject]


@pytest.fixture
def small(tmp_path: Path) -> Edit:
    """Read the small project beside its exports after replacing some texts."""
    write_exports(tmp_path)

    def read(*changes: tuple[str, str], **options) -> UniaxialProject:
        return read_uniaxial(changed(SMALL, changes, tmp_path), **options)

    return read


@pytest.fixture
def example(tmp_path: Path) -> Edit:
    """Read the example after replacing some texts."""
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())

    def read(*changes: tuple[str, str], **options) -> UniaxialProject:
        text = (CURVES / "project.toml").read_text()
        return read_uniaxial(changed(text, changes, tmp_path), **options)

    return read


@pytest.fixture
def joint(tmp_path: Path) -> Callable[..., JointProject]:
    """Read the joint example, with empty files for the bubble's points, after changes."""
    (tmp_path / "curves.csv").write_bytes((JOINT.parent / "curves.csv").read_bytes())
    (tmp_path / "data" / "grid").mkdir(parents=True)
    for i in range(20):
        (tmp_path / "data" / "grid" / f"test1_{i:02d}.csv").touch()

    def read(*changes: tuple[str, str], **options) -> JointProject:
        return read_joint(changed(JOINT.read_text(), changes, tmp_path), **options)

    return read


def changed(text: str, changes: tuple[tuple[str, str], ...], folder: Path) -> Path:
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "project.toml"
    path.write_text(text)
    return path


def complaint(call, *arguments, **options) -> str:
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# The example


def test_the_example_in_mm_and_mpa():
    p = read_uniaxial(CURVES / "project.toml")
    assert (p.thickness, p.width, p.grip_distance, p.bias_angle) == (0.81, 25.0, 75.0, 45.0)
    assert (p.increments, p.match_by, p.objective) == (100, "polynomial", "N")
    assert p.weights == {"warp": 1.0, "fill": 1.0, "bias": 1.0}
    assert {d: (s.gauge_length, s.final_length) for d, s in p.strips.items()} == LENGTHS
    warp = p.strips["warp"]
    assert warp.polynomial is not None
    assert warp.polynomial.coefficients == pytest.approx([0, 812.44, -516.29, 183.02, -18.557])
    assert [s.scatter for s in p.strips.values()] == [21.7, 64.1, 40.3]
    assert warp.curves == () and len(warp.points[0]) == len(warp.specimen_of) == 0
    assert p.least == pytest.approx([20, 20, 1]) and p.largest == pytest.approx([2000, 1000, 200])
    assert (p.margin_E, p.margin_G) == pytest.approx((20, 1))
    assert (p.nu12, p.thickness_change, p.moduli, p.degree) == (0.24, "constant", "cubic", 3)
    assert (p.starts, p.seed, p.method, p.solver, p.max_analyses) == (20, 1, "lm", "membrane", 100)
    # Log strains at the ends; shear of a 45-degree strip that keeps its area: 2 ln(l_f/l_i).
    assert p.strain_range == pytest.approx((ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]))
    assert p.strain_range == pytest.approx((0.153, 0.232, 0.883), abs=5e-4)


def test_units_of_the_file_do_not_matter(example):
    reference = example()
    mpa = example(
        ('modulus = "GPa"', 'modulus = "MPa"'),
        ("E1 = [0.02, 2.0]", "E1 = [20.0, 2000.0]"),
        ("E2 = [0.02, 1.0]", "E2 = [20.0, 1000.0]"),
        ("G12 = [0.001, 0.2]", "G12 = [1.0, 200.0]"),
    )
    assert mpa.lower == pytest.approx(reference.lower)
    assert mpa.upper == pytest.approx(reference.upper)
    metres = example(
        ('length = "mm"', 'length = "m"'),
        ("thickness = 0.81", "thickness = 0.81e-3"),
        ("width = 25.0", "width = 25.0e-3"),
        ("grip_distance = 75.0", "grip_distance = 75.0e-3"),
        ("[uniaxial.data]", "[uniaxial.warp]\nfinal_length = 23.0e-3\n[uniaxial.data]"),
        ("# strain_range", "strain_range"),
    )
    assert metres.thickness == pytest.approx(0.81) and metres.width == pytest.approx(25)
    assert metres.grip_distance == pytest.approx(75)
    # A section picks its direction among those of the file, and replaces its lengths.
    assert list(metres.strips) == ["warp"]
    assert metres.strips["warp"].final_length == pytest.approx(23.0)
    assert metres.strips["warp"].gauge_length == 20.022


def test_strain_range(example):
    given = "strain_range = [0.1, 0.2, 0.3]"
    assert example(("# strain_range = [0.153, 0.232, 0.883]", given)).strain_range == (
        0.1,
        0.2,
        0.3,
    )
    turned = example(("bias_angle = 45.0", "bias_angle = 30.0"))
    shear = 2 * np.sin(np.radians(60)) * ENDS["bias"]
    assert turned.strain_range == pytest.approx((ENDS["warp"], ENDS["fill"], shear))
    # Two directions say nothing about the third strain.
    two = ("[uniaxial.data]", "[uniaxial.warp]\n[uniaxial.fill]\n[uniaxial.data]")
    assert "material.strain_range: this key is missing" in complaint(example, two)
    assert list(example(two, ("# strain_range", "strain_range")).strips) == ["warp", "fill"]
    assert example(two, ('"cubic"', '"constant"')).strain_range == (1.0, 1.0, 1.0)


# Bounds


@pytest.mark.parametrize("form, size", [("constant", 1), ("linear", 2), ("cubic", 4)])
def test_bounds_on_coefficients(example, form, size):
    n = 3 * size
    low = ", ".join(["-0.5"] * (size - 1) + ["0.01"])
    lists = f"lower = [{', '.join([low] * 3)}]\nupper = [{', '.join(['2.0'] * n)}]"
    p = example(
        ('moduli = "cubic"', f'moduli = "{form}"'),
        ("E1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.001, 0.2]", lists),
    )
    assert p.lower.shape == p.upper.shape == (n,) and p.least is p.largest is None
    assert p.lower[size - 1 :: size] == pytest.approx([10] * 3) and (p.upper == 2000).all()
    assert (p.margin_E, p.margin_G) == (5.0, 0.5)
    assert p.free == tuple(4 * m + k for m in range(3) for k in range(4 - size, 4))


@pytest.mark.parametrize("form", ["constant", "linear", "quadratic", "cubic", "trilinear"])
def test_each_modulus_has_bounds_of_its_own(example, form):
    """E1 may not go as low as E2, whatever the smaller of the two."""
    p = example(
        ('moduli = "cubic"', f'moduli = "{form}"'),
        ("E1 = [0.02, 2.0]", "E1 = [0.1, 2.0]"),
        ("G12 = [0.001, 0.2]", "G12 = [0.003, 0.2]"),
    )
    unknowns = parameters_of(p)

    def constant(e1: float, e2: float, g12: float) -> np.ndarray:
        tail = [0.0] * p.degree
        if form == "trilinear":
            return np.repeat([g12, e2, e1], 3)
        return np.array([*tail, g12, *tail, e2, *tail, e1])

    inside = [(100.1, 20.1, 3.1), (1999, 999, 199)]
    outside = [(99, 30, 4), (150, 19, 4), (150, 30, 2.9), (2001, 30, 4), (150, 1001, 4)]
    for moduli, good in [(m, True) for m in inside] + [(m, False) for m in outside]:
        coefficients = constant(*moduli)
        a, c = unknowns.inequalities
        assert unknowns.allowed(coefficients[None])[0] == good, moduli
        assert (a @ unknowns.unknowns(coefficients) >= c).all() == good, moduli
    # Starts too: the moduli at the Chebyshev points (or in the regions), each between its own.
    drawn = unknowns.draw(np.random.default_rng(1), 500) @ np.linalg.inv(unknowns.from_values).T
    n = p.degree + 1
    for block, (low, high) in enumerate([(3, 200), (20, 1000), (100, 2000)]):
        part = drawn[:, n * block : n * block + n]
        assert (part > low * (1 - 1e-9)).all() and (part < high * (1 + 1e-9)).all()
        assert part.min() < 1.1 * low and part.max() > 0.9 * high


def test_breaks(example):
    trilinear = ('moduli = "cubic"', 'moduli = "trilinear"')
    p = example(trilinear)
    # Where three lines follow each load polynomial best, in shares of its strain range.
    assert p.breaks is not None
    # Where three lines follow the load curves best; the warp curve is stiff, soft, stiff.
    assert (0 < p.breaks[:, 0]).all() and (p.breaks[:, 1] < p.strain_range).all()
    assert (p.breaks[:, 0] < p.breaks[:, 1]).all()
    assert p.breaks[0] == pytest.approx([0.022, 0.11], abs=0.006)
    breaks = "[material.breaks]\nwarp = [0.02, 0.1]\nfill = [0.03, 0.2]\nshear = [0.1, 0.5]\n"
    p = example(trilinear, ("# [least, largest]", f"{breaks}# [least, largest]"))
    np.testing.assert_array_equal(p.breaks, [[0.02, 0.1], [0.03, 0.2], [0.1, 0.5]])


# Measured curves


def test_machine_exports_by_direction(small):
    p = small()
    assert list(p.strips) == ["warp", "fill", "bias"]
    names = {d: [c.specimen for c in s.curves] for d, s in p.strips.items()}
    # b.csv lists two specimens, one after the other.
    assert names == {"warp": ["w1", "w2"], "fill": ["f"], "bias": ["b 1", "b 2"]}
    for (direction, strip), slope, gauge in zip(
        p.strips.items(), (200, 80, 50), (20, 22, 19), strict=True
    ):
        u, load = strip.points
        np.testing.assert_allclose(load, slope * u, atol=1e-3, err_msg=direction)
        assert (np.diff(u) >= 0).all()
        assert strip.final_length == pytest.approx(gauge + 4)
        assert strip.polynomial is not None
        assert strip.polynomial.coefficients[:2] == pytest.approx([0, slope], abs=1e-2)
        assert strip.scatter == pytest.approx(0.0, abs=1e-3)
    whose = p.strips["warp"].specimen_of
    u = p.strips["warp"].points[0]
    np.testing.assert_allclose(u[whose == 1], 0.9 * np.linspace(0, 4, 21), atol=1e-6)


def test_what_a_small_project_leaves_out(small):
    p = small()
    assert (p.width, p.grip_distance, p.bias_angle, p.increments) == (25.0, 75.0, 45.0, 100)
    assert (p.match_by, p.objective, p.moduli, p.starts) == ("polynomial", "N", "cubic", 50)
    assert (p.modulus_unit, p.modulus_scale, p.title) == ("GPa", 1000.0, p.path.parent.name)
    assert p.strips["warp"].polynomial is not None and p.strips["warp"].polynomial.order == 4
    lower = small(("[bounds]", "order = 2\nthrough_origin = false\n[bounds]"))
    assert lower.strips["warp"].polynomial is not None
    assert lower.strips["warp"].polynomial.order == 2


def test_points_end_where_the_model_ends(small):
    p = small(
        ("gauge_length = 20.0", "gauge_length = 20.0\nfinal_length = 22.5"),
        ("thickness = 0.81", 'thickness = 0.81\nmatch = "points"'),
    )
    u, load = p.strips["warp"].points
    assert p.match_by == "points" and u.max() <= 2.5 < u.max() + 0.2
    assert len(u) == len(load) == len(p.strips["warp"].specimen_of)
    assert len(p.strips["fill"].points[0]) == 21


def test_one_file_of_all_directions(small, tmp_path):
    u = np.linspace(0, 4, 9)
    lines = [f"{d},{s},{v},{k * v}" for d, k in (("Warp", 200), ("weft", 80), ("45", 50))
             for s in "AB" for v in u]  # fmt: skip
    text = "Direction,Specimen,Extension (mm),Load (N)\n" + "\n".join(lines) + "\n"
    (tmp_path / "all.csv").write_text(text)
    old = 'files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }'
    p = small((old, 'files = ["all.csv"]'))
    for strip in p.strips.values():
        assert [c.specimen for c in strip.curves] == ["A", "B"]
    # By direction the same file gives the rows of that direction.
    both = small((old, 'files = { warp = ["all.csv"], fill = ["all.csv"], bias = ["b.csv"] }'))
    for direction in ("warp", "fill"):
        np.testing.assert_array_equal(
            both.strips[direction].points, p.strips[direction].points, direction
        )
    # A section picks among what the file holds.
    sections = "[uniaxial.bias]\ngauge_length = 19.0\n"
    p = small((old, 'files = ["all.csv"]'), (sections, ""), ("[bounds]", RANGE))
    assert list(p.strips) == ["warp", "fill"]


RANGE = "[material]\nstrain_range = [0.1, 0.1, 0.5]\n[bounds]"


def test_columns_and_units_of_exports(small, tmp_path):
    u = np.linspace(0, 0.4, 9)
    (tmp_path / "f.TXT").write_text("A;B;C\n" + rows(";", u, 0.8 * u, u, comma=True) + "\n")
    for name in ("w1", "w2", "b"):
        (tmp_path / f"{name}.csv").write_bytes((tmp_path / "f.TXT").read_bytes())
    wanted = 'columns = { elongation = "A", load = "B" }\n'
    old = "files ="
    message = complaint(small, (old, wanted + old))
    assert "w1.csv: line 1, column 'A': the file does not name the unit; say length_unit" in message
    units = 'length_unit = "cm"\nload_unit = "kN"\ndecimal = ","\n'
    p = small((old, wanted + units + old))
    curve = p.strips["warp"].curves[0]
    np.testing.assert_allclose(curve.elongation, 10 * u)
    np.testing.assert_allclose(curve.load, 800 * u)


def test_data_folder(small, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    for name in ("w1.csv", "w2.csv", "f.TXT", "b.csv"):
        (tmp_path / name).rename(other / name)
    message = complaint(small)
    assert message == (
        f"{tmp_path / 'project.toml'}: uniaxial.data.files.warp[0]: there is no file"
        f" {tmp_path / 'w1.csv'}; --data DIR names another folder"
    )
    assert small(data_folder=other).strips.keys() == LENGTHS.keys()
    assert small(("[uniaxial.data]", '[uniaxial.data]\nfolder = "other"')).strips.keys()


def test_a_forward_analysis_does_without_data(example, small, tmp_path):
    write_exports(tmp_path)
    for name in ("w1.csv", "curves.csv"):
        (tmp_path / name).unlink()
    # Without lengths there is no model: the data are needed for them.
    assert "there is no file" in complaint(small, need_data=False)
    assert "there is no file" in complaint(example, need_data=False)
    ends = [(f"gauge_length = {a}.0", f"gauge_length = {a}.0\nfinal_length = {a + 4}.0")
            for a in (20, 22, 19)]  # fmt: skip
    p = small(*ends, need_data=False)
    assert [s.final_length for s in p.strips.values()] == [24, 26, 23]
    assert all(s.polynomial is None and s.scatter is None for s in p.strips.values())
    assert "there is no file" in complaint(small, *ends)


def test_real_points(shared_data):
    p = read_uniaxial(CURVES / "points.toml", shared_data / "uniaxial")
    assert p.match_by == "points"
    assert [len(s.curves) for s in p.strips.values()] == [5, 5, 5]
    scatter = [s.scatter for s in p.strips.values()]
    assert scatter == pytest.approx([21.7, 64.1, 40.3], abs=0.05)
    assert p.strain_range == pytest.approx((ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]))


# What is wrong is said


OLD_FILES = 'files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }'
BOUNDS = "E1 = [0.02, 2.0]\nE2 = [0.01, 1.0]\nG12 = [0.001, 0.2]"


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('kind = "uniaxial"', 'kind = "bubble"', ["project.kind", "run `bubblefit bubble`"]),
        ('kind = "uniaxial"', "kind = []", ["project.kind", "expected 'uniaxial', got []"]),
        ('kind = "uniaxial"', "kind = { a = 1 }", ["project.kind", "expected 'uniaxial'"]),
        ('kind = "uniaxial"', "", ["project.kind", "missing"]),
        ("thickness = 0.81", "", ["uniaxial.thickness", "missing"]),
        ("thickness = 0.81", "thickness = 0", ["uniaxial.thickness", "greater than 0"]),
        ("thickness", "thikness", ["uniaxial.thikness", "did you mean 'thickness'"]),
        ("thickness = 0.81", "thickness = 1\nwidth = -1", ["uniaxial.width", "greater than 0"]),
        ("thickness = 0.81", "thickness = 1\nbias_angle = 90", ["uniaxial.bias_angle", "90"]),
        ("thickness = 0.81", "thickness = 1\nincrements = 0", ["uniaxial.increments", "1"]),
        ("thickness = 0.81", 'thickness = 1\nmatch = "all"', ["uniaxial.match", "'points'"]),
        (
            "thickness = 0.81",
            "thickness = 1\ngrip_distance = 19.0",
            ["uniaxial.bias.gauge_length", "distance of the grips, 19 mm"],
        ),
        ("gauge_length = 20.0", "", ["uniaxial.warp.gauge_length", "missing"]),
        ("gauge_length = 20.0", "length = 20.0", ["uniaxial.warp.length", "gauge_length"]),
        ("[uniaxial.warp]\ngauge_length = 20.0", "", ["uniaxial.warp.gauge_length", "missing"]),
        (
            "gauge_length = 20.0",
            "gauge_length = 20.0\nfinal_length = 20.0",
            ["uniaxial.warp.final_length", "more than the gauge length 20 mm"],
        ),
        (
            "gauge_length = 20.0",
            "gauge_length = 20.0\nfinal_length = 25.0",
            ["uniaxial.warp.final_length", "the data end at an elongation of 4 mm", "24 mm"],
        ),
        (OLD_FILES, "", ["uniaxial.data", "exactly one of 'polynomials' and 'files'"]),
        (OLD_FILES, f'polynomials = "c.csv"\n{OLD_FILES}', ["uniaxial.data", "exactly one"]),
        (OLD_FILES, 'polynomials = "c.csv"', ["uniaxial.data.polynomials", "there is no file"]),
        (OLD_FILES, "files = []", ["uniaxial.data.files", "at least 1 items"]),
        (OLD_FILES, "files = {}", ["uniaxial.data.files", "files of one direction at least"]),
        (OLD_FILES, "files = 3", ["uniaxial.data.files", "list"]),
        (OLD_FILES, 'files = "w1.csv"', ["uniaxial.data.files", "list", "'w1.csv'"]),
        (OLD_FILES, 'files = ["w1.csv", 2]', ["uniaxial.data.files[1]", "string", "2"]),
        (OLD_FILES, 'files = ["w1.csv"]', ["w1.csv: line 4", "files = { warp = [...] }"]),
        ('warp = ["w1.csv", "w2.csv"]', "warp = []", ["uniaxial.data.files.warp", "at least 1"]),
        ('warp = ["w1.csv", ', "warp = [1, ", ["uniaxial.data.files.warp[0]", "string"]),
        ('warp = ["w1.csv", "w2.csv"]', 'warp = "w1.csv"', ["files.warp", "list", "'w1.csv'"]),
        ("fill = [", "weft = [", ["uniaxial.data.files.weft", "allowed here: warp, fill, bias"]),
        ('"w2.csv"', '"./w1.csv"', ["uniaxial.data.files.warp[1]", "listed twice"]),
        ('"f.TXT"', '"w1.csv"', ["uniaxial.data.files.fill[0]", "is listed for warp too"]),
        ('"f.TXT"', '"x.csv"', ["uniaxial.data.files.fill[0]", "there is no file", "--data DIR"]),
        (
            'fill = ["f.TXT"], ',
            "",
            ["uniaxial.fill", "no fill test; leave this section out or add its data"],
        ),
        ("[bounds]", "order = 0\n[bounds]", ["uniaxial.data.order", "1"]),
        (
            "[bounds]",
            "order = 10\nthrough_origin = 1\n[bounds]",
            ["uniaxial.data.through_origin", "boolean"],
        ),
        ("[bounds]", 'load_unit = "lbf"\n[bounds]', ["uniaxial.data.load_unit", "'N' or 'kN'"]),
        ("[bounds]", 'length_unit = "in"\n[bounds]', ["uniaxial.data.length_unit", "'cm' or 'm'"]),
        ("[bounds]", 'decimal = ";"\n[bounds]', ["uniaxial.data.decimal", "'.' or ','"]),
        (
            "[bounds]",
            'load_unit = "N"\n[bounds]',
            ["w1.csv: line 4", "the file says 'kN', load_unit says 'N'"],
        ),
        (
            "[bounds]",
            'columns = { force = "F" }\n[bounds]',
            ["uniaxial.data.columns.force", "allowed here: elongation, load, specimen, direction"],
        ),
        (
            "[bounds]",
            'columns = { load = "F" }\n[bounds]',
            ["w1.csv", "no header row with the columns one of elongation and 'F'"],
        ),
        ("[bounds]", "[uniaxial.weights]\nwarp = -1\n[bounds]", ["uniaxial.weights.warp", "0"]),
        (
            "[bounds]",
            "[uniaxial.weights]\nwarp = 0\nfill = 0\nbias = 0\n[bounds]",
            ["uniaxial.weights", "nothing would be matched"],
        ),
        ("[bounds]", '[units]\nload = "kN"\n[bounds]', ["units.load", "unknown key"]),
        (BOUNDS, "", ["bounds", "[least, largest] of E1, E2 and G12, or 'lower' and 'upper'"]),
        ("G12 = [0.001, 0.2]", "", ["bounds.G12", "missing"]),
        ("G12 = [0.001, 0.2]", "G12 = [0.001]", ["bounds.G12", "at least 2 items"]),
        ("G12 = [0.001, 0.2]", "G12 = [0.2, 0.2]", ["bounds.G12", "[least, largest]"]),
        ("G12 = [0.001, 0.2]", "G12 = [-1, 0.2]", ["bounds.G12[0]", "greater than 0"]),
        (BOUNDS, f"{BOUNDS}\nlower = [1]", ["bounds", "some of both"]),
        (BOUNDS, "lower = [0.1]", ["bounds.upper", "missing"]),
        (BOUNDS, "lower = [0.1]\nupper = [1]", ["bounds.lower", "12 coefficients", "got 1"]),
        ("[bounds]", "[fit.margin]\nE = 1\nG12 = 1\n[bounds]", ["fit.margin", "leave this out"]),
        ("[bounds]", "[fit.nuisance]\n[bounds]", ["fit.nuisance", "unknown key"]),
        ("[bounds]", '[fit]\nobjective = "e"\n[bounds]', ["fit.objective", "'N' or 'relative'"]),
        (
            "[bounds]",
            '[fit]\nconstraints = "boolean"\n[bounds]',
            ["fit.constraints", "use 'margin' with method 'lm', or 'slsqp' or 'cobyla'"],
        ),
        ("[bounds]", "[bubble]\n[bounds]", ["bubble", "unknown key"]),
        (
            "[bounds]",
            '[material]\nmoduli = "linear"\ndegree = 1\n[bounds]',
            ["material.degree", "leave one out"],
        ),
        ("[bounds]", '[material]\nmoduli = "quartic"\n[bounds]', ["material.moduli", "'cubic'"]),
        (
            "[bounds]",
            "[material.breaks]\nwarp=[1,2]\nfill=[1,2]\nshear=[1,2]\n[bounds]",
            ["material.breaks", "only a trilinear law has breaks, not cubic moduli"],
        ),
        (
            "[bounds]",
            '[material]\nmoduli = "trilinear"\n[material.breaks]\nwarp=[0.1,0.15]\n'
            "fill=[0.1,0.05]\nshear=[0.1,0.2]\n[bounds]",
            ["material.breaks.fill", "increasing strains below the end of the range"],
        ),
        (
            "[bounds]",
            '[material]\nmoduli = "trilinear"\n[material.breaks]\nwarp=[0.1,0.15]\n[bounds]',
            ["material.breaks.fill", "missing"],
        ),
        ("thickness = 0.81", "thickness = ", ["TOML syntax", "line"]),
    ],
)
def test_bad_input_names_file_and_field(small, tmp_path, old, new, words):
    message = complaint(small, (old, new))
    assert message.startswith(str(tmp_path))
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    "text, words",
    [
        ("Extension (mm),Load (N)\n1,2\n2,x\n", ["f.TXT: line 3, column 'Load (N)': expected a n"]),
        (
            "Extension (mm),Load (N)\n1,2\n2,3\n",
            ["project.toml: uniaxial.data, order 4: no load curve through the fill points", "2"],
        ),
        (
            "Extension (mm),Load (N)\n-1,2\n-2,3\n",
            ["project.toml: uniaxial.data, elongation: no load curve through the fill points"],
        ),
        ("Extension (mm),Load (N)\n1,0\n2,0\n", ["uniaxial.data, load", "all 2 loads are 0 N"]),
        (
            "Direction,Extension (mm),Load (N)\nwarp,1,2\n",
            ["f.TXT: column 'Dir", "no fill; it has"],
        ),
        ("", ["f.TXT: no header row"]),
    ],
)
def test_bad_data_names_the_file_or_the_project(small, tmp_path, text, words):
    (tmp_path / "f.TXT").write_text(text)
    message = complaint(small)
    for word in words:
        assert word in message, message


def test_points_are_needed_where_they_are_to_be_matched(example, small, tmp_path):
    match = ('match = "polynomial"', 'match = "points"')
    message = complaint(example, match)
    assert "uniaxial.match: 'points' needs measured points (data.files)" in message
    # The first points lie beyond the end of the model.
    text = "Extension (mm),Load (N)\n" + rows(",", np.arange(1.0, 9.0), np.arange(8.0))
    (tmp_path / "f.TXT").write_text(text)
    short = ("gauge_length = 22.0", "gauge_length = 22.0\nfinal_length = 22.5")
    message = complaint(small, short, ("thickness =", 'match = "points"\nthickness ='))
    assert message.startswith(
        f"{tmp_path / 'project.toml'}: uniaxial.fill.final_length: no measured"
    )


def test_paths_of_calculix_are_beside_the_project(small, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    calculix = '[solver.calculix]\nccx = "bin/ccx"\ntemplates = "~/decks"\n[bounds]'
    options = small(("[bounds]", calculix)).solver_options["calculix"]
    assert options["ccx"] == tmp_path / "bin" / "ccx"
    assert options["templates"] == tmp_path / "home" / "decks"
    plain = small(("[bounds]", '[solver.calculix]\nccx = "ccx_2.20"\n[bounds]'))
    assert plain.solver_options["calculix"]["ccx"] == "ccx_2.20"


# Joint


def test_the_joint_example(joint, tmp_path):
    p = joint()
    assert (p.bubble_weight, p.uniaxial_weight) == (1.0, 1.0)
    assert p.thickness == p.bubble.thickness == p.uniaxial.thickness == 0.81
    assert p.bubble.objective == "e" and p.uniaxial.objective == "relative"
    assert len(p.bubble.pressures) == 20 and p.bubble.pressures[0] == pytest.approx(0.0091422)
    assert list(p.uniaxial.strips) == ["warp", "fill", "bias"]
    assert (
        p.strain_range == p.bubble.strain_range == p.uniaxial.strain_range == (0.18, 0.232, 0.883)
    )
    assert p.thickness_change == "incompressible" and p.starts == 8
    for part in (p.bubble, p.uniaxial):
        np.testing.assert_array_equal(part.lower, p.lower)
    # The strips' range where none is given.
    without = joint(("strain_range = [0.18,", "# ["))
    assert without.strain_range == pytest.approx((ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]))
    solved = replace(p, solver="calculix")
    assert solved.bubble.solver == solved.uniaxial.solver == "calculix"


def test_folders_of_a_joint_project(joint, tmp_path):
    other = tmp_path / "strips"
    other.mkdir()
    (tmp_path / "curves.csv").rename(other / "curves.csv")
    message = complaint(joint)
    assert "uniaxial.data.polynomials: there is no file" in message
    assert "--strip-data DIR names another folder" in message
    assert joint(strip_folder=other, data_folder=tmp_path / "data").uniaxial.strips
    assert "--data DIR" in complaint(joint, strip_folder=other, data_folder=tmp_path)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('kind = "joint"', 'kind = "uniaxial"', ["project.kind", "run `bubblefit uniaxial`"]),
        ("[uniaxial]\nthickness = 0.81", "[uniaxial]\nthickness = 0.8", ["uniaxial.thickness"]),
        ("bubble = 1.0", "bubble = 0.0", ["joint.bubble", "run `bubblefit bubble` or `uniaxial`"]),
        ("uniaxial = 1.0", "uniaxial = 0.0", ["joint.uniaxial", "expected above 0"]),
        ("uniaxial = 1.0", "strips = 1.0", ["joint.strips", "allowed here: bubble, uniaxial"]),
        ("bubble = 1.0", "bubble = -1.0", ["joint.bubble", "greater than or equal to 0"]),
        ("starts = 8", 'starts = 8\nobjective = "N"', ["fit.objective", "unknown key"]),
        ("radius = 100.0", "", ["bubble.radius", "missing"]),
        ("0.091422, 0.211985", "0.3, 0.2", ["bubble.pressures[1]", "increase"]),
        ('polynomials = "curves.csv"', "", ["uniaxial.data", "exactly one"]),
        ("E1 = [0.01, 2.0]", "", ["bounds.E1", "missing"]),
        ("indices = [0, ", "indices = [", ["data.points.indices", "20 pressures, got 19"]),
    ],
)
def test_bad_joint_projects(joint, tmp_path, old, new, words):
    message = complaint(joint, (old, new))
    assert message.startswith(f"{tmp_path / 'project.toml'}: ")
    for word in words:
        assert word in message, message


# Examples to start from


@pytest.mark.parametrize("kind, file", [("uniaxial", "project.toml"), ("joint", "test1.toml")])
def test_init_names_the_command_that_runs_it(tmp_path, kind, file):
    folder = tmp_path / "mine"
    done = CliRunner().invoke(main, ["init", str(folder), "--example", kind])
    assert done.exit_code == 0
    assert f"next: bubblefit {kind} {folder / file}" in done.output
    assert ("--data DIR" in done.output) == (kind == "joint")
    if kind == "uniaxial":
        assert read_uniaxial(folder / file).strips.keys() == LENGTHS.keys()
    else:
        assert "--data DIR" in complaint(read_joint, folder / file)
    again = CliRunner().invoke(main, ["init", str(folder), "--example", kind])
    assert again.exit_code == 2 and "already there" in again.stderr
