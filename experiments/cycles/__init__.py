"""Fit a law with a memory to cyclic tests: section [[cycles]], models and objective.

Every file is the load history of one specimen that is loaded, unloaded and loaded again. The model
of a strip follows the measured strains, and its loads are compared with the measured ones, each
branch (loading or unloading) with the same weight. This determines the memory of a law
(`materials/memory.py`) together with its moduli. Strains and loads count from where the load first
crosses the reference load, as in `evaluation`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...errors import InputError
from ...inference.comparison import Comparison
from ...materials.card import State
from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import (
    GRIP_DISTANCE,
    WIDTH,
    UniaxialModel,
    bias_strip,
    refined_quads,
    straight_strip,
)
from ...notes import Note
from ...readers.curves import LengthUnit
from ...readers.frames import FrameSource
from ...readers.histories import Pace, pace_of, read_history
from ...readers.sections import Name, Positive, Section, Size, Weight, whole_in_base_units
from ...solvers.base import Array
from ..base import MakeSolver, Masks, PreparedTest, Reach, Refined, SectionTest, Weighting
from ..data_files import READING, DataFile
from ..measured import MeasuredKind, PreparedParts
from ..sections import Place, listed_files
from ..strips.load_objective import LoadObjective
from ..strips.reading import FilesSection
from .evaluation import evaluate_history, scatter_notes
from .values import EvaluatedHistory, matched_rows

#: Gauge length (mm) of strips along the yarns, which are homogeneous, so that it does not matter.
GAUGE_LENGTH = 100.0
#: Factor by which the edges of the bias strip's quads are divided; below 1 the mesh is coarser.
BIAS_EDGES = 0.4
#: Standard deviation of one load over the largest load, unless the project gives the noise.
NOISE_SHARE = 0.005
#: Smallest difference of strain between consecutive readings, and of a reading from zero.
MIN_STRAIN = 1e-6


class HistoryColumns(Section):
    """[cycles.columns]: the files' own column names."""

    load: str | None = None
    strain: str | None = None
    elongation: str | None = None
    travel: str | None = None
    time: str | None = None


class CyclesSection(Section):
    """Section [[cycles]]: strips, straps or cords through loading, unloading and reloading."""

    name: Name | None = None
    weight: Weight = 1.0
    files: FilesSection
    folder: str = ""
    columns: HistoryColumns = HistoryColumns()
    load_unit: Literal["N", "kN", "lbf"] | None = None
    length_unit: LengthUnit | None = None
    strain_unit: Literal["%", "mm/mm"] | None = None
    width: Size | None = None
    gauge_length: Size | None = None
    grip_distance: Size | None = None
    reference_load: Positive | None = None
    increments: Annotated[int, Field(ge=4, le=1000)] = 20
    noise: Positive | None = None


@dataclass(frozen=True, eq=False)
class Specimen:
    """The history of one specimen as a fit matches it, averaged over equal parts of each branch.

    Parameters
    ----------
    direction : str
        "warp", "fill" or "bias".
    evaluated : EvaluatedHistory
        The whole history with the values of its cycles.
    strain, load : (n,) arrays
        Strain and load (N) of each averaged reading, less those at the reference load.
    branch : (n,) array of int
        Number of each reading's branch from 0; even numbers are loadings.
    cycle : (n,) array of int
        Number of each reading's cycle from 1.
    predictable : tuple of int
        Numbers of the cycles that may be left out, because the others can predict them.
    """

    direction: str
    evaluated: EvaluatedHistory
    strain: Array
    load: Array
    branch: NDArray[np.intp]
    cycle: NDArray[np.intp]
    predictable: tuple[int, ...]

    @property
    def name(self) -> str:
        """Return the name of the specimen: its direction and its file without ending."""
        return f"{self.direction} {self.evaluated.name}"


