"""experiments/bubble/objective.py: the objective of displacement fields, and causes of a misfit."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.inference.assessment import discrepancies
from bubblefit.inference.objective import Blocks
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.spatial.transform import Rotation

from ...builders.projects import fit_setup, known_bubble
from ...inference.cases import MODEL as CASE
from ...inference.cases import reference, targets
from ...support.refusals import complaint
from .cases import cubic_targets, zero_history


def direct_e(model, data, shift=0.0):
    """Return e by Eqs 4.5 to 4.8 as they are printed."""
    total = 0.0
    for frame, target in zip(model, data, strict=True):
        off = target.at_places(frame) + shift - target.displacement
        rms = np.sqrt(np.sum(off**2, axis=0) / len(off))
        total += np.sum(rms / np.max(np.abs(target.displacement), axis=0))
    return total


def test_objective_equals_equations_4_5_to_4_8():
    data = targets()
    other = MembraneSolver().run(CASE, HypoelasticLaw.linear(400.0, 300.0, 15.0))
    objective = FieldObjective(data)
    blocks = Blocks(objective.sizes)
    e = blocks.value(objective.residual(other))
    assert e == pytest.approx(direct_e(other.displacement, data))
    assert blocks.value(objective.residual(reference())) == 0.0
    assert blocks.norms(objective.residual(other)).shape == (21,)
    doubled = FieldObjective(data, weight=2.0)
    assert blocks.value(doubled.residual(other)) == pytest.approx(2 * e)
    millimetres = (other.displacement - reference().displacement).transpose(0, 2, 1).ravel()
    assert doubled.residual(other) * doubled.scale == pytest.approx(millimetres)
    # In millimetres nothing is divided by.
    plain = FieldObjective(data, "mm")
    moved = reference().displacement + np.array([0.0, 0.0, 0.5])
    residual = plain.residual(replace(reference(), displacement=moved))
    assert Blocks(plain.sizes).value(residual) == pytest.approx(7 * 0.5)
    assert plain.mean_absolute(moved) == pytest.approx(0.5)
    fields = reference().displacement.copy()
    fields[2, :, 1] = 0.0
    assert "97 kPa: dy" in complaint(FieldObjective, targets(fields))


def test_objective_between_nodes_with_an_offset():
    random, data = np.random.default_rng(1), []
    for k, p in enumerate(CASE.pressures):
        sample = sp.random(10 + k, len(CASE.mesh.points), 0.1, "csr", random_state=k)
        data.append(FieldTarget(p, random.standard_normal((10 + k, 3)), sample))
    objective, shift = FieldObjective(data), [0.1, -0.2, 0.3]
    nuisance = dict(zip(OFFSETS, shift, strict=True))
    e = Blocks(objective.sizes).value(objective.residual(reference(), nuisance))
    assert e == pytest.approx(direct_e(reference().displacement, data, shift))


@pytest.mark.parametrize("normalise", ["mm", "e"])
def test_field_constant_in_pressure_is_projected_out(normalise):
    some, nodes, frames = cubic_targets()
    plain = FieldObjective(some, normalise, constant=(0, 2))
    field = np.random.default_rng(6).standard_normal((len(nodes), 3)) * [1, 0, 1]
    moved = [replace(t, displacement=t.displacement + t.at_places(field)) for t in some]
    other = FieldObjective(moved, normalise, constant=(0, 2))
    other.scales = plain.scales
    residual = plain.residual(zero_history(frames), {})
    np.testing.assert_allclose(other.residual(zero_history(frames), {}), residual, atol=1e-12)
    # Along y nothing is taken out.
    whole = FieldObjective(some, normalise).residual(zero_history(frames), {})
    middle = np.concatenate([np.repeat([False, True, False], n) for n in plain.sizes[::3]])
    np.testing.assert_allclose(residual[middle], whole[middle])
    assert np.abs(residual - whole)[~middle].min() > 1e-6
    taken = other.constant_field(frames) - plain.constant_field(frames)
    seen = [t.place_numbers for t in some]
    expected = np.concatenate([t.at_places(field) for t in some])
    np.testing.assert_allclose(taken[np.concatenate(seen)], expected, atol=1e-12)
    slope = np.random.default_rng(8).standard_normal((*frames.shape, 2))
    ahead, behind = (
        plain.residual(zero_history(frames + s * slope[..., 1]), {}) for s in (0.5, -0.5)
    )
    np.testing.assert_allclose(plain.jacobian(None, slope)[:, 1], ahead - behind, atol=1e-12)


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
