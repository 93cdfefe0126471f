"""Decks of a user's own: a bar of rubber as a command in closed form, and as a deck of CalculiX."""

import sys

import numpy as np
from bubblefit.project.project import read_project
from bubblefit.solvers.settings import PROGRAMS_FROM

#: MPa: Mooney-Rivlin's constants behind the measured forces.
TRUE = {"C10": 0.30, "C01": 0.08}
STRETCHES = np.linspace(1.05, 1.6, 12)

#: Forces of an incompressible bar of 1 mm by 1 mm by 10 mm, from constants in job.txt.
SCRIPT = """\
c10, c01 = (float(word) for word in open("job.txt").read().split()[:2])
rows = ["travel_mm,force_N"]
for k in range(81):
    s = 1.0 + 0.01 * k
    force = 2.0 * (s - s**-2) * (c10 + c01 / s)
    rows.append(f"{10.0 * (s - 1.0):.10g},{force:.12g}")
open("curve.csv", "w").write("\\n".join(rows) + "\\n")
print("solved")
"""

#: A cube of 1 mm pulled along z, one eighth of a bar.
CUBE = """\
*NODE, NSET=ALL
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
5, 0., 0., 1.
6, 1., 0., 1.
7, 1., 1., 1.
8, 0., 1., 1.
*ELEMENT, TYPE=C3D8, ELSET=CUBE
1, 1, 2, 3, 4, 5, 6, 7, 8
*NSET, NSET=GRIP
5, 6, 7, 8
*NSET, NSET=BOTTOM, GENERATE
1, 4
"""
DECK = """\
*INCLUDE, INPUT=cube.inp
*MATERIAL, NAME=RUBBER
*HYPERELASTIC, MOONEY-RIVLIN
{{ C10 | number }}, {{ C01 | number }}, 0.01
*SOLID SECTION, ELSET=CUBE, MATERIAL=RUBBER
*BOUNDARY
BOTTOM, 3
1, 1, 2
4, 1
2, 2
5, 1, 2
8, 1
6, 2
*STEP, NLGEOM, INC=100
*STATIC, DIRECT
0.2, 1.
*BOUNDARY
GRIP, 3, 3, 0.6
*NODE FILE
U, RF
*END STEP
"""
PARAMETERS = """\
[deck.parameters]
C10 = { bounds = [0.05, 3.0], unit = "MPa" }
C01 = { bounds = [0.0, 1.0], unit = "MPa" }
feasible = "C10 + C01 > 0.1"
"""
HEAD = """\
[fabric]
name = "rubber"
thickness = 1.0

[law]
form = "none"

[fit]
starts = 1
"""


def force(stretch, c10, c01):
    """Force (N) of an incompressible bar of 1 mm by 1 mm."""
    return 2.0 * (stretch - stretch**-2) * (c10 + c01 / stretch)


def write_curve(path, noise=0.0, seed=0):
    """Write the forces of the bar with the true constants, as measured."""
    values = force(STRETCHES, TRUE["C10"], TRUE["C01"])
    values = values + noise * np.random.default_rng(seed).normal(size=len(values))
    rows = [f"{10 * (s - 1):.6g},{f:.10g}" for s, f in zip(STRETCHES, values, strict=True)]
    path.write_text("travel [mm],force [N]\n" + "\n".join(rows) + "\n")


def bar_project(folder, monkeypatch, replaced=(), noise=0.0, seed=0):
    """Return the path of a project whose deck is a script; `replaced` changes its text."""
    monkeypatch.setenv(PROGRAMS_FROM, str(folder))
    (folder / "solve.py").write_text(SCRIPT)
    (folder / "job.txt.j2").write_text("{{ C10 | number }} {{ C01 | number }}\n")
    write_curve(folder / "frame.csv", noise, seed)
    text = f"""{HEAD}
[[deck]]
name = "bar"
program = ["{sys.executable}", "solve.py"]
template = "job.txt.j2"
result = "curve.csv"

{PARAMETERS}
[[deck.compare]]
measured = "frame.csv"
x = {{ column = "travel", result = "travel_mm" }}
y = {{ column = "force", result = "force_N", unit = "N" }}
noise = 0.002
"""
    for old, new in replaced:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "project.toml"
    path.write_text(text)
    return path


