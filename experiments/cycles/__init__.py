"""Whole load histories in a fit: section [[cycles]], models, objective.

Every file is one specimen that is loaded, unloaded and loaded again. A strip is driven through the
measured strains and its loads are compared, each branch with the same weight, so that a law with a
memory (`materials/memory.py`) is found with its moduli. Strains and loads count from the first
passage of the reference load, as in `evaluation`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...errors import InputError, Note
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
from ...readers.curves import LengthUnit
from ...readers.frames import FrameSource
from ...readers.histories import Pace, pace_of, read_history
from ...readers.sections import Name, Positive, Section, Size, whole_in_base_units
from .. import kinds
from ..kinds import Array, MakeSolver, Masks, Place, PreparedTest, Reach, SectionTest, Weighting
from ..measured import MeasuredKind, PreparedParts
from ..strips.prepared import LoadObjective
from ..strips.test import FilesSection
from .evaluation import EvaluatedHistory, evaluate_history, matched_rows, scatter_notes

#: mm of a gauge whose length does not matter; edges of the bias strip's quads over the usual ones.
GAUGE, COARSER = 100.0, 0.4
#: Of the largest load: noise of one load unless the project says it. Least strain of a reading.
NOISE, LEAST = 0.005, 1e-6


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
    weight: Annotated[float, Field(ge=0, le=1e6)] = 1.0
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
    """One history as it is matched: readings averaged over equal parts of each branch.

    strain, load : (n,) from the reference load on, N. branch : (n,) its number from 0, even on
    loading. cycle : (n,) from 1. leaves : cycles that the others can predict.
    """

    direction: str
    evaluated: EvaluatedHistory
    strain: Array
    load: Array
    branch: NDArray[np.intp]
    cycle: NDArray[np.intp]
    leaves: tuple[int, ...]

    @property
    def name(self) -> str:
        """Return direction and file."""
        return f"{self.direction} {self.evaluated.name}"


def specimen_of(direction: str, found: EvaluatedHistory, increments: int) -> Specimen:
    """Return a history thinned to so many readings a branch; its turning points stay as read."""
    history, level = found.history, found.reference
    strain, load = history.strain - found.zero, history.load - level
    start, end = matched_rows(found)
    inside = (np.arange(len(load)) >= start) & (np.arange(len(load)) <= end)
    rows: list[tuple[float, float, int, int]] = []
    last = 0.0
    for v in found.values:
        up = slice(v.cycle.start, v.cycle.peak + 1)
        for side, part in enumerate((up, slice(v.cycle.peak, v.cycle.end + 1))):
            if side and not v.cycle.unloaded:
                continue
            keep = inside[part] & (strain[part] > LEAST)
            x, y = strain[part][keep], load[part][keep]
            if len(x) < 2:
                continue
            place = np.clip((x - x[0]) / (x[-1] - x[0] or 1.0), 0.0, 1.0)
            number = np.minimum((increments - 1) * place, increments - 1.5).astype(int)
            number[-1] = increments - 1
            for k in np.unique(number):
                own = number == k
                e, f = float(x[own].mean()), float(y[own].mean())
                if abs(e - last) > LEAST:
                    rows.append((e, f, 2 * v.cycle.number - 2 + side, v.cycle.number))
                    last = e
    if not rows:
        problem = f"no reading above the reference load of {level:g} N"
        raise InputError(history.path, "load", problem)
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    tops = [v.top for v in found.values]
    leaves = tuple(
        v.cycle.number for k, v in enumerate(found.values)
        if k and not math.isnan(v.permanent) and v.top <= max(tops[:k] + tops[k + 1 :])
    )  # fmt: skip
    branch, cycle = (column.astype(np.intp) for column in columns[2:])
    return Specimen(direction, found, columns[0], columns[1], branch, cycle, leaves)


@dataclass(frozen=True, eq=False, kw_only=True)
class CyclesTest(SectionTest):
    """Specimens by their names; lengths mm, loads N. gauge : of the bias strips."""

    width: float
    gauge: float
    grip_distance: float
    matched: Mapping[str, Specimen]
    kind: str = "cycles"
    reads_files: bool = True
    state: State = "first loading"

    @property
    def reach(self) -> Reach:
        """Return the largest strains; shear of a strip that keeps its area is twice its own."""
        ends: dict[str, float] = {}
        for one in self.matched.values():
            end = float(np.log1p(one.strain.max())) * (2 if one.direction == "bias" else 1)
            ends[one.direction] = max(end, ends.get(one.direction, 0.0))
        return Reach((ends.get("warp"), ends.get("fill"), ends.get("bias")))

    @property
    def data_notes(self) -> tuple[Note, ...]:
        """Return the doubts about the histories, and the scatter between specimens."""
        by_direction: dict[str, list[EvaluatedHistory]] = {}
        notes: list[Note] = []
        for specimen in self.matched.values():
            by_direction.setdefault(specimen.direction, []).append(specimen.evaluated)
            notes += [note for note in specimen.evaluated.notes if note.kind != kinds.READING]
        return (*notes, *scatter_notes(by_direction))

    @property
    def pace(self) -> Pace:
        """Return rate of strain and hold by the files' times."""
        return pace_of(one.evaluated.history for one in self.matched.values())

    def models(
        self, thickness: float | None = None, what: kinds.Refined = "elements", factor: float = 1.0
    ) -> Mapping[str, UniaxialModel]:
        """Return a strip a specimen; those along the yarns are homogeneous, one quad."""
        quads = refined_quads("bias", COARSER * (factor if what == "elements" else 1.0))
        lengths = self.gauge, 2 * self.gauge, self.thick(thickness), self.width
        models = {}
        for name, one in self.matched.items():
            if one.direction == "bias":
                model = bias_strip(*lengths, self.grip_distance, increments=1, **quads)
            else:
                yarn: Literal["warp", "fill"] = "warp" if one.direction == "warp" else "fill"
                model = straight_strip(yarn, *lengths, increments=1, across=1, along=1)
            path = (self.gauge * one.strain).tolist()
            models[name] = replace(model, elongations=path, unloaded=True)
        return models

    def settings(self) -> Mapping[str, object]:
        names = ("weight", "width", "gauge", "grip_distance", "noise")
        return {name: getattr(self, name) for name in names}


