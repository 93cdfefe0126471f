"""A computed bubble as a camera would see it, for tests of measured data."""

import re
from collections.abc import Callable
from pathlib import Path

import bubblefit as bf
import numpy as np
from bubblefit.experiments.bubble import KIND
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.law_setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver

from .projects import small

COLUMNS = 'columns = { x = "x", y = "y", z = "z", dx = "dx", dy = "dy", dz = "dz" }'
Array = np.ndarray


def camera_project(
    folder: Path, change: Callable[[Array, Array], tuple[Array, Array]]
) -> tuple[str, HypoelasticLaw]:
    """Write frames (frame_0_22kPa.csv ...) of the known solution on 108 quads; a project's text.

    change : of places and displacements (n, 3) mm in the test's frame to those of the files. The
        project ends its table of points with `length_unit`, which takes more lines.
    """
    path = small(folder, ("elements = 48", "elements = 108"))
    text = path.read_text()
    path.write_text(text.replace('symmetry = "quarter"', 'symmetry = "full"'))
    project = bf.read_project(path)
    test = project.tests["bubble"]
    computed = KIND.prepare(test, law_of(project, [test.reach]), MembraneSolver)
    files = [f"frame_{k}_{1e3 * f.pressure:.6g}kPa.csv" for k, f in enumerate(computed.fields)]
    for name, field in zip(files, computed.fields, strict=True):
        flat = np.column_stack([field.points, np.zeros(len(field.points))])
        table = np.hstack(change(flat, field.displacement))
        np.savetxt(
            folder / name, table, delimiter=",", header="x,y,z,dx,dy,dz", comments="", fmt="%.9g"
        )
    points = f'[bubble.data.points]\nfiles = {files}\n{COLUMNS}\nlength_unit = "mm"\n\n'
    data = re.compile(r"(?ms)^\[bubble\.data\.known_solution\].*?(?=^\[fit\])")
    return data.sub(points, text), computed.known
