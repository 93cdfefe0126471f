"""Validation: walls, cord forces and slopes of measured braided beams."""

import numpy as np
import pandas as pd
import pytest
from bubblefit.meshes.beam_model import BeamModel, BraidedWall, TubeCrossSection
from bubblefit.meshes.cylinder_model import Cord, ForceTable, axial_table

from ..solvers.membrane.cases import beam_history
from ..support.needs import measured_data

CORD = axial_table(800e3)
ONE_UP = (0.0, 120.0, 240.0)
TWO_UP = (60.0, 180.0, 300.0)


def test_published_wall_and_cord_forces_follow_from_braid_and_pressure():
    for _, row in pd.read_csv(measured_data() / "beams" / "beams.csv").iterrows():
        wall = BraidedWall(
            row["braid_angle_deg"], row["E1_braid_N_mm"], row["G12_braid_N_mm"],
            row["E_bladder_N_mm"], row["G_bladder_N_mm"], 0.001 * 0.175127,
        )  # fmt: skip
        assert wall.axial == pytest.approx(row["E_axial_N_mm"], rel=1e-3)
        assert wall.shear == pytest.approx(row["G_axial_hoop_N_mm"], rel=1e-3)
        own = TubeCrossSection(
            0.5 * row["diameter_mm"], 1e-3 * row["pressure_kPa"], wall,
            [Cord(a, CORD) for a in ONE_UP],
        )  # fmt: skip
        _, slope = wall.pull(np.zeros(1), own.pressure, own.radius)
        assert slope[0] == pytest.approx(row["E_axial_eff_N_mm"], rel=1e-3)
        assert own.cord_forces[0] == pytest.approx(row["cord_force_initial_N"], rel=1e-3)


def test_shear_between_cords_lowers_slopes_of_a_measured_braid():
    """71 degrees: by 4 to 8 %, of beams whose cords carry nearly all of the bending."""
    folder = measured_data() / "beams"
    beams, cords = (pd.read_csv(folder / f"{name}.csv") for name in ("beams", "cords"))
    for _, row in beams[beams["beam"] == "HETS2_71"].iterrows():
        table = cords[cords["cord_table"] == row["cord_table"]]
        pull = ForceTable(table["strain"].to_numpy(), table["force_N"].to_numpy())
        wall = BraidedWall(
            row["braid_angle_deg"], row["E1_braid_N_mm"], row["G12_braid_N_mm"],
            row["E_bladder_N_mm"], row["G_bladder_N_mm"],
        )  # fmt: skip
        for angles in (ONE_UP, TWO_UP):
            tube = TubeCrossSection(
                0.5 * row["diameter_mm"], 1e-3 * row["pressure_kPa"], wall,
                [Cord(a, pull) for a in angles],
            )  # fmt: skip
            by_pressure = np.pi * tube.pressure * tube.radius**2
            rigidity = tube.radius * wall.shear
            assert 27 / (4 * np.pi) < (tube.shear - by_pressure) / rigidity < 2.2
            model = BeamModel(tube, row["span_mm"], [2.0], row["load_spacing_mm"],
                              roller_below=row["roller_below_axis_mm"])  # fmt: skip
            now = beam_history(model, 2.0)[1][-1]
            tube.__dict__["shear"] = np.pi * rigidity + by_pressure
            assert 0.04 < 1 - now / beam_history(model, 2.0)[1][-1] < 0.08
