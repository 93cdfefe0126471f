"""What one bending run says in numbers: stiffness, buckling, strain on inflation, pressure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...data.bending import BendingCurve
from ...data.bending_scatter import BendingError, model_error
from ...meshes.mesh import Mesh
from ...meshes.strain import surface_strain
from ...models.cylinder import CylinderModel
from .record import BendingRun

Array = NDArray[np.float64]

#: The initial stiffness is that of a straight line through at least so many frames.
FEWEST = 3
#: The knee: where the slope has fallen to this part of the initial stiffness.
KNEE = 0.5
#: Places in each such stretch at which the slope is looked at.
STEPS = 20
#: A limit point: the load falls by more than this part of it afterwards.
FALL = 0.005
#: Wrinkled beyond the inflated state: share of the surface. The bodies press up to 0.8 % together
#: where they touch, from the first millimetres on, long before the beam wrinkles beside the collar.
ONSET = 0.01
#: The curve is compared with a straight line up to this part of the load at the knee.
STRAIGHT = 0.5

Point = tuple[float, float]  # deflection in mm and load in N


@dataclass(frozen=True)
class BendingMeasures:
    """Numbers of one run that ended; None where the run does not tell.

    Parameters
    ----------
    stiffness : N/mm, initial.
    loads : N by the name of the place where it is read.
    knee, limit, wrinkles : (deflection, load) where the slope has halved, of the largest load
        before the load falls, and where wrinkles appear.
    straightness : R^2 of a straight line before buckling, and its largest deviation over the
        load there.
    body_strain : (eps1, eps2) largest on inflation in the body, away from seam and caps;
        anywhere_strain : on the tube with seam, its edges and ends.
    pressure_rise : kPa from inflated to the last frame.
    reached : mm. error : against what was measured.
    """

    stiffness: float | None
    loads: Mapping[str, float | None]
    knee: Point | None
    limit: Point | None
    wrinkles: Point | None
    straightness: tuple[float, float] | None
    body_strain: tuple[float, float]
    anywhere_strain: tuple[float, float]
    pressure_rise: float
    reached: float
    error: BendingError | None

    @property
    def buckling(self) -> Point | None:
        """The limit point, else the knee."""
        return self.limit or self.knee

    @property
    def buckling_is(self) -> str:
        """What the buckling load is: "limit point", "knee", or "none"."""
        return "limit point" if self.limit else "knee" if self.knee else "none"


def bending_measures(
    model: CylinderModel, run: BendingRun, measured: Sequence[BendingCurve]
) -> BendingMeasures:
    """The numbers of a run of a model, beside what was measured."""
    d, load, over = run.deflection, run.load, model.reading.slope_over
    stiffness = initial_stiffness(d, load, over)
    knee = knee_point(d, load, stiffness, over)
    body, anywhere = inflation_strain(model.mesh, run.inflated)
    return BendingMeasures(
        stiffness,
        loads_at(d, load, model.reading.places),
        knee,
        limit_point(d, load),
        wrinkle_onset(run),
        straightness(d, load, knee[1] if knee else float(load.max())),
        body,
        anywhere,
        1e3 * float(run.pressure[-1] - run.pressure[0]),
        float(d[-1]),
        model_error(measured, d, load),
    )


def loads_at(d: Array, load: Array, places: Mapping[str, float]) -> dict[str, float | None]:
    """Load (N) at places (mm) by name; None at those that the run did not reach."""
    end = d[-1] * (1 + 1e-9)
    return {n: float(np.interp(p, d, load)) if p <= end else None for n, p in places.items()}


def initial_stiffness(d: Array, load: Array, over: float) -> float | None:
    """Slope (N/mm) of the straight line through the frames up to `over` mm."""
    count = max(int((d <= over * (1 + 1e-9)).sum()), FEWEST)
    if len(d) < 2:
        return None
    return float(np.polyfit(d[:count], load[:count], 1)[0])


def knee_point(d: Array, load: Array, stiffness: float | None, over: float) -> Point | None:
    """Where the slope over `over` mm first is `KNEE` of the initial stiffness."""
    half = 0.5 * over
    if stiffness is None or not stiffness > 0 or d[-1] < 2 * over:
        return None
    at = np.linspace(half, d[-1] - half, max(2, round(STEPS * (d[-1] / over - 1)) + 1))
    slope = (np.interp(at + half, d, load) - np.interp(at - half, d, load)) / over
    below = np.flatnonzero(slope <= KNEE * stiffness)
    if not len(below):
        return None
    i = int(below[0])
    place = float(at[i])
    if i:  # between the two places where it is above and below
        share = (slope[i - 1] - KNEE * stiffness) / (slope[i - 1] - slope[i])
        place = float(at[i - 1] + share * (at[i] - at[i - 1]))
    return place, float(np.interp(place, d, load))


def limit_point(d: Array, load: Array) -> Point | None:
    """The largest load, where the load falls afterwards."""
    top = int(np.argmax(load))
    if not load[top:].min() < (1 - FALL) * load[top]:
        return None
    return float(d[top]), float(load[top])


def wrinkle_onset(run: BendingRun) -> Point | None:
    """The first frame in which more of the surface is wrinkled than when inflated."""
    if not len(run.wrinkled):
        return None
    more = np.flatnonzero(run.wrinkled > run.wrinkled[0] + ONSET)
    return (float(run.deflection[more[0]]), float(run.load[more[0]])) if len(more) else None


def straightness(d: Array, load: Array, buckling: float) -> tuple[float, float] | None:
    """R^2 of a straight line up to `STRAIGHT` of the buckling load, and how far the curve is off.

    The deviation is the largest, over the load where the part ends.
    """
    beyond = np.flatnonzero(load > STRAIGHT * buckling)
    count = int(beyond[0]) if len(beyond) else len(d)
    if count < FEWEST + 1:
        return None
    x, y = d[:count], load[:count]
    off = y - np.polyval(np.polyfit(x, y, 1), x)
    total = float(((y - y.mean()) ** 2).sum())
    if not total > 0:
        return None
    return 1.0 - float((off**2).sum()) / total, float(np.abs(off).max() / y[-1])


def inflation_strain(mesh: Mesh, inflated: Array) -> tuple[Point, Point]:
    """Largest (eps1, eps2) in the middle of the quads of the inflated tube.

    First of the body without the quads that touch seam or caps, which the thick seam and the caps
    bend; then of the whole tube with its seam.
    """
    strain = surface_strain(mesh, inflated)[:, :2]
    others = np.zeros(len(mesh.points), dtype=bool)
    for name in ("seam", "caps"):
        if name in mesh.element_sets:
            others[mesh.quads[mesh.element_sets[name]]] = True
    body = mesh.element_sets["body"]
    free = body[~others[mesh.quads[body]].any(axis=1)]
    tube = np.concatenate([body, mesh.element_sets.get("seam", body[:0])])

    def largest(quads: NDArray[np.intp]) -> Point:
        found = strain[quads].max(axis=0)
        return float(found[0]), float(found[1])

    return largest(free if len(free) else body), largest(tube)
