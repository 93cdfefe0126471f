"""`bubblefit dic sphere`: balls of the radii of Table A.1 give its errors."""

import json

import numpy as np
import pandas as pd
import pytest

from ..commands import in_process, one_line
from ..readers.test_surfaces import cap

#: Table A.1 of the thesis: radius, mm, and error, %, of a ball of 40.0 mm.
TABLE_A1 = [(39.73, 0.67), (39.78, 0.54), (39.90, 0.23), (39.85, 0.38), (39.89, 0.28)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """ball1.csv ...; one point of each is astray."""
    home = tmp_path_factory.mktemp("balls")
    for k, (radius, _) in enumerate(TABLE_A1, start=1):
        points, _, _ = cap(radius, 60.0, 300, k)
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
    # Nothing is written over.
    one_line(in_process(*run, "--out", out, cwd=folder, code=2), str(out), "--overwrite")


def test_the_table_on_the_terminal(folder, golden):
    run = ("dic", "sphere", "ball1.csv", "ball3.csv", "--radius", 40)
    golden("dic-sphere", in_process(*run, cwd=folder).stdout, folder)
    alone = in_process("dic", "sphere", "ball1.csv", cwd=folder).stdout
    assert "off" not in alone and len(alone.splitlines()) == 2


def test_metres_and_columns_of_other_names(folder):
    table = pd.read_csv(folder / "ball2.csv") / 1e3
    path = folder / "metres.csv"
    table.rename(columns={"x": "a", "y": "b", "z": "c"}).to_csv(path, index=False)
    options = "--columns", "x=a,y=b,z=c", "--length-unit", "m", "--json"
    said = json.loads(in_process("dic", "sphere", path, *options, cwd=folder).stdout)
    assert said["frames"][0]["radius_mm"] == pytest.approx(39.78, abs=1e-5)
    assert "deviation_percent" not in said["frames"][0]


def test_bad_input_is_one_line(folder):
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
