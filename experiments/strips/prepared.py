"""Strips in a fit: residuals (Eqs 3.4-3.6), comparisons, independent loads; strips to make next.

Specimens differ as a whole: one is stiffer along all of its curve. A hundred loads of it are not a
hundred measurements: five specimens reduce an uncertainty by the root of five, whatever the number
of readings."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...inference.comparison import Comparison, NoiseIs
from ...inference.correlation import CorrelogramSettings, correlated_count
from ...meshes.strip_models import GRIP_DISTANCE, WIDTH, UniaxialModel
from ...readers.curves import DIRECTIONS, LoadCurve
from ...solvers.base import Array, History
from ..base import MakeSolver, Masks, Reach, Weighting
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from ..measured import PreparedParts
from ..planning import Candidate, Planning
from .data import Strip, doubts_of_strips
from .test import StripsTest, reach_of


class LoadObjective:
    """Residuals (model - measured) / (scale sqrt(n)) at n elongations of the gauge.
    increments : (frames,) mm of the model; its load is interpolated by a cubic spline from the
    origin. elongation, load : (n,) mm, N, measured. scale : N: 1 for errors in N (Eq. 3.7), the
    largest load for relative errors. least_noise, noise_is : N, and its origin. correlated_count :
    number of loads that err as one, at least. specimens : (n,) number of each load's specimen."""

    unit, columns = "N", 1

    def __init__(
        self,
        increments: ArrayLike,
        elongation: ArrayLike,
        load: ArrayLike,
        scale: float = 1.0,
        weight: float = 1.0,
        least_noise: float = 0.0,
        noise_is: NoiseIs = "assumed",
        correlated_count: float = 1.0,
        specimens: ArrayLike | None = None,
    ) -> None:
        knots = np.concatenate([[0.0], np.asarray(increments, float)])
        self.elongation = np.asarray(elongation, float)
        self.measured = np.asarray(load, float)
        # Interpolation is linear in the loads; the first knot is the unloaded strip.
        curve = scipy.interpolate.CubicSpline(knots, np.eye(len(knots)))
        self.sample = curve(self.elongation)[:, 1:]
        self.steep = curve(self.elongation, 1)[:, 1:]
        self.sizes = (len(self.measured),)
        self.least_noise = least_noise
        self.noise_is = noise_is
        self.specimens = None if specimens is None else np.asarray(specimens)
        self.correlated_count = min(max(correlated_count, 1.0), float(len(self.measured)))
        self.scale = np.full(len(self.measured), scale * np.sqrt(len(self.measured)) / weight)

    @property
    def data(self) -> tuple[Array, ...]:
        return self.elongation, self.measured

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the elongation of every reading, (n, 1) mm: neighbours may err as one."""
        return (self.elongation[:, None],)

    def of_points(self, values: Array) -> Array:
        return values

    def shifted(self, external: History, surrogate: History) -> LoadObjective:
        objective = copy.copy(self)
        objective.measured = self.measured - self.sample @ (external.load - surrogate.load)
        return objective

    def modelled(self, history: History) -> Array:
        """Return the model's load at the measured elongations, (n,) N."""
        return np.asarray(self.sample @ history.load)

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        return np.asarray((self.modelled(history) - self.measured) / self.scale)

    def jacobian(self, history: History, slope: Array) -> Array:
        assert history.load_slope is not None
        return np.asarray(self.sample @ history.load_slope / self.scale[:, None])

    def causes(self, history: History) -> dict[str, Array]:
        """Return causes of a misfit by their words, none known of loads in general."""
        return {}

    def rms(self, history: History) -> float:
        """Return RMS error in N (Eqs 3.4-3.6), whatever the scale and the weight."""
        return float(np.sqrt(np.mean((self.modelled(history) - self.measured) ** 2)))


