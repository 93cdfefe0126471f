"""Projects of the measured tests of VALMEX 7318: the fabric, bubbles 1 to 3 and the strips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

HERE = Path(__file__).resolve().parent.parent
DATA = HERE.parent / "shared" / "data" / "bubble"
CURVES = HERE / "examples" / "joint-valmex7318" / "curves.csv"
#: Eleven of the twenty frames, evenly spread and the last.
FEW = (0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 19)
FABRIC = """\
[fabric]
name = "VALMEX 7318"
thickness = 0.81
thickness_change = "incompressible"

[units]
modulus = "GPa"
pressure = "bar"

[law.bounds]
E1 = [0.01, 3.0]
E2 = [0.01, 2.0]
G12 = [0.0005, 0.2]

[law]
"""
BUBBLE = """
[[bubble]]
name = "{name}"
radius = 100.0
pressures = {pressures}
elements = {elements}
objective = "mm"

[bubble.sheet]
modes = {modes}

[bubble.data.points]
pattern = "grid/test{test}_{{index:02d}}.csv"
indices = {frames}
flag_column = "flag"
"""
STRIPS = """
[[strips]]
name = "strips"
width = 25.0
grip_distance = 75.0
increments = {increments}

[strips.data]
polynomials = "{curves}"
"""
FIT = "\n[fit]\nstarts = {starts}\nseed = 1\njobs = 1\nmax_analyses = 80\n"


def bubbles(
    tests: Mapping[str, int], data: Path, frames: Sequence[int], elements: int, modes: int
) -> str:
    """Of a project: measured tests by name, with the measured pressures of the frames."""
    table = pd.read_csv(data / "grid_pressures.csv")
    pressures = [float(table["p_bar"][k]) for k in frames]
    said = {"pressures": pressures, "frames": list(frames), "elements": elements, "modes": modes}
    return "".join(BUBBLE.format(name=name, test=test, **said) for name, test in tests.items())


def published_strips(increments: int = 100) -> str:
    """Of a project: the published strips by their load polynomials."""
    return STRIPS.format(curves=CURVES, increments=increments)
