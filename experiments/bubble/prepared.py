"""A bubble test with its data: what was measured, or computed, and what a fit compares with it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...inference.comparison import Comparison, Nuisance
from ...materials.forms.registry import form_named
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...meshes.mesh import Mesh
from ...meshes.reading import FacetReading, SmoothReading
from ...readers.fields import DisplacementField, read_fields
from ...readers.frames import FrameSource
from ...readers.surfaces import DisplacementSurface, fit_surface
from ...solvers.base import Solver
from ..kinds import (
    DataFile,
    Doubt,
    Expected,
    MakeSolver,
    Masks,
    Reach,
    Weighting,
    joined,
)
from .doubts import View, doubts_of
from .objective import (
    OFFSETS,
    FieldObjective,
    FieldTarget,
    at_nodes,
    at_points,
    at_rest,
    counted_from,
    folded,
    mirrored,
    reading_of,
    with_places,
)
from .point_files import PointFiles
from .registration import Registration, register_fields
from .sheet import FLAT, MeasuredSheet, measured_sheet, sheet_nuisance, with_sheet
from .test import PART, BubbleTest, KnownSolution

Array = NDArray[np.float64]

#: Over pressures and directions; relative to the largest measured displacement of each.
OBJECTIVES = {
    "e": "sum of relative RMS errors",
    "mm": "sum of RMS errors, mm",
}
#: Comparisons of lower stages lead in; a bubble is the last to join.
STAGE = 2
#: mm and kPa; a pressure offset leaves the first pressure positive.
MOST_SHIFT, MOST_PRESSURE, LEAST_SHARE = 20.0, 50.0, -0.9
PRESSURE = "pressure_offset"


@dataclass(frozen=True, eq=False)
class PreparedBubble:
    """The test, what was measured (or computed) as read, and polynomial surfaces of it.

    known : the law behind computed data. surfaces : for the match or the report. registration :
    of the fields, None where the files were in the test's coordinates. by_this_model : the data
    were computed with the mesh, the increments and the solver of the fit. sheet : what the
    fields say of the sheet's surface and of its rim.
    """

    test: BubbleTest
    fields: tuple[DisplacementField, ...]
    surfaces: tuple[DisplacementSurface, ...]
    known: HypoelasticLaw | None
    registration: Registration | None = None
    by_this_model: bool = False
    sheet: MeasuredSheet = FLAT

    @property
    def objective_is(self) -> str:
        """What is minimised, in words."""
        own = OBJECTIVES[self.test.objective]
        unknown = self.test.sheet.modes or self.test.sheet.slack
        return f"{own}, and what is known of the sheet" if unknown else own

    @property
    def specimens(self) -> Mapping[str, Sequence[int]]:
        """None: a bubble is one specimen."""
        return {}

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Frames, where no field that is constant over them is projected out."""
        return frames_of(self)

    def reach(self, masks: Masks) -> Reach:
        """As the test's own: a bubble does not tell how far it is strained."""
        return self.test.reach

    @property
    def dropped(self) -> int:
        """Doubtful points that were left out."""
        return sum(sum(f.dropped.values()) for f in self.fields)

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """The one comparison: the whole field at every pressure; none where nothing is left.

        Raises
        ------
        InputError : data that cannot be matched.
        """
        test, model, sheet = self.test, self.model, self.test.sheet
        whole = self.targets
        targets = kept_targets(whole, (masks or {}).get(test.name))
        if not targets:
            return ()
        # Blocks: one a direction and pressure.
        blocks = 3 * (len(test.pressures) - len(whole) + len(targets))
        weight = weighting.weight / blocks if weighting.relative else 1.0
        kind = "e" if weighting.relative else test.objective
        try:
            objective = FieldObjective(targets, kind, weight, test.noise, sheet.constant)
        except InputError as error:
            raise test.place.error(error.field, error.problem) from None
        nuisance = (*nuisance_of(test), *sheet_nuisance(sheet, model, objective.scale))
        return (Comparison(test.name, model, make_solver(), objective, nuisance, STAGE),)

    @property
    def targets(self) -> list[FieldTarget]:
        """What is matched, frame by frame, on the model's mesh.

        Raises
        ------
        InputError : data that cannot be matched.
        """
        test, mesh, sheet = self.test, self.model.mesh, self.test.sheet
        if test.match_by == "surfaces":
            targets = at_nodes(self.surfaces, mesh)
        elif self.known is not None:
            targets = at_nodes(self.matched, mesh)
        else:
            targets, _ = at_points(test, self.matched, mesh)
        try:
            if sheet.constant or sheet.since is not None:
                targets = with_places(targets, mesh.points[:, :2])
            if sheet.since is not None:
                targets = counted_from(targets, sheet.since)
        except InputError as error:
            raise test.place.error(error.field, error.problem) from None
        return targets

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """The same places on a finer mesh with finer increments, or on a coarser mesh."""
        if self.by_this_model and factor > 1:
            return self.comparisons(make_solver, weighting)
        return finer_bubble(self, make_solver, weighting, factor)

    def data_files(self) -> Sequence[DataFile]:
        """The files of the measured fields; none where they were computed."""
        data = self.test.data
        logs: Sequence[Path] = ()
        if isinstance(data, PointFiles) and data.recorded is not None:
            logs = data.recorded.logs
        frames = [
            DataFile(f.path, f.source, len(f.points), f.dropped)
            for f in self.fields
            if f.path is not None
        ]
        return [*joined(frames), *(DataFile(log, FrameSource("log"), None) for log in logs)]

    @property
    def matched(self) -> Sequence[DisplacementField]:
        """The fields as they are matched: at places without load, folded for a quarter."""
        since = self.test.sheet.since
        fields = self.fields if since is None else at_rest(self.fields, since)
        return [folded(f) for f in fields] if self.test.symmetry == "quarter" else fields

    @property
    def model(self) -> BubbleModel:
        """Of the sheet as it was, with the unknown shapes at zero."""
        return with_sheet(self.test.model(), self.test.sheet, self.test.outline, self.sheet)

    @property
    def outside(self) -> int:
        """Measured points beyond the rim of the model, which are not matched."""
        if self.test.match_by == "surfaces" or self.known is not None:
            return 0
        return at_points(self.test, self.matched, self.test.model().mesh)[1]

    @property
    def view(self) -> View:
        """What is looked at before a fit."""
        test = self.test
        return View(self.fields, test.outline, test.thickness, self.registration is not None)

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        """What makes the measured fields doubtful; nothing where they were computed."""
        return () if self.known is not None else doubts_of(self.view, expected)


