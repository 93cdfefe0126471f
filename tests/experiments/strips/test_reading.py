"""[[strips]] of a project: units, defaults, data by direction."""

from collections.abc import Callable

import numpy as np
import pytest
from bubblefit.experiments.strips.section import CurvesSection, StripsSection
from bubblefit.experiments.strips.test import StripsTest

from ...complaints import complaint, complaint_with
from ...projects import project_file
from .sections import CURVES, ENDS, LENGTHS, PUBLISHED, SMALL, read, rows, write_exports

Edit = Callable[..., StripsTest]


@pytest.fixture
def small(tmp_path) -> Edit:
    """Read the small section beside its exports after replacing some texts."""
    write_exports(tmp_path)

    def edited(*changes: tuple[str, str], **options) -> StripsTest:
        return read(project_file(tmp_path, SMALL, *changes), **options)

    return edited


@pytest.fixture
def example(tmp_path) -> Edit:
    """Read the published polynomials after replacing some texts."""
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())

    def edited(*changes: tuple[str, str], **options) -> StripsTest:
        return read(project_file(tmp_path, PUBLISHED, *changes), **options)

    return edited


def test_the_published_polynomials_in_mm(example):
    p = example()
    assert (p.thickness, p.width, p.grip_distance, p.bias_angle) == (0.81, 25.0, 75.0, 45.0)
    assert (p.increments, p.match_by, p.objective) == (100, "polynomial", "N")
    assert p.weights == {"warp": 1.0, "fill": 1.0, "bias": 1.0} and p.weight == 1.0
    assert (p.kind, p.name) == ("strips", "strips")
    assert {d: (s.gauge_length, s.final_length) for d, s in p.strips.items()} == LENGTHS
    warp = p.strips["warp"]
    assert warp.polynomial is not None
    assert warp.polynomial.coefficients == pytest.approx([0, 812.44, -516.29, 183.02, -18.557])
    assert [s.scatter for s in p.strips.values()] == [21.7, 64.1, 40.3]
    assert warp.curves == () and len(warp.points[0]) == len(warp.specimen_of) == 0
    # Log strains at the ends; shear of a 45-degree strip that keeps its area: 2 ln(l_f/l_i).
    assert p.reach.strain == pytest.approx((ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]))
    assert p.reach.strain == pytest.approx((0.153, 0.232, 0.883), abs=5e-4)


def test_units_of_the_file_do_not_matter(example):
    metres = example(
        ("width = 25.0", "width = 25.0e-3"),
        ("grip_distance = 75.0", "grip_distance = 75.0e-3"),
        ("[data]", "[warp]\nfinal_length = 23.0e-3\n[data]"),
        length="m",
    )
    assert metres.width == pytest.approx(25)
    assert metres.grip_distance == pytest.approx(75)
    # A table picks its direction among those of the file, and replaces its lengths.
    assert list(metres.strips) == ["warp"]
    assert metres.strips["warp"].final_length == pytest.approx(23.0)
    assert metres.strips["warp"].gauge_length == 20.022


def test_what_the_gauges_say_of_the_law(example):
    turned = example(("bias_angle = 45.0", "bias_angle = 30.0"))
    shear = 2 * np.sin(np.radians(60)) * ENDS["bias"]
    assert turned.reach.strain == pytest.approx((ENDS["warp"], ENDS["fill"], shear))
    # Two directions say nothing about the third strain.
    two = example(("[data]", "[warp]\n[fill]\n[data]"))
    assert two.reach.strain == (pytest.approx(ENDS["warp"]), pytest.approx(ENDS["fill"]), None)
    assert two.reach.break_shares[2] is None
    # Where three lines follow the load curves best; the warp curve is stiff, soft, stiff.
    shares = np.array(example().reach.break_shares)
    assert (shares[:, 0] > 0).all() and (shares[:, 1] < 1).all()
    assert (shares[:, 0] < shares[:, 1]).all()
    assert ENDS["warp"] * shares[0] == pytest.approx([0.022, 0.11], abs=0.006)


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


def test_what_a_small_section_leaves_out(small):
    p = small()
    assert (p.width, p.grip_distance, p.bias_angle, p.increments) == (25.0, 75.0, 45.0, 100)
    assert (p.match_by, p.objective) == ("polynomial", "N")
    assert p.strips["warp"].polynomial is not None and p.strips["warp"].polynomial.order == 4
    assert p.strips["warp"].through_origin
    lower = small(("[data]", "[data]\norder = 2\nthrough_origin = false"))
    assert lower.strips["warp"].polynomial is not None
    assert lower.strips["warp"].polynomial.order == 2 and not lower.strips["warp"].through_origin


