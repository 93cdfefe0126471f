"""A law that goes with the load ratio: increments, fits, and forms of strain beside it.

Usage: bench_load_ratio.py. What an increment takes the ratio of (a path that is nowhere in
proportion, small strains); increments and Newton's work on a bubble of 108 quads in the quarter;
the fit of a bubble of 48 quads to what such a law computes; five computed ratios of it, each left
out in turn of fits of several forms.
"""

from __future__ import annotations

import tempfile
from itertools import pairwise
from pathlib import Path

import bubblefit as bf
import numpy as np
from bubblefit.materials.designers import RATIOS, shares
from bubblefit.materials.forms.ratio import LoadRatio
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs.validation import validate
from bubblefit.solvers.membrane.solver import MembraneSolver

NU, THICKNESS = 0.24, 0.8
#: MPa: G12, E2 at 1:1, what it gains, E1 at 1:1, what it gains.
BETA = np.array([30.0, 800.0, 400.0, 1000.0, -300.0])
SOFT = np.array([12.0, 240.0, 120.0, 600.0, -150.0])
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
CORNERS = np.array([[0.0, 0.0], [20.0, 5.0], [10.0, 25.0]])
FORMS = ("load-ratio", "cubic", "constant")


def law_of(beta: np.ndarray) -> HypoelasticLaw:
    return HypoelasticLaw(beta, NU, form=LoadRatio())


def strain(parts: int, where: float) -> np.ndarray:
    """Along CORNERS, each leg in `parts`, with the ratio of the stress at a share of each part."""
    law, total = law_of(BETA), np.zeros(2)
    for start, end in pairwise(CORNERS):
        step = (end - start) / parts
        for k in range(parts):
            gamma = start + (k + where) * step
            gamma = gamma / np.hypot(*gamma) if gamma.any() else np.full(2, np.sqrt(0.5))
            e1, e2 = (
                float(law.modulus("E1", 0.0, gamma[0])),
                float(law.modulus("E2", 0.0, gamma[1])),
            )
            total += np.array([[1 / e1, -NU / e1], [-NU / e1, 1 / e2]]) @ step
    return total


def increments() -> None:
    print("a path in two legs, error of the strain at its end, %: ratio at start, mean, end")
    exact = strain(20_000, 0.5)
    for parts in (1, 2, 4, 8, 16):
        ends = [strain(parts, where) for where in (0.0, 0.5, 1.0)]
        off = [100 * np.abs(end - exact).max() / exact.max() for end in ends]
        print(f"  {2 * parts:3d} increments  " + "".join(f"{x:10.4f}" for x in off))


def bubble() -> None:
    mesh = disk_mesh(100.0, 108, "quarter")
    print("a bubble, seven pressures to 300 kPa: error of the displacements, % of the apex")
    for words, beta in (("load-ratio", SOFT), ("constants", SOFT * [1, 1, 0, 1, 0])):
        ends = None
        for parts in (40, 4, 2, 1):
            share = np.arange(1, parts + 1) / parts
            rises = zip([0.0, *PRESSURES[:-1]], PRESSURES, strict=True)
            steps = np.concatenate([a + (b - a) * share for a, b in rises])
            model = BubbleModel(mesh, 0.81, PRESSURES, steps)
            found = MembraneSolver().run(model, law_of(beta))
            ends = found.displacement if ends is None else ends
            off = 100 * np.abs(found.displacement - ends).max() / ends.max()
            print(f"  {words:10s} {7 * parts:4d} increments {off:9.5f}  "
                  f"{found.iterations / (7 * parts):.1f} assemblies an increment")  # fmt: skip


def known_bubble(folder: Path) -> None:
    numbers = ", ".join(f"{x:g}" for x in SOFT)
    path = folder / "bubble.toml"
    path.write_text(
        '[fabric]\nname = "computed"\nthickness = 0.81\n[units]\nmodulus = "MPa"\n'
        'pressure = "kPa"\nlength = "mm"\n[law]\nform = "load-ratio"\nnu12 = 0.24\n'
        "[law.bounds]\nE1 = [50, 3000]\nE2 = [50, 3000]\nG12 = [1, 300]\n"
        "[[bubble]]\nradius = 100.0\npressures = [22, 59, 97, 132, 186, 251, 300]\n"
        'elements = 192\nsymmetry = "quarter"\n[bubble.match]\nby = "points"\n'
        f'[bubble.data.known_solution]\nform = "load-ratio"\nbeta = [{numbers}]\n'
    )
    fit = bf.fit(bf.read_project(path), starts=3)
    off = np.abs(fit.law.beta / SOFT - 1).max()
    print(f"a bubble of 48 quads, {len(fit.best.ranked)} starts: objective {fit.objective:.1e}, "
          f"unknowns within {off:.1e}; nothing else than a bubble is fitted")  # fmt: skip


def left_out(folder: Path) -> None:
    rows = ['ratio,"n_w, kN/m","n_f, kN/m","eps_w, %","eps_f, %"']
    for ratio in RATIOS:
        loads = np.outer(np.linspace(2.0, 30.0, 30), shares(ratio))
        found = 100 * biaxial_response(law_of(BETA), loads, THICKNESS).elongation
        rows += [",".join([ratio, *map(repr, map(float, [*n, *e]))])
                 for n, e in zip(loads, found, strict=True)]  # fmt: skip
    (folder / "test.csv").write_text("\n".join(rows) + "\n")
    path = folder / "project.toml"
    path.write_text(
        f'[fabric]\nname = "computed"\nthickness = {THICKNESS}\n[units]\nmodulus = "MPa"\n'
        '[law]\nform = "cubic"\nnu12 = 0.24\nstrain_range = [0.07, 0.07, 0.1]\n[law.bounds]\n'
        "E1 = [100, 3000]\nE2 = [100, 3000]\nG12 = [1, 300]\n[[biaxial]]\n[biaxial.data]\n"
        'files = ["test.csv"]\n[fit]\nstarts = 1\n'
    )
    done = validate(bf.read_project(path), forms=FORMS, leave="ratios", starts=1)
    table = done.table()
    print("five computed ratios, each left out in turn: RMS of its strains, % (foretold, fitted)")
    print(table.to_string(index=False, float_format="%.3g"))


def main() -> None:
    increments()
    bubble()
    with tempfile.TemporaryDirectory() as place:
        known_bubble(Path(place))
        left_out(Path(place))


if __name__ == "__main__":
    main()