def nuisance_of(test: BubbleTest) -> tuple[Nuisance, ...]:
    """The offsets that the test's section turns on."""
    on: list[Nuisance] = []
    if test.displacement_offset:
        on += [Nuisance(name, -MOST_SHIFT, MOST_SHIFT, "mm", None, 1.0) for name in OFFSETS]
    if test.pressure_offset:
        least = LEAST_SHARE * 1e3 * min(test.increments)
        on.append(Nuisance(PRESSURE, least, MOST_PRESSURE, "kPa", "pressure_offset", 1e-3))
    return tuple(on)


#: Quads of the full disk: with fewer it is no disk any more.
LEAST_QUADS = 48
#: A place between the polygons of two rims is looked for so much nearer to the centre, in turn.
INWARD = (1.0, 1 - 1e-4, 1 - 1e-3, 1 - 1e-2, 0.95, 0.9)


def finer_bubble(
    prepared: PreparedBubble, make_solver: MakeSolver, weighting: Weighting, factor: float
) -> tuple[Comparison, ...]:
    """Its one comparison, of quads and increments divided by a factor; only of quads below one.

    What lies between nodes is read as the fit reads it: what that does is part of the
    difference.

    Raises
    ------
    InputError : the mesh would be too coarse for a disk, or for the places of the data.
    """
    test = prepared.test
    (own,) = prepared.comparisons(make_solver, weighting)
    finer = test.models(what="elements", factor=factor)[PART]
    whole = len(finer.mesh.quads) * (4 if test.symmetry == "quarter" else 1)
    if whole < LEAST_QUADS and factor < 1:
        problem = f"{whole} quads are too few for a disk, of which {LEAST_QUADS} are the least"
        raise InputError(None, "elements", problem)
    steps = test.models(what="increments", factor=max(1, round(factor)))[PART].increments
    model = with_sheet(replace(finer, increments=steps), test.sheet, test.outline, prepared.sheet)
    objective = own.objective
    assert isinstance(objective, FieldObjective)
    moved = copy.copy(objective)
    reading = reading_of(test, model.mesh)
    moved.targets = resampled(objective.targets, own.model.mesh, model.mesh, reading)
    return (replace(own, model=model, objective=moved),)


