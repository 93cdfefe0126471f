"""A bubble test with its data, measured or computed, and the comparisons of a fit with it."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import dropwhile
from typing import ClassVar

import numpy as np
import scipy
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...inference.comparison import Comparison, Nuisance
from ...inference.virtual_work import GapObjective, smoothed
from ...materials.forms.base import form_named
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import TURN, BubbleModel, default_increments
from ...meshes.disk import Outline
from ...meshes.mesh import FacetReading, Mesh, SmoothReading
from ...readers.fields import DisplacementField, DisplacementSurface, fit_surface
from ...readers.frames import FrameSource
from .. import kinds
from ..kinds import Array, Doubt, Expected, MakeSolver, Masks, Planning, Precision, Weighting
from . import objective as matching
from .doubts import View, doubts_of
from .objective import FieldObjective, FieldTarget, folded, mirrored
from .point_files import PointFiles
from .registration import Registration, register_fields
from .section import Sheet
from .sheet import (
    FLAT,
    MOST_SIGMAS,
    MeasuredSheet,
    measured_sheet,
    prior_weight,
    sheet_nuisance,
    with_sheet,
)
from .test import PART, BubbleTest, KnownSolution, measured_fields

#: Over pressures and directions; relative to the largest measured displacement of each.
OBJECTIVES = {"e": "sum of relative RMS errors", "mm": "sum of RMS errors, mm"}
#: Comparisons of lower stages lead in; a bubble is the last to join.
STAGE = 2
#: mm and kPa; a pressure offset leaves the first pressure positive.
MOST_SHIFT, MOST_PRESSURE, LEAST_SHARE = 20.0, 50.0, -0.9
PRESSURE = "pressure_offset"
#: Degrees: beyond, a sheet of swapped moduli comes near.
MOST_TURN = 30.0
#: Quads of the full disk: with fewer it is no disk any more.
LEAST_QUADS = 48
#: Quads on which a smoothed shape is balanced, at most: measured fields know no more.
SHAPED = 150
#: A place between the polygons of two rims is looked for so much nearer to the centre, in turn.
INWARD = (1.0, 1 - 1e-4, 1 - 1e-3, 1 - 1e-2, 0.95, 0.9)


@dataclass(frozen=True, eq=False)
class PreparedBubble:
    """The test, its fields as read (or computed), and polynomial surfaces of them.
    known : the law behind computed data. registration : None where the files were in the test's
    coordinates. by_this_model : the data were computed with the mesh, the increments and the solver
    of the fit. sheet : surface and rim as measured."""

    test: BubbleTest
    fields: tuple[DisplacementField, ...]
    surfaces: tuple[DisplacementSurface, ...]
    known: HypoelasticLaw | None
    registration: Registration | None = None
    by_this_model: bool = False
    sheet: MeasuredSheet = FLAT
    specimens: ClassVar[Mapping[str, Sequence[int]]] = {}  # a bubble is one

    @property
    def objective_is(self) -> str:
        own = OBJECTIVES[self.test.objective]
        unknown = self.test.sheet.unknown
        return f"{own}, and what is known of the sheet" if unknown else own

    @property
    def parts(self) -> Mapping[str, Mapping[str, Masks]]:
        """Return the points kept without each frame; none beside a constant field."""
        targets = self.targets
        if self.test.sheet.constant or len(targets) < 2:
            return {}
        frame = np.repeat(np.arange(len(targets)), [len(t.displacement) for t in targets])
        names = [f"{1e3 * target.pressure:.5g} kPa" for target in targets]
        if len(set(names)) < len(names):
            names = [f"{name} (frame {k + 1})" for k, name in enumerate(names)]
        return {"frames": {name: {self.test.name: frame != k} for k, name in enumerate(names)}}

    def reach(self, masks: Masks) -> kinds.Reach:
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
        sheet = self.test.sheet
        whole = self.targets
        targets = kept_targets(whole, (masks or {}).get(test.name))
        if not targets:
            return ()
        # Blocks: one a direction and pressure.
        blocks = 3 * (len(test.pressures) - len(whole) + len(targets))
        weight = weighting.weight / blocks if weighting.relative else 1.0
        kind = "e" if weighting.relative else test.objective
        with test.place.naming():
            objective = FieldObjective(targets, kind, weight, test.noise, sheet.constant)
        nuisance: list[Nuisance] = []
        if test.displacement_offset:
            ends = -MOST_SHIFT, MOST_SHIFT
            nuisance += [Nuisance(name, *ends, "mm", None, 1.0) for name in matching.OFFSETS]
        if test.pressure_offset:
            least = LEAST_SHARE * 1e3 * min(test.increments)
            unknown = Nuisance(PRESSURE, least, MOST_PRESSURE, "kPa", "pressure_offset", 1e-3)
            nuisance.append(unknown)
        nuisance += sheet_nuisance(sheet, model, objective.scale)
        nuisance += registration_nuisance(test, objective, self.frame_found)
        if masks and all(target.frame is not None for target in targets):
            # What lies above the last frame that counts strains nothing.
            last = max(sheet.since or 0, *(target.frame or 0 for target in targets))
            model = model.until(last)
        return (Comparison(test.name, model, make_solver(), objective, tuple(nuisance), STAGE),)

    @cached_property
    def frame_found(self) -> Mapping[str, float]:
        """Return what the fields alone say of the frame, where a fit of it begins."""
        wanted = self.test.registration and self.known is None
        return self.view.frame_found if wanted else {}

    @cached_property
    def targets(self) -> list[FieldTarget]:
        """Return the fields to match, frame by frame, on the model's mesh; raises InputError."""
        test = self.test
        mesh = self.model.mesh
        sheet = self.test.sheet
        if test.match_by == "surfaces":
            targets = matching.at_nodes(self.surfaces, mesh)
        elif self.known is not None:
            targets = matching.at_nodes(self.matched, mesh)
        else:
            targets, _ = matching.at_points(test, self.matched, mesh)
        with test.place.naming():
            if sheet.constant or sheet.since is not None:
                targets = matching.with_places(targets, mesh.points[:, :2])
            if sheet.since is not None:
                targets = matching.counted_from(targets, sheet.since)
        return targets

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Return the same places on a finer mesh with finer increments, or on a coarser mesh."""
        (own,) = self.comparisons(make_solver, weighting)
        return (own if self.by_this_model and factor > 1 else self._refined(own, factor),)

    def virtual_work(self, make_solver: MakeSolver) -> tuple[Comparison, ...]:
        """Return the comparison of the measured shapes with equilibrium, on few quads.
        A constant field is not taken out. InputError for displacements that count from a pressure,
        at which the shape is not known; for too few points."""
        test = self.test
        sheet = self.test.sheet
        if sheet.since is not None:
            raise test.place.error("sheet.from_pressure", "leaves the shapes of the sheet unknown")
        (own,) = self.comparisons(make_solver, Weighting())
        if self.known is None and len(own.model.mesh.quads) > SHAPED:
            own = self._refined(own, (SHAPED / len(own.model.mesh.quads)) ** 0.5)
        assert isinstance(own.objective, FieldObjective)
        nodes = own.model.mesh.points[:, :2]
        base = np.zeros((len(test.pressures), len(nodes), 3))
        if self.sheet.rim:
            base = np.array([rim.at(nodes) for rim in self.sheet.rim])
        unit = test.outline.unit(nodes)
        shifted = test.displacement_offset
        with test.place.naming("data"):
            shape, roots = smoothed(own.model, own.objective.targets, unit, base, shifted)
        return (replace(own, model=shape, objective=GapObjective(shape, roots, own.objective)),)

    def _refined(self, own: Comparison, factor: float) -> Comparison:
        """Return a comparison of quads and increments divided by a factor, read as the fit reads.
        Raises InputError for a mesh too coarse for a disk, or for the places of the data."""
        test = self.test
        finer = test.models(None, "elements", factor)[PART]
        whole = len(finer.mesh.quads) * (4 if test.symmetry == "quarter" else 1)
        if whole < LEAST_QUADS and factor < 1:
            problem = f"{whole} quads are too few for a disk, of which {LEAST_QUADS} are the least"
            raise InputError(None, "elements", problem)
        steps = test.models(None, "increments", max(1, round(factor)))[PART].increments
        if factor > 1 and test.sheet.known:
            # Of a sheet that may be slack the fit knows no equilibrium below its first increment.
            first = own.model.increments[0] * (1 - 1e-12)
            steps = list(dropwhile(lambda p: p < first, steps))
        model = with_sheet(replace(finer, increments=steps), test.sheet, test.outline, self.sheet)
        assert isinstance(own.objective, FieldObjective)
        moved = copy.copy(own.objective)
        reading = matching.reading_of(test, model.mesh)
        moved.targets = resampled(own.objective.targets, own.model.mesh, reading)
        prolong = partial(_prolonged, own.model, model) if factor > 1 else None
        return replace(own, model=model, objective=moved, prolong=prolong)

    def data_files(self) -> Sequence[kinds.DataFile]:
        data = self.test.data
        logs = () if data.recorded is None else data.recorded.logs
        if isinstance(data, PointFiles) and data.options.reference:
            logs = (*logs, data.options.reference)
        read = [(field.path, field) for field in self.fields if field.path is not None]
        frames = [kinds.DataFile(path, f.source, len(f.points), f.dropped) for path, f in read]
        others = [kinds.DataFile(log, FrameSource("log"), None) for log in logs]
        return [*kinds.joined(frames), *others]

    @property
    def matched(self) -> Sequence[DisplacementField]:
        """Return the fields as they are matched: at places without load, folded for a quarter."""
        since = self.test.sheet.since
        fields = self.fields if since is None else matching.at_rest(self.fields, since)
        return [folded(f) for f in fields] if self.test.symmetry == "quarter" else fields

    @property
    def model(self) -> BubbleModel:
        """Return the model of the sheet as it was, with the unknown shapes at zero."""
        return with_sheet(self.test.model(), self.test.sheet, self.test.outline, self.sheet)

    @property
    def outside(self) -> int:
        """Return the number of measured points beyond the model's rim, which are not matched."""
        if self.test.match_by == "surfaces" or self.known is not None:
            return 0
        return matching.at_points(self.test, self.matched, self.test.model().mesh)[1]

    @property
    def view(self) -> View:
        """Return the fields for a look before a fit."""
        test = self.test
        registered = self.registration is not None
        flat = not test.sheet.known
        numbers = () if test.data.recorded is None else test.data.recorded.numbers
        thick = test.place.fabric.thickness
        fields = self.fields[: test.rising]
        return View(fields, test.outline, thick, registered, flat, numbers)

    @property
    def seen(self) -> Sequence[str]:
        """Return what `check` says of several inflations."""
        found = self.test.data.recorded and self.test.data.recorded.inflations
        return (found.line, *found.lines) if found else ()

    def doubts(self, expected: Expected) -> Sequence[Doubt]:
        return () if self.known is not None else doubts_of(self.view, expected)


