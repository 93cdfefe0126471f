"""experiments/bubble/recorded_frames.py: frames by recorded pressures, doubts about a log."""

import shutil
from dataclasses import replace
from pathlib import Path

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble.findings import recorded_lines, recorded_numbers
from bubblefit.experiments.bubble.prepared import prepare
from bubblefit.experiments.bubble.recorded_frames import doubts_of_log, frame_times
from bubblefit.experiments.bubble.section import LogSection
from bubblefit.experiments.data_files import Output
from bubblefit.project.project import read_project
from bubblefit.readers.clock_offset import given_offset
from bubblefit.reports.kinds.bubble import clock_picture, recorded_table

from ...support.refusals import complaint, complaint_with
from .cases import PLACE

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
def frames_folder(tmp_path_factory):
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
    table, path = np.column_stack([clock + AHEAD, volts]), home / "data" / "valve.csv"
    np.savetxt(path, table, "%.6g", ",", header="time (s),p (V)", comments="")
    return home


def recorded_project(folder: Path, pressure: str, asked: str = "", files: str = POINTS) -> Path:
    path = folder / "project.toml"
    pressures = f"pressures = {asked}" if asked else ""
    path.write_text(PROJECT.format(pressures=pressures, files=files, pressure=pressure))
    return path


def recorded_bubble(path: Path, need_data: bool = True):
    (test,) = read_project(path, need_data=need_data).tests.values()
    return test


@pytest.mark.parametrize(
    "said", ["from_name = true", "from_name = '_(.+)kPa'\nunit = 'kPa'", "column = 'p'"]
)
def test_frames_nearest_to_the_pressures_are_taken(frames_folder, said):
    def taken(more=""):
        section = f"[bubble.data.points.pressure]\n{said}\n{more}"
        return recorded_bubble(recorded_project(frames_folder, section, "[10.5, 60]"))

    test = taken("tolerance = 0.51\n")
    assert [file.name for file in test.data.files] == ["p4_10kPa.csv", "p13_60kPa.csv"]
    assert test.pressures == pytest.approx([0.010, 0.060])
    assert set(test.pressures) <= set(test.increments)
    fields = prepare(test, None, None).fields
    assert [f.pressure for f in fields] == list(test.pressures)
    assert [f.path for f in fields] == list(test.data.files)
    (line,) = recorded_lines(test.data.recorded)
    assert "2 of 17 frames taken, 3 at no pressure" in line and "10 in place of 10.5 kPa" in line
    near = replace(test.data.recorded, pressure=np.array([0.0105001, 0.06]))
    assert "10.5001 in place of 10.5 kPa" in recorded_lines(near)[0]
    same = replace(near, pressure=near.requested * (1 + 1e-15))
    assert "in place of" not in recorded_lines(same)[0]
    table = recorded_table(test.data.recorded)
    assert table.header[1:4] == ["pressure, kPa", "asked for, kPa", "farther by, kPa"]
    assert table.rows[0][1:] == pytest.approx([10.0, 10.5, -0.5])
    complaint_with(["bubble[0].pressures[0]", "10.5"], taken, "tolerance = 0.49\n")


def test_all_or_a_number_of_frames_are_taken(frames_folder):
    section = "[bubble.data.points.pressure]\nfrom_name = true\n"
    test = recorded_bubble(recorded_project(frames_folder, section))
    assert test.pressures == pytest.approx([0.010, 0.012, 0.021, 0.033, 0.060])
    test = recorded_bubble(recorded_project(frames_folder, section + "frames = 2\n"))
    assert test.pressures == pytest.approx([0.033, 0.060])
    left = recorded_numbers(test.data.recorded)["left_out"]
    assert left == {"at no pressure": 3, "at a pressure that another frame has": 9}


