"""Pressures of frames, from files and from logs with clocks of their own."""

import re
from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.columns import PRESSURE_UNITS, TIME_UNITS, columns_of, split_unit
from bubblefit.readers.frames import Frame
from bubblefit.readers.machine_tables import Channel
from bubblefit.readers.names import check_pattern, number_in_name, value_in_file
from bubblefit.readers.pressure_log import (
    LogOptions,
    _rest_height,
    apex_height,
    find_offset,
    given_offset,
    log_at,
    offset_misfits,
    read_pressure_log,
)

from ..complaints import complaint

# --- pressures of files ---
POINTS = "x [mm];y [mm];dx [mm];dy [mm];dz [mm]"


def written(folder: Path, text: str) -> Path:
    path = folder / "made-up.csv"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("step_012_35.5kPa.csv", 0.0355), ("step_012_35,5_kPa.csv", 0.0355),
        ("run7-0.355bar-a.csv", 0.0355), ("12_355 mbar.txt", 0.0355), ("5.1489psi.csv", 0.0355),
        ("3mbar2.csv", 3e-4),
    ],
)  # fmt: skip
def test_a_number_with_its_unit_in_the_name(name, expected):
    assert number_in_name(Path(name), PRESSURE_UNITS) == pytest.approx(expected, rel=2e-5)


def test_a_pattern_says_where_the_number_is():
    path = Path("bubble_p0355_t12.csv")
    assert number_in_name(path, PRESSURE_UNITS, r"_p(\d+)_", "hPa") == pytest.approx(0.0355)
    assert number_in_name(path, TIME_UNITS, r"_t(\d+)\.") == 12.0
    assert number_in_name(Path("p3_7x.csv"), PRESSURE_UNITS, r"_(\d)") == 7.0
    assert check_pattern(r"_p(\d+)_") is None
    for pattern, words in (("(", "no regular expression"), ("(a)(b)", "has 2"), ("a", "has 0")):
        assert words in check_pattern(pattern)


@pytest.mark.parametrize(
    ("name", "units", "pattern", "words"),
    [
        ("12max.csv", PRESSURE_UNITS, None, ["found none", "pattern"]),
        ("p3_7x.csv", {"s": 1.0, "ms": 1e-3}, None, ["with its unit (s, ms)", "found none"]),
        ("10kPa_0.1bar.csv", PRESSURE_UNITS, None, ["10 kPa and 0.1 bar"]),
        ("1s_2ms", {"s": 1.0, "ms": 1e-3}, None, ["found 1 s and 2 ms"]),
        ("a.csv", PRESSURE_UNITS, r"p(\d+)", ["does not fit the pattern"]),
        ("px.csv", PRESSURE_UNITS, r"p(\w)", ["expected a number in the group", "'x'"]),
        ("p3.csv", PRESSURE_UNITS, "p(q)?", ["expected a number in the group", "None"]),
    ],
)
def test_names_without_one_number(name, units, pattern, words):
    unit = "kPa" if units is PRESSURE_UNITS else None
    said = complaint(number_in_name, Path(name), units, pattern, unit, "from_name")
    assert said.startswith(f"{name}: from_name: ") and all(word in said for word in words), said


@pytest.mark.parametrize(
    "text",
    [
        f"{POINTS};p [kPa]\n0;0;0;0;1;35,5\n1;0;0;0;1;35,5\n",
        f"{POINTS};p\nmm;mm;mm;mm;mm;bar\n0;0;0;0;1;0.355\n1;0;0;0;1;0.355\n",
        f"# p [kPa] = 35.5\n{POINTS}\n0;0;0;0;1\n",
        f"Title\np;35,5;kPa\n{POINTS}\n0;0;0;0;1\n",
        f"# test 1 p_bar=0.355000; x,y in mm\n# p = 0.355 bar\n{POINTS}\n0;0;0;0;1\n",
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;nan;nan;nan;\n",
        f"{POINTS};p [kPa]\n0;0;0;0;1;35.5\n1;0;0;0;1;n/a\n2;0;0;0;1;35.5\n",
        f"{POINTS};p\n;;;;;[kPa]\n0;0;0;0;1;35.5\n", f"{POINTS}\n0;0;0;0;1\np = 3.55e1 kPa\n",
        "p [kPa],q,r\n35.5,a,1\n35.5,b,2\n", "x p_kPa\n1 35.5\n", "# p_kPa = 35.5\nx;y\n1;2\n",
        "p [kPa]: 35,5\nx;y\n1;2\n", "p 35.5 kPa, and p 35.5 kPa again\n", "p (kPa) 355e-1\n",
    ],
)  # fmt: skip
def test_a_column_or_a_line_above_the_numbers(tmp_path, text):
    path = written(tmp_path, text)
    assert value_in_file(path, Channel("p"), PRESSURE_UNITS) == pytest.approx(0.0355)


