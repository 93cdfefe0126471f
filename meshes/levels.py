"""Load levels of a model: their validation, and their indices among the increments."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from .mesh import Numbers


def places_of(levels: Sequence[float], steps: Sequence[float]) -> Numbers:
    """Return the index of the step that is nearest to each level."""
    all_steps = np.array(steps)
    return np.array([int(np.argmin(np.abs(all_steps - level))) for level in levels])


def keep_levels(
    model: Any, unit: str = "", unloaded: bool = False, **levels_by_name: Sequence[float]
) -> None:
    """Validate load levels and store them as attributes of a frozen model.

    Parameters
    ----------
    model : frozen dataclass
    unit : str
        Unit of the levels, for the message of an error.
    unloaded : bool
        Whether levels may also fall, and need only differ from one to the next.
    **levels_by_name : sequences of float
        Levels by the name of the attribute.

    Raises
    ------
    InputError
        Unless levels are finite, positive and increasing.
    """
    for name, levels in levels_by_name.items():
        values = np.array(levels, dtype=float)
        change = np.diff(values, prepend=0.0)
        is_admissible = (change > 0).all()
        if unloaded:
            is_admissible = (change != 0).all() and (values > 0).all()
        if not (len(values) and np.isfinite(values).all() and is_admissible):
            raise InputError(None, name, f"expected positive, increasing, got {values}{unit}")
        object.__setattr__(model, name, tuple(values.tolist()))
