"""Projects of known laws: `known_bubble`, `constant_strips`, frames of a camera; changed ones."""

import re
from collections.abc import Callable
from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
from bubblefit.experiments.bubble import KIND
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs.law_setup import law_of
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.paths import KNOWN

#: The easy form of bounds, which serves every form of the moduli.
EASY = "[law.bounds]\nE1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.001, 0.2]\n\n"


def replaced_once(text, *changes):
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    return text


def project_file(folder, text, *changes):
    path = folder / "project.toml"
    path.write_text(replaced_once(text, *changes))
    return path


def edited_project(folder, old, new, source=KNOWN, **options):
    return read_project(project_file(folder, source.read_text(), (old, new)), **options)


def fit_setup(project, tests=None):
    """Return the tests of a project, or of its file, that are fitted, with their data."""
    project = project if isinstance(project, bf.Project) else read_project(project)
    return prepare_fit(project, project.chosen(tests, fitted=True))


def known_bubble(folder, *changes):
    """The known-solution example with 48 quads, changed further by replacing text."""
    return project_file(folder, KNOWN.read_text(), ("elements = 800", "elements = 48"), *changes)


def known_bubble_of_form(folder, form):
    """The same with bounds on the moduli and another `[law] form` (lines of TOML)."""
    text = known_bubble(folder).read_text()
    first, last = text.index("# Table 4.2. Order"), text.index("[[bubble]]")
    text = text[:first] + EASY + text[last:]
    margin = next(line for line in text.splitlines() if line.startswith("margin"))
    path = folder / "project.toml"
    path.write_text(text.replace(margin, "").replace('form = "cubic"', form))
    return path


#: A small bubble of a fabric of constant moduli, for the solvers that take their time.
CONSTANT_BUBBLE = """
[fabric]
thickness = 0.81
[law]
form = "constant"
[law.bounds]
lower = [0.03, 0.3, 0.3]
upper = [0.2, 1.0, 1.0]
[[bubble]]
radius = 100.0
pressures = [22, 59]
elements = 32
symmetry = "quarter"
[bubble.data.known_solution]
beta = [0, 0, 0, 0.08, 0, 0, 0, 0.4, 0, 0, 0, 0.8]
"""

#: Strips of a fabric of constant moduli in two tests, the second of the warp only.
CONSTANT_STRIPS = """
[fabric]
name = "made"
thickness = 0.8
lab = "L 7"
[units]
modulus = "GPa"
[law]
form = "constant"
nu12 = 0.0
strain_range = [0.12, 0.14, 0.1]
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.03, 1.0]
G12 = [0.005, 0.2]
[defaults.strips]
increments = 8
match = "points"
[[strips]]
name = "one"
warp = { gauge_length = 20, final_length = 22.9 }
fill = { gauge_length = 20, final_length = 22.9 }
[strips.data]
files = ["one.csv"]
[[strips]]
name = "two"
weight = 3.0
warp = { gauge_length = 20, final_length = 22.5 }
[strips.data]
files = ["two.csv"]
[fit]
starts = 2
seed = 7
"""
#: MPa, of two specimens a direction.
STRIP_MODULI = {
    "one": {"warp": (300.0, 360.0), "fill": (200.0, 180.0)},
    "two": {"warp": (330.0, 410.0)},
}
STRIP_ELONGATION = np.linspace(0.2, 3.0, 12)


def constant_strips(folder, *changes):
    """A project of `STRIPS`, changed by replacing text, and its points.

    Without contraction a load is 0.8 mm times 25 mm times E ln(1 + elongation / 20).
    """
    for test, directions in STRIP_MODULI.items():
        lines = ["direction,specimen,elongation (mm),load (N)"]
        for direction, moduli in directions.items():
            for specimen, modulus in zip("ab", moduli, strict=True):
                loads = 20 * modulus * np.log1p(STRIP_ELONGATION / 20)
                lines += [
                    f"{direction},{specimen},{u!r},{load!r}"
                    for u, load in zip(STRIP_ELONGATION.tolist(), loads.tolist(), strict=True)
                ]
        (folder / f"{test}.csv").write_text("\n".join(lines) + "\n")
    return project_file(folder, CONSTANT_STRIPS, *changes)


def computed_bubble_fields(**keys):
    """Fields of a bubble of a known law, as `[[bubble]]` says it: in mm and MPa."""
    known = {"beta": [0, 0, 0, 9.0, 0, 0, 0, 200.0, 0, 0, 0, 400.0]}
    bubble = bf.Bubble.of(radius=100.0, data={"known_solution": known}, **keys)
    project = bf.Project.of(bubble, bf.Law("constant"), fabric=bf.Fabric("made", thickness=0.8))
    return prepare_fit(project, project.chosen(None)).tests[0].fields


def write_camera_arrays(folder, **keys):
    """Write camera.npz: points, displacements and pressures of `computed_fields`."""
    fields = computed_bubble_fields(**keys)
    points = np.column_stack([fields[0].points, np.zeros(len(fields[0].points))])
    moved = np.array([field.displacement for field in fields])
    pressures = [field.pressure for field in fields]
    np.savez(folder / "camera.npz", points=points, displacements=moved, pressures=pressures)


def write_two_camera_exports(folder):
    """Write one bubble as two cameras export it, turned by 20 degrees: vic_*.csv, davis_*.txt."""
    fields = computed_bubble_fields(pressures=[0.03, 0.06, 0.1], elements=800)
    c, s = np.cos(np.radians(20.0)), np.sin(np.radians(20.0))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for k, field in enumerate(fields):
        places = np.column_stack([field.points, np.zeros(len(field.points))])
        seen = np.column_stack([places @ turn.T + [5.0, 2.0, 300.0], field.displacement @ turn.T])
        names = ["x [m]", "y [m]", "z [m]", "dx [m]", "dy [m]", "dz [m]"]
        metres = pd.DataFrame(seen / 1000, columns=names)
        metres.to_csv(folder / f"vic_{k + 8}.csv", index=False)  # 8, 9, 10
        words = pd.DataFrame(seen).map(lambda x: f"{x:.6f}".replace(".", ","))
        names = [f"{name} [mm]" for name in "XYZUVW"]
        words.to_csv(folder / f"davis_{k}.txt", sep=";", header=names, index=False)
    return fields


COLUMNS = 'columns = { x = "x", y = "y", z = "z", dx = "dx", dy = "dy", dz = "dz" }'
Array = np.ndarray


def known_bubble_in_camera_frames(
    folder: Path, change: Callable[[Array, Array], tuple[Array, Array]]
) -> tuple[str, HypoelasticLaw]:
    """Write frames (frame_0_22kPa.csv ...) of the known solution on 108 quads; a project's text.

    change : of places and displacements (n, 3) mm in the test's frame to those of the files. The
        project ends its table of points with `length_unit`, which takes more lines.
    """
    path = known_bubble(folder, ("elements = 48", "elements = 108"))
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
