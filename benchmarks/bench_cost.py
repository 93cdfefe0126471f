"""Measure time, memory and size: analyses, growth with the mesh, reading."""

import resource
import tempfile
import time
from pathlib import Path

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.doubts import View, doubts_of
from bubblefit.experiments.bubble.registration import register_fields
from bubblefit.experiments.kinds import Expected
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, disk_mesh
from bubblefit.readers.fields import DisplacementField, read_fields
from bubblefit.solvers.base import parameters_of
from bubblefit.solvers.membrane import factorisation
from bubblefit.solvers.membrane.solver import MembraneSolver
from common import known_model_and_law, seconds, start_on
from dic_exports import EXPORTS
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_info, threadpool_limits

QUADS = (192, 450, 800, 1800, 3200, 7200, 20_000)
#: Doubles of band storage beyond which the banded LU is not tried (half a gigabyte).
MOST_BAND, AS_SHIPPED = 64_000_000, factorisation.LARGEST_BAND
RADIUS = 100.0


def analysis(repeats=40):
    """Time an analysis of the known solution and its derivatives, the least of REPEATS turns."""
    model, law = known_model_and_law()
    solver = MembraneSolver()
    # Warm starts come from a neighbour, as in a fit that is settling: 0.1 % away, with its slope.
    near = law.with_beta(1.001 * law.beta)
    history, _ = solver.run_with_sensitivity(model, near)
    guess = history.path + history.path_slope @ (law.beta - near.beta)
    threads = max((info["num_threads"] for info in threadpool_info()), default=1)
    variants = {
        "analysis, cold": lambda: solver.run(model, law),
        "analysis, warm": lambda: solver.run(model, law, guess=guess),
        "with 12 derivatives, cold": lambda: solver.run_with_sensitivity(model, law),
        "with 12 derivatives, warm": lambda: solver.run_with_sensitivity(model, law, guess=guess),
        "with all 14, cold": lambda: solver.run_with_sensitivity(model, law, parameters_of(law)),
    }
    with threadpool_limits(1):
        turns = [[seconds(run) for run in variants.values()] for _ in range(repeats)]
    times = dict(zip(variants, np.min(turns, axis=0), strict=True))
    base = times["analysis, cold"]
    parallel = min(seconds(variants["analysis, cold"]) for _ in range(5))
    print(f"{len(model.mesh.quads)} quads, {len(model.increments)} increments, one core")
    print(f"{'':28s}{'ms':>8s}{'a second':>10s}{'in cold analyses':>18s}")
    for name, t in {**times, f"cold, {threads} BLAS threads": parallel}.items():
        print(f"{name:28s}{1e3 * t:8.1f}{1 / t:10.0f}{t / base:18.2f}")
    gradient = times["with 12 derivatives, cold"] / base - 1
    print(f"a gradient costs {gradient:.2f} of an analysis (goal: at most 0.5)")


def growth(largest=QUADS[-1]):
    """Time quarter models of up to LARGEST quads, banded LU beside SuperLU, on one core."""
    base, law = known_model_and_law()
    print(f"{'quads':>6s}{'unknowns':>10s}{'band, s':>9s}{'SuperLU, s':>12s}"
          f"{'faster / 200 quads':>20s}{'shipped':>9s}{'apex, mm':>10s}")  # fmt: skip
    found = []
    with threadpool_limits(1):
        timed(base, law, AS_SHIPPED)  # compiles
        for wanted in (n for n in QUADS if n <= largest):
            mesh = disk_mesh(100.0, 4 * wanted, "quarter")
            model = BubbleModel(mesh, base.thickness, base.pressures, base.increments)
            reference = min(timed(base, law, AS_SHIPPED)[0] for _ in range(5))
            repeats = 3 if wanted < 1000 else 1
            (band, apex, kind), (sparse, _, _) = (
                min(timed(model, law, limit) for _ in range(repeats)) for limit in (MOST_BAND, 0)
            )
            shipped = timed(model, law, AS_SHIPPED)[2] if wanted < 4000 else "SuperLU"
            best = min(band, sparse) / reference
            found.append((len(mesh.quads), best))
            text = f"{band:9.3f}" if kind == "band" else f"{'-':>9s}"
            print(f"{len(mesh.quads):6d}{mesh.points.size - len(model.fixed):10d}{text}"
                  f"{sparse:12.3f}{best:20.1f}{shipped:>9s}{apex:10.3f}", flush=True)  # fmt: skip
    sizes, ratios = np.log([row for row in found if np.isfinite(row[1])]).T
    print(f"time grows with quads to the power {np.polyfit(sizes, ratios, 1)[0]:.2f}")


def timed(model, law, limit):
    factorisation.LARGEST_BAND = limit
    try:
        solver, done = MembraneSolver(), []
        kind = type(solver._membrane(model, law).tangent).__name__
        wall = seconds(lambda: done.append(solver.run(model, law)))
    except SolverFailure as failure:
        print(failure)
        return float("nan"), float("nan"), "failed"
    finally:
        factorisation.LARGEST_BAND = AS_SHIPPED
    apex = done[0].displacement[-1, model.mesh.node_sets["apex"][0], 2]
    return wall, float(apex), "band" if kind == "BandedTangent" else "SuperLU"


def registration(points=37_000, frames=49):
    """Register and examine a whole bubble test; print s of processor time and peak memory."""
    fields = seen(points, frames)
    begun = time.process_time()
    moved, found = register_fields(fields, Outline.circle(RADIUS))
    registered = time.process_time()
    expected = Expected({"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (1.0, 200.0)})
    doubts = doubts_of(View(moved, Outline.circle(RADIUS), 0.8, True), expected)
    looked = time.process_time()
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{len(fields[0].points)} points, {frames} frames, "
          f"warp at {found.warp_angle:.2f} degrees\n"
          f"registered in {registered - begun:.1f} s, looked at in {looked - registered:.1f} s\n"
          f"memory at most {memory:.0f} MiB; "
          f"doubts: {[d.name for d in doubts] or 'none'}")  # fmt: skip


def seen(points, frames):
    """Return an orthotropic sheet's possible shape, turned, tilted and shifted, with noise."""
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


def readers(points=37_000, frames=49, *formats):
    """Read one export of each of FORMATS as often as there are frames; s of processor time."""
    random = np.random.default_rng(1)
    r, angle = 100 * np.sqrt(random.random(points)), 2 * np.pi * random.random(points)
    places = np.stack([r * np.cos(angle), r * np.sin(angle), 0.02 * r], axis=1)
    rise = np.stack([0.05 * places[:, 0], 0.03 * places[:, 1], 30 + r], 1)
    frame = places, (1 - (r / 100) ** 2)[:, None] * rise
    print(f"{points} points, {frames} frames; s of processor time, MB of file, peak MB so far")
    plain = None
    for case in formats or EXPORTS:
        with tempfile.TemporaryDirectory() as folder:
            (file,) = EXPORTS[case][1](Path(folder), [frame])
            read_fields([file], [0.1])  # imports, which are not the reader's time
            start = time.process_time()
            kept = [read_fields([file], [0.1]) for _ in range(frames)]
            taken = time.process_time() - start
            size = file.stat().st_size / 1e6
        plain = plain or taken
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        assert len(kept[-1][0].points) == points
        print(f"{case:14} {taken:7.2f} s {taken / plain:6.2f} x plain {size:7.1f} MB "
              f"{peak:7.0f} MB")  # fmt: skip


if __name__ == "__main__":
    start_on(analysis, growth, registration, readers)