def specimen_of(direction: str, evaluated: EvaluatedHistory, increments: int) -> Specimen:
    """Thin a history to a number of readings in each branch, for a fit.

    Readings are averaged over equal parts of the strain of a branch; the last reading of a branch,
    its turning point, stays as it was measured.

    Parameters
    ----------
    direction : str
        "warp", "fill" or "bias".
    evaluated : EvaluatedHistory
        The whole history with the values of its cycles.
    increments : int
        Largest number of readings of a branch.

    Raises
    ------
    InputError
        If no reading lies above the reference load.
    """
    history = evaluated.history
    strain = history.strain - evaluated.zero
    load = history.load - evaluated.reference
    start, end = matched_rows(evaluated)
    row = np.arange(len(load))
    is_matched = (row >= start) & (row <= end) & (strain > MIN_STRAIN)
    readings: list[tuple[float, float, int, int]] = []
    last_strain = 0.0
    for v in evaluated.values:
        branches = [slice(v.cycle.start, v.cycle.peak + 1)]
        if v.cycle.unloaded:
            branches.append(slice(v.cycle.peak, v.cycle.end + 1))
        for side, rows in enumerate(branches):
            matched = is_matched[rows]
            means = _averages(strain[rows][matched], load[rows][matched], increments)
            for mean_strain, mean_load in means:
                if abs(mean_strain - last_strain) > MIN_STRAIN:
                    branch = 2 * v.cycle.number - 2 + side
                    readings.append((mean_strain, mean_load, branch, v.cycle.number))
                    last_strain = mean_strain
    if not readings:
        problem = f"no reading above the reference load of {evaluated.reference:g} N"
        raise InputError(history.path, "load", problem)
    strains, loads, branch_numbers, cycle_numbers = zip(*readings, strict=True)
    return Specimen(
        direction=direction,
        evaluated=evaluated,
        strain=np.array(strains),
        load=np.array(loads),
        branch=np.array(branch_numbers).astype(np.intp),
        cycle=np.array(cycle_numbers).astype(np.intp),
        predictable=_predictable_cycles(evaluated),
    )


def _averages(strain: Array, load: Array, increments: int) -> list[tuple[float, float]]:
    """Return mean strain and mean load (N) of equal parts of a branch, and its last reading."""
    if len(strain) < 2:
        return []
    share = np.clip((strain - strain[0]) / (strain[-1] - strain[0] or 1.0), 0.0, 1.0)
    part = np.minimum((increments - 1) * share, increments - 1.5).astype(int)
    part[-1] = increments - 1
    masks = [part == k for k in np.unique(part)]
    return [(float(strain[mask].mean()), float(load[mask].mean())) for mask in masks]


def _predictable_cycles(evaluated: EvaluatedHistory) -> tuple[int, ...]:
    """Return the numbers of the cycles up to strains that other cycles reach, except the first."""
    tops = [v.top for v in evaluated.values]
    numbers = []
    for k, v in enumerate(evaluated.values):
        if k and not math.isnan(v.permanent) and v.top <= max(tops[:k] + tops[k + 1 :]):
            numbers.append(v.cycle.number)
    return tuple(numbers)


