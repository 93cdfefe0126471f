"""experiments/bubble/causes.py: causes that a residual points to."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference.assessment import discrepancies
from bubblefit.project.project import read_project
from scipy.spatial.transform import Rotation

from ...builders.projects import fit_setup, known_bubble


def misplaced(name):
    """The field as measured: 1 mm off the centre, turned, tilted, 3 mm off along a diagonal."""
    turn = Rotation.from_euler("zy", {"turn": [3, 0], "tilt": [0, 1]}.get(name, [0, 0]), True)
    beside = np.array([1.0, -0.5]) if name == "centre" else np.zeros(2)

    def moved(one):
        at = np.column_stack([one.points[:, :2], np.zeros(len(one.points))])
        at = turn.apply(at)[:, :2] if name == "turn" else at[:, :2]
        displacement = turn.apply(one.displacement)
        if name == "stripe":
            # Near enough to the others that the points are matched.
            displacement[np.abs(at[:, 0] - at[:, 1]) < 3.0, 2] += 0.5
        return replace(one, points=at + beside, displacement=displacement)

    return moved


@pytest.fixture(scope="module")
def cubic_fields(tmp_path_factory):
    """Cubic moduli on a full disk of 192 quads, and its fields inside 90 mm with 1 um of noise."""
    folder, random = tmp_path_factory.mktemp("causes"), np.random.default_rng(0)
    project = read_project(known_bubble(folder, ("elements = 48", "elements = 192"), FULL, FRAMES))
    (prepared,) = fit_setup(project).tests
    seen = []
    for one in prepared.fields_to_match:
        some = np.hypot(*one.points[:, :2].T) < 90
        noise = 1e-3 * random.standard_normal((some.sum(), 3))
        seen.append(
            replace(one, points=one.points[some], displacement=one.displacement[some] + noise)
        )
    return project, tuple(seen)


FULL = 'symmetry = "quarter"', 'symmetry = "full"'
FRAMES = "[22, 59, 97, 132, 186, 251, 300]", "[60, 120, 180, 240, 300]"
LATE_ONCE = "[22, 59, 97, 132, 186, 251, 300]", "[60, 125, 180, 240, 300]"
LATE = "[22, 59, 97, 132, 186, 251, 300]", "[65, 125, 185, 245, 305]"
STRETCHED = 'thickness_change = "constant"', 'thickness_change = "incompressible"'


@pytest.mark.parametrize(
    ("name", "change", "words", "amounts"),
    [
        ("radius", ("radius = 100.0", "radius = 101.0"), "radius", [-1.0]),
        ("centre", FULL, "centre", [1.0, -0.5]),
        ("turn", FULL, "axes", [3.0]),
        ("tilt", FULL, "tilt", [0.0, 1.0]),
        ("pressure", LATE, "pressures", [5.0]),
        ("single pressure", LATE_ONCE, "alone (a wrong frame)", [5.0, 125.0]),
        ("stripe", FULL, "values far off all others", [100.0, 65.0]),
        ("thickness", STRETCHED, "thickness_change", [100.0]),
    ],
)
def test_residual_points_to_its_cause(cubic_fields, tmp_path, name, change, words, amounts):
    _, seen = cubic_fields
    frames = () if change in (LATE, LATE_ONCE) else (FRAMES,)
    changes = (FULL, *frames) if change is FULL else (FULL, *frames, change)
    setup = fit_setup(known_bubble(tmp_path, ("elements = 48", "elements = 192"), *changes))
    (own,) = setup.tests
    fields = [
        replace(misplaced(name)(one), pressure=p)
        for one, p in zip(seen, own.test.pressures, strict=True)
    ]
    measured = replace(own, fields=tuple(fields), known=None, by_this_model=False)
    problem = replace(setup, tests=(measured,)).problem()
    beta = own.known.beta[list(problem.unknowns.free)]
    point = problem.evaluate(problem.unknowns.at(beta), True)
    no_doubt = np.zeros_like(point.residual)
    found = discrepancies(problem, point.residual, no_doubt, point, lambda step: 0.0)["bubble"]
    assert found.is_significant
    first = found.causes[0]
    assert words in first.description and first.explained_share > 0.8, found.causes
    # Moduli take up most of the difference between two frames whose pressures may be off.
    others = [cause for cause in found.causes[1:] if "alone" not in cause.description]
    assert all(cause.explained_share < 0.5 * first.explained_share for cause in others), others
    said = [float(n) for n in re.findall(r"[-+]?\d+\.?\d*(?:e-\d+)?", first.description)]
    assert said == pytest.approx(amounts, abs=0.1, rel=0.2)
