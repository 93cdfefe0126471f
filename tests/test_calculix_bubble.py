"""The bubble on CalculiX: agreement with the membrane and with published numbers, and the deck."""

import csv
import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.models.bubble import BubbleModel, default_increments
from bubblefit.solvers.base import Solver
from bubblefit.solvers.calculix.bubble import decks
from bubblefit.solvers.calculix.pressure import pressure_forces
from bubblefit.solvers.calculix.shells import shell_mesh
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.decks import OURS, render
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import solver_named

# Table 4.2, MPa.
BETA = 1e3 * np.array(
    [-7.96788e-3, 0.710747, -0.156912, 0.0200439, -10.6241, 13.7830, -0.931830, 0.139437]
    + [-479.622, 212.650, -20.2028, 0.806350]
)
CUBIC = HypoelasticLaw(BETA, strain_range=np.full(3, 0.13))
LINEAR = HypoelasticLaw.linear(800.0, 400.0, 20.0)
PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)
AGREEMENT = 0.003  # of the apex height


def bubble(elements, symmetry="quarter", pressures=PRESSURES):
    mesh = disk_mesh(100.0, elements, symmetry)
    return BubbleModel(mesh, 0.81, pressures, default_increments(pressures))


def differences(element, model, law):
    """Largest difference of apex and of any component anywhere, over the apex height, (frames,)."""
    found = CalculixSolver(element=element).run(model, law)
    expected = MembraneSolver().run(model, law)
    np.testing.assert_allclose(found.load, expected.load)
    apex = model.mesh.node_sets["apex"][0]
    height = expected.displacement[:, apex, 2]
    difference = np.abs(found.displacement - expected.displacement)
    return difference[:, apex, 2] / height, difference.max(axis=(1, 2)) / height, found, expected


# S4 stops at 251 kPa with the cubic law: docs/calculix.md says why.
@pytest.mark.parametrize(
    ("element", "elements", "law", "pressures"),
    [
        ("S8R", 432, CUBIC, PRESSURES),
        ("S8R", 432, LINEAR, PRESSURES),
        ("S4", 1728, LINEAR, PRESSURES),
        ("S4", 1728, CUBIC, PRESSURES[:-1]),
    ],
    ids=["S8R-cubic", "S8R-linear", "S4-linear", "S4-cubic"],
)
def test_agrees_with_the_membrane(ccx, element, elements, law, pressures):
    apex, field, found, expected = differences(element, bubble(elements, "quarter", pressures), law)
    print(element, elements, np.round(100 * apex, 3), np.round(100 * field, 3))
    assert apex.max() < AGREEMENT
    assert field.max() < AGREEMENT
    # Support forces: what the pressure pushes up, the rim and the corners of its sets take.
    up = expected.reactions["rim"][:, 2]
    np.testing.assert_allclose(found.reactions["rim"][:, 2], up, rtol=0.01)
    np.testing.assert_allclose(found.strain_max, expected.strain_max, rtol=0.03)
