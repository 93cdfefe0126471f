"""Compare a strip test with its models in a fit: parts, comparisons, doubts and data files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...inference.comparison import Comparison
from ...inference.nuisance import Nuisance, prior_weight
from ...meshes.strip_models import UniaxialModel
from ...readers.curves import cut_of
from ...readers.quantities import distance_to_strip
from ...solvers.base import Array
from ..base import MakeSolver, Masks, Reach, Weighting
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from ..measured import PreparedParts
from .data import Strip
from .doubts import doubts_of_strips
from .load_objective import StripObjective, correlated_loads
from .test import StripsTest, reach_of

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
        if weighting.relative and directions:
            share /= sum(test.weights[direction] for direction in directions)
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
        return doubts_of_strips(test.strips, width, thickness, expected, test.grip_distance)


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
