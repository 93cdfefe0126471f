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


def test_numbers_may_stand_in_the_project(tmp_path):
    keys = "[bubble.data.heights.values]\npressure = [10, 40, 120, 250]\n"
    test = bubble_of(tmp_path, HEIGHTS + keys + "height = [9.6, 15.3, 22.4, 29.1]\n")
    np.testing.assert_allclose(test.data.series[0].pressure, KILO / 1e3)
    assert not test.data.files


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
        assert test.data.files[0].used == 10
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


def test_forward_analysis_needs_no_table_but_pressures(tmp_path):
    text = HEIGHTS + 'files = ["none.csv"]\n'
    with pytest.raises(InputError, match="pressures"):
        bubble_of(tmp_path, text, need_data=False)
    text = text.replace("radius", "pressures = [10, 20]\nradius")
    assert bubble_of(tmp_path, text, need_data=False).pressures == (0.01, 0.02)
