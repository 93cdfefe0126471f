"""From a bubble test to what a fit needs of it: its data read or computed, surfaces, the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...data.fields import DisplacementField, read_fields
from ...data.registration.fields import register_fields
from ...data.registration.register import Registration
from ...data.surfaces import DisplacementSurface, fit_surface
from ...errors import InputError
from ...materials.law import HypoelasticLaw
from ..base import MakeSolver
from .known_data import known_data
from .places import mirrored
from .point_files import PointFiles
from .prepared import PreparedBubble
from .sheet import measured_sheet
from .sources import KnownSolution
from .test import BubbleTest


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
