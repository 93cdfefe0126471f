"""Biaxial tests ready to be compared with their model, with measured data or proposed by a plan.

Doubts are about units, ratios, moduli and swapped yarns. A plan proposes one load ratio at a time.
"""

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...inference.comparison import Comparison, ErrorColumns
from ...inference.nuisance import Nuisance, prior_weight
from ...materials.biaxial_patch import biaxial_response, largest_load
from ...materials.designers import RATIOS, shares
from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import elongations
from ...readers.frames import FrameSource
from ...readers.machine_tables import BiaxialTable
from ...solvers.base import Array, History
from ..base import Candidate, MakeSolver, Masks, Planning, Precision, Reach, Weighting
from ..data_files import DataFile
from ..doubts import Doubt, Expected
from ..measured import PERCENT, USUAL_NOISE, PreparedParts, StrainObjective
from . import BiaxialSection, BiaxialTest, TablesSection, reach_of
from .paths import BiaxialPath, LoadCycle, nearest_ratio

NO_SHARE = (
    "all of the measured load is taken to reach the field where strains are measured; arms and "
    "corners carry a part of it, also with slits: give what is known of it as load_share (0.85), "
    "with load_share_deviation"
)


class PathObjective(StrainObjective):
    """Residuals of the strains of one path: those along warp, then those along fill.

    Strains count from the first row of the path, which has no residual.
    """

    # Strains count from the first row, so that it matches for any law.
    first_row = 1
    quantities = ("warp strain", "fill strain")
    #: Nuisance parameter of the share of the loads that reaches the field, and its start.
    load_share: tuple[str, float] | None = None
    #: Relative change of the loads by that share.
    load_change = 0.0

    def at(self, nuisance: Mapping[str, float]) -> Self:
        if self.load_share is None or self.load_share[0] not in nuisance:
            return self
        name, start = self.load_share
        objective = copy.copy(self)
        objective.load_change = nuisance[name] / start - 1.0
        return objective

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        return StrainObjective.residual(self.at(nuisance or {}), history)

    def nuisance_columns(
        self, names: Sequence[str], nuisance: Mapping[str, float], history: History
    ) -> Array:
        assert self.load_share is not None
        return self.in_blocks(self._slopes_by_load())[:, None] / self.load_share[1]

    def _slopes_by_load(self) -> Array:
        """Return the derivatives (n, 2) of model less data by a relative change of the loads.

        The strain at the stated load is then smaller by the slope of the measured curve.
        """
        larger = self.load.max(axis=1) / self.load.max()
        powers = np.arange(min(5, len(larger)))
        curves = np.linalg.lstsq(larger[:, None] ** powers, self.strain, rcond=None)[0]
        slopes = (powers * larger[:, None] ** powers) @ curves
        return slopes - slopes[0]

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the larger load (n, 1) N/mm of each residual along warp, then along fill.

        Errors at neighbouring loads are correlated.
        """
        return (self.load[1:].max(axis=1, keepdims=True),) * 2

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, 2) since the beginning of the path."""
        strains = elongations(history.displacement)
        return strains - strains[0] + self.load_change * self._slopes_by_load()

    def jacobian(self, history: History, slope: Array) -> Array:
        slopes = elongations(slope)
        return self.in_blocks(slopes - slopes[0])

    def spread_over_residuals(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values (n,) of the rows of the path repeated for each residual."""
        return np.tile(values[1:], 2)


@dataclass(frozen=True, eq=False)
class PreparedBiaxial(PreparedParts):
    """A biaxial test with its data."""

    test: BiaxialTest
    objective_is = "sum of the ratios' RMS errors of strain, warp and fill, over their largest"

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the masks that leave out each ratio, where there are several."""
        return self.masks_without_each("ratios")

    def reach(self, masks: Masks) -> Reach:
        """Return the largest strains of the ratios that `masks` keep."""
        return reach_of(self.matched_parts(masks).values())

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison of measured and modelled strains for each ratio that `masks` keep."""
        test = self.test
        models = self.test.models()
        fitted_paths = self.matched_parts(masks)
        comparisons = []
        weight = weighting.of_block(2 * len(fitted_paths))
        for path in fitted_paths.values():
            largest = float(np.abs(path.strain_change).max())
            if not largest > 0:
                raise test.place.error("data", f"the strains of ratio {path.ratio} are all zero")
            objective = PathObjective(path.load, path.strain_change, largest, weight, test.noise)
            parts = self.part(path.ratio), models[path.ratio], make_solver(), objective
            nuisance = load_share_nuisance(test, objective)
            comparisons.append(
                Comparison(*parts, nuisance, contracts=True, shared_errors=first_row_errors)
            )
        return tuple(comparisons)

    @property
    def seen(self) -> Sequence[str]:
        return () if self.test.section.load_share is not None else (NO_SHARE,)

    def data_files(self) -> Sequence[DataFile]:
        used_rows_of = {id(table): 0 for table in self.test.tables}
        for path in self.test.paths:
            used_rows_of[id(path.table)] += len(path.load)
        files = []
        for table in self.test.tables:
            used_rows = used_rows_of[id(table)]
            loading_rows = count_loading_rows(self.test.paths, table)
            thinned = f"thinned to at most {self.test.section.points} of a ratio"
            dropped = {
                "not of an evaluated loading": len(table.load) - loading_rows,
                thinned: loading_rows - used_rows,
            }
            arrays = () if table.path is not None else (table.load, table.strain)
            file = table.path or Path(table.name)
            files.append(DataFile(file, table.source, used_rows, dropped, arrays))
            fill = table.partner
            if fill is not None and fill.path is not None:
                files.append(DataFile(fill.path, fill.source, len(fill.load)))
        return files

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """Return the doubts about the load paths of the test."""
        return _doubts_of_paths(self.test.paths, self.test.place.fabric.thickness, expected)


def first_row_errors(
    comparison: Comparison,
    law: HypoelasticLaw,
    nuisance: Mapping[str, float],
    history: History,
) -> ErrorColumns:
    """Return the errors of the first row of a path, from which its strains count.

    They err as much as the other rows scatter about their mean.
    """
    objective = comparison.objective
    deviation = objective.scale * objective.residual(history, nuisance)
    blocks = np.split(deviation, np.cumsum(objective.sizes)[:-1])
    scatter = np.sqrt(np.mean([block.var() for block in blocks]))
    level = max(objective.least_noise, float(scatter))
    by_block = np.repeat(np.eye(len(blocks)), objective.sizes, axis=0)
    return ErrorColumns.independent(level * by_block / objective.scale[:, None])


def count_loading_rows(paths: Sequence[BiaxialPath], table: BiaxialTable) -> int:
    """Return how many rows of a table lie within its evaluated loadings and their range."""
    count = 0
    for path in paths:
        if path.table is table:
            larger = table.load[path.cycle.first : path.cycle.last + 1].max(axis=1)
            lowest, highest = path.larger.min(), path.larger.max()
            count += int(((larger >= lowest) & (larger <= highest)).sum())
    return count


def load_share_nuisance(test: BiaxialTest, objective: PathObjective) -> tuple[Nuisance, ...]:
    """Return the unknown share of the loads that reaches the field, where its deviation is given.

    All ratios of the test have the same; `objective` is told its name.
    """
    section = test.section
    deviation = section.load_share_deviation
    if deviation is None:
        return ()
    start = float(np.mean(1.0 if section.load_share is None else section.load_share))
    name = f"load_share of {test.name}"
    objective.load_share = name, start
    furthest = min(4 * deviation, 0.9 * start)
    return (
        Nuisance(
            name,
            start - furthest,
            start + furthest,
            "",
            prior=deviation,
            weight=prior_weight(objective.least_noise, objective.scale),
            start=start,
            shared=True,
        ),
    )


@dataclass(frozen=True)
class PathLimits:
    """Limits beyond which a load path is doubtful for a coated fabric."""

    end_strain: tuple[float, float] = (5e-4, 0.5)  # least and largest strain of a coated fabric
    load: tuple[float, float] = (0.05, 500.0)  # kN/m, least and largest load of a path
    angle: float = 6.0  # degrees between the loads' direction and that of their stated ratio
    stiffer: float = 1.15  # strain across over strain along the more loaded yarn: swapped beyond


PATH_LIMITS = PathLimits()


def _doubts_of_paths(
    paths: Sequence[BiaxialPath], thickness: float, expected: Expected
) -> list[Doubt]:
    """Return the doubts about the load paths of a test: units, ratios, moduli and swapped yarns.

    Parameters
    ----------
    paths : sequence of BiaxialPath
        Loading branches that are evaluated.
    thickness : float, mm
        Thickness of the fabric.
    expected : Expected
        Bounds that the project gives the moduli.
    """
    doubts = [doubt for path in paths for doubt in _of_path(path)]
    if expected.moduli:
        doubts += _of_modulus(paths, thickness, expected)
    doubts += _of_yarns(paths)
    if not any(doubt.name == "swapped" for doubt in doubts) and expected.warp_is_stiffer:
        doubts += _of_stiffer_yarn(paths)
    return doubts


def _of_path(path: BiaxialPath) -> Iterator[Doubt]:
    """Yield doubts about the units of one path, and about its load ratio."""
    strain = float(np.abs(path.strain_change).max())
    load = float(path.load.max())
    if not PATH_LIMITS.end_strain[0] < strain < PATH_LIMITS.end_strain[1]:
        text = (
            f"ratio {path.ratio}: the strain changes by {100 * strain:.3g} % along the path: are "
            "the strains in the unit that is said?"
        )
        yield Doubt("strain-unit", True, text)
    if not PATH_LIMITS.load[0] < load < PATH_LIMITS.load[1]:
        text = (
            f"ratio {path.ratio}: the loads go up to {load:.3g} kN/m: are they per width, and in "
            "the unit that is said?"
        )
        yield Doubt("load-unit", True, text)
    warp, fill = (path.load[-1] - path.load[0]).tolist()
    expected_angle = np.degrees(np.arctan2(*shares(path.ratio)[::-1]))
    if abs(np.degrees(np.arctan2(fill, warp)) - expected_angle) > PATH_LIMITS.angle:
        measured_ratio = nearest_ratio([warp, fill])
        text = (
            f"ratio {path.ratio}: the loads change by {warp:.4g} and {fill:.4g} kN/m along warp "
            f"and fill, which is {measured_ratio}: are the columns of warp and fill right?"
        )
        is_sure = measured_ratio == ":".join(path.ratio.split(":")[::-1])
        yield Doubt("ratio", is_sure, text)


def _of_modulus(
    paths: Sequence[BiaxialPath], thickness: float, expected: Expected
) -> Iterator[Doubt]:
    """Yield the doubt about the first path whose modulus is far outside the bounds."""
    for path in paths:
        yarn = int(np.argmax(path.load[-1] - path.load[0]))
        strain = float(path.strain_change[-1, yarn])
        if not strain > 0:
            continue
        load = float(path.load[-1, yarn] - path.load[0, yarn])
        unlikely = expected.outside(load / strain / thickness, ["E1", "E2"])
        if unlikely:
            text = (
                f"ratio {path.ratio}: load over strain and thickness is about {unlikely}: "
                "are loads and strains in the units that are said, and is the thickness right?"
            )
            yield Doubt("modulus", True, text)
            return


def _of_yarns(paths: Sequence[BiaxialPath]) -> Iterator[Doubt]:
    """Yield the doubt that warp and fill are swapped: the less loaded yarn strains more."""
    ends = {path.ratio: path.strain_change[-1] for path in paths}
    for ratio, mirrored_ratio in (("2:1", "1:2"), ("1:0", "0:1")):
        if ratio not in ends or mirrored_ratio not in ends:
            continue
        warp, fill = ends[ratio]
        mirrored_warp, mirrored_fill = ends[mirrored_ratio]
        is_fill_longer = fill > PATH_LIMITS.stiffer * warp
        if is_fill_longer and mirrored_warp > PATH_LIMITS.stiffer * mirrored_fill:
            text = (
                f"in ratios {ratio} and {mirrored_ratio} the yarn that is pulled less "
                "stretches more: the strains of warp and fill seem to be swapped"
            )
            yield Doubt("swapped", True, text)
            return


def _of_stiffer_yarn(paths: Sequence[BiaxialPath]) -> Iterator[Doubt]:
    """Yield the doubt that warp and fill are swapped, where the bounds have the warp stiffer.

    Equal loads are compared: those of 1:1, or those of a ratio and its mirror image.
    """
    compliance = {
        path.ratio: path.strain_change[-1] / np.maximum(path.load[-1] - path.load[0], 1e-9)
        for path in paths
    }
    for ratio, mirrored_ratio in (("1:1", "1:1"), ("2:1", "1:2"), ("1:0", "0:1")):
        if ratio not in compliance or mirrored_ratio not in compliance:
            continue
        warp = compliance[ratio][0]
        fill = compliance[mirrored_ratio][1]
        if warp > PATH_LIMITS.stiffer * fill > 0:
            text = (
                f"in {ratio} the warp is strained {warp / fill:.3g} times as much as the fill is "
                f"by the same load in {mirrored_ratio}, and the bounds have the warp stiffer: warp "
                "and fill, or their strains alone, seem to be swapped"
            )
            yield Doubt("swapped", False, text)
            return


@dataclass(frozen=True)
class CandidatePaths:
    """Load paths that a plan proposes."""

    further_ratios: tuple[str, ...] = ("1:5", "5:1")  # beside the five of designers' constants
    loads: int = 20  # number of loads of a path
    independent_values: int = 5  # number in a curve if no test says: extensometers drift
    prestress: float = 0.05  # first load of a path, as a share of its last


CANDIDATES = CandidatePaths()


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return a candidate test for each load ratio, loaded up to the strains of the law's range."""
    prepared = [test for test in planning.present if isinstance(test, PreparedBiaxial)]
    noise_is = planning.noise_is(prepared[0] if prepared else None)
    return [
        Candidate(f"biaxial {ratio}", partial(_computed, ratio, prepared, planning), noise_is)
        for ratio in (*RATIOS, *CANDIDATES.further_ratios)
    ]


def _computed(
    ratio: str, present: Sequence[PreparedBiaxial], planning: Planning
) -> PreparedBiaxial:
    """Return a test of one ratio, with the strains that the current law predicts."""
    thickness = planning.place.fabric.thickness
    highest = largest_load(planning.law, thickness, [shares(ratio)], planning.ends[:2])
    if not highest > 0:
        raise SolverFailure(f"the law carries no load of ratio {ratio}", "membrane")
    count = CANDIDATES.loads
    levels = highest * np.linspace(CANDIDATES.prestress, 1.0, count)
    loads = np.outer(levels, shares(ratio))
    strain = biaxial_response(planning.law, loads, thickness).elongation
    table = BiaxialTable(
        Path("computed"),
        loads,
        strain,
        None,
        np.arange(count),
        FrameSource("computed"),
        name="computed",
    )
    cycle = LoadCycle(
        ratio=ratio,
        phase=1,
        number=1,
        number_in_file=1,
        first=0,
        last=count - 1,
    )
    path = BiaxialPath(table, cycle, 1, loads, strain)
    section = BiaxialSection(data=TablesSection(files=["computed"]))
    test = BiaxialTest(
        name=f"biaxial {ratio}",
        place=planning.place,
        weight=1.0,
        section=section,
        tables=[table],
        paths=[path],
        noise=_noise(present, planning) / PERCENT,
    )
    return PreparedBiaxial(test)


def _noise(present: Sequence[PreparedBiaxial], planning: Planning) -> float:
    """Return the noise (%) that each strain of a path has if all its errors are independent."""
    if planning.noise is not None:
        return planning.noise
    precisions = [
        planning.precision[prepared.part(path.ratio)]
        for prepared in present
        for path in prepared.test.paths
    ]
    if not precisions:
        precisions = [Precision(PERCENT * USUAL_NOISE, 1.0, CANDIDATES.independent_values)]
    return max(precision.for_values(CANDIDATES.loads - 1) for precision in precisions)
