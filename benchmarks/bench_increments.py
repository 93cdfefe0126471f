"""What the number of increments costs in accuracy, and Newton's work in a fit.

Usage: bench_increments.py [--starts N] [--old PATH]. The bubble of Table 4.2 with 96 quads in the
quarter: heights of the apex against 350 increments (goal with 7 increments: 0.002 %; with the
modulus at the midpoint of an increment it was 0.21 %). Then N starts of the known-solution
example (5 unless given, 0 for none) in one process, Newton's work counted.

--old PATH : a checkout of another commit, measured beside it, such as the last one with the
midpoint rule (git worktree add ../old 050fe5e).
"""

from __future__ import annotations

import argparse
import contextlib
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.cli.main import main as bubblefit_command
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane import factorisation, newton
from bubblefit.solvers.membrane.solver import MembraneSolver

# Table 4.2, "solution", GPa.
TABLE_4_2 = [
    -7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2,
    -1.06241e1, 1.37830e1, -9.31830e-1, 1.39437e-1,
    -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1,
]  # fmt: skip
ENDS = [0.13, 0.13, 0.13]
LAW = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, ENDS)
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
MESH = disk_mesh(100.0, 400, "quarter")
#: Parts of each rise of the pressure.
PARTS = (1, 3, 10)
REFERENCE = 50
GOAL = 0.002


def model(parts: int, extra: bool = False) -> BubbleModel:
    """The bubble with every rise of the pressure in `parts`; `extra`: two more first increments."""
    levels = np.interp(np.arange(1, 7 * parts + 1) / parts, range(8), [0.0, *PRESSURES])
    more = 1e-3 * np.array([6.0, 40.0]) if extra else np.empty(0)
    return BubbleModel(MESH, 0.81, PRESSURES, np.unique(np.concatenate([levels, more])))


def errors() -> tuple[list[float], dict[int, float]]:
    """Heights of the apex (mm) with 350 increments, and errors (%) by number of increments."""
    solver = MembraneSolver(1e-10)
    apex = MESH.node_sets["apex"][0]
    exact = solver.run(model(REFERENCE), LAW).displacement[:, apex, 2]
    by_count = {}
    for case in [model(1), model(1, True), *(model(parts) for parts in PARTS[1:])]:
        height = solver.run(case, LAW).displacement[:, apex, 2]
        by_count[len(case.increments)] = 100 * float(np.abs(height / exact - 1).max())
    return exact.tolist(), by_count


def work_of_starts(starts: int) -> dict[str, float]:
    """Newton's work in so many starts of the example: the fit's process is a fork of this one."""
    count = {name: multiprocessing.Value("q") for name in ("increments", "assemblies", "factors")}

    def count_calls(kind: Any, method: str, name: str) -> None:
        original = getattr(kind, method)

        def counting(*given: Any, **named: Any) -> Any:
            count[name].value += 1  # type: ignore[attr-defined]
            return original(*given, **named)

        setattr(kind, method, counting)

    count_calls(newton.Membrane, "equilibrium", "increments")
    count_calls(newton.Membrane, "unbalance", "assemblies")
    for kind in vars(factorisation).values():
        if isinstance(kind, type) and kind.__module__ == factorisation.__name__:
            if hasattr(kind, "factor") and kind is not factorisation.Tangent:
                count_calls(kind, "factor", "factors")
    project = Path(factorisation.__file__).parents[2] / "examples/bubble-known-solution"
    with tempfile.TemporaryDirectory() as folder:
        words = ["bubble", str(project / "project.toml"), "--starts", str(starts), "--jobs", "1"]
        words += ["--quiet", "--out", str(Path(folder) / "out")]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        with contextlib.redirect_stdout(sys.stderr):
            bubblefit_command(words, standalone_mode=False)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return {"seconds": seconds, **{name: value.value for name, value in count.items()}}  # type: ignore[attr-defined]


def measure(starts: int) -> dict[str, Any]:
    heights, by_count = errors()
    work = work_of_starts(starts) if starts else None
    return {"apex_mm": heights, "errors": {str(n): e for n, e in by_count.items()}, "work": work}


def measure_in(checkout: Path, starts: int) -> dict[str, Any]:
    """The same of another checkout, in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "bubblefit").symlink_to(checkout.resolve(), target_is_directory=True)
        command = [sys.executable, __file__, "--json", "--starts", str(starts)]
        done = subprocess.run(
            command, env={**os.environ, "PYTHONPATH": folder}, capture_output=True, text=True
        )
    if done.returncode:
        sys.exit(done.stderr)
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--starts", type=int, default=5, help="of the example, counted [5]")
    parser.add_argument("--old", type=Path, help="a checkout of another commit")
    parser.add_argument("--json", action="store_true", help="print numbers for another process")
    options = parser.parse_args()
    here = measure(options.starts)
    if options.json:
        print(json.dumps(here))
        return
    sides = {"": here}
    if options.old:
        sides = {"here: ": here, "old: ": measure_in(options.old, options.starts)}
    for side, result in sides.items():
        for increments, error in result["errors"].items():
            print(f"{side}{increments} increments: apex within {error:.2g} % of 350")
        work = result["work"]
        if work:
            factors, assemblies = (
                work[name] / work["increments"] for name in ("factors", "assemblies")
            )
            print(
                f"{side}{options.starts} starts: {factors:.1f} factorisations and {assemblies:.1f} "
                f"assemblies an increment, {work['seconds']:.1f} s of processor"
            )
    if options.old:
        heights = [np.array(result["apex_mm"]) for result in sides.values()]
        apart = float(np.abs(heights[0] - heights[1]).max())
        print(f"350 increments of both: apex {apart:.1g} mm apart")
    if here["errors"]["7"] > GOAL:
        sys.exit(f"goal missed: {here['errors']['7']:.2g} % > {GOAL} %")


if __name__ == "__main__":
    main()
