"""Measure estimates by virtual work of noisy fields of the known solution."""

from dataclasses import replace

import numpy as np
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.runs.estimate import estimate_of
from common import known_project, known_setup, start_on

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


if __name__ == "__main__":
    start_on(estimate)
