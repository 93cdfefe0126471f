"""experiments/bubble/objective.py: the objective of displacement fields."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.inference.objective import Blocks
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver

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
