"""The thesis' Fig. 4.2: largest displacement at 300 kPa for five nu12, over the mean of the five.

Prints the published ratios beside ours, and exits 1 where they are further off than known: up to
0.0075, the same curve 1.24 times as steep, because Marc's pressure did not follow the surface
(docs/validation/published-bubble.md).

    python benchmarks/reproduction/nu12_figure_4_2.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import bubblefit as bf
import numpy as np
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.studies.poisson import Ratios, vary_nu12

KNOWN = Path(bf.__file__).parent / "examples" / "bubble-known-solution" / "project.toml"
#: By nu12, as read off the figure to three decimals.
FIGURE = {0.05: 1.029, 0.15: 1.016, 0.25: 1.0015, 0.35: 0.985, 0.45: 0.967}
#: "Plus or minus three percent".
BAND = 0.03
#: Furthest off; how much steeper, and how near to that.
MOST, STEEPER, NEAR = 0.0075, 1.24, 0.03


def ratios() -> Ratios:
    """Ours, at 300 kPa, of the known solution."""
    project = bf.read_project(KNOWN)
    ends = project.law.strain_range
    assert ends is not None
    test = project.tests["bubble"]
    law = HypoelasticLaw(test.data.beta, 0.24, np.array(ends))  # type: ignore[attr-defined]
    card = MaterialCard(law, project.fabric.thickness, "Table 4.2")
    return vary_nu12(project, card, list(FIGURE)).parts["bubble"].responses["300 kPa"]


def compare(ours: Ratios) -> tuple[float, float]:
    """Largest difference, and how many times as steep our curve is."""
    published = np.array([*FIGURE.values()])
    slope = np.polyfit(published - 1, ours.to_mean - 1, 1)[0]
    return float(np.abs(ours.to_mean - published).max()), float(slope)


def main() -> int:
    """Print, and whether it is as known."""
    ours = ratios()
    most, slope = compare(ours)
    for (nu12, published), ratio in zip(FIGURE.items(), ours.to_mean, strict=True):
        print(f"nu12 {nu12:.2f}   published {published:.4f}   bubblefit {ratio:.4f}")
    print(f"at most {most:.4f} off, {slope:.2f} times as steep")
    low, high = ours.to_mean.min() - 1, ours.to_mean.max() - 1
    print(f"{100 * low:+.1f} to {100 * high:+.1f} % of the mean (published: +-{100 * BAND:g} %)")
    return 0 if most < MOST and abs(slope - STEEPER) < NEAR else 1


if __name__ == "__main__":
    sys.exit(main())
