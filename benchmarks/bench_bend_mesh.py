"""Bending with coarse and fine elements: how far the loads that `bend` predicts are apart.

Usage: bench_bend_mesh.py [SIZES] [CASE ...]. SIZES: mm of an element, the last of them what the
others are held against ("25,12" unless given); CASE: DIAMETER/KPA of the example's cylinders
(150/140 unless given). Each with the cards "uniaxial" and "bubble 1", to 240 mm; one analysis with
12 mm is one to two minutes of CPU time. `25,12 150/140 200/100 250/85` makes the table of
docs/validation/bending.md.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import bubblefit as bf
import numpy as np
from bubblefit.experiments.cylinder.predicted import initial_stiffness
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "bend-valmex7318" / "project.toml"
CARDS, SIZES, CASES = ("uniaxial", "bubble 1"), "25,12", ("150/140",)
#: mm of deflection: where loads are shown, and over which the stiffness is taken.
PLACES, OVER = (20.0, 40.0, 100.0, 160.0, 240.0), 20.0


def main() -> None:
    sizes = [float(size) for size in (sys.argv[1] if len(sys.argv) > 1 else SIZES).split(",")]
    project = bf.read_project(EXAMPLE)
    heads = ("cylinder, card", "mm", "quads", "N/mm", *(f"at {p:g} mm, N" for p in PLACES))
    print(f"| {' | '.join(heads)} | most off, % |\n|{'---|' * (len(heads) + 1)}")
    for case in sys.argv[2:] or CASES:
        diameter, pressure = case.split("/")
        name = f"{diameter} mm, {pressure} kPa"
        for card in CARDS:
            tests = [replace(project.tests[name], size=size) for size in sizes]  # type: ignore[call-arg]
            found = [curve(test, project.cards[card].card) for test in tests]
            for size, (quads, way, load) in zip(sizes, found, strict=True):
                numbers = [initial_stiffness(way, load, OVER), *np.interp(PLACES, way, load)]
                shown = [f"{numbers[0]:.2f}", *(f"{number:.1f}" for number in numbers[1:])]
                row = [f"{name}, {card}", f"{size:g}", str(quads), *shown]
                print(f"| {' | '.join(row)} | {most_off(way, load, *found[-1][1:])} |", flush=True)


def curve(test: Any, card: Any) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    """Quads, and the curve of load (N) over deflection (mm) as `bend` predicts it."""
    model = test.model(card.thickness)
    history = MembraneSolver().run(model, card.law)
    way = np.array([0.0, *model.deflections])[: len(history.load)]
    return len(model.mesh.quads), way, history.load


def most_off(way, load, fine_way, fine_load) -> str:  # type: ignore[no-untyped-def]
    """The largest difference from the fine mesh at a frame, and at which deflection."""
    count = min(len(way), len(fine_way))
    off = 100 * (load[1:count] / fine_load[1:count] - 1)
    at = int(np.abs(off).argmax())
    return f"{off[at]:+.1f} at {way[at + 1]:g} mm" if np.abs(off).max() > 0 else "-"


if __name__ == "__main__":
    main()
