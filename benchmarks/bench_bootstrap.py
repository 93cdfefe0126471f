"""What a bootstrap of a hundred samples costs, and whether its short refits have settled.

Usage: bench_bootstrap.py [SAMPLES] [--data DIR] [--elements N]. The published bubble test 1 (20
frames, full disk of 108 quads, constant moduli, sheet taken for flat) is fitted once, and its
frames are drawn SAMPLES (100) times. Printed: analyses in all and of one sample, how many used up
theirs, one standard deviation of each modulus beside that of the fit, and by how much, in those
standard deviations, a tenth of the samples moves when it gets ten times as many analyses.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from bubblefit.project.project import read_project
from bubblefit.runs import bootstrap as study
from bubblefit.runs.bootstrap import bootstrap
from bubblefit.runs.fit import fit

HERE = Path(__file__).resolve().parent.parent
DATA = HERE.parent / "shared" / "data" / "bubble"
EXAMPLE = HERE / "examples" / "bubble-valmex7318" / "test1-linear.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("samples", type=int, nargs="?", default=100)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--elements", type=int, default=108)
    given = parser.parse_args()
    project = read_project(EXAMPLE, given.data)
    (test,) = project.tests.values()
    test = test.__class__(**{**vars(test), "elements": given.elements})
    project = project.__class__(**{**vars(project), "tests": {test.name: test}})
    found = fit(project, starts=1)
    print(f"fit: {found.objective:.4g} mm, {found.result['analyses']} analyses, 1 start")
    done = bootstrap(project, "frames", given.samples, found.card)
    each = [sample.analyses for sample in done.samples]
    print(
        f"{len(each)} samples: {done.analyses} analyses in all, {np.mean(each):.2f} a sample, "
        f"{max(each)} at most; {done.unfinished} used up theirs"
    )
    for name, (own, of_fit) in done.sigma.items():
        print(f"  1 sigma of {name}: {100 * own:.3g} % (fit, by noise: {100 * of_fit:.3g} %)")
    study.MOST, study.NEGLIGIBLE = 10 * study.MOST, 1e-9
    few = max(2, given.samples // 10)
    settled = bootstrap(project, "frames", few, found.card)
    for name, moduli in settled.moduli.items():
        sigma = done.moduli[name].std(axis=0, ddof=1)
        off = np.abs(moduli - done.moduli[name][:few]) / sigma
        print(f"  {name} of {few} samples moves by {off.max():.2g} sigma at most when it settles")


if __name__ == "__main__":
    main()
