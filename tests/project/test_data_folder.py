"""Recognition of measured files by the readers that take them, and the tests proposed for them."""

import shutil

import pytest
from bubblefit.project.data_folder import (
    BENDING,
    BIAXIAL,
    FRAMES,
    LOG,
    NUMBERS,
    STRIPS,
    TIMES,
    proposed_tests,
    recognised_groups,
)

from ..support.paths import EXAMPLES

DATA = EXAMPLES / "own-data" / "data"


def test_roles_of_files(tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    for name in ("bubble/Bubble-0058_0.csv", "camera.csv", "pressure.csv", "strips/fill_1.csv"):
        shutil.copy(DATA / name, data)
    shutil.copy(EXAMPLES / "biaxial-computed" / "test.csv", data / "cruciform.csv")
    (data / "beam.csv").write_text("deflection (mm),load (N)\n0,0\n1,20\n2,41\n")
    roles = {group.files[0].name: group.role for group in recognised_groups(data)}
    assert roles == {
        "Bubble-0058_0.csv": FRAMES,
        "camera.csv": TIMES,
        "pressure.csv": LOG,
        "fill_1.csv": STRIPS,
        "cruciform.csv": BIAXIAL,
        "beam.csv": BENDING,
    }
    tests = proposed_tests(recognised_groups(data))
    assert [test["kind"] for test in tests] == ["bubble", "strips", "biaxial", "cylinder"]
    assert tests[0]["sizes"] == ["radius"] and tests[0]["in_camera_axes"]
    assert tests[1]["in_heads"] == {"width": 50.0, "grip_distance": 200.0, "gauge_length": 100.0}


def test_frames_without_heights_and_with_a_pressure_in_each(tmp_path):
    for number, bar in enumerate((0.1, 0.2, 0.3)):
        rows = [f"{x},{y},0.1,0.2,{5 * bar}" for x in (-50, 0, 50) for y in (-50, 0, 50)]
        text = "\n".join([f"# p_bar={bar}", "x,y,dx,dy,dz", *rows])
        (tmp_path / f"test1_{number:02d}.csv").write_text(text)
    (test,) = proposed_tests(recognised_groups(tmp_path))
    assert test["columns"] == {name: name for name in ("x", "y", "dx", "dy", "dz")}
    assert (test["column"], test["in_camera_axes"], test["sizes"]) == ("p", False, ["radius"])


@pytest.mark.parametrize(
    ("stems", "group"),
    [
        ("test1_00 test1_19", "test1_*"),
        ("Bubble-0003_0 Bubble-0058_0", "Bubble-*_*"),
        ("step_2_60.5kPa step_12_100kPa", "step_*_*kPa"),
        ("warp1 warp2", "warp*"),
        ("strip_45deg_1 strip_45deg_2", "strip_45deg_*"),
        ("strip_0deg strip_0deg", "strip_0deg"),
        ("img000120_0 img000121_0", "img*_*"),
    ],
)
def test_files_of_one_test_differ_in_numbers(stems, group):
    assert {NUMBERS.sub("*", stem) for stem in stems.split()} == {group}


def test_angles_of_strips_stand_in_names(tmp_path):
    for angle in ("0", "22.5", "75"):
        text = (DATA / "strips" / "warp_1.csv").read_text().replace("Kette", "20 °C")
        (tmp_path / f"nylon {angle} deg.csv").write_text(text)
    (strips,) = proposed_tests(recognised_groups(tmp_path))
    assert strips["angles"] == {angle: [f"nylon {angle} deg.csv"] for angle in ("0", "22.5", "75")}
    assert strips["cuts"] == ["warp", "bias"] and strips["by_angle"]
