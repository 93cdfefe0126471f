"""`bubblefit gauge`: DIC frames of a strip become a load curve that a project reads."""

import json

import numpy as np
import pandas as pd
import pytest
from bubblefit.project.project import read_project

from ..audit import audit_table
from ..readers.test_spheres import ball_cap
from ..support.commands import in_process, one_line

LOWER, UPPER = ("12.3", "20.1"), ("12.3", "40.122")


GAUGE = ["--lower", *LOWER, "--upper", *UPPER]


#: By x, y and z: the strip rises 0.02 mm a mm.
LENGTH = float((40.122 - 20.1) * np.hypot(1, 0.02))


STRETCHES = np.linspace(1.0, 1.165, 12)


LOST = (4, 7)


def write_frames(folder, lost=(), stretches=STRETCHES, header="x,y,z,dx,dy,dz", scale=1.0):
    """Frames f0.csv ... of a 25 x 60 mm strip: stretched, turned about x, slipped in the grips."""
    x, y = np.meshgrid(np.arange(0, 25.1), np.arange(0, 60.1))
    points = np.column_stack([x.ravel(), y.ravel(), 0.02 * y.ravel() + 1.0])
    turn = np.array([[1, 0, 0], [0, np.cos(0.1), -np.sin(0.1)], [0, np.sin(0.1), np.cos(0.1)]])
    folder.mkdir(exist_ok=True)
    files = []
    for i, stretch in enumerate(stretches):
        moved = (points * [0.95, stretch, stretch]) @ turn.T + [0.3, -2.0, 0.5]
        table = np.column_stack([points, moved - points]) / scale
        if i in lost:  # a hole where the upper end is
            table[np.hypot(points[:, 0] - 12, points[:, 1] - 40) < 2, 3:] = np.nan
        files.append(folder / f"f{i}.csv")
        text = "\n".join(
            ",".join("" if np.isnan(v) else repr(v) for v in r) for r in table.tolist()
        )
        files[-1].write_text(f"{header}\n{text}\n")
    return files


def load_at(time):
    """N, linear in s: so interpolation between the machine's readings is exact."""
    return 350.0 * np.asarray(time) + 5.0


def machine_export(folder, end=6.0):
    """As MTS TestSuite writes it, at 10 Hz; 12 frames at 2 Hz end at 5.5 s."""
    rows = [f"{0.9 * t:.6f},{load_at(t) / 1e3},{t!r}" for t in np.arange(0, end, 0.1).tolist()]
    head = "Test: cut strip\nTest Run: 3\n\nAxial Displacement,Axial Force,Running Time\nmm,kN,s\n"
    (folder / "machine.csv").write_text(head + "\n".join(rows) + "\n")


def gauge(*arguments, code=0, cwd="."):
    return in_process("gauge", *arguments, cwd=cwd, code=code)


def refusal(*arguments):
    """Return the one line of a refusal, without "bubblefit: "."""
    done = gauge(*arguments, code=2)
    assert done.stdout == ""
    (line,) = [line for line in done.stderr.splitlines() if not line.startswith("warning: ")]
    return line.removeprefix("bubblefit: ")


@pytest.fixture(scope="module")
def strip(tmp_path_factory):
    folder = tmp_path_factory.mktemp("strip")
    write_frames(folder / "frames")
    machine_export(folder)
    return folder


def read_curve(path):
    return pd.read_csv(path, comment="#")


PROJECT = """
[fabric]
thickness = 0.81
[[strips]]
{sections}
[strips.data]
{data}
"""