def registration_nuisance(
    test: BubbleTest, objective: FieldObjective, begin: Mapping[str, float]
) -> list[Nuisance]:
    """Return the unknowns of the registration: the yarns' angle, which is the model's, and places.
    begin : where a fit of each begins, by name, if within its bounds. Their priors weigh as the
    noise does: the field's symmetry tells far more."""
    found = list[Nuisance]()
    weight = prior_weight(objective.least_noise, objective.scale)
    for name, prior in test.registration.items():
        most = MOST_SIGMAS * prior
        unit = "mm" if name == "shift" else "deg"
        of_model: tuple[str | None, float] = (None, 1.0)
        if name == TURN:
            most = min(most, MOST_TURN)
            of_model = (TURN, float(np.pi / 180))
        own = (one for one in (TURN, *matching.PLACED) if one.startswith(name))
        found += [Nuisance(one, -most, most, unit, *of_model, prior, weight) for one in own]
    return [
        replace(one, begin=begin[one.name]) if abs(begin.get(one.name, np.inf)) < one.upper else one
        for one in found
    ]


def resampled(
    targets: tuple[FieldTarget, ...], own: Mesh, reading: SmoothReading | FacetReading
) -> tuple[FieldTarget, ...]:
    """Return the targets of a mesh at the same places of another, by its reading."""
    moved = []
    before = None
    sample = None
    for target in targets:
        rest = target.at(own.points)[:, :2] if target.at_rest is None else target.at_rest
        places = np.ascontiguousarray(rest)
        # Frames of one camera mostly have the same places.
        if before is None or not np.array_equal(before, places):
            before = places
            sample = _sample(reading, places)
        moved.append(replace(target, sample=sample))
    return tuple(moved)