class StripObjective(LoadObjective):
    """Residuals of a strip's loads, with what may be wrong in such a test."""

    def causes(self, history: History) -> dict[str, Array]:
        """Return (n, 1) a cause, by its words, the slope of the residual by one unit of it."""
        slope = self.steep @ history.load / self.scale
        return {
            "loads off by {:+.2g} N (zero the load cell, name the preload)": (1.0 / self.scale)[
                :, None
            ],
            "elongations off by {:+.2g} mm (count them from the preload)": -slope[:, None],
            "a gauge length off by {:+.1%} (measure it)": (slope * self.elongation)[:, None],
        }


#: Independent places along the curve of a specimen, where there are no two to compare: those of
#: the published strips have 1.6, 1.2 and 1.1.
PLACES = 1.25
#: Specimens behind a polynomial where the number is unknown: as many as ISO 1421 asks for.
SPECIMENS = 5
#: Along the whole curve of a specimen, in few bins: it may have ten loads.
CURVE_CORRELOGRAM = CorrelogramSettings(max_distance=1.0 + 1e-9, bins=8)


def loads_alike(
    strip: Strip, loads: int, noise: float | None, specimens: int | None = None
) -> float:
    """Return the number of loads of a direction that err as one.
    noise : N, that the project gives of one load."""
    if noise is not None and specimens is None and len(np.unique(strip.specimen_of)) < 2:
        return 1.0
    return max(1.0, loads / independent_loads(strip, specimens))


@lru_cache(maxsize=64)
def independent_loads(strip: Strip, specimens: int | None = None) -> float:
    """Return the number of independent loads of all specimens of a direction together.
    Of two or more specimens: places a specimen that do not err as one, by the correlation along it
    of what it lies beside the polynomial of all, or by the factor by which it is stiffer, whichever
    are fewer; times the specimens less one. Else `PLACES` a specimen, likewise, with `specimens`,
    one, or `SPECIMENS` behind a polynomial."""
    numbers = np.unique(strip.specimen_of).tolist()
    if len(numbers) < 2 or strip.polynomial is None:
        behind = specimens or (1 if strip.curves else SPECIMENS)
        return PLACES * max(1, behind - 1)
    elongation, load = strip.points
    mean = strip.polynomial(elongation)
    rows = [np.flatnonzero(strip.specimen_of == number) for number in numbers]
    blocks = [load[own] - mean[own] for own in rows]
    square = float(np.mean(np.concatenate(blocks) ** 2))
    if not square > 0:
        return float(len(numbers) - 1)
    places = [elongation[own][:, None] for own in rows]
    along = correlated_count(blocks, places, CURVE_CORRELOGRAM)
    # What a specimen that is stiffer by a factor leaves, which no distance tells.
    by_factor = [
        float(block @ mean[own]) ** 2 / max(float(mean[own] @ mean[own]), 1e-300)
        for block, own in zip(blocks, rows, strict=True)
    ]
    together = max(along, float(np.mean(by_factor)) / square)
    each = float(np.mean([len(block) for block in blocks])) / together
    return (len(numbers) - 1) * max(1.0, each)


OBJECTIVES = {
    "N": "sum of the strips' RMS errors, N",
    "relative": "sum of the strips' RMS errors over their largest load",
}
#: Increments of an estimate, and edges of the usual quads over its quads' edges.
FEW, COARSER = 20, 0.25
#: Strips along the yarns lead in: they are homogeneous and hardly ever fail; a bias strip can at
#: its first increment.
STRAIGHT, BIAS = 0, 1


