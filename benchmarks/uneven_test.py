"""A computed bubble test of a sheet that was neither flat nor taut, as files of a project."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh, disk_modes
from bubblefit.solvers.membrane.solver import MembraneSolver

RADIUS, THICKNESS = 100.0, 0.81
#: MPa: E1 falls by a third over the strain reached, E2 by a sixth, G12 stays.
E1, E2, G12 = (-1200.0, 300.0), (-400.0, 220.0), (0.0, 12.0)
RANGE = (0.13, 0.13, 0.13)


@dataclass(frozen=True)
class Uneven:
    """What is wrong with the sheet, and with the measurement.

    height, rim : mm, scale of the surface, largest motion of the rim. slack : share of the
    stress-free length. noise : mm, of every number. repeats : points at every node.
    """

    height: float = 4.0
    slack: float = 0.001
    rim: float = 2.0
    noise: float = 0.05
    repeats: int = 1


def law() -> HypoelasticLaw:
    """Return the known law: linear in strain, incompressible."""
    beta = np.zeros(12)
    for block, moduli in enumerate((G12, E2, E1)):
        beta[4 * block + 2 : 4 * block + 4] = moduli
    return HypoelasticLaw(beta, 0.24, np.array(RANGE), "incompressible")


def model(what: Uneven, pressures: Sequence[float], elements: int) -> BubbleModel:
    """Return the sheet as it really was; pressures in MPa."""
    mesh = disk_mesh(RADIUS, elements)
    x, y = mesh.points[:, 0] / RADIUS, mesh.points[:, 1] / RADIUS
    modes = disk_modes(mesh.points, RADIUS, 10)
    shape = 0.8 * modes["z0_1"] - 0.9 * modes["z0_x"] + 0.7 * modes["z0_xy"] - 0.8 * modes["z0_yy"]
    # What ten modes cannot follow: a wave along the warp.
    shape += 0.12 * (1 - x**2 - y**2) * np.sin(5.0 * x + 1.0)
    shape *= what.height / np.abs(shape).max()
    points = np.column_stack([mesh.points[:, :2], shape])
    rim = mesh.points[mesh.node_sets["rim"]]
    angle = np.arctan2(rim[:, 1], rim[:, 0])
    # Slips inwards more along the warp, rises with the clamp, more on one side.
    inwards = -(0.35 + 0.25 * np.cos(2 * angle)) * what.rim
    motion = np.column_stack(
        [inwards * np.cos(angle), inwards * np.sin(angle), what.rim * (0.7 + 0.15 * np.cos(angle))]
    )
    steps = default_increments(pressures)
    share = (np.array(steps) / pressures[-1])[:, None, None]
    return BubbleModel(
        replace(mesh, points=points), THICKNESS, pressures, steps,
        slack=(what.slack, what.slack), rim_motion=share * motion,
    )  # fmt: skip


def write_test(
    folder: Path, what: Uneven, pressures: Sequence[float], elements: int
) -> BubbleModel:
    """Compute the test, write a file of the mesh's nodes a pressure, and return the model."""
    truth = model(what, pressures, elements)
    history = MembraneSolver().run(truth, law())
    random, nodes = np.random.default_rng(7), truth.mesh.points

    def seen(values: np.ndarray) -> np.ndarray:
        return values + what.noise * random.standard_normal(values.shape)

    heights = 612.0 + seen(np.repeat(nodes[:, 2:], what.repeats, axis=0))
    places = np.repeat(nodes[:, :2], what.repeats, axis=0)
    for k, displacement in enumerate(history.displacement):
        moved = seen(np.repeat(displacement, what.repeats, axis=0))
        table = np.hstack([places, heights, moved])
        path = folder / f"t_{k:02d}.csv"
        np.savetxt(path, table, "%.7f", ",", header="x,y,z,dx,dy,dz", comments="")
    return truth


PROJECT = """\
fabric = {{ name = "computed", thickness = {thickness}, thickness_change = "incompressible" }}
units = {{ modulus = "MPa" }}
fit = {{ starts = 1, seed = 3, jobs = 1, max_analyses = 60 }}

[law]
form = "linear"
strain_range = [0.13, 0.13, 0.13]
bounds = {{ E1 = [30.0, 2000.0], E2 = [30.0, 1500.0], G12 = [2.0, 100.0] }}

[[bubble]]
name = "uneven"
radius = {radius}
pressures = {pressures}
elements = {elements}
objective = "mm"

[bubble.data.points]
pattern = "t_{{index:02d}}.csv"
indices = {indices}
columns = {{ z = "z" }}

[bubble.sheet]
{sheet}
"""


def project_text(pressures: Sequence[float], elements: int, sheet: str) -> str:
    """Return a project that fits it; sheet : lines of [bubble.sheet]."""
    kpa, indices = [round(1e3 * p, 6) for p in pressures], list(range(len(pressures)))
    return PROJECT.format(thickness=THICKNESS, radius=RADIUS, pressures=kpa, indices=indices,
                          elements=elements, sheet=sheet)  # fmt: skip


def errors(fitted: HypoelasticLaw, ends: Sequence[float]) -> dict[str, float]:
    """Return the largest relative errors of E1 and E2 from a fifth of the strains reached on."""
    known, found = law(), {}
    for name, end in zip(("E1", "E2"), ends, strict=False):
        strain = np.linspace(0.2 * end, end, 41)
        ratio = fitted.modulus(name, strain) / known.modulus(name, strain)
        found[name] = float(np.abs(ratio - 1).max())
    return found