def _prolonged(own: BubbleModel, finer: BubbleModel, path: Array) -> Array:
    """Return starts of every increment of a finer model from a path (steps, nodes, 3).
    Displacements are straight in the cube root of the pressure, also below the first one: a slack
    sheet has moved far there, and has folds that a finer mesh does not find from above."""
    sample = _sample(SmoothReading.of(own.mesh), finer.mesh.points[:, :2])
    known, levels = (np.cbrt(np.array(model.increments)) for model in (own, finer))
    if own.unloaded:  # along the way of the roots, up and down
        known, levels = (np.cumsum(np.abs(np.diff(x, prepend=0.0))) for x in (known, levels))
    order = np.argsort(known)
    known = known[order]
    moved = path[order]
    if len(known) == 1:
        known = np.append(0.0, known)
        moved = np.concatenate([0.0 * moved, moved])
    starts = np.empty((len(finer.increments), *finer.mesh.points.shape))
    for start, level in zip(starts, levels, strict=True):
        after = min(max(int(np.searchsorted(known, level)), 1), len(known) - 1)
        share = (level - known[after - 1]) / (known[after] - known[after - 1])
        start[:] = sample @ ((1.0 - share) * moved[after - 1] + share * moved[after])
        start.reshape(-1)[finer.fixed] = 0.0
    return starts