def cube_project(folder, replaced=()):
    """Return the path of a project whose deck is a cube in CalculiX, without measured forces."""
    (folder / "cube.inp").write_text(CUBE)
    (folder / "frame.inp.j2").write_text(DECK)
    text = f"""{HEAD}
[[deck]]
name = "cube"
template = "frame.inp.j2"

{PARAMETERS}
[[deck.compare]]
measured = "frame.csv"
x = {{ column = "travel", set = "GRIP", displacement = "z", scale = 10 }}
y = {{ column = "force", set = "GRIP", reaction = "z" }}
noise = 0.002
"""
    for old, new in replaced:
        assert old in text, old
        text = text.replace(old, new)
    path = folder / "project.toml"
    path.write_text(text)
    return path


def bar(folder, monkeypatch, replaced=(), **data):
    """Return the project of the bar."""
    return read_project(bar_project(folder, monkeypatch, replaced, **data))


#: A sheet of 10 mm by 10 mm whose nodes move by A x t and B y t: two files, at t = 1 and 2.
SHEET_SCRIPT = """\
a, b = (float(word) for word in open("job.txt").read().split()[:2])
nodes = [(x, y) for x in range(11) for y in range(11)]
def rows(values):
    return "\\n".join(" ".join(f"{v:.12g}" for v in row) for row in values)
head = '<DataArray type="Float64" NumberOfComponents="3" format="ascii"'
for t in (1, 2):
    points = rows((x, y, 0.0) for x, y in nodes)
    moved = rows((a * x * t, b * y * t, 0.0) for x, y in nodes)
    open(f"out-{t}.vtu", "w").write(f'''<VTKFile type="UnstructuredGrid" version="0.1">
<UnstructuredGrid><Piece NumberOfPoints="121" NumberOfCells="1">
<Points>{head} Name="Points">{points}</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 12</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray>
<DataArray type="Int64" Name="types" format="ascii">5</DataArray></Cells>
<PointData>{head} Name="displacement">{moved}</DataArray></PointData>
</Piece></UnstructuredGrid></VTKFile>''')
"""
#: The node set of the sheet, as a deck of Abaqus names it.
SHEET_SETS = "*NSET, NSET=SHEET, GENERATE\n1, 121\n"


def write_frames(folder, a, b, noise=0.0):
    """Write frames of DIC of the sheet at t = 1 and 2."""
    random = np.random.default_rng(1)
    x, y = random.uniform(0, 10, (2, 40))
    for t in (1, 2):
        moved = np.column_stack([x, y, 0 * x, a * x * t, b * y * t, 0 * x])
        moved[:, 3:5] += noise * random.normal(size=(40, 2))
        rows = "\n".join(",".join(f"{v:.10g}" for v in row) for row in moved)
        (folder / f"field_{t}.csv").write_text(f"x,y,z,dx,dy,dz\n{rows}\n")


def sheet_project(folder, monkeypatch, noise=0.0):
    """Return the path of a project whose deck is a script that writes VTU, with fields of DIC."""
    monkeypatch.setenv(PROGRAMS_FROM, str(folder))
    (folder / "solve.py").write_text(SHEET_SCRIPT)
    (folder / "job.txt.j2").write_text("{{ A }} {{ B }}\n")
    (folder / "sets.inp").write_text(SHEET_SETS)
    write_frames(folder, 0.02, -0.01, noise)
    path = folder / "project.toml"
    path.write_text(f"""{HEAD}
[[deck]]
name = "sheet"
program = ["{sys.executable}", "solve.py"]
template = "job.txt.j2"
files = ["sets.inp"]
result = "out-*.vtu"

[deck.parameters]
A = {{ bounds = [0.0, 0.1] }}
B = {{ bounds = [-0.1, 0.0] }}

[[deck.compare]]
measured = "field_*.csv"
quantity = "displacement"
set = "SHEET"
times = [1.0, 2.0]
noise = 0.001
""")
    return path
