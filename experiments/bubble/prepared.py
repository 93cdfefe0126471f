"""A bubble test prepared with its data (measured or computed), which makes the fit's comparison."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import dropwhile
from pathlib import Path
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError, SolverFailure
from ...inference.comparison import Comparison
from ...inference.objective import Objective
from ...inference.virtual_work import GapObjective, smoothed
from ...materials.forms.base import form_named
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import BubbleModel
from ...readers.fields import DisplacementField, DisplacementSurface, fit_surface
from ...readers.frames import Frame, FrameSource, frame_file_name
from ..base import Alternative, BasePrepared, MakeSolver, Masks, Reach, Weighting
from ..cap import CapEstimate, cap_estimate
from ..data_files import DataFile, joined
from ..doubts import Doubt, Expected
from . import PART, BubbleTest, KnownSolution, measured_fields
from .doubts import doubts_of
from .field_shape import folded, mirrored
from .frame_doubts import loaded_alternative
from .measured_view import MeasuredView
from .nuisance import SheetErrors, bubble_nuisance
from .objective import FieldObjective
from .point_files import PointFiles
from .registration import CameraRegistration, register_fields
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
    prolonged,
    reading_of,
    resampled,
    with_place_numbers,
    with_unloaded_positions,
)

#: Objectives in words; sums are over pressures and components of the displacement, and errors are
#: relative to the largest measured displacement of each.
OBJECTIVES = {"e": "sum of relative RMS errors", "mm": "sum of RMS errors, mm"}

NO_SCALE = (
    "the radius is that of the clamp by the camera's scale alone: give nominal_radius, by a ruler, "
    "so that a wrong scale is noticed"
)


@dataclass(frozen=True)
class MeshLimits:
    """Limits of the numbers of quads of meshes other than the one that is fitted."""

    min_quads: int = 48  # of the full disk: fewer do not follow its rim
    #: Of the shape smoothed for the estimate by virtual work: measured fields resolve no more.
    max_quads_of_shape: int = 150


MESH_LIMITS = MeshLimits()


class PreparedInflation(BasePrepared):
    """Base class of prepared bubbles: the model of the test, and finer ones.

    Attributes
    ----------
    test : BubbleTest
    sheet : MeasuredSheet
        What was measured of the sheet's shape before the test, and of its rim.
    by_this_model : bool
        Whether the data were computed with the mesh, the increments and the solver of the fit.
    """

    test: BubbleTest
    sheet: MeasuredSheet
    by_this_model: bool = False

    def reach(self, masks: Masks) -> Reach:
        """Return the reach of the test, which is unknown: strain is not known without the law."""
        return self.test.reach

    @property
    def model(self) -> BubbleModel:
        """Return the model with the measured shape of the sheet, and unknown shapes at zero."""
        return with_sheet(self.test.model(), self.test.sheet, self.test.outline, self.sheet)

    def refined_model(self, model: BubbleModel, factor: float) -> BubbleModel:
        """Return the model with edges of quads, and increments, divided by a factor.

        A factor above 1 makes the mesh finer, below 1 coarser; increments are never made fewer.
        Raise InputError for a mesh that is too coarse for a disk.
        """
        test = self.test
        finer = test.models(None, "elements", factor)[PART]
        quads = len(finer.mesh.quads) * (4 if test.symmetry == "quarter" else 1)
        fewest = MESH_LIMITS.min_quads
        if quads < fewest and factor < 1:
            problem = f"{quads} quads are too few for a disk, of which {fewest} are the least"
            raise InputError(None, "elements", problem)
        steps = test.models(None, "increments", max(1, round(factor)))[PART].increments
        if factor > 1 and test.sheet.allows_for_shape:
            # A sheet that may be slack has no known equilibrium below the fit's first increment.
            first = model.increments[0] * (1 - 1e-12)
            steps = list(dropwhile(lambda pressure: pressure < first, steps))
        finer = replace(finer, increments=steps)
        return with_sheet(finer, test.sheet, test.outline, self.sheet)

    def refined(self, comparison: Comparison, factor: float) -> Comparison:
        """Return a comparison with quads and increments divided by a factor, at the same places.

        Raise InputError for a mesh that is too coarse for a disk or for the places of the data.
        """
        model = self.refined_model(comparison.model, factor)
        prolong = partial(prolonged, comparison.model, model) if factor > 1 else None
        objective = self.objective_on(model, comparison)
        return replace(comparison, model=model, objective=objective, prolong=prolong)

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the comparison at the same places with a finer model, or with a coarser mesh."""
        (comparison,) = self.comparisons(make_solver, weighting)
        if self.by_this_model and factor > 1:
            return (comparison,)
        return (self.refined(comparison, factor),)

    def objective_on(self, model: BubbleModel, comparison: Comparison) -> Objective:
        """Return the objective of a comparison with its data read on the mesh of another model."""
        raise NotImplementedError(f"{type(self).__name__} needs objective_on(model, comparison)")


