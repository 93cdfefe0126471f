"""Meshes of gmsh's geometry files (.geo), which are made once."""

import sys
from functools import lru_cache

from ...errors import InputError
from ...solvers.process import log_tail, run_process
from ...solvers.scratch import run_folder, write_deck
from ...storage.reading import read_bytes

#: Meshes a geometry file in a process of its own, which it may end; groups become node sets.
SCRIPT = """
import gmsh
gmsh.initialize(readConfigFiles=False, interruptible=False)
gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
gmsh.merge("mesh.geo")
gmsh.model.mesh.generate(gmsh.model.getDimension())
gmsh.write("mesh.inp")
"""
TIMEOUT_S = 600.0


@lru_cache(maxsize=8)
def mesh_of(geometry: bytes) -> bytes:
    """Return the mesh of a geometry as a CalculiX or Abaqus input file.

    Physical groups become element sets and node sets. Raise InputError where gmsh fails.
    """
    with run_folder("gmsh", None, False, "gmsh", "gmsh.log") as folder:
        write_deck(folder, {"mesh.geo": geometry})
        log = folder / "gmsh.log"
        run_process([sys.executable, "-c", SCRIPT], folder, log, TIMEOUT_S)
        mesh = folder / "mesh.inp"
        if not mesh.is_file():
            lines = [line for line in log_tail(log).splitlines() if line.startswith("Error")]
            problem = lines[0] if lines else "gmsh made no mesh of it"
            raise InputError(None, "geo", problem)
        return read_bytes(mesh)
