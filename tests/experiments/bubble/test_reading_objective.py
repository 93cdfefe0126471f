from dataclasses import replace

import numpy as np
import pytest
from bubblefit.experiments.bubble.reading_objective import ReadingObjective, reader_of
from bubblefit.experiments.bubble.readings import ReadingSeries
from bubblefit.meshes.sampling import SmoothReading
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.gauges import (
    LAW,
    PRESSURES,
    THICKNESS,
    bubble_model,
    gauge_heights,
    height_series,
    inflated,
)

PLACES = np.array([[0.0, 0.0], [50.0, 0.0], [0.0, -50.0], [-60.0, 55.0]])


def objective_at(places, model, moves_with_sheet=False):
    reading = SmoothReading.of(model.mesh)
    series = [
        height_series(xy, moves_with_sheet=moves_with_sheet, value=np.ones(len(PRESSURES)))
        for xy in places
    ]
    readers = [reader_of(s, PRESSURES, reading) for s in series]
    return ReadingObjective(readers, "mm", 1.0, {})


def test_gauge_reads_the_point_that_has_moved_below_it():
    model, history = inflated()
    heights = np.array(objective_at(PLACES, model).modelled(history.displacement, {})).T
    np.testing.assert_allclose(heights, gauge_heights(PLACES), atol=0.02)
    moves_with_sheet = np.array(
        objective_at(PLACES, model, True).modelled(history.displacement, {})
    ).T
    assert np.abs(moves_with_sheet - gauge_heights(PLACES))[-1, 1:].min() > 0.1
    np.testing.assert_allclose(moves_with_sheet[:, 0], heights[:, 0], atol=1e-9)


@pytest.mark.parametrize("moves_with_sheet", [True, False])
def test_derivatives_are_those_of_differences(moves_with_sheet):
    model = bubble_model(48)
    names = ["beta_0", "beta_4", "pressure_offset"]
    history, slope = MembraneSolver().run_with_sensitivity(model, LAW, names)
    objective = objective_at(PLACES, model, moves_with_sheet)
    jacobian = objective.jacobian(history, slope)
    for k, step in enumerate([1.0, 1.0, 1e-4]):
        ends = [
            objective.residual(replace(history, displacement=history.displacement + d))
            for d in (step * slope[..., k], -step * slope[..., k])
        ]
        difference = (ends[0] - ends[1]) / (2 * step)
        size = np.abs(difference).max()
        np.testing.assert_allclose(jacobian[:, k], difference, atol=2e-3 * size)


def apex_objective(model, quantities=("curvature", "strain")):
    n = len(PRESSURES)
    series = [
        ReadingSeries(
            quantity,
            f"{quantity} along {direction}",
            np.array(PRESSURES),
            np.linspace(0.1, 1.0, n),
            np.zeros((n, 2)),
            np.zeros(n, dtype=int),
            direction=direction,
            span=20.0,
        )
        for quantity in quantities
        for direction in ((1.0, 0.0), (0.0, 1.0))
    ]
    reading = SmoothReading.of(model.mesh)
    return ReadingObjective([reader_of(s, PRESSURES, reading) for s in series], "e", 1.0, {})


def test_apex_has_the_curvature_and_the_strain_of_its_equilibrium():
    """n1 k1 + n2 k2 = p with the stresses of the law."""
    model, history = inflated()
    k1, k2, e1, e2 = apex_objective(model).modelled(history.displacement, {})
    centre = int(model.mesh.node_sets["apex"][0])
    quad = next(k for k, nodes in enumerate(model.mesh.quads) if centre in nodes)
    complete = replace(history, model=model, law=LAW)
    strain = np.expm1(complete.strain()[:, quad])
    np.testing.assert_allclose(e1, strain[:, 0], rtol=0.03)
    np.testing.assert_allclose(e2, strain[:, 1], rtol=0.03)
    n1, n2 = THICKNESS * complete.stress()[:, quad, :2].T
    np.testing.assert_allclose(n1 * k1 + n2 * k2, PRESSURES, rtol=0.05)


