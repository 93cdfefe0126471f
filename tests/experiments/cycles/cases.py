"""Builders of the tests of cycles."""

from dataclasses import replace
from itertools import pairwise

import bubblefit as bf
import numpy as np
from bubblefit.materials.forms.spline import Spline
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import Memory
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.load_histories import write_history

CYCLES_PROJECT = """
[fabric]
name = "made"
thickness = 0.8
[units]
modulus = "MPa"
[law]
form = "spline"
knots = {{ warp = [0.0, 0.04, 0.08], fill = [0.0, 0.04, 0.08], shear = [0.0, 1.0] }}
strain_range = [0.08, 0.08, 1.0]
[law.bounds]
E1 = [20.0, 2000.0]
E2 = [20.0, 1000.0]
G12 = [1.0, 200.0]
[law.memory]
warp = "fitted"
fill = "fitted"
[[cycles]]
name = "loops"
files = {{ warp = ["warp.csv"], fill = ["fill.csv"] }}
width = 50.0
reference_load = 5.0
increments = {increments}
[fit]
jobs = 1
"""
CYCLES_MEMORY = Memory((0.45, 0.55, 0.0), (1.7, 1.6, 1.0), (1.2, 1.3, 1.0), (4.0, 2.0, 0.0))
CYCLES_BETA = np.array([15.0, 15.0, 300.0, 220.0, 350.0, 900.0, 500.0, 800.0])


def loops_project(folder, increments, points):
    """A project of strips along warp and fill through three loops, computed by their own model."""
    form = Spline.at([[0.0, 0.04, 0.08], [0.0, 0.04, 0.08], [0.0, 1.0]])
    law = HypoelasticLaw(CYCLES_BETA, 0.24, [0.08, 0.08, 1.0], form=form, memory=CYCLES_MEMORY)
    for k, yarn in enumerate(("warp", "fill")):
        low, last = (CYCLES_MEMORY.kept(k, top) - 1e-3 for top in (0.05, 0.075))
        turns = pairwise([0.0, 0.05, low, 0.05, low, 0.075, last])
        strain = np.concatenate([np.linspace(a, b, points)[1:] for a, b in turns])
        one = straight_strip(yarn, 100.0, 200.0, 0.8, 50.0, increments=1, across=1, along=1)
        path = replace(one, elongations=(100.0 * strain).tolist(), unloaded=True)
        load = 5.0 + MembraneSolver().run(path, law).load
        columns = np.r_[0.0, 5.0, load], np.r_[-0.01, 0.0, strain]
        write_history(folder / f"{yarn}.csv", ["load_N,strain"], columns)
    (folder / "project.toml").write_text(CYCLES_PROJECT.format(increments=increments))
    return bf.read_project(folder / "project.toml")
