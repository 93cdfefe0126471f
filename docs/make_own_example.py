"""Makes examples/own-data: a bubble, its pressure log and strips as a laboratory writes them.

Usage: python docs/make_own_example.py. The law below is known, the rest is what measuring does to
it: a sheet that is out of plane by 2 mm, more on one side; a camera that is turned by 9 degrees,
tilted by 3 and looks down from 640 mm; 0.02 mm of noise and 2 % of rejected points; a log with
another clock (12.7 s ahead), in bar and with decimal commas; strips of three specimens that differ
by 1 %, pulled until they break.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver
from scipy.interpolate import CloughTocher2DInterpolator
from scipy.spatial.transform import Rotation

DATA = Path(__file__).resolve().parent.parent / "examples" / "own-data" / "data"
THICKNESS = 0.83  # mm
#: MPa: E1 = 640 - 1800 eps1, E2 = 220 + 600 eps2, G12 = 18 - 20 gamma12.
LAW = HypoelasticLaw(
    np.array([0, 0, -20.0, 18.0, 0, 0, 600.0, 220.0, 0, 0, -1800.0, 640.0]), 0.24, np.full(3, 0.2)
)
RADIUS, SPACING, NOISE, REJECTED = 100.0, 7.5, 0.02, 0.02  # mm, mm, mm, share of the points
TURN = Rotation.from_euler("zx", [9.0, 3.0], degrees=True).as_matrix()
SHIFT = np.array([6.0, -3.0, 640.0])
#: Pressures of the frames, kPa, 5 s apart; 12.7 s later by the log's clock. Two pictures are of the
#: sheet at rest; the last is of the release.
FRAMES = (0, 0, 12, 33, 58, 84, 109, 136, 161, 188, 214, 241, 266, 290, 90)
INTERVAL, OFFSET = 5.0, 12.7
#: Of the strips, mm: width, length between the grips, gauge length, largest elongation of it.
WIDTH, GRIPS, GAUGE = 50.0, 200.0, 100.0
ENDS = {"warp": 9.0, "fill": 14.0, "bias45": 22.0}


def sag(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the height (mm) of the sheet before the test."""
    share = (x**2 + y**2) / RADIUS**2
    return np.where(share < 1, 2.0 * (1 - share) * (1 + 0.4 * x / RADIUS), 0.0)


def write_frames(random: np.random.Generator) -> None:
    """Write a file for each frame, as VIC-3D exports it, and the times of the pictures."""
    mesh = elliptic_disk_mesh(Outline.circle(RADIUS), 1800, "full", "blocks")
    points = mesh.points.copy()
    points[:, 2] = sag(points[:, 0], points[:, 1])
    pressures = [1e-3 * kpa for kpa in sorted({*FRAMES} - {0})]
    steps = sorted({*pressures, 0.001, 0.003, 0.006, 0.009, 0.02, 0.026})
    model = BubbleModel(replace(mesh, points=points), THICKNESS, pressures, steps)
    history = MembraneSolver().run(model, LAW)
    x, y = (a.ravel() for a in np.meshgrid(*[np.arange(-111, 112, SPACING)] * 2))
    is_on_sheet = np.hypot(x, y) < 112
    x, y = x[is_on_sheet], y[is_on_sheet]
    folder = DATA / "bubble"
    folder.mkdir(parents=True, exist_ok=True)
    states = np.concatenate([np.zeros((1, len(points), 3)), history.displacement])
    levels = [0.0, *pressures]
    for number, kpa in enumerate(FRAMES):
        displacement = states[int(np.argmin(np.abs(np.array(levels) - 1e-3 * kpa)))]
        field = CloughTocher2DInterpolator(points[:, :2], displacement)(x, y)
        measured = np.nan_to_num(field) + random.normal(0.0, NOISE, field.shape)
        positions = np.column_stack([x, y, sag(x, y) + random.normal(0.0, NOISE, len(x))])
        sigma = np.where(random.random(len(x)) < REJECTED, -1.0, 0.004)
        table = np.column_stack([positions @ TURN.T + SHIFT, measured @ TURN.T, sigma])
        table[sigma < 0, :6] = 0.0
        names = ", ".join(f'"{q} [mm]"' for q in "XYZUVW") + ', "sigma [pixel]"'
        path = folder / f"Bubble-{5 * number + 3:04d}_0.csv"
        np.savetxt(path, table, "%.3f", ", ", header=names, comments="")
    times = [f"{INTERVAL * number:.3f}" for number in range(len(FRAMES))]
    (DATA / "camera.csv").write_text("\n".join(["Time_0 [s]", *times]) + "\n")


