"""Projects of tubes under pressure, pull and torque, with the strains of a known law."""

from pathlib import Path

import numpy as np
from bubblefit.experiments.tube import LOADS
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import TubeModel
from bubblefit.solvers.membrane.solver import MembraneSolver

RADIUS, THICKNESS = 100.0, 0.8
TUBE_LAW = HypoelasticLaw.linear(400.0, 300.0, 20.0, 0.24)
#: Pressure (MPa), pull (N), torque (N mm).
TUBE_LOADS = [
    *((pressure, 0.0, 0.0) for pressure in (0.004, 0.01, 0.02)),
    *((0.02, force, 0.0) for force in (400.0, 1200.0, 2000.0)),
    *((0.02, 0.0, torque) for torque in (1e4, 3e4, 6e4)),
]


def known_tube(folder: Path) -> Path:
    """Write a project of one tube and its table, without noise; return the project file."""
    model = TubeModel(TUBE_LOADS, RADIUS, THICKNESS)
    strains = model.strains(MembraneSolver().run(model, TUBE_LAW).displacement)
    twist = np.degrees(strains[:, 2] / RADIUS) * 1e3
    loads = np.array(TUBE_LOADS) / list(LOADS.values())
    rows = np.column_stack([loads, 100 * strains[:, :2], twist])
    head = "pressure_kPa,force_N,torque_Nm,axial_percent,hoop_percent,twist_deg_per_m"
    np.savetxt(folder / "tube.csv", rows, delimiter=",", header=head, comments="", fmt="%.10g")
    path = folder / "project.toml"
    path.write_text(
        '[fabric]\nname = "t"\nthickness = 0.8\n[law]\nform = "constant"\n[law.bounds]\n'
        "E1 = [0.05, 2.0]\nE2 = [0.05, 2.0]\nG12 = [0.001, 0.5]\n[fit]\njobs = 1\n"
        '[[tube]]\ndiameter = 200.0\nfile = "tube.csv"\nnoise = 0.005\n'
    )
    return path