def test_derivatives_of_curvature_and_strain_are_those_of_differences():
    model = bubble_model(48)
    history, slope = MembraneSolver().run_with_sensitivity(model, LAW, ["beta_0", "beta_4"])
    objective = apex_objective(model)
    jacobian = objective.jacobian(history, slope)
    for k in range(2):
        ends = [
            objective.residual(replace(history, displacement=history.displacement + d))
            for d in (slope[..., k], -slope[..., k])
        ]
        difference = (ends[0] - ends[1]) / 2
        size = np.abs(difference).max()
        np.testing.assert_allclose(jacobian[:, k], difference, atol=1e-4 * size)


def test_series_of_several_quantities_are_compared_by_their_noise():
    model, _ = inflated()
    objective = apex_objective(model)
    assert (objective.unit, objective.least_noise) == ("sigma", 1.0)
    assert objective.noises == (0.01, 0.01, 1e-4, 1e-4)
    single = apex_objective(model, ["strain"])
    assert single.unit == "%" and single.least_noise == pytest.approx(0.01)


def test_noise_is_stated_or_not_as_that_of_the_first_series():
    model, _ = inflated()
    objective = apex_objective(model)
    readers = objective.readers[1:]  # curvature, strain, strain
    for stated, noise_is in (("curvature", "given"), ("strain", "assumed")):
        mixed = ReadingObjective(readers, "e", 1.0, {stated: 0.02})
        assert mixed.noise_is == noise_is and 0.02 in mixed.noises


def test_offset_of_a_gauge_moves_its_readings_alone():
    model, history = inflated()
    objective = objective_at(PLACES, model)
    assert objective.height_offsets == tuple(f"height_offset_{k}" for k in (1, 2, 3, 4))
    moved = objective.residual(history, {"height_offset_2": 0.5}) - objective.residual(history)
    column = objective.nuisance_columns(["height_offset_2"], {}, history)[:, 0]
    np.testing.assert_allclose(moved, 0.5 * column)
    assert np.flatnonzero(column).tolist() == list(range(6, 12))


def test_scale_of_heights_is_common_to_all_gauges():
    model, history = inflated()
    objective = objective_at(PLACES, model)
    scaled = objective.residual(history, {"height_scale": 2.0}) - objective.residual(history)
    names = ["height_scale", "height_offset_1"]
    column = objective.nuisance_columns(names, {}, history)[:, 0]
    np.testing.assert_allclose(scaled, 2.0 * column)
    heights = np.concatenate(objective.modelled(history.displacement, {}))
    np.testing.assert_allclose(scaled * objective.divisor, 0.02 * heights)
    curvatures = apex_objective(model, ["curvature"])
    assert not curvatures.nuisance_columns(names[:1], {}, history).any()


def test_relative_errors_are_those_of_the_largest_reading():
    model, history = inflated()
    series = height_series([0, 0], value=gauge_heights(PLACES[:1])[:, 0] + 0.3)
    reader = reader_of(series, PRESSURES, SmoothReading.of(model.mesh))
    relative = ReadingObjective([reader], "e", 1.0, {"height": 0.1})
    residual = relative.residual(history)
    assert np.linalg.norm(residual) == pytest.approx(0.3 / series.value.max(), rel=0.1)
    np.testing.assert_allclose(residual * relative.scale, -0.3, atol=0.02)
    assert (relative.unit, relative.least_noise, relative.noise_is) == ("mm", 0.1, "given")


def test_surrogate_has_the_residuals_of_the_external_solver():
    model, history = inflated()
    objective = objective_at(PLACES[:2], model)
    surrogate = replace(history, displacement=0.98 * history.displacement)
    shifted = objective.shifted(history, surrogate)
    np.testing.assert_allclose(shifted.residual(surrogate), objective.residual(history), atol=1e-9)
