"""readers/machine_tables.py: quantities of machine tables and logs in mm, N, MPa and s."""

from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers.histories import read_history, read_pressure_log
from bubblefit.readers.machine_tables import Channel, in_unit, read_machine_loads, read_times
from bubblefit.readers.units import PRESSURE_UNITS

from ..support.refusals import complaint, complaint_with
from .cases import read_export, written_file


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
def test_readings_of_a_sensor_are_scaled_to_their_unit(own, channel, expected):
    def read():
        channels = np.array([2.0]), own, Channel(**channel), PRESSURE_UNITS, Path("a.csv"), "here"
        return in_unit(*channels)[0]

    if isinstance(expected, float):
        assert read() == pytest.approx(expected)
    else:
        assert complaint(read).startswith(f"a.csv: here: {expected}")


def test_log_in_volts_is_scaled(tmp_path):
    """Festo SPTE-P10R: 0 V at 0 kPa, 10 V at 1,000 kPa (Appendix B); a volt may be a unit."""
    path = written_file(tmp_path, "Zeit (min);U_p (V)\n0;0\n1;0,355\n2;10\n")
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
        ("t,p (kPa)\n0,1\n1,2\n", {}, ["no column of time in the header row", "has: t, p"]),
        ("time,p\n0,1\n1,2\n", {}, ["line 1, column 'p'", "say the unit"]),
        ("time,p (V)\n0,1\n1,2\n", {"unit": "kPa"}, ["'V'", "'kPa'"]),
        ("time,p (kPa)\n0,1\n1,2\n", {"unit": "kPa", "scale": 100.0}, ["leave the scale"]),
        ("time,p (kPa)\n0,1\n2,2\n1,3\n0,3\n", {}, ["line 4, column 'time'", "go back"]),
        ("time,p (kPa)\n3,1\n3,2\n", {}, ["column 'time'", "two times"]),
        ("time (days),p (kPa)\n3,1\n4,2\n", {}, ["'days' is not one of s"]),
        ("time,p (kPa),Druck\n3,1,1\n4,2,2\n", {}, ["'p (kPa)' or 'Druck'", "columns"]),
    ],
)
def test_ambiguous_logs_are_refused(tmp_path, text, channel, words):
    path = written_file(tmp_path, text)
    complaint_with([str(path), *words], read_pressure_log, path, Channel(**channel))


@pytest.mark.parametrize(
    ("unit", "newton"),
    [
        ("kN/m", 25.0), ("N/mm", 25.0), ("N/m", 0.025), ("N/cm", 2.5), ("N/50mm", 0.5),
        ("N/5 cm", 0.5), ("daN/5cm", 5.0),
    ],
)  # fmt: skip
def test_loads_per_width_are_multiplied_by_the_width(export_file, unit, newton):
    for name in (f"Force [{unit}]", f"Force in {unit}"):
        text = f"Weg [mm];{name}\n0,5;2\n1,5;4,0\n"
        (curve,) = read_export(export_file, text, width=25.0)
        np.testing.assert_allclose(curve.load, [2 * newton, 4 * newton], rtol=1e-14)
    assert f"{unit.replace(' ', '')} is a load per width" in complaint(
        read_export, export_file, text
    )
    (curve,) = read_export(export_file, "Load,disp_mm\n2,1\n", load_unit="kN/m", width=50.0)
    assert curve.load == [100.0]


#: The clock of a log: the heading, two stamps, seconds since midnight of the first.
CLOCKS = [
    ("Zeitstempel", "12.03.2021 14:02:11,500", "12.03.2021 14:02:12,000", 50531.5, 50532.0),
    ("Timestamp", "2021-03-12T23:59:59.5Z", "2021-03-13T00:00:00.5Z", 86399.5, 86400.5),
    ("Time", "12:00:01 AM", "2:02:11 PM", 1.0, 50531.0), ("Uhrzeit", "23:59:59,5", "0:00:00,5",
     86399.5, 86400.5), ("Time", "2/28/2021 12:00:00 PM", "3/1/2021 12:00:00 PM", 43200, 129600),
    ("Zeit", "30.12.21 00:00:01", "01.01.22 00:00:01", 1, 172801),
]  # fmt: skip


@pytest.mark.parametrize(("name", "first", "second", "start", "end"), CLOCKS)
def test_clock_times_become_seconds(export_file, name, first, second, start, end):
    export_file.write_text(f"{name};Load [N];Druck [bar]\n{first};1,5;0,1\n{second};2;0,2\n")
    assert read_times(export_file).tolist() == [start, end]
    assert read_machine_loads(export_file, timed=True)[1].tolist() == [start, end]
    time, pressure = read_pressure_log(export_file)
    assert time.tolist() == [start, end] and pressure == pytest.approx([0.01, 0.02])
    export_file.write_text(export_file.read_text() + "14.2;1;0,3\n")
    assert f"line 4, column '{name}': expected a time" in complaint(read_times, export_file)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("t_sek;Prüfzeit\n;s\n0;1,5\n0;2\n", [1.5, 2.0]), ("Time (min)\n1\n2\n", [60.0, 120.0]),
        ("frame,time_ms\n0,1500\n1,1600.5\n", [1.5, 1.6005]),
        ("Running Time,Cycle time\n3,4\n", [3.0]),
        ("Time (d)\n1\n", "line 1, column 'Time (d)': unit 'd' is not one of s, sec, ms, min, h"),
        ("Time,Running time\n1,2\n", "the column of time may be 'Time' or 'Running time'"),
        ("Zeit/ms\n0\n100\n", [0.0, 0.1]), ("Time/min\n0\n1\n", [0.0, 60.0]),
        ("frame\n1\n", "no header row with the columns one of time"),
        ("time\n1\nx\n", "line 3, column 'time': expected a number, found 'x'"),
    ],
)  # fmt: skip
def test_times_are_read_in_their_unit(export_file, text, expected):
    export_file.write_text(text)
    if isinstance(expected, list):
        np.testing.assert_allclose(read_times(export_file), expected, rtol=1e-14)
    else:
        complaint_with([expected, str(export_file)], read_times, export_file)


def test_times_of_a_column_that_the_user_names_must_not_fall(export_file):
    export_file.write_text("Cycle time (s),Load (N),Strain (%)\n0,1,0\n1,2,1\n0,1,0\n1,3,2\n")
    assert read_history(export_file).time is None
    said = complaint(read_history, export_file, columns={"time": "Cycle time (s)"})
    assert "these times fall, as of a clock that restarts" in said


def test_loads_are_read_without_elongation(export_file):
    export_file.write_text("Time (min),Load (kN),Load rate (kN/s)\n0,1,7\n0.5,2,7\n")
    plain, timed = read_machine_loads(export_file), read_machine_loads(export_file, timed=True)
    assert plain[0].tolist() == [1000, 2000] and timed[1].tolist() == [0, 30]
    assert plain[1] is None
    export_file.write_text("Load (kN)\n1\n")
    said = complaint(read_machine_loads, export_file, timed=True)
    assert "no header row with the columns one of load and one of t" in said
