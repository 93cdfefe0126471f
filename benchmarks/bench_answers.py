"""Measure estimates by virtual work, and how long answers take beside an earlier version."""

import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import bench_valmex
import numpy as np
import pandas as pd
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.runs.estimate import estimate_of
from bubblefit.runs.fit import fit
from common import EXAMPLES, ROOT, known_project, known_setup, start_on

#: mm, of one displacement.
NOISE = 0.0, 0.01, 0.03, 0.1


def estimate(fields=100):
    """Estimate from the known solution (200 quads) with white noise, FIELDS times a level.

    Errors: median and worst over the strain reached, medians over the fields. Coverage: share of
    strains and fields at which the 95 % band holds the true modulus.
    """
    setup = known_setup(known_project())
    (prepared,) = setup.tests
    print(f"{'noise, mm':>10s}" + "".join(f"{name:>8s}, %{'worst':>8s}{'covered':>9s}"
          for name in COMPONENTS) + f"{'chi':>8s}{'cpu, s':>8s}")  # fmt: skip
    for sigma in NOISE:
        rows, chi, seconds = [], [], []
        for seed in range(fields if sigma else 1):
            random, noisy = np.random.default_rng(seed), []
            for f in prepared.fields:
                noise = sigma * random.standard_normal(f.displacement.shape)
                noisy.append(replace(f, displacement=f.displacement + noise))
            test = replace(prepared.test, noise=sigma or NOISE[2])
            found = estimate_of(
                replace(setup, tests=(replace(prepared, fields=tuple(noisy), test=test),))
            )
            rows.append(errors(found, prepared.known))
            chi.append(found.gaps[0].chi)
            seconds.append(found.seconds)
        median, worst, covered = np.array(rows).transpose(1, 0, 2)
        each = np.stack([np.median(median, axis=0), np.median(worst, axis=0), covered.mean(axis=0)])
        print(f"{sigma:10.2f}" + "".join(f"{100 * a:10.2f}{100 * b:8.1f}{100 * c:8.0f} %"
              for a, b, c in each.T) + f"{np.mean(chi):8.2f}{np.median(seconds):8.2f}",
              flush=True)  # fmt: skip


def errors(found, truth):
    """Return median and largest relative error and share inside the band, of each modulus."""
    rows = []
    for name, component in COMPONENTS.items():
        strain = np.linspace(0.0, found.best.valid[component], 61)
        true, own = truth.modulus(name, strain), found.law.modulus(name, strain)
        low, high = found.best.certainty.ends(name, strain, own)
        off = np.abs(own / true - 1.0)
        rows.append([np.median(off), off.max(), np.mean((low <= true) & (true <= high))])
    return np.array(rows).T


def real(modes=0, *, data=bench_valmex.DATA):
    """Estimate from tests 1 to 3 (20 frames of about 500 points), beside a fit of the same."""
    folder = bench_valmex.measured(data)
    for test in bench_valmex.PUBLISHED:
        own = bench_valmex.project(
            bench_valmex.ALONE, {f"test {test}": test}, Path(folder), range(20), 112, modes, 1, 0
        )
        found = estimate_of(known_setup(own))
        fitted = fit(own)
        (gap,), (misfit,) = found.gaps, fitted.misfits.values()
        for name, law, chi in (("estimate", found.law, gap.chi), ("fit", fitted.law, misfit.ratio)):
            moduli = ", ".join(f"{n} {float(law.modulus(n, 0.06)):.4g}" for n in COMPONENTS)
            print(
                f"test {test}, {name:8s}: chi {chi:6.3g}, at a strain of 0.06: {moduli} MPa",
                flush=True,
            )
        print(f"        {found.seconds:.2f} s of processor time, {found.problem.analyses} analyses")


#: A process that reads a project and fits it; prints its processor time, and its children's.
FIT = """
import resource, sys
import bubblefit as bf
found = bf.fit(bf.read_project(sys.argv[1]), jobs=1, starts=int(sys.argv[2]))
found.card
own, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
print(sum(r.ru_utime + r.ru_stime for r in (own, others)), found.objective)
"""


def beside(other, repeats=3, *, data=bench_valmex.DATA):
    """Fit real test 1 (ten modes) and the known solution beside the version in folder OTHER.

    OTHER/bubblefit is a worktree of it (git worktree add). Prints seconds of processor time with
    all processes, the least of REPEATS side by side, and their ratio.
    """
    folder = bench_valmex.measured(data)
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "real.toml"
        table = pd.read_csv(folder / "grid_pressures.csv")
        text = bench_valmex.PROJECT.format(law=bench_valmex.ALONE, starts=1)
        text += bench_valmex.BUBBLE.format(
            name="test 1", test=1, frames=list(bench_valmex.FEW), elements=112, modes=10,
            pressures=[float(table["p_bar"][k]) for k in bench_valmex.FEW], unknowns="",
        )  # fmt: skip
        path.write_text(f'{text}folder = "{folder}"\n')
        works = {"real test 1, one start": (path, 1), "known solution, one start": (KNOWN, 1),
                 "known solution, 10 starts": (KNOWN, 10)}  # fmt: skip
        for name, (project, starts) in works.items():
            least, ends = {}, {}
            for _ in range(int(repeats)):
                for which in (str(other), str(ROOT.parent)):
                    done = subprocess.run(
                        [sys.executable, "-c", FIT, str(project), str(starts)], cwd=place,
                        env={**os.environ, "PYTHONPATH": which}, capture_output=True, text=True,
                    )  # fmt: skip
                    seconds, ends[which] = map(float, done.stdout.split())
                    least[which] = min(seconds, least.get(which, np.inf))
            before, now = least.values()
            print(f"{name}: {before:.2f} s, now {now:.2f} s, {now / before:.2f} of it; objectives "
                  f"{', '.join(f'{e:.6g}' for e in ends.values())}", flush=True)  # fmt: skip


KNOWN = EXAMPLES / "bubble-known-solution" / "project.toml"

if __name__ == "__main__":
    start_on(estimate, real, beside)