@dataclass(frozen=True, eq=False, kw_only=True)
class CyclesTest(SectionTest):
    """A test of specimens that are loaded, unloaded and loaded again.

    Parameters
    ----------
    width, grip_distance : float, mm
        Width of the strips, and their free length between the grips.
    gauge : float, mm
        Gauge length of bias strips.
    matched : mapping of str to Specimen
        Specimens by their names.
    """

    setting_names: ClassVar[tuple[str, ...]] = (
        "weight",
        "width",
        "gauge",
        "grip_distance",
        "noise",
    )

    width: float
    gauge: float
    grip_distance: float
    matched: Mapping[str, Specimen]
    kind: str = "cycles"
    reads_files: bool = True
    state: State = "first loading"

    @property
    def reach(self) -> Reach:
        """Return the largest log strains along warp and fill, and the largest shear.

        A bias strip at 45 degrees keeps its area, so that its shear is twice its strain.
        """
        ends: dict[str, float] = {}
        for specimen in self.matched.values():
            direction = specimen.direction
            end = float(np.log1p(specimen.strain.max())) * (2 if direction == "bias" else 1)
            ends[direction] = max(end, ends.get(direction, 0.0))
        return Reach((ends.get("warp"), ends.get("fill"), ends.get("bias")))

    @property
    def data_notes(self) -> tuple[Note, ...]:
        """Return the doubts about the histories, and the scatter between specimens."""
        by_direction: dict[str, list[EvaluatedHistory]] = {}
        notes: list[Note] = []
        for specimen in self.matched.values():
            by_direction.setdefault(specimen.direction, []).append(specimen.evaluated)
            notes += [note for note in specimen.evaluated.notes if note.kind != READING]
        return (*notes, *scatter_notes(by_direction))

    @property
    def pace(self) -> Pace:
        """Return the pace of the test by the times in its files."""
        return pace_of(specimen.evaluated.history for specimen in self.matched.values())

    def models(
        self,
        thickness: float | None = None,
        refined: Refined = "elements",
        factor: float = 1.0,
    ) -> Mapping[str, UniaxialModel]:
        """Return the model of each specimen: a bias strip, or one quad for a homogeneous strip.

        Parameters
        ----------
        thickness : float, optional
            Thickness of the fabric, mm; the project's unless given.
        refined : {"elements", "increments"}
            What is refined; increments follow the measured strains and cannot be.
        factor : float
            Number by which the edges of a bias strip's quads are divided.
        """
        quads = refined_quads("bias", BIAS_EDGES * (factor if refined == "elements" else 1.0))
        lengths = self.gauge, 2 * self.gauge, self.thick(thickness), self.width
        models = {}
        for name, specimen in self.matched.items():
            if specimen.direction == "bias":
                model = bias_strip(*lengths, self.grip_distance, increments=1, **quads)
            else:
                model = straight_strip(
                    specimen.direction,
                    *lengths,
                    increments=1,
                    across=1,
                    along=1,
                )
            elongations = (self.gauge * specimen.strain).tolist()
            models[name] = replace(model, elongations=elongations, unloaded=True)
        return models


def read(section: CyclesSection, place: Place, name: str) -> CyclesTest:
    """Read a cyclic test from its section and its load histories.

    Parameters
    ----------
    section : CyclesSection
    place : Place
        Place of the section in its project, with folders, units and messages.
    name : str
        Name of the test.

    Raises
    ------
    InputError
        If there are no files, a bias strip's gauge does not fit, or a history cannot be evaluated.
    """
    section = whole_in_base_units(section, place.scales)
    folder = place.folder(section.folder)
    gauge = section.gauge_length or GAUGE_LENGTH
    grips = section.grip_distance or GRIP_DISTANCE
    if section.files.bias and (section.gauge_length is None or not gauge < grips):
        problem = f"of bias strips expected a length below the distance of the grips, {grips:g} mm"
        raise place.error("gauge_length", problem)
    listed = section.files.model_dump(exclude_none=True)
    if not listed:
        raise place.error("files", "expected files of one direction at least: { warp = [...] }")
    options: dict[str, Any] = {
        "columns": section.columns.model_dump(exclude_none=True) or None,
        "load_unit": section.load_unit,
        "length_unit": section.length_unit,
        "strain_unit": section.strain_unit,
        "length": section.gauge_length,
    }
    specimens: dict[str, Specimen] = {}
    for path, key, direction in listed_files(place, folder, listed, "files"):
        if not place.has(path, key):
            continue
        evaluated = evaluate_history(read_history(path, **options), section.reference_load)
        specimen = specimen_of(direction, evaluated, section.increments)
        if specimen.name in specimens:
            raise place.error(key, f"two files of one direction are called {evaluated.name!r}")
        specimens[specimen.name] = specimen
    return CyclesTest(
        name=name,
        place=place,
        weight=section.weight,
        width=section.width or WIDTH,
        gauge=gauge,
        grip_distance=grips,
        matched=specimens,
        noise=section.noise,
    )


