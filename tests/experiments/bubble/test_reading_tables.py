import numpy as np
import openpyxl
import pytest
from bubblefit.errors import InputError
from bubblefit.project.project import read_project

PROJECT = """
[fabric]
thickness = 0.8
[law]
form = "constant"
[law.bounds]
E1 = [0.02, 3.0]
E2 = [0.02, 3.0]
G12 = [0.001, 0.3]
[[bubble]]
radius = 100.0
elements = 48
symmetry = "quarter"
"""
HEIGHTS = PROJECT + "[bubble.data.heights]\n"
RISE = np.array([9.6, 15.3, 22.4, 29.1])
KILO = np.array([10.0, 40.0, 120.0, 250.0])


def bubble_of(folder, text, need_data=True):
    (folder / "project.toml").write_text(text)
    (test,) = read_project(folder / "project.toml", need_data=need_data).tests.values()
    return test


def refusal(folder, text):
    with pytest.raises(InputError) as caught:
        bubble_of(folder, text)
    return str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("h.csv", "pressure (kPa),height (mm)\n10,9.6\n40,15.3\n120,22.4\n250,29.1\n"),
        ("h.txt", "Druck [bar];Höhe [cm]\n0,1;0,96\n0,4;1,53\n1,2;2,24\n2,5;2,91\n"),
        (
            "h.dat",
            "Gauge in lab 3\nP (mbar)\tapex (mm)\n100\t9.6\n400\t15.3\n1200\t22.4\n2500\t29.1\n",
        ),
    ],
)
def test_table_of_any_machine_text_and_unit(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    test = bubble_of(tmp_path, HEIGHTS + f'files = ["{name}"]\n')
    (series,) = test.data.series
    np.testing.assert_allclose(series.pressure, KILO / 1e3)
    np.testing.assert_allclose(series.value, RISE)
    np.testing.assert_allclose(test.pressures, KILO / 1e3)
    assert not series.positions.any()


def test_workbook_with_two_gauges_and_two_specimens(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["specimen", "p", "gauge 1", "gauge 2"])
    for specimen in ("A", "B"):
        for p, h in zip(KILO, RISE, strict=True):
            book.active.append([specimen, p, h, 0.75 * h])
    book.save(tmp_path / "h.xlsx")
    keys = 'files = ["h.xlsx"]\nplaces = [[0, 0], [50, 0]]\n'
    keys += 'pressure_unit = "kPa"\nlength_unit = "mm"\n'
    apex, half = bubble_of(tmp_path, HEIGHTS + keys).data.series
    assert apex.specimens.tolist() == [0] * 4 + [1] * 4
    np.testing.assert_allclose(half.value, 0.75 * apex.value)
    assert half.positions[0].tolist() == [50.0, 0.0]


def test_pressures_below_zero_are_named(tmp_path):
    (tmp_path / "h.csv").write_text("p (kPa),h (mm)\n-10,9.6\n-40,15.3\n")
    said = refusal(tmp_path, HEIGHTS + 'files = ["h.csv"]\n')
    assert "bubble[0].data: no reading is at a pressure above zero" in said


def test_decimal_mark_is_that_of_all_gauges(tmp_path):
    rows = "".join(f"{p:g};{h:.0f};{0.75 * h:.2f}\n" for p, h in zip(KILO, RISE, strict=True))
    (tmp_path / "h.csv").write_text("p [kPa];h [mm];x 50 [mm]\n" + rows.replace(".", ","))
    keys = 'files = ["h.csv"]\nplaces = [[0, 0], [50, 0]]\n'
    keys += 'columns = { height = ["h [mm]", "x 50 [mm]"] }\n'
    _, half = bubble_of(tmp_path, HEIGHTS + keys).data.series
    np.testing.assert_allclose(half.value, 0.75 * RISE, atol=0.006)


def test_specimen_named_in_its_first_row_only_is_refused(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["specimen", "pressure (kPa)", "height (mm)"])
    for specimen in ("A", "B"):
        for p, h in zip(KILO, RISE, strict=True):
            book.active.append([specimen if p == KILO[0] else None, p, h])
    book.save(tmp_path / "h.xlsx")
    words = "line 3, column 'specimen': expected the specimen's name, found nothing"
    assert words in refusal(tmp_path, HEIGHTS + 'files = ["h.xlsx"]\n')


def test_column_of_words_on_the_line_is_no_reading(tmp_path):
    rows = [f"dome {p:g},{p},{h}" for p, h in zip(KILO, RISE, strict=True)]
    for heading in ("Line", "Axis", "Achse"):
        (tmp_path / "h.csv").write_text(f"{heading},p (kPa),z (mm)\n" + "\n".join(rows))
        (series,) = bubble_of(tmp_path, HEIGHTS + 'files = ["h.csv"]\n').data.series
        np.testing.assert_allclose(series.value, RISE)
    (tmp_path / "h.csv").write_text("Line,p (kPa),e (%)\n" + "\n".join(rows))
    keys = 'files = ["h.csv"]\ncolumns = { strain_warp = "e (%)" }\n'
    (strain,) = bubble_of(tmp_path, PROJECT + "[bubble.data.apex]\n" + keys).data.series
    np.testing.assert_allclose(strain.value, RISE / 100)


def test_numbers_may_stand_in_the_project(tmp_path):
    keys = "[bubble.data.heights.values]\npressure = [10, 40, 120, 250]\n"
    test = bubble_of(tmp_path, HEIGHTS + keys + "height = [9.6, 15.3, 22.4, 29.1]\n")
    np.testing.assert_allclose(test.data.series[0].pressure, KILO / 1e3)
    assert not test.data.files


def test_gauges_at_one_place_have_labels_of_their_own(tmp_path):
    values = "values = { pressure = [10, 40], height = [[9.6, 15.3], [9.7, 15.2], [7.0, 11.0]] }"
    test = bubble_of(tmp_path, f"{HEIGHTS}places = [[0, 0], [0, 0], [50, 0]]\n{values}\n")
    labels = [series.label for series in test.data.series]
    assert labels == ["height 1 at (0, 0) mm", "height 2 at (0, 0) mm", "height at (50, 0) mm"]


def test_only_one_inflation_of_cycles_is_used(tmp_path):
    first = np.linspace(0, 200, 11)
    pressure = np.concatenate([first, first[::-1], first, first[::-1]])
    height = np.cbrt(pressure) * np.repeat([4.0, 4.3, 4.2, 4.4], 11)
    rows = "\n".join(f"{p},{h}" for p, h in zip(pressure, height, strict=True))
    (tmp_path / "h.csv").write_text(f"pressure (kPa),height (mm)\n{rows}\n")
    keys = 'files = ["h.csv"]\n'
    for inflation, factor in ((1, 4.0), (2, 4.2)):
        text = HEIGHTS.replace("radius", f"inflation = {inflation}\nradius") + keys
        test = bubble_of(tmp_path, text)
        (series,) = test.data.series
        np.testing.assert_allclose(series.value, factor * np.cbrt(first[1:]))
    assert test.state == "conditioned"
    text = HEIGHTS.replace("radius", "inflation = 3\nradius") + keys
    assert "expected at most 2" in refusal(tmp_path, text)


def test_many_readings_are_averaged(tmp_path):
    pressure = np.linspace(1, 200, 5000)
    rows = "\n".join(f"{p},{4 * np.cbrt(p)}" for p in pressure)
    (tmp_path / "h.csv").write_text(f"pressure (kPa),height (mm)\n{rows}\n")
    (series,) = bubble_of(tmp_path, HEIGHTS + 'files = ["h.csv"]\n').data.series
    assert len(series.value) == 200
    np.testing.assert_allclose(series.value, 4 * np.cbrt(1e3 * series.pressure), rtol=2e-3)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("", "data.heights.files"),
        ('files = ["none.csv"]', "none.csv"),
        ('files = ["h.csv"]\nplaces = [[0, 0], [50, 0]]', "a column of heights for each of 2"),
        ('files = ["h.csv"]\nplaces = [[120, 0]]', "expected places within"),
        ('files = ["bare.csv"]\nlength_unit = "mm"', "say pressure_unit"),
        ('files = ["h.csv"]\n[bubble.nuisance]\ntilt = 1.0', "nuisance.tilt: needs fields"),
        ('files = ["h.csv"]\n[bubble.nuisance]\nshift = 1.0', "nuisance.shift: needs fields"),
        ('files = ["h.csv"]\n[bubble.nuisance]\nturn = 5.0', "nuisance.turn: needs fields"),
        ('files = ["h.csv"]\n[bubble.sheet]\nconstant_field = ["dz"]', "sheet.constant_field"),
        ('files = ["h.csv"]\n[bubble.data.points]\nfiles = ["x.csv"]', "expected exactly one of"),
    ],
)
def test_what_is_wrong_is_said_with_its_key(tmp_path, keys, words):
    (tmp_path / "h.csv").write_text("pressure (kPa),height (mm)\n10,9.6\n40,15.3\n")
    (tmp_path / "bare.csv").write_text("p,h\n10,9.6\n40,15.3\n")
    assert words in refusal(tmp_path, HEIGHTS + keys + "\n")


