"""What the tests of bending share: a solver that answers at once, projects, made-up readings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.volume import enclosed_volume
from bubblefit.models.cylinder import CylinderModel
from bubblefit.solvers.base import History, SolverCheck

#: Warp moduli (MPa) with which `Formula` fails, and stops half-way.
FAILS, STOPS = 13.0, 17.0


class Formula:
    """Instead of finite elements: a tube of linear stiffness that buckles at its hand estimate.

    Load = limit * tanh(stiffness * deflection / limit), limit = 4 pi p R^3 / (span - collar).
    """

    name = "formula"
    external = False

    def __init__(self, **options: Any) -> None:
        pass

    def check(self) -> SolverCheck:
        return SolverCheck(self.name, True, "1", True)

    def run(
        self,
        model: CylinderModel,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
    ) -> History:
        e1, e2 = float(law.beta[11]), float(law.beta[7])
        if e1 == FAILS:
            raise SolverFailure("made to fail", self.name, 201)
        way = np.array([0.0, *model.deflections])
        if e1 == STOPS:
            way = way[: len(way) // 2 + 1]
        points = model.mesh.points
        radius, thickness = np.hypot(points[:, 0], points[:, 1]).max(), model.thickness.min()
        hoop = np.log1p(model.pressure * radius / thickness / e2)
        slope = np.clip(1 - np.abs(points[:, 2]) / (0.5 * model.supports.span), -1, None)
        inflated = points * np.expm1([hoop, hoop, 0.1 * hoop])
        u = np.array([inflated - d * slope[:, None] * [0, 1, 0] for d in way])
        arm = model.supports.span - model.collar.length
        limit = 4 * np.pi * model.pressure * radius**3 / arm
        stiffness = 48 * (e1 + 100 * model.pressure) * np.pi * radius**3 * thickness / arm**3
        load = limit * np.tanh(stiffness * way / limit)
        volume = model.copies * np.array(
            [enclosed_volume(points + v, model.mesh.quads) * (1 - 1e-5 * d)
             for v, d in zip(u, way, strict=True)]
        )  # fmt: skip
        gas = model.gas.closed_in(model.pressure, float(volume[0]))
        pressure = [gas.pressure(float(v)) for v in volume]
        return History(
            load,
            u,
            np.zeros(3),
            np.array([0.1 * hoop, hoop, 0.0]),
            cavity_pressure=np.array(pressure),
            cavity_volume=volume,
            wrinkled=0.05 + 0.002 * np.maximum(way - 50.0, 0.0),
            remarks=("made up", *(["the run stopped early: so asked"] if e1 == STOPS else [])),
        )


PROJECT = """
[project]
kind = "bend"
title = "Tubes"
[units]
modulus = "MPa"
[cylinder]
thickness = 0.81
element_size = 40.0
frames = 24
[measured]
load = {{ column = "mass_kg", unit = "kg" }}
[[cases]]
diameter = 150
pressure = 90
{first}
[[cases]]
name = "high"
diameter = 150
pressure = 140
[[cards]]
name = "soft"
test = "uniaxial"
beta = [0, 0, 0, 20, 0, 0, 0, 150, 0, 0, 0, {soft}]
[[cards]]
name = "stiff"
test = "bubble"
beta = [0, 0, 0, 20, 0, 0, 0, 150, 0, 0, 0, 900]
[run]
solver = "formula"
"""


def write_project(folder: Path, first: str = "", soft: float = 500.0) -> Path:
    """Two cases and two cards. first : further keys of the first case."""
    path = folder / "project.toml"
    path.write_text(PROJECT.format(first=first, soft=soft))
    return path


def write_readings(path: Path, slope: float = 3.5, noise: float = 0.0) -> Path:
    """Made-up readings of two repetitions, 5 kg apart, then unloaded."""
    rows = ["# made up for a test", "run,deflection (mm),mass_kg"]
    for run, sign in ((1, 1.0), (2, -1.0)):
        masses = np.arange(0.0, 30.1, 5.0)
        way = 9.80665 * masses / slope * (1 + sign * noise)
        rows += [f"{run},{d!r},{m!r}" for d, m in zip(way.tolist(), masses.tolist(), strict=True)]
        rows += [f"{run},{0.5 * float(way[-1])!r},10.0"]
    path.write_text("\n".join(rows) + "\n")
    return path