@dataclass(frozen=True, eq=False)
class PreparedStrips(PreparedParts):
    """A test of strips with its data."""

    test: StripsTest

    @property
    def objective_is(self) -> str:
        return OBJECTIVES[self.test.objective]

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return number of the specimen of each measured point that is matched, by comparison."""
        matched = self.test.matched if self.test.match_by == "points" else {}
        return {self.part(d): strip.specimen_of.tolist() for d, strip in matched.items()}

    def count(self, data: Strip) -> int:
        by_points = self.test.match_by == "points"
        return len(data.points[0]) if by_points else self.test.increments

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return masks without each part, by sort and name; sorts of one part are left out."""
        matched = self.test.matched if self.test.match_by == "points" else {}
        specimens: dict[str, Masks] = {
            f"{d}, {which}": {**self.whole, self.part(d): mask}
            for d, strip in matched.items()
            for which, mask in _without(strip).items()
        }
        return self.without_each("directions") | ({"specimens": specimens} if specimens else {})

    def reach(self, masks: Masks) -> Reach:
        """Return the reach of the law in the points matched."""
        return reach_of(self.test, {d: masks.get(self.part(d)) for d in self.test.matched})

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison a direction that has weight and points."""
        test = self.test
        models = self.test.models()
        share = weighting.weight
        kept = self.kept(masks)
        if weighting.relative and kept:
            share /= sum(test.weights[d] for d in kept)
        relative = weighting.relative or test.objective == "relative"
        return tuple(
            Comparison(
                self.part(direction),
                models[direction],
                make_solver(),
                self._objective(models[direction], direction, relative, share, masks or {}),
                stage=BIAS if direction == "bias" else STRAIGHT,
                contracts=True,
                # A law of logarithmic strain lets yarns slide beside each other where half the
                # stress along them is more than G12 (docs/reference/law.md): fabrics do not.
                must_be_stable=False,
            )
            for direction in kept
        )

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return comparisons with few quads and increments: a strip is nearly homogeneous."""
        few = replace(self.test, increments=min(self.test.increments, FEW))
        return replace(self, test=few).finer(make_solver, Weighting(), COARSER)

    def _objective(
        self, model: UniaxialModel, direction: str, relative: bool, share: float, masks: Masks
    ) -> StripObjective:
        test = self.test
        strip = self.test.strips[direction]
        elongation, load = loads_to_match(test, strip, model)
        alike = loads_alike(strip, len(load), test.noise, test.specimens)
        owners = strip.specimen_of if test.match_by == "points" else None
        mask = masks.get(self.part(direction))
        if mask is not None:
            elongation = elongation[mask]
            load = load[mask]
            owners = None if owners is None else owners[mask]
        largest = float(np.abs(load).max(initial=0.0))
        if relative and not largest > 0:
            raise test.place.error(direction, "the measured load is zero")
        scale = largest if relative else 1.0
        weight = share * test.weights[direction]
        noise = strip.noise(largest, test.noise)
        return StripObjective(
            model.elongations, elongation, load, scale, weight, *noise, alike, owners
        )

    def data_files(self) -> Sequence[DataFile]:
        test = self.test
        points = self.test.match_by == "points"
        every = [file for own in test.matched.values() for file in own.data_files(points)]
        return joined(every)

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        test = self.test
        sizes = test.width, test.place.fabric.thickness
        return doubts_of_strips(test.strips, *sizes, expected, test.grip_distance)


def loads_to_match(test: StripsTest, strip: Strip, model: UniaxialModel) -> tuple[Array, Array]:
    """Return elongation (n,) mm and load (n,) N: points, or the polynomial at increments."""
    if test.match_by == "points":
        return strip.points
    if strip.polynomial is None:
        raise test.place.error("data", "the load curves are not there")
    elongation = np.array(model.elongations)
    return elongation, strip.polynomial(elongation)


def _without(strip: Strip) -> Mapping[str, NDArray[np.bool_]]:
    """Return masks without each specimen, by its name; none of a strip of one specimen."""
    owners = strip.specimen_of
    numbers = np.unique(owners).tolist()
    names = [strip.curves[number].specimen for number in numbers]
    if len(set(names)) < len(names):  # files may name theirs alike
        names = [str(number + 1) for number in numbers]
    masks = {f"specimen {name}": owners != n for name, n in zip(names, numbers, strict=True)}
    return masks if len(masks) > 1 else {}