NEITHER = ["neither a column 'p' nor a line"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{POINTS};p [kPa]\n0;0;0;0;1;35\n1;0;0;0;1;36\n", ["line 3, column 'p [kPa]'", "line 2"]),
        (f"{POINTS};p [kPa]\n0;0;0;0;1;3\n1;0;0;0;1;3\n1;0;0;0;1;4\n", ["line 4, column 'p ["]),
        (f"{POINTS};p\n0;0;0;0;1;35\n", ["line 1, column 'p'", "say the unit"]),
        (f"{POINTS};p [V]\n0;0;0;0;1;35\n", ["'V' is not one of", "volts"]),
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
    said = complaint(value_in_file, path, Channel("p"), PRESSURE_UNITS)
    assert all(word in said for word in [str(path), *words]), said


def test_a_log_in_volts_is_that_of_appendix_b(tmp_path):
    """Festo SPTE-P10R: 0 V at 0 kPa, 10 V at 1,000 kPa (Appendix B of the thesis)."""
    path = written(tmp_path, "Zeit (min);U_p (V)\n0;0\n1;0,355\n2;10\n")
    log = read_pressure_log(path, LogOptions(Channel("U_p", "kPa", 100.0)))
    assert log.pressure == pytest.approx([0.0, 0.0355, 1.0])
    assert log.time == pytest.approx([0.0, 60.0, 120.0])


def test_a_volt_may_be_a_unit(tmp_path):
    path = written(tmp_path, "t (s),p (V)\n0,1\n1,2\n")
    for scale, pressures in ((1.0, [0.05, 0.15]), (4.0, [0.35, 0.75])):
        log = read_pressure_log(path, LogOptions(Channel("p", "bar", scale, -0.5), Channel("t")))
        assert log.pressure == pytest.approx(pressures)


@pytest.mark.parametrize(
    ("text", "options", "words"),
    [
        ("t,p (kPa)\n0,1\n1,2\n", LogOptions(), ["no header row", "time"]),
        ("time,p\n0,1\n1,2\n", LogOptions(), ["line 1, column 'p'", "say the unit"]),
        ("time,p (V)\n0,1\n1,2\n", LogOptions(Channel(unit="kPa")), ["'V'", "'kPa'"]),
        ("time,p (kPa)\n0,1\n1,2\n", LogOptions(Channel("p", "kPa", 100.0)), ["leave the scale"]),
        ("time,p (kPa)\n0,1\n2,2\n1,3\n", LogOptions(), ["line 4, column 'time'", "go back"]),
        ("time,p (kPa)\n0,1\n2,2\n1,3\n0,3\n", LogOptions(), ["line 4, column 'time'"]),
        ("time,p (kPa)\n3,1\n3,2\n", LogOptions(), ["column 'time'", "two times"]),
        ("time (days),p (kPa)\n3,1\n4,2\n", LogOptions(), ["'days' is not one of s"]),
        ("time,p (kPa),Druck\n3,1,1\n4,2,2\n", LogOptions(), ["'p (kPa)' or 'Druck'", "columns"]),
    ],
)
def test_logs_that_cannot_be_told(tmp_path, text, options, words):
    path = written(tmp_path, text)
    said = complaint(read_pressure_log, path, options)
    assert all(word in said for word in [str(path), *words]), said


def test_columns_of_pressure():
    assert split_unit("p_kPa") == ("p", "kPa") and split_unit("Druck in mbar") == ("Druck", "mbar")
    names = ["Time", "Pressure (bar)", "Pressure rate (bar/s)", "Druck"]
    assert columns_of(names, "pressure", {}) == [1, 3]


def test_the_apex_is_what_moved_most_in_any_axes():
    r = np.linspace(0, 1, 2001)
    up = np.outer(50 * (1 - r), [0.6, 0.0, -0.8])
    up[7] = 900.0
    up[3] = np.nan
    frame = Frame(np.zeros_like(up), up)
    # 98 % of points evenly along a cone moved less than 98 % of its height.
    assert apex_height(frame) == pytest.approx(49.0, abs=0.1)
    assert np.isnan(apex_height(Frame(np.zeros((2, 3)), np.full((2, 3), np.nan))))


# --- clock offset ---
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
    """Times and heights of a frame a second, and the log, whose clock is `offset` ahead."""
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
def test_a_known_offset_is_found_within_what_is_said(history, law, offset, seed=3):
    """Of whatever law: nothing is supposed but that the sheet rises with the pressure."""
    data = recorded(history, law, offset, 5e-4, seed)
    found = find_offset(*data)
    assert found.lower <= offset <= found.upper
    assert found.upper - found.lower < 5.0 and abs(found.offset - offset) < 1.5
    assert 0 < found.misfit < 1e-3
    true = history(data[0])
    within = np.abs(found.pressure - true) <= found.doubt + 5 * 0.3 * 5e-4
    assert within.all() and np.mean(found.doubt) < 0.004


def test_steps_are_sharper_than_a_frame_between_two_pictures():
    found = find_offset(*recorded(steps, "flat", 37.3, 5e-4))
    assert found.offset == pytest.approx(37.3, abs=0.2)
    assert found.upper - found.lower < 1.0
    # On the holds the offset does not matter; between them it does.
    assert np.median(found.doubt) < 2e-4 < 5e-4 < found.doubt.max()


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_the_doubt_is_what_the_offsets_leave_open(noise):
    """On a steady rise of 1.67 kPa/s: half of the range of the offsets times that."""
    found = find_offset(*recorded(ramp, "flat", 37.3, noise))
    assert found.lower <= 37.3 <= found.upper
    assert found.offset == pytest.approx((found.lower + found.upper) / 2)
    middle = found.doubt[60:100]
    assert np.mean(middle) == pytest.approx(0.3 / 180 * (found.upper - found.lower) / 2, rel=0.15)


def test_frames_in_no_order_and_frames_without_a_height():
    times, heights, *log = recorded(steps, "flat", 37.3, 5e-4)
    order = np.random.default_rng(1).permutation(len(times))
    heights[[20, 21, 90]] = np.nan
    found = find_offset(times[order], heights[order], *log)
    assert found.offset == pytest.approx(37.3, abs=0.2)
    np.testing.assert_allclose(found.pressure, steps(times[order]), atol=0.012)
    assert np.isfinite(found.pressure[np.isnan(heights[order])]).all()


def test_frames_beyond_the_log_have_no_pressure():
    times, heights, clock, pressures = recorded(steps, "flat", 37.3, 5e-4, count=250)
    kept = clock < 37.3 + 220
    found = find_offset(times, heights, clock[kept], pressures[kept])
    assert found.offset == pytest.approx(37.3, abs=0.3)
    lost = np.isnan(found.pressure)
    assert lost.any() and (times[lost] > 219).all()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        # A steady rise that neither begins nor ends in the film.
        (dict(history=lambda t: 0.3 * (t + 60) / 380, law="taut", start=10.0), ["do as well"]),
        # Every hold alike, and the film between two of them: a step later does as well.
        (dict(history=steps, law="taut", start=40.0, count=100), ["do as well", "kPa on average"]),
        (dict(history=ramp, law="flat", count=5), ["5 frames are too few"]),
        (dict(history=ramp, law="flat", count=900), ["the log lasts 379.8 s, the frames 899 s"]),
    ],
)
def test_what_cannot_be_told_is_refused(change, words):
    said = complaint(find_offset, *recorded(offset=12.0, noise=5e-4, **change))
    assert all(word in said for word in ["offset" if "log" not in words[0] else "", *words]), said