def test_points_end_where_the_model_ends(small):
    p = small(
        ("gauge_length = 20.0", "gauge_length = 20.0\nfinal_length = 22.5"),
        ("[warp]", 'match = "points"\n[warp]'),
    )
    u, load = p.strips["warp"].points
    assert p.match_by == "points" and u.max() <= 2.5 < u.max() + 0.2
    assert len(u) == len(load) == len(p.strips["warp"].specimen_of)
    assert p.strips["warp"].beyond == 42 - len(u) > 0
    assert len(p.strips["fill"].points[0]) == 21 and p.strips["fill"].beyond == 0


def test_a_polynomial_is_followed_a_twentieth_beyond_the_points(small, example):
    def gauge(final: float):
        end = ("gauge_length = 20.0", f"gauge_length = 20.0\nfinal_length = {final}")
        return small(end).strips["warp"].final_length

    assert gauge(24.199) == 24.199
    said = complaint(gauge, 24.201)
    assert said.endswith(
        "strips[0].warp.final_length: the data end at an elongation of 4 mm; expected up to 24 mm, "
        "got 24.201 mm"
    )
    # A published polynomial ends where its own final length is.
    warp = "[warp]\nfinal_length = {}\n[data]"
    assert list(example(("[data]", warp.format(23.49))).strips) == ["warp"]
    assert "the data end" in complaint(example, ("[data]", warp.format(23.50)))


def test_breaks_follow_the_specimens_kept(small, tmp_path):
    """A second specimen of another shape moves the breaks; without it they are the first's."""
    u = np.linspace(0, 4, 41)
    head = "Extension (mm),Load (N)\n"
    early = 200 * np.minimum(u, 0.8) + 20 * u
    late = 200 * np.minimum(u, 3.0) + 20 * u
    (tmp_path / "w1.csv").write_text(head + rows(",", u, early))
    (tmp_path / "w2.csv").write_text(head + rows(",", u, late))
    strip = small().strips["warp"]
    first = strip.specimen_of == 0
    (tmp_path / "w2.csv").write_text(head + rows(",", u, early))
    alone = small().strips["warp"]
    assert strip.break_shares(first) == pytest.approx(alone.break_shares())
    assert strip.break_shares(first) != pytest.approx(strip.break_shares())


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
    # A table picks among what the file holds.
    p = small((old, 'files = ["all.csv"]'), ("[bias]\ngauge_length = 19.0\n", ""))
    assert list(p.strips) == ["warp", "fill"]


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
        f"{tmp_path / 'project.toml'}: strips[0].data.files.warp[0]: there is no file"
        f" {tmp_path / 'w1.csv'}; --data DIR names another folder"
    )
    assert small(data_folder=other).strips.keys() == LENGTHS.keys()
    assert small(("[data]", '[data]\nfolder = "other"')).strips.keys()


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
    assert p.reach.strain[0] == pytest.approx(np.log(24 / 20))
    assert p.reach.break_shares == (None, None, None)
    assert "there is no file" in complaint(small, *ends)


def test_real_points(shared_data, tmp_path):
    lengths = "".join(
        f"[{d}]\ngauge_length = {a}\nfinal_length = {b}\n" for d, (a, b) in LENGTHS.items()
    )
    text = f'match = "points"\n{lengths}[data]\nfiles = ["valmex7318_load_gauge.csv"]\n'
    p = read(project_file(tmp_path, text), data_folder=shared_data / "uniaxial")
    assert p.match_by == "points"
    assert [len(s.curves) for s in p.strips.values()] == [5, 5, 5]
    scatter = [s.scatter for s in p.strips.values()]
    assert scatter == pytest.approx([21.7, 64.1, 40.3], abs=0.05)
    assert p.reach.strain == pytest.approx((ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]))


def test_loads_per_width_are_multiplied_by_the_strips_own(small, tmp_path):
    per_width = (tmp_path / "w1.csv").read_text().replace("mm,kN,sec", "mm,kN/m,sec")
    (tmp_path / "w1.csv").write_text(per_width)
    for width, said in ((25.0, ""), (50.0, "width = 50.0\n")):
        first, _ = small(("[warp]", f"{said}[warp]")).strips["warp"].curves
        np.testing.assert_allclose(first.load, 0.2 * first.elongation * width, rtol=1e-9, atol=1e-9)


