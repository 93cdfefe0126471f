"""What biases the moduli of the known solution: data of another model, polynomial surfaces.

Usage: bench_bias.py [STARTS]. STARTS of the example each (3 unless given): data of the model that
fits, data of a finer mesh with other load steps (the lines to uncomment in the example), and
matching by surfaces of degree 4, 6 and 8. Printed: e, the largest error of each modulus over the
strain reached, that of G12 over the first half of it, the largest errors that are left when
the mesh's part, as the fit estimates it, is taken out (`mesh_error = "taken out"`), and how much of
the truth the bands of the fit hold. The data's own mesh is finer, not infinitely
fine: the last row but those of surfaces has data of a mesh so fine that it is nearly that.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import bubblefit as bf
import numpy as np
from bubblefit.experiments.bubble.test import BubbleTest, KnownSolution
from bubblefit.inference.assessment import moduli_error
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import Project
from bubblefit.runs.best import with_certainty
from known_solution import known_project

#: The lines to uncomment: quads of the full disk, load steps in kPa beside the pressures.
ELEMENTS, VERY_FINE, STEPS = 1800, 7200, (4, 11, 40, 78, 115, 160, 220, 275)
DEGREES = (4, 6, 8)


def main() -> None:
    starts = int(sys.argv[1]) if len(sys.argv) > 1 else 3
    base = known_project()
    (test,) = base.tests.values()
    assert isinstance(test, BubbleTest) and isinstance(test.data, KnownSolution)
    steps = np.unique([*test.pressures, *(1e-3 * np.array(STEPS))])
    other = replace(test.data, elements=ELEMENTS, increments=tuple(map(float, steps)))
    cases: dict[str, BubbleTest] = {"the same model": test}
    cases["data of a finer mesh, other load steps"] = replace(test, data=other)
    cases["the same of a very fine mesh"] = replace(test, data=replace(other, elements=VERY_FINE))
    for degree in DEGREES:
        words = f"surfaces of degree {degree}"
        cases[words] = replace(test, match_by="surfaces", match_degree=degree)
    print(f"{'':40s}{'e':>9s}{'E1, %':>8s}{'E2, %':>8s}{'G12, %':>8s}{'half way':>10s}"
          f"{'mesh out: E1':>14s}{'E2':>7s}{'G12':>7s}"
          f"{'in band, %: E1':>17s}{'E2':>7s}{'G12':>7s}")  # fmt: skip
    for words, case in cases.items():
        fit = bf.fit(_with(base, case), starts=starts)
        known = fit.law.with_beta(test.data.beta)
        errors = moduli_error(fit.law, known, fit.best.reached)
        half = moduli_error(fit.law, known, 0.5 * fit.best.reached)["G12"]
        row = "".join(f"{100 * errors[name]:8.2g}" for name in ("E1", "E2", "G12"))
        left = "".join(f"{100 * left:7.2g}" for left in without_mesh(fit, known))
        inside = "".join(f"{100 * share:7.0f}" for share in held(fit, known))
        print(
            f"{words:40s}{fit.objective:9.2g}{row}{100 * half:10.2g}       {left}   {inside}",
            flush=True,
        )


def without_mesh(fit: bf.Fit, known: HypoelasticLaw) -> list[float]:
    """Largest error of E1, E2 and G12 of the card with the mesh's error taken out."""
    settings = fit.project.fit.model_copy(update={"mesh_error": "taken out"})
    setup = replace(fit.setup, project=replace(fit.project, fit=settings))
    best = with_certainty(setup, fit.problem, replace(fit.best, certainty=None))
    assert best.certainty is not None and best.certainty.taken_out
    errors = moduli_error(best.law, known, best.reached)
    return [errors[name] for name in ("E1", "E2", "G12")]


def held(fit: bf.Fit, known: HypoelasticLaw) -> list[float]:
    """Of the strains of E1, E2 and G12, the share at which the truth lies in the fit's band."""
    sure = fit.best.certainty
    assert sure is not None
    return [
        float(np.mean((sure.band[n][0] <= true) & (true <= sure.band[n][1])))
        for n, true in ((n, known.modulus(n, sure.strain[n])) for n in ("E1", "E2", "G12"))
    ]


def _with(project: Project, test: BubbleTest) -> Project:
    changed: Mapping[str, Any] = {test.name: test}
    return replace(project, tests=changed)


if __name__ == "__main__":
    main()
