"""A project whose frames are chosen by the pressures at which they were recorded."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.bubble import report
from bubblefit.experiments.bubble.findings import recorded_lines, recorded_numbers
from bubblefit.experiments.bubble.point_files import RecordedFrames
from bubblefit.experiments.bubble.prepared import prepare
from bubblefit.experiments.bubble.report import clock_pictures, recorded_table
from bubblefit.experiments.kinds import Output, files_of
from bubblefit.project.project import project_text, read_project, settings_of
from bubblefit.readers.pressure_log import ClockOffset

from ...complaints import complaint, complaint_with
from ...dic_exports import pyaldic
from ...drawings import caught

#: kPa, a picture each; the last is of the release.
LEVELS = np.array([0.0, 0, 0, 10, 10, 10, 21, 21, 21, 33, 33, 33, 60, 60, 60, 12, 12.0])
PROJECT = """
[fabric]
name = "made up"
thickness = 0.8
[[bubble]]
radius = 100.0
elements = 48
{pressures}
[bubble.data.points]
{files}
{pressure}
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.02, 1.0]
G12 = [0.001, 0.2]
"""
POINTS = 'files = ["frames/*.csv"]\nfolder = "data"'
LOG = """[bubble.data.points.pressure]
{more}
[bubble.data.points.pressure.log]
file = "valve.csv"
pressure = {{ unit = "kPa", scale = 100.0 }}
rate = 0.5
"""
#: s, the log's clock less the camera's.
AHEAD = 41.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """data/frames/p1_0kPa.csv ..., data/valve.csv in volts."""
    home = tmp_path_factory.mktemp("recorded")
    (home / "data" / "frames").mkdir(parents=True)
    x, y = (one.ravel() for one in np.meshgrid(*2 * [np.linspace(-70, 70, 9)]))
    draw = np.random.default_rng(5)
    for k, level in enumerate(LEVELS):
        up = 40 * (level / 60) ** (1 / 3) * (1 - (x**2 + y**2) / 1e4)
        moved = [draw.normal(0, 0.01, len(x)) for _ in range(3)]
        table = np.column_stack([x, y, moved[0], moved[1], up + moved[2], 0 * x + level / 100])
        # Without zeros in front: picture 10 comes after picture 9.
        path = home / "data" / "frames" / f"p{k + 1}_{level:g}kPa.csv"
        np.savetxt(path, table, "%.6g", ",", header="x,y,dx,dy,dz,p [bar]", comments="")
    clock = np.arange(-20.0, 50.0, 0.25)
    volts = np.interp(clock, 2.0 * np.arange(len(LEVELS)), LEVELS) / 100
    table = np.column_stack([clock + AHEAD, volts])
    np.savetxt(
        home / "data" / "valve.csv", table, "%.6g", ",", header="time (s),p (V)", comments=""
    )
    return home


def pictures(folder: Path) -> list[Path]:
    home = folder / "data" / "frames"
    return [home / f"p{k}_{level:g}kPa.csv" for k, level in enumerate(LEVELS, start=1)]


def project(folder: Path, pressure: str, asked: str = "", files: str = POINTS) -> Path:
    path = folder / "project.toml"
    pressures = f"pressures = {asked}" if asked else ""
    path.write_text(PROJECT.format(pressures=pressures, files=files, pressure=pressure))
    return path


def bubble(path: Path, need_data: bool = True):
    (test,) = read_project(path, need_data=need_data).tests.values()
    return test


def names(test) -> list[str]:
    return [file.name for file in test.data.files]


@pytest.mark.parametrize(
    "said", ["from_name = true", "from_name = '_(.+)kPa'\nunit = 'kPa'", "column = 'p'"]
)
def test_the_frames_nearest_to_the_pressures(folder, said):
    section = f"[bubble.data.points.pressure]\n{said}\n"
    test = bubble(project(folder, section, "[10.5, 60]"))
    assert names(test) == ["p4_10kPa.csv", "p13_60kPa.csv"]
    assert test.pressures == pytest.approx([0.010, 0.060])
    assert set(test.pressures) <= set(test.increments)
    fields = prepare(test, None, None).fields
    assert [f.pressure for f in fields] == list(test.pressures)
    assert [f.path.name for f in fields] == names(test)
    (line,) = recorded_lines(test.data.recorded)
    assert "2 of 17 frames taken, 3 at no pressure" in line
    assert line.endswith("farthest from the pressure asked for: 10 in place of 10.5 kPa")
    table = recorded_table(test.data.recorded)
    assert table.header[1:4] == ["pressure, kPa", "asked for, kPa", "farther by, kPa"]
    assert table.rows[0][1:] == pytest.approx([10.0, 10.5, -0.5])


def test_a_tolerance_is_in_the_unit_of_the_pressures(folder):
    def taken(tolerance):
        said = f"[bubble.data.points.pressure]\nfrom_name = true\ntolerance = {tolerance}\n"
        return bubble(project(folder, said, "[10.5, 60]")).pressures

    assert taken(0.51) == pytest.approx([0.010, 0.060])
    said = complaint(taken, 0.49)
    assert "bubble[0].pressures[0]" in said and "10.5" in said


def test_all_frames_and_some(folder):
    section = "[bubble.data.points.pressure]\nfrom_name = true\n"
    test = bubble(project(folder, section))
    assert test.pressures == pytest.approx([0.010, 0.012, 0.021, 0.033, 0.060])
    test = bubble(project(folder, section + "frames = 2\n"))
    assert test.pressures == pytest.approx([0.033, 0.060])
    assert recorded_numbers(test.data.recorded)["left_out"] == {
        "at no pressure": 3,
        "at a pressure that another frame has": 9,
    }


def test_the_log_is_in_the_record_of_a_run(folder, tmp_path):
    (folder / "beside.csv").write_bytes((folder / "data" / "valve.csv").read_bytes())
    text = LOG.format(more="").replace("valve.csv", "beside.csv")
    found = read_project(project(folder, text, "[10, 60]"))
    (test,) = found.tests.values()
    *frames, log = files_of(prepare(test, None, None))
    assert [file.path.name for file in frames] == names(test)
    assert log.path == folder / "beside.csv" and log.source.format == "log" and log.used is None
    again = tmp_path / "again.toml"
    again.write_text(project_text(settings_of(found, [test.name])))
    assert bubble(again).pressures == test.pressures


def test_a_log_in_volts_with_a_clock_of_its_own(folder, tmp_path):
    test = bubble(project(folder, LOG.format(more="tolerance = 2"), "[10, 22, 34, 60]"))
    taken = test.data.recorded
    assert test.pressures == pytest.approx([0.010, 0.021, 0.033, 0.060], rel=0.01)
    assert taken.clock.lower <= AHEAD <= taken.clock.upper
    assert taken.clock.offset == pytest.approx(AHEAD, abs=1.0)
    numbers = recorded_numbers(taken)
    assert numbers["from"] == "the log valve.csv" and numbers["frames"] == 17
    assert numbers["left_out"]["after the largest pressure"] >= 2
    assert numbers["clock"]["how"] == "found by the apex heights"
    assert numbers["clock"]["between_s"] == [taken.clock.lower, taken.clock.upper]
    assert numbers["taken"][1]["asked_kPa"] == pytest.approx(22.0)
    # What the clocks leave open of each frame's own pressure, not of another's.
    each = {file.name: 1e3 * d for file, d in zip(pictures(folder), taken.clock.doubt, strict=True)}
    for row in numbers["taken"]:
        assert row["uncertain_kPa"] == pytest.approx(each[row["frame"]])
    mean = f"uncertain by {np.mean([*each.values()]):.2g} kPa on average"
    first, second = recorded_lines(taken)
    assert first.startswith("pressures from the log valve.csv: 4 of 17 frames taken")
    assert f"{taken.clock.offset:.2f} s, found by the apex heights" in second
    assert second.endswith(mean)
    table = recorded_table(taken)
    assert table.header[-1] == "uncertain by the clocks, +- kPa" and second in table.note
    ((name, caption),) = clock_pictures(taken, Output(tmp_path))
    assert (tmp_path / name).stat().st_size > 20_000 and "by one clock" in caption
    # Given, nothing is looked for.
    given = bubble(project(folder, LOG.format(more="") + f"offset = {AHEAD}\n"))
    assert given.data.recorded.clock.misfit is None
    assert recorded_lines(given.data.recorded)[1].endswith(" 41.00 s, given")
    assert "between_s" in recorded_numbers(given.data.recorded)["clock"]


def test_times_of_frames_from_a_table_or_the_names(folder):
    (folder / "data" / "camera.csv").write_text(
        "picture,time (ms)\n" + "".join(f"{k},{2000 * k}\n" for k in range(len(LEVELS)))
    )
    numbered = LOG.format(more="") + "time_in_name = 'p(\\d+)_'\n"
    table = LOG.format(more="").replace("rate = 0.5", "times = 'camera.csv'")
    by_rate = bubble(project(folder, LOG.format(more=""))).data.recorded.clock
    by_table = bubble(project(folder, table)).data.recorded.clock
    by_number = bubble(project(folder, numbered)).data.recorded.clock
    assert by_table.offset == pytest.approx(by_rate.offset)
    # The first picture is number 1: its clock is a picture behind.
    assert by_number.offset == pytest.approx(by_rate.offset - 2.0)


def test_one_file_with_all_frames(folder, tmp_path):
    (tmp_path / "data").mkdir()
    shutil.copy(folder / "data" / "valve.csv", tmp_path / "data")
    files = sorted(
        (folder / "data" / "frames").iterdir(), key=lambda f: int(f.name[1:].split("_")[0])
    )
    tables = [np.loadtxt(file, delimiter=",", skiprows=1) for file in files]
    frames = [(np.column_stack([t[:, :2], 0 * t[:, 0]]), t[:, 2:5]) for t in tables[1:]]
    (path,) = pyaldic(tmp_path / "data", frames)
    named = f'files = ["{path.name}"]\nfolder = "data"'
    test = bubble(project(tmp_path, LOG.format(more=""), "[10, 60]", named))
    taken = test.data.recorded
    # Of the frame at rest that the format adds, and of the 16 of the film.
    assert taken.count == 17 and taken.clock.offset == pytest.approx(AHEAD, abs=1.0)
    assert taken.names[0].startswith(f"{path.name}, frame ")
    low, high = prepare(test, None, None).fields
    assert [low.pressure, high.pressure] == list(test.pressures)
    number = [int(name.split()[-1]) - 1 for name in taken.names]
    assert LEVELS[number] == pytest.approx([10, 60])
    np.testing.assert_allclose(high.displacement, tables[number[1]][:, 2:5], atol=1e-9)
    path.rename(tmp_path / "data" / "all_60kPa.npz")
    section = "[bubble.data.points.pressure]\nfrom_name = true\n"
    test = bubble(project(tmp_path, section, "", named.replace(path.name, "all_60kPa.npz")))
    assert "one frame for each of 1 pressures, found 17" in complaint(prepare, test, None, None)


def test_a_simulation_needs_no_frames(folder, tmp_path):
    section = "[bubble.data.points.pressure]\nfrom_name = true\n"
    text = project(folder, section, "[10.5, 60]").read_text()
    (tmp_path / "project.toml").write_text(text)
    test = bubble(tmp_path / "project.toml", need_data=False)
    assert test.pressures == pytest.approx([0.0105, 0.060]) and test.data.files == ()


@pytest.mark.parametrize(
    ("section", "asked", "words"),
    [
        ("", "", ["bubble[0].pressures", "missing", "[bubble.data.points.pressure]"]),
        ("", "[10, 20]", ["data.points.files", "2 pressures, got 17", "points.pressure"]),
        ("from_name = true\ncolumn = 'p'", "", ["points.pressure", "exactly one"]),
        ("frames = 3", "", ["points.pressure", "exactly one"]),
        ("from_name = true\nframes = 3", "[10]", ["pressure.frames", "means nothing"]),
        ("from_name = true\ntolerance = 3", "", ["pressure.tolerance", "means nothing"]),
        ("from_name = true\nframes = 30", "", ["pressure.frames", "5 frames", "got 30"]),
        ("from_name = true", "[10, 42, 60]", ["bubble[0].pressures[1]", "within 1.2 kPa of 42"]),
        ("from_name = '(a)(b)'", "", ["pressure.from_name", "one group"]),
        ("from_name = 'q(.)'", "", ["p1_0kPa.csv", "from_name", "does not fit"]),
        ("column = 'q'", "", ["p1_0kPa.csv", "neither a column 'q'"]),
        ("column = 'p'\nunit = 'kPa'", "", ["p1_0kPa.csv", "'bar'", "'kPa'", "correct"]),
        ("from_name = true\nscale = 2", "", ["pressure.scale", "of a 'column'"]),
    ],
)
def test_bad_input_names_file_and_field(folder, section, asked, words):
    section = f"[bubble.data.points.pressure]\n{section}\n" if section else ""
    complaint_with(words, read_project, project(folder, section, asked))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("valve.csv", "nowhere.csv", ["pressure.log.file", "no file", "nowhere.csv"]),
        ("rate = 0.5", "", ["pressure.log", "one of 'rate', 'times' and 'time_in_name'"]),
        ("rate = 0.5", "rate = 0.01", ["pressure.log", "the log lasts", "the rate right?"]),
        ("rate = 0.5", "rate = 0.5\noffset = 1e6", ["pressure.log.offset", "within the log"]),
        ("rate = 0.5", "times = 'valve.csv'", ["valve.csv", "17 frames, got 280"]),
        ("rate = 0.5", "rate = 0.5\ntimes_column = 't'", ["log.times_column", "without 'times'"]),
        ("rate = 0.5", "time_in_name = true", ["p1_0kPa.csv", "time_in_name", "found none"]),
        (', scale = 100.0', "", ["valve.csv", "'V'", "'kPa'"]),
        ("frames/*", "frames/q*", ["data.points.files", "no file matches", "--data DIR"]),
    ],
)  # fmt: skip
def test_bad_logs_name_file_and_field(folder, old, new, words):
    path = project(folder, LOG.format(more=""))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    complaint_with(words, read_project, path)


#: Of all five frames of the film, MPa; the first of them is before the log begins.
DOUBT = np.array([np.nan, 0.0002, 0.0004, 0.0006, 0.0008])
CLOCK = ClockOffset(
    offset=41.254, lower=40.996, upper=41.504, misfit=0.00234,
    pressure=np.array([np.nan, 0.01, 0.021, 0.033, 0.06]), doubt=DOUBT,
    times=np.arange(5.0), heights=np.array([0.0, 10.0, 20.0, 30.0, 40.0]),
)  # fmt: skip
TAKEN = RecordedFrames(
    files=(Path("a.csv"), Path("b.csv")), frames=None, names=("a.csv", "b.csv"),
    pressure=np.array([0.021, 0.06]), asked=np.array([0.0215, 0.0598]), source="the log valve.csv",
    count=5, left_out={"at no pressure": 1, "before the log": 2}, doubt=DOUBT[[2, 4]], clock=CLOCK,
)  # fmt: skip
#: Without a log, and of what frames there are.
PLAIN = replace(TAKEN, asked=None, doubt=None, clock=None, left_out={}, source="the files' names")


def test_numbers_for_result_json():
    found = recorded_numbers(TAKEN)
    rows = [
        {"frame": "a.csv", "pressure_kPa": 21.0, "asked_kPa": 21.5, "uncertain_kPa": 0.4},
        {"frame": "b.csv", "pressure_kPa": 60.0, "asked_kPa": 59.8, "uncertain_kPa": 0.8},
    ]
    assert found.pop("taken") == [pytest.approx(row) for row in rows]
    assert found == {
        "from": "the log valve.csv", "frames": 5,
        "left_out": {"at no pressure": 1, "before the log": 2},
        "clock": {
            "offset_s": 41.254, "between_s": [40.996, 41.504], "misfit": 0.00234,
            "how": "found by the apex heights",
        },
    }  # fmt: skip
    given = recorded_numbers(replace(TAKEN, clock=replace(CLOCK, misfit=None)))["clock"]
    assert (given["misfit"], given["how"]) == (None, "given")
    plain = recorded_numbers(PLAIN)
    assert plain["taken"][1] == pytest.approx({"frame": "b.csv", "pressure_kPa": 60.0})
    assert "clock" not in plain


def test_lines_for_the_terminal():
    first, second = recorded_lines(TAKEN)
    assert "2 of 5 frames" in first and "21 in place of 21.5 kPa" in first
    for number in ("41.25 s", "41.00 and 41.50 s", "0.0023", "0.5 kPa"):
        assert number in second
    (_, given) = recorded_lines(replace(TAKEN, clock=replace(CLOCK, misfit=None)))
    assert given.endswith("41.25 s, given")
    (plain,) = recorded_lines(PLAIN)
    assert "2 of 5 frames" in plain


def test_the_table_of_frames():
    table = recorded_table(TAKEN)
    assert [row[0] for row in table.rows] == ["a.csv", "b.csv"]
    assert table.rows[0][1:] == pytest.approx([21.0, 21.5, -0.5, 0.4])
    assert table.rows[1][1:] == pytest.approx([60.0, 59.8, 0.2, 0.8])
    # Where the offset was given, the clocks leave nothing open.
    given = recorded_table(replace(TAKEN, asked=None, clock=replace(CLOCK, misfit=None)))
    assert given.header == ["frame", "pressure, kPa"]
    plain = recorded_table(PLAIN)
    assert plain.rows == [["a.csv", pytest.approx(21.0)], ["b.csv", pytest.approx(60.0)]]


def test_pressures_and_heights_are_drawn_by_the_clock_of_the_log(tmp_path, monkeypatch):
    drawn = caught(monkeypatch, report, "clock_charts")
    assert clock_pictures(PLAIN, Output(tmp_path)) == [] == drawn
    clock_pictures(TAKEN, Output(tmp_path))
    ((path, times, pressure, heights, taken),) = drawn
    assert path == tmp_path / "clock.png"
    assert times == pytest.approx([41.254, 42.254, 43.254, 44.254, 45.254])
    assert pressure is CLOCK.pressure and heights is CLOCK.heights and taken is TAKEN.pressure
