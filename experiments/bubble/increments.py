"""Load steps of a bubble: the pressures of its data, and others between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base import Place


def merge_increments(
    place: Place,
    field: str,
    extra: Sequence[float],
    pressures: Sequence[float],
) -> tuple[float, ...]:
    """Load steps (MPa): the pressures (MPa) and the extra ones (in the file's unit) between.

    Raises
    ------
    InputError : an extra one beyond the last pressure; `field` is their key in the test's section.
    """
    steps = list(pressures)
    for i, step in enumerate(extra):
        value = step * place.scales.pressure
        if value > pressures[-1] * (1 + 1e-9):
            problem = f"expected a step up to the last pressure, got {step:g} beyond it"
            raise place.error(f"{field}[{i}]", problem)
        # 22 kPa written twice must not become two steps one rounding error apart.
        if not np.isclose(steps, value, rtol=1e-9, atol=0.0).any():
            steps.append(value)
    return tuple(sorted(steps))
