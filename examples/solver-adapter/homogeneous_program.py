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


def integral(pieces: list[list[float]], strain: float) -> float:
    """Of a modulus (MPa) from zero to a log strain.

    A piece has the strain up to which it holds and a cubic, highest power first; the modulus is
    held below zero strain and beyond the last piece.
    """
    first, start, total = pieces[0], 0.0, 0.0
    if strain <= 0:
        return first[4] * strain
    for end, *cubic in pieces:
        for power, factor in zip((4, 3, 2, 1), cubic, strict=True):
            total += factor * (min(strain, end) ** power - start**power) / power
        start = end
        if strain <= end:
            return total
    a, b, c, d = pieces[-1][1:]
    return total + (((a * start + b) * start + c) * start + d) * (strain - start)


def mean(pieces: list[list[float]], old: float, new: float) -> float:
    """Of a modulus over an increment of its strain; of a tiny one about it where it is smaller."""
    if abs(new - old) < 1e-6:
        old, new = old - 1e-6, old + 1e-6
    return (integral(pieces, new) - integral(pieces, old)) / (new - old)


def pull(job: dict[str, Any]) -> Iterator[tuple[float, float, float]]:
    """Rows (stretch along, stretch across, force) of a strip; moduli are means of an increment."""
    along = across = stress = 0.0
    for stretch in job["stretches"]:
        step, contraction = log(stretch) - along, 0.0
        # The mean across depends on the contraction, which depends on it.
        for _ in range(50):
            e = mean(job["along"], along, along + step)
            e_across = mean(job["across"], across, across + contraction)
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