def resampled(
    targets: tuple[FieldTarget, ...],
    own: Mesh,
    other: Mesh,
    reading: SmoothReading | FacetReading | None = None,
) -> tuple[FieldTarget, ...]:
    """The same targets at the same places, from the nodes of another mesh.

    reading : of that mesh, smooth unless given.
    """
    reading = reading or SmoothReading.of(other)
    found: list[tuple[Array, sp.csr_matrix]] = []
    moved = []
    for target in targets:
        rest = target.at(own.points)[:, :2] if target.at_rest is None else target.at_rest
        places = np.ascontiguousarray(rest)
        sample = next((s for p, s in found if np.array_equal(p, places)), None)
        if sample is None:
            sample = _sample(reading, places)
            found.append((places, sample))
        moved.append(replace(target, sample=sample))
    return tuple(moved)


def _sample(reading: SmoothReading | FacetReading, places: Array) -> sp.csr_matrix:
    at, inside = places.copy(), np.zeros(len(places), dtype=bool)
    for share in INWARD:
        at[~inside] = share * places[~inside]
        matrix, inside = reading.matrix(at)
        if inside.all():
            return matrix
    problem = f"{(~inside).sum()} places of the data lie outside of it"
    raise InputError(None, "mesh", problem)


def frames_of(prepared: PreparedBubble) -> Mapping[str, Mapping[str, Masks]]:
    """The points that are kept without each frame, by its pressure.

    None of a single frame, nor where a field that is the same in all frames is projected out: it
    is known of all of them together only.
    """
    if prepared.test.sheet.constant:
        return {}
    targets = prepared.targets
    if len(targets) < 2:
        return {}
    whose = np.repeat(np.arange(len(targets)), [len(t.displacement) for t in targets])
    names = [f"{1e3 * target.pressure:.5g} kPa" for target in targets]
    if len(set(names)) < len(names):
        names = [f"{name} (frame {k + 1})" for k, name in enumerate(names)]
    return {
        "frames": {name: {prepared.test.name: whose != k} for k, name in enumerate(names)},
    }


def kept_targets(
    targets: Sequence[FieldTarget], mask: NDArray[np.bool_] | None
) -> list[FieldTarget]:
    """What a mask over the points of all targets leaves of them, each of its own frame."""
    if mask is None:
        return list(targets)
    ends = np.cumsum([len(target.displacement) for target in targets])[:-1]
    kept = []
    for k, (target, own) in enumerate(zip(targets, np.split(mask, ends), strict=True)):
        if not own.any():
            continue
        frame = k if target.frame is None else target.frame
        whole = target.sample
        if whole is None and not own.all():
            whole = sp.identity(len(own), format="csr")
        kept.append(
            replace(
                target,
                displacement=target.displacement[own],
                sample=whole if whole is None else sp.csr_matrix(whole[own]),
                places=None if target.places is None else target.places[own],
                at_rest=None if target.at_rest is None else target.at_rest[own],
                frame=frame,
            )
        )
    return kept


@dataclass(frozen=True, eq=False)
class KnownData:
    """fields : computed, one a pressure. law : behind them.

    by_this_model : whether they are of the mesh, the increments and the solver of the fit.
    """

    fields: tuple[DisplacementField, ...]
    law: HypoelasticLaw
    by_this_model: bool


def known_data(
    test: BubbleTest, data: KnownSolution, law: HypoelasticLaw, make_solver: MakeSolver
) -> KnownData:
    """The known solution of a test; `law` : as the fit has it, without its coefficients.

    Raises
    ------
    InputError : in the section. SolverFailure : the known solution cannot be run.
    """
    known, solver = _known_law(test, data, law), _solver(test, data, make_solver)
    fields = _computed(test, data, known, solver)
    own = data.solver is None or solver.identity == make_solver().identity
    return KnownData(fields, known, own and _same_steps_and_mesh(test, data))


