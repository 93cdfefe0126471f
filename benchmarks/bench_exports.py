"""What exported cards lose, for Table 4.2: moduli in tables, uncoupled curves.

Usage: bench_exports.py. The figures of docs/how-to/exports.md: largest relative error of a modulus
between the points of its table; biaxial stress that curves of strips do not give, both yarns
stretched alike; 2nd Piola-Kirchhoff stress along the yarns in trellis shear.
"""

from __future__ import annotations

import numpy as np
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.exports import base as curves
from bubblefit.materials.responses import trellis_angle, trellis_curve
from bubblefit.materials.tables import modulus_tables
from known_solution import known_model_and_law

POINTS, STRETCHES = (61, 121, 201), (0.02, 0.05, 0.10)
GAMMA = 0.13


def main() -> None:
    model, law = known_model_and_law()
    card = MaterialCard(law, model.thickness, "Table 4.2")
    print("tables: largest error between points, %")
    for points in POINTS:
        errors = {name: 100 * t.error for name, t in modulus_tables(law, points).items()}
        print(f"{points:5d} points   " + "   ".join(f"{n} {e:.2g}" for n, e in errors.items()))
    print("curves of strips, both yarns stretched alike: stress that is missing, %")
    for stretch in STRETCHES:
        warp, fill = softer(card, stretch)
        print(
            f"{100 * stretch:5.0f} % of log strain   warp {100 * warp:.0f}   fill {100 * fill:.0f}"
        )
    _, _, yarns = trellis_curve(law, np.linspace(0, trellis_angle(GAMMA), 21), "green")
    warp, fill = np.abs(yarns).max(axis=0)
    print(f"trellis to gamma12 = {GAMMA:g}: {warp:.1f} and {fill:.1f} MPa along warp and fill")


def softer(card: MaterialCard, stretch: float) -> tuple[float, float]:
    """As every exported file says it, at another log strain than its own."""
    shares: tuple[float, float] = curves._softer(card.law, stretch)
    return shares


if __name__ == "__main__":
    main()
