"""An inflated circular sheet of rubber, as a deck of one's own with its readings.

The deck is axisymmetric: a row of quadratic elements along the radius, a Mooney-Rivlin rubber, and
a pressure from below. What is measured is the height of the apex. CalculiX chooses its increments,
which differ from run to run.
"""

import numpy as np
from bubblefit.experiments.deck.model import DeckModel
from bubblefit.experiments.deck.results import DeckReader, Probe, QuantityReading
from bubblefit.experiments.deck.solvers import ANY_LAW, DeckSolver
from bubblefit.project.project import read_project
from bubblefit.solvers.calculix.solver import CalculixSolver

#: MPa.
TRUE = {"C10": 0.30, "C01": 0.06}
#: Pressure (MPa) at time 1, and pressures of the readings.
PRESSURE = 0.024
READINGS = np.linspace(0.002, PRESSURE, 12)
#: mm: standard deviation of a height.
NOISE = 0.1

DECK = """\
{% set n = 4 %}
** Radius 50 mm, thickness 1 mm; x is the radius, y the axis.
*NODE, NSET=ALL
{% for i in range(2 * n + 1) %}
{% for j in range(3) %}
{{ 1 + 3 * i + j }}, {{ (25 * i / n) | number }}, {{ j / 2 }}, 0.
{% endfor %}
{% endfor %}
*ELEMENT, TYPE=CAX8R, ELSET=SHEET
{% for k in range(n) %}
{% set a = 1 + 6 * k %}
{{ k + 1 }}, {{ a }}, {{ a + 6 }}, {{ a + 8 }}, {{ a + 2 }},
{{ a + 3 }}, {{ a + 7 }}, {{ a + 5 }}, {{ a + 1 }}
{% endfor %}
*NSET, NSET=AXIS, GENERATE
1, 3
*NSET, NSET=APEX
2
*NSET, NSET=RIM, GENERATE
{{ 6 * n + 1 }}, {{ 6 * n + 3 }}
*MATERIAL, NAME=RUBBER
*HYPERELASTIC, MOONEY-RIVLIN
{{ C10 | number }}, {{ C01 | number }}, 0.1
*SOLID SECTION, ELSET=SHEET, MATERIAL=RUBBER
*BOUNDARY
AXIS, 1
RIM, 1, 2
*STEP, NLGEOM, INC=200
*STATIC
0.05, 1., 1e-4, 0.1
*DLOAD
SHEET, P1, 0.024
*NODE FILE
U
*END STEP
"""
PROJECT = """\
[fabric]
name = "rubber"
thickness = 1.0

[law]
form = "none"

[fit]
starts = 1

[[deck]]
name = "bulge"
template = "bulge.inp.j2"

[deck.parameters]
C10 = {{ bounds = [0.2, 0.45], unit = "MPa" }}
C01 = {{ bounds = [0.02, 0.15], unit = "MPa" }}
feasible = "C10 + C01 > 0"

[[deck.compare]]
measured = "heights.csv"
x = {{ column = "pressure", time = {pressure} }}
y = {{ column = "height", set = "APEX", displacement = "y", unit = "mm" }}
noise = {noise}
"""


def bulge_heights(folder, constants=TRUE):
    """Return the heights (mm) that the deck computes at the readings."""
    (folder / "bulge.inp.j2").write_text(DECK)
    height = Probe("displacement", "APEX", 1)
    reading = QuantityReading(Probe("time", scale=PRESSURE), height, READINGS)
    reader = DeckReader((reading,), "job.frd")
    model = DeckModel(folder, "bulge.inp.j2", constants, {}, "", 1.0, reader)
    return DeckSolver(CalculixSolver()).run(model, ANY_LAW).load


def bulge_project(folder, heights, seed):
    """Return a project whose readings are these heights with noise."""
    (folder / "bulge.inp.j2").write_text(DECK)
    noisy = heights + NOISE * np.random.default_rng(seed).normal(size=len(heights))
    rows = [f"{p:.6g},{h:.6f}" for p, h in zip(READINGS, noisy, strict=True)]
    (folder / "heights.csv").write_text("\n".join(["pressure,height", *rows]) + "\n")
    path = folder / "project.toml"
    path.write_text(PROJECT.format(pressure=PRESSURE, noise=NOISE))
    return read_project(path)
