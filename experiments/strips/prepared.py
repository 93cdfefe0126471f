"""Strip tests ready to be compared with their models, with measured data or proposed by a plan.

A plan proposes one direction at a time, like the first strips of the project, if it has any.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...inference.comparison import Comparison
from ...inference.nuisance import Nuisance, prior_weight
from ...meshes.strip_models import GRIP_DISTANCE, WIDTH, UniaxialModel
from ...readers.curves import DIRECTIONS, LoadCurve, cut_of
from ...readers.quantities import distance_to_strip
from ...solvers.base import Array
from ..base import Candidate, MakeSolver, Masks, Planning, Reach, Weighting
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from ..measured import PreparedParts
from . import StripsTest, reach_of
from .data import Strip
from .doubts import doubts_of_strips
from .load_objective import PLACES_OF_SPECIMEN, StripObjective, correlated_loads

WHOLE_LENGTH = 0.95  # of the grips' distance: gauges from here on are as long as the strip
NO_EXTENSOMETER = (
    "no extensometer is named by the elongations (column {columns}), and the gauge is as long as "
    "the strip: what machine and grips give is then a part of them, which strips alone cannot "
    "show, and moduli come out too low: give it as compliance (mm/N), or compliance_prior beside "
    "a bubble or a biaxial test"
)
MAX_PRIORS = 4.0  # standard deviations of its prior by which a compliance may be larger
OBJECTIVES = {
    "N": "sum of the strips' RMS errors, N",
    "relative": "sum of the strips' RMS errors over their largest load",
}


@dataclass(frozen=True, eq=False)
class PreparedStrips(PreparedParts):
    """A test of strips with its data."""

    test: StripsTest

    @property
    def objective_is(self) -> str:
        return OBJECTIVES[self.test.objective]

    @property
    def seen(self) -> Sequence[str]:
        """Return a note on elongations from grip to grip whose column does not say so.

        Travel that a column's name tells is doubted (`doubts_of_strips`).
        """
        test = self.test
        if test.compliance or test.compliance_prior is not None:
            return ()
        columns: dict[str, None] = {}
        for strip in test.matched.values():
            if strip.gauge_length >= WHOLE_LENGTH * test.grip_distance:
                columns |= dict.fromkeys(_columns_not_of_strip(strip))
        names = ", ".join(map(repr, columns))
        return (NO_EXTENSOMETER.format(columns=names),) if columns else ()

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return the specimen's index for each measured point that is matched, by comparison."""
        return {self.part(d): s.specimen_of.tolist() for d, s in self._matched_by_points.items()}

    @property
    def _matched_by_points(self) -> Mapping[str, Strip]:
        """Return the strips whose points (not polynomials) are matched, by direction."""
        return self.test.matched if self.test.match_by == "points" else {}

    def count(self, data: Strip) -> int:
        by_points = self.test.match_by == "points"
        return len(data.points[0]) if by_points else self.test.increments

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the masks that leave out each direction and each specimen, by kind and name.

        A kind with a single part is left out.
        """
        specimens: dict[str, Masks] = {
            f"{direction}, {specimen}": {**self.full_masks, self.part(direction): mask}
            for direction, strip in self._matched_by_points.items()
            for specimen, mask in _masks_without_specimens(strip).items()
        }
        return self.masks_without_each("directions") | (
            {"specimens": specimens} if specimens else {}
        )

    def reach(self, masks: Masks) -> Reach:
        """Return the largest strains of the points that `masks` keep."""
        return reach_of(self.test, {d: masks.get(self.part(d)) for d in self.test.matched})

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison for each direction that has a weight and points."""
        test = self.test
        models = self.test.models()
        share = weighting.weight
        directions = self.matched_parts(masks)
        total = sum(test.weights[direction] for direction in directions)
        if weighting.relative and directions:
            share /= total
        relative = weighting.relative or test.objective == "relative"
        objectives = {
            direction: self._objective(models[direction], direction, relative, share, masks or {})
            for direction in directions
        }
        return tuple(
            Comparison(
                self.part(direction),
                models[direction],
                make_solver(),
                objective,
                compliance_nuisance(test, objective),
                # Strips along the yarns are compared first: they are homogeneous and hardly ever
                # fail, while a bias strip can fail at its first increment.
                stage=1 if cut_of(direction) == "bias" else 0,
                contracts=True,
                # A law of logarithmic strain lets yarns slide beside each other where half the
                # stress along them is more than G12 (docs/reference/law.md): fabrics do not.
                must_be_stable=False,
                weight=len(directions) * test.weights[direction] / total,
            )
            for direction, objective in objectives.items()
        )

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return comparisons on coarse meshes with few increments, for virtual work.

        A strip is nearly homogeneous, so that these are enough.
        """
        test = replace(self.test, increments=min(self.test.increments, 20))
        coarser = replace(self, test=test)
        return coarser.finer(make_solver, Weighting(), factor=0.25)

    def _objective(
        self,
        model: UniaxialModel,
        direction: str,
        relative: bool,
        share: float,
        masks: Masks,
    ) -> StripObjective:
        """Return the objective of a direction; `share` is its weight before that of the section."""
        test = self.test
        strip = test.strips[direction]
        elongation, load = loads_to_match(test, strip, model)
        correlated_count = correlated_loads(strip, len(load), test.noise, test.specimen_count)
        specimens = strip.specimen_of if test.match_by == "points" else None
        mask = masks.get(self.part(direction))
        if mask is not None:
            elongation = elongation[mask]
            load = load[mask]
            specimens = None if specimens is None else specimens[mask]
        largest = float(np.abs(load).max(initial=0.0))
        if relative and not largest > 0:
            raise test.place.error(direction, "the measured load is zero")
        noise, noise_is = strip.noise(largest, test.noise)
        return StripObjective(
            model.elongations,
            elongation,
            load,
            unit_error=largest if relative else 1.0,
            weight=share * test.weights[direction],
            least_noise=noise,
            noise_is=noise_is,
            correlated_count=correlated_count,
            specimens=specimens,
        )

    def data_files(self) -> Sequence[DataFile]:
        test = self.test
        by_points = test.match_by == "points"
        files = [file for strip in test.matched.values() for file in strip.data_files(by_points)]
        return joined(files)

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        test = self.test
        thickness = test.place.fabric.thickness
        width = test.total_width
        by_points = test.match_by == "points"
        distance = test.grip_distance
        return doubts_of_strips(test.strips, width, thickness, expected, distance, by_points)


def _columns_not_of_strip(strip: Strip) -> list[str]:
    """Return the columns of elongation that name neither an extensometer nor the machine."""
    columns = [
        curve.source.columns.get("elongation", "")
        for curve in strip.curves
        if curve.source is not None and not curve.between_grips
    ]
    return [column for column in columns if column and distance_to_strip(column)]


def compliance_nuisance(test: StripsTest, objective: StripObjective) -> tuple[Nuisance, ...]:
    """Return the unknown compliance of machine and grips, where its deviation is given.

    All strips of the test have the same; `objective` gets its name.
    """
    prior = test.compliance_prior
    if prior is None:
        return ()
    name = f"compliance of {test.name}"
    objective.compliance = name, test.compliance
    return (
        Nuisance(
            name,
            0.0,
            test.compliance + MAX_PRIORS * prior,
            "mm/N",
            prior=prior,
            weight=prior_weight(
                objective.least_noise,
                objective.scale,
                correlated=objective.correlated_count,
            ),
            start=test.compliance,
            shared=True,
        ),
    )


def loads_to_match(test: StripsTest, strip: Strip, model: UniaxialModel) -> tuple[Array, Array]:
    """Return the elongations (n,) mm and loads (n,) N that a fit matches.

    These are the measured points, or the polynomial at the increments of the model.
    """
    if test.match_by == "points":
        return strip.points
    if strip.polynomial is None:
        raise test.place.error("data", "the load curves are not there")
    elongation = np.array(model.elongations)
    return elongation, strip.polynomial(elongation)


def _masks_without_specimens(strip: Strip) -> Mapping[str, NDArray[np.bool_]]:
    """Return the masks (points,) that leave out each specimen, by name; none for a single one."""
    specimen_of = strip.specimen_of
    numbers = np.unique(specimen_of).tolist()
    if len(numbers) < 2:
        return {}
    names = [strip.curves[number].specimen for number in numbers]
    if len(set(names)) < len(names):  # files may name theirs alike
        names = [str(number + 1) for number in numbers]
    return {
        f"specimen {name}": specimen_of != number
        for name, number in zip(names, numbers, strict=True)
    }


@dataclass(frozen=True)
class CandidateStrips:
    """Strips that a plan proposes."""

    angles: tuple[float, ...] = (30.0, 45.0, 60.0)  # degrees from pull to warp of bias strips
    gauge_length: float = 20.0  # mm, if the project has no strips
    increments: int = 20  # number of increments of the model and of loads of a curve
    specimens: int = 3
    scatter: float = 0.04  # of the largest load if unknown; published strips have 2, 6 and 4 %


CANDIDATES = CandidateStrips()


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return a candidate test for each direction, like the project's first strips or usual ones."""
    template = next((test for test in planning.present if isinstance(test, PreparedStrips)), None)
    angles = {*CANDIDATES.angles}
    if template is not None:
        angles.add(template.test.bias_angle)
    pulls = {"warp strip": ("warp", 45.0), "fill strip": ("fill", 45.0)}
    pulls |= {f"strip at {angle:g} degrees": ("bias", angle) for angle in sorted(angles)}
    return [
        Candidate(
            name,
            partial(
                _computed,
                name,
                direction,
                angle,
                template,
                planning,
            ),
            planning.noise_is(template),
            CANDIDATES.specimens,
        )
        for name, (direction, angle) in pulls.items()
    ]


