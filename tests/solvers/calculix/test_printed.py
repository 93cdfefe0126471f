"""solvers/calculix/printed.py: what CalculiX prints for *NODE PRINT."""

import numpy as np
import pytest
from bubblefit.project.project import read_project
from bubblefit.solvers.calculix.printed import PrintedFile

from ...builders.decks import cube_project, write_curve
from ...builders.projects import fit_setup
from ...support import needs

TEXT = """
                        S T E P       1

 forces (fx,fy,fz) for set GRIP and time  0.5000000E+00

         5  1.000000E+00  2.000000E+00 -3.000000E+00
         7  1.500000E+00  0.000000E+00  4.000000E+00

 displacements (vx,vy,vz) for set ALL and time  0.5000000E+00

         2  0.000000E+00  0.000000E+00  1.000000E-01
         5  0.000000E+00  0.000000E+00  2.000000E-01

 total force (fx,fy,fz) for set GRIP and time  0.5000000E+00

        2.500000E+00  2.000000E+00  1.000000E+00

 forces (fx,fy,fz) for set GRIP and time  0.1000000E+01

         5  2.000000E+00  4.000000E+00 -6.000000E+00
"""


def test_tables_of_sets_are_read_by_time(tmp_path):
    (tmp_path / "job.dat").write_text(TEXT)
    file = PrintedFile(tmp_path / "job.dat")
    assert file.mesh.numbers.tolist() == [2, 5, 7] and np.isnan(file.mesh.points).all()
    half, full = file.frames()
    assert (half.time, full.time) == (0.5, 1.0)
    assert half.fields["forces"][1:, 2].tolist() == [-3.0, 4.0]
    assert half.fields["displacements"][:2, 2].tolist() == [0.1, 0.2]
    assert np.isnan(half.fields["forces"][0]).all() and [*full.fields] == ["forces"]


def test_forces_that_are_printed_are_those_of_the_frd_file(tmp_path):
    needs.calculix()
    loads = {}
    for result in ("job.frd", "job.dat"):
        folder = tmp_path / result
        folder.mkdir()
        write_curve(folder / "frame.csv")
        path = cube_project(
            folder,
            [('template = "frame.inp.j2"', f'template = "frame.inp.j2"\nresult = "{result}"')],
        )
        deck = folder / "frame.inp.j2"
        printed = "*NODE PRINT, NSET=GRIP\nU, RF\n*END STEP"
        deck.write_text(deck.read_text().replace("*END STEP", printed))
        problem = fit_setup(read_project(path)).problem()
        point = problem.evaluate(np.array([0.3, 0.08]), False)
        assert point is not None, problem.failure
        loads[result] = point.histories[0].load
    assert loads["job.dat"] == pytest.approx(loads["job.frd"], rel=1e-5)
