"""Builders of the tests of cylinders."""

from types import SimpleNamespace

import numpy as np
from bubblefit.experiments.cylinder.test import CylinderTest
from bubblefit.project.project import read_project
from bubblefit.solvers.base import History

from ...support.paths import EXAMPLES

#: mm over which slopes are taken here.
OVER = 20.0
WAY = np.linspace(0.0, 240.0, 61)
NONE = np.empty(0)


def run_of_curve(*values: float) -> np.ndarray:
    return np.array(values, dtype=float)


# Records
SMALL_CYLINDER = SimpleNamespace(deflections=(10.0, 20.0))


def cylinder_history(frames: int = 3, **other) -> History:
    given = {
        "cavity_pressure": run_of_curve(0.1, 0.101, 0.102)[:frames],
        "cavity_volume": 5e7 - np.arange(frames),
    } | other
    moved = np.arange(frames * 6.0).reshape(frames, 2, 3)
    return History(np.arange(frames) * 50.0, moved, np.zeros(3), np.zeros(3), **given)


CYLINDER_EXAMPLE = EXAMPLES / "bend-valmex7318" / "project.toml"
# Thesis Tables 3.2 and 5.4, GPa.
TABLES = {
    "uniaxial": [-7.96599e-3, 7.49311e-1, -1.50931e-1, 2.05148e-2, -1.13743e1, 1.07160e1,
                 -6.17621e-1, 1.41287e-1, -4.78030e2, 2.11227e2, -2.02600e1, 8.15340e-1],
    "bubble 1": [-1.28170e-3, 9.49079e-1, -4.48869e-2, 8.04287e-2, 9.70652e1, 1.23017e1,
                 -2.75939e0, 1.18880e-1, -1.59163e2, 3.81894e2, -4.04413e1, 1.17116e0],
    "bubble 2": [-4.42858e-3, 9.87096e-1, -2.05457e-1, 9.33764e-2, 6.73425e1, 1.46374e1,
                 -3.42911e0, 1.46766e-1, -3.81685e2, 1.32145e2, -1.26632e1, 7.42916e-1],
    "bubble 3": [-1.09230e-3, 8.24376e-1, -1.73231e-1, 1.22820e-1, 9.99878e1, -2.19352e0,
                 -2.44582e0, 1.89481e-1, -3.65789e2, 3.07545e2, -3.34450e1, 9.89845e-1],
    "bubble 4": [-2.97973e-3, 3.67627e-1, -1.01234e-1, 8.26297e-2, 8.17789e1, 1.56849e1,
                 -4.03842e0, 1.81033e-1, -2.89436e2, 9.75725e1, -9.87010e0, 5.63206e-1],
}  # fmt: skip
TABLE_6_1 = {150.0: (90, 110, 140), 200.0: (60, 80, 100), 250.0: (50, 65, 85)}
PLAIN_MEMBRANE = (
    '[fabric]\nname = "f"\nthickness = 0.8\n[[cylinder]]\ndiameter = 150.0\npressure = 90.0\n'
    "element_size = 60.0\ndeflections = [2.0]\n"
)


def cylinders_of_project(path) -> list[CylinderTest]:
    return list(read_project(path).tests.values())


BEAM = """[fabric]
name = "braid"
thickness = 1.0
[units]
pressure = "kPa"
[[cylinder]]
name = "beam"
model = "beam"
diameter = 340.0
pressure = 80.0
span = 3000.0
load_spacing = 1000.0
roller_below_axis = 300.0
mass_per_length = 2.0
deflections = [20.0, 40.0]
places = [40.0]
wall = { pressure = [60.0, 100.0], yarn = [1000.0, 2000.0], yarn_shear = 2.0, angle = 65.0, bladder = 9.6, bladder_shear = 3.3 }
[[cylinder.cord]]
angle = 0.0
strain = [0.0, 0.002, 0.02]
force = [0.0, 200.0, 14000.0]
[[cylinder.cord]]
angle = 180.0
stiffness = 8e5
"""  # noqa: E501