def test_offset_of_gauges_needs_gauges(tmp_path):
    text = PROJECT + "pressures = [10]\n[bubble.nuisance]\nheight_offset = 0.1\n"
    text += "[bubble.data.known_solution]\nbeta = [0, 0, 0, 0.08, 0, 0, 0, 0.4, 0, 0, 0, 0.8]\n"
    assert "there is no [bubble.data.heights]" in refusal(tmp_path, text)


@pytest.mark.parametrize("key", ["height_offset", "height_scale"])
def test_unknowns_of_heights_need_heights_or_profiles(tmp_path, key):
    apex = "[bubble.data.apex.values]\npressure = [10, 40]\ncurvature_warp = [1e-3, 2e-3]\n"
    text = PROJECT + apex + f"[bubble.nuisance]\n{key} = 0.1\n"
    assert f"nuisance.{key}: is of gauges" in refusal(tmp_path, text)
    profiles = "pressure = [10, 10, 10]\ncoordinate = [-50, 0, 50]\nheight = [7, 9, 7]\n"
    assert bubble_of(tmp_path, f"{text}[bubble.data.profiles.values]\n{profiles}").data.series


def test_typed_heights_of_unequal_length_are_refused(tmp_path):
    values = "places = [[0, 0], [50, 0]]\nvalues = { pressure = [10, 40], height = [[1, 2], [1]] }"
    words = "data.heights.values: expected lists of equal length: pressure, height 1, height 2"
    assert words in refusal(tmp_path, f"{HEIGHTS}{values}\n")


