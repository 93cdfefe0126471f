"""Compare with Marc: decks through the stand-in, bars of a misread law."""

import tempfile
from pathlib import Path

import numpy as np
from bubblefit.inference.methods import FitOptions
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip
from bubblefit.runs.starts import run_start
from bubblefit.solvers.bars import BARS, INCREMENTS
from bubblefit.solvers.marc.deck import TOLERANCE
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import ROOT, known_model_and_law, known_project, known_setup, objectives_of, start_on
from scipy.integrate import quad

STAND_IN = ROOT / "tests" / "marc_stand_in" / "run_marc"
MODELS = {
    "bubble": BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, (0.006, 0.022, 0.059, 0.097)),
    "bias strip": bias_strip(25, 30, 0.81, increments=8, across=4, along=12),
    "cylinder": inflated_cylinder(150.0, 0.14, 0.81, 60.0, deflections=(1.0, 2.5, 5.0)),
}


def stand_in(also=""):
    """Solve through Marc's deck and result file at several tolerances of the control block.

    Largest difference from the membrane, which the stand-in solves with. `fit`: also a fit.
    """
    _, law = known_model_and_law()
    print("| tolerance of the deck | " + " | ".join(MODELS) + " |\n" + "|---" * 4 + "|")
    membrane = MembraneSolver(wall="stiff")
    expected = [membrane.run(model, law).displacement for model in MODELS.values()]
    for tolerance in (0.3, 0.1, TOLERANCE, 1e-6):
        rows = ["control", "".join(f"{n:10d}" for n in [99999, 30, 0, 5, 0, 1, 0, 0, 1, *[0] * 7])]
        rows += 2 * ["".join(f"{value:20.12E}" for value in [tolerance, *[0.0] * 7])]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "control.dat"
            path.write_text("\n".join(rows) + "\n")
            solver = MarcSolver(marc=STAND_IN, increments=0, include={"control": str(path)})
            off = []
            for model, own in zip(MODELS.values(), expected, strict=True):
                size = np.abs(own).max(axis=(1, 2), keepdims=True)
                found = solver.run(model, law).displacement
                off.append(float((np.abs(found - own) / size).max()))
        print(f"| {tolerance:g} | " + " | ".join(f"{e:.1e}" for e in off) + " |", flush=True)
    if also == "fit":
        project = known_project(48).with_solver("marc", {"marc": str(STAND_IN)}, [])
        problem, heard = known_setup(project).problem(), list[float]()
        run_start(problem, FitOptions("lm", max_analyses=100), 1, 0, objectives_of("marc", heard))
        print("known solution: e = " + ", ".join(f"{e:.1e}" for e in heard))


def integral(modulus, end, measure):
    """Integrate a modulus that is looked up by a measure of the log strain."""
    return float(quad(lambda strain: modulus(measure(strain)), 0.0, end)[0])


def at_ends(modulus, end):
    pulled = np.log1p(np.expm1(end) * np.arange(INCREMENTS + 1) / INCREMENTS)
    steps = zip(pulled[1:], np.diff(pulled), strict=True)
    return float(sum(modulus(e) * step for e, step in steps))


READINGS = {
    "the law": lambda modulus, end: integral(modulus, end, lambda e: e),
    "secant, not tangent moduli": lambda modulus, end: modulus(end) * end,
    "of engineering strain": lambda modulus, end: integral(modulus, end, np.expm1),
    "of Green-Lagrange strain": lambda modulus, end: integral(
        modulus, end, lambda e: 0.5 * float(np.expm1(2 * e))
    ),
    "modulus at the end of an increment": at_ends,
    "stress is nominal": lambda modulus, end: integral(modulus, end, lambda e: e) / np.exp(end),
}


def bars():
    """Print end stresses (MPa) of the four published bars for ways of getting the law wrong."""
    print(f"{'MPa':36s}" + "".join(f"{f'{bar.model} {bar.direction}':>14s}" for bar in BARS))
    print(f"{'published':36s}" + "".join(f"{bar.stress:14.3f}" for bar in BARS))
    for words, reading in READINGS.items():
        stresses = [
            reading(
                lambda strain, bar=bar: 1e3 * float(np.polyval(bar.modulus[::-1], strain)),
                np.log1p(bar.elongation),
            )
            for bar in BARS
        ]
        print(f"{words:36s}" + "".join(f"{stress:14.3f}" for stress in stresses))


if __name__ == "__main__":
    start_on(stand_in, bars)
