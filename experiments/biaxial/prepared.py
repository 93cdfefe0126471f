"""Biaxial tests in a fit: residuals, comparisons, doubts, and tests that could be made next."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ...errors import SolverFailure
from ...inference.comparison import Comparison
from ...materials.biaxial_patch import biaxial_response, largest_load
from ...materials.designers import RATIOS, shares
from ...meshes.strip_models import elongations
from ...readers.frames import FrameSource
from ...solvers.base import Array, History
from ..base import MakeSolver, Masks, Reach, Weighting
from ..data_files import DataFile
from ..doubts import Doubt, Expected
from ..measured import PERCENT, USUAL_NOISE, PreparedParts, StrainObjective
from ..planning import Candidate, Planning, Precision
from .test import (
    BiaxialPath,
    BiaxialSection,
    BiaxialTable,
    BiaxialTest,
    LoadCycle,
    TablesSection,
    nearest_ratio,
    reach_of,
)

#: Strains at the end of a path: no coated fabric ends below or above.
LEAST_END, MOST_END = 5e-4, 0.5
#: kN/m: a cruciform of a coated fabric is loaded by more, and by less.
LEAST_LOAD, MOST_LOAD = 0.05, 500.0
#: Degrees between the loads' direction and that of the ratio they are said to have.
OFF = 6.0
#: How much stiffer than the warp the fill must be to be taken for it.
STIFFER = 1.15
#: Beside the five of designers' constants.
FURTHER = ("1:5", "5:1")
#: Loads of a path; values of a strain's curve that are taken to be independent where the project
#: has no biaxial test: an extensometer drifts, and errs alike along much of it.
LOADS, INDEPENDENT = 20, 5
#: Of the load at which a strain is at its end: where a path begins.
PRESTRESS = 0.05


class PathObjective(StrainObjective):
    """Residuals of the strains along warp, then fill, of one path, (n, 2) since its first load."""

    # The first row is the zero of the others and matches whatever the law is.
    first = 1

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the load (n, 1) N/mm of each block's values: neighbours err as one."""
        return (self.load[1:].max(axis=1, keepdims=True),) * 2

    def modelled(self, history: History) -> Array:
        """Return the model's strains (n, 2) since the beginning of the path."""
        strains = elongations(history.displacement)
        return np.asarray(strains - strains[0])

    def jacobian(self, history: History, slope: Array) -> Array:
        slopes = elongations(slope)
        return self.in_blocks(slopes - slopes[0])

    def of_points(self, values: Array) -> Array:
        return np.tile(values[1:], 2)


