"""Tests of bent cylinders share a solver that answers at once, a project, and readings."""

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.experiments.cylinder.predicted import CylinderPredicted
from bubblefit.experiments.forward import RunRecord
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.closed_surfaces import enclosed_volume
from bubblefit.meshes.cylinder_model import CylinderModel
from bubblefit.runs.predictions import run_card
from bubblefit.solvers.base import BandEnd, History, Solver, SolverCheck

#: Warp moduli (MPa) with which `Formula` fails, and stops half-way.
FAILS, STOPS = 13.0, 17.0


class ClosedFormCylinder:
    """Instead of finite elements: a tube of linear stiffness that buckles at its hand estimate.

    Load = limit * tanh(stiffness * deflection / limit), limit = 4 pi p R^3 / (span - collar).
    """

    name, external, progress = "formula", False, None

    def __init__(self, **options: Any) -> None:
        self.identity = f"formula {sorted(options.items())}"

    def check(self) -> SolverCheck:
        return SolverCheck(self.name, True, "1", True)

    def run(self, model: CylinderModel, law: HypoelasticLaw, *_: Any, **__: Any) -> History:
        e1, e2 = float(law.beta[11]), float(law.beta[7])
        if e1 == FAILS:
            raise SolverFailure("made to fail", self.name, 201)
        way = np.array([0.0, *model.deflections])
        if e1 == STOPS:
            way = way[: len(way) // 2 + 1]
        points = model.mesh.points
        radius, thickness = 0.5 * model.diameter, model.thickness.min()
        hoop = np.log1p(model.pressure * radius / thickness / e2)
        slope = np.clip(1 - np.abs(points[:, 2]) / (0.5 * model.supports.span), -1, None)
        inflated = points * np.expm1([hoop, hoop, 0.1 * hoop])
        u = np.array([inflated - d * slope[:, None] * [0, 1, 0] for d in way])
        arm = model.supports.span - model.collar.length
        limit = 4 * np.pi * model.pressure * radius**3 / arm
        stiffness = 48 * (e1 + 100 * model.pressure) * np.pi * radius**3 * thickness / arm**3
        load = limit * np.tanh(stiffness * way / limit)
        inside = [enclosed_volume(points + v, model.mesh.quads) for v in u]
        volume = model.copies * np.array(inside) * (1 - 1e-5 * way)
        gas = model.gas.closed_in(model.pressure, float(volume[0]))
        pressure = [gas.pressure(float(v)) for v in volume]
        return History(
            load, u, np.zeros(3), np.array([0.1 * hoop, hoop, 0.0]),
            cavity_pressure=np.array(pressure), cavity_volume=volume,
            wrinkled=0.05 + 0.002 * np.maximum(way - 50.0, 0.0), remarks=("made up",),
            early="the run stopped early: so asked" if e1 == STOPS else "",
        )  # fmt: skip


#: Ends of a band, as a solver gives them.
ENDS = (
    BandEnd("slack", "it wrinkles", {"factor": 1.0}),
    BandEnd("rigid wall", "it does not", {"factor": 1.5}, predicted=False),
)


class CylinderWithBand(ClosedFormCylinder):
    """With a band, unless the `factor` is given that its loads are multiplied by."""

    def __init__(self, factor: float | None = None) -> None:
        super().__init__(factor=factor)
        self.factor = factor

    def band(self, model: CylinderModel) -> tuple[BandEnd, ...]:
        return ENDS if self.factor is None else ()

    def run(self, *arguments: Any, **named: Any) -> History:
        history = super().run(*arguments, **named)
        assert self.factor is not None, "a band is run end by end"
        return replace(history, load=self.factor * history.load)


PROJECT = """
[fabric]
name = "Tubes"
thickness = 0.81
[units]
modulus = "MPa"
[defaults.cylinder]
element_size = 40.0
frames = 24
places = [40, 100, 240]
slope_over = 20
[defaults.cylinder.measured]
load = {{ column = "mass_kg", unit = "kg" }}
[[cylinder]]
name = "150 mm, 90 kPa"
diameter = 150
pressure = 90
{first}
[[cylinder]]
name = "high"
diameter = 150
pressure = 140
[[card]]
name = "soft"
beta = [0, 0, 0, 20, 0, 0, 0, 150, 0, 0, 0, {soft}]
[[card]]
name = "stiff"
beta = [0, 0, 0, 20, 0, 0, 0, 150, 0, 0, 0, 900]
[fit]
solver = "formula"
"""


#: To be studied, with the card of Table 4.2 of the thesis, "solution".
STUDIED_PROJECT = """
[fabric]
thickness = 0.81
[units]
length = "mm"
pressure = "kPa"
modulus = "GPa"
[defaults.cylinder]
element_size = 60.0
deflections = [10.0, 20.0, 30.0, 40.0]
places = [40, 100, 240]
slope_over = 20
[[cylinder]]
name = "narrow"
diameter = 150.0
pressure = 140.0
[[cylinder]]
name = "wide"
diameter = 200.0
pressure = 100.0
[[card]]
name = "known"
strain_range = [0.2, 0.2, 0.2]
beta = [-7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2, -1.06241e1, 1.37830e1, -9.31830e-1,
  1.39437e-1, -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1]
"""


def write_cylinder_project(folder: Path, first: str = "", soft: float = 500.0) -> Path:
    path = folder / "project.toml"
    path.write_text(PROJECT.format(first=first, soft=soft))
    return path


def write_cylinder_readings(path: Path, slope: float = 3.5, noise: float = 0.0) -> Path:
    rows = ["# made up for a test", "run,deflection (mm),mass_kg"]
    for run, sign in ((1, 1.0), (2, -1.0)):
        masses = np.arange(0.0, 30.1, 5.0)
        way = 9.80665 * masses / slope * (1 + sign * noise)
        rows += [f"{run},{d!r},{m!r}" for d, m in zip(way.tolist(), masses.tolist(), strict=True)]
        rows += [f"{run},{0.5 * float(way[-1])!r},10.0"]
    path.write_text("\n".join(rows) + "\n")
    return path


def ran(model: CylinderModel, card: MaterialCard, solver: Solver | None = None) -> RunRecord:
    return run_card(CylinderPredicted(), solver or ClosedFormCylinder(), model, card)


TOLD = "BUBBLEFIT_TEST_RUNS"  # a file that gets a letter a run


class Counted(ClosedFormCylinder):
    def run(self, *arguments, **named):
        with open(os.environ[TOLD], "a") as stream:
            stream.write(".")
        return super().run(*arguments, **named)