def _solver(test: BubbleTest, data: KnownSolution, make_solver: MakeSolver) -> Solver:
    """Who computes the data: the solver that fits unless another is named."""
    if data.solver is None:
        return make_solver()
    try:
        return make_solver(data.solver)
    except InputError as error:
        field = "data.known_solution.solver"
        raise test.place.error(field, error.problem) from None


def _same_steps_and_mesh(test: BubbleTest, data: KnownSolution) -> bool:
    """Whether the data are of the increments and the mesh that the fit has, whole or folded."""
    if len(data.increments) != len(test.increments):
        return False
    if not np.allclose(data.increments, test.increments, rtol=1e-9, atol=0.0):
        return False
    own, other = (test.model(elements=n).mesh for n in (test.elements, data.elements))
    return own.points.shape == other.points.shape and np.allclose(own.points, other.points)


def _known_law(test: BubbleTest, data: KnownSolution, law: HypoelasticLaw) -> HypoelasticLaw:
    field = "data.known_solution"
    try:
        form = form_named(data.form, {}, law.strain_range.tolist())
        return HypoelasticLaw(data.beta, law.nu12, law.strain_range, law.thickness_change, form)
    except InputError as error:
        raise test.place.error(f"{field}.{error.field}", error.problem) from None


def _computed(
    test: BubbleTest, data: KnownSolution, known: HypoelasticLaw, solver: Solver
) -> tuple[DisplacementField, ...]:
    """Displacements of the known solution by a solver, on the data's own mesh."""
    if data.symmetry == "quarter" and test.symmetry == "full":
        problem = "data of a quarter cannot be matched by a full model; use the same symmetry"
        raise test.place.error("data.known_solution.symmetry", problem)
    source = test.model(elements=data.elements, symmetry=data.symmetry, increments=data.increments)
    try:
        history = solver.run(source, known)
    except SolverFailure as failure:
        raise SolverFailure(
            f"the known solution cannot be run: {failure.reason}",
            failure.solver,
            failure.exit_number,
            failure.log_tail,
            failure.scratch,
        ) from None
    return tuple(
        DisplacementField(p, source.mesh.points[:, :2], u)
        for p, u in zip(test.pressures, np.asarray(history.displacement), strict=True)
    )


def prepare(test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedBubble:
    """Read or compute the data of a test.

    Raises
    ------
    InputError : in the data. SolverFailure : the known solution cannot be run.
    """
    if isinstance(test.data, KnownSolution):
        known = known_data(test, test.data, law, make_solver)
        surfaces = _surfaces(test, known.fields, computed=True)
        prepared = PreparedBubble(
            test, known.fields, surfaces, known.law, by_this_model=known.by_this_model
        )
    else:
        fields, registration = _measured(test, test.data)
        surfaces = _surfaces(test, fields, computed=False)
        prepared = PreparedBubble(test, fields, surfaces, None, registration)
    try:
        sheet = measured_sheet(test.sheet, test.outline, prepared.matched)
    except InputError as error:
        raise test.place.error(error.field, error.problem) from None
    return replace(prepared, sheet=sheet)


def _surfaces(
    test: BubbleTest, fields: Sequence[DisplacementField], computed: bool
) -> tuple[DisplacementSurface, ...]:
    """Surfaces of every field; where they are only reported, too few points leave them out."""
    # A computed quarter is mirrored: surfaces are fitted to the full disk.
    whole = [mirrored(f) if computed else f for f in fields]
    if test.match_by == "points":
        count = min(len(f.points) for f in whole)
        if count < (test.match_degree + 1) ** 2:
            return ()
    try:
        return tuple(fit_surface(f, test.match_degree) for f in whole)
    except InputError as error:
        problem = f"{error.field}: {error.problem}"
        raise test.place.error("match.degree", problem) from None


def _measured(
    test: BubbleTest, data: PointFiles
) -> tuple[tuple[DisplacementField, ...], Registration | None]:
    try:
        frames = None if data.recorded is None else data.recorded.frames
        fields = read_fields(
            data.files, test.pressures, options=data.options, format=data.format, frames=frames
        )
    except InputError as error:
        if error.path is not None:
            raise
        raise test.place.error(f"data.points.{error.field}", error.problem) from None
    if data.registration is None:
        return fields, None
    try:
        return register_fields(fields, test.outline, data.registration)
    except InputError as error:
        field = f"data.points.registration.{error.field}".rstrip(".")
        raise test.place.error(field, error.problem) from None
