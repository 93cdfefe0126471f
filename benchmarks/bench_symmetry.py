"""How far the three real bubble tests are from any doubly symmetric model.

Usage: bench_symmetry.py [DATA_FOLDER]. A model with warp and fill as planes of symmetry has one
value for a point and its mirror images (dx odd in x, dy odd in y, dz even in both); the nearest in
mean |dx| + |dy| + |dz| is their median. What is left then, over all points and pressures, is the
floor that docs/validation/results.md names: no such model can be nearer. Beside it the mean
difference of dz between mirror images, left and right (x -> -x) and top and bottom (y -> -y), and
dz in the middle of the first picture.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).resolve().parent.parent
PRESSURES, RADIUS = 20, 100.0
FIELDS = ("dx", "dy", "dz")
#: Sign of each displacement under x -> -x and under y -> -y.
PARITY = {"dx": (-1, 1), "dy": (1, -1), "dz": (1, 1)}
AXES = ("x", "y")


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "data" / "bubble"
    if not (folder / "grid").is_dir():
        print(f"skipped: no measured data in {folder}")
        return
    print("test  floor, mm  left and right, mm  top and bottom, mm  first picture, mm")
    for test in (1, 2, 3):
        frames = [read(folder / "grid" / f"test{test}_{k:02d}.csv") for k in range(PRESSURES)]
        left = np.mean(np.concatenate([unsymmetric(frame) for frame in frames]))
        gaps = [
            np.mean(np.concatenate([mirrored(frame, axis) for frame in frames])) for axis in AXES
        ]
        middle = float(frames[0].dz[np.hypot(frames[0].x, frames[0].y) < 1.0].mean())
        print(f"{test:4d}{left:11.2f}{gaps[0]:20.2f}{gaps[1]:20.2f}{middle:19.1f}")


def read(path: Path) -> pd.DataFrame:
    """Points on the disk that are not doubtful."""
    frame = pd.read_csv(path, comment="#")
    return frame[(frame.flag == 0) & (np.hypot(frame.x, frame.y) <= RADIUS)]


def unsymmetric(frame: pd.DataFrame) -> np.ndarray:
    """(points,) |dx| + |dy| + |dz| from the nearest doubly symmetric field."""
    cells = frame[["x", "y"]].abs().round(1)
    groups = [cells["x"], cells["y"]]
    total = np.zeros(len(frame))
    for name in FIELDS:
        sign = np.ones(len(frame))
        for axis, parity in zip(AXES, PARITY[name], strict=True):
            # On a plane of symmetry what is odd across it is zero.
            sign *= np.sign(frame[axis].round(1)) if parity < 0 else 1.0
        folded = frame[name] * sign
        total += (
            (folded - folded.groupby(groups).transform("median"))
            .abs()
            .where(sign != 0, frame[name].abs())
        )
    return total


def mirrored(frame: pd.DataFrame, axis: str) -> np.ndarray:
    """(pairs,) |dz - dz of the mirror image across the plane `axis` = 0|."""
    here = frame.assign(x=frame.x.round(1), y=frame.y.round(1))
    there = here.assign(**{axis: -here[axis]})
    both = here.merge(there, on=["x", "y"])
    return (both.dz_x - both.dz_y).abs().to_numpy()


if __name__ == "__main__":
    main()
