"""What a prepared test offers beside its protocol: the same data beside another mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

from .base import MakeSolver
from .fittable import Weighting

if TYPE_CHECKING:
    from ..identification.comparison import Comparison


@runtime_checkable
class Refinable(Protocol):
    """A prepared test whose fit can be asked what a finer, or a coarser, model would have shown."""

    def finer(
        self, make_solver: MakeSolver, weighting: Weighting, factor: float
    ) -> tuple[Comparison, ...]:
        """Its comparisons with edges of elements and increments divided by a factor.

        Every residual is of the same measured value as that of `comparisons`. Where the data were
        computed with the fit's own model there is nothing finer: the same comparisons. A factor
        below one makes larger elements, and leaves the increments as they are.

        Raises
        ------
        InputError : there is no such mesh.
        """