def test_no_offset_is_looked_at_for_which_there_is_no_log():
    times, heights, clock, pressures = recorded(steps, "flat", 37.3, 5e-4, count=100)
    clock, pressures = clock[:646], pressures[:646]
    offsets, misfits = offset_misfits(times, heights, clock, pressures)
    assert len(offsets) == len(misfits) > 100 and (np.diff(offsets) >= 0).all()
    best = offsets[np.argmin(misfits)]
    assert offsets[-1] - best < 1.0
    ends = [np.isfinite(log_at(s, times, clock, pressures)).mean() for s in offsets]
    assert min(ends) >= 0.8 - 1e-9


def test_up_to_where_a_frame_is_at_rest():
    """Six standard deviations above the lowest, by second differences; a fiftieth of the most."""
    assert _rest_height(np.linspace(3.0, 60.0, 20)) == pytest.approx(1.2)
    assert _rest_height(np.linspace(0.0, 60.0, 20)) == pytest.approx(0.0, abs=1e-9)
    rough = np.arange(20.0) % 2  # second differences of 2, which noise of 1.21 makes
    assert _rest_height(np.append(rough, 900.0)) == pytest.approx(6 * 2 / 0.6745 / np.sqrt(6))
    assert _rest_height(np.append(rough, 90.0)) == pytest.approx(1.8)


def test_offsets_that_do_as_well_are_told_from_the_least_to_the_largest():
    times, log = np.arange(20.0), np.arange(0.0, 60.0, 0.5)
    said = complaint(find_offset, times, times + 5.0, log, 0.3 * log / 60)
    assert said.startswith("offset: cannot be found: offsets from ")
    numbers = [float(n) for n in re.findall(r"-?\d+\.\d\d", said)[:2]]
    assert numbers[0] < 0 < 30 < numbers[1]
    assert said.endswith(
        "kPa on average; give it in s. Where the pressure was held, released or began to rise "
        "while frames were taken, it can be found"
    )


def test_heights_of_another_test_are_refused():
    times, heights, *log = recorded(steps, "flat", 12.0, 5e-4)
    said = complaint(find_offset, times, np.roll(heights[::-1], 31), *log)
    assert "at no offset does the sheet rise with the pressure" in said


def test_an_offset_that_is_given_is_taken():
    times, heights, *log = recorded(ramp, "flat", 12.0, 0.0)
    found = given_offset(12.0, times, heights, *log)
    np.testing.assert_allclose(found.pressure, ramp(times), atol=1e-12)
    assert found.misfit is None and found.lower == found.upper == 12.0 and not found.doubt.any()
    said = complaint(given_offset, 1e5, times, heights, *log)
    assert "no frame lies within the log" in said and "from -48.00 to 331.80 s" in said