def read(section: CyclesSection, place: Place, name: str) -> CyclesTest:
    """Read the section of a test, and its histories."""
    section, folder = whole_in_base_units(section, place.scales), place.folder(section.folder)
    width, gauge = section.width or WIDTH, section.gauge_length or GAUGE
    grips = section.grip_distance or GRIP_DISTANCE
    if section.files.bias and (section.gauge_length is None or not gauge < grips):
        problem = f"of bias strips expected a length below the distance of the grips, {grips:g} mm"
        raise place.error("gauge_length", problem)
    keys = ("load_unit", "length_unit", "strain_unit")
    said = {key: getattr(section, key) for key in keys} | {"length": section.gauge_length}
    specimens: dict[str, Specimen] = {}
    listed = section.files.model_dump(exclude_none=True)
    if not listed:
        raise place.error("files", "expected files of one direction at least: { warp = [...] }")
    columns = section.columns.model_dump(exclude_none=True) or None
    for path, key, direction in kinds.listed_files(place, folder, listed, "files"):
        if not place.has(path, key):
            continue
        found = evaluate_history(
            read_history(path, columns=columns, **said), section.reference_load
        )
        one = specimen_of(direction, found, section.increments)
        if one.name in specimens:
            raise place.error(key, f"two files of one direction are called {found.name!r}")
        specimens[one.name] = one
    return CyclesTest(
        name=name, place=place, weight=section.weight, width=width, gauge=gauge,
        grip_distance=grips, matched=specimens, noise=section.noise,
    )  # fmt: skip


class HistoryObjective(LoadObjective):
    """Residuals (model - measured) / peak of the loads of a history; each branch weighs alike.

    kept : (n,) which readings count. The sum of squares is the mean square over the branches.
    """

    def __init__(
        self, one: Specimen, kept: NDArray[np.bool_], weight: float, noise: float | None
    ) -> None:
        self.rows, peak = np.flatnonzero(kept), float(one.load.max())
        self.elongation, self.measured = one.strain[self.rows], one.load[self.rows]
        _, number, count = np.unique(one.branch[self.rows], return_inverse=True, return_counts=True)
        self.sizes, self.specimens, self.alike = (len(self.rows),), None, 1.0
        self.sample = np.eye(len(kept))[self.rows]
        self.scale = peak * np.sqrt(count[number] * len(count)) / max(weight, 1e-300)
        self.least_noise = NOISE * peak if noise is None else noise
        self.noise_is = "assumed" if noise is None else "given"

    @property
    def places(self) -> tuple[Array, ...]:
        """Return the numbers of the readings: neighbours may err as one."""
        return (self.rows[:, None].astype(float),)


@dataclass(frozen=True, eq=False)
class PreparedCycles(PreparedParts):
    """Load histories with their data."""

    test: CyclesTest
    objective_is = "root of the mean square error of each branch's loads over the largest load"

    @property
    def data_notes(self) -> tuple[Note, ...]:
        return self.test.data_notes

    @property
    def seen(self) -> list[str]:
        """Return what `check` says of each specimen."""
        return [
            f"{name}: {specimen.evaluated.words}" for name, specimen in self.test.matched.items()
        ]

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """Return the number of the specimen of each reading, by comparison."""
        every = enumerate(self.test.matched.items())
        return {self.part(name): [k] * len(one.load) for k, (name, one) in every}

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return masks without each cycle that others can predict, and without each specimen."""
        cycles: dict[str, Masks] = {
            f"cycle {k} of {name}": {**self.whole, self.part(name): one.cycle != k}
            for name, one in self.test.matched.items() for k in one.leaves
        }  # fmt: skip
        return ({"cycles": cycles} if cycles else {}) | self.without_each("specimens")

    def reach(self, masks: Masks) -> Reach:
        """Return the reach of the readings that are matched."""
        kept = {
            name: replace(one, strain=one.strain[masks.get(self.part(name), slice(None))])
            for name, one in self.kept(masks).items()
        }
        return replace(self.test, matched=kept).reach

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return a comparison a specimen that has readings."""
        test, models, chosen = self.test, self.test.models(), self.kept(masks)
        known = {**self.whole, **(masks or {})}
        weight = weighting.weight / max(len(chosen), 1) if weighting.relative else 1.0
        return tuple(
            Comparison(
                self.part(name), models[name], make_solver(),
                HistoryObjective(one, known[self.part(name)], weight, test.noise), contracts=True,
                must_be_stable=False,
            )
            for name, one in chosen.items()
        )  # fmt: skip

    def data_files(self) -> Sequence[kinds.DataFile]:
        every = [one.evaluated.history for one in self.test.matched.values()]
        return [
            kinds.DataFile(h.path, FrameSource("machine table", notes=h.notes), len(h.load))
            for h in every
        ]


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
        """Return the test, which was read with its data; raises InputError: no memory."""
        if law.memory is None:
            problem = (
                "load cycles need a law with a memory: say [law.memory] warp = 'fitted' (or fill, "
                "shear), or numbers"
            )
            raise InputError(test.place.path, "law.memory", problem)
        return super().prepare(test, law, make_solver)


KIND = CyclesKind()
