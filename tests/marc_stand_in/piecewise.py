"""Laws of any piecewise cubics, as a form that knows nothing else."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from bubblefit.materials.forms.base import UNLIMITED
from bubblefit.materials.law import HypoelasticLaw
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Piecewise:
    """beta holds the coefficients of every piece of E1, then of E2 and of G12.

    ends : the strains at which one piece of E1, E2, G12 gives way to the next.
    """

    ends: tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]

    name = "piecewise"

    @property
    def counts(self) -> list[int]:
        return [len(ends) + 1 for ends in self.ends]

    @property
    def size(self) -> int:
        return 4 * sum(self.counts)

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(f"beta_{i}" for i in range(self.size))

    @property
    def free(self) -> tuple[int, ...]:
        return tuple(range(self.size))

    @property
    def modulus_of(self) -> tuple[str, ...]:
        names = zip(("E1", "E2", "G12"), self.counts, strict=True)
        return tuple(name for name, count in names for _ in range(4 * count))

    def piece_map(self) -> Array:
        whole, first = np.zeros((3, max(self.counts), 4, self.size)), 0
        for component, count in enumerate(self.counts):
            for piece in range(max(self.counts)):
                begin = first + 4 * min(piece, count - 1)
                whole[component, piece, :, begin : begin + 4] = np.eye(4)
            first += 4 * count
        return whole

    def uppers(self) -> Array:
        longest = max(self.counts) - 1
        rows = [[*ends, *[UNLIMITED] * (longest - len(ends)), UNLIMITED] for ends in self.ends]
        return np.array(rows, dtype=float)

    def grid(self, component: int, end: float) -> Array:
        knots = [0.0, *(at for at in self.ends[component] if at < end), end]
        return np.unique(np.concatenate([np.linspace(a, b, 31) for a, b in pairwise(knots)]))

    def from_values(self, strain_range: Sequence[float]) -> Array:
        return np.eye(self.size)

    def to_card(self) -> dict[str, object]:
        return {}

    def describe(self) -> str:
        return "beta: coefficients of the pieces of E1, E2, G12, highest power first."


def piecewise_law(
    e1: ArrayLike, e2: ArrayLike, g12: ArrayLike, nu12: float = 0.24, thickness: str = "constant"
) -> HypoelasticLaw:
    """The law of three moduli (n, 5), MPa: the upper end of each piece and its coefficients."""
    curves = [np.asarray(curve, dtype=float) for curve in (e1, e2, g12)]
    form = Piecewise(tuple(tuple(curve[:-1, 0].tolist()) for curve in curves))  # type: ignore[arg-type]
    beta = np.concatenate([curve[:, 1:].ravel() for curve in curves])
    ends = np.array([curve[-1, 0] for curve in curves])
    return HypoelasticLaw(beta, nu12, ends, thickness, form)  # type: ignore[arg-type]