def test_forward_analysis_needs_no_table_but_pressures(tmp_path):
    text = HEIGHTS + 'files = ["none.csv"]\n'
    with pytest.raises(InputError, match="pressures"):
        bubble_of(tmp_path, text, need_data=False)
    text = text.replace("radius", "pressures = [10, 20]\nradius")
    assert bubble_of(tmp_path, text, need_data=False).pressures == (0.01, 0.02)


def test_profiles_of_several_lines_and_pressures_in_one_table(tmp_path):
    rows = [
        f"{axis},{p},{s},{h * (1 - (s / 100) ** 2)}"
        for axis in ("x", "Schuss", "30")
        for p, h in zip(KILO, RISE, strict=True)
        for s in range(-90, 91, 3)
    ]
    (tmp_path / "p.csv").write_text("axis,p_kPa,coord_mm,z_mm\n" + "\n".join(rows))
    test = bubble_of(tmp_path, PROJECT + '[bubble.data.profiles]\nfiles = ["p.csv"]\n')
    x, y, inclined = test.data.series
    assert [s.label for s in test.data.series] == [
        f"heights along {a}" for a in ("x", "Schuss", "30")
    ]
    assert len(x.value) == 4 * 40 and not x.positions[:, 1].any()
    np.testing.assert_allclose(y.positions[:, 1], x.positions[:, 0], atol=1e-9)
    np.testing.assert_allclose(np.hypot(*inclined.positions.T), np.abs(x.positions[:, 0]))
    np.testing.assert_allclose(test.pressures, KILO / 1e3)