def write_log(random: np.random.Generator) -> None:
    """Write the log of the pressure sensor, twice a second by its own clock, in bar."""
    frame_times = OFFSET + INTERVAL * np.arange(len(FRAMES))
    times = np.arange(0.0, frame_times[-1] + 4.0, 0.5)
    # The valve is opened for two seconds after each picture, then the pressure is held.
    opened = np.column_stack([frame_times[:-1] + 0.7, frame_times[:-1] + 2.7]).ravel()
    kpa = np.interp(times, [0.0, *opened], [0.0, *np.repeat(FRAMES, 2)[1:-1]])
    kpa = np.where(times > frame_times[-1], FRAMES[-1] * np.exp(frame_times[-1] - times), kpa)
    bar = kpa / 100 + random.normal(0.0, 0.0015, len(times))
    rows = [f"{t:.1f};{p:.4f}".replace(".", ",") for t, p in zip(times, bar, strict=True)]
    lines = ["Druckaufnehmer P17, Bubble 1", "", "Zeit [s];Druck [bar]", *rows]
    (DATA / "pressure.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_strips(random: np.random.Generator) -> None:
    """Write three specimens of each direction, until they break, as a testing machine does."""
    folder = DATA / "strips"
    folder.mkdir(parents=True, exist_ok=True)
    solver = MembraneSolver()
    for name, end in ENDS.items():
        lengths = GAUGE, GAUGE + end, THICKNESS, WIDTH
        if name == "bias45":
            model = bias_strip(*lengths, GRIPS, 45.0, 200)
        else:
            model = straight_strip("warp" if name == "warp" else "fill", *lengths, 200)
        load = solver.run(model, LAW).load
        curve = np.array([0.0, *model.elongations]), np.array([0.0, *load])
        for number in (1, 2, 3):
            path = folder / f"{name}_{number}.csv"
            path.write_text(specimen(*curve, name, random), encoding="utf-8")


def specimen(
    elongation: np.ndarray, load: np.ndarray, name: str, random: np.random.Generator
) -> str:
    """Return the export of one specimen: 0.4 mm a second, 5 readings a second, then the break."""
    stiffness, strength = random.normal(1.0, 0.01), random.uniform(0.93, 0.99)
    times = np.arange(0.0, strength * elongation[-1] / 0.4, 0.2)
    measured = 0.4 * times + random.normal(0.0, 0.003, len(times))
    forces = stiffness * np.interp(0.4 * times, elongation, load)
    forces += random.normal(0.0, 1.5, len(times))
    times = np.append(times, times[-1] + [0.2, 0.4])
    measured = np.append(measured, measured[-1] + [1.9, 2.3])
    forces = np.append(forces, forces[-1] * np.array([0.11, 0.02]))
    words = {"warp": "Kette", "fill": "Schuss", "bias45": "45 Grad"}[name]
    head = f"""Prüfvorschrift;DIN EN ISO 1421
Material;PVC-Polyester, {words}
Probenbreite b0;{WIDTH:g};mm
Einspannlänge;{GRIPS:g};mm
Messlänge;{GAUGE:g};mm

Prüfzeit;Feindehnung;Standardkraft
s;mm;N
"""
    rows = zip(times, measured, forces, strict=True)
    return head + "".join(f"{t:.1f};{u:.4f};{f:.2f}\n".replace(".", ",") for t, u, f in rows)


def main() -> None:
    random = np.random.default_rng(2026)
    write_frames(random)
    write_log(random)
    write_strips(random)


if __name__ == "__main__":
    main()
