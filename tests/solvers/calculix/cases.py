"""Builders of the tests with CalculiX."""

from dataclasses import replace

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.meshes.strip_models import bias_strip, straight_strip

from ...builders.laws import TABLE_3_2
from ...support.commands import write_program
from ...support.refusals import raised

PRESSURES = (0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.3)


def bubble_model_of(elements, symmetry="quarter", pressures=PRESSURES):
    mesh = disk_mesh(100.0, elements, symmetry)
    return BubbleModel(mesh, 0.81, pressures, default_increments(pressures))


def uneven_bubble(elements, pressures):
    flat = bubble_model_of(elements, "full", pressures)
    points = flat.mesh.points + np.outer(
        5.0 * disk_modes(flat.mesh.points / 100.0, 1)["z0_1"], [0, 0, 1]
    )
    rim = flat.mesh.points[flat.mesh.node_sets["rim"]]
    share = np.array(flat.increments)[:, None, None] / pressures[-1]
    motion = share * (0.01 * rim * [1.0, 0.5, 0.0] + [0.0, 0.0, 1.5])
    mesh = replace(flat.mesh, points=points)
    return replace(flat, mesh=mesh, slack=(0.003, 0.001), rim_motion=motion)


LINEAR_LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)
STA = """SUMMARY OF JOB INFORMATION
  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME
     1          1     1U   12  0.000000E+00  0.000000E+00  0.100000E+01
     1          1     2    10  0.300000E-02  0.300000E-02  0.300000E-02
     1          2     1     5  0.600000E-02  0.600000E-02  0.300000E-02
"""


def small_bubble():
    return BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.81, (0.01, 0.03))


def failure_of(solver, **options):
    found = raised(SolverFailure, "", solver.run, small_bubble(), LINEAR_LAW, **options)
    assert found.scratch.is_dir()
    assert (found.scratch / "job.inp").exists()
    return found


GIVE = "echo Job finished"
TOLD = f"cat > job.sta <<'.'\n{STA}.\n"
# Held beyond the strains that the tests reached: E1 is negative beyond 0.33, which the corners of
# the grips get near.
STRIP_LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2), strain_range=[0.153, 0.232, 0.7])
# Thesis Table 3.1, mm.
WARP, FILL, BIAS = (20.022, 23.329), (22.780, 28.721), (19.767, 30.734)
WIDTH, THICKNESS = 25.0, 0.81
COARSE, SOME = {"across": 4, "along": 12}, {"across": 6, "along": 18}


def strip_model_of(name, increments=100, **counts):
    if name == "bias":
        return bias_strip(*BIAS, THICKNESS, increments=increments, **counts)
    lengths = WARP if name == "warp" else FILL
    return straight_strip(name, *lengths, THICKNESS, increments=increments, **counts)


def fake_ccx_program(path, version="2.99", then="exit 0"):
    return write_program(
        path, f'#!/bin/sh\n[ "$1" = -v ] && echo "This is Version {version}"\n{then}\n'
    )