def test_log_in_volts_with_its_own_clock(frames_folder, tmp_path):
    test = recorded_bubble(
        recorded_project(frames_folder, LOG.format(more="tolerance = 2"), "[10, 22, 34, 60]")
    )
    taken = test.data.recorded
    assert test.pressures == pytest.approx([0.010, 0.021, 0.033, 0.060], rel=0.01)
    assert taken.clock.lower <= AHEAD <= taken.clock.upper
    assert taken.clock.offset == pytest.approx(AHEAD, abs=1.0)
    numbers = recorded_numbers(taken)
    assert numbers["left_out"]["after the largest pressure"] >= 2
    # What the clocks leave open of each frame's own pressure, not of another's.
    every = zip(enumerate(LEVELS, 1), taken.clock.pressure_uncertainty, strict=True)
    each = {f"p{k}_{level:g}kPa.csv": 1e3 * doubt for (k, level), doubt in every}
    for row in numbers["taken"]:
        assert row["uncertain_kPa"] == pytest.approx(each[row["frame"]])
    first, second = recorded_lines(taken)
    assert "valve.csv: 4 of 17 frames taken" in first
    assert f"{taken.clock.offset:.2f} s, found by the apex heights" in second
    assert f"uncertain by {np.mean([*each.values()]):.2g} kPa" in second
    table = recorded_table(taken)
    assert table.header[-1] == "uncertain by the clocks, +- kPa" and second in table.note
    name, _ = clock_picture(taken, taken.clock, Output(tmp_path))
    assert (tmp_path / name).stat().st_size > 20_000
    # Given, nothing is looked for.
    given = recorded_bubble(
        recorded_project(frames_folder, LOG.format(more="") + f"offset = {AHEAD}\n")
    )
    assert given.data.recorded.clock.misfit is None
    assert recorded_lines(given.data.recorded)[1].endswith(" 41.00 s, given")


def test_frames_within_the_noise_of_the_log_are_at_rest(frames_folder, tmp_path):
    """0.15 kPa of noise are above zero at about half of the frames at rest."""
    folder = shutil.copytree(frames_folder, tmp_path / "noisy")
    log = np.loadtxt(folder / "data" / "valve.csv", delimiter=",", skiprows=1)
    log[:, 1] += np.random.default_rng(3).normal(0.0, 0.0015, len(log))
    path = folder / "data" / "valve.csv"
    np.savetxt(path, log, "%.6g", ",", header="time (s),p (V)", comments="")
    section = LOG.format(more="") + f"offset = {AHEAD}\n"
    recorded = recorded_bubble(recorded_project(folder, section)).data.recorded
    assert recorded.left_out["at no pressure"] == 3 and recorded.pressure.min() > 9e-3


@pytest.mark.parametrize("offset", ["", f"offset = {AHEAD}\n"])
def test_missing_picture_numbers_count_as_time(frames_folder, tmp_path, offset):
    """Without pictures 5 to 8 of 17 at 2 s each, the last of 60 kPa is at 28 s all the same."""
    shutil.copytree(frames_folder / "data", tmp_path / "data")
    for k in range(5, 9):
        next((tmp_path / "data" / "frames").glob(f"p{k}_*")).unlink()
    test = recorded_bubble(recorded_project(tmp_path, LOG.format(more="") + offset))
    taken = test.data.recorded
    for name, pressure in zip(taken.names, 1e3 * taken.pressure, strict=True):
        assert pressure == pytest.approx(float(name.split("_")[1][:-7]), abs=2.0)
    (said,) = taken.number_doubts
    assert "1 to 17" in said and "leave out 4 (5, 6, 7, 8)" in said
    doubts = prepare(test, None, None).view.number_doubts
    assert doubts == taken.number_doubts


