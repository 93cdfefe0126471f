"""Virtual work on a measured shape: fields, and the step to equilibrium."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.inference.virtual_work import disk_fields
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, MeasuredShape
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.solver import MembraneSolver

KNOWN_LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0)


RISING = (0.05, 0.1)


@pytest.fixture(scope="module")
def model():
    mesh = disk_mesh(100.0, 60, "quarter")
    return BubbleModel(mesh, 0.8, RISING, modes=disk_modes(mesh.points[:, :2] / 100.0, 1))


def shape_of(model, moved, fields=None):
    if fields is None:  # everything that is not held
        fields = np.delete(np.eye(model.mesh.points.size), model.fixed, axis=1)
    return MeasuredShape.of(model, moved, fields)


@pytest.mark.parametrize("band", [factorisation.LARGEST_BAND, 0])
def test_step_to_equilibrium_is_that_of_newton(model, band, monkeypatch):
    monkeypatch.setattr(factorisation, "LARGEST_BAND", band)
    here, slope = MembraneSolver(1e-12).run_with_sensitivity(model, KNOWN_LAW)
    solver, shape = MembraneSolver(), shape_of(model, here.displacement)
    history, by = solver.run_with_sensitivity(shape, KNOWN_LAW)
    assert np.abs(history.displacement).max() < 1e-7
    # At the equilibrium of the first frame the derivatives are those of the solution; later ones
    # have in the solution what the law remembers, which is nothing where moduli are constant.
    np.testing.assert_allclose(by[0], slope[0], atol=1e-6 * np.abs(slope[0]).max())
    np.testing.assert_allclose(by[1], slope[1], atol=2e-3 * np.abs(slope[1]).max())
    softer = replace(KNOWN_LAW, beta=KNOWN_LAW.beta * 0.999)
    moved = MembraneSolver(1e-12).run(model, softer).displacement - here.displacement
    step = solver.run(shape, softer).displacement
    np.testing.assert_allclose(step, moved, atol=3e-3 * np.abs(moved).max())


@pytest.mark.parametrize("name, by", [
    ("beta_3", 1e-3), ("beta_11", 0.1), ("nu12", 1e-4), ("pressure_offset", 1e-6), ("z0_1", 1e-3)
])  # fmt: skip
def test_derivatives_of_step_follow_differences_at_equilibrium(model, name, by):
    solver = MembraneSolver(1e-12)
    shape = shape_of(model, solver.run(model, KNOWN_LAW).displacement)
    _, slope = solver.run_with_sensitivity(shape, KNOWN_LAW, [name])
    ends = []
    for step in (by, -by):
        law, place = KNOWN_LAW, shape
        if name.startswith("beta"):
            law = replace(KNOWN_LAW, beta=KNOWN_LAW.beta + step * np.eye(12)[int(name[5:])])
        elif name == "nu12":
            law = replace(KNOWN_LAW, nu12=KNOWN_LAW.nu12 + step)
        else:
            place = shape.with_parameters({name: step})
        ends.append(solver.run(place, law).displacement)
    difference = (ends[0] - ends[1]) / (2 * by)
    np.testing.assert_allclose(slope[..., 0], difference, atol=1e-4 * np.abs(difference).max())


def test_virtual_fields_vanish_on_rim_and_are_symmetric():
    turn = np.linspace(0, 2 * np.pi, 7)
    rim = np.column_stack([np.cos(turn), np.sin(turn)])
    assert all(np.abs(shape).max() < 1e-12 for shape in disk_fields(rim))
    inside = 0.7 * rim + 0.01
    for axis in (0, 1):
        mirror = inside * np.where(np.arange(2) == axis, -1.0, 1.0)
        for k, (own, other) in enumerate(
            zip(disk_fields(inside), disk_fields(mirror), strict=True)
        ):
            np.testing.assert_allclose(own * (-1.0 if k == axis else 1.0), other, atol=1e-12)
    assert [shape.shape[1] for shape in disk_fields(inside)] == [10, 10, 10]
