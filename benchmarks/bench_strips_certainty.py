"""What counting specimens instead of loads does to the uncertainty of the published strips.

Usage: bench_strips_certainty.py [--data DIR]. VALMEX 7318, strips along warp, fill, bias, cubics:
by the published polynomials (of five specimens, which their file does not say) and, where the
measured points are there, by those. Printed for each: how many independent loads a direction has,
and the median 1 sigma of the moduli with every load counted as independent, and as they are now.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from bubblefit.inference.assessment import certainty
from bubblefit.project.project import Project, read_project
from bubblefit.runs.fit import fit

HERE = Path(__file__).resolve().parent.parent
DATA = HERE.parent / "shared" / "data" / "uniaxial"
EXAMPLES = HERE / "examples" / "uniaxial-valmex7318"


def told(name: str, project: Project) -> None:
    found = fit(project, starts=2)
    problem, best = found.problem, found.best
    assert best.differentiated is not None
    print(f"{name}: objective {found.objective:.4g}")
    for comparison in problem.comparisons:
        own = comparison.objective
        loads, together = sum(own.sizes), own.alike  # type: ignore[attr-defined]
        print(f"  {comparison.name}: {loads} loads count as {loads / together:.3g}")
    for words in ("as specimens", "every load by itself"):
        sure = certainty(problem, best.differentiated, best.law, best.valid)
        sigma = ", ".join(f"{n} {100 * np.median(s):.2g} %" for n, s in sure.sigma.items())
        print(f"  median 1 sigma, {words}: {sigma}")
        for comparison in problem.comparisons:
            comparison.objective.alike = 1.0  # type: ignore[attr-defined]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA)
    data = parser.parse_args().data
    told("published polynomials", read_project(EXAMPLES / "project.toml"))
    if data.is_dir():
        told("points", read_project(EXAMPLES / "points.toml", data))


if __name__ == "__main__":
    main()
