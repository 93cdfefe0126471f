"""The three real bubble tests: residual of each fit beside the published one.

Usage: bench_valmex.py [DATA_FOLDER] [STARTS] [TEST ...]. Prints the mean |dx| + |dy| + |dz| in mm,
over all points and pressures, of linear orthotropic and cubic moduli, with and without a pressure
or a displacement offset, and E1, E2 and G12 at zero strain. Published (linear orthotropic, Abaqus):
1.55, 1.66, 1.70 mm.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import bubblefit as bf
import numpy as np
from bubblefit.project.project import Project

ROOT = Path(__file__).resolve().parent.parent
PUBLISHED = {1: 1.55, 2: 1.66, 3: 1.70}
VARIANTS: tuple[tuple[str, dict[str, bool]], ...] = (
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
    print(f"{'test':>4s}  {'moduli':6s}  {'nuisance':45s}{'mean, mm':>9s}{'published':>11s}"
          f"{'E1, MPa':>9s}{'E2, MPa':>9s}{'G12, MPa':>10s}")  # fmt: skip
    tests = tuple(map(int, sys.argv[3:])) or tuple(PUBLISHED)
    for test in tests:
        for kind, nuisance in VARIANTS:
            path = ROOT / "examples" / "bubble-valmex7318" / f"test{test}-{kind}.toml"
            fit = bf.fit(_with(bf.read_project(path, folder), nuisance), starts=starts)
            took = {k: v for k, v in fit.result["nuisance"].items() if v is not None}
            words = ", ".join(f"{k} {np.round(v, 2)}" for k, v in took.items()) or "none"
            moduli = "".join(f"{float(m(0.0)):9.1f}" for m in (fit.law.E1, fit.law.E2, fit.law.G12))
            mean = fit.result["mean_abs_mm"]
            print(f"{test:4d}  {kind:6s}  {words:45s}{mean:9.2f}{PUBLISHED[test]:11.2f}{moduli}",
                  flush=True)  # fmt: skip


def _with(project: Project, nuisance: dict[str, bool]) -> Project:
    """The project with offsets of its bubble as unknowns."""
    tests: dict[str, Any] = {
        name: replace(test, **nuisance)  # type: ignore[type-var]
        for name, test in project.tests.items()
    }
    return replace(project, tests=tests)


if __name__ == "__main__":
    main()