def test_profiles_of_a_file_a_pressure_take_the_listed_pressures(tmp_path):
    for k, h in enumerate((10.0, 15.0)):
        lines = "\n".join(f"{s},{h * (1 - (s / 100) ** 2)}" for s in range(-90, 91, 10))
        (tmp_path / f"p{k}.csv").write_text(f"s (mm),dz (mm)\n{lines}\n")
    keys = '[bubble.data.profiles]\nfiles = ["p0.csv", "p1.csv"]\ndirection_deg = 90\n'
    text = PROJECT.replace("radius", "pressures = [10, 40]\nradius") + keys
    (series,) = bubble_of(tmp_path, text).data.series
    np.testing.assert_allclose(np.unique(series.pressure), [0.01, 0.04])
    assert not series.positions[:, 0].round(9).any()
    assert "expected one for each of 2" in refusal(tmp_path, PROJECT + keys)
    # Files of the other line, between them or behind them, are at the same pressures.
    for name in ("p0", "p1"):
        text_of_fill = (tmp_path / f"{name}.csv").read_text().replace("s (mm)", "y (mm)")
        (tmp_path / f"{name}_fill.csv").write_text(text_of_fill)
    for files in ("p0 p0_fill p1 p1_fill", "p0 p1 p0_fill p1_fill"):
        names = ", ".join(f'"{name}.csv"' for name in files.split())
        text = PROJECT.replace("radius", "pressures = [10, 40]\nradius")
        text += f"[bubble.data.profiles]\nfiles = [{names}]\n"
        for along, across in zip(bubble_of(tmp_path, text).data.series, (1, 0), strict=True):
            assert not along.positions[:, across].round(9).any()
            heights = [along.value[along.pressure == p].max() for p in (0.01, 0.04)]
            np.testing.assert_allclose(heights, [10.0, 15.0])
    assert "one for each of 1" in refusal(tmp_path, text.replace('"p0.csv", ', ""))


def test_profiles_of_named_specimens_are_kept_apart(tmp_path):
    rows = {
        name: [f"{name},10,{s},{h * (1 - (s / 100) ** 2)}" for s in range(-90, 91, 3)]
        for name, h in (("S1", 10.0), ("S2", 11.0))
    }
    heading = "Specimen,p (kPa),s (mm),dz (mm)\n"
    (tmp_path / "p.csv").write_text(heading + "\n".join(rows["S1"] + rows["S2"]))
    keys = '[bubble.data.profiles]\nfiles = ["p.csv"]\n'
    (series,) = bubble_of(tmp_path, PROJECT + keys).data.series
    assert series.specimens.tolist() == [0] * 40 + [1] * 40
    apex = [series.value[series.specimens == number].max() for number in (0, 1)]
    np.testing.assert_allclose(apex, [10.0, 11.0], rtol=1e-3)
    for name, lines in rows.items():
        (tmp_path / f"{name}.csv").write_text(heading + "\n".join(lines))
    files = keys.replace('"p.csv"', '"S1.csv", "S2.csv"')
    (of_files,) = bubble_of(tmp_path, PROJECT + files).data.series
    assert of_files.specimens.tolist() == series.specimens.tolist()


def test_specimens_of_profiles_along_both_axes_are_kept_apart(tmp_path):
    rows = [
        f"{name},{axis},10,{s},{h * (1 - (s / 100) ** 2)}"
        for axis in ("x", "y")
        for name, h in (("S1", 10.0), ("S2", 11.0))
        for s in range(-90, 91, 3)
    ]
    heading = "Specimen,axis,p (kPa),s (mm),dz (mm)\n"
    (tmp_path / "p.csv").write_text(heading + "\n".join(rows))
    test = bubble_of(tmp_path, f'{PROJECT}[bubble.data.profiles]\nfiles = ["p.csv"]\n')
    assert [s.label for s in test.data.series] == ["heights along x", "heights along y"]
    for series in test.data.series:
        assert series.specimens.tolist() == [0] * 40 + [1] * 40