@dataclass(frozen=True, eq=False)
class PreparedBubble(PreparedInflation):
    """A bubble test with its displacement fields.

    Attributes
    ----------
    test : BubbleTest
    fields : tuple of DisplacementField
        The fields at the test's pressures as they were measured (and registered) or computed.
    surfaces : tuple of DisplacementSurface
        Polynomials through the fields; empty where there are too few points.
    known : HypoelasticLaw or None
        The law with which data were computed; None where they are measured.
    registration : CameraRegistration or None
        How the fields were transformed to the test's coordinates; None where the files are in them.
    by_this_model : bool
        Whether the data were computed with the mesh, the increments and the solver of the fit.
    sheet : MeasuredSheet
        What was measured of the sheet's shape before the test, and of its rim.
    """

    test: BubbleTest
    fields: tuple[DisplacementField, ...]
    surfaces: tuple[DisplacementSurface, ...]
    known: HypoelasticLaw | None = None
    registration: CameraRegistration | None = None
    by_this_model: bool = False
    sheet: MeasuredSheet = FLAT
    specimens: ClassVar[Mapping[str, Sequence[int]]] = {}  # a bubble is one

    @property
    def objective_is(self) -> str:
        """Say in words what the objective compares, and whether the sheet has unknowns."""
        objective = OBJECTIVES[self.test.objective]
        if self.test.sheet.has_unknowns:
            return f"{objective}, and what is known of the sheet"
        return objective

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the masks that leave out each frame; none where a constant field is taken out."""
        targets = self.targets
        if self.test.sheet.constant or len(targets) < 2:
            return {}
        counts = [len(target.displacement) for target in targets]
        frame_of_place = np.repeat(np.arange(len(targets)), counts)
        names = [f"{1e3 * target.pressure:.5g} kPa" for target in targets]
        if len(set(names)) < len(names):
            names = [f"{name} (frame {k + 1})" for k, name in enumerate(names)]
        masks: dict[str, Masks] = {
            name: {self.test.name: frame_of_place != k} for k, name in enumerate(names)
        }
        return {"frames": masks}

    @property
    def source(self) -> str:
        """Return "measured" for data of a camera, "known" for data computed with a known law."""
        return "measured" if self.known is None else "known"

    @property
    def dropped_count(self) -> int:
        """Return the number of points that were left out when the files were read."""
        return sum(sum(f.dropped.values()) for f in self.fields)

    def comparisons(
        self, make_solver: MakeSolver, weighting: Weighting, masks: Masks | None = None
    ) -> tuple[Comparison, ...]:
        """Return the one comparison of the fields at all pressures; none if masks keep no point."""
        test = self.test
        model = self.model
        targets = masked_targets(self.targets, (masks or {}).get(test.name))
        if not targets:
            return ()
        # Blocks: one a direction and pressure.
        blocks = 3 * (len(test.pressures) - len(self.targets) + len(targets))
        weight = weighting.of_block(blocks)
        scaling = "e" if weighting.relative else test.objective
        with test.place.errors_name():
            objective = FieldObjective(targets, scaling, weight, test.noise, test.sheet.constant)
        nuisance = bubble_nuisance(test, model, objective, self.registration_estimates)
        if masks and all(target.frame is not None for target in targets):
            # The model need not be run beyond the last frame that is matched.
            last_frame = max(
                test.sheet.reference_frame or 0, *(target.frame or 0 for target in targets)
            )
            model = model.up_to_frame(last_frame)
        # Comparisons of lower stages lead in; a bubble is the last to join.
        return (
            Comparison(
                test.name,
                model,
                make_solver(),
                objective,
                nuisance,
                stage=2,
                shared_errors=self.shared_errors,
            ),
        )

    @property
    def shared_errors(self) -> SheetErrors | None:
        """Return the errors of what was measured of the sheet and of its place, if anything was."""
        sheet = self.test.sheet
        is_measured = self.sheet.surface is not None or bool(self.sheet.rim)
        is_counted = sheet.reference_frame is not None
        if not (is_measured or is_counted or self.registration is not None):
            return None
        return SheetErrors(self.test, self.sheet, self.registration)

    @cached_property
    def registration_estimates(self) -> Mapping[str, float]:
        """Return misalignments estimated from the fields, at which a fit of them starts.

        It is empty where the registration is not fitted.
        """
        is_fitted = self.test.registration and self.known is None
        return self.view.registration_estimates if is_fitted else {}

    @cached_property
    def targets(self) -> list[FieldTarget]:
        """Return the fields to match, one target for each frame, with sampling on the model's mesh.

        Raise InputError where the data do not go with the test.
        """
        test = self.test
        mesh = self.model.mesh
        sheet = self.test.sheet
        if test.match_by == "surfaces":
            targets = at_nodes(self.surfaces, mesh)
        elif self.known is not None:
            targets = at_nodes(self.fields_to_match, mesh)
        else:
            targets, _ = at_points(test, self.fields_to_match, mesh)
        with test.place.errors_name():
            if sheet.constant or sheet.reference_frame is not None:
                targets = with_place_numbers(targets, mesh.points[:, :2])
            if sheet.reference_frame is not None:
                targets = counted_from(targets, sheet.reference_frame)
        return targets

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return the comparison that checks the measured shapes for equilibrium by virtual work.

        The shapes are smoothed on a mesh of few quads. A constant field is not taken out.

        Raises
        ------
        InputError
            Displacements count from a pressure, at which the shape is not known; or there are too
            few points.
        """
        test = self.test
        sheet = self.test.sheet
        if sheet.reference_frame is not None:
            raise test.place.error("sheet.from_pressure", "leaves the shapes of the sheet unknown")
        (comparison,) = self.comparisons(make_solver, Weighting())
        quad_ratio = MESH_LIMITS.max_quads_of_shape / len(comparison.model.mesh.quads)
        if self.known is None and quad_ratio < 1.0:
            comparison = self.refined(comparison, quad_ratio**0.5)
        objective = comparison.objective
        assert isinstance(objective, FieldObjective)
        nodes = comparison.model.mesh.points[:, :2]
        rim_motion = np.zeros((len(test.pressures), len(nodes), 3))
        if self.sheet.rim:
            rim_motion = np.array([rim.values_at(nodes) for rim in self.sheet.rim])
        with test.place.errors_name("data"):
            shape, roots = smoothed(
                comparison.model,
                objective.targets,
                disk_positions=test.outline.unit(nodes),
                rim_motion=rim_motion,
                has_shift=test.displacement_offset,
            )
        gaps = GapObjective(shape, roots, objective)
        return (replace(comparison, model=shape, objective=gaps),)

    def objective_on(self, model: BubbleModel, comparison: Comparison) -> Objective:
        assert isinstance(comparison.objective, FieldObjective)
        objective = copy.copy(comparison.objective)
        reading = reading_of(self.test, model.mesh)
        objective.targets = resampled(objective.targets, comparison.model.mesh, reading)
        return objective

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
        """Return the frames in memory as data files, with the names that their files will get."""
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

    @cached_property
    def outlying_points(self) -> Sequence[NDArray[np.bool_]]:
        """Return which points of each field lie far off all others and are not matched."""
        if self.known is not None:
            return [np.zeros(len(field.points), dtype=bool) for field in self.fields]
        view = self.view
        return [view.outlying_points(field) for field in self.fields]

    @property
    def fields_to_match(self) -> Sequence[DisplacementField]:
        """Return the fields that the model is to match, folded for a model of a quarter.

        Points far off all others are left out. Where the reference of the images is a loaded frame,
        the positions of the points in the unloaded sheet are estimated (`with_unloaded_positions`).
        """
        fields = [
            field if not is_outlying.any() else field.subset(~is_outlying)
            for field, is_outlying in zip(self.fields, self.outlying_points, strict=True)
        ]
        reference_frame = self.test.sheet.reference_frame
        if reference_frame is not None:
            fields = with_unloaded_positions(fields, reference_frame)
        return [folded(f) for f in fields] if self.test.symmetry == "quarter" else fields

    @property
    def points_beyond(self) -> int:
        """Return the number of measured points beyond the model's rim, which are not matched."""
        if self.test.match_by == "surfaces" or self.known is not None:
            return 0
        mesh = self.test.model().mesh
        _, points_beyond = at_points(self.test, self.fields_to_match, mesh)
        return points_beyond

    @cached_property
    def view(self) -> MeasuredView:
        """Return the measured fields, up to the first fall of the pressure, for checks of them."""
        test = self.test
        recorded = test.data.recorded
        return MeasuredView(
            fields=self.fields[: test.rising],
            outline=test.outline,
            thickness=test.place.fabric.thickness,
            is_registered=self.registration is not None,
            is_flat=not test.sheet.allows_for_shape,
            number_doubts=() if recorded is None else recorded.number_doubts,
            log_doubts=() if recorded is None else recorded.log_doubts,
            nominal_radius=test.nominal_radius,
            counts_from_pressure=test.sheet.reference_frame is not None,
            moving_rim=test.sheet.moving_rim,
        )

    def closed_form(self, law: HypoelasticLaw) -> CapEstimate | None:
        """Return the estimate by rises of the centre; None where they count from a pressure.

        It is also None for a sheet clamped under tension, and where no rise is positive.
        """
        test = self.test
        return closed_form_of(test, test.pressures[: test.rising], self.view.rises, law)

    def alternative(self, nuisance: Mapping[str, float]) -> Alternative | None:
        """Return a reference picture under pressure, where the sheet makes it likely, or None."""
        return loaded_alternative(self, nuisance)

    @property
    def seen(self) -> Sequence[str]:
        """Return the lines that `bubblefit check` prints on several inflations and on the scale."""
        recorded = self.test.data.recorded
        inflations = None if recorded is None else recorded.inflations
        lines = () if inflations is None else (inflations.line, *inflations.lines)
        has_scale = not self.test.of_clamp or self.test.nominal_radius is not None
        return lines if has_scale else (*lines, NO_SCALE)

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        return () if self.known is not None else doubts_of(self.view.expecting(expected))


