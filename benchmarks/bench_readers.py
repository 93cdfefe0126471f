"""Reading exports of image correlation: processor time and memory of a whole test, by format.

    python benchmarks/bench_readers.py [POINTS] [FRAMES] [FORMAT ...]

37,000 points a frame and 49 frames unless given. One export is written for each format, read as
often as there are frames (each reading is of the file, from its beginning), and kept, as a fit
does. Processor time, for wall clock means nothing beside other work; ratios are to the plain table.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from bubblefit.readers.fields import read_fields
from bubblefit.tests.dic_exports import EXPORTS


def bubble(points: int) -> tuple[np.ndarray, np.ndarray]:
    """Places and displacements (points, 3) mm over a disk."""
    random = np.random.default_rng(1)
    r, angle = 100 * np.sqrt(random.random(points)), 2 * np.pi * random.random(points)
    places = np.stack([r * np.cos(angle), r * np.sin(angle), 0.02 * r], axis=1)
    high = 1 - (r / 100) ** 2
    return places, high[:, None] * np.stack([0.05 * places[:, 0], 0.03 * places[:, 1], 30 + r], 1)


def main() -> None:
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    points, frames = [*numbers, 37_000, 49][:2] if len(numbers) < 2 else numbers[:2]
    cases = [word for word in sys.argv[1:] if not word.isdigit()] or list(EXPORTS)
    print(f"{points} points, {frames} frames; s of processor time, MB of file, peak MB so far")
    plain = None
    for case in cases:
        with tempfile.TemporaryDirectory() as folder:
            (file,) = EXPORTS[case][1](Path(folder), [bubble(points)])
            read_fields([file], [0.1])  # imports, which are not the reader's time
            start = time.process_time()
            kept = [read_fields([file], [0.1]) for _ in range(frames)]
            taken = time.process_time() - start
            size = file.stat().st_size / 1e6
        plain = plain or taken
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        assert len(kept[-1][0].points) == points
        print(
            f"{case:14} {taken:7.2f} s {taken / plain:6.2f} x plain {size:7.1f} MB {peak:7.0f} MB"
        )


if __name__ == "__main__":
    main()
