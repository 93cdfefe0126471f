"""The published cards of VALMEX 7318 as a designer's constants, and how far these hang on choices.

Usage: bench_designers_constants.py [LOWEST HIGHEST] (0 and 5 kN/m unless given): for each card of
the bending example, constants by least squares of the strains of eight paths, the spread over all
other choices of what is evaluated, and the RMS of strain that straight lines leave.
"""

from __future__ import annotations

import sys
from pathlib import Path

import bubblefit as bf
from bubblefit.errors import InputError
from bubblefit.materials.designers import constants_of_law, spread_of

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "bend-valmex7318" / "project.toml"
SHEAR = 0.05
NAMES = {"warp": "E warp", "fill": "E fill", "nu_warp": "nu_warp", "nu_fill": "nu_fill"}


def main() -> None:
    lowest, highest = (float(x) for x in sys.argv[1:3]) if len(sys.argv) > 2 else (0.0, 5.0)
    print(f"{lowest:g} to {highest:g} kN/m, G to a shear strain of {SHEAR:g}; E and G in kN/m")
    for name, one in bf.read_project(EXAMPLE, need_data=False).cards.items():
        card = one.card
        try:
            found = constants_of_law(card.law, card.thickness, lowest, highest, SHEAR)
        except InputError as error:
            print(f"{name:10s}{error.problem}")
            continue
        c = found.constants
        ends = spread_of((found.evaluation, *found.others))
        parts = [
            f"{words} {getattr(c, key):.3g} ({ends[key][0]:.3g} to {ends[key][1]:.3g})"
            for key, words in NAMES.items()
        ]
        print(f"{name:10s}{', '.join(parts)}, G {c.shear:.3g} ({found.shear[0]:.3g} to "
              f"{found.shear[1]:.3g}); {1 + len(found.others)} choices; RMS {found.rms:.2g} % "
              f"of up to {max(found.largest.values()):.2g} %")  # fmt: skip


if __name__ == "__main__":
    main()
