"""Field: what public issues and questions report, one case each; sources in README.md here."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.curves import read_load_curves
from bubblefit.readers.fields import read_fields
from bubblefit.readers.histories import read_pressure_log

from ..builders.bubbles import doubts_by_name, for_each_field, noisy, with_clamp
from ..support.refusals import complaint

PLACES = np.array([[10.0, 10], [50, 10], [10, 50], [50, 50], [30, 30], [20, 40]])
HEADINGS = "x [mm],y [mm],z [mm],dx [mm],dy [mm],dz [mm]"
ROWS = [f"{x},{y},0.5,0.1,0.2,0.3" for x, y in PLACES]


def table(heading=HEADINGS, rows=None, end="\n"):
    return end.join([heading, *(ROWS if rows is None else rows)]) + end


def with_row(row):
    return [*ROWS[:2], row, *ROWS[3:]]


def written(folder, text, encoding="utf-8", name="frame.csv"):
    path = Path(folder) / name
    path.write_bytes(text.encode(encoding))
    return path


GERMAN = [row.replace(",", ";").replace(".", ",") for row in ROWS]
#: Frames that are read as they are meant: text, encoding, number of rows left out.
READ = {
    "byte order mark": (table(), "utf-8-sig", 0),
    "quoted headings after a mark": (
        table(",".join(f'"{name}"' for name in HEADINGS.split(","))),
        "utf-8-sig",
        0,
    ),
    "utf-16": (table(), "utf-16", 0),
    "trailing separators": (table(HEADINGS + ",", [row + "," for row in ROWS]), "utf-8", 0),
    "trailing separators of rows": (table(rows=[row + "," for row in ROWS]), "utf-8", 0),
    "column of row numbers": (
        table("Unnamed: 0," + HEADINGS, [f"{k},{row}" for k, row in enumerate(ROWS)]),
        "utf-8",
        0,
    ),
    "decimal commas": (table(HEADINGS.replace(",", ";"), GERMAN), "utf-8", 0),
    "carriage returns": (table(end="\r"), "utf-8", 0),
    "words for no value": (table(rows=with_row("10,50,0.5,nan,NaN,NaN")), "utf-8", 1),
    "spreadsheet's no value": (table(rows=with_row("10,50,0.5,1,2,#N/A")), "utf-8", 1),
    "cut in the last row": (table()[:-9] + "\n", "utf-8", 1),
}


@pytest.mark.parametrize("report", READ)
def test_frame_is_read_as_it_is_meant(report, tmp_path):
    text, encoding, left_out = READ[report]
    (field,) = read_fields([written(tmp_path, text, encoding)], [0.1])
    assert sum(field.dropped.values()) == left_out
    assert len(field.points) == len(PLACES) - left_out
    assert field.points[0] == pytest.approx(PLACES[0])
    assert field.displacement[0] == pytest.approx([0.1, 0.2, 0.3])


def test_inches_and_metres_in_headings_are_turned_to_mm(tmp_path):
    in_inches = written(tmp_path, table(HEADINGS.replace("mm", "in")))
    (field,) = read_fields([in_inches], [0.1])
    assert field.points == pytest.approx(25.4 * PLACES)
    mixed = written(tmp_path, table(HEADINGS.replace("dx [mm]", "dx [m]")))
    (field,) = read_fields([mixed], [0.1])
    assert field.displacement[0] == pytest.approx([100.0, 0.2, 0.3])


DICE = "SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA,GAMMA,BETA,SSSIG"
PYVALE = "ss_x,ss_y,u,v,m,converged,cost,ftol,xtol,niter"
CONFLICT = ["<<<<<<< HEAD", *ROWS, "=======", *ROWS, ">>>>>>> b"]
#: Frames that are refused: text and words of the message.
REFUSED = {
    "planar DICe": (table(DICE, ["0,25,190,1.5,1.3,0.002,0.14,0.17,0"]), "planar and in pixels"),
    "pyvale": (table(PYVALE, ["10,10,0.5,0.1,0.5,1,0.9,1e-6,1e-6,8"]), "column 'x'"),
    "pixels": (table(HEADINGS.replace("mm", "px")), "is in pixels"),
    "decimal and separating commas": (
        table(rows=[",".join(v.replace(".", ",") for v in row.split(",")) for row in ROWS]),
        "decimal commas need another separator",
    ),
    "infinity": (table(rows=with_row("10,50,0.5,inf,0.2,0.3")), "found 'inf'"),
    "exponents of Fortran": (table(rows=with_row("10,50,0.5,1.0D-01,1,1")), "found '1.0D-01'"),
    "typographic minus": (table(rows=with_row("\u221210,50,0.5,1,1,1")), "found '\u221210'"),
    "two tables in one file": (table() + table(), "found 'x [mm]'"),
    "conflict of versions": (table(rows=CONFLICT), "found '<<<<<<< HEAD'"),
    "pointer to a large file": (
        "version https://git-lfs.github.com/spec/v1\noid sha256:a\nsize 1\n",
        "version https://git-lfs",
    ),
    "page of an error": ("<!DOCTYPE html><html>404</html>", "only a header line"),
    "headings alone": (table(rows=[]), "only a header line"),
    "empty file": ("", "found nothing"),
    "no headings": ("\n".join(ROWS), "name them with columns"),
    "zero bytes": (table() + "\0" * 40, "is not a text file"),
}


@pytest.mark.parametrize("report", REFUSED)
def test_frame_is_refused_with_its_reason(report, tmp_path):
    text, words = REFUSED[report]
    assert words in complaint(read_fields, [written(tmp_path, text)], [0.1])


ELONGATION = np.linspace(0.0, 5.0, 21)
LOAD = 640.0 * ELONGATION


def curve_table(heading, elongation, load, separator=","):
    rows = [f"{u:.7g}{separator}{f:.7g}" for u, f in zip(elongation, load, strict=True)]
    return "\n".join([heading, *rows]) + "\n"


ABOVE = "date : 01-02-1900\nuser : bob\nlength : .5\nremarks : awsome\n\n"
CURVES = {
    "lines above the headings": ABOVE
    + curve_table("elongation (mm);load (N)", ELONGATION, LOAD, ";"),
    "sep= of a spreadsheet": "sep=;\n"
    + curve_table("Extension (mm);Load (N)", ELONGATION, LOAD, ";"),
    "inches and lbf": curve_table("Extension (in),Load (lbf)", ELONGATION / 25.4, LOAD / 4.4482216),
    "kgf": curve_table("Extension (mm),Load (kgf)", ELONGATION, LOAD / 9.80665),
    "rows of statistics": curve_table("Extension (mm),Load (N)", ELONGATION, LOAD)
    + "\nMaximum,3200\nMean,1600\n",
}


@pytest.mark.parametrize("report", CURVES)
def test_curve_is_read_in_mm_and_newton(report, tmp_path):
    (curve,) = read_load_curves(written(tmp_path, CURVES[report]), direction="warp")
    assert curve.elongation == pytest.approx(ELONGATION, abs=1e-5)
    assert curve.load == pytest.approx(LOAD, rel=1e-4)


@pytest.mark.parametrize(
    ("heading", "words"),
    [
        ("Extension (mm),Load (mV)", "a sensor in volts needs scale and unit"),
        ("Extension,Load", "say length_unit"),
        ("Strain (%),Stress (MPa)", "no column of load"),
    ],
)
def test_curve_without_a_usable_unit_asks_for_it(heading, words, tmp_path):
    path = written(tmp_path, curve_table(heading, ELONGATION, LOAD))
    assert words in complaint(read_load_curves, path, direction="warp")


HOURS = "time,p [kPa]\n2016-11-06 01:59:58,1\n2016-11-06 01:59:59,2\n2016-11-06 01:00:00,3\n"
MILLISECONDS = "Time Code [ms];p [mbar]\n1700000000000;0\n1700000000500;10\n1700000001000;20\n"


def test_clock_set_back_to_winter_time_is_refused(tmp_path):
    assert "times must not go back" in complaint(read_pressure_log, written(tmp_path, HOURS))


def test_milliseconds_since_1970_are_read_as_seconds(tmp_path):
    times, pressures = read_pressure_log(written(tmp_path, MILLISECONDS))
    assert np.diff(times) == pytest.approx([0.5, 0.5])
    assert pressures == pytest.approx([0.0, 0.001, 0.002])


@pytest.mark.parametrize("unit", ["inH2O", "V"])
def test_units_of_a_log_that_are_not_known_are_refused(unit, tmp_path):
    text = f"t [s],p [{unit}]\n0,0\n1,1\n2,2\n"
    assert f"unit '{unit}' is not one of" in complaint(read_pressure_log, written(tmp_path, text))


def test_hour_of_twelve_is_noon(tmp_path):
    text = "time,p [kPa]\n11:59:59 AM,1\n12:00:00 PM,2\n12:00:01 PM,3\n"
    times, _ = read_pressure_log(written(tmp_path, text))
    assert np.diff(times) == pytest.approx([1.0, 1.0])


# Bubbles ----------------------------------------------------------------------------------------


def with_displacement(change):
    return lambda field: replace(field, displacement=change(field.displacement))


def stripe(field):
    displacement = field.displacement.copy()
    displacement[np.abs(field.points[:, 0] - field.points[:, 1]) < 4.0, 2] += 3.0
    return replace(field, displacement=displacement)


def filled(value):
    def change(displacement):
        displacement = displacement.copy()
        displacement[[5, 77]] = value
        return displacement

    return with_displacement(change)


def doubled(field):
    return replace(
        field,
        points=np.tile(field.points, (2, 1)),
        displacement=np.tile(field.displacement, (2, 1)),
        z=None,
    )


def shuffled(displacement):
    return np.random.default_rng(1).permutation(displacement)


def shifted_once(fields):
    shifted = with_displacement(lambda displacement: displacement + np.array([2.0, 0.0, 0.0]))
    return (*fields[:2], shifted(fields[2]), fields[3])


def in_alphabetical_order(fields):
    pressures = [field.pressure for field in fields]
    order = [fields[number] for number in (3, 0, 1, 2)]
    return tuple(
        replace(field, pressure=pressure) for field, pressure in zip(order, pressures, strict=True)
    )


def from_frame_to_frame(fields):
    steps = [
        replace(field, displacement=field.displacement - previous.displacement)
        for previous, field in pairwise(fields)
    ]
    return (fields[0], *steps)


def at_scale(factor):
    return lambda f: replace(f, points=factor * f.points, displacement=factor * f.displacement)


#: Faults of a bubble: change of the frames, name of the doubt, whether it is an error, words.
BUBBLES = {
    "stripe of bad points": (for_each_field(stripe), "outliers", False, "lie up to 3"),
    "99 for no value": (for_each_field(filled(99.0)), "outliers", False, "2 of "),
    "-9999 for no value": (for_each_field(filled(-9999.0)), "outliers", False, "2 of "),
    "1e30 for no value": (for_each_field(filled(1e30)), "outliers", False, "1e+30 mm"),
    "rows shuffled": (
        for_each_field(with_displacement(shuffled)),
        "outliers",
        True,
        "belong to the same points",
    ),
    "points twice": (for_each_field(doubled), "repeated-points", False, "given twice"),
    "camera pushed in one frame": (shifted_once, "moving-edge", False, "moves by 2, "),
    "heights for rises": (
        for_each_field(with_displacement(lambda d: d + np.array([0.0, 0.0, 25.0]))),
        "moving-edge",
        False,
        "dz is a height",
    ),
    "frame_10 before frame_2": (in_alphabetical_order, "frame-order", True, "not in the order"),
    "displacements from frame to frame": (from_frame_to_frame, "frame-order", True, "sinks"),
    "spacing of 1 for 1.563 mm": (
        for_each_field(at_scale(1 / 1.563)),
        "strain-rise",
        False,
        "calls for",
    ),
    "z away from the camera": (
        for_each_field(with_displacement(lambda d: d * [1.0, 1.0, -1.0])),
        "z-flipped",
        True,
        "z is flipped",
    ),
    "dx and dy in pixels": (
        for_each_field(with_displacement(lambda d: d * [10.0, 10.0, 1.0])),
        "strain-rise",
        True,
        "calls for",
    ),
    "rest picture as first frame": (
        lambda fields: (with_displacement(lambda d: 0 * d)(fields[0]), *fields[1:]),
        "rest-frame",
        True,
        "taken at rest",
    ),
}


@pytest.mark.parametrize("report", BUBBLES)
def test_bubble_of_a_report_is_doubted(clean_bubble, report):
    change, name, sure, words = BUBBLES[report]
    found = doubts_by_name(change(noisy(clean_bubble, 0.02)))
    assert found[name].sure == sure and words in found[name].text, found


def test_bubble_with_its_clamp_or_seen_from_behind_raises_no_doubt(clean_bubble):
    fields = noisy(clean_bubble, 0.02)
    mirrored = for_each_field(
        lambda f: replace(f, points=f.points * [-1, 1], displacement=f.displacement * [-1, 1, 1])
    )
    assert not doubts_by_name(mirrored(fields))
    assert not doubts_by_name(with_clamp(clean_bubble))