def _computed(
    name: str,
    direction: str,
    angle: float,
    template: PreparedStrips | None,
    planning: Planning,
) -> PreparedStrips:
    """Return a strip test with the loads that the current law predicts, one for each increment.

    The strip has the final length of the project's strip, or else is pulled to the end of the law's
    range of strain. `angle` is in degrees, from the pull to the warp of a bias strip.
    """
    strip = _strip_like(template, direction, angle, planning)
    test = StripsTest(
        name=name,
        place=planning.place,
        weight=1.0,
        width=WIDTH if template is None else template.test.width,
        grip_distance=GRIP_DISTANCE if template is None else template.test.grip_distance,
        bias_angle=angle,
        increments=CANDIDATES.increments,
        strips={direction: strip},
        match_by="points",
        weights=dict.fromkeys(DIRECTIONS, 1.0),
        objective="N",
        side_by_side=1 if template is None else template.test.side_by_side,
    )
    (model,) = test.models().values()
    load = planning.make_solver().run(model, planning.law).load
    noise = _noise(direction, template, planning, len(load), float(np.abs(load).max()))
    curve = LoadCurve(direction, "computed", np.array(model.elongations), load, None)
    computed = replace(strip, curves=(curve,))
    return PreparedStrips(replace(test, strips={direction: computed}, noise=noise))


