"""experiments/strips/reading.py: keys and gauges of a section, and the files that it names."""

from collections.abc import Callable

import numpy as np
import pytest
from bubblefit.experiments.strips import StripsTest
from bubblefit.experiments.strips.reading import StripsSection

from ...builders.projects import project_file
from ...support.refusals import complaint, complaint_with
from .cases import CURVES, PUBLISHED, SMALL, read_strips, rows_of, write_exports

#: Table 3.1: gauge and final lengths, mm.
LENGTHS = {"warp": (20.022, 23.329), "fill": (22.780, 28.721), "bias": (19.767, 30.734)}
ENDS = {direction: float(np.log(b / a)) for direction, (a, b) in LENGTHS.items()}


def ends(further: float) -> list[tuple[str, str]]:
    """Final lengths (mm) of the small section so much beyond its gauges."""
    gauges = {a: f"gauge_length = {a}.0" for a in (20, 22, 19)}
    return [(said, f"{said}\nfinal_length = {a + further}") for a, said in gauges.items()]


Edit = Callable[..., StripsTest]
HEAD = "Extension (mm),Load (N)\n"


@pytest.fixture
def small_strips(tmp_path) -> Edit:
    write_exports(tmp_path)
    return lambda *changes, **options: read_strips(
        project_file(tmp_path, SMALL, *changes), **options
    )


@pytest.fixture
def example_strips(tmp_path) -> Edit:
    (tmp_path / "curves.csv").write_bytes((CURVES / "curves.csv").read_bytes())
    return lambda *changes, **options: read_strips(
        project_file(tmp_path, PUBLISHED, *changes), **options
    )


@pytest.mark.parametrize("key", ["compliance", "compliance_prior"])
def test_compliance_is_refused_beside_polynomials(example_strips, key):
    change = "width = 25.0", f"{key} = 1e-3\nwidth = 25.0"
    assert f"strips[0].{key}: needs measured points" in complaint(example_strips, change)


def test_the_published_polynomials_in_mm(example_strips):
    p = example_strips()
    assert (p.width, p.grip_distance, p.bias_angle) == (25.0, 75.0, 45.0)
    assert (p.increments, p.match_by, p.objective) == (100, "polynomial", "N")
    assert (p.kind, p.name) == ("strips", "strips")
    assert {d: (s.gauge_length, s.final_length) for d, s in p.strips.items()} == LENGTHS
    warp = p.strips["warp"]
    assert warp.polynomial.coefficients == pytest.approx([0, 812.44, -516.29, 183.02, -18.557])
    assert [s.scatter for s in p.strips.values()] == [21.7, 64.1, 40.3]
    assert warp.curves == () and len(warp.points[0]) == len(warp.specimen_of) == 0
    # Log strains at the ends; shear of a 45-degree strip that keeps its area: 2 ln(l_f/l_i).
    assert p.reach.strain == pytest.approx((ENDS["warp"], ENDS["fill"], 2 * ENDS["bias"]))
    assert p.reach.strain == pytest.approx((0.153, 0.232, 0.883), abs=5e-4)


def test_pattern_lists_its_matching_files(small_strips):
    listed, matched = small_strips(), small_strips(('"w1.csv", "w2.csv"', '"w*.csv"'))
    for one, other in zip(listed.strips["warp"].curves, matched.strips["warp"].curves, strict=True):
        assert one.path == other.path and (one.load == other.load).all()
    complaint_with(
        ["strips[0].data.files.warp[0]", "no file"], small_strips, ('"w1.csv", ', '"v*.csv", ')
    )


def test_units_of_the_file_do_not_change_the_strips(example_strips):
    metres = example_strips(
        ("width = 25.0", "width = 25.0e-3"),
        ("grip_distance = 75.0", "grip_distance = 75.0e-3"),
        ("[data]", "[warp]\nfinal_length = 23.0e-3\n[data]"),
        length="m",
    )
    assert (metres.width, metres.grip_distance) == pytest.approx((25, 75))
    # A table picks its direction among those of the file, and replaces its lengths.
    assert list(metres.strips) == ["warp"]
    assert metres.strips["warp"].final_length == pytest.approx(23.0)
    assert metres.strips["warp"].gauge_length == 20.022


