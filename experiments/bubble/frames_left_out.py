"""Frames of a bubble that a fit can do without."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..fittable import Masks
from .objective import FieldTarget

if TYPE_CHECKING:
    from .prepared import PreparedBubble


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