def test_table_of_all_frames_is_split(frames_folder, tmp_path):
    """Frames 1 to 17 without 5 to 8; pressures by a column of it, or by a log and their numbers."""
    (tmp_path / "data").mkdir()
    shutil.copy(frames_folder / "data" / "valve.csv", tmp_path / "data")
    home, rows = frames_folder / "data" / "frames", ["Bild;x;y;dx;dy;dz;p [bar]"]
    for k, level in enumerate(LEVELS, 1):
        table = np.loadtxt(home / f"p{k}_{level:g}kPa.csv", delimiter=",", skiprows=1)
        rows += [";".join(f"{v:g}" for v in (k, *row)) for row in table if not 5 <= k <= 8]
    (tmp_path / "data" / "all.csv").write_text("\n".join(rows))
    files = 'files = ["all.csv"]\nfolder = "data"'
    column = "[bubble.data.points.pressure]\ncolumn = 'p'\n"
    for section in (column, LOG.format(more="")):
        test = recorded_bubble(recorded_project(tmp_path, section, "[10, 21, 60]", files))
        assert test.pressures == pytest.approx([0.010, 0.021, 0.060], rel=0.01)
        assert test.data.recorded.count == 13
        fields = prepare(test, None, None).fields
        assert [len(field.points) for field in fields] == [81] * 3
        rises = [field.displacement[40, 2] for field in fields]
        assert rises == pytest.approx([40 * (p / 60) ** (1 / 3) for p in (10, 21, 60)], abs=0.1)


def test_simulation_needs_no_frames(tmp_path):
    section = "[bubble.data.points.pressure]\nfrom_name = true\n"
    test = recorded_bubble(recorded_project(tmp_path, section, "[10.5, 60]"), need_data=False)
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
def test_bad_input_names_file_and_field(frames_folder, section, asked, words):
    section = f"[bubble.data.points.pressure]\n{section}\n" if section else ""
    complaint_with(words, read_project, recorded_project(frames_folder, section, asked))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("valve.csv", "nowhere.csv", ["pressure.log.file", "no file", "nowhere.csv"]),
        ("rate = 0.5", "rate = 0.01", ["pressure.log", "the log lasts", "the rate right?"]),
        ("rate = 0.5", "rate = 0.5\noffset = 1e6", ["pressure.log.offset", "within the log"]),
        ("rate = 0.5", "time_in_name = true", ["p1_0kPa.csv", "time_in_name", "found none"]),
        (', scale = 100.0', "", ["valve.csv", "'V'", "'kPa'"]),
        ("frames/*", "frames/q*", ["data.points.files", "no file matches", "--data DIR"]),
    ],
)  # fmt: skip
def test_bad_logs_name_file_and_field(frames_folder, old, new, words):
    path = recorded_project(frames_folder, LOG.format(more=""))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    complaint_with(words, read_project, path)


def times_of_frames(folder, count=2, files=("p1.csv", "p7.csv"), **said):
    (folder / "t.csv").write_text("frame,time (ms)\n1,500\n2,1500\n")
    section = LogSection(file="l.csv", **said)
    own, files = [None] * count, [folder / f for f in files]
    return frame_times(section, files, own, PLACE, folder)[0].tolist()


def test_frame_times_from_numbers_or_log(tmp_path):
    assert times_of_frames(tmp_path, 3, rate=2.0) == [0.0, 0.5, 1.0]
    assert times_of_frames(tmp_path, rate=2.0) == [0.0, 3.0]  # p1, p7
    assert times_of_frames(tmp_path, rate=2.0, time_in_name=False) == [0.0, 0.5]
    assert times_of_frames(tmp_path, times="t.csv") == [0.5, 1.5]
    assert times_of_frames(tmp_path, time_in_name=r"p(\d)") == [1.0, 7.0]
    assert times_of_frames(tmp_path, time_in_name=r"p(\d)", rate=2.0) == [0.5, 3.5]
    assert times_of_frames(tmp_path, files=("1s.csv", "70ms.csv"), time_in_name=True) == [1.0, 0.07]


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "expected one of"), ({"times": "t.csv", "time_in_name": True}, "expected one of"),
        ({"rate": 1.0, "times_column": "t"}, "times_column: "),
        ({"rate": 1.0, "times": "t.csv"}, "rate: "),
        ({"time_in_name": "p(.)", "count": 3}, "time_in_name: a file holds"),
        ({"time_in_name": True, "rate": 1.0}, "time_in_name: with"),
        ({"times": "t.csv", "count": 3}, "t.csv: expected one time for each of the 3 frames"),
    ],
)  # fmt: skip
def test_missing_frame_times_are_refused(tmp_path, said, words):
    assert (
        complaint(times_of_frames, tmp_path, **said).removeprefix(f"{tmp_path}/").startswith(words)
    )


