"""Residuals of displacement fields, beside their definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from bubblefit.errors import InputError
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective, FieldTarget
from bubblefit.inference.comparison import Blocks
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...inference.cases import MODEL, reference, targets


def direct_e(model: np.ndarray, data: list[FieldTarget]) -> float:
    """Eqs 4.5 to 4.8 as they are printed."""
    total = 0.0
    for frame, target in zip(model, data, strict=True):
        measured = target.displacement
        for axis in range(3):
            difference = target.at(frame)[:, axis] - measured[:, axis]
            rms = np.sqrt(np.sum(difference**2) / len(measured))
            total += rms / np.max(np.abs(measured[:, axis]))
    return total


def test_e_against_a_direct_evaluation() -> None:
    data = targets()
    other = MembraneSolver().run(MODEL, HypoelasticLaw.linear(400.0, 300.0, 15.0))
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


def test_e_between_the_nodes_and_with_an_offset() -> None:
    """Places that are not nodes, another number of them at each pressure, a rigid offset."""
    random = np.random.default_rng(1)
    data = []
    for k, p in enumerate(MODEL.pressures):
        rows = 10 + k
        sample = sp.random(rows, len(MODEL.mesh.points), 0.1, "csr", random_state=k)
        data.append(FieldTarget(p, random.standard_normal((rows, 3)), sample))
    objective, shift = FieldObjective(data), np.array([0.1, -0.2, 0.3])
    u = reference().displacement
    total = 0.0
    for frame, target in zip(u, data, strict=True):
        gap = target.sample @ frame + shift - target.displacement
        total += (np.sqrt((gap**2).mean(axis=0)) / np.abs(target.displacement).max(axis=0)).sum()
    nuisance = dict(zip(OFFSETS, shift, strict=True))
    e = Blocks(objective.sizes).value(objective.residual(reference(), nuisance))
    assert e == pytest.approx(total)


def test_millimetres_are_not_normalised() -> None:
    objective = FieldObjective(targets(), "mm")
    moved = reference().displacement + np.array([0.0, 0.0, 0.5])
    e = Blocks(objective.sizes).value(objective.residual(replace(reference(), displacement=moved)))
    assert e == pytest.approx(7 * 0.5)
    assert objective.mean_absolute(moved) == pytest.approx(0.5)


def test_data_without_displacement_are_refused() -> None:
    fields = reference().displacement.copy()
    fields[2, :, 1] = 0.0
    with pytest.raises(InputError, match="97 kPa: dy is zero"):
        FieldObjective(targets(fields))
