"""Values that files tell: units, columns, names, flags; each at its limit, each complaint whole."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.bending import read_bending_curves
from bubblefit.readers.clock_offset import find_offset
from bubblefit.readers.curves import LoadCurve, split_at_restarts
from bubblefit.readers.fields import DisplacementField, fit_surface
from bubblefit.readers.formats import text_exports
from bubblefit.readers.frame_choice import REPEATED, choose_frames
from bubblefit.readers.frames import Frame, FrameOptions, read_frames
from bubblefit.readers.machine_tables import Channel, in_unit
from bubblefit.readers.numbers_in_names import check_pattern, number_in_name, picture_numbers
from bubblefit.readers.pressure_log import apex_height, read_pressure_log
from bubblefit.readers.quantities import means, nearest_to_strip
from bubblefit.readers.units import (
    LENGTH_UNITS,
    LOAD_UNITS,
    PRESSURE_UNITS,
    TIME_UNITS,
    WIDTH_LOAD_UNITS,
    scale_of,
    split_unit,
)
from bubblefit.readers.values_in_files import values_in_file

from ..support.refusals import complaint, complaint_with


def test_units_of_columns_are_those_of_si():
    pascal = {
        "Pa": 1, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3, "psi": 0.45359237 * 9.80665 / 0.0254**2,
        "bar": 1e5, "MPa": 1e6,
    }  # fmt: skip
    assert {k: 1e6 * v for k, v in PRESSURE_UNITS.items()} == pytest.approx(pascal)
    lengths = {"mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4, "ft": 304.8, "um": 1e-3, "mil": 0.0254}
    assert pytest.approx(lengths | dict.fromkeys(("\u00b5m", "\u03bcm"), 1e-3)) == LENGTH_UNITS
    pond, pound = 9.80665e-3, 0.45359237 * 9.80665
    loads = {"N": 1.0, "kN": 1e3, "daN": 10.0, "mN": 1e-3, "gf": pond, "lbf": pound}
    loads |= {"kip": 1e3 * pound, "ozf": pound / 16}
    assert pytest.approx(loads | {"kgf": 1e3 * pond, "kp": 1e3 * pond}) == LOAD_UNITS
    per_metre = {"kN/m": 1e3, "N/mm": 1e3, "N/m": 1.0, "N/cm": 1e2, "N/50mm": 20.0}
    per_metre |= {"N/5cm": 20.0, "daN/5cm": 200.0, "lbf/in": pound / 0.0254}
    found = {k: 1e3 * v for k, v in WIDTH_LOAD_UNITS.items()}
    assert found == pytest.approx(per_metre)
    assert TIME_UNITS == {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
    for unit, newton in {"n": 1.0, "kn": 1e3, "KN": 1e3, "N": 1.0, "MN": None}.items():
        assert scale_of(unit, LOAD_UNITS) == newton


@pytest.mark.parametrize(
    ("name", "quantity", "yes"),
    [
        ("Load (N)", "load", 1), ("Load rate", "load", 0), ("Load cell", "load", 0),
        ("Zeit", "time", 1), ("Zeit (s)", "load", 0), ("Weg", "elongation", 1),
        ("Weg", "deflection", 1), ("Load", "elongation", 0), ("Specimen label", "specimen", 1),
        ("Specimen_ID", "specimen", 1), ("Specimen width", "specimen", 0), ("Preload", "load", 0),
        ("Überdruck [bar]", "pressure", 1), ("Pressure rate (bar/s)", "pressure", 0),
        ("Tensile strain (Extension)", "elongation", 0), ("Load Cell", "elongation", 0),
    ],
)  # fmt: skip
def test_what_columns_mean(name, quantity, yes):
    assert means(name, quantity) is bool(yes)


@pytest.mark.parametrize(
    ("name", "plain", "unit"),
    [
        ("Load (kN)", "Load", "kN"), ("Crosshead [mm]", "Crosshead", "mm"), ("p_kPa", "p", "kPa"),
        ("gauge_disp_mm", "gauge_disp", "mm"), ("load_N", "load", "N"), ("Kraft / N", "Kraft", "N"),
        ("Weg in mm", "Weg", "mm"), ("PROBENBREITE <mm>", "PROBENBREITE", "mm"), ("m", "m", ""),
        ("Tensile strain (Extension)", "Tensile strain (Extension)", ""), ("Time", "Time", ""),
        ("Load (Channel 1)", "Load (Channel 1)", ""), ("Strain (mm/mm)", "Strain", "mm/mm"),
        ("Druck in mbar", "Druck", "mbar"),
    ],
)  # fmt: skip
def test_units_in_names(name, plain, unit):
    assert split_unit(name) == (plain, unit)


def test_the_elongation_nearest_to_the_strip():
    names = ["Crosshead (mm)", "Extension (mm)", "Video gauge (mm)", "Stroke", "Wegaufnehmer"]
    for which, nearest in (([0, 1, 2, 3, 4], [2, 4]), ([0, 1, 3], [1]), ([0, 3], [0, 3]), ([], [])):
        assert nearest_to_strip(names, which) == nearest


@pytest.mark.parametrize(
    ("own", "channel", "expected"),
    [
        ("kPa", {}, 2e-3), ("", {"unit": "bar"}, 0.2), ("bar", {"unit": "bar"}, 0.2),
        ("V", {"scale": 3.0, "offset": 1.0, "unit": "bar"}, 0.7), ("hPa", {"unit": "mbar"}, 2e-4),
        ("kPa", {"scale": 1.0, "offset": 1.0}, 3e-3),
        ("kPa", {"scale": 2.0}, "is in kPa already"), ("", {}, "say the unit of the readings"),
        ("V", {"scale": 2.0}, "say the unit after scaling"), ("mV", {}, "unit 'mV' is not one of"),
        ("at", {}, "unit 'at' is not one of Pa, hPa, mbar, kPa, psi, bar, MPa"),
        ("bar", {"unit": "kPa"}, "the file says 'bar', the project 'kPa'"),
        ("V", {"unit": "kPa"}, "the file says 'V', the project 'kPa'"),
        ("bar", {"unit": "kPa", "scale": 1.0}, "the file says 'bar', the project 'kPa'"),
    ],
)  # fmt: skip
def test_readings_of_a_sensor(own, channel, expected):
    def read():
        channels = np.array([2.0]), own, Channel(**channel), PRESSURE_UNITS, Path("a.csv"), "here"
        return in_unit(*channels)[0]

    if isinstance(expected, float):
        assert read() == pytest.approx(expected)
    else:
        assert complaint(read).startswith(f"a.csv: here: {expected}")


def test_states_of_dice_that_are_failures(tmp_path):
    """By DICe.h; all others are successes of some step."""
    good = {0, 1, 2, 3, 4, 6, 15, 18}
    names = [f"MODEL_{kind}_{a}" for kind in ("COORDINATES", "DISPLACEMENT") for a in "XYZ"]
    rows = [f"{k},0.1,{k}," + ",".join(map(str, range(k + 1, k + 7))) for k in range(25)]
    text = "\n".join([",".join(["SUBSET_ID", "SIGMA", "STATUS_FLAG", *names]), *rows, ""])
    path = tmp_path / "a.txt"
    for above in ("", "*** DICe\n"):
        path.write_text(above + text)
        (frame,) = read_frames([path])
        assert {int(x) - 1 for x in frame.points[:, 0]} == good == {*text_exports.SUCCESSFUL}
        assert frame.dropped == {"flagged as doubtful": 25 - len(good)}
    path.write_text(
        "SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y\n0,9,9,1,1\n"
    )
    columns = {"x": "COORDINATE_X", "y": "COORDINATE_Y", "dx": "DISPLACEMENT_X"}
    columns |= {"dy": "DISPLACEMENT_Y"}
    options = FrameOptions(("x", "y", "dx", "dy"), columns)
    assert read_frames([path], options)[0].points[0, :2].tolist() == [9.0, -9.0]
    assert "has no MODEL_COORDINATES_X: planar" in complaint(read_frames, [path])


def test_which_frame_is_near_enough():
    seen = np.array([0.010, 0.020, 0.050])
    assert choose_frames(seen, [0.011, 0.05])[0] == (0, 2)
    assert choose_frames(seen, [0.013, 0.047], tolerance=0.003)[0] == (0, 2)
    for asked, tolerance, words in (
        ([0.01101, 0.05], None, "pressures[0]: no frame within 1 kPa of 11.01 kPa"),
        ([0.013], 0.00299, "pressures[0]: no frame within 2.99 kPa of 13 kPa"),
        ([0.0096, 0.0104], 0.001, "pressures[1]: the frame at 10 kPa is the nearest to 9.6 and"),
    ):
        assert complaint(choose_frames, seen, asked, None, tolerance).startswith(words)
    # A millionth of the largest apart is one; more is two.
    assert choose_frames(np.array([0.1, 0.1 - 0.9e-7, 0.05])) == ((2, 1), {REPEATED: 1})
    assert choose_frames(np.array([0.1, 0.1 - 1.1e-7, 0.05]))[0] == (2, 1, 0)
    seen = np.array([0.010, 0.011, 0.012, 0.060])
    assert choose_frames(seen, count=4)[0] == (0, 1, 2, 3)
    assert choose_frames(seen, count=3)[0] == (1, 2, 3)
    assert choose_frames(seen, count=1)[0] == (3,)
    assert "frames: expected at most the 4 frames at" in complaint(choose_frames, seen, None, 5)


def split(*elongation: float) -> list[list[float]]:
    u = np.array(elongation)
    curve = LoadCurve("warp", "s", u, 10 * u, None, time=np.arange(len(u)), notes=("n",))
    parts = split_at_restarts(curve)
    assert [p.specimen for p in parts] == [f"s {k}" for k in range(1, len(parts) + 1)]
    assert all(p.notes == ("n",) and (p.load == 10 * p.elongation).all() for p in parts)
    assert np.concatenate([p.time for p in parts]).tolist() == list(range(len(u)))
    return [p.elongation.tolist() for p in parts]


def test_a_specimen_begins_where_the_elongation_falls_below_half():
    assert split(0, 1, 2, 0.99, 3) == [[0, 1, 2], [0.99, 3]]
    assert split(0, 1, 2, 1.0, 3) == [[0, 1, 2, 1.0, 3]]
    assert split(0, 5, 0, 5, 0, 5) == [[0, 5], [0, 5], [0, 5]]
    # Noise up to a hundredth of all is no elongation yet.
    assert split(0.1, -0.1, 0.1, 10) == [[0.1, -0.1, 0.1, 10]]
    assert split(0.11, -0.1, 0.1, 10) == [[0.11], [-0.1, 0.1, 10]]


def test_a_zero_by_the_first_four_readings(tmp_path):
    path = tmp_path / "b.csv"
    for rows, deflection in (
        ("6,2\n8,6\n10,10\n12,14\n14,99\n", [1.0, 3.0, 5.0, 7.0, 9.0]),
        ("0.1,1\n0.2,2\n0.3,3\n0.4,4\n", [0.1, 0.2, 0.3, 0.4]),
        ("6,2\n6,3\n6,4\n6,5\n7,9\n", None), ("6,2\n7,2\n8,2\n9,2\n10,9\n", None),
    ):  # fmt: skip
        path.write_text("deflection (mm),load (N)\n" + rows)
        if deflection:
            (curve,) = read_bending_curves(path, zero="line")
            assert curve.deflection.tolist() == pytest.approx(deflection)
        else:
            assert "line 2: the first read" in complaint(read_bending_curves, path, zero="line")


def test_surfaces_that_cannot_be():
    points = np.random.default_rng(1).uniform(-50, 50, (4, 2))
    field = DisplacementField(0.02, points, np.column_stack([points, points[:, 0] * points[:, 1]]))
    found = fit_surface(field, 1)  # four coefficients through four points
    np.testing.assert_allclose(found.evaluate(points), field.displacement, atol=1e-9)
    line = DisplacementField(0.02, np.tile(points[:2], (4, 1)), np.zeros((8, 3)))
    few = DisplacementField(0.02, points[:3], np.zeros((3, 3)))
    for bad, degree, words in (
        (few, 1, "surface of degree 1 at 20 kPa: 4 coefficients need as many points, there are 3"),
        (line, 1, "surface of degree 1 at 20 kPa: the 8 points lie so that they settle only 2"),
        (field, -1, "degree: expected 0 to 12, got -1"), (field, 13, "degree: expected 0 to 12"),
    ):  # fmt: skip
        assert complaint(fit_surface, bad, degree).startswith(words)


def test_numbers_of_frames_that_are_none(tmp_path):
    path = tmp_path / "all.csv"
    path.write_text("x;frame;p [bar]\n1;1;0.2\n2;two;0.3\n")
    words = "line 3, column 'frame': expected a number, found 'two'"
    complaint_with([words], values_in_file, path, Channel("p"), PRESSURE_UNITS)
    # Of one frame, or of frames that are all called alike, no picture is missing.
    assert picture_numbers([path], [5.0]) == (np.zeros(1), [])
    assert len(picture_numbers([path], [5.0, 5.0])[1]) == 1


def test_the_height_of_the_apex():
    up = np.outer(50 * (1 - np.linspace(0, 1, 2001)), [0.6, 0.0, -0.8])
    up[7] = 900.0
    up[3] = np.nan
    frame = Frame(np.zeros_like(up), up)
    # 98 % of points evenly along a cone moved less than 98 % of its height.
    assert apex_height(frame) == pytest.approx(49.0, abs=0.1)
    assert np.isnan(apex_height(Frame(np.zeros((2, 3)), np.full((2, 3), np.nan))))


POINTS = "x [mm];y [mm];dx [mm];dy [mm];dz [mm]"


def written(folder: Path, text: str) -> Path:
    path = folder / "made-up.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "units", "pattern", "expected"),
    [
        ("step_012_35.5kPa.csv", PRESSURE_UNITS, None, 0.0355),
        ("step_012_35,5_kPa.csv", PRESSURE_UNITS, None, 0.0355),
        ("run7-0.355bar-a.csv", PRESSURE_UNITS, None, 0.0355),
        ("12_355 mbar.txt", PRESSURE_UNITS, None, 0.0355),
        ("5.1489psi.csv", PRESSURE_UNITS, None, 0.0355), ("3mbar2.csv", PRESSURE_UNITS, None, 3e-4),
        ("bubble_p35.5_t12.csv", PRESSURE_UNITS, r"_p([\d.]+)_", 0.0355),
        ("bubble_p35.5_t12.csv", TIME_UNITS, r"_t(\d+)\.", 12.0),
        ("p3_7x.csv", TIME_UNITS, r"_(\d)", 7.0), ("12max.csv", PRESSURE_UNITS, None, "found none"),
        ("p3_7x.csv", {"s": 1.0, "ms": 1e-3}, None, "with its unit (s, ms)"),
        ("10kPa_0.1bar.csv", PRESSURE_UNITS, None, "10 kPa and 0.1 bar"),
        ("1s_2ms", {"s": 1.0, "ms": 1e-3}, None, "found 1 s and 2 ms"),
        ("a.csv", PRESSURE_UNITS, r"p(\d+)", "does not fit the pattern"),
        ("px.csv", PRESSURE_UNITS, r"p(\w)", "found 'x'"),
        ("p3.csv", PRESSURE_UNITS, "p(q)?", "found None"),
    ],
)  # fmt: skip
def test_a_number_in_the_name(name, units, pattern, expected):
    asked = Path(name), units, pattern, "kPa" if units is PRESSURE_UNITS else None, "from_name"
    if isinstance(expected, float):
        assert number_in_name(*asked) == pytest.approx(expected, rel=2e-5)
    else:
        said = complaint(number_in_name, *asked)
        assert said.startswith(f"{name}: from_name: ") and expected in said
    assert check_pattern(r"_p(\d+)_") is None
    for bad, words in (("(", "no regular expression"), ("(a)(b)", "has 2"), ("a", "has 0")):
        assert words in check_pattern(bad)


def test_a_column_or_a_line_above_the_numbers(tmp_path):
    for text in (
        f"{POINTS};p [kPa]\n0;0;0;0;1;35,5\n1;0;0;0;1;35,5\n",
        f"{POINTS};p\nmm;mm;mm;mm;mm;bar\n0;0;0;0;1;0.355\n1;0;0;0;1;0.355\n",
        f"# p [kPa] = 35.5\n{POINTS}\n0;0;0;0;1\n", f"Title\np;35,5;kPa\n{POINTS}\n0;0;0;0;1\n",
        f"# test 1 p_bar=0.355000; x,y in mm\n# p = 0.355 bar\n{POINTS}\n0;0;0;0;1\n",
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;nan;nan;nan;\n",
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;0;0;1;n/a\n2;0;0;0;1;35.5\n",
        f"{POINTS};p\n;;;;;[kPa]\n0;0;0;0;1;35.5\n", f"{POINTS}\n0;0;0;0;1\np = 3.55e1 kPa\n",
        "p [kPa],q,r\n35.5,a,1\n35.5,b,2\n", "x p_kPa\n1 35.5\n", "# p_kPa = 35.5\nx;y\n1;2\n",
        "p [kPa]: 35,5\nx;y\n1;2\n", "p 35.5 kPa, and p 35.5 kPa again\n", "p (kPa) 355e-1\n",
    ):  # fmt: skip
        value = values_in_file(written(tmp_path, text), Channel("p"), PRESSURE_UNITS)
        assert value == pytest.approx(0.0355), text


NEITHER = ["neither a column 'p' nor a line"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{POINTS};p [kPa]\n0;0;0;0;1;35\n1;0;0;0;1;36\n", ["line 3, column 'p [kPa]'", "line 2"]),
        (f"{POINTS};p [kPa]\n0;0;0;0;1;3\n1;0;0;0;1;3\n1;0;0;0;1;4\n", ["line 4, column 'p ["]),
        (f"{POINTS};p\n0;0;0;0;1;35\n", ["line 1, column 'p'", "say the unit"]),
        (f"{POINTS};p [V]\n0;0;0;0;1;35\n", ["'V' is not one of"]),
        (f"{POINTS};p [V]\n0;0;0;0;1;high\n0;0;0;0;1;3\n0;0;0;0;1;low\n", ["line 4", "'low'"]),
        (f"{POINTS};p\n0;0;0;0;1;\n0;0;0;0;1;n/a\n", ["line 1, column 'p': holds no number"]),
        (f"{POINTS}\n0;0;0;0;1\n", NEITHER), ("xp = 3 kPa\np2 = 4 kPa\n", NEITHER),
        # A column of words is none, and a row with too few cells is none of the table.
        ("p [kPa],q,r,s\n3,a,b,c\n3,a,b,c\n", NEITHER), ("p,q,r [kPa]\n3\n3\n", NEITHER),
        (f"p = 3 kPa\np = 4 kPa\n{POINTS}\n0;0;0;0;1\n", ["line 2", "another 'p' than line 1"]),
        ("a\np = 3 kPa\n\np = 4 kPa\n", ["line 4", "another 'p' than line 2"]),
        (f"t\n{POINTS};p;p [bar]\n0;0;0;0;1;3;4\n", ["line 2", "2 columns are called 'p'"]),
    ],
)  # fmt: skip
def test_values_that_cannot_be_told(tmp_path, text, words):
    path = written(tmp_path, text)
    complaint_with([str(path), *words], values_in_file, path, Channel("p"), PRESSURE_UNITS)


def test_a_log_in_volts(tmp_path):
    """Festo SPTE-P10R: 0 V at 0 kPa, 10 V at 1,000 kPa (Appendix B); a volt may be a unit."""
    path = written(tmp_path, "Zeit (min);U_p (V)\n0;0\n1;0,355\n2;10\n")
    for channel, pressure in (
        (Channel("U_p", "kPa", 100.0), [0.0, 0.0355, 1.0]),
        (Channel("U_p", "bar", 1.0, -0.5), [-0.05, -0.0145, 0.95]),
    ):
        time, read = read_pressure_log(path, channel)
        assert read == pytest.approx(pressure)
        assert time == pytest.approx([0.0, 60.0, 120.0])


@pytest.mark.parametrize(
    ("text", "channel", "words"),
    [
        ("t,p (kPa)\n0,1\n1,2\n", {}, ["no header row", "time"]),
        ("time,p\n0,1\n1,2\n", {}, ["line 1, column 'p'", "say the unit"]),
        ("time,p (V)\n0,1\n1,2\n", {"unit": "kPa"}, ["'V'", "'kPa'"]),
        ("time,p (kPa)\n0,1\n1,2\n", {"unit": "kPa", "scale": 100.0}, ["leave the scale"]),
        ("time,p (kPa)\n0,1\n2,2\n1,3\n0,3\n", {}, ["line 4, column 'time'", "go back"]),
        ("time,p (kPa)\n3,1\n3,2\n", {}, ["column 'time'", "two times"]),
        ("time (days),p (kPa)\n3,1\n4,2\n", {}, ["'days' is not one of s"]),
        ("time,p (kPa),Druck\n3,1,1\n4,2,2\n", {}, ["'p (kPa)' or 'Druck'", "columns"]),
    ],
)
def test_logs_that_cannot_be_told(tmp_path, text, channel, words):
    path = written(tmp_path, text)
    complaint_with([str(path), *words], read_pressure_log, path, Channel(**channel))


#: The log's clock, s, of a test that begins at 0; its pressures, MPa.
CLOCK = np.arange(-60.0, 320.0, 0.2)


def steps(t):
    """A manual valve: raised by 30 kPa within 3 s, held to 25 s, nine times."""
    return np.where(t > 0, 0.03 * np.clip(np.floor(t / 25) + np.clip(t % 25 / 3, 0, 1), 0, 9), 0.0)


def ramp(t):
    return 0.3 * np.clip(t / 180, 0.0, 1.0)


def cycles(t):
    return np.where(t > 0, 0.15 * (1 - np.cos(2 * np.pi * t / 60)), 0.0)


#: Sheets: a membrane that was flat, one that was taut, one of neither.
HEIGHTS = {
    "flat": lambda p: 60 * (p / 0.3) ** (1 / 3),
    "taut": lambda p: 60 * p / 0.3,
    "between": lambda p: 45 * np.log1p(10 * p / 0.3) / np.log(11) + 15 * p / 0.3,
}


def recorded(history, law, offset, noise, seed=0, count=150, start=-10.0):
    draw = np.random.default_rng(seed)
    times = np.arange(count) + start
    heights = np.abs(HEIGHTS[law](history(times)) + 60 * noise * draw.normal(size=count))
    pressures = history(CLOCK) + 0.3 * noise * draw.normal(size=len(CLOCK))
    return times, heights, CLOCK + offset, pressures


@pytest.mark.parametrize(
    ("history", "law", "offset"),
    [
        (steps, "flat", 37.3), (steps, "taut", -9876.5), (steps, "between", 1.7e9 + 0.25),
        (ramp, "flat", 0.0), (ramp, "taut", 12.34), (cycles, "between", 60.0),
    ],
)  # fmt: skip
def test_a_known_offset_is_found_within_what_is_said(history, law, offset):
    """Of whatever law: nothing is supposed but that the sheet rises with the pressure."""
    data = recorded(history, law, offset, 5e-4, 3)
    found = find_offset(*data)
    assert found.lower <= offset <= found.upper
    assert found.upper - found.lower < 5.0 and abs(found.offset - offset) < 1.5
    assert 0 < found.misfit < 1e-3
    within = np.abs(found.pressure - history(data[0])) <= found.doubt + 5 * 0.3 * 5e-4
    assert within.all() and np.mean(found.doubt) < 0.004


def test_steps_are_sharper_than_a_frame_between_two_pictures():
    times, heights, clock, pressures = recorded(steps, "flat", 37.3, 5e-4)
    found = find_offset(times, heights, clock, pressures)
    assert found.offset == pytest.approx(37.3, abs=0.2) and found.upper - found.lower < 1.0
    # On the holds the offset does not matter; between them it does.
    assert np.median(found.doubt) < 2e-4 < 5e-4 < found.doubt.max()
    # Frames in no order, and frames without a height.
    order = np.random.default_rng(1).permutation(len(times))
    heights[[20, 21, 90]] = np.nan
    found = find_offset(times[order], heights[order], clock, pressures)
    assert found.offset == pytest.approx(37.3, abs=0.2)
    np.testing.assert_allclose(found.pressure, steps(times[order]), atol=0.012)
    assert np.isfinite(found.pressure[np.isnan(heights[order])]).all()
    # Frames beyond the log have no pressure.
    times, heights, clock, pressures = recorded(steps, "flat", 37.3, 5e-4, count=250)
    kept = clock < 37.3 + 220
    found = find_offset(times, heights, clock[kept], pressures[kept])
    assert found.offset == pytest.approx(37.3, abs=0.3)
    lost = np.isnan(found.pressure)
    assert lost.any() and (times[lost] > 219).all()


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_the_doubt_is_what_the_offsets_leave_open(noise):
    """On a steady rise of 1.67 kPa/s: half of the range of the offsets times that."""
    found = find_offset(*recorded(ramp, "flat", 37.3, noise))
    assert found.lower <= 37.3 <= found.upper
    assert found.offset == pytest.approx((found.lower + found.upper) / 2)
    middle = found.doubt[60:100]
    assert np.mean(middle) == pytest.approx(0.3 / 180 * (found.upper - found.lower) / 2, rel=0.15)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # A steady rise that neither begins nor ends in the film.
        (dict(history=lambda t: 0.3 * (t + 60) / 380, law="taut", start=10.0), "do as well"),
        # Every hold alike, and the film between two of them: a step later does as well.
        (dict(history=steps, law="taut", start=40.0, count=100), "kPa on average"),
        (dict(history=ramp, law="flat", count=5), "5 frames are too few"),
        (dict(history=ramp, law="flat", count=900), "the log lasts 379.8 s, the frames 899 s"),
    ],
)
def test_what_cannot_be_told_is_refused(change, words):
    assert words in complaint(find_offset, *recorded(offset=12.0, noise=5e-4, **change))