CLOCK = np.arange(0.0, 200.0, 0.2)
TIMES = np.arange(0.0, 180.0, 2.0)


def doubts(heights, log_times, pressures, times=TIMES):
    return doubts_of_log(given_offset(5.0, times, heights, log_times, pressures), log_times)


def pressure(t):
    return 0.1 * np.clip(t / 100, 0, 1)


HEIGHTS = 40 * np.cbrt(pressure(TIMES + 5.0) / 0.1)


def test_log_of_one_inflation_and_its_release_is_not_doubted():
    assert doubts(HEIGHTS, CLOCK, pressure(CLOCK)) == []
    released = np.where(CLOCK > 120, 0.1 * np.exp((120 - CLOCK) / 20), pressure(CLOCK))
    at_frames = np.interp(TIMES + 5.0, CLOCK, released)
    # A sheet that has crept stands higher when the pressure falls.
    assert doubts(42 * np.cbrt(at_frames / 0.1), CLOCK, released) == []
    assert doubts(np.full(len(TIMES), np.nan), CLOCK, released) == []


@pytest.mark.parametrize(("share", "is_doubted"), [(0.85, False), (0.7, True), (0.2, True)])
def test_leak_between_sheet_and_gauge_is_doubted(share, is_doubted):
    leaking = np.where(
        CLOCK > 120, 0.1 * np.maximum(share, 1 - (CLOCK - 120) / 50), pressure(CLOCK)
    )
    found = doubts(HEIGHTS + 1e-3, CLOCK, leaking)
    assert len(found) == is_doubted
    if is_doubted:
        assert "stays at 40 mm" in found[0] and "a leak between the sheet and the gauge" in found[0]


@pytest.mark.parametrize(("hole", "is_doubted"), [(3600.0, True), (30.0, False)])
def test_hole_of_an_hour_in_a_log_of_a_fifth_of_a_second_is_doubted(hole, is_doubted):
    late = CLOCK > 50
    times = np.where(TIMES > 45, TIMES + hole, TIMES)
    found = doubts(HEIGHTS, np.where(late, CLOCK + hole, CLOCK), pressure(CLOCK), times)
    assert len(found) == is_doubted
    assert (
        not is_doubted or "a hole of 3600 s at 50 s, where readings are otherwise 0.2 s" in found[0]
    )
    # A hole before the first frame tells nothing of the frames.
    early = np.where(CLOCK > 2, CLOCK, CLOCK - 3600.0)
    assert doubts(HEIGHTS, early, pressure(CLOCK)) == []


@pytest.mark.parametrize(("key", "value"), [("from_name", True), ("column", "p")])
def test_pressures_of_arrays_are_in_no_files(key, value):
    points = np.zeros((30, 3))
    data = {"points": {"pressure": {key: value}}}
    bubble = bf.Bubble(points, [points, points], [0.05, 0.1], radius=100.0, data=data)
    said = complaint(bf.Project.of, bubble, bf.Law("constant"), fabric=bf.Fabric("made", 0.8))
    assert said.startswith(f"bubble: pressure.{key}: is of files, and arrays are given")


def test_second_inflation_of_pressures_that_only_rise_is_refused(frames_folder):
    rising = POINTS.replace("*", "p[4-9]_*")
    section = "[bubble.data.points.pressure]\nfrom_name = true\n"
    path = recorded_project(frames_folder, section, files=rising)
    assert len(recorded_bubble(path).data.files) == 2  # one of each pressure
    path.write_text(path.read_text().replace("radius", "inflation = 2\nradius"))
    assert "bubble[0].inflation: " in complaint(recorded_bubble, path)