def _strip_like(
    template: PreparedStrips | None,
    direction: str,
    angle: float,
    planning: Planning,
) -> Strip:
    """Return a strip without data, with the lengths of the project's strip where it has one."""
    strip = None if template is None else template.test.strips.get(direction)
    gauge_length = CANDIDATES.gauge_length if strip is None else strip.gauge_length
    final_length = gauge_length * math.exp(_end_strain(direction, angle, planning))
    if template is not None and strip is not None:
        has_angle = direction != "bias" or angle == template.test.bias_angle
        final_length = strip.final_length if has_angle else final_length
    return Strip(direction, gauge_length, final_length)


def _end_strain(direction: str, angle: float, planning: Planning) -> float:
    """Return the logarithmic strain of the gauge at which the range of the law ends.

    A bias strip keeps its area: at strain e its shear is 2 sin(2 angle) e, and the strain of the
    yarn closer to the pull is cos(2 angle) e. The one that is first at the end of its range counts.
    """
    warp, fill, shear = planning.ends.tolist()
    if direction != "bias":
        return float(warp if direction == "warp" else fill)
    double_angle = math.radians(2 * angle)
    strain_of_yarn = math.cos(double_angle)
    by_shear = shear / (2 * math.sin(double_angle))
    if abs(strain_of_yarn) <= 1e-9:
        return float(by_shear)
    by_yarn = (warp if angle < 45 else fill) / abs(strain_of_yarn)
    return float(min(by_shear, by_yarn))


def _noise(
    direction: str,
    template: PreparedStrips | None,
    planning: Planning,
    values: int,
    largest: float,
) -> float:
    """Return the noise (N) that each of so many loads has if all their errors are independent.

    It is that of the project's strips of the same direction, or else of its other directions, or
    else a usual one. `values` is the number of loads, `largest` the largest load (N).
    """
    if planning.noise is not None:
        return planning.noise
    if template is None:
        return CANDIDATES.scatter * largest * math.sqrt(values / PLACES_OF_SPECIMEN)
    test = template.test
    by_direction = {
        matched: _noise_of_specimen(matched, template, planning, values) for matched in test.matched
    }
    if direction in by_direction:
        return by_direction[direction]
    models = test.models()
    relative = []
    for matched, noise in by_direction.items():
        _, load = loads_to_match(test, test.strips[matched], models[matched])
        relative.append(noise / float(np.abs(load).max()))
    return max(relative) * largest


def _noise_of_specimen(
    direction: str,
    template: PreparedStrips,
    planning: Planning,
    values: int,
) -> float:
    """Return the noise (N) that each of `values` independent loads of one specimen has."""
    test = template.test
    precision = planning.precision[template.part(direction)]
    specimens = len(test.strips[direction].curves) or test.specimen_count or 1
    if test.match_by == "points":
        precision = replace(precision, value_count=max(1, precision.value_count // specimens))
    else:  # one curve of all of them: one specimen says so much less
        precision = replace(precision, correlated_count=precision.correlated_count * specimens)
    return precision.for_values(values)
