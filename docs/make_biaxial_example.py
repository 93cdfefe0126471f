"""Makes examples/biaxial-computed/test.csv: a biaxial test computed with a published law.

Usage: python docs/make_biaxial_example.py. Five ratios of three cycles, 0.5 to 10 kN/m; the law is
Table 3.2's (fitted to strips); the first cycle of a ratio leaves 0.20 and 0.30 % along warp and
fill, every later one 0.02 and 0.03 %, in proportion to the load of the loading; strains have 0.01 %
of noise.
"""

from __future__ import annotations

from pathlib import Path

import bubblefit as bf
import numpy as np
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.designers import RATIOS, shares

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
LOWEST, HIGHEST, UP, DOWN = 0.5, 10.0, 25, 10
FIRST, LATER, NOISE = np.array([0.20, 0.30]), np.array([0.02, 0.03]), 0.01


def main() -> None:
    cards = bf.read_project(EXAMPLES / "bend-valmex7318" / "project.toml", need_data=False).cards
    card = cards["uniaxial"].card
    random = np.random.default_rng(7318)
    share = np.concatenate([np.linspace(0, 1, UP), np.linspace(1, 0, DOWN + 1)[1:]])
    kept, lines = np.zeros(2), ['ratio,"n_w, kN/m","n_f, kN/m","eps_w, %","eps_f, %"']
    for ratio in RATIOS:
        for cycle in range(3):
            # Both yarns have the prestress, whatever the ratio.
            loads = LOWEST + np.outer((HIGHEST - LOWEST) * share, shares(ratio))
            strain = 100 * biaxial_response(card.law, loads, card.thickness).elongation
            grown = np.maximum.accumulate(share)[:, None] * (LATER if cycle else FIRST)
            noise = NOISE * random.standard_normal(strain.shape)
            rows = np.column_stack([loads, strain + kept + grown + noise])
            lines += [f"{ratio}," + ",".join(f"{x:.4f}" for x in row) for row in rows]
            kept = kept + grown[-1]
    path = EXAMPLES / "biaxial-computed" / "test.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{path}: {len(lines) - 1} rows")


if __name__ == "__main__":
    main()
