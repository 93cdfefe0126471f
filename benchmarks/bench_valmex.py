"""The three real bubble tests: residual of each fit beside the published one.

Usage: bench_valmex.py [DATA_FOLDER] [STARTS] [TEST ...]. Prints the mean |dx| + |dy| + |dz| in mm,
over all points and pressures, of linear orthotropic and cubic moduli, with and without a pressure
or a displacement offset. Published (linear orthotropic, Abaqus): 1.55, 1.66, 1.70 mm.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from bubblefit.cli.options import cores
from bubblefit.identification.methods import FitOptions
from bubblefit.projects.bubble import read_project
from bubblefit.runs.processes import run_starts
from bubblefit.runs.start import StartRecord
from bubblefit.studies.bubble_results import assess
from bubblefit.studies.bubble_setup import bubble_problem, bubble_setup

ROOT = Path(__file__).resolve().parent.parent
PUBLISHED = {1: 1.55, 2: 1.66, 3: 1.70}
VARIANTS = (
    ("linear", {}),
    ("linear", {"pressure_offset": True}),
    ("linear", {"displacement_offset": True}),
    ("cubic", {}),
    ("cubic", {"pressure_offset": True}),
)


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data" / "bubble"
    starts = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    if not (folder / "grid").is_dir():
        print(f"skipped: no measured data in {folder}")
        return
    print("test  moduli  nuisance                     mean, mm  published  starts  wall, s")
    tests = tuple(map(int, sys.argv[3:])) or tuple(PUBLISHED)
    for test in tests:
        for kind, nuisance in VARIANTS:
            path = ROOT / "examples" / "bubble-valmex7318" / f"test{test}-{kind}.toml"
            project = replace(read_project(path, folder), starts=starts, **nuisance)
            begun = time.perf_counter()
            options = FitOptions(max_analyses=project.max_analyses)
            build = partial(bubble_problem, project)
            records = [
                r
                for r in run_starts(build, options, project.seed, range(starts), cores())
                if isinstance(r, StartRecord)
            ]
            ranked = sorted(
                (r for r in records if r.objective is not None), key=lambda r: r.objective
            )
            wall = time.perf_counter() - begun
            found = assess(project, bubble_setup(project), records, ranked, wall)
            took = {k: v for k, v in found.result["nuisance"].items() if v is not None}
            words = ", ".join(f"{k} {np.round(v, 2)}" for k, v in took.items()) or "none"
            print(
                f"{test:4d}  {kind:6s}  {words:45s} {found.mean_absolute:8.3f}  "
                f"{PUBLISHED[test]:9.2f}  {len(ranked):6d}  {wall:7.0f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