@pytest.mark.parametrize(
    ("keys", "column", "factor"),
    [
        ('curvature_unit = "1/m"', "k", -1e3),
        ('curvature_unit = "1/mm"\ncurvature_is = "half"', "k", 0.5),
        ('curvature_unit = "mm"\ncurvature_is = "radius"', "k", None),
    ],
)
def test_curvature_of_the_apex_of_any_sign_half_of_it_or_the_radius(tmp_path, keys, column, factor):
    curvature = 2e-4 * RISE
    values = 1 / curvature if factor is None else factor * curvature
    rows = "\n".join(f"{p},{v},{e}" for p, v, e in zip(KILO, values, 0.01 * RISE, strict=True))
    (tmp_path / "a.csv").write_text(f"p (kPa),{column},e (%)\n{rows}\n")
    text = PROJECT + f'[bubble.data.apex]\nfiles = ["a.csv"]\n{keys}\nstrain_is = "logarithmic"\n'
    columns = f'columns = {{ curvature_warp = "{column}", strain_fill = "e (%)" }}\n'
    bent, strained = bubble_of(tmp_path, text + columns).data.series
    np.testing.assert_allclose(bent.value, curvature)
    np.testing.assert_allclose(strained.value, np.expm1(1e-4 * RISE))
    assert (bent.direction, strained.direction[1], bent.span) == ((1.0, 0.0), 1.0, 20.0)


@pytest.mark.parametrize(
    ("kind", "quantity", "unit"),
    [
        ("apex", "curvature_warp", 'curvature_unit = "1/m"'),
        ("apex", "strain_fill", 'strain_unit = "%"'),
        ("heights", "height", 'length_unit = "cm"'),
        ("heights", "height", 'pressure_unit = "bar"'),
    ],
)
def test_unit_beside_values_of_the_project_is_refused(tmp_path, kind, quantity, unit):
    values = f"values = {{ pressure = [10, 40], {quantity} = [1.0, 2.0] }}\n"
    text = f"{PROJECT}[bubble.data.{kind}]\n{values}"
    assert len(bubble_of(tmp_path, text).data.series[0].value) == 2
    said = refusal(tmp_path, text + unit + "\n")
    assert f"data.{kind}.{unit.split()[0]}: is of files" in said


def test_modes_of_the_sheet_are_refused_beside_readings_of_the_apex(tmp_path):
    values = "values = { pressure = [10, 40], curvature_warp = [1e-3, 2e-3] }\n"
    text = f"{PROJECT}[bubble.data.apex]\n{values}[bubble.sheet]\nmodes = 2\n"
    assert "sheet.modes: cannot be told from readings of the apex" in refusal(tmp_path, text)


@pytest.mark.parametrize(
    ("heading", "cells", "column"),
    [
        ("p (kPa),s (mm),dz (mm)", "10,", "pressure"),
        ("axis,s (mm),dz (mm)", "x,", "axis"),
        ("specimen,s (mm),dz (mm)", "A,", "specimen"),
    ],
)
def test_column_that_only_some_profiles_have_is_refused(tmp_path, heading, cells, column):
    places = range(-90, 91, 10)
    bare = "s (mm),dz (mm)\n" + "\n".join(f"{s},{9 - s * s / 900}" for s in places)
    (tmp_path / "bare.csv").write_text(bare)
    rows = "\n".join(f"{cells}{s},{9 - s * s / 900}" for s in places)
    (tmp_path / "full.csv").write_text(f"{heading}\n{rows}\n")
    for files in (["full.csv", "bare.csv"], ["bare.csv", "full.csv"]):
        text = PROJECT.replace("radius", "pressures = [10, 40]\nradius")
        text += f"[bubble.data.profiles]\nfiles = {files}\n"
        assert f"a column of the {column} in all tables" in refusal(tmp_path, text)


def test_direction_of_a_line_that_is_no_angle_is_refused(tmp_path):
    rows = "\n".join(f"diagonal,10,{s},{9 - s * s / 900}" for s in range(-90, 91, 10))
    (tmp_path / "p.csv").write_text(f"axis,p (kPa),s (mm),dz (mm)\n{rows}\n")
    text = PROJECT + '[bubble.data.profiles]\nfiles = ["p.csv"]\n'
    assert "expected x, y or degrees from the warp" in refusal(tmp_path, text)


PROFILES = PROJECT + "[bubble.data.profiles]\n"


