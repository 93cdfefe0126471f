"""Predict inflated braided tubes in four-point bending beside measured loads.

DATA: a folder with beams.csv (geometry, braid, bladder), cords.csv (force by strain) and curves.csv
(deflection, load) in the columns of its README; no number here comes from the curves.
"""

import time
from pathlib import Path

import numpy as np
import pandas as pd
from bubblefit.errors import SolverFailure
from bubblefit.experiments.cylinder.measures import against_measured
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import BeamModel, BraidedWall, TubeCrossSection
from bubblefit.meshes.cylinder_model import Cord, ForceTable, curve_reading
from bubblefit.readers.bending import BendingCurve
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import SHARED, start_on

KEYS = ["beam", "orientation", "pressure_kPa"]
#: mm: where loads are compared, the window of the slope at the knee, the last and the step.
PLACE, OVER, LAST, STEP = 100.0, 10.0, 130.0, 2.0
#: N/mm per lb/in.
POUNDS = 0.175127
#: Half a degree is what 55 degree braids leave open.
HALF_A_DEGREE = 0.5
#: Nothing of a beam comes from a card.
UNUSED = HypoelasticLaw.linear(1.0, 1.0, 1.0)


def beam_of(row, cords, orientation, angle=0.0, friction=0.0):
    """Return the model of a row of beams.csv; angle: degrees more than listed."""
    table = cords[cords["cord_table"] == row["cord_table"]]
    pull = ForceTable(table["strain"].to_numpy(), table["force_N"].to_numpy())
    places = str(row[f"cord_angles_{orientation}_deg"]).split(";")
    wall = BraidedWall(
        row["braid_angle_deg"] + angle, row["E1_braid_N_mm"], row["G12_braid_N_mm"],
        row["E_bladder_N_mm"], row["G_bladder_N_mm"], row["E2_braid_lb_in"] * POUNDS,
    )  # fmt: skip
    section = TubeCrossSection(
        0.5 * row["diameter_mm"], 1e-3 * row["pressure_kPa"], wall,
        [Cord(float(place), pull) for place in places],
    )  # fmt: skip
    return BeamModel(
        section, row["span_mm"], np.arange(STEP, LAST + 0.5 * STEP, STEP), row["load_spacing_mm"],
        roller_below=row["roller_below_axis_mm"], friction=friction,
        reading=curve_reading(row["diameter_mm"], [PLACE], OVER),
    )  # fmt: skip


def beside(model, curve):
    """Return predicted over measured: load at 100 mm, slope from 10 to 35 % of it, knee."""
    try:
        history = MembraneSolver().run(model, UNUSED)
    except SolverFailure:
        return [None] * 3
    way = np.array([0.0, *model.deflections])[: len(history.load)]
    found = against_measured(model.reading, way, history.load, [curve])
    assert found is not None
    ratios = found.ratios
    return [ratios[f"load at {PLACE:g} mm"], ratios["secant stiffness"], ratios["secant knee"]]


def words(ratios):
    return ["-" if ratio is None else f"{ratio:.3f}" for ratio in ratios]


def main(*, data=str(SHARED / "beams"), friction=0.0):
    """Print a line for each curve in the folder of data; friction: N added to every load."""
    beams, cords, curves = (
        pd.read_csv(Path(data) / f"{name}.csv", comment="#")
        for name in ("beams", "cords", "curves")
    )
    begun, count = time.perf_counter(), 0
    for (beam, orientation, pressure), rows in curves.groupby(KEYS, sort=False):
        own = beams[(beams["beam"] == beam) & np.isclose(beams["pressure_kPa"], pressure, atol=0.1)]
        if own.empty:
            continue
        row = own.iloc[0]
        curve = BendingCurve("", rows["deflection_mm"].to_numpy(), rows["load_N"].to_numpy())
        model = beam_of(row, cords, orientation, friction=friction)
        load, slope, knee = words(beside(model, curve))
        name = f"{beam} {orientation} {pressure:g} kPa"
        line = f"{name}: load at 100 mm {load} of measured, slope {slope}, knee {knee}"
        if row["braid_angle_deg"] < 58.0:
            ends = []
            for off in (-HALF_A_DEGREE, HALF_A_DEGREE):
                turned = beam_of(row, cords, orientation, off, friction)
                ends.append(words(beside(turned, curve))[0])
            line += f" (load {ends[0]} to {ends[1]} with half a degree of braid angle)"
        print(line, flush=True)
        count += 1
    spent = time.perf_counter() - begun
    print(f"{count} curves in {spent:.1f} s; friction {friction:g} N")


if __name__ == "__main__":
    start_on(main)