def test_gauge_of_frames_becomes_curve_of_a_project(tmp_path, golden):
    write_frames(tmp_path / "frames", LOST)
    machine_export(tmp_path, end=5.3)
    pairing = "--loads machine.csv --frame-interval 0.5 --direction Warp".split()
    command = ("gauge", "frames/f*.csv", *GAUGE, *pairing, "--specimen", "W 1", "--out", "w1.csv")
    done = in_process(*command, cwd=tmp_path)
    golden("gauge", done.stdout + done.stderr, tmp_path)
    found = audit_table("gauge", tmp_path / "w1.csv", done.stdout + done.stderr, tmp_path).findings
    assert not found, "\n".join(map(str, found))
    left_out = "1 of 12 frames have a length and no load; they are left out: f11.csv"
    assert f"# note: {left_out}\n" in (tmp_path / "w1.csv").read_text()
    # All defaults but the gauge length: header, units, specimen and direction are found.
    project = tmp_path / "project.toml"
    sections = f"[strips.warp]\ngauge_length = {LENGTH!r}"
    project.write_text(PROJECT.format(sections=sections, data='files = ["w1.csv"]'))
    read = read_project(project).tests["strips"].strips
    assert list(read) == ["warp"]
    (curve,) = read["warp"].curves
    kept = [i for i in range(11) if i not in LOST]
    np.testing.assert_allclose(curve.elongation, LENGTH * (STRETCHES[kept] - 1), atol=1e-9)
    np.testing.assert_allclose(curve.load, load_at(0.5 * np.array(kept)), rtol=1e-12)
    assert curve.specimen == "W 1"
    assert read["warp"].final_length == pytest.approx(LENGTH * STRETCHES[10])


def test_times_of_a_camera_with_another_clock_are_aligned(strip, tmp_path):
    """The camera starts 0.25 s after the machine and counts milliseconds."""
    times = tmp_path / "pictures.csv"
    times.write_text("picture,time_ms\n" + "".join(f"{i},{400 * i}\n" for i in range(12)))
    out = tmp_path / "w.csv"
    pairing = ["--frame-times", times, "--time-offset", 0.25]
    gauge(strip / "frames/f*.csv", *GAUGE, "--loads", strip / "machine.csv", *pairing,
          "--direction", "warp", "--out", out)  # fmt: skip
    expected = load_at(0.4 * np.arange(12) + 0.25)
    np.testing.assert_allclose(read_curve(out)["load_N"], expected, rtol=1e-12)


def test_gauge_overwrites_neither_results_nor_data(strip, tmp_path):
    out, frames = tmp_path / "gauge.csv", sorted((strip / "frames").glob("f*.csv"))
    ask = [*frames, *GAUGE, "--out", out]
    gauge(*ask)
    first = out.read_bytes()
    assert "is already there; use --overwrite" in refusal(*ask)
    changed = [*ask, "--upper", "12.3", "39", "--overwrite"]
    # Refused after the frames are read: what was there stays.
    refusal(*changed, "--loads", tmp_path / "none.csv", "--direction", "warp")
    assert out.read_bytes() == first
    gauge(*changed)
    assert out.read_bytes() != first
    message = refusal(*ask[:-1], out / "gauge.csv")
    assert "cannot be written" in message and "--out" in message
    assert [f.name for f in tmp_path.iterdir()] == ["gauge.csv"]
    before, link = frames[0].read_bytes(), tmp_path / "link.csv"
    link.symlink_to(frames[0])
    for out in (frames[0], link):
        message = refusal(*ask[:-1], out, "--overwrite")
        assert "is one of the files to be read" in message
    assert frames[0].read_bytes() == before


LOADS = ["--loads", "{strip}/machine.csv", "--direction", "warp"]


NO_LOADS = "means nothing without --loads"


BAD = [
    (["--loads", "{strip}/machine.csv"], "--direction: this option is missing"),
    (["--loads", "{strip}/machine.csv", "--direction", "90"], "--direction: unknown direction"),
    (["--direction", "warp"], f"--direction: {NO_LOADS}"),
    (["--frame-interval", "1"], f"--frame-interval: {NO_LOADS}"),
    ([*LOADS, "--time-offset", "1"], "--time-offset: means nothing without --frame-times or"),
    ([*LOADS, "--frame-time-column", "t"], "--frame-time-column: means nothing without --fr"),
    ([*LOADS, "--frame-interval", "1", "--frame-times", "{tmp}/t.csv"],
     "--frame-times, --frame-interval: give one of them, not both"),
    ([*LOADS, "--frame-interval", "nan"], "--frame-interval: expected a finite number"),
    ([*LOADS, "--specimen", " "], "--specimen: expected a name on one line"),
    (LOADS, "machine.csv: expected one load for each of the 12 frames, got 60; --frame-times"),
    ([*LOADS, "--load-column", "F"], "'F'; name them with --load-column; line 4, above"),
    ([*LOADS, "--frame-times", "{tmp}/none.csv"], "none.csv: no such file"),
    (["--columns", "x"], "--columns: expected such as x=X,y=Y"),
    (["--columns", "w=W"], "--columns: expected one of x, y, z, dx, dy, dz, got 'w'"),
    (["--columns", "x=dx,dx=dx"], "--columns: column 'dx' is named for x and for dx"),
    (["--columns", "x=X"], "f0.csv: column 'X': this column is missing; the file has: x, y"),
    (["--flag-column", "mask"], "f0.csv: column 'mask': this column is missing"),
    (["--max-gap", "inf"], "--max-gap: expected a finite number"),
    (["--lower", "nan", "2"], "lower: expected x and y in mm"),
    (["--length-unit", "m"], "f0.csv: gauge: the ends are 20.02 mm apart, the points 1414 mm"),
    (["{tmp}/no*.csv"], "FRAMES: no file matches"),
    (["{strip}/machine.csv"], "machine.csv"),
]  # fmt: skip