#: Degrees from the pull to the warp yarn, of strips across the yarns.
ANGLES = (30.0, 45.0, 60.0)
#: Where the project has no strips: mm of the gauge, increments and values of a curve, specimens.
GAUGE, INCREMENTS, USUAL = 20.0, 20, 3
#: Of the largest load: scatter of specimens where none is known. That of the published strips is
#: 2, 6 and 4 % (examples/uniaxial-valmex7318/curves.csv).
SCATTER = 0.04


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return each direction by itself, after the project's first strips or usual ones."""
    own = [test for test in planning.present if isinstance(test, PreparedStrips)]
    template = own[0] if own else None
    angles = sorted({*ANGLES, *([template.test.bias_angle] if template else [])})
    pulls = {"warp strip": ("warp", 45.0), "fill strip": ("fill", 45.0)}
    pulls |= {f"strip at {angle:g} degrees": ("bias", angle) for angle in angles}
    noise_is = "assumed" if template is None else f"that of {template.test.name}"
    noise_is = noise_is if planning.noise is None else "given"
    return [
        Candidate(name, partial(_made, name, *pull, template, planning), noise_is, USUAL)
        for name, pull in pulls.items()
    ]


def _made(
    name: str, direction: str, angle: float, template: PreparedStrips | None, planning: Planning
) -> PreparedStrips:
    """Return the strip with the loads that the law gives, one value an increment.
    It is as long as the project's own, else pulled up to the end of the known law. angle : degrees
    from the pull to the warp of a strip across the yarns."""
    own = None if template is None else template.test
    strip = None if own is None else own.strips.get(direction)
    gauge = GAUGE if strip is None else strip.gauge_length
    final = gauge * math.exp(_strain(direction, angle, planning))
    if own is not None and strip is not None:
        alike = direction != "bias" or angle == own.bias_angle
        final = strip.final_length if alike else final
    strip = Strip(direction, gauge, final)
    width, grips = (WIDTH, GRIP_DISTANCE) if own is None else (own.width, own.grip_distance)
    test = StripsTest(
        name=name,
        place=planning.place,
        weight=1.0,
        width=width,
        grip_distance=grips,
        bias_angle=angle,
        increments=INCREMENTS,
        strips={direction: strip},
        match_by="points",
        weights=dict.fromkeys(DIRECTIONS, 1.0),
        objective="N",
    )
    (model,) = test.models().values()
    load = np.asarray(planning.make_solver().run(model, planning.law).load)
    noise = _noise(direction, template, planning, len(load), float(np.abs(load).max()))
    curve = LoadCurve(direction, "computed", np.array(model.elongations), load, None)
    done = replace(strip, curves=(curve,))
    return PreparedStrips(replace(test, strips={direction: done}, noise=noise))


def _strain(direction: str, angle: float, planning: Planning) -> float:
    """Return the logarithmic strain of the gauge where a yarn, or the shear, is at its end.
    A strip across the yarns keeps its area: shear 2 sin(2 angle) e, the nearer yarn cos(2 angle) e.
    """
    warp, fill, shear = planning.ends.tolist()
    if direction != "bias":
        return float(warp if direction == "warp" else fill)
    turn = math.radians(2 * angle)
    along = math.cos(turn)
    end = warp if angle < 45 else fill
    most = shear / (2 * math.sin(turn))
    return float(min(most, end / abs(along))) if abs(along) > 1e-9 else float(most)


def _noise(
    direction: str, template: PreparedStrips | None, planning: Planning, values: int, largest: float
) -> float:
    """Return the noise (N) of independent loads: of the own direction, the others, or usual."""
    if planning.noise is not None:
        return planning.noise
    if template is None:
        return SCATTER * largest * math.sqrt(values / PLACES)
    test = template.test
    own = {}
    for d in test.matched:  # the precision of one specimen
        known = planning.precision[template.part(d)]
        specimens = len(test.strips[d].curves) or test.specimens or 1
        if test.match_by != "points":  # one curve of all of them: one says so much less
            known = replace(known, alike=known.alike * specimens)
        else:
            known = replace(known, values=max(1, known.values // specimens))
        own[d] = known.at(values)
    if direction in own:
        return own[direction]
    models = test.models()
    loads = {d: loads_to_match(test, test.strips[d], models[d])[1] for d in own}
    return max(noise / float(np.abs(loads[d]).max()) for d, noise in own.items()) * largest
