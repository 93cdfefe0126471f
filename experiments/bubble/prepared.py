"""A bubble test with its data, measured or computed, and the comparisons of a fit with it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import dropwhile
from pathlib import Path
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...inference.comparison import Comparison
from ...inference.virtual_work import GapObjective, smoothed
from ...materials.forms.base import form_named
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...readers.fields import DisplacementField, DisplacementSurface, fit_surface
from ...readers.frames import Frame, FrameSource, frame_file_name
from ..base import BasePrepared, MakeSolver, Masks, Reach, Weighting
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from .doubts import doubts_of
from .folding import folded, mirrored
from .measured_view import View
from .nuisance import bubble_nuisance
from .objective import FieldObjective
from .point_files import PointFiles
from .registration import CameraRegistration, register_fields
from .resampling import prolonged, resampled
from .sheet import (
    FLAT,
    MeasuredSheet,
    measured_sheet,
    with_sheet,
)
from .targets import (
    FieldTarget,
    at_nodes,
    at_points,
    counted_from,
    reading_of,
    with_place_numbers,
    with_unloaded_positions,
)
from .test import PART, BubbleTest, KnownSolution, measured_fields

#: Over pressures and directions; relative to the largest measured displacement of each.
OBJECTIVES = {"e": "sum of relative RMS errors", "mm": "sum of RMS errors, mm"}


@dataclass(frozen=True)
class MeshLimits:
    """Limits of other meshes of a test than the one that is fitted."""

    min_quads: int = 48  # of the full disk: with fewer it is no disk any more
    max_quads_of_shape: int = 150  # of a smoothed shape in balance: measured fields know no more


MESH_LIMITS = MeshLimits()


@dataclass(frozen=True, eq=False)
class PreparedBubble(BasePrepared):
    """A bubble test with its displacement fields.

    Attributes
    ----------
    test : BubbleTest
    fields : tuple of DisplacementField
        As they were read or computed, at the test's pressures.
    surfaces : tuple of DisplacementSurface
        Polynomials through the fields; none where there are too few points.
    known : HypoelasticLaw or None
        The law behind computed data.
    registration : CameraRegistration or None
        None where the files were in the test's coordinates.
    by_this_model : bool
        Whether the data were computed with the mesh, the increments and the solver of the fit.
    sheet : MeasuredSheet
        Surface and rim as measured.
    """

    test: BubbleTest
    fields: tuple[DisplacementField, ...]
    surfaces: tuple[DisplacementSurface, ...]
    known: HypoelasticLaw | None
    registration: CameraRegistration | None = None
    by_this_model: bool = False
    sheet: MeasuredSheet = FLAT
    specimens: ClassVar[Mapping[str, Sequence[int]]] = {}  # a bubble is one

    @property
    def objective_is(self) -> str:
        objective = OBJECTIVES[self.test.objective]
        if self.test.sheet.has_unknowns:
            return f"{objective}, and what is known of the sheet"
        return objective

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the points kept without each frame; none beside a constant field."""
        targets = self.targets
        if self.test.sheet.constant or len(targets) < 2:
            return {}
        counts = [len(target.displacement) for target in targets]
        frame = np.repeat(np.arange(len(targets)), counts)
        names = [f"{1e3 * target.pressure:.5g} kPa" for target in targets]
        if len(set(names)) < len(names):
            names = [f"{name} (frame {k + 1})" for k, name in enumerate(names)]
        masks: dict[str, Masks] = {
            name: {self.test.name: frame != k} for k, name in enumerate(names)
        }
        return {"frames": masks}

    def reach(self, masks: Masks) -> Reach:
        """Return the test's own: a bubble does not tell how far it is strained."""
        return self.test.reach

    @property
    def source(self) -> str:
        """Return the name of the data: only what a camera saw is measured."""
        return "measured" if self.known is None else "known"

    @property
    def dropped(self) -> int:
        """Return the number of doubtful points that were left out."""
        return sum(sum(f.dropped.values()) for f in self.fields)

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return the comparison of the field at all pressures; none where nothing is left."""
        test = self.test
        model = self.model
        targets = kept_targets(self.targets, (masks or {}).get(test.name))
        if not targets:
            return ()
        # Blocks: one a direction and pressure.
        blocks = 3 * (len(test.pressures) - len(self.targets) + len(targets))
        weight = weighting.weight / blocks if weighting.relative else 1.0
        scaling = "e" if weighting.relative else test.objective
        with test.place.naming():
            objective = FieldObjective(targets, scaling, weight, test.noise, test.sheet.constant)
        nuisance = bubble_nuisance(test, model, objective, self.registration_estimates)
        if masks and all(target.frame is not None for target in targets):
            # What lies above the last frame that counts strains nothing.
            last_frame = max(test.sheet.since or 0, *(target.frame or 0 for target in targets))
            model = model.until(last_frame)
        # Comparisons of lower stages lead in; a bubble is the last to join.
        return (Comparison(test.name, model, make_solver(), objective, nuisance, stage=2),)

    @cached_property
    def registration_estimates(self) -> Mapping[str, float]:
        """Return what the fields alone say of the frame, where a fit of it begins."""
        is_fitted = self.test.registration and self.known is None
        return self.view.registration_estimates if is_fitted else {}

    @cached_property
    def targets(self) -> list[FieldTarget]:
        """Return the fields to match, frame by frame, on the model's mesh; raises InputError."""
        test = self.test
        mesh = self.model.mesh
        sheet = self.test.sheet
        if test.match_by == "surfaces":
            targets = at_nodes(self.surfaces, mesh)
        elif self.known is not None:
            targets = at_nodes(self.matched, mesh)
        else:
            targets, _ = at_points(test, self.matched, mesh)
        with test.place.naming():
            if sheet.constant or sheet.since is not None:
                targets = with_place_numbers(targets, mesh.points[:, :2])
            if sheet.since is not None:
                targets = counted_from(targets, sheet.since)
        return targets

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the same places on a finer mesh with finer increments, or on a coarser mesh."""
        (comparison,) = self.comparisons(make_solver, weighting)
        if self.by_this_model and factor > 1:
            return (comparison,)
        return (self._refined(comparison, factor),)

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return the comparison of the measured shapes with equilibrium, on few quads.

        A constant field is not taken out.

        Raises
        ------
        InputError
            Displacements count from a pressure, at which the shape is not known; or there are too
            few points.
        """
        test = self.test
        sheet = self.test.sheet
        if sheet.since is not None:
            raise test.place.error("sheet.from_pressure", "leaves the shapes of the sheet unknown")
        (comparison,) = self.comparisons(make_solver, Weighting())
        quad_ratio = MESH_LIMITS.max_quads_of_shape / len(comparison.model.mesh.quads)
        if self.known is None and quad_ratio < 1.0:
            comparison = self._refined(comparison, quad_ratio**0.5)
        objective = comparison.objective
        assert isinstance(objective, FieldObjective)
        nodes = comparison.model.mesh.points[:, :2]
        base = np.zeros((len(test.pressures), len(nodes), 3))
        if self.sheet.rim:
            base = np.array([rim.at(nodes) for rim in self.sheet.rim])
        unit = test.outline.unit(nodes)
        has_offset = test.displacement_offset
        with test.place.naming("data"):
            shape, roots = smoothed(
                comparison.model,
                objective.targets,
                unit,
                base,
                has_offset,
            )
        gaps = GapObjective(shape, roots, objective)
        return (replace(comparison, model=shape, objective=gaps),)

    def _refined(self, comparison: Comparison, factor: float) -> Comparison:
        """Return a comparison of quads and increments divided by a factor, read as the fit reads.

        Raises InputError for a mesh too coarse for a disk, or for the places of the data.
        """
        test = self.test
        model = self._refined_model(comparison.model, factor)
        assert isinstance(comparison.objective, FieldObjective)
        objective = copy.copy(comparison.objective)
        reading = reading_of(test, model.mesh)
        objective.targets = resampled(objective.targets, comparison.model.mesh, reading)
        prolong = partial(prolonged, comparison.model, model) if factor > 1 else None
        return replace(comparison, model=model, objective=objective, prolong=prolong)

    def _refined_model(self, model: BubbleModel, factor: float) -> BubbleModel:
        """Return the model of quads and increments divided by a factor."""
        test = self.test
        finer = test.models(None, "elements", factor)[PART]
        quads = len(finer.mesh.quads) * (4 if test.symmetry == "quarter" else 1)
        fewest = MESH_LIMITS.min_quads
        if quads < fewest and factor < 1:
            problem = f"{quads} quads are too few for a disk, of which {fewest} are the least"
            raise InputError(None, "elements", problem)
        steps = test.models(None, "increments", max(1, round(factor)))[PART].increments
        if factor > 1 and test.sheet.allows_for_shape:
            # Of a sheet that may be slack the fit knows no equilibrium below its first increment.
            first = model.increments[0] * (1 - 1e-12)
            steps = list(dropwhile(lambda pressure: pressure < first, steps))
        finer = replace(finer, increments=steps)
        return with_sheet(finer, test.sheet, test.outline, self.sheet)

    def data_files(self) -> Sequence[DataFile]:
        """Return the files of frames, logs and references that were read."""
        data = self.test.data
        logs = () if data.recorded is None else data.recorded.logs
        if isinstance(data, PointFiles) and data.options.reference:
            logs = (*logs, data.options.reference)
        frames = [
            DataFile(field.path, field.source, len(field.points), field.dropped)
            for field in self.fields
            if field.path is not None
        ]
        if isinstance(data, PointFiles) and data.frames is not None:
            frames = self._data_in_memory(data.frames)
        log_files = [DataFile(log, FrameSource("log"), None) for log in logs]
        return [*joined(frames), *log_files]

    def _data_in_memory(self, arrays: Sequence[Frame]) -> list[DataFile]:
        """Return the arrays of the frames, by the names of their files once they are written."""
        recorded = self.test.data.recorded
        numbers = range(len(arrays)) if recorded is None else recorded.frames or ()
        return [
            DataFile(
                Path(frame_file_name(number)),
                field.source,
                len(field.points),
                field.dropped,
                (arrays[number].points, arrays[number].displacement),
            )
            for number, field in zip(numbers, self.fields, strict=True)
        ]

    @property
    def matched(self) -> Sequence[DisplacementField]:
        """Return the fields as they are matched: at places without load, folded for a quarter."""
        since = self.test.sheet.since
        fields = self.fields if since is None else with_unloaded_positions(self.fields, since)
        return [folded(f) for f in fields] if self.test.symmetry == "quarter" else fields

    @property
    def model(self) -> BubbleModel:
        """Return the model of the sheet as it was, with the unknown shapes at zero."""
        return with_sheet(self.test.model(), self.test.sheet, self.test.outline, self.sheet)

    @property
    def points_beyond(self) -> int:
        """Return the number of measured points beyond the model's rim, which are not matched."""
        if self.test.match_by == "surfaces" or self.known is not None:
            return 0
        mesh = self.test.model().mesh
        _, points_beyond = at_points(self.test, self.matched, mesh)
        return points_beyond

    @property
    def view(self) -> View:
        """Return the fields for a look before a fit."""
        test = self.test
        recorded = test.data.recorded
        return View(
            fields=self.fields[: test.rising],
            outline=test.outline,
            thickness=test.place.fabric.thickness,
            registered=self.registration is not None,
            flat=not test.sheet.allows_for_shape,
            numbers=() if recorded is None else recorded.numbers,
        )

    @property
    def seen(self) -> Sequence[str]:
        """Return what `check` says of several inflations."""
        recorded = self.test.data.recorded
        inflations = None if recorded is None else recorded.inflations
        return () if inflations is None else (inflations.line, *inflations.lines)

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        return () if self.known is not None else doubts_of(self.view, expected)


