"""Values that files tell: units, columns, names, flags; each at its limit, each complaint whole."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.bubble.sheet import fit_disk_polynomial
from bubblefit.readers import columns as column_names
from bubblefit.readers.bending import read_bending_curves
from bubblefit.readers.columns import PRESSURE_UNITS, means, nearest_to_strip, scale_of
from bubblefit.readers.curves import LoadCurve, read_load_curves, split_at_restarts
from bubblefit.readers.fields import DisplacementField
from bubblefit.readers.formats import dice
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.machine_tables import Channel, in_unit
from bubblefit.readers.names import check_pattern, number_in_name, value_in_file
from bubblefit.readers.pressure_log import (
    REPEATED,
    choose_frames,
    misfit_of,
    offset_misfits,
    straightest,
)
from bubblefit.readers.surfaces import fit_surface, read_surfaces

from ..complaints import complaint

# --- units ---------------------------------------------------------------------------------------


def test_units_of_columns_are_those_of_si() -> None:
    pascal = {
        "Pa": 1, "hPa": 1e2, "mbar": 1e2, "kPa": 1e3, "psi": 0.45359237 * 9.80665 / 0.0254**2,
        "bar": 1e5, "MPa": 1e6,
    }  # fmt: skip
    assert {k: 1e6 * v for k, v in PRESSURE_UNITS.items()} == pytest.approx(pascal)
    assert column_names.LENGTH_UNITS == {"mm": 1.0, "cm": 10.0, "m": 1000.0}
    assert column_names.LOAD_UNITS == {"N": 1.0, "kN": 1000.0}
    per_metre = {"kN/m": 1e3, "N/mm": 1e3, "N/m": 1.0, "N/cm": 1e2, "N/50mm": 20.0}
    found = {k: 1e3 * v for k, v in column_names.WIDTH_LOAD_UNITS.items()}
    assert found == pytest.approx(per_metre)
    seconds = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
    assert column_names.TIME_UNITS == seconds
    for unit, newton in {"n": 1.0, "kn": 1e3, "KN": 1e3, "N": 1.0, "MN": None}.items():
        assert scale_of(unit, column_names.LOAD_UNITS) == newton


@pytest.mark.parametrize(
    ("name", "quantity", "yes"),
    [
        ("Load (N)", "load", 1), ("Load rate", "load", 0), ("Load cell", "load", 0),
        ("Zeit", "time", 1), ("Zeit (s)", "load", 0), ("Weg", "elongation", 1),
        ("Weg", "deflection", 1), ("Load", "elongation", 0), ("Specimen label", "specimen", 1),
        ("Specimen_ID", "specimen", 1), ("Specimen width", "specimen", 0),
        ("Überdruck [bar]", "pressure", 1),
    ],
)  # fmt: skip
def test_what_columns_mean(name: str, quantity: str, yes: int) -> None:
    assert means(name, quantity) is bool(yes)


def test_the_elongation_nearest_to_the_strip() -> None:
    names = ["Crosshead (mm)", "Extension (mm)", "Video gauge (mm)", "Stroke", "Wegaufnehmer"]
    assert nearest_to_strip(names, [0, 1, 2, 3, 4]) == [2, 4]
    assert nearest_to_strip(names, [0, 1, 3]) == [1] and nearest_to_strip(names, [0, 3]) == [0, 3]
    assert nearest_to_strip(names, []) == []


def unit(own: str, **channel) -> float:
    value = in_unit(np.array([2.0]), own, Channel(**channel), PRESSURE_UNITS, Path("a.csv"), "here")
    return float(value[0])


def test_readings_of_a_sensor() -> None:
    """Scale times reading plus offset, in the unit."""
    assert unit("kPa") == pytest.approx(2e-3)
    assert unit("", unit="bar") == pytest.approx(0.2)
    assert unit("V", scale=3.0, offset=1.0, unit="bar") == pytest.approx(0.7)
    assert unit("kPa", scale=1.0, offset=1.0) == pytest.approx(3e-3)
    assert unit("bar", unit="bar") == pytest.approx(0.2)
    assert unit("hPa", unit="mbar") == pytest.approx(2e-4)


@pytest.mark.parametrize(
    ("own", "channel", "words"),
    [
        ("kPa", {"scale": 2.0}, "is in kPa already: leave the scale 2 out"),
        ("", {}, "say the unit of the readings, one of Pa, hPa, mbar, kPa, psi, bar, MPa"),
        ("V", {"scale": 2.0}, "say the unit after scaling, one of Pa, hPa, mbar, kPa, psi, bar, "
         "MPa"),
        ("mV", {}, "unit 'mV' is not one of Pa, hPa, mbar, kPa, psi, bar, MPa; a sensor in volts "
         "needs scale and unit"),
        ("at", {}, "unit 'at' is not one of Pa, hPa, mbar, kPa, psi, bar, MPa; convert it"),
        ("bar", {"unit": "kPa"}, "the file says 'bar', the project 'kPa'; correct one of them"),
        ("V", {"unit": "kPa"}, "the file says 'V', the project 'kPa'; correct one of them"),
        ("bar", {"unit": "kPa", "scale": 1.0}, "the file says 'bar', the project 'kPa'; correct "
         "one of them"),
    ],
)  # fmt: skip
def test_units_that_contradict(own: str, channel: dict, words: str) -> None:
    assert complaint(unit, own, **channel) == f"a.csv: here: {words}"


# --- names ---------------------------------------------------------------------------------------


def test_numbers_in_names_say_where_they_are() -> None:
    path = Path("p3_7x.csv")
    assert number_in_name(path, PRESSURE_UNITS, r"_(\d)") == 7.0
    assert number_in_name(Path("3mbar2.csv"), PRESSURE_UNITS) == pytest.approx(3e-4)
    assert complaint(number_in_name, path, {"s": 1.0, "ms": 1e-3}, None, None, "time") == (
        "p3_7x.csv: time: expected one number with its unit (s, ms) in the file's name, found "
        "none; a pattern with one group says where it is"
    )
    assert complaint(number_in_name, Path("1s_2ms"), {"s": 1.0, "ms": 1e-3}) == (
        "1s_2ms: expected one number with its unit (s, ms) in the file's name, found 1 s and 2 ms; "
        "a pattern with one group says where it is"
    )
    assert complaint(number_in_name, path, PRESSURE_UNITS, "q(.)", None, "f") == (
        "p3_7x.csv: f: the file's name does not fit the pattern 'q(.)'"
    )
    for pattern, found in (("(x)", "'x'"), ("p(q)?", "None")):
        assert complaint(number_in_name, path, PRESSURE_UNITS, pattern, None, "f") == (
            f"p3_7x.csv: f: expected a number in the group of {pattern!r}, found {found}"
        )
    assert check_pattern("a") == ("expected one group, in brackets, around the number; 'a' has 0")


# --- a value beside the points -------------------------------------------------------------------

POINTS = "x [mm];y [mm];dx [mm];dy [mm];dz [mm]"


def value(folder: Path, text: str, name: str = "p") -> float:
    path = folder / "a.csv"
    path.write_text(text)
    return value_in_file(path, Channel(name), PRESSURE_UNITS)


@pytest.mark.parametrize(
    "text",
    [
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;0;0;1;n/a\n2;0;0;0;1;35.5\n",
        f"{POINTS};p\n;;;;;[kPa]\n0;0;0;0;1;35.5\n",
        "p [kPa],q,r\n35.5,a,1\n35.5,b,2\n",  # two of three are numbers
        "x p_kPa\n1 35.5\n",
        "# p_kPa = 35.5\nx;y\n1;2\n",
        "p [kPa]: 35,5\nx;y\n1;2\n",
        "p 35.5 kPa, and p 35.5 kPa again\n",
        f"{POINTS}\n0;0;0;0;1\np = 3.55e1 kPa\n",
        "p (kPa) 355e-1\n",
    ],
)
def test_a_value_wherever_it_stands(tmp_path: Path, text: str) -> None:
    assert value(tmp_path, text) == pytest.approx(0.0355)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{POINTS};p [kPa]\n0;0;0;0;1;3\n1;0;0;0;1;3\n1;0;0;0;1;4\n", "line 4, column 'p [kPa]': "
         "expected the same number as in line 2, one a file"),
        (f"{POINTS};p [kPa]\n0;0;0;0;1;3\n1;0;0;0;1;low\n", "line 3, column 'p [kPa]': expected a "
         "number, found 'low'"),
        (f"{POINTS};p\n0;0;0;0;1;\n0;0;0;0;1;n/a\n", "line 1, column 'p': holds no number"),
        (f"t\n{POINTS};p;p [bar]\n0;0;0;0;1;3;4\n", "line 2: 2 columns are called 'p'"),
        ("a\np = 3 kPa\n\np = 4 kPa\n", "line 4: says another 'p' than line 2"),
        ("xp = 3 kPa\np2 = 4 kPa\n", "neither a column 'p' nor a line above the numbers that says "
         "'p' and a value"),
        # A column of words is none, and a row with too few cells is none of the table.
        ("p [kPa],q,r,s\n3,a,b,c\n3,a,b,c\n", "neither a column 'p' nor a line above the numbers "
         "that says 'p' and a value"),
        ("p,q,r [kPa]\n3\n3\n", "neither a column 'p' nor a line above the numbers that says 'p' "
         "and a value"),
    ],
)  # fmt: skip
def test_values_that_are_not_told(tmp_path: Path, text: str, words: str) -> None:
    assert complaint(value, tmp_path, text) == f"{tmp_path / 'a.csv'}: {words}"


# --- frames --------------------------------------------------------------------------------------


def test_states_of_dice_that_are_failures(tmp_path: Path) -> None:
    """By DICe.h; all others are successes of some step."""
    good = {0, 1, 2, 3, 4, 6, 15, 18}
    names = [f"MODEL_{kind}_{a}" for kind in ("COORDINATES", "DISPLACEMENT") for a in "XYZ"]
    rows = [f"{k},0.1,{k}," + ",".join(map(str, range(k + 1, k + 7))) for k in range(25)]
    path = tmp_path / "a.txt"
    head = ",".join(["SUBSET_ID", "SIGMA", "STATUS_FLAG", *names])
    path.write_text("\n".join([head, *rows, ""]))
    (frame,) = read_frames([path])
    assert {int(x) - 1 for x in frame.points[:, 0]} == good == {*dice.SUCCESSFUL}
    assert frame.dropped == {"flagged as doubtful": 25 - len(good)}
    # The names may stand below lines of ***, and nowhere else.
    path.write_text("*** DICe\n" + "\n".join([head, *rows, ""]))
    assert len(read_frames([path])[0].points) == len(good)
    flat = "SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y\n0,9,9,1,1\n"
    path.write_text(flat)
    columns = {"x": "COORDINATE_X", "y": "COORDINATE_Y", "dx": "DISPLACEMENT_X",
               "dy": "DISPLACEMENT_Y"}  # fmt: skip
    options = FrameOptions(("x", "y", "dx", "dy"), columns)
    assert read_frames([path], options)[0].points[0, :2].tolist() == [9.0, -9.0]


def test_which_frame_is_near_enough() -> None:
    """2 % of the largest asked for, or as said; as far as that, not farther."""
    seen = np.array([0.010, 0.020, 0.050])
    assert choose_frames(seen, [0.011, 0.05]).frames == (0, 2)
    assert complaint(choose_frames, seen, [0.01101, 0.05]) == (
        "pressures[0]: no frame within 1 kPa of 11.01 kPa; the nearest was recorded at 10 kPa: ask "
        "for that, or say a larger tolerance"
    )
    assert choose_frames(seen, [0.013, 0.047], tolerance=0.003).frames == (0, 2)
    assert "within 2.99 kPa of 13 kPa" in complaint(choose_frames, seen, [0.013], None, 0.00299)
    assert complaint(choose_frames, seen, [0.0096, 0.0104], None, 0.001) == (
        "pressures[1]: the frame at 10 kPa is the nearest to 9.6 and to 10.4 kPa; ask for one of "
        "them"
    )


def test_frames_at_one_pressure() -> None:
    """A millionth of the largest apart is one; more is two."""
    one = choose_frames(np.array([0.1, 0.1 - 0.9e-7, 0.05]))
    assert one.frames == (2, 1) and one.left_out == {REPEATED: 1}
    assert choose_frames(np.array([0.1, 0.1 - 1.1e-7, 0.05])).frames == (2, 1, 0)
    seen = np.array([0.010, 0.011, 0.012, 0.060])
    assert choose_frames(seen, count=4).frames == (0, 1, 2, 3)
    assert choose_frames(seen, count=3).frames == (1, 2, 3)
    assert choose_frames(seen, count=1).frames == (3,)
    assert complaint(choose_frames, seen, None, 5) == (
        "frames: expected at most the 4 frames at pressures of their own, got 5"
    )


# --- load curves ---------------------------------------------------------------------------------


def split(*elongation: float) -> list[list[float]]:
    u = np.array(elongation)
    curve = LoadCurve("warp", "s", u, 10 * u, None, time=np.arange(len(u)), notes=("n",))
    parts = split_at_restarts(curve)
    assert [p.specimen for p in parts] == [f"s {k}" for k in range(1, len(parts) + 1)]
    assert all(p.notes == ("n",) and (p.load == 10 * p.elongation).all() for p in parts)
    assert np.concatenate([p.time for p in parts]).tolist() == list(range(len(u)))
    return [p.elongation.tolist() for p in parts]


def test_a_specimen_begins_where_the_elongation_falls_below_half() -> None:
    assert split(0, 1, 2, 0.99, 3) == [[0, 1, 2], [0.99, 3]]
    assert split(0, 1, 2, 1.0, 3) == [[0, 1, 2, 1.0, 3]]
    assert split(0, 5, 0, 5, 0, 5) == [[0, 5], [0, 5], [0, 5]]
    # Noise up to a hundredth of all is no elongation yet.
    assert split(0.1, -0.1, 0.1, 10) == [[0.1, -0.1, 0.1, 10]]
    assert split(0.11, -0.1, 0.1, 10) == [[0.11], [-0.1, 0.1, 10]]


def test_what_is_said_of_columns(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Crosshead (mm),Extension (mm),Load (N)\n0,0,1\n2,1,5\n")
    (curve,) = read_load_curves(path, direction="warp")
    assert curve.elongation.tolist() == [0.0, 1.0]
    (named,) = read_load_curves(path, direction="warp", format="text")
    for one in (curve, named):
        assert one.source is not None and one.source.format == "text"
        assert one.source.columns == {"elongation": "Extension (mm)", "load": "Load (N)"}
        assert one.source.units == {"elongation": "mm", "load": "N"}
    assert curve.notes == (
        "a.csv: the elongation is column 'Extension (mm)', not 'Crosshead (mm)'; columns = { "
        "elongation = ... } names another",
    )
    path.write_text("Load (N),Extension (mm),Force (N)\n0,0,1\n2,1,5\n")
    assert complaint(read_load_curves, path, direction="warp") == (
        f"{path}: line 1: the column of load may be 'Load (N)' or 'Force (N)'; name one with "
        "columns; the file has: Load (N), Extension (mm), Force (N)"
    )
    path.write_text("Load (N),Extension (in)\n0,0\n2,1\n")
    assert complaint(read_load_curves, path, direction="warp") == (
        f"{path}: line 1, column 'Extension (in)': unit 'in' is not one of mm, cm, m; convert the "
        "column"
    )
    path.write_text("Load (N),Extension (cm)\n0,0\n2,1\n")
    assert complaint(read_load_curves, path, direction="warp", length_unit="mm") == (
        f"{path}: line 1, column 'Extension (cm)': the file says 'cm', length_unit says 'mm'; "
        "correct one of them"
    )
    path.write_text("Load,Extension (cm)\n0,0\n2,1\n")
    assert complaint(read_load_curves, path, direction="warp") == (
        f"{path}: line 1, column 'Load': the file does not name the unit; say load_unit, one of N, "
        "kN"
    )


# --- bending, surfaces, clocks -------------------------------------------------------------------


def test_a_zero_by_the_first_four_readings(tmp_path: Path) -> None:
    path = tmp_path / "b.csv"
    head = "deflection (mm),load (N)\n"
    path.write_text(head + "6,2\n8,6\n10,10\n12,14\n14,99\n")
    (curve,) = read_bending_curves(path, zero="line")
    assert curve.deflection.tolist() == pytest.approx([1.0, 3.0, 5.0, 7.0, 9.0])
    path.write_text(head + "0.1,1\n0.2,2\n0.3,3\n0.4,4\n")
    (curve,) = read_bending_curves(path, zero="line")
    assert curve.deflection.tolist() == pytest.approx([0.1, 0.2, 0.3, 0.4])
    for rows in ("6,2\n6,3\n6,4\n6,5\n7,9\n", "6,2\n7,2\n8,2\n9,2\n10,9\n"):
        path.write_text(head + rows)
        assert complaint(read_bending_curves, path, zero="line") == (
            f"{path}: line 2: the first readings of 'b' do not rise: no zero to be found"
        )


def test_surfaces_that_cannot_be(tmp_path: Path) -> None:
    points = np.random.default_rng(1).uniform(-50, 50, (4, 2))
    field = DisplacementField(0.02, points, np.column_stack([points, points[:, 0] * points[:, 1]]))
    found = fit_surface(field, 1)  # four coefficients through four points
    np.testing.assert_allclose(found.evaluate(points), field.displacement, atol=1e-9)
    assert complaint(fit_surface, DisplacementField(0.02, points[:3], np.zeros((3, 3))), 1) == (
        "surface of degree 1 at 20 kPa: 4 coefficients need as many points, there are 3; lower "
        "the degree"
    )
    line = DisplacementField(0.02, np.tile(points[:2], (4, 1)), np.zeros((8, 3)))
    assert complaint(fit_surface, line, 1) == (
        "surface of degree 1 at 20 kPa: the 8 points lie so that they settle only 2 of 4 "
        "coefficients (on too few lines?); lower the degree"
    )
    for degree in (-1, 15, 99):
        if degree != 15:
            assert complaint(fit_surface, field, degree).endswith(f", got {degree}")
    path = tmp_path / "s.csv"

    def surfaces(scale: str, degree: str = "0", c0: str = "3") -> str:
        rows = [f"0.1,{axis},1,{degree},{scale},{c0}\n" for axis in "xyz"]
        return "pressure_MPa,direction,R2,degree,scale_mm,C0\n" + "".join(rows)

    path.write_text(surfaces("0.5"))
    assert read_surfaces(path)[0].scale == 0.5
    for text, words in (
        (surfaces("0"), "expected a scale above 0 mm, got 0"),
        (surfaces("-1"), "expected a scale above 0 mm, got -1"),
        (surfaces("1", "0.5"), ", got 0.5"),
        (
            surfaces("1e300", "1", "1e300")
            .replace("C0", "C0,C1,C2,C3")
            .replace(",1e300\n", ",1e300,0,0,0\n"),
            "coefficients too large for a scale of 1e+300 mm",
        ),
    ):
        path.write_text(text)
        said = complaint(read_surfaces, path)
        assert said.startswith(f"{path}: line 2: ") and said.endswith(words), said


def test_rising_functions_that_are_known() -> None:
    p = np.linspace(0.0, 1.0, 11)
    assert misfit_of(p, p**2, 0.0) == pytest.approx(0.0, abs=1e-12)
    # Falling: anchored in (0, 0), nothing that rises explains it.
    assert misfit_of(p, 1 - p, 0.0) > 0.9
    # Fewer than six frames, or than four of five less one, tell nothing; six of eight do.
    few = np.where(np.arange(11) < 5, p, np.nan)
    assert misfit_of(few, p, 0.0) == 1.0
    eight, some = np.linspace(0, 1, 8), np.where(np.arange(8) < 6, np.linspace(0, 1, 8), np.nan)
    assert misfit_of(some, eight, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert misfit_of(np.where(np.arange(8) < 5, eight, np.nan), eight, 0.0) == 1.0
    assert misfit_of(np.full(8, 0.3), eight, 0.0) > 0.4  # no variance on one side counts as one
    for power in (1, 2, 3):
        assert straightest(p ** (1 / power), [p[::-1], p]) == power


def test_offsets_are_half_a_frame_apart_and_finer_about_the_best() -> None:
    times = np.arange(10.0)
    log = np.arange(0.0, 40.0, 0.5)
    pressures = np.clip(log - 20.0, 0, 5) / 50
    heights = np.clip(times - 3.0, 0, 5)
    offsets, misfits = offset_misfits(times, heights, log, pressures)
    assert (np.diff(offsets) >= 0).all() and len(offsets) == len(misfits)
    # Eight of ten frames lie within the log: from -2 s to 39.5 - 7 s.
    assert (offsets[0], offsets[-1]) == pytest.approx((-2.0, 32.5))
    steps = np.diff(offsets)
    assert np.median(steps[steps > 0.1]) == pytest.approx(0.5, abs=0.02)
    assert offsets[np.argmin(misfits)] == pytest.approx(17.0, abs=0.05)
    near = np.abs(offsets - 17.0) < 0.9
    assert near.sum() > 60 and steps[near[:-1] & near[1:]].max() < 0.03
    said = complaint(offset_misfits, times * 9, heights, log, pressures)
    assert said == (
        "the log lasts 39.5 s, the frames 81 s; are the units of time and the rate right?"
    )


def test_a_polynomial_of_degree_nought_is_the_mean() -> None:
    found = fit_disk_polynomial(np.eye(2), np.array([[1.0], [4.0]]), 1.0, 0)
    assert found.at(np.zeros((1, 2))).tolist() == [[2.5]] and found.rms.tolist() == [1.5]
