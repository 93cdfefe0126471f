"""Seconds and memory to register and look at a whole bubble test: 37,000 points, 49 frames.

    python benchmarks/bench_check.py [POINTS] [FRAMES]

Prints processor seconds of the registration and of the doubts, and the largest memory of the
process; reading is `bench_readers.py`.
"""

from __future__ import annotations

import resource
import sys
import time

import numpy as np
from bubblefit.experiments.bubble.doubts import View, doubts_of
from bubblefit.experiments.bubble.registration import register_fields
from bubblefit.experiments.kinds import Expected
from bubblefit.meshes.disk import Outline
from bubblefit.readers.fields import DisplacementField
from scipy.spatial.transform import Rotation

RADIUS = 100.0


def seen(points: int, frames: int) -> list[DisplacementField]:
    """A shape that an orthotropic sheet could take, turned, tilted and shifted, with noise."""
    rng = np.random.default_rng(1)
    turn = Rotation.from_euler("zx", [12.0, 3.0], degrees=True)
    line = np.linspace(-1.15, 1.15, round(np.sqrt(points * 4 / np.pi)))
    x, y = (axis.ravel() for axis in np.meshgrid(line, line))
    near = np.hypot(x, y) < 1.15
    x, y = x[near], y[near]
    on = np.clip(1 - x**2 - y**2, 0.0, None)
    flat = RADIUS * np.stack([x, y, 0 * x], axis=1)
    places = turn.apply(flat) + np.array([3.0, -4.0, 600.0])
    fields = []
    for rise in np.linspace(3.0, 35.0, frames):
        side = rise**2 / RADIUS * on
        moved = np.stack([0.3 * side * x, 0.5 * side * y, rise * on * (1 + 0.05 * y**2)], axis=1)
        moved += 0.01 * rng.standard_normal(moved.shape)
        pressure = 0.3 * (rise / 35.0) ** 3
        fields.append(DisplacementField(pressure, places[:, :2], turn.apply(moved), z=places[:, 2]))
    return fields


def main() -> None:
    points, frames = (int(a) for a in (sys.argv[1:] + ["37000", "49"][len(sys.argv) - 1 :]))
    fields = seen(points, frames)
    begun = time.process_time()
    moved, found = register_fields(fields, Outline.circle(RADIUS))
    registered = time.process_time()
    expected = Expected({"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (1.0, 200.0)})
    doubts = doubts_of(View(moved, Outline.circle(RADIUS), 0.8, True), expected)
    looked = time.process_time()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{len(fields[0].points)} points, {frames} frames, warp at {found.warp_angle:.2f} degrees"
    )
    print(f"registered in {registered - begun:.1f} s, looked at in {looked - registered:.1f} s")
    print(f"memory at most {memory:.0f} MiB; doubts: {[d.name for d in doubts] or 'none'}")


if __name__ == "__main__":
    main()
