"""The program that the adapter drives; it knows nothing of bubblefit.

    python homogeneous_program.py job.json

pulls a strip that is free to contract and writes job.csv: a row an increment, stretch along and
across the pull and force (N). Exit code 3: a modulus is not positive.
"""

import csv
import json
import sys
from collections.abc import Iterator
from math import exp, log
from pathlib import Path
from typing import Any

VERSION = "1.0"


def modulus(yarn: dict[str, Any], strain: float) -> float:
    """A cubic (highest power first, MPa) of log strain, held outside [0, end]."""
    cubic, x = yarn["cubic"], min(max(strain, 0.0), yarn["end"])
    return ((cubic[0] * x + cubic[1]) * x + cubic[2]) * x + cubic[3]


def pull(job: dict[str, Any]) -> Iterator[tuple[float, float, float]]:
    """Rows (stretch along, stretch across, force) of a strip; moduli at midpoint strains."""
    along = across = stress = 0.0
    for stretch in job["stretches"]:
        step, contraction = log(stretch) - along, 0.0
        # The moduli at the midpoint depend on the contraction, which depends on them.
        for _ in range(50):
            e = modulus(job["along"], along + step / 2)
            e_across = modulus(job["across"], across + contraction / 2)
            if not (e > 0 and e_across > 0):
                sys.exit(3)
            # No stress across: nu along-across is nu12 for the warp, nu21 for the fill.
            nu = job["nu12"] * (1.0 if job["warp"] else e / e_across)
            before, contraction = contraction, -nu * step
            if abs(contraction - before) < 1e-15:
                break
        along, across, stress = along + step, across + contraction, stress + e * step
        # Cauchy stress on the present width; thickness as it was, or volume as it was.
        area = exp(across) if job["constant_thickness"] else exp(-along)
        yield exp(along), exp(across), stress * area * job["width"] * job["thickness"]


def main() -> None:
    if sys.argv[1:] == ["--version"]:
        print(VERSION)
        return
    path = Path(sys.argv[1])
    with path.with_suffix(".csv").open("w", newline="") as file:
        csv.writer(file).writerows(pull(json.loads(path.read_text())))


if __name__ == "__main__":
    main()
