"""Builders of the tests of the membrane."""

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.closed_surfaces import half_tube, tube_warp
from bubblefit.meshes.cylinder_model import Bending, InflatedModel, RigidCylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.membrane.beam import Beam
from bubblefit.solvers.membrane.factorisation import tangent_for
from bubblefit.solvers.membrane.kernel import reference_elements
from bubblefit.solvers.membrane.membrane import Membrane

LEVELS = (0.03, 0.1, 0.2)
BUBBLE = BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, LEVELS)
MODELS = {
    "bubble": BUBBLE,
    "warp": straight_strip("warp", 20.0, 20.8, 0.81, increments=4, across=2, along=3),
    "fill": straight_strip("fill", 20.0, 21.5, 0.81, increments=4, across=2, along=3),
    "bias": bias_strip(20.0, 21.0, 0.81, increments=4, across=4, along=12),
}
# Three regions of every strain, with breaks that the strips pass.
TRILINEAR_LAW = HypoelasticLaw.trilinear(
    (800.0, 450.0, 900.0), (140.0, 110.0, 240.0), (20.0, 14.0, 40.0),
    [[0.01, 0.03], [0.02, 0.06], [0.05, 0.2]],
)  # fmt: skip


def beam_history(model, deflection):
    beam = Beam(model, 1e-10)
    x = beam.equilibrium(np.zeros(3 * len(beam.s) + 2), None)
    return beam, beam.reach(x, -x[1], -x[1] + deflection), x


RADIUS, LENGTH, SPAN = 75.0, 600.0, 800.0
POST = RigidCylinder("support", (1.0, 0.0, 0.0), (0.0, 0.0, 0.5 * SPAN), 50.0)
RING = RigidCylinder("collar", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 120.0, True, 145.0, 10.0)


def square_beam(displacements=(2.0, 6.0, 10.0), penalty=5.0, across=8):
    mesh = half_tube(across, 24, RADIUS, LENGTH)
    foot = mesh.node_sets["foot"]
    hang = foot[[np.argmin(np.abs(mesh.points[foot, 2] - 0.5 * SPAN))]]
    mesh = Mesh(mesh.points, mesh.quads, {**mesh.node_sets, "hang": hang})
    return InflatedModel(
        mesh, 0.81, tube_warp(mesh, LENGTH), [0.005, 0.02, 0.05, 0.1],
        {"symmetry_x": (0,), "symmetry_z": (2,), "hang": (1,)}, copies=4,
        bending=Bending([POST], [RING], displacements, released="hang", penalty=penalty),
    )  # fmt: skip


PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
E1, E2, G12, NU, THICKNESS = 300.0, 220.0, 5.0, 0.24, 0.81


def distorted_grid(across, along, width, length, distort=0.0):
    x, y = np.meshgrid(np.linspace(0, length, along + 1), np.linspace(0, width, across + 1))
    points = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    inside = (x > 0) & (x < length) & (y > 0) & (y < width)
    moves = np.random.default_rng(2).uniform(-distort, distort, (int(inside.sum()), 2))
    points[inside.ravel(), :2] += moves * [length / along, width / across]
    corner = (np.arange(across)[:, None] * (along + 1) + np.arange(along)).ravel()
    quads = np.stack([corner, corner + 1, corner + along + 2, corner + along + 1], axis=1)
    return points, quads


def plane_membrane(points, quads, law, held, thickness=THICKNESS, tolerance=1e-11):
    free = np.setdiff1d(np.arange(points.size), held)
    return Membrane(
        points, quads, reference_elements(points, quads), thickness, law, free,
        tangent_for(quads, points, free), tolerance, step_limit=0.1 * np.ptp(points),
    )  # fmt: skip


def quarter_bubble(steps=None):
    mesh = disk_mesh(100.0, 192, "quarter")
    steps = default_increments(PRESSURES) if steps is None else steps
    return BubbleModel(mesh, THICKNESS, PRESSURES, steps)