@pytest.mark.parametrize(("options", "words"), BAD)
def test_bad_input_of_gauge_is_one_line(strip, tmp_path, options, words):
    given = [option.format(strip=strip, tmp=tmp_path) for option in options]
    ask = [strip / "frames/f*.csv", *GAUGE, "--out", tmp_path / "out.csv", *given]
    assert words in refusal(*ask)
    assert list(tmp_path.iterdir()) == []


#: Table A.1 of the thesis: radius, mm, and error, %, of a ball of 40.0 mm.
TABLE_A1 = [(39.73, 0.67), (39.78, 0.54), (39.90, 0.23), (39.85, 0.38), (39.89, 0.28)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    home = tmp_path_factory.mktemp("balls")
    for k, (radius, _) in enumerate(TABLE_A1, start=1):
        points, _, _ = ball_cap(radius, 60.0, 300, k)
        points[3] += 1.0
        table = np.round(points, 6)
        np.savetxt(home / f"ball{k}.csv", table, "%.6f", ",", header="x,y,z", comments="")
    return home


def test_errors_of_the_radius_are_those_of_the_thesis(folder):
    """To 0.021 %: half of the last digit of both, and one (39.90) that the thesis rounds down."""
    out = folder / "out" / "balls.csv"
    out.parent.mkdir()
    run = ("dic", "sphere", "ball*.csv", "--radius", 40.0)
    said = json.loads(in_process(*run, "--json", "--out", out, cwd=folder).stdout)
    for row, (radius, error) in zip(said["frames"], TABLE_A1, strict=True):
        assert row["radius_mm"] == pytest.approx(radius, abs=1e-5)
        assert row["deviation_percent"] == pytest.approx(-error, abs=0.021)
        assert row["left_out"] == 1 and row["points"] == 299 and row["rms_mm"] < 1e-5
        centre = [row[f"{axis}_mm"] for axis in "xyz"]
        assert centre == pytest.approx([12.0, -7.0, 610.0], abs=1e-4)
    assert said["mean_deviation_percent"] == pytest.approx(0.42, abs=0.01)
    assert said["worst_deviation_percent"] == pytest.approx(-0.67, abs=0.01)
    table = pd.read_csv(out)
    assert table["radius_mm"].tolist() == [row["radius_mm"] for row in said["frames"]]
    assert out.with_suffix(".png").stat().st_size > 20_000
    printed = in_process(*run, cwd=folder).stdout
    found = audit_table("sphere", out, printed, folder).findings
    assert not found, "\n".join(map(str, found))
    # Nothing is written over.
    one_line(in_process(*run, "--out", out, cwd=folder, code=2), str(out), "--overwrite")


def test_bad_input_of_dic_sphere_is_one_line(folder):
    (folder / "flat.csv").write_text("x,y,z\n" + "".join(f"{k},{k * k},1\n" for k in range(20)))
    for arguments, words in (
        (["nowhere*.csv"], ["FRAMES", "no file matches"]),
        (["ball1.csv", "--columns", "x"], ["--columns", "expected such as"]),
        (["ball1.csv", "--format", "davis-9"], ["--format", "is not one of"]),
        (["flat.csv"], ["flat.csv", "in a plane"]),
        (["ball1.csv", "--out", "a.png"], ["a.png", "CSV"]),
        (["ball1.csv", "--out", "ball1.csv"], ["ball1.csv", "one of the files to be read"]),
    ):
        one_line(in_process("dic", "sphere", *arguments, cwd=folder, code=2), *words)