def test_strains_of_another_bias_angle_and_of_two_directions(example_strips):
    turned = example_strips(
        ("bias_angle = 45.0", "bias_angle = 30.0"), ("[data]", "[warp]\n[bias]\n[data]")
    )
    shear = 2 * np.sin(np.radians(60)) * ENDS["bias"]
    assert turned.reach.strain == (pytest.approx(ENDS["warp"]), None, pytest.approx(shear))
    assert turned.reach.break_shares[1] is None


# Measured curves


def test_machine_exports_by_direction(small_strips):
    p = small_strips()
    assert list(p.strips) == ["warp", "fill", "bias"]
    # b.csv lists two specimens, one after the other.
    names = {d: [c.specimen for c in s.curves] for d, s in p.strips.items()}
    assert names == {"warp": ["w1", "w2"], "fill": ["f"], "bias": ["b 1", "b 2"]}
    expected = zip(p.strips.values(), (200, 80, 50), (20, 22, 19), strict=True)
    for strip, slope, gauge in expected:
        u, load = strip.points
        np.testing.assert_allclose(load, slope * u, atol=1e-3, err_msg=strip.direction)
        assert (np.diff(u) >= 0).all()
        assert strip.final_length == pytest.approx(gauge + 4)
        assert strip.polynomial.coefficients[:2] == pytest.approx([0, slope], abs=1e-2)
        assert strip.scatter == pytest.approx(0.0, abs=1e-3)
    warp = p.strips["warp"]
    second = warp.points[0][warp.specimen_of == 1]
    np.testing.assert_allclose(second, 0.9 * np.linspace(0, 4, 21), atol=1e-6)
    # What is left out.
    assert (p.width, p.grip_distance, p.bias_angle, p.increments) == (25.0, 75.0, 45.0, 100)
    assert (p.match_by, p.objective) == ("polynomial", "N")
    assert warp.polynomial.order == 4 and warp.through_origin and p.weight == 1.0
    assert p.weights == {"warp": 1.0, "fill": 1.0, "bias": 1.0}
    lower = small_strips(("[data]", "[data]\norder = 2\nthrough_origin = false")).strips["warp"]
    assert lower.polynomial.order == 2 and not lower.through_origin


def test_points_end_where_the_model_ends(small_strips):
    p = small_strips(
        ("gauge_length = 20.0", "gauge_length = 20.0\nfinal_length = 22.5"),
        ("[warp]", 'match = "points"\n[warp]'),
    )
    u, load = p.strips["warp"].points
    assert p.match_by == "points" and u.max() <= 2.5 < u.max() + 0.2
    assert len(u) == len(load) == len(p.strips["warp"].specimen_of)
    assert p.strips["warp"].unmatched_count == 42 - len(u) > 0
    assert len(p.strips["fill"].points[0]) == 21 and p.strips["fill"].unmatched_count == 0


@pytest.mark.parametrize(("order", "has_scatter"), [("", True), ("order = 4\n", False)])
def test_polynomial_leaves_scatter_to_four_points(small_strips, tmp_path, order, has_scatter):
    """One of order 4 goes through four points, as if there were no noise."""
    rows = ["elongation (mm),load (N)", "0.5,110", "1.0,190", "1.5,310", "2.0,390"]
    (tmp_path / "w1.csv").write_text("\n".join(rows) + "\n")
    strip = small_strips(('"w1.csv", "w2.csv"', '"w1.csv"'), ("[data]\n", "[data]\n" + order))
    assert (strip.strips["warp"].scatter > 5.0) == has_scatter