def test_a_choice_of_columns_is_kept_for_the_report(small, tmp_path):
    text = (tmp_path / "b.csv").read_text().replace("Tensile stress", "Crosshead [mm]")
    (tmp_path / "b.csv").write_text(text.replace("(MPa)", "(mm)"))
    curves = small().strips["bias"].curves
    assert len(curves) == 2
    for curve in curves:
        assert "the elongation is column 'Extension', not 'Crosshead [mm]'" in curve.notes[0]


OLD_FILES = 'files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }'
TOP = "[warp]\n"


@pytest.fixture
def small_sections(tmp_path) -> Callable[..., StripsTest]:
    """Read the small_sections section beside its exports after replacing some texts."""
    write_exports(tmp_path)

    def edited(*changes: tuple[str, str]) -> StripsTest:
        return read(project_file(tmp_path, SMALL, *changes))

    return edited


@pytest.mark.parametrize(
    "old, new, words",
    [
        (TOP, f"thikness = 0.81\n{TOP}", ["strips[0].thikness", "unknown key"]),
        (TOP, f"widht = 1\n{TOP}", ["strips[0].widht", "did you mean 'width'"]),
        (TOP, f"width = -1\n{TOP}", ["strips[0].width", "greater than 0"]),
        (TOP, f"bias_angle = 90\n{TOP}", ["strips[0].bias_angle", "90"]),
        (TOP, f"increments = 0\n{TOP}", ["strips[0].increments", "1"]),
        (TOP, f'match = "all"\n{TOP}', ["strips[0].match", "'points'"]),
        (TOP, f'objective = "e"\n{TOP}', ["strips[0].objective", "'N' or 'relative'"]),
        (TOP, f"weight = -1\n{TOP}", ["strips[0].weight", "0"]),
        (
            TOP,
            f"grip_distance = 19.0\n{TOP}",
            ["strips[0].bias.gauge_length", "distance of the grips, 19 mm"],
        ),
        ("gauge_length = 20.0", "", ["strips[0].warp.gauge_length", "missing"]),
        ("gauge_length = 20.0", "length = 20.0", ["strips[0].warp.length", "gauge_length"]),
        ("[warp]\ngauge_length = 20.0", "", ["strips[0].warp.gauge_length", "missing"]),
        (
            "gauge_length = 20.0",
            "gauge_length = 20.0\nfinal_length = 20.0",
            ["strips[0].warp.final_length", "more than the gauge length 20 mm"],
        ),
        (
            "gauge_length = 20.0",
            "gauge_length = 20.0\nfinal_length = 25.0",
            ["strips[0].warp.final_length", "the data end at an elongation of 4 mm", "24 mm"],
        ),
        (OLD_FILES, "", ["strips[0].data", "exactly one of 'polynomials' and 'files'"]),
        (OLD_FILES, f'polynomials = "c.csv"\n{OLD_FILES}', ["strips[0].data", "exactly one"]),
        (OLD_FILES, 'polynomials = "c.csv"', ["strips[0].data.polynomials", "there is no file"]),
        (OLD_FILES, "files = []", ["strips[0].data.files", "at least 1 items"]),
        (OLD_FILES, "files = {}", ["strips[0].data.files", "files of one direction at least"]),
        (OLD_FILES, "files = 3", ["strips[0].data.files", "list"]),
        (OLD_FILES, 'files = "w1.csv"', ["strips[0].data.files", "list", "'w1.csv'"]),
        (OLD_FILES, 'files = ["w1.csv", 2]', ["strips[0].data.files[1]", "string", "2"]),
        (OLD_FILES, 'files = ["w1.csv"]', ["w1.csv: line 4", "files = { warp = [...] }"]),
        ('warp = ["w1.csv", "w2.csv"]', "warp = []", ["strips[0].data.files.warp", "at least 1"]),
        ('warp = ["w1.csv", ', "warp = [1, ", ["strips[0].data.files.warp[0]", "string"]),
        ('warp = ["w1.csv", "w2.csv"]', 'warp = "w1.csv"', ["files.warp", "list", "'w1.csv'"]),
        ("fill = [", "weft = [", ["strips[0].data.files.weft", "allowed here: warp, fill, bias"]),
        ('"w2.csv"', '"./w1.csv"', ["strips[0].data.files.warp[1]", "listed twice"]),
        ('"f.TXT"', '"w1.csv"', ["strips[0].data.files.fill[0]", "is listed for warp too"]),
        ('"f.TXT"', '"x.csv"', ["strips[0].data.files.fill[0]", "there is no file", "--data DIR"]),
        (
            'fill = ["f.TXT"], ',
            "",
            ["strips[0].fill", "no fill test; leave this section out or add its data"],
        ),
        ("[data]", "[data]\norder = 0", ["strips[0].data.order", "1"]),
        (
            "[data]",
            "[data]\norder = 10\nthrough_origin = 1",
            ["strips[0].data.through_origin", "boolean"],
        ),
        (
            "[data]",
            '[data]\nload_unit = "lbf"',
            ["strips[0].data.load_unit", "'N', 'kN', 'kN/m' or 'N/mm'"],
        ),
        ("[data]", '[data]\nlength_unit = "in"', ["strips[0].data.length_unit", "'cm' or 'm'"]),
        ("[data]", '[data]\ndecimal = ";"', ["strips[0].data.decimal", "'.' or ','"]),
        (
            "[data]",
            '[data]\nload_unit = "N"',
            ["w1.csv: line 4", "the file says 'kN', load_unit says 'N'"],
        ),
        (
            "[data]",
            '[data]\ncolumns = { force = "F" }',
            ["strips[0].data.columns.force", "allowed here: elongation, load, specimen, direction"],
        ),
        (
            "[data]",
            '[data]\ncolumns = { load = "F" }',
            ["w1.csv", "no header row with the columns one of elongation and 'F'"],
        ),
        ("[data]", "[weights]\nwarp = -1\n[data]", ["strips[0].weights.warp", "0"]),
        (
            "[data]",
            "[weights]\nwarp = 0\nfill = 0\nbias = 0\n[data]",
            ["strips[0].weights", "nothing would be matched"],
        ),
    ],
)
def test_bad_input_names_file_and_field(small_sections, tmp_path, old, new, words):
    assert complaint_with(words, small_sections, (old, new)).startswith(str(tmp_path))


