"""Displacement fields of a bubble test brought into the test's coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...errors import InputError
from ..fields import DisplacementField
from ..outline import Outline
from .register import ALL_FOUND, Registration, RegistrationOptions, register


def register_fields(
    fields: Sequence[DisplacementField],
    outline: Outline,
    options: RegistrationOptions = ALL_FOUND,
) -> tuple[tuple[DisplacementField, ...], Registration]:
    """As `register`, of fields by rising pressure.

    outline : of the rim, its angle counted from the warp. Without a measured height of the
    reference state the sheet is taken to lie in the camera's plane.

    Raises
    ------
    InputError : as `register`; a plane to be found without a measured height.
    """
    measured = all(field.z is not None for field in fields)
    if not measured:
        if options.plane not in ("found", "camera"):
            problem = "the files have no height z of the reference state to lay a plane through"
            raise InputError(None, "plane", problem)
        options = replace(options, plane="camera")
    semi_axes = outline.major, outline.minor
    if not outline.round:
        options = replace(options, rim_angle=outline.angle)
    frames, registration = register([field.frame for field in fields], semi_axes, options)
    moved = [
        replace(
            field,
            points=frame.points[:, :2],
            z=frame.points[:, 2] if measured else None,
            displacement=frame.displacement,
        )
        for field, frame in zip(fields, frames, strict=True)
    ]
    return tuple(moved), registration
