"""Tests, laws and sheets as objects: from arrays, to a fit, to a project file and back."""

import runpy

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError
from bubblefit.runs.setup import prepare_fit

from ..places import ROOT
from ..projects import constant_strips

FABRIC = bf.Fabric("made", thickness=0.8)
KNOWN_LAW = [0, 0, 0, 9.0, 0, 0, 0, 200.0, 0, 0, 0, 400.0]
PRESSURES = np.linspace(0.005, 0.1, 20)
#: Of `constant_strips`.
ELONGATION = np.linspace(0.2, 3.0, 12)


def prepared(project):
    """The tests of a project with their data."""
    return prepare_fit(project, project.chosen(None, fitted=True))


def objective(project):
    """The objective in the middle of the first start's neighbourhood: every residual counts."""
    problem = prepared(project).problem()
    low, high = problem.unknowns.box
    return problem.evaluate(0.6 * low + 0.4 * high).objective


def project_of(*tests, form="constant", **more):
    return bf.Project.of(tests, bf.Law(form), fabric=FABRIC, **more)


@pytest.fixture(scope="session")
def camera(tmp_path_factory):
    """20 frames of a known law as a camera's software saves them: mm, and MPa."""
    computed = bf.Bubble.of(
        radius=100.0, pressures=PRESSURES, elements=48, symmetry="quarter",
        data={"known_solution": {"beta": KNOWN_LAW}},
    )  # fmt: skip
    (test,) = prepared(project_of(computed)).tests
    path = tmp_path_factory.mktemp("camera") / "camera.npz"
    points = np.column_stack([test.fields[0].points, np.zeros(len(test.fields[0].points))])
    moved = np.array([field.displacement for field in test.fields])
    np.savez(path, points=points, displacements=moved, pressures=PRESSURES)
    return path


@pytest.fixture
def arrays(camera):
    return dict(np.load(camera))


def test_twelve_lines_from_arrays_to_moduli(camera, monkeypatch):
    script = ROOT / "tests" / "typed" / "first_fit.py"
    assert len(script.read_text().splitlines()) <= 12
    monkeypatch.chdir(camera.parent)
    found = runpy.run_path(str(script))
    at_rest = found["moduli"].query("strain == 0").set_index("modulus")
    assert at_rest["MPa"].loc[["E1", "E2"]].tolist() == pytest.approx(
        [400.0, 200.0], rel=0.06
    )  # 48 quads
    assert {path.name for path in camera.parent.iterdir()} == {"camera.npz"}


def test_arrays_lists_and_tables_are_one_bubble(arrays):
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
        (test,) = prepared(project_of(bf.Bubble(*args, radius=100.0, elements=48))).tests
        for field, u, p in zip(test.fields, moved, loads, strict=True):
            assert field.pressure == p
            np.testing.assert_array_equal(field.points, points[:, :2])
            np.testing.assert_array_equal(field.z, points[:, 2])
            np.testing.assert_array_equal(field.displacement, u)


def test_lost_points_and_frames_of_other_points(arrays):
    points, moved, loads = (arrays[name] for name in ("points", "displacements", "pressures"))
    moved[3, 5] = np.nan
    several = [points[: len(points) - k % 3] for k in range(20)]
    ragged = [u[: len(u) - k % 3] for k, u in enumerate(moved)]
    (test,) = prepared(project_of(bf.Bubble(several, ragged, loads, radius=100.0))).tests
    counts = [len(field.points) for field in test.fields]
    assert counts == [len(points) - k % 3 - (k == 3) for k in range(20)]
    assert test.dropped == 1


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
        ({"pressures": lambda a: 1000 * a}, "pressures", "kPa"),
        ({"pressures": lambda a: a[::-1]}, "pressures[1]", "rising"),
        ({"pressures": lambda a: a - a[0]}, "pressures[0]", "above 0"),
        ({"radus": 100.0}, "radus", "'radius'"),
        ({"radius": "wide"}, "radius", "number"),
        ({"sheet": {"mode": 3}}, "sheet.mode", "'modes'"),
        ({"registration": {"centre": [1.0]}}, "registration.centre", "3"),
    ],
)
def test_the_wrong_argument_is_named(arrays, change, argument, words):
    given = {**arrays, "radius": 100.0}
    given |= {k: v(given[k]) if callable(v) else v for k, v in change.items()}
    with pytest.raises(InputError) as caught:
        bf.Bubble(**given)
    assert caught.value.field == argument and words in caught.value.problem


