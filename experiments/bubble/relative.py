"""Displacements counted from one of the frames: which places are the same, and where they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ...data.fields import DisplacementField
from ...errors import InputError
from .objective import FieldTarget

Array = NDArray[np.float64]
#: Decimals of a mm to which two frames give the same reference place.
DECIMALS = 3
#: Of a frame's places, that the frame it is counted from has to have, too.
LEAST_SHARE = 0.5
#: In-plane displacements of an inflated sheet go with the square of its height, and this with the
#: cube root of the pressure.
POWER = 2.0 / 3.0


def at_rest(fields: Sequence[DisplacementField], since: int) -> list[DisplacementField]:
    """The fields with places in the sheet without load, where they are those of frame `since`.

    That is so where the picture that all displacements are counted from was taken at the pressure
    of this frame: nothing moves in it. How far its places have moved already is told by the next
    frame: in-plane displacements grow with p^(2/3). Other fields are left as they are.
    """
    first = fields[since]
    if first.displacement.any():
        return list(fields)
    other = fields[since + 1 if since + 1 < len(fields) else since - 1]
    powers = [field.pressure**POWER for field in (first, other)]
    moved = other.displacement[:, :2] * (powers[0] / (powers[1] - powers[0]))
    tree = cKDTree(other.points)
    return [replace(f, points=f.points - moved[tree.query(f.points)[1]]) for f in fields]


def with_places(targets: Sequence[FieldTarget], nodes: Array) -> list[FieldTarget]:
    """The targets with the numbers of their places, the same place having the same in all.

    nodes : (nodes, 2) mm, of the model.
    """
    places = [np.round(target.at(nodes), DECIMALS) + 0.0 for target in targets]
    _, numbers = np.unique(np.concatenate(places), axis=0, return_inverse=True)
    ends = np.cumsum([len(p) for p in places])[:-1]
    return [
        replace(target, places=own)
        for target, own in zip(targets, np.split(numbers.reshape(-1), ends), strict=True)
    ]


def counted_from(targets: Sequence[FieldTarget], since: int) -> list[FieldTarget]:
    """Targets, with places, less that of the frame `since`, from which the others are counted.

    Raises
    ------
    InputError : a frame that shares too few places with it.
    """
    origin = targets[since]
    assert origin.places is not None
    relative = []
    for k, target in enumerate(targets):
        if k == since:
            continue
        assert target.places is not None
        _, mine, its = np.intersect1d(target.places, origin.places, return_indices=True)
        if len(mine) < LEAST_SHARE * len(target.places):
            problem = (
                f"the frames at {1e3 * target.pressure:g} and {1e3 * origin.pressure:g} kPa share "
                f"{len(mine)} of {len(target.places)} points; expected the same points in all"
            )
            raise InputError(None, "sheet.from_pressure", problem)
        moved = target.displacement[mine] - origin.displacement[its]
        sample = None if target.sample is None else target.sample[mine]
        relative.append(
            replace(
                target,
                displacement=moved,
                sample=sample,
                places=target.places[mine],
                at_rest=None if target.at_rest is None else target.at_rest[mine],
                frame=k,
                since=since,
            )
        )
    return relative