@pytest.mark.parametrize(
    "text, words",
    [
        ("Extension (mm),Load (N)\n1,2\n2,x\n", ["f.TXT: line 3, column 'Load (N)': expected a n"]),
        (
            "Extension (mm),Load (N)\n1,2\n2,3\n",
            ["project.toml: strips[0].data, order 4: no load curve through the fill points", "2"],
        ),
        (
            "Extension (mm),Load (N)\n-1,2\n-2,3\n",
            ["project.toml: strips[0].data, elongation: no load curve through the fill points"],
        ),
        ("Extension (mm),Load (N)\n1,0\n2,0\n", ["strips[0].data, load", "all 2 loads are 0 N"]),
        (
            "Direction,Extension (mm),Load (N)\nwarp,1,2\n",
            ["f.TXT: column 'Dir", "no fill; it has"],
        ),
        ("", ["f.TXT: no header row"]),
    ],
)
def test_bad_data_names_the_file_or_the_project(small_sections, tmp_path, text, words):
    (tmp_path / "f.TXT").write_text(text)
    complaint_with(words, small_sections)


def test_points_are_needed_where_they_are_to_be_matched(small_sections, tmp_path):
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())
    points = ('match = "polynomial"', 'match = "points"')
    message = complaint(read, project_file(tmp_path, PUBLISHED, points))
    assert "strips[0].match: 'points' needs measured points (data.files)" in message
    # The first points lie beyond the end of the model.
    text = "Extension (mm),Load (N)\n" + rows(",", np.arange(1.0, 9.0), np.arange(8.0))
    (tmp_path / "f.TXT").write_text(text)
    short = ("gauge_length = 22.0", "gauge_length = 22.0\nfinal_length = 22.5")
    message = complaint(small_sections, short, (TOP, f'match = "points"\n{TOP}'))
    assert message.startswith(
        f"{tmp_path / 'project.toml'}: strips[0].fill.final_length: no measured"
    )


def test_defaults():
    said = StripsSection(data=CurvesSection())
    assert (said.bias_angle, said.increments) == (45.0, 100)
    assert (said.match, said.objective, said.weight) == ("polynomial", "N", 1.0)
    assert said.weights.model_dump() == {"warp": 1.0, "fill": 1.0, "bias": 1.0}
    assert (said.data.order, said.data.through_origin, said.data.comment) == (4, True, "#")