def test_polynomial_is_followed_a_twentieth_beyond_the_points(small_strips, example_strips):
    def gauge(final: float):
        end = ("gauge_length = 20.0", f"gauge_length = 20.0\nfinal_length = {final}")
        return small_strips(end).strips["warp"].final_length

    assert gauge(24.199) == 24.199
    words = ["strips[0].warp.final_length", "elongation of 4 mm", "24 mm", "24.201 mm"]
    complaint_with(words, gauge, 24.201)
    # A published polynomial ends where its own final length is.
    warp = "[warp]\nfinal_length = {}\n[data]"
    assert list(example_strips(("[data]", warp.format(23.49))).strips) == ["warp"]
    assert "the data end" in complaint(example_strips, ("[data]", warp.format(23.50)))


def test_breaks_follow_the_selected_specimens(small_strips, tmp_path):
    """A second specimen of another shape moves the breaks; without it they are the first's."""
    u = np.linspace(0, 4, 41)
    early, late = (HEAD + rows_of(",", u, 200 * np.minimum(u, b) + 20 * u) for b in (0.8, 3.0))
    (tmp_path / "w1.csv").write_text(early)
    (tmp_path / "w2.csv").write_text(late)
    strip = small_strips().strips["warp"]
    first = strip.break_shares(strip.specimen_of == 0)
    (tmp_path / "w2.csv").write_text(early + "\n")
    assert first == pytest.approx(small_strips().strips["warp"].break_shares())
    assert first != pytest.approx(strip.break_shares())


FILES = 'files = { warp = ["w1.csv", "w2.csv"], fill = ["f.TXT"], bias = ["b.csv"] }'


def test_one_file_of_all_directions(small_strips, tmp_path):
    u = np.linspace(0, 4, 9)
    lines = [f"{d},{s},{v},{k * v}" for d, k in (("Warp", 200), ("weft", 80), ("45", 50))
             for s in "AB" for v in u]  # fmt: skip
    (tmp_path / "all.csv").write_text("Direction,Specimen," + HEAD + "\n".join(lines) + "\n")
    p = small_strips((FILES, 'files = ["all.csv"]'))
    for strip in p.strips.values():
        assert [c.specimen for c in strip.curves] == ["A", "B"]
    # By direction the same file gives the rows of that direction.
    both = small_strips(
        (FILES, 'files = { warp = ["all.csv"], fill = ["all.csv"], bias = ["b.csv"] }')
    )
    for direction in ("warp", "fill"):
        np.testing.assert_array_equal(both.strips[direction].points, p.strips[direction].points)
    # A table picks among what the file holds.
    p = small_strips((FILES, 'files = ["all.csv"]'), ("[bias]\ngauge_length = 19.0\n", ""))
    assert list(p.strips) == ["warp", "fill"]


def test_columns_and_units_of_exports(small_strips, tmp_path):
    u = np.linspace(0, 0.4, 9)
    for k, name in enumerate(("f.TXT", "w1.csv", "w2.csv", "b.csv")):
        rows = rows_of(";", u, 0.8 * u, u, comma=True)
        (tmp_path / name).write_text("A;B;C\n" + rows + k * "\n")
    wanted = 'columns = { elongation = "A", load = "B" }\n'
    complaint_with(
        ["w1.csv: line 1, column 'A'", "length_unit"], small_strips, (FILES, f"{wanted}{FILES}")
    )
    units = 'length_unit = "cm"\nload_unit = "kN"\ndecimal = ","\n'
    curve = small_strips((FILES, wanted + units + FILES)).strips["warp"].curves[0]
    np.testing.assert_allclose(curve.elongation, 10 * u)
    np.testing.assert_allclose(curve.load, 800 * u)


def test_extensometer_is_preferred_to_the_crosshead(small_strips, tmp_path):
    """818 MPa on the strip; over the crosshead it would be a third of it."""
    e = np.linspace(0, 0.14, 60)
    load = 818.0 * 25.0 * 0.81 * (np.log1p(e) - 1.2 * np.log1p(e) ** 2)
    stroke = 75.0 * 1.35 * e + 2e-3 * load
    heads = {
        "Standardweg [mm]\tFeindehnung [mm]": 20.0 * e,
        "Standardweg [mm]\tFeindehnung [%]": 1e2 * e,
    }
    for head, gauge in heads.items():
        text = (
            f"Prüfzeit [s]\tStandardkraft [N]\t{head}\n{rows_of(chr(9), e, load, stroke, gauge)}\n"
        )
        (tmp_path / "w1.csv").write_text(text)
        warp = small_strips(('["w1.csv", "w2.csv"]', '["w1.csv"]')).strips["warp"]
        slope = float(warp.polynomial(1e-6) - warp.polynomial(0.0)) / 1e-6
        assert 20.0 * slope / (25.0 * 0.81) == pytest.approx(818.0, rel=0.01)
        assert "not 'Standardweg" in warp.curves[0].notes[0] and not warp.curves[0].between_grips