def test_what_only_a_project_can_say_names_the_argument_too(arrays):
    def complaint(*tests, law="constant", **more):
        with pytest.raises(InputError) as caught:
            bf.fit(tests, bf.Law(law), fabric=FABRIC, starts=1, **more)
        return caught.value

    odd = bf.Bubble(**arrays, radius=100.0, symmetry="quarter", sheet=bf.Sheet(modes=2))
    error = complaint(odd)
    assert (error.path, error.field) == ("bubble", "sheet.modes")
    error = complaint(odd, odd.with_keys(name="bubble"))
    assert (error.path, error.field) == ("bubble", "sheet.modes")
    flat = bf.Bubble(**{**arrays, "displacements": arrays["displacements"] * 1e200}, radius=100.0)
    assert "bubblefit-arrays" not in str(complaint(flat))
    good = bf.Bubble(**arrays, radius=100.0, elements=48, symmetry="quarter")
    assert complaint(good, startss=3).field == "startss"
    assert complaint(good, tolerance=-1.0).field == "tolerance"
    assert complaint(good, weights={"strips": 2}).field == "weights.strips"
    assert complaint(good, law="cubic").field == "law.strain_range"
    with pytest.raises(InputError, match=r"^form: .*'spline'"):
        bf.Law("splin")
    with pytest.raises(InputError, match=r"^knot: .*'knots'"):
        bf.Law("spline", knot=6)
    for missing in ("law", "fabric"):
        given = {"law": bf.Law("constant"), "fabric": FABRIC, missing: None}
        with pytest.raises(InputError, match=f"^{missing}: "):
            bf.fit([good], **given)


def test_strips_from_arrays_are_those_of_files(tmp_path):
    read = bf.read_project(constant_strips(tmp_path))
    moduli = {"warp": (300.0, 360.0), "fill": (200.0, 180.0)}
    curves = {
        direction: [(ELONGATION, 20 * e * np.log1p(ELONGATION / 20)) for e in two]
        for direction, two in moduli.items()
    }
    keys = {"match": "points", "increments": 8, "name": "one", "width": 25.0}
    ends = {"warp": {"final_length": 22.9}, "fill": {"final_length": 22.9}}
    table = pd.DataFrame(
        [
            (direction, name, u, load)
            for direction, several in curves.items()
            for name, (us, loads) in zip("ab", several, strict=True)
            for u, load in zip(us, loads, strict=True)
        ],
        columns=["direction", "specimen", "elongation", "load"],
    )
    stacked = {d: [np.column_stack(curve) for curve in two] for d, two in curves.items()}
    law = bf.Law("constant", nu12=0.0, strain_range=[0.12, 0.14, 0.1])
    files = bf.Strips.read(tmp_path / "one.csv", gauge=20, **keys, **ends)
    own = read.tests["one"].strips
    for made in (curves, table, stacked, files):
        if not isinstance(made, bf.Strips):
            made = bf.Strips(made, gauge=20, **keys, **ends)
        project = bf.Project.of(made, law, fabric=FABRIC)
        for direction, strip in project.tests["one"].strips.items():
            for mine, theirs in zip(strip.points, own[direction].points, strict=True):
                np.testing.assert_array_equal(mine, theirs)
    with pytest.raises(InputError, match=r"^curves.warp\[1\]"):
        bf.Strips({"warp": [curves["warp"][0], (ELONGATION, ELONGATION[1:])]})
    with pytest.raises(InputError, match=r"^curves.wrap: .*'warp'"):
        bf.Strips({"wrap": curves["warp"]})
    with pytest.raises(InputError, match="there is no file"):
        bf.Strips.read(tmp_path / "none.csv")