@dataclass(frozen=True, eq=False)
class PreparedBiaxial(PreparedParts):
    """A biaxial test with its data."""

    test: BiaxialTest
    objective_is = "sum of the ratios' RMS errors of strain, warp and fill, over their largest"

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the ratios as parts, where there are several."""
        return self.without_each("ratios")

    def reach(self, masks: Masks) -> Reach:
        """Return the reach of the ratios that masks leave."""
        return reach_of(self.kept(masks).values())

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison a ratio that masks leave; a patch hardly ever fails."""
        test = self.test
        models = self.test.models()
        fitted_paths = self.kept(masks)
        comparisons = []
        share = weighting.weight / (2 * max(1, len(fitted_paths))) if weighting.relative else 1.0
        for path in fitted_paths.values():
            largest = float(np.abs(path.since).max())
            if not largest > 0:
                raise test.place.error("data", f"the strains of ratio {path.ratio} are all zero")
            objective = PathObjective(path.load, path.since, largest, share, test.noise)
            parts = self.part(path.ratio), models[path.ratio], make_solver(), objective
            comparisons.append(Comparison(*parts, contracts=True))
        return tuple(comparisons)

    def data_files(self) -> Sequence[DataFile]:
        used = {id(table): 0 for table in self.test.tables}
        for path in self.test.paths:
            used[id(path.table)] += len(path.load)
        files = []
        for table in self.test.tables:
            rows = used[id(table)]
            dropped = {"not of an evaluated loading": len(table.load) - rows}
            files.append(DataFile(table.path, table.source, rows, dropped))
        return files

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        paths = self.test.paths
        doubts = [doubt for path in paths for doubt in _of_path(path)]
        for path in paths if expected.moduli else ():
            yarn = int(np.argmax(path.load[-1] - path.load[0]))
            strain = float(path.since[-1, yarn])
            if not strain > 0:
                continue
            load = float(path.load[-1, yarn] - path.load[0, yarn])
            unlikely = expected.outside(
                load / strain / self.test.place.fabric.thickness, ["E1", "E2"]
            )
            if unlikely:
                text = (
                    f"ratio {path.ratio}: load over strain and thickness is about {unlikely}: "
                    "are loads and strains in the units that are said, and is the thickness right?"
                )
                doubts.append(Doubt("modulus", True, text))
                break
        ends = {path.ratio: path.since[-1] for path in paths}
        for ratio, mirrored_ratio in (("2:1", "1:2"), ("1:0", "0:1")):
            if ratio not in ends or mirrored_ratio not in ends:
                continue
            first_end = ends[ratio]
            two = ends[mirrored_ratio]
            if first_end[1] > STIFFER * first_end[0] and two[0] > STIFFER * two[1]:
                text = (
                    f"in ratios {ratio} and {mirrored_ratio} the yarn that is pulled less "
                    "stretches more: the strains of warp and fill seem to be swapped"
                )
                return [*doubts, Doubt("swapped", True, text)]
        return doubts


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return each ratio by itself, up to the strains that the law is known for."""
    prepared = [test for test in planning.present if isinstance(test, PreparedBiaxial)]
    noise_is = "assumed" if not prepared else f"that of {prepared[0].test.name}"
    noise_is = noise_is if planning.noise is None else "given"
    return [
        Candidate(f"biaxial {ratio}", partial(_made, ratio, prepared, planning), noise_is)
        for ratio in (*RATIOS, *FURTHER)
    ]


def _made(ratio: str, present: Sequence[PreparedBiaxial], planning: Planning) -> PreparedBiaxial:
    """Return the path with the strains that the law gives."""
    thickness = planning.place.fabric.thickness
    highest = largest_load(planning.law, thickness, [shares(ratio)], planning.ends[:2])
    if not highest > 0:
        raise SolverFailure(f"the law carries no load of ratio {ratio}", "membrane")
    loads = np.outer(np.linspace(PRESTRESS, 1.0, LOADS) * highest, shares(ratio))
    strain = biaxial_response(planning.law, loads, thickness).elongation
    table = BiaxialTable(
        Path("computed"), loads, strain, None, np.arange(LOADS), FrameSource("computed")
    )
    path = BiaxialPath(table, LoadCycle(ratio, 1, 1, 1, 0, LOADS - 1), 1, loads, strain)
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
    """Return the noise of independent strains, %."""
    if planning.noise is not None:
        return planning.noise
    precisions = [planning.precision[t.part(p.ratio)] for t in present for p in t.test.paths]
    if not precisions:
        return Precision(PERCENT * USUAL_NOISE, 1.0, INDEPENDENT).at(LOADS - 1)
    return max(precision.at(LOADS - 1) for precision in precisions)


def _of_path(path: BiaxialPath) -> Iterator[Doubt]:
    """Yield doubts about the units of one path, and about its ratio."""
    end = float(np.abs(path.since).max())
    load = float(path.load.max())
    if not LEAST_END < end < MOST_END:
        text = (
            f"ratio {path.ratio}: the strain changes by {100 * end:.3g} % along the path: are the "
            "strains in the unit that is said?"
        )
        yield Doubt("strain-unit", True, text)
    if not LEAST_LOAD < load < MOST_LOAD:
        text = (
            f"ratio {path.ratio}: the loads go up to {load:.3g} kN/m: are they per width, and in "
            "the unit that is said?"
        )
        yield Doubt("load-unit", True, text)
    warp, fill = (path.load[-1] - path.load[0]).tolist()
    expected_angle = np.degrees(np.arctan2(*shares(path.ratio)[::-1]))
    if abs(np.degrees(np.arctan2(fill, warp)) - expected_angle) > OFF:
        measured_ratio = nearest_ratio([warp, fill])
        text = (
            f"ratio {path.ratio}: the loads change by {warp:.4g} and {fill:.4g} kN/m along warp "
            f"and fill, which is {measured_ratio}: are the columns of warp and fill right?"
        )
        yield Doubt("ratio", measured_ratio == ":".join(path.ratio.split(":")[::-1]), text)