def test_line_whose_coordinate_is_y_is_along_the_fill(tmp_path):
    for axis in "xy":
        rows = "10;0;9.6\n10;50;7\n20;0;12\n20;50;9\n"
        (tmp_path / f"{axis}.csv").write_text(f"pressure (kPa);{axis} (mm);z (mm)\n{rows}")
    (series,) = bubble_of(tmp_path, PROFILES + 'files = ["y.csv"]\n').data.series
    np.testing.assert_allclose(series.positions, [[0, 0], [0, 50]] * 2, atol=1e-9)
    both = PROFILES + 'files = ["x.csv", "y.csv"]\n'
    along_x, along_y = bubble_of(tmp_path, both).data.series
    np.testing.assert_allclose(along_x.positions, [[0, 0], [50, 0]] * 2, atol=1e-9)
    np.testing.assert_allclose(along_y.positions, series.positions)
    for degrees, place in ((0, [50, 0]), (90, [0, 50])):
        (series,) = bubble_of(tmp_path, f"{both}direction_deg = {degrees}\n").data.series
        assert len(series.value) == 8
        np.testing.assert_allclose(series.positions, [[0, 0], place] * 4, atol=1e-9)


CYCLES = (10, 20, 10, 2, 12, 20)


@pytest.mark.parametrize("is_by_place", [False, True])
def test_only_one_inflation_of_profiles_is_used(tmp_path, is_by_place):
    order = [(k, p, s) for k, p in enumerate(CYCLES) for s in (0, 50)]
    if is_by_place:
        order.sort(key=lambda row: (row[2], row[0]))
    rows = "\n".join(f"{p};{s};{1 + k}" for k, p, s in order)
    (tmp_path / "p.csv").write_text(f"pressure (kPa);x (mm);z (mm)\n{rows}\n")
    for inflation, heights in ((1, {0.01: 1, 0.02: 2}), (2, {0.012: 5, 0.02: 6})):
        text = PROFILES.replace("radius", f"inflation = {inflation}\nradius")
        (series,) = bubble_of(tmp_path, text + 'files = ["p.csv"]\n').data.series
        assert len(series.value) == 4
        assert dict(zip(series.pressure, series.value, strict=True)) == heights
    text = text.replace("inflation = 2", "inflation = 9") + 'files = ["p.csv"]\n'
    assert "inflation: expected at most 2" in refusal(tmp_path, text)


def test_profiles_of_a_pressure_each_are_inflations_in_the_order_of_their_files(tmp_path):
    for k, p in enumerate(CYCLES):
        rows = f"{p};0;{1 + k}\n{p};50;{1 + k}\n"
        (tmp_path / f"p{k}.csv").write_text(f"pressure (kPa);x (mm);z (mm)\n{rows}")
    text = PROFILES.replace("radius", "inflation = 2\nradius") + 'files = ["p*.csv"]\n'
    (series,) = bubble_of(tmp_path, text).data.series
    np.testing.assert_allclose(series.value, [5, 5, 6, 6])


def test_profiles_of_one_specimen_in_two_tables_are_used_together(tmp_path):
    for name in ("a", "b"):
        rows = "\n".join(f"{p};{s};{p - s / 10}" for p in (10, 20, 40) for s in (0, 50))
        (tmp_path / f"{name}.csv").write_text(f"pressure (kPa);x (mm);z (mm)\n{rows}\n")
    (series,) = bubble_of(tmp_path, PROFILES + 'files = ["a.csv", "b.csv"]\n').data.series
    assert len(series.value) == 12


def test_profile_whose_pressure_scatters_is_used_whole(tmp_path):
    random = np.random.default_rng(1)
    rows = "\n".join(f"{p:.4f};{s};9" for s, p in enumerate(random.normal(10, 0.02, 30)))
    (tmp_path / "p.csv").write_text(f"pressure (kPa);x (mm);z (mm)\n{rows}\n")
    (series,) = bubble_of(tmp_path, PROFILES + 'files = ["p.csv"]\n').data.series
    assert len(series.value) == 30