def _sample(reading: SmoothReading | FacetReading, places: Array) -> scipy.sparse.csr_matrix:
    at = places.copy()
    inside = np.zeros(len(places), dtype=bool)
    for share in INWARD:
        at[~inside] = share * places[~inside]
        matrix, inside = reading.matrix(at)
        if inside.all():
            return matrix
    problem = f"{(~inside).sum()} places of the data lie outside of it"
    raise InputError(None, "mesh", problem)


def kept_targets(
    targets: Sequence[FieldTarget], mask: NDArray[np.bool_] | None
) -> list[FieldTarget]:
    """Return the points of all targets that a mask leaves, each with its own frame."""
    if mask is None:
        return list(targets)
    ends = np.cumsum([len(target.displacement) for target in targets])[:-1]
    kept = []
    for k, (target, own) in enumerate(zip(targets, np.split(mask, ends), strict=True)):
        if not own.any():
            continue
        frame = k if target.frame is None else target.frame
        if target.sample is None and not own.all():
            target = replace(target, sample=scipy.sparse.identity(len(own), format="csr"))
        kept.append(replace(target.only(own), frame=frame))
    return kept


def prepare(test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedBubble:
    """Read or compute the data of a test; raises InputError, SolverFailure."""
    if test.rising < len(test.pressures) and law.memory is None:
        problem = "'all' needs a law with a memory: say [law.memory] warp = 'fitted' and fill"
        raise test.place.error("inflation", problem)
    known = None
    registration = None
    own = False
    if isinstance(test.data, KnownSolution):
        fields, known, own = _computed(test, test.data, law, make_solver)
    else:
        fields, registration = read_measured(test)
    surfaces = _surfaces(test, fields, computed=known is not None)
    prepared = PreparedBubble(test, fields, surfaces, known, registration, own)
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
        known = HypoelasticLaw(data.beta, law.nu12, law.strain_range, law.thickness_change, form)
    with test.place.naming(field=f"{field}.solver"):
        solver = make_solver() if data.solver is None else make_solver(data.solver)
    if data.symmetry == "quarter" and test.symmetry == "full":
        problem = "data of a quarter cannot be matched by a full model; use the same symmetry"
        raise test.place.error(f"{field}.symmetry", problem)
    source = test.model(elements=data.elements, symmetry=data.symmetry, increments=data.increments)
    try:
        history = solver.run(source, known)
    except SolverFailure as failure:
        reason = f"the known solution cannot be run: {failure.reason}"
        where = failure.solver, failure.exit_number, failure.log_tail, failure.scratch
        raise SolverFailure(reason, *where) from None
    fields = tuple(
        DisplacementField(p, source.mesh.points[:, :2], u)
        for p, u in zip(test.pressures, np.asarray(history.displacement), strict=True)
    )
    own = data.solver is None or solver.identity == make_solver().identity
    return fields, known, own and _same_steps_and_mesh(test, data)


def _same_steps_and_mesh(test: BubbleTest, data: KnownSolution) -> bool:
    """Return whether the data are of the fit's increments and mesh, whole or folded."""
    own = np.array(test.increments)
    other = np.array(data.increments)
    if own.shape != other.shape or not np.allclose(other, own, rtol=1e-9, atol=0.0):
        return False
    own, other = (test.model(elements=n).mesh.points for n in (test.elements, data.elements))
    return own.shape == other.shape and np.allclose(own, other)


def _surfaces(
    test: BubbleTest, fields: Sequence[DisplacementField], computed: bool
) -> tuple[DisplacementSurface, ...]:
    """Fit surfaces to every field; too few points leave them out where they are only reported."""
    # A computed quarter is mirrored: surfaces are fitted to the full disk.
    whole = [mirrored(f) if computed else f for f in fields]
    few = min(len(f.points) for f in whole) < (test.match_degree + 1) ** 2
    if few and test.match_by == "points":
        return ()
    try:
        return tuple(fit_surface(f, test.match_degree) for f in whole)
    except InputError as error:
        raise test.place.error("match.degree", f"{error.field}: {error.problem}") from None


def read_measured(
    test: BubbleTest,
) -> tuple[tuple[DisplacementField, ...], Registration | None]:
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
        found, how = register_fields([fields[k] for k in order], test.outline, data.registration)
        return tuple(found[k] for k in np.argsort(order)), how


#: Of the highest pressure of the project's own test: frames of one to more pressure.
FURTHER = (1.25, 1.5)
#: Minor over major semi-axis of an elliptic rim, and degrees from the warp to the major one.
SLENDER, ANGLES = 0.5, (0.0, 45.0, 90.0)
#: Where the project has no bubble: mm, quads of the full disk, places a frame, and pressures in
#: shares of the highest one.
RADIUS, ELEMENTS, PLACES = 100.0, 432, 400
LEVELS = (0.1, 0.25, 0.45, 0.7, 1.0)
#: Of the strains that the law is known for: what such a bubble is to reach.
REACHED = 0.7


def candidates(planning: Planning) -> Sequence[kinds.Candidate]:
    """Return variants of the project's first bubble, or of a usual one where there is none."""
    own = [test for test in planning.present if isinstance(test, PreparedBubble)]
    if own:
        first = own[0].test
        noise_is = f"that of {own[0].test.name}"
        sight = planning.precision[first.name]
    else:
        first = _usual(planning)
        noise_is = "assumed"
        sight = Precision(matching.CORRELATION, 1.0, PLACES)
    if planning.noise is not None:
        sight = replace(sight, noise=planning.noise)
        noise_is = "given"
    # As it would be made: inflated once, matched at points, in millimetres, its rim at rest.
    if first.rising < len(first.pressures):
        pressures = first.pressures[: first.rising]
        first = replace(first, pressures=pressures, increments=default_increments(pressures))
    sheet = replace(first.sheet, measured=False, moving_rim=False)
    first = replace(first, match_by="points", objective="mm", sheet=sheet)
    tests = {"the same bubble again" if own else "bubble": first}
    top = first.pressures[-1]
    more = tuple(f * top for f in FURTHER)
    pressures = (*first.pressures, *more)
    increments = (*first.increments, *more)
    higher = replace(first, pressures=pressures, increments=increments)
    tests[f"bubble to {1e3 * more[-1]:.4g} kPa"] = higher
    for angle in ANGLES:
        tests[f"bubble, elliptic rim at {angle:g} degrees"] = _elliptic(first, angle)
    return [
        kinds.Candidate(name, partial(_made, test, sight, planning), noise_is)
        for name, test in tests.items()
    ]


def _made(test: BubbleTest, sight: Precision, planning: Planning) -> PreparedBubble:
    """Return the test with the law's displacements at the nodes of its model."""
    law = planning.law
    model = with_sheet(test.model(), test.sheet, test.outline, FLAT)
    history = planning.make_solver().run(model, law)
    nodes = model.mesh.points[:, :2]
    test = replace(test, noise=sight.at(len(nodes)))
    fields = tuple(
        DisplacementField(p, nodes, u)
        for p, u in zip(test.pressures, np.asarray(history.displacement), strict=True)
    )
    if test.symmetry == "quarter":
        fields = tuple(folded(field) for field in fields)
    return PreparedBubble(test, fields, (), law, by_this_model=True)


def _elliptic(test: BubbleTest, angle: float) -> BubbleTest:
    """Return the test with a rim as long as its own, at pressures that strain it about as much.
    Of a shallow dome of height h, p = h (N1/a^2 + N2/b^2) up to a factor; alike strained it is h
    that goes with the minor semi-axis b."""
    rim = Outline(test.outline.major, SLENDER * test.outline.major, angle)
    curved = rim.minor * (rim.major**-2 + rim.minor**-2)
    times = curved * test.outline.radius / 2.0
    symmetry = test.symmetry if rim.doubly_symmetric else "full"
    pressures, increments = (tuple(times * p for p in a) for a in (test.pressures, test.increments))
    return replace(test, outline=rim, symmetry=symmetry, pressures=pressures, increments=increments)


def _usual(planning: Planning) -> BubbleTest:
    """Return a circular test, to a pressure that strains the sheet as far as the law is known."""
    law = planning.law
    ends = planning.ends
    # A shallow cap: strain 2/3 (h/R)^2, curvature 2 h/R^2, mean modulus.
    strain = REACHED * float(min(ends[:2]))
    along = np.linspace(0.0, strain, 21)
    mean = np.mean([law.modulus(name, along).mean() for name in ("E1", "E2")])
    tension = float(mean) * strain * planning.place.fabric.thickness / (1.0 - law.nu12)
    top = 4.0 * RADIUS * float(np.sqrt(1.5 * strain)) * tension / RADIUS**2
    pressures = tuple(share * top for share in LEVELS)
    increments = default_increments(pressures)
    return BubbleTest(
        name="bubble",
        place=planning.place,
        weight=1.0,
        outline=Outline.circle(RADIUS),
        elements=ELEMENTS,
        symmetry="quarter",
        generator="blocks",
        pressures=pressures,
        increments=increments,
        data=KnownSolution(law.beta, law.form.name, ELEMENTS, increments, "quarter"),
        match_by="points",
        match_degree=4,
        objective="mm",
        displacement_offset=False,
        pressure_offset=False,
        sheet=Sheet(),
    )
