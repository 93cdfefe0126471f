"""Arrays and tables of a user in place of files: the same tests, and wrong arguments."""

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.project.arrays import biaxial_tables_of_arrays

from ..builders.measured_arrays import project_of
from ..builders.projects import fit_setup
from ..support.paths import EXAMPLES
from ..support.refusals import complaint, raised, refused


def test_arrays_lists_and_tables_make_the_same_bubble(arrays):
    points, moved, loads = (arrays[name] for name in ("points", "displacements", "pressures"))
    points[:, 2] = np.linspace(0, 1, len(points)) / 3  # what no decimal number is
    frames = [np.column_stack([points, u]) for u in moved]
    table = pd.concat(
        pd.DataFrame(frame, columns=["x", "y", "z", "dx", "dy", "dz"]).assign(pressure=p)
        for frame, p in zip(frames, loads, strict=True)
    )
    numbered = table.assign(frame=np.repeat(range(20), len(points))).drop(columns="pressure")
    for args in (
        (points, moved, loads),
        ([points] * 20, list(moved), loads.tolist()),
        (table,),
        (numbered, None, loads),
    ):
        (test,) = fit_setup(project_of(bf.Bubble(*args, radius=100.0, elements=48))).tests
        for field, u, p in zip(test.fields, moved, loads, strict=True):
            assert field.pressure == p
            np.testing.assert_array_equal(field.points, points[:, :2])
            np.testing.assert_array_equal(field.z, points[:, 2])
            np.testing.assert_array_equal(field.displacement, u)


def test_frames_may_lack_points_or_have_other_points(arrays):
    points, moved, loads = (arrays[name] for name in ("points", "displacements", "pressures"))
    moved[3, 5] = np.nan
    several = [points[: len(points) - k % 3] for k in range(20)]
    ragged = [u[: len(u) - k % 3] for k, u in enumerate(moved)]
    (test,) = fit_setup(project_of(bf.Bubble(several, ragged, loads, radius=100.0))).tests
    counts = [len(field.points) for field in test.fields]
    assert counts == [len(points) - k % 3 - (k == 3) for k in range(20)]
    assert test.dropped_count == 1


@pytest.mark.parametrize(
    ("change", "argument", "words"),
    [
        ({"displacements": lambda a: a[0, :, :2]}, "displacements", "(frames, m, 3)"),
        ({"displacements": lambda a: "no"}, "displacements", "numbers"),
        ({"displacements": lambda a: np.full_like(a, np.nan)}, "displacements[0]", "lost"),
        ({"displacements": lambda a: np.full_like(a, np.inf)}, "displacements", "finite"),
        ({"points": lambda a: a[:-1]}, "displacements[0]", "3)"),
        ({"points": lambda a: [a, a]}, "points", "20"),
        ({"pressures": lambda a: a[:-1]}, "pressures", "(20,)"),
        ({"pressures": lambda a: 1000 * a}, "pressures[1]", "is this in kPa? Divide by 1000"),
        ({"radius": 0.1}, "radius", "is this in m? Multiply by 1000"),
        ({"pressures": lambda a: a[::-1]}, "pressures[1]", "rising"),
        ({"pressures": lambda a: a - a[0]}, "pressures[0]", "above 0"),
        ({"radus": 100.0}, "radus", "'radius'"),
        ({"radius": "wide"}, "radius", "number"),
        ({"sheet": {"mode": 3}}, "sheet.mode", "'modes'"),
        ({"registration": {"centre": [1.0]}}, "registration.centre", "3"),
    ],
)
def test_wrong_argument_is_named(arrays, change, argument, words):
    given = {**arrays, "radius": 100.0}
    given |= {k: v(given[k]) if callable(v) else v for k, v in change.items()}
    caught = refused(bf.Bubble, **given)
    assert caught.field == argument and words in caught.problem


def test_biaxial_and_cylinder_tests_are_made_of_arrays(tmp_path):
    example = bf.read_project(EXAMPLES / "biaxial-computed" / "project.toml")
    (own,) = example.tests.values()
    table = bf.read(EXAMPLES / "biaxial-computed" / "test.csv")
    assert list(table.columns) == [*bf.Biaxial.columns, "ratio"]
    keys = {k: v for k, v in example.definitions["biaxial"].section.items() if k != "data"}
    by_ratio = {r: rows.drop(columns="ratio").to_numpy() for r, rows in table.groupby("ratio")}
    for given in (table, by_ratio):
        project = project_of(bf.Biaxial(given, **keys), form="linear")
        for mine, theirs in zip(project.tests["biaxial"].paths, own.paths, strict=True):
            assert mine.ratio == theirs.ratio
            np.testing.assert_allclose(mine.load, theirs.load, rtol=1e-14)
            np.testing.assert_allclose(mine.strain, theirs.strain, rtol=1e-14)
    raised(InputError, r"^paths\['1:1'\]", bf.Biaxial, {"1:1": by_ratio["1:1"][:, :3]})

    way = np.linspace(0.0, 90.0, 10)
    cylinder = bf.Cylinder(150.0, 0.09, curves=[(way, 2 * way), (way, 2.1 * way)], span=2000.0)
    (test,) = project_of(cylinder).tests.values()
    assert (test.diameter, test.pressure, test.supports.span) == (150.0, 0.09, 2000.0)
    assert [curve.load[-1] for curve in test.measured] == [180.0, 189.0]
    file = tmp_path / "bend.csv"
    file.write_text("deflection (mm),load (N)\n0,0\n90,180\n")
    read = project_of(bf.Cylinder.read(file, diameter=150.0, pressure=0.09)).tests["cylinder"]
    assert read.measured[0].load.tolist() == [0.0, 180.0]
    assert bf.read(file)["load"].tolist() == [0.0, 180.0]
    raised(InputError, r"^pressure: .*kPa", bf.Cylinder, 150.0, 90.0)


@pytest.mark.parametrize("ratio", [1, 0, "", (1, 1)])
def test_load_ratio_that_is_no_text_is_refused(ratio):
    said = complaint(biaxial_tables_of_arrays, {ratio: np.ones((5, 4))})
    assert "expected load ratios warp:fill as text, such as '2:1'" in said