def test_rows_after_failure_are_cut_where_asked(small_strips, tmp_path):
    u = np.linspace(0, 4, 21)
    (tmp_path / "w1.csv").write_text(HEAD + rows_of(",", u, np.where(u < 3.5, 200.0 * u, 20.0)))
    one = ('["w1.csv", "w2.csv"]', '["w1.csv"]')
    assert len(small_strips(one).strips["warp"].points[0]) == 21
    said = ("[data]", "[data]\nuntil_largest_load = true")
    warp = small_strips(one, said).strips["warp"]
    assert warp.points[0][-1] == pytest.approx(3.4) and warp.final_length == pytest.approx(23.4)
    (file,) = warp.data_files(by_points=False)
    assert (file.used_count, file.dropped) == (18, {"after the largest load": 3})


def test_data_folder(small_strips, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    for name in ("w1.csv", "w2.csv", "f.TXT", "b.csv"):
        (tmp_path / name).rename(other / name)
    missing = [f"{tmp_path / 'w1.csv'}", "--data"]
    said = complaint_with(missing, small_strips)
    assert said.startswith(f"{tmp_path / 'project.toml'}: strips[0].data.files.warp[0]: ")
    assert small_strips(data_folder=other).strips.keys() == LENGTHS.keys()
    assert small_strips(("[data]", '[data]\nfolder = "other"')).strips.keys()


def test_forward_analysis_needs_no_data(example_strips, small_strips, tmp_path):
    for name in ("w1.csv", "curves.csv"):
        (tmp_path / name).unlink()
    # Without lengths there is no model: the data are needed for them.
    assert "there is no file" in complaint(small_strips, need_data=False)
    assert "there is no file" in complaint(example_strips, need_data=False)
    p = small_strips(*ends(4), need_data=False)
    assert [s.final_length for s in p.strips.values()] == [24, 26, 23]
    assert all(s.polynomial is None and s.scatter is None for s in p.strips.values())
    assert p.reach.strain[0] == pytest.approx(np.log(24 / 20))
    assert p.reach.break_shares == (None, None, None)
    assert "there is no file" in complaint(small_strips, *ends(4))


def test_loads_per_width_are_multiplied_by_the_width_of_the_strip(small_strips, tmp_path):
    per_width = (tmp_path / "w1.csv").read_text().replace("mm,kN,sec", "mm,kN/m,sec")
    (tmp_path / "w1.csv").write_text(per_width)
    for width, said in ((25.0, ""), (50.0, "width = 50.0\n")):
        first, _ = (
            small_strips(("[warp]", f"{said}grip_distance = 19.0\n[warp]")).strips["warp"].curves
        )
        np.testing.assert_allclose(first.load, 0.2 * first.elongation * width, rtol=1e-9, atol=1e-9)


# Bad input: the key below strips[0], and what else is named

#: Lines at the top of the section, or of its data.
ADDED = {
    "[warp]\n": [
        ("thikness = 0.81", ".thikness", "unknown key"),
        ("bias_angle = 91", ".bias_angle", "90"),
        ("grip_distance = 18.0", ".bias.gauge_length", "18 mm"),
    ],
    "gauge_length = 22.0": [
        ("final_length = 22.0", ".fill.final_length", "more than the gauge length 22 mm"),
        ("final_length = 27.0", ".fill.final_length", "elongation of 4 mm", "26 mm"),
    ],
    "files": [
        ('polynomials = "c.csv"', ".data", "exactly one"),
        ('length_unit = "yd"', ".data.length_unit", "'cm', 'm', 'in' or '%'"),
        ('load_unit = "N"', "w1.csv: line 4", "'kN'", "load_unit"),
        ('columns = { force = "F" }', ".data.columns.force", "load, lateral, specimen"),
        ('columns = { load = "F" }', "w1.csv", "no column of F in the header row"),
    ],
    "[data]": [
        ("[weights]\nwarp = -1", ".weights.warp", "0"),
        ("[weights]\nwarp = 0\nfill = 0\nbias = 0", ".weights", "nothing would be matched"),
    ],
}
CHANGED = [
    ("gauge_length = 20.0", "", ".warp.gauge_length", "missing"),
    ("[warp]\ngauge_length = 20.0", "", ".warp.gauge_length", "missing"),
    (FILES, "", ".data", "exactly one of 'polynomials' and 'files'"),
    (FILES, 'polynomials = "c.csv"', ".data.polynomials", "there is no file"),
    (FILES, "files = {}", ".data.files", "one direction at least"),
    (FILES, 'files = "w1.csv"', ".data.files", "list", "'w1.csv'"),
    (FILES, 'files = ["w1.csv"]', "w1.csv: line 4", "files = { warp = [...] }"),
    ('warp = ["w1.csv", "w2.csv"]', 'warp = "w1.csv"', "files.warp", "list", "'w1.csv'"),
    ("fill = [", "weft = [", ".data.files.weft", "warp, fill, bias"),
    ('"w2.csv"', '"./w1.csv"', ".data.files.warp[1]", "twice"),
    ('"f.TXT"', '"w1.csv"', ".data.files.fill[0]", "listed for warp too"),
    ('"f.TXT"', '"x.csv"', ".data.files.fill[0]", "there is no file", "--data DIR"),
    ('fill = ["f.TXT"], ', "", ".fill", "no fill test"),
    *((at, f"{line}\n{at}" if at != "gauge_length = 22.0" else f"{at}\n{line}", *words)
      for at, added in ADDED.items() for line, *words in added),
]  # fmt: skip


@pytest.mark.parametrize("row", CHANGED, ids=lambda row: row[1])
def test_bad_input_names_file_and_field(small_strips, tmp_path, row):
    old, new, *words = row
    words = [f"strips[0]{word}" if word.startswith(".") else word for word in words]
    assert complaint_with(words, small_strips, (old, new)).startswith(str(tmp_path))


@pytest.mark.parametrize(
    "text, words",
    [
        (HEAD + "1,2\n2,x\n", ["f.TXT: line 3, column 'Load (N)'"]),
        (HEAD + "1,2\n2,3\n", ["strips[0].data, order 4", "fill", "2"]),
        (HEAD + "-1,2\n-2,3\n", ["strips[0].data, elongation", "fill"]),
        (HEAD + "1,0\n2,0\n", ["strips[0].data, load", "all 2 loads are 0 N"]),
        (HEAD + "0,1\n1,-9\n2,-19\n", ["strips[0].data: ", "from 1 to -19 N", "their sign"]),
        ("Direction," + HEAD + "warp,1,2\n", ["f.TXT: column 'Dir", "no fill"]),
        ("", ["f.TXT: no header row"]),
    ],
)
def test_bad_data_names_the_file_or_the_project(small_strips, tmp_path, text, words):
    (tmp_path / "f.TXT").write_text(text)
    complaint_with(words, small_strips)


def test_points_are_needed_where_they_are_to_be_matched(small_strips, example_strips, tmp_path):
    points = ('match = "polynomial"', 'match = "points"')
    complaint_with(["strips[0].match", "data.files"], example_strips, points)
    # The first points lie beyond the end of the model.
    (tmp_path / "f.TXT").write_text(HEAD + rows_of(",", np.arange(1.0, 9.0), np.arange(8.0)))
    short = ("gauge_length = 22.0", "gauge_length = 22.0\nfinal_length = 22.5")
    words = ["project.toml: strips[0].fill.final_length", "no measured"]
    complaint_with(words, small_strips, short, ("[warp]\n", 'match = "points"\n[warp]\n'))


FAN = """
width = 2.5
side_by_side = 10
gauge_length = 20.0
[data]
directions = { 0 = "fan*.csv", 30 = ["fan.csv"], 75 = "fan.csv" }
"""


def fan_of_strips(folder, *changes, angles=(0, 30, 60, 75)):
    rows = [f"{angle},{u},{(90 - angle) * u}" for angle in angles for u in range(7)]
    (folder / "fan.csv").write_text(
        "\n".join(["direction_deg,elongation (mm),force (kN/m)", *rows])
    )
    return read_strips(project_file(folder, FAN, *changes))


def test_angles_of_one_file_are_strips_of_one_section(tmp_path):
    test = fan_of_strips(tmp_path)
    assert list(test.strips) == ["warp", "30 degrees", "75 degrees"]  # not 60, which is not listed
    assert {strip.gauge_length for strip in test.strips.values()} == {20.0}
    assert test.total_width == 25.0
    steep = test.strips["75 degrees"].curves[0]
    np.testing.assert_allclose(steep.load, 15 * 25.0 * steep.elongation)  # per width of all
    shear = 2 * np.sin(np.radians(60)) * np.log(26 / 20)  # the largest is that at 30 degrees
    assert test.reach.strain == pytest.approx((np.log(26 / 20), None, shear))
    final = fan_of_strips(
        tmp_path, ("[data]", "[warp]\nfinal_length = 24\n[bias]\ngauge_length = 19\n[data]")
    )
    lengths = {d: (s.gauge_length, s.final_length) for d, s in final.strips.items()}
    assert lengths["warp"] == (20, 24) and lengths["75 degrees"] == (19, 25)
    weighted = fan_of_strips(tmp_path, ("[data]", "[weights]\nbias = 0\n[data]"))
    assert list(weighted.matched) == ["warp"]


def test_wrong_angles_name_the_key(tmp_path):
    complaint_with(
        ["strips[0].data.directions", "'105 deg'"], fan_of_strips, tmp_path, ("75 =", "105 =")
    )
    complaint_with(["fan.csv", "no bias", "75 degrees"], fan_of_strips, tmp_path, ("75 =", "45 ="))
    twice = ("75 =", '"30.0" =')
    complaint_with(["data.directions.30.0", "30 degrees", "twice"], fan_of_strips, tmp_path, twice)
    listed = ("gauge_length = 20.0", ""), ("[data]", "[warp]\ngauge_length = 20\n[data]")
    complaint_with(["strips[0].bias.gauge_length", "missing"], fan_of_strips, tmp_path, *listed)


@pytest.mark.parametrize(("angle", "strain"), [(0, (True, False)), (90, (False, True))])
def test_strips_in_grips_may_be_pulled_along_a_yarn(example_strips, angle, strain):
    test = example_strips(
        ("bias_angle = 45.0", f"bias_angle = {angle}"), ("[data]", "[bias]\n[data]")
    )
    warp, fill, shear = test.reach.strain
    assert (warp is not None, fill is not None, shear) == (*strain, None)
    assert (warp or fill) == pytest.approx(ENDS["bias"])
    model = test.models()["bias"]
    assert np.abs(model.warp) == pytest.approx([angle / 90, 1 - angle / 90, 0], abs=1e-9)


def test_gauge_of_an_angle_is_that_of_bias_then_of_all_strips():
    section = StripsSection.model_validate(
        {
            "gauge_length": 20.0,
            "final_length": 23.0,
            "bias": {"final_length": 25.0},
            "data": {"directions": {"0": "w*.csv", "15": ["a.csv", "b.csv"]}},
        }
    )
    lengths = {
        direction: (section.gauge(direction).gauge_length, section.gauge(direction).final_length)
        for direction in ("warp", "bias", "15 degrees")
    }
    assert lengths == {"warp": (20, 23), "bias": (20, 25), "15 degrees": (20, 25)}
    assert section.data.directions == {"0": ["w*.csv"], "15": ["a.csv", "b.csv"]}