@pytest.mark.parametrize(
    ("heading", "keys", "unit"),
    [
        ("Rx (mm)", "", "mm is no unit of curvature_is = 'curvature'"),
        ("a (m)", 'curvature_is = "half"', "m is no unit of curvature_is = 'half'"),
        ("Rx (1/m)", 'curvature_is = "radius"', "1/m is no unit of curvature_is = 'radius'"),
        ("Rx", 'curvature_unit = "mm"', "mm is no unit of curvature_is = 'curvature'"),
        (
            "Rx",
            'curvature_unit = "1/cm"\ncurvature_is = "radius"',
            "1/cm is no unit of curvature_is = 'radius'",
        ),
    ],
)
def test_unit_of_a_curvature_must_go_with_what_it_is(tmp_path, heading, keys, unit):
    (tmp_path / "a.csv").write_text(f"p (kPa);{heading}\n10;500\n20;400\n40;300\n")
    text = f'{PROJECT}[bubble.data.apex]\nfiles = ["a.csv"]\n{keys}\n'
    words = refusal(tmp_path, f'{text}columns = {{ curvature_warp = "{heading}" }}\n')
    assert f"column '{heading}': {unit}" in words


GAUGES = HEIGHTS + 'files = ["h.csv"]\nplaces = [[0, 0], [50, 0]]\n'


def test_columns_of_gauges_may_be_named_without_their_units(tmp_path):
    (tmp_path / "h.csv").write_text("p (kPa);h1 (mm);h2 (mm)\n10;9.6;7.3\n20;12;9.2\n")
    for names in ('["h2", "h1"]', '["h2 (mm)", " h1 "]'):
        away, apex = bubble_of(tmp_path, GAUGES + f"columns = {{ height = {names} }}\n").data.series
        assert (away.value.tolist(), apex.value.tolist()) == ([7.3, 9.2], [9.6, 12])
    one = GAUGES.replace(", [50, 0]", "") + 'columns = { height = "h2" }\n'
    (series,) = bubble_of(tmp_path, one).data.series
    assert series.value.tolist() == [7.3, 9.2]


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ('["h1", "h9 (mm)"]', "column 'h9 (mm)': is missing; the file has: p (kPa), h1 (mm)"),
        ('["h1 (mm)", "h1 (mm)"]', "column 'h1 (mm)': is named by columns.height for two places"),
        ('["h1", "h1 (mm)"]', "column 'h1 (mm)': is named by columns.height for two places"),
        ('["h1", "h2"]', "column 'h2': appears twice"),
    ],
)
def test_columns_of_gauges_that_are_not_one_each_are_refused(tmp_path, names, words):
    (tmp_path / "h.csv").write_text("p (kPa);h1 (mm);h2 (mm);h2 (cm)\n10;9;7;7\n20;12;9;9\n")
    assert words in refusal(tmp_path, GAUGES + f"columns = {{ height = {names} }}\n")


def test_reading_that_one_gauge_lacks_is_left_out_alone(tmp_path):
    rows = [f"{p},{h},{0.75 * h}" for p, h in zip(KILO, RISE, strict=True)]
    for hole in ("", "n/a", "-", "#N/A", "#NV"):
        text = "\n".join([*rows[:2], f"{KILO[2]},{RISE[2]},{hole}", *rows[3:]])
        (tmp_path / "h.csv").write_text(f"p (kPa),apex (mm),warp 50 (mm)\n{text}\n")
        keys = 'files = ["h.csv"]\nplaces = [[0, 0], [50, 0]]\n'
        data = bubble_of(tmp_path, HEIGHTS + keys).data
        apex, half = data.series
        np.testing.assert_allclose(apex.value, RISE)
        np.testing.assert_allclose(half.value, 0.75 * np.delete(RISE, 2))
        assert "1 of 4 readings of 'warp 50 (mm)' missing" in data.files[0].source.notes
    (tmp_path / "h.csv").write_text(f"p (kPa),apex (mm),warp 50 (mm)\n{text}\n,11.0,9.0\n")
    assert "column 'p (kPa)': expected a number" in refusal(tmp_path, HEIGHTS + keys)
    (tmp_path / "h.csv").write_text("p (kPa),apex (mm),warp 50 (mm)\n10,9.6,\n40,15.3,n/a\n")
    assert "column 'warp 50 (mm)': holds no number" in refusal(tmp_path, HEIGHTS + keys)
