"""CalculiX' tolerances of force and correction: what they cost in accuracy and in iterations.

Usage: bench_calculix_tolerances.py [all]. The bubble (48 S8R, Table 4.2) against the tightest pair:
largest difference of any displacement in mm; with `all` also the bias strip (300 S4, Table 3.2, 100
increments): largest difference of the load over the end load. The tables of
docs/how-to/calculix.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import ModuleType

import numpy as np
from bench_calculix_strips import LAW, bias
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.base import History
from bubblefit.solvers.calculix import bubble, strip
from bubblefit.solvers.calculix.solver import CalculixSolver
from known_solution import known_model_and_law
from threadpoolctl import threadpool_limits

#: The tightest first.
BUBBLE = ((1e-10, 1e-9), (1e-8, 1e-7), (1e-7, 1e-6), (1e-6, 1e-5), (5e-3, 1e-2))
STRIP = ((1e-7, 1e-6), (1e-5, 1e-4), (1e-4, 1e-3), (1e-3, 1e-2))


def main() -> None:
    base, known = known_model_and_law()
    mesh = disk_mesh(100.0, 192, "quarter")
    model = BubbleModel(mesh, base.thickness, base.pressures, base.increments)
    compare(
        "bubble, 48 S8R", bubble, BUBBLE, "mm", lambda: CalculixSolver().run(model, known),
        lambda found, exact: float(np.abs(found.displacement - exact.displacement).max()),
    )  # fmt: skip
    if sys.argv[1:] != ["all"]:
        return
    pulled = bias(100, 1)
    compare(
        "bias strip, 300 S4", strip, STRIP, "of the end load",
        lambda: CalculixSolver(element="S4").run(pulled, LAW),
        lambda found, exact: float(np.abs(found.load - exact.load).max() / exact.load[-1]),
    )  # fmt: skip


def compare(
    what: str,
    module: ModuleType,
    tolerances: tuple[tuple[float, float], ...],
    unit: str,
    run: Callable[[], History],
    apart: Callable[[History, History], float],
) -> None:
    """A line a pair of tolerances; `module` holds those of its decks."""
    shipped, exact = module.TOLERANCES, None
    for pair in tolerances:
        module.TOLERANCES = pair  # type: ignore[attr-defined]
        with threadpool_limits(1):
            found = run()
        exact = exact or found
        mark = "  (ours)" if pair == shipped else ""
        print(f"{what}: {pair[0]:g}, {pair[1]:g}: {apart(found, exact):.1e} {unit}, "
              f"{found.iterations} iterations{mark}", flush=True)  # fmt: skip
    module.TOLERANCES = shipped  # type: ignore[attr-defined]


if __name__ == "__main__":
    main()