def kept_targets(
    targets: Sequence[FieldTarget], mask: NDArray[np.bool_] | None
) -> list[FieldTarget]:
    """Return the points of all targets that a mask leaves, with the frame of each."""
    if mask is None:
        return list(targets)
    ends = np.cumsum([len(target.displacement) for target in targets])[:-1]
    kept_parts = []
    for k, (target, mask_of_target) in enumerate(zip(targets, np.split(mask, ends), strict=True)):
        if not mask_of_target.any():
            continue
        frame = k if target.frame is None else target.frame
        if target.sample is None and not mask_of_target.all():
            identity = scipy.sparse.identity(len(mask_of_target), format="csr")
            target = replace(target, sample=identity)
        kept_parts.append(replace(target.subset(mask_of_target), frame=frame))
    return kept_parts


def prepare(test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedBubble:
    """Read or compute the data of a test.

    Parameters
    ----------
    test : BubbleTest
    law : HypoelasticLaw
        That of the fit, without its coefficients.
    make_solver : callable
        Makes the solver of the fit, or one of a name.

    Raises
    ------
    InputError
        The data cannot be read, or do not go with the test or the law.
    SolverFailure
        A known solution cannot be computed.
    """
    if test.rising < len(test.pressures) and law.memory is None:
        problem = "'all' needs a law with a memory: say [law.memory] warp = 'fitted' and fill"
        raise test.place.error("inflation", problem)
    law_of_data = None
    registration = None
    by_this_model = False
    if isinstance(test.data, KnownSolution):
        fields, law_of_data, by_this_model = _computed(test, test.data, law, make_solver)
    else:
        fields, registration = read_measured(test)
    surfaces = _surfaces(test, fields, computed=law_of_data is not None)
    prepared = PreparedBubble(test, fields, surfaces, law_of_data, registration, by_this_model)
    with test.place.naming():
        sheet = measured_sheet(test.sheet, test.outline, prepared.matched)
    return replace(prepared, sheet=sheet)


def _computed(
    test: BubbleTest, data: KnownSolution, law: HypoelasticLaw, make_solver: MakeSolver
) -> tuple[tuple[DisplacementField, ...], HypoelasticLaw, bool]:
    """Return fields, their law, and whether mesh, increments and solver are those of the fit."""
    field = "data.known_solution"
    with test.place.naming(field):
        form = form_named(data.form, {}, law.strain_range.tolist())
        exact = HypoelasticLaw(data.beta, law.nu12, law.strain_range, law.thickness_change, form)
    with test.place.naming(field=f"{field}.solver"):
        solver = make_solver() if data.solver is None else make_solver(data.solver)
    if data.symmetry == "quarter" and test.symmetry == "full":
        problem = "data of a quarter cannot be matched by a full model; use the same symmetry"
        raise test.place.error(f"{field}.symmetry", problem)
    source = test.model(elements=data.elements, symmetry=data.symmetry, increments=data.increments)
    try:
        history = solver.run(source, exact)
    except SolverFailure as failure:
        reason = f"the known solution cannot be run: {failure.reason}"
        where = failure.solver, failure.exit_number, failure.log_tail, failure.scratch
        raise SolverFailure(reason, *where) from None
    fields = tuple(
        DisplacementField(p, source.mesh.points[:, :2], u)
        for p, u in zip(test.pressures, np.asarray(history.displacement), strict=True)
    )
    is_solver_of_fit = data.solver is None or solver.identity == make_solver().identity
    return fields, exact, is_solver_of_fit and _same_steps_and_mesh(test, data)


def _same_steps_and_mesh(test: BubbleTest, data: KnownSolution) -> bool:
    """Return whether the data are of the fit's increments and mesh, whole or folded."""
    fitted = np.array(test.increments)
    computed = np.array(data.increments)
    if fitted.shape != computed.shape or not np.allclose(computed, fitted, rtol=1e-9, atol=0.0):
        return False
    nodes = test.model().mesh.points
    nodes_of_data = test.model(elements=data.elements).mesh.points
    return nodes.shape == nodes_of_data.shape and np.allclose(nodes, nodes_of_data)


def _surfaces(
    test: BubbleTest, fields: Sequence[DisplacementField], computed: bool
) -> tuple[DisplacementSurface, ...]:
    """Fit surfaces to every field; too few points leave them out where they are only reported."""
    # A computed quarter is mirrored: surfaces are fitted to the full disk.
    full_disks = [mirrored(field) if computed else field for field in fields]
    fewest_points = min(len(field.points) for field in full_disks)
    if fewest_points < (test.match_degree + 1) ** 2 and test.match_by == "points":
        return ()
    try:
        return tuple(fit_surface(field, test.match_degree) for field in full_disks)
    except InputError as error:
        raise test.place.error("match.degree", f"{error.field}: {error.problem}") from None


def read_measured(
    test: BubbleTest,
) -> tuple[tuple[DisplacementField, ...], CameraRegistration | None]:
    """Read the fields of measured files, and register them where the section asks for it."""
    data = test.data
    assert isinstance(data, PointFiles)
    fields = measured_fields(test.place, data, test.pressures)
    if test.of_clamp:
        words = (
            f"the radius, {test.outline.radius:.4g} mm, is of the clamp, whose points stand still"
        )
        source = replace(fields[0].source, notes=(*fields[0].source.notes, words))
        fields = (replace(fields[0], source=source), *fields[1:])
    if data.registration is None:
        return fields, None
    order = np.argsort([field.pressure for field in fields], kind="stable")
    with test.place.naming("data.points.registration"):
        rising = [fields[k] for k in order]
        registered, registration = register_fields(rising, test.outline, data.registration)
    return tuple(registered[k] for k in np.argsort(order)), registration
