"""Height of a bubble's apex on coarse disks, their rim on the circle or out where the area is its.

A disk's rim is a polygon inscribed in the circle, with too little area. Here its nodes are also
moved out, with all others in proportion, to where the polygon has the circle's area (as those of a
bent cylinder are, meshes/tube.py). The bubble of Table 4.2, a quarter, at its seven pressures;
errors in % of the apex on the finest disk, whose two rims hardly differ.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from bench_increments import LAW, PRESSURES
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.mesh import Mesh
from bubblefit.solvers.membrane.solver import MembraneSolver
from numpy.typing import NDArray

RADIUS, THICKNESS = 100.0, 0.81
#: Quads of the quarter.
QUADS, FINEST = (12, 25, 50, 100, 200), 3200


def main() -> None:
    finest = disk_mesh(RADIUS, 4 * FINEST, "quarter")
    exact = heights(finest)
    apart = 100 * np.abs(heights(moved_out(finest)) / exact - 1).max()
    print(f"{len(finest.quads)} quads: the two rims differ by {apart:.3f} %\n")
    print("| quads of the quarter | area missing, % | rim on the circle: first, last pressure, % |"
          " of equal area, % |\n|---|---|---|---|")  # fmt: skip
    sizes, errors = [], []
    for wanted in QUADS:
        mesh = disk_mesh(RADIUS, 4 * wanted, "quarter")
        off = [100 * (heights(m) / exact - 1) for m in (mesh, moved_out(mesh))]
        on, out = (f"{one[0]:+.3f}, {one[-1]:+.3f}" for one in off)
        print(f"| {len(mesh.quads)} | {100 * (1 - factor(mesh) ** -2):.2f} | {on} | {out} |")
        sizes.append(len(mesh.quads) ** -0.5)
        errors.append([abs(one[k]) for one in off for k in (0, -1)])
    orders = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    words = ", ".join(f"{order:.2f}" for order in orders)
    print(f"| order | | {', '.join(words.split(', ')[:2])} | {', '.join(words.split(', ')[2:])} |")


def heights(mesh: Mesh) -> NDArray[np.float64]:
    """Of the apex (mm) at every pressure."""
    history = MembraneSolver().run(BubbleModel(mesh, THICKNESS, PRESSURES.tolist()), LAW)
    return history.displacement[:, mesh.node_sets["apex"][0], 2]


def factor(mesh: Mesh) -> float:
    """By which the rim's polygon is to grow to have the area of the circle."""
    x, y = mesh.points[mesh.node_sets["rim"], :2].T
    turns = np.diff(np.sort(np.arctan2(y, x)))
    return float(np.sqrt(turns.sum() / np.sin(turns).sum()))


def moved_out(mesh: Mesh) -> Mesh:
    """The disk with a rim of the circle's area."""
    return replace(mesh, points=factor(mesh) * mesh.points)


if __name__ == "__main__":
    main()
