"""Sections of a bubble and what is made of them before a fit: limits, times, shares, tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble import report as examined
from bubblefit.experiments.bubble.equilibrium import Apex
from bubblefit.experiments.bubble.objective import (
    FieldTarget,
    at_points,
    at_rest,
    counted_from,
    with_places,
)
from bubblefit.experiments.bubble.point_files import _frame_times
from bubblefit.experiments.bubble.section import (
    LogSection,
    Sheet,
    SheetSection,
    outline_of,
    sheet_of,
)
from bubblefit.experiments.bubble.sheet import _on_disk, measured_sheet, sheet_nuisance
from bubblefit.experiments.bubble.test import merge_increments
from bubblefit.experiments.kinds import Fabric, Output, Place, Scales
from bubblefit.meshes.disk import Outline, disk_mesh
from bubblefit.readers.fields import DisplacementField

from ...complaints import complaint
from ...drawings import caught

PLACE = Place(Path("p.toml"), "bubble[0]", Fabric("a fabric", 0.8))
METRES = replace(PLACE, scales=Scales(pressure=0.1, length=1000.0))


# --- the edge ------------------------------------------------------------------------------------


def edge(radius: float | None = None, symmetry: str = "full", place: Place = PLACE, **ellipse):
    own = SimpleNamespace(**({"angle": 0.0} | ellipse)) if ellipse else None
    section: Any = SimpleNamespace(radius=radius, ellipse=own, symmetry=symmetry)
    return outline_of(section, place)


def test_edges_at_their_limits() -> None:
    assert edge(0.1, place=METRES) == Outline.circle(100.0)
    assert edge(0.81) == Outline.circle(0.81)
    assert edge(major=80.0, minor=80.0) == Outline(80.0, 80.0)
    assert edge(major=0.2, minor=0.1, angle=90.0, symmetry="quarter", place=METRES) == Outline(
        200.0, 100.0, 90.0
    )
    assert edge(major=400.0, minor=100.0).minor == 100.0


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "radius: this key is missing; give the radius of the disk, or [bubble.ellipse]"),
        ({"radius": 1.0, "major": 2.0}, "radius: expected a radius or [bubble.ellipse], not both"),
        ({"radius": 0.8}, "radius: expected more than the fabric's thickness 0.8 mm, got 0.8 mm"),
        ({"major": 2.0, "minor": 0.8}, "ellipse.minor: expected more than the fabric's thickness "
         "0.8 mm, got 0.8 mm"),
        ({"major": 2.0, "minor": 2.1}, "ellipse.minor: expected at most the major 2 mm, got 2.1 "
         "mm; 'angle' is that of the major semi-axis"),
        ({"major": 401.0, "minor": 100.0}, "ellipse.minor: expected at least the 4th part of the "
         "major 401 mm, got 100 mm"),
        ({"major": 200.0, "minor": 100.0, "angle": 30.0, "symmetry": "quarter"}, "symmetry: the "
         "axes of the ellipse lie at 30 degrees from the yarns: needs 'full'"),
    ],
)  # fmt: skip
def test_edges_that_cannot_be(said: dict[str, Any], words: str) -> None:
    assert complaint(edge, **said) == f"p.toml: bubble[0].{words}"


# --- load steps ----------------------------------------------------------------------------------


def test_load_steps_are_in_the_unit_of_the_file() -> None:
    steps = merge_increments(PLACE, "increments", [30.0, 10.0, 22.0 * (1 + 1e-10)], (0.022, 0.03))
    assert steps == pytest.approx((0.010, 0.022, 0.03)) and len(steps) == 3
    assert len(merge_increments(PLACE, "i", [22.0 * (1 + 1e-8)], (0.022, 0.03))) == 3
    assert merge_increments(METRES, "i", [0.1], (0.022,)) == pytest.approx((0.01, 0.022))
    assert complaint(merge_increments, PLACE, "increments", [10.0, 30.001], (0.03,)) == (
        "p.toml: bubble[0].increments[1]: expected a step up to the last pressure, got 30.001 "
        "beyond it"
    )


# --- the sheet -----------------------------------------------------------------------------------


def sheet(place: Place = PLACE, **said: Any) -> Sheet:
    how = {"pressures": (0.02, 0.2), "symmetry": "full", "of_files": True, "offset": False}
    how |= {key: said.pop(key) for key in [*how] if key in said}
    return sheet_of(SheetSection(**said), place, **how)


def test_what_a_section_says_of_the_sheet() -> None:
    assert sheet() == Sheet() == Sheet(False, 8, 0, 3.0, False, 0.3, 0.5, False, (), None)
    found = sheet(
        METRES, surface="measured", degree=6, modes=3, prior=0.002, slack=True, slack_prior=0.1,
        misfit=0.0001, rim="measured", constant_field=["dz", "dx", "dz"],
    )  # fmt: skip
    assert found == Sheet(True, 6, 3, 2.0, True, 0.1, pytest.approx(0.1), True, (0, 2), None)
    assert sheet(from_pressure=200.0).since == 1 and sheet(METRES, from_pressure=0.2).since == 0
    assert sheet(from_pressure=20.0 * (1 + 9e-7)).since == 0


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"surface": "measured", "of_files": False}, "sheet.surface: nothing is measured here: no "
         "files are read"),
        ({"rim": "measured", "of_files": False}, "sheet.rim: nothing is measured here: no files "
         "are read"),
        ({"surface": "measured", "symmetry": "quarter"}, "sheet.surface: a measured surface: a "
         "sheet that is not doubly symmetric needs symmetry = 'full'"),
        ({"modes": 3, "symmetry": "quarter"}, "sheet.modes: 3 modes: a sheet that is not doubly "
         "symmetric needs symmetry = 'full'"),
        ({"prior": 1.0}, "sheet.prior: belongs to modes, not asked for"),
        ({"slack_prior": 1.0}, "sheet.slack_prior: belongs to slack, not asked for"),
        ({"misfit": 1.0}, "sheet.misfit: belongs to modes or slack, not asked for"),
        ({"from_pressure": 20.1}, "sheet.from_pressure: expected one of several 'pressures', got "
         "20.1"),
        ({"from_pressure": 20.0, "pressures": (0.02,)}, "sheet.from_pressure: expected one of "
         "several 'pressures', got 20"),
        ({"from_pressure": 20.0, "surface": "measured"}, "sheet.from_pressure: a surface measured "
         "under pressure is not without stress: use modes instead"),
        ({"from_pressure": 20.0, "offset": True}, "nuisance.displacement_offset: takes up what "
         "from_pressure and constant_field take out; use one of them"),
        ({"constant_field": ["dx"], "offset": True}, "nuisance.displacement_offset: takes up what "
         "from_pressure and constant_field take out; use one of them"),
        ({"from_pressure": 20.0, "constant_field": ["dx"]}, "sheet.constant_field: takes out what "
         "from_pressure takes out already; use one of them"),
        ({"constant_field": ["dx"], "pressures": (0.02,)}, "sheet.constant_field: nothing is left "
         "of the data of one pressure"),
    ],
)  # fmt: skip
def test_what_a_sheet_cannot_be(said: dict[str, Any], words: str) -> None:
    assert complaint(sheet, **said) == f"p.toml: bubble[0].{words}"


def measured(reach: float, height: float = 0.0, nan: bool = False) -> DisplacementField:
    turn = np.linspace(0, 2 * np.pi, 200)
    r = 100.0 * reach * np.sqrt(np.linspace(0, 1, 200))
    points = np.column_stack([r * np.cos(9 * turn), r * np.sin(9 * turn)])
    z = 600.0 + height * points[:, 0] / (200.0 * reach)
    if nan:
        z[100:] = np.nan
    return DisplacementField(0.1, points, np.zeros((200, 3)), z=z)


@pytest.mark.parametrize(
    ("field", "words"),
    [
        (measured(0.85), ""),
        (measured(0.849), "sheet.surface: points go out to 85 % of the radius; at least 85 % are "
         "needed to know the rim"),
        (measured(0.9, nan=True), "sheet.surface: points go out to 63 % of the radius; at least "
         "85 % are needed to know the rim"),
        (measured(0.9, 49.0), ""),
        (measured(0.9, 52.0), "sheet.surface: heights z of the reference picture differ by"),
    ],
)  # fmt: skip
def test_heights_of_a_reference_picture(field: DisplacementField, words: str) -> None:
    asked = Sheet(measured=True, degree=2), Outline.circle(100.0), [field]
    if words:
        assert complaint(measured_sheet, *asked).startswith(words)
    else:
        assert measured_sheet(*asked).surface is not None
    # The motion of the rim asks for no height.
    if np.isnan(field.z).any():
        assert _on_disk(field, asked[1], "rim").all()
        assert _on_disk(field, asked[1], "rim").sum() == 200
    rim = Sheet(moving_rim=True, degree=2)
    if field.points.max() < 84.95:
        assert "sheet.rim: points go out to 85 %" in complaint(measured_sheet, rim, *asked[1:])


def test_points_none_of_which_lies_on_the_disk() -> None:
    far = measured(2.0)
    far = replace(far, points=far.points[np.hypot(*far.points.T) > 101.0], z=None,
                  displacement=far.displacement[np.hypot(*far.points.T) > 101.0])  # fmt: skip
    assert complaint(measured_sheet, Sheet(moving_rim=True), Outline.circle(100.0), [far]) == (
        "sheet.rim: points go out to 0 % of the radius; at least 85 % are needed to know the rim"
    )


def test_priors_of_a_sheet_weigh_as_twenty_points() -> None:
    model: Any = SimpleNamespace(modes={"z0_1": None, "z0_x": None})
    scale = np.array([1.0, 4.0, 100.0])
    found = sheet_nuisance(Sheet(modes=2, prior=2.0, slack=True, misfit=0.1), model, scale)
    weight = pytest.approx(0.1 * np.sqrt(20) / 4)
    told = [(n.name, n.lower, n.upper, n.unit, n.scale, n.prior, n.weight) for n in found]
    assert told == [
        ("z0_1", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("z0_x", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("slack_warp", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
        ("slack_fill", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
    ]
    assert [n.model_parameter for n in found] == [n.name for n in found]


# --- frames counted from one that is loaded ------------------------------------------------------


def test_places_at_rest_by_the_two_thirds_of_the_pressure() -> None:
    """In-plane 8 to 27 kPa: 4 to 9 units; what has moved at 8 is 4/5 of what moves between."""
    points = np.array([[10.0, 0.0], [0.0, 20.0]])
    moved = np.array([[0.5, 0.0, 9.0], [0.0, 1.0, 9.0]])
    first = DisplacementField(0.008, points, np.zeros((2, 3)))
    other = DisplacementField(0.027, points[::-1], moved[::-1])
    for fields, since in (([first, other], 0), ([other, first], 1)):
        for found in at_rest(fields, since):
            order = np.argsort(found.points[:, 1])
            assert found.points[order] == pytest.approx(np.array([[9.6, 0.0], [0.0, 19.2]]))
    seen = replace(first, displacement=np.full((2, 3), 1e-9))
    assert at_rest([seen, other], 0) == [seen, other]


def test_a_frame_shares_half_of_its_places() -> None:
    nodes = np.array([[float(k), 0.0] for k in range(5)])

    def target(pressure: float, *which: int) -> FieldTarget:
        import scipy.sparse as sp

        sample = sp.csr_matrix(np.eye(5)[list(which)])
        return FieldTarget(pressure, np.array([[k, pressure, 1.0] for k in which]), sample)

    some = with_places([target(0.1, 0, 1, 2, 3), target(0.02, 4, 3, 2)], nodes)
    (found,) = counted_from(some, 1)
    np.testing.assert_allclose(found.displacement, [[0.0, 0.08, 0.0]] * 2, atol=1e-12)
    assert (found.frame, found.since, found.pressure) == (0, 1, 0.1)
    assert found.at(nodes)[:, 0].tolist() == [2.0, 3.0]
    few = with_places([target(0.1, 0, 1, 2), target(0.02, 4, 3, 2)], nodes)
    assert complaint(counted_from, few, 1) == (
        "sheet.from_pressure: the frames at 100 and 20 kPa share 1 of 3 points; expected the same "
        "points in all"
    )


def test_points_that_lie_on_the_disk() -> None:
    """A tenth of them, and out to a tenth of its radius: less is another unit."""
    mesh = disk_mesh(100.0, 48)
    test: Any = SimpleNamespace(outline=Outline.circle(100.0), place=PLACE, facet=None)

    def found(points: Any) -> tuple[int, int]:
        points = np.array(points, dtype=float)
        fields = [DisplacementField(0.2, points, np.zeros((len(points), 3)))]
        (target,), outside = at_points(test, fields, mesh)
        return len(target.displacement), outside

    far = [[900.0, k] for k in range(9)]
    assert found([[50.0, 0.0], *far]) == (1, 9)
    right = "are the length unit and the columns x and y right?"
    assert complaint(found, [[50.0, 0.0], *far, [901.0, 0]]) == (
        "p.toml: bubble[0], data at 200 kPa: 1 of 11 points lie on the disk of radius 100 mm: "
        + right
    )
    assert found([[10.0, 0.0], [0.0, -9.0]]) == (2, 0)
    assert complaint(found, [[-9.99, 0.0], [0.0, 9.0]]) == (
        "p.toml: bubble[0], data at 200 kPa: all points lie within 9.99 mm of the centre of a disk "
        "of radius 100 mm: " + right
    )


# --- times of frames -----------------------------------------------------------------------------


def times(folder: Path, count: int = 2, files: tuple[str, ...] = ("p1.csv", "p7.csv"), **said: Any):
    (folder / "t.csv").write_text("frame,time (ms)\n1,500\n2,1500\n")
    section = LogSection(file="l.csv", **said)
    return _frame_times(section, [folder / f for f in files], count, PLACE, folder).tolist()


def test_times_of_frames(tmp_path: Path) -> None:
    assert times(tmp_path, 3, rate=2.0) == [0.0, 0.5, 1.0]
    assert times(tmp_path, times="t.csv") == [0.5, 1.5]
    assert times(tmp_path, time_in_name=r"p(\d)") == [1.0, 7.0]
    assert times(tmp_path, time_in_name=r"p(\d)", rate=2.0) == [0.5, 3.5]
    assert times(tmp_path, files=("1s.csv", "70ms.csv"), time_in_name=True) == [1.0, 0.07]


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "expected one of 'rate', 'times' and 'time_in_name' for the times of the frames"),
        ({"times": "t.csv", "time_in_name": True}, "expected one of 'rate', 'times' and "
         "'time_in_name' for the times of the frames"),
        ({"rate": 1.0, "times_column": "t"}, "times_column: means nothing without 'times'"),
        ({"rate": 1.0, "times": "t.csv"}, "rate: means nothing beside 'times'"),
        ({"time_in_name": "p(.)", "count": 3}, "time_in_name: a file holds several frames; give "
         "'rate' or 'times'"),
        ({"time_in_name": True, "rate": 1.0}, "time_in_name: with 'rate', expected a pattern whose "
         "group is the number of the picture"),
        ({"times": "t.csv", "count": 3}, "t.csv: expected one time for each of the 3 frames, "
         "got 2"),
    ],
)  # fmt: skip
def test_times_that_cannot_be_had(tmp_path: Path, said: dict[str, Any], words: str) -> None:
    found = complaint(times, tmp_path, **said)
    assert found.removeprefix(f"{tmp_path}/") == words


# --- what is seen before a fit -------------------------------------------------------------------


def test_every_cell_of_what_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = caught(monkeypatch, examined, "rise_charts")
    monkeypatch.setattr(examined, "registration_picture", lambda *_: ("maps.png", "maps"))
    points = np.zeros((4, 2))
    fields = [
        DisplacementField(0.02, points, np.zeros((4, 3)), {"all zero": 2, "without a value": 1}),
        DisplacementField(0.2, points, np.zeros((4, 3)), path=Path("x/b.csv")),
    ]
    apexes = [Apex(0.2, 31.0, 0.012, 16.0, 0.5, (0.03, 0.05))]
    rim = SimpleNamespace(x=1.234, y=-0.5, error=0.123)
    axes = SimpleNamespace(off=-2.346, error=0.456, clear=0.876)
    view = SimpleNamespace(rises=np.array([3.0, 30.0]), apexes=apexes, rim=rim, axes=axes)
    test = SimpleNamespace(thickness=0.8, outline=None)
    prepared: Any = SimpleNamespace(fields=fields, view=view, test=test, registration=None)
    shown = examined.exhibit_examined(prepared, Output(tmp_path))
    assert shown.facts == [
        ("the sheet rises about, mm", "1.23, -0.50 (+- 0.12)"),
        ("axes of symmetry, degrees from x and y", "-2.35 (+- 0.46, 88% clear)"),
    ]
    frames, equilibrium = shown.tables
    assert frames.header == [
        "pressure, kPa", "file", "points", "dropped", "rise about the centre, mm"
    ]  # fmt: skip
    assert frames.rows == [
        [20.0, "computed", 4, "2 all zero, 1 without a value", 3.0],
        [200.0, "b.csv", 4, "none", 30.0],
    ]
    assert equilibrium.header == [
        "pressure, kPa", "apex, mm", "k1 + k2, 1/m", "force, kN/m", "+-", "stress, MPa",
        "strain along warp, %", "along fill, %",
    ]  # fmt: skip
    assert equilibrium.rows == [pytest.approx([200.0, 31.0, 12.0, 16.0, 0.5, 20.0, 3.0, 5.0])]
    assert shown.figures == [
        ("maps.png", "maps"), ("rises.png", "rise about the centre against pressure")
    ]  # fmt: skip
    ((path, pressures, rises),) = drawn
    assert (path, pressures) == (tmp_path / "rises.png", [0.02, 0.2]) and rises is view.rises
    view.apexes, view.rim, view.axes = [], None, None
    bare = examined.exhibit_examined(prepared, Output(tmp_path))
    assert bare.facts == [] and len(bare.tables) == 1
