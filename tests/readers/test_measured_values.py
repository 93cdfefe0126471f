"""Values that files tell: units, columns, names, flags; each at its limit, each complaint whole."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers import columns as column_names
from bubblefit.readers.bending import read_bending_curves
from bubblefit.readers.columns import PRESSURE_UNITS, means, nearest_to_strip, scale_of
from bubblefit.readers.curves import LoadCurve, read_load_curves, split_at_restarts
from bubblefit.readers.fields import DisplacementField
from bubblefit.readers.formats import dice
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.machine_tables import Channel, in_unit
from bubblefit.readers.pressure_log import (
    REPEATED,
    choose_frames,
    misfit_of,
    offset_misfits,
    straightest,
)
from bubblefit.readers.surfaces import fit_surface, read_surfaces

from ..complaints import complaint


# --- units ---
def test_units_of_columns_are_those_of_si():
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
def test_what_columns_mean(name, quantity, yes):
    assert means(name, quantity) is bool(yes)


def test_the_elongation_nearest_to_the_strip():
    names = ["Crosshead (mm)", "Extension (mm)", "Video gauge (mm)", "Stroke", "Wegaufnehmer"]
    assert nearest_to_strip(names, [0, 1, 2, 3, 4]) == [2, 4]
    assert nearest_to_strip(names, [0, 1, 3]) == [1] and nearest_to_strip(names, [0, 3]) == [0, 3]
    assert nearest_to_strip(names, []) == []


def unit(own: str, **channel) -> float:
    value = in_unit(np.array([2.0]), own, Channel(**channel), PRESSURE_UNITS, Path("a.csv"), "here")
    return float(value[0])


def test_readings_of_a_sensor():
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
def test_units_that_contradict(own, channel, words):
    assert complaint(unit, own, **channel) == f"a.csv: here: {words}"


# --- frames ---
def test_states_of_dice_that_are_failures(tmp_path):
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


def test_which_frame_is_near_enough():
    seen = np.array([0.010, 0.020, 0.050])
    assert choose_frames(seen, [0.011, 0.05]).frames == (0, 2)
    said = complaint(choose_frames, seen, [0.01101, 0.05])
    assert "pressures[0]: no frame within 1 kPa of 11.01 kPa; the nearest was" in said
    assert choose_frames(seen, [0.013, 0.047], tolerance=0.003).frames == (0, 2)
    assert "within 2.99 kPa of 13 kPa" in complaint(choose_frames, seen, [0.013], None, 0.00299)
    assert complaint(choose_frames, seen, [0.0096, 0.0104], None, 0.001) == (
        "pressures[1]: the frame at 10 kPa is the nearest to 9.6 and to 10.4 kPa; ask for one of "
        "them"
    )


def test_frames_at_one_pressure():
    """A millionth of the largest apart is one; more is two."""
    one = choose_frames(np.array([0.1, 0.1 - 0.9e-7, 0.05]))
    assert one.frames == (2, 1) and one.left_out == {REPEATED: 1}
    assert choose_frames(np.array([0.1, 0.1 - 1.1e-7, 0.05])).frames == (2, 1, 0)
    seen = np.array([0.010, 0.011, 0.012, 0.060])
    assert choose_frames(seen, count=4).frames == (0, 1, 2, 3)
    assert choose_frames(seen, count=3).frames == (1, 2, 3)
    assert choose_frames(seen, count=1).frames == (3,)
    assert "frames: expected at most the 4 frames at" in complaint(choose_frames, seen, None, 5)


# --- load curves ---
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


def test_the_source_says_which_columns_were_read(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Crosshead (mm),Extension (mm),Load (N)\n0,0,1\n2,1,5\n")
    for options in ({}, {"format": "text"}):
        (one,) = read_load_curves(path, direction="warp", **options)
        assert one.elongation.tolist() == [0.0, 1.0]
        assert one.source is not None and one.source.format == "text"
        assert one.source.columns == {"elongation": "Extension (mm)", "load": "Load (N)"}
        assert one.source.units == {"elongation": "mm", "load": "N"}


@pytest.mark.parametrize(
    ("head", "options", "words"),
    [
        ("Load (N),Extension (mm),Force (N)", {}, "may be 'Load (N)' or 'Force (N)'"),
        ("Load (N),Extension (in),q", {}, "column 'Extension (in)': unit 'in' is not one of mm"),
        ("Load (N),Extension (cm),q", {"length_unit": "mm"}, "says 'cm', length_unit says"),
        ("Load,Extension (cm),q", {}, "column 'Load': the file does not name the unit"),
    ],
)
def test_columns_that_cannot_be_told(tmp_path, head, options, words):
    path = tmp_path / "a.csv"
    path.write_text(f"{head}\n0,0,1\n2,1,5\n")
    said = complaint(read_load_curves, path, direction="warp", **options)
    assert said.startswith(f"{path}: line 1") and words in said


# --- bending, surfaces, clocks ---
def test_a_zero_by_the_first_four_readings(tmp_path):
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
        assert "line 2: the first readings of" in complaint(read_bending_curves, path, zero="line")


def test_surfaces_that_cannot_be(tmp_path):
    points = np.random.default_rng(1).uniform(-50, 50, (4, 2))
    field = DisplacementField(0.02, points, np.column_stack([points, points[:, 0] * points[:, 1]]))
    found = fit_surface(field, 1)  # four coefficients through four points
    np.testing.assert_allclose(found.evaluate(points), field.displacement, atol=1e-9)
    assert complaint(fit_surface, DisplacementField(0.02, points[:3], np.zeros((3, 3))), 1) == (
        "surface of degree 1 at 20 kPa: 4 coefficients need as many points, there are 3; lower "
        "the degree"
    )
    line = DisplacementField(0.02, np.tile(points[:2], (4, 1)), np.zeros((8, 3)))
    assert "surface of degree 1 at 20 kPa: the 8 points lie so" in complaint(fit_surface, line, 1)
    for degree in (-1, 99):
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


def test_rising_functions_that_are_known():
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


def test_offsets_are_half_a_frame_apart_and_finer_about_the_best():
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
    assert "the log lasts 39.5 s, the frames 81 s; are the units of time and the rate" in said
