"""What is told of a registration: every number, cell and word of made-up ones."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble import findings as registration
from bubblefit.experiments.bubble.findings import (
    registration_line,
    registration_numbers,
    registration_table,
)
from bubblefit.experiments.kinds import Output
from bubblefit.meshes.disk import Outline
from bubblefit.readers.fields import DisplacementField

from ...drawings import caught

MOTIONS = (
    SimpleNamespace(points=9, shift=np.array([0.3, 0.4, 0.0]), angle=0.25),
    SimpleNamespace(points=0, shift=np.array([9.0, 9.0, 9.0]), angle=9.0),
    SimpleNamespace(points=4, shift=np.array([0.0, 0.0, 0.1]), angle=0.75),
)


def found(**other: Any) -> Any:
    said = {
        "placement": SimpleNamespace(
            origin=np.array([1.234, -5.678, 600.0]), axes=np.eye(3), tilt=1.456
        ),
        "rim": SimpleNamespace(error=0.123),
        "warp": SimpleNamespace(error=0.456, clear=0.87),
        "warp_angle": 12.346,
        "plane_of": "clamp",
        "flatness": 0.0678,
        "motions": MOTIONS,
        "options": SimpleNamespace(remove_clamp_motion=True, warp_is_stiff=True),
    }  # fmt: skip
    return SimpleNamespace(**(said | other))


def test_numbers() -> None:
    assert registration_numbers(found()) == {
        "origin_mm": [1.234, -5.678, 600.0],
        "axes": np.eye(3).tolist(),
        "plane": {"of": "clamp", "deviation_mm": 0.0678},
        "tilt_degrees": 1.456,
        "centre": {"error_mm": 0.123},
        "warp_degrees": 12.346,
        "warp": {"error_degrees": 0.456, "clear": 0.87},
        "clamp_motion": {
            "removed": True,
            "shift_mm": [pytest.approx(0.5), pytest.approx(0.1)],
            "turn_degrees": [0.25, 0.75],
        },
    }
    left = SimpleNamespace(remove_clamp_motion=False, warp_is_stiff=True)
    bare = registration_numbers(found(rim=None, warp=None, options=left))
    assert (bare["centre"], bare["warp"]) == ("given", "given")
    assert bare["clamp_motion"]["removed"] is False
    assert registration_numbers(found(motions=MOTIONS[1:2]))["clamp_motion"] == {
        "removed": False, "shift_mm": [], "turn_degrees": []
    }  # fmt: skip


def test_table_and_line() -> None:
    table = registration_table(found())
    assert (table.title, table.header) == ("Registration", ["step", "value", "how"])
    assert table.rows == [
        ["plane of the rim", "tilted by 1.46 degrees",
         "through the points beyond the rim, which deviate by 0.068 mm"],
        ["centre of the rim, mm", "1.23, -5.68, 600.00",
         "found where the sheet does not rise, +- 0.12"],
        ["warp, degrees from the camera's x", "12.35",
         "found by symmetry (87% clear), +- 0.46; the stiffer of the two axes"],
        ["motion of the clamp", "0.5 mm, 0.75 degrees at most", "removed"],
    ]  # fmt: skip
    soft = SimpleNamespace(remove_clamp_motion=False, warp_is_stiff=False)
    other = registration_table(found(options=soft, plane_of="camera", rim=None)).rows
    assert other[0][2] == "the camera's own x and y" and other[1][2] == "given"
    assert other[2][2] == "found by symmetry (87% clear), +- 0.46; the softer of the two axes"
    assert other[3][2] == "left in"
    turned = SimpleNamespace(error=0.456, clear=None)
    bare = registration_table(found(warp=turned, plane_of="edge", motions=())).rows
    assert bare[0][2] == "through the edge of the sheet, which deviate by 0.068 mm"
    assert bare[2][2] == "found by the turn of the elliptic rim, +- 0.46"
    assert bare[3][1:] == ["not known", "no points beyond the rim all around"]
    assert registration_table(found(warp=None)).rows[2][2] == "given"
    line = "registration: centre 1.23, -5.68, 600.00 mm, tilt 1.46, warp 12.35 degrees"
    assert registration_line(found(warp_angle=12.346)) == f"{line} (+- 0.5)"
    assert registration_line(found(warp_angle=12.346, warp=None)) == f"{line} (given)"


def test_maps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = caught(monkeypatch, registration, "registration_charts")
    points, edge = np.ones((3, 2)), Outline.circle(100.0)
    moved = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 3.0]])
    first = DisplacementField(0.01, points, 0 * moved)
    for z in (None, np.array([4.0, 5.0, 6.0])):
        last = DisplacementField(0.2, points, moved, z=z)
        shown = registration.registration_picture([first, last], edge, Output(tmp_path, "b-"))
        assert shown == (
            "b-registration.png",
            "measured points in the test's coordinates, the rim, warp and fill",
        )
    (_, _, (rise,), outline), (path, places, (height, again), _) = drawn
    assert path == tmp_path / "b-registration.png" and places is points
    assert rise[0] == again[0] == "rise at 200 kPa, mm" and rise[1].tolist() == [1.0, 2.0, 3.0]
    assert height[0] == "reference height z, mm" and height[1].tolist() == [4.0, 5.0, 6.0]
    np.testing.assert_array_equal(outline, edge.edge())
