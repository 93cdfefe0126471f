"""An inflated cylinder in bending on finer and finer meshes, or with more and more increments.

Usage: bench_cylinder_mesh.py [elements|increments] [LEVELS]. 150 mm at 140 kPa with the card of
Table 4.2, quarter, to 120 mm in 30 steps, membrane solver with a tension field; LEVELS (2 unless
given) from `element_size` 46.8, at which the quads around the cylinder are halved exactly. With 3
it makes the table of docs/how-to/studies.md.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import bubblefit as bf
import numpy as np
from bubblefit.materials.card import MaterialCard
from bubblefit.runs.refinement import refine
from known_solution import known_model_and_law

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "bend-valmex7318" / "project.toml"
NAME, SIZE, DEFLECTION, FRAMES = "150 mm, 140 kPa", 46.8, 120.0, 30


def main() -> None:
    what = sys.argv[1] if len(sys.argv) > 1 else "elements"
    levels = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    project = bf.read_project(EXAMPLE)
    project = project.with_solver("membrane", {}, ["wall=tension field"])
    deflections = tuple(map(float, np.linspace(0.0, DEFLECTION, FRAMES + 1)[1:]))
    cylinder: Any = replace(project.tests[NAME], size=SIZE, deflections=deflections)  # type: ignore[call-arg]
    tests: Mapping[str, Any] = {NAME: cylinder}
    _, law = known_model_and_law()
    card = MaterialCard(law, project.fabric.thickness, "Table 4.2")
    found = refine(replace(project, tests=tests), card, NAME, what, levels, coarser=0)  # type: ignore[arg-type]
    print("\n".join(found.lines()))


if __name__ == "__main__":
    main()
