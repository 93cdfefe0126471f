"""Parameters of a model that a fit may change: what `with_parameters` is asked for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Self

from ..errors import InputError

THICKNESS = "thickness"


def changes_anything(known: Sequence[str], values: Mapping[str, float]) -> bool:
    """Whether values added to parameters change a model.

    Raises
    ------
    InputError : no such parameter.
    """
    unknown = [name for name in values if name not in known]
    if unknown:
        raise InputError(None, "parameters", f"{unknown} not among {tuple(known)}")
    return any(values.values())


class OfThickness:
    """A model, a dataclass with a `thickness`, of which nothing else is a parameter."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """What `with_parameters` changes: thickness (mm)."""
        return (THICKNESS,)

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same model with `values` added to its `parameters`; itself where all are zero.

        Raises
        ------
        InputError : no such parameter, or the thickness would not be positive.
        """
        if not changes_anything(self.parameters, values):
            return self
        model: Any = self
        changed: Self = replace(model, thickness=model.thickness + values[THICKNESS])
        return changed