class HistoryObjective(LoadObjective):
    """Residuals of the loads of a history: (model - measured) / largest load, scaled by branch.

    Each branch has the same weight: the sum of squared residuals is the square of `weight` times
    the mean over the branches of the mean squared relative error.

    Parameters
    ----------
    specimen : Specimen
        Measured readings.
    is_matched : (n,) array of bool
        Mask of the readings that count.
    weight : float
        Weight of the specimen's error in the objective.
    noise : float or None
        Standard deviation of one load, N; `NOISE_SHARE` of the largest load unless given.
    """

    def __init__(
        self,
        specimen: Specimen,
        is_matched: NDArray[np.bool_],
        weight: float,
        noise: float | None,
    ) -> None:
        peak = float(specimen.load.max())
        self.rows = np.flatnonzero(is_matched)
        self.elongation = specimen.strain[self.rows]
        self.load = specimen.load[self.rows]
        branch = specimen.branch[self.rows]
        _, number, count = np.unique(branch, return_inverse=True, return_counts=True)
        self.sizes = (len(self.rows),)
        self.sample = np.eye(len(is_matched))[self.rows]
        self.scale = peak * np.sqrt(count[number] * len(count)) / max(weight, 1e-300)
        self.least_noise = NOISE_SHARE * peak if noise is None else noise
        self.noise_is = "assumed" if noise is None else "given"

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the number (n, 1) of each reading, over which errors may be correlated."""
        return (self.rows[:, None].astype(float),)


@dataclass(frozen=True, eq=False)
class PreparedCycles(PreparedParts):
    """A cyclic test with its data, ready to be compared with a model."""

    test: CyclesTest
    objective_is = "root of the mean square error of each branch's loads over the largest load"

    looks_at_data = True

    @property
    def data_notes(self) -> tuple[Note, ...]:
        return self.test.data_notes

    @property
    def seen(self) -> list[str]:
        """Return a line on each specimen, which the command `check` prints."""
        return [
            f"{name}: {specimen.evaluated.words}" for name, specimen in self.test.matched.items()
        ]

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return the number of the specimen (from 0) of each reading, by comparison."""
        numbered = enumerate(self.test.matched.items())
        return {self.part(name): [k] * len(specimen.load) for k, (name, specimen) in numbered}

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the masks that leave out each cycle that others can predict, or each specimen."""
        cycles: dict[str, Masks] = {
            f"cycle {k} of {name}": {**self.full_masks, self.part(name): specimen.cycle != k}
            for name, specimen in self.test.matched.items()
            for k in specimen.predictable
        }
        return ({"cycles": cycles} if cycles else {}) | self.masks_without_each("specimens")

    def reach(self, masks: Masks) -> Reach:
        """Return the largest strains of the readings that `masks` keep."""
        matched = {}
        for name, specimen in self.matched_parts(masks).items():
            strain = specimen.strain[masks.get(self.part(name), slice(None))]
            matched[name] = replace(specimen, strain=strain)
        return replace(self.test, matched=matched).reach

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison of measured and modelled loads for each specimen with readings."""
        models = self.test.models()
        specimens = self.matched_parts(masks)
        all_masks = {**self.full_masks, **(masks or {})}
        weight = weighting.of_block(len(specimens))
        comparisons = []
        for name, specimen in specimens.items():
            part = self.part(name)
            objective = HistoryObjective(specimen, all_masks[part], weight, self.test.noise)
            comparison = Comparison(
                part,
                models[name],
                make_solver(),
                objective,
                contracts=True,
                must_be_stable=False,
            )
            comparisons.append(comparison)
        return tuple(comparisons)

    def data_files(self) -> Sequence[DataFile]:
        """Return the files of the histories."""
        files = []
        for specimen in self.test.matched.values():
            history = specimen.evaluated.history
            source = FrameSource("machine table", notes=history.notes)
            files.append(DataFile(history.path, source, len(history.load)))
        return files


class CyclesKind(MeasuredKind):
    """Strips, straps or cords through loading, unloading and reloading."""

    name = "cycles"
    title = "strips through loading, unloading and reloading"
    section = CyclesSection
    folder_key = "folder"
    prepared = PreparedCycles
    read = staticmethod(read)

    def prepare(
        self, test: CyclesTest, law: HypoelasticLaw, make_solver: MakeSolver
    ) -> PreparedTest:
        """Return the test with its data; InputError for a law without a memory."""
        if law.memory is None:
            problem = (
                "load cycles need a law with a memory: say [law.memory] warp = 'fitted' (or fill, "
                "shear), or numbers"
            )
            raise InputError(test.place.path, "law.memory", problem)
        return super().prepare(test, law, make_solver)


KIND = CyclesKind()
