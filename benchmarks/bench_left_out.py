"""Bubble tests 1 to 3 of VALMEX 7318, each left out of the fit in turn and foretold by the others.

Usage: bench_left_out.py [--data DIR] [--elements N] [--modes N ...] [--form NAME ...]
[--objective mm|relative ...] [--frames all|few] [--starts N] [--strips]
For every form, number of modes of the sheet and objective the mean of |dx| + |dy| + |dz| of each
test as the fit to all three leaves it and as the fit to the other two foretells it; and the moduli.
Earlier work (linear orthotropic, Abaqus, a flat sheet) has a mean of 1.86 mm foretold. `mm` is what
that minimised: the sum of RMS errors in millimetres; `relative` is what `bubblefit validate`
minimises: relative RMS errors, in which directions count alike. The sheet of the test left out is
fitted to it, with the law of the others. With --strips the published strips of the same fabric
(warp, fill and bias, by their load polynomials) are in every fit; the objective is then the
relative one, because millimetres and newtons do not add up.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from bubblefit.experiments.kinds import PreparedTest, Weighting
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import Project, read_project
from bubblefit.runs.compare import best_of
from bubblefit.runs.setup import FitSetup, prepare_fit
from bubblefit.runs.validation import held_out
from valmex_tests import DATA, FABRIC, FEW, FIT, bubbles, published_strips

STRAIN = 0.06
PUBLISHED = 1.86

#: Logarithmic strains (warp, fill, shear) that bubbles, and strips, reach.
ENDS, ENDS_OF_STRIPS = [0.13, 0.13, 0.13], [0.18, 0.232, 0.883]


class InMillimetres(FitSetup):
    """A fit of several bubbles whose objective is the sum of their own, in mm."""

    @property
    def weightings(self) -> tuple[Weighting, ...]:
        return tuple(Weighting() for _ in self.tests)


def project(
    data: Path, form: str, modes: int, elements: int, frames: Sequence[int], strips: bool
) -> Project:
    """The three tests, perhaps with the strips."""
    names = {f"test {test}": test for test in (1, 2, 3)}
    tests = bubbles(names, data, frames, elements, modes)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "project.toml"
        law = f'form = "{form}"\nstrain_range = {ENDS_OF_STRIPS if strips else ENDS}\n'
        also = published_strips(25) if strips else ""
        path.write_text(FABRIC + law + tests + also + FIT.format(starts=1))
        return read_project(path, data=dict.fromkeys(names, data))


def law_of_others(
    setup: FitSetup, objective: str, without: str | None, starts: int
) -> HypoelasticLaw | None:
    """The law of a fit of all tests, or without one of them."""
    kept = tuple(test for test in setup.tests if test.test.name != without)
    own = replace(setup, tests=kept)
    if objective == "mm":
        own = InMillimetres(own.project, own.law, own.bounds, kept)
    problem = own.problem()
    unknowns = best_of(own, problem, starts)
    return None if unknowns is None else own.law.with_beta(problem.unknowns.beta(unknowns))


def told(test: PreparedTest, law: HypoelasticLaw | None, setup: FitSetup) -> float:
    """Mean |dx| + |dy| + |dz| of a test with a law, mm; NaN where either does not run."""
    if law is None:
        return float("nan")
    found = held_out(test, law, setup.make_solver)
    return float(found.numbers.get("mean_abs_mm", float("nan")))


def moduli(law: HypoelasticLaw | None) -> str:
    """E1, E2 in GPa and G12 in MPa at one strain."""
    if law is None:
        return "no fit"
    e1, e2, g12 = (float(law.modulus(name, STRAIN)) for name in ("E1", "E2", "G12"))
    return f"E1 {e1 / 1e3:.3f} E2 {e2 / 1e3:.3f} GPa, G12 {g12:.1f} MPa"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--elements", type=int, default=112)
    parser.add_argument("--modes", type=int, nargs="+", default=[0])
    parser.add_argument("--form", nargs="+", default=["constant"])
    parser.add_argument("--objective", nargs="+", default=["mm", "relative"])
    parser.add_argument("--starts", type=int, default=1)
    parser.add_argument("--strips", action="store_true")
    parser.add_argument("--frames", choices=("all", "few"), default="all")
    given = parser.parse_args()
    objectives = ["relative"] if given.strips else given.objective
    frames = range(20) if given.frames == "all" else FEW
    for form in given.form:
        for modes in given.modes:
            own = project(given.data, form, modes, given.elements, frames, given.strips)
            setup = prepare_fit(own, own.chosen(None, fitted=True))  # type: ignore[arg-type]
            for objective in objectives:
                also = ", with strips" if given.strips else ""
                print(f"{form} moduli, {modes} modes of the sheet, {objective}{also}", flush=True)
                together = law_of_others(setup, objective, None, given.starts)
                print(f"    all three: {moduli(together)}", flush=True)
                foretold = []
                for test in setup.tests:
                    if test.test.kind != "bubble":
                        continue
                    name = test.test.name
                    law = law_of_others(setup, objective, name, given.starts)
                    foretold.append(told(test, law, setup))
                    print(f"    {name}: foretold {foretold[-1]:.2f} mm, in the fit to all "
                          f"{told(test, together, setup):.2f} mm; without it {moduli(law)}",
                          flush=True)  # fmt: skip
                print(f"    mean foretold {np.mean(foretold):.2f} mm, beside {PUBLISHED} of earlier"
                      " work", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
