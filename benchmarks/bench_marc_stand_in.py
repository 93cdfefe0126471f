"""Through Marc's deck and result file and back, by the stand-in for Marc, beside the membrane.

Usage: bench_marc_stand_in.py [fit]. A bubble, a bias strip and a cylinder at several tolerances of
the deck's control block: the largest difference of a displacement over the largest of its frame.
With `fit` also the known solution on 48 elements, Marc in twelve increments to one of the membrane,
which leads: e after each run of Marc. No Marc runs: the stand-in solves with the membrane itself.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.inference.methods.base import FitOptions
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip
from bubblefit.runs.starts import run_start
from bubblefit.solvers.base import History
from bubblefit.solvers.marc.deck import TOLERANCE
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from known_solution import known_model_and_law, known_project, known_setup, objectives_of

STAND_IN = Path(__file__).resolve().parent.parent / "tests" / "marc_stand_in" / "run_marc"
MODELS: dict[str, Any] = {
    "bubble": BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, (0.006, 0.022, 0.059, 0.097)),
    "bias strip": bias_strip(25, 30, 0.81, increments=8, across=4, along=12),
    "cylinder": inflated_cylinder(150.0, 0.14, 0.81, 60.0, deflections=(1.0, 2.5, 5.0)),
}
TOLERANCES = (0.3, 0.1, TOLERANCE, 1e-6)
ELEMENTS = 48


def main() -> None:
    _, law = known_model_and_law()
    print("| tolerance of the deck | " + " | ".join(MODELS) + " |")
    print("|---" * (1 + len(MODELS)) + "|")
    expected = {
        name: MembraneSolver(wall="stiff").run(model, law) for name, model in MODELS.items()
    }
    for tolerance in TOLERANCES:
        with tempfile.TemporaryDirectory() as folder:
            solver = MarcSolver(
                marc=STAND_IN, increments=0, include={"control": control(Path(folder), tolerance)}
            )
            off = [error(solver.run(m, law), expected[name]) for name, m in MODELS.items()]
        print(f"| {tolerance:g} | " + " | ".join(f"{e:.1e}" for e in off) + " |", flush=True)
    if sys.argv[1:] == ["fit"]:
        fit()


def control(folder: Path, tolerance: float) -> str:
    """A site's own control block."""
    rows = ["control", "".join(f"{n:10d}" for n in [99999, 30, 0, 5, 0, 1, 0, 0, 1, *[0] * 7])]
    rows += 2 * ["".join(f"{value:20.12E}" for value in [tolerance, *[0.0] * 7])]
    path = folder / "control.dat"
    path.write_text("\n".join(rows) + "\n")
    return str(path)


def error(found: History, expected: History) -> float:
    size = np.abs(expected.displacement).max(axis=(1, 2), keepdims=True)
    return float((np.abs(found.displacement - expected.displacement) / size).max())


def fit() -> None:
    project = known_project(ELEMENTS).with_solver("marc", {"marc": str(STAND_IN)}, [])
    problem, heard = known_setup(project).problem(), list[float]()
    run_start(problem, FitOptions("lm", max_analyses=100), 1, 0, objectives_of("marc", heard))
    print("known solution: e = " + ", ".join(f"{e:.1e}" for e in heard))


if __name__ == "__main__":
    main()