def masked_targets(
    targets: Sequence[FieldTarget], mask: NDArray[np.bool_] | None
) -> list[FieldTarget]:
    """Return the targets with only the points that a mask keeps, each with its frame's number.

    Parameters
    ----------
    mask : (points of all targets,) array of bool or None
        Target after target; None keeps all. A target without points is left out.
    """
    if mask is None:
        return list(targets)
    ends = np.cumsum([len(target.displacement) for target in targets])[:-1]
    masked = []
    for k, (target, mask_of_target) in enumerate(zip(targets, np.split(mask, ends), strict=True)):
        if not mask_of_target.any():
            continue
        frame = k if target.frame is None else target.frame
        if target.sample is None and not mask_of_target.all():
            # The places are all nodes: without some of them the nodes are sampled.
            identity = scipy.sparse.identity(len(mask_of_target), format="csr")
            target = replace(target, sample=identity)
        masked.append(replace(target.subset(mask_of_target), frame=frame))
    return masked


def prepare(test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedBubble:
    """Read or compute the data of a bubble test.

    Parameters
    ----------
    test : BubbleTest
    law : HypoelasticLaw
        The law of the fit; its coefficients are not used.
    make_solver : callable
        Makes the solver of the fit, or, with a name, another.

    Returns
    -------
    PreparedBubble

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
    prepared = PreparedBubble(
        test,
        fields,
        surfaces,
        law_of_data,
        registration,
        by_this_model,
    )
    with test.place.errors_name():
        sheet = measured_sheet(test.sheet, test.outline, prepared.fields_to_match)
    object.__setattr__(prepared, "sheet", sheet)  # which keeps the outlying points that are known
    return prepared


def _computed(
    test: BubbleTest,
    data: KnownSolution,
    law: HypoelasticLaw,
    make_solver: MakeSolver,
) -> tuple[tuple[DisplacementField, ...], HypoelasticLaw, bool]:
    """Compute the data of a known solution.

    Return the fields, one for each pressure, the law that they were computed with, and whether
    mesh, increments and solver are those of the fit, so that data and model have the same errors.
    Raise SolverFailure if the model cannot be run.
    """
    key = "data.known_solution"
    with test.place.errors_name(key):
        form = form_named(data.form, {}, law.strain_range.tolist())
        exact = HypoelasticLaw(data.beta, law.nu12, law.strain_range, law.thickness_change, form)
    with test.place.errors_name(field=f"{key}.solver"):
        solver = make_solver() if data.solver is None else make_solver(data.solver)
    if data.symmetry == "quarter" and test.symmetry == "full":
        problem = "data of a quarter cannot be matched by a full model; use the same symmetry"
        raise test.place.error(f"{key}.symmetry", problem)
    model = test.model(elements=data.elements, symmetry=data.symmetry, increments=data.increments)
    try:
        history = solver.run(model, exact)
    except SolverFailure as failure:
        reason = f"the known solution cannot be run: {failure.reason}"
        where = failure.solver, failure.exit_number, failure.log_tail, failure.scratch
        raise SolverFailure(reason, *where) from None
    fields = tuple(
        DisplacementField(pressure, model.mesh.points[:, :2], displacement)
        for pressure, displacement in zip(test.pressures, history.displacement, strict=True)
    )
    is_solver_of_fit = data.solver is None or solver.identity == make_solver().identity
    return fields, exact, is_solver_of_fit and _same_steps_and_mesh(test, data)


def _same_steps_and_mesh(test: BubbleTest, data: KnownSolution) -> bool:
    """Return whether data are computed with the fit's increments and mesh (full or a quarter)."""
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
    """Fit a polynomial surface to every field.

    Return none where there are too few points, unless the fit matches surfaces: then raise
    InputError.
    """
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
    """Read the measured fields, and register them where the section asks for it.

    Return the fields at the test's pressures, and the registration or None.
    """
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
    with test.place.errors_name("data.points.registration"):
        rising = [fields[k] for k in order]
        registered, registration = register_fields(rising, test.outline, data.registration)
    return tuple(registered[k] for k in np.argsort(order)), registration


def closed_form_of(
    test: BubbleTest, pressures: ArrayLike, rises: ArrayLike, law: HypoelasticLaw
) -> CapEstimate | None:
    """Return the estimate by pressures (n,), MPa, and rises (n,), mm, of the centre of a test.

    It is None where rises count from a pressure, under tension, and where no rise is positive.
    """
    sheet = test.sheet
    if sheet.reference_frame is not None or sheet.clamped_under_tension:
        return None
    with suppress(InputError):
        return cap_estimate(
            pressures,
            rises,
            test.outline.dome_radius,
            test.place.fabric.thickness,
            law.nu12,
            law.thickness_change,
        )
    return None
