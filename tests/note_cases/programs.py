"""Notes of what Marc and CalculiX did, provoked.

A run of Marc goes wrong in many ways at once.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.errors import Note
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.solvers.calculix import cylinder as cylinder_analysis
from bubblefit.solvers.calculix.cylinder import BentCylinder, solid_mesh, volumes
from bubblefit.solvers.calculix.deck import shell_mesh, tilt_remarks
from bubblefit.solvers.marc.cylinder import may_touch
from bubblefit.solvers.marc.sheets import bubble_history
from bubblefit.solvers.marc.solver import MarcSolver

from ..inference.cases import MODEL
from ..marc_files import sts_text, t19_text
from ..solvers.marc.test_marc_deck import frames_of
from ..solvers.membrane.test_bending import LINEAR


def notes_of_marc_bending(folder: Path, patch: pytest.MonkeyPatch) -> Iterable[Note]:
    """A Marc that repeats an increment and stops at 60 of 100 mm; the supports carry nothing."""
    patch.delenv("BUBBLEFIT_MARC", raising=False)
    model = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0, 60.0, 100.0])
    frames, _ = frames_of(model, model.mesh.points * [0.05, 0.05, 0.0], last=2)
    frames[-1][1]["Contact Normal Force"][may_touch(model)["supports"]] = 0.0
    filled = len(model.inflation)
    for name, given in (("inflation", frames[: filled + 1]), ("bending", frames)):
        ended, times = name == "inflation", [time for time, _ in given[1:]]
        (folder / name).mkdir()
        text = t19_text(model.mesh.points, model.mesh.quads, given, ended=ended)
        (folder / name / "job.t19").write_text(text)
        numbers = [*range(1, len(times)), len(times) - 1]
        text = sts_text(times) if ended else sts_text(times, 3015, numbers)
        (folder / name / "job.sts").write_text(text)
    program = folder / "run_marc"
    program.write_text(
        f"#!/bin/sh\nif grep -q '^contact' job.dat; then cp {folder}/bending/* .\n"
        f"else cp {folder}/inflation/* .; fi\n"
    )
    program.chmod(0o755)
    return MarcSolver(marc=program, scratch=str(folder / "scratch")).run(model, LINEAR).remarks


def notes_of_marc_results(folder: Path, _: Any) -> Iterable[Note]:
    """A .t19 with displacements alone."""
    u = np.zeros_like(MODEL.mesh.points)
    frames = [(float(i), {"Displacement": u}) for i in range(len(MODEL.increments) + 1)]
    (folder / "job.t19").write_text(t19_text(MODEL.mesh.points, MODEL.mesh.quads, frames))
    return bubble_history(folder / "job.t19", MODEL, 1).remarks


def notes_of_calculix_bending(*_: Any) -> Iterable[Note]:
    """A run that stopped at 6 of 8 mm; its volume does not change, so nor does the pressure."""
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, deflections=[4.0, 8.0])
    solids, still = solid_mesh(model), np.zeros((3, *model.mesh.points.shape))
    forces = {name: np.zeros((3, 3)) for name in ("supports", "collar")}
    volume = volumes(model, still)
    filling = volume[0] * (1 + 0.01 * np.arange(1, len(model.inflation) + 1))
    found = BentCylinder(np.array([0.0, 3, 6]), still, forces, volume, 9, True, "no step left")

    def run(_decks: Any, _read: Any, rescue: Any = None) -> Any:
        return (np.zeros_like(solids.points), filling) if rescue is None else found

    setup: Any = SimpleNamespace(templates=None)
    return cylinder_analysis.analyse(model, LINEAR, setup, run).remarks


def notes_of_tilted_shells(*_: Any) -> Iterable[Note]:
    """A cone, 30 mm high and 100 mm in radius."""
    shells = shell_mesh(MODEL.mesh, "S4")
    radius = np.hypot(*shells.points[:, :2].T)
    cone = shells.points + np.outer(30.0 * (1 - radius / radius.max()), [0, 0, 1])
    return tilt_remarks(replace(shells, points=cone))
