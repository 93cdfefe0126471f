"""A pulled end: the columns and rows of the tangent that belong to it, and the gauge it opens."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .factorisation import Tangent, tangent_for
from .newton import Membrane

Array = NDArray[np.float64]

MOST_CORRECTIONS = 12
#: mm of gauge elongation over mm of gauge length.
GAUGE_TOLERANCE = 1e-10


class DrivenTangent:
    """The factorisable tangent of the free unknowns, and beside it that of the driven ones.

    Both lie in one array, so that one assembly fills them: first what `free` needs, then every
    element entry with a driven row or column.

    Parameters
    ----------
    driven : unknowns that move together; none of them free.
    """

    def __init__(
        self, quads: NDArray[np.intp], size: int, free: NDArray[np.intp], driven: NDArray[np.intp]
    ) -> None:
        self.inner: Tangent = tangent_for(quads, size, free)
        dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
        rows, columns = np.repeat(dofs, 12, axis=1), np.tile(dofs, (1, 12))
        beside = np.isin(rows, driven) | np.isin(columns, driven)
        inside = self.inner.data.size
        count = int(beside.sum())
        self.data = np.zeros(inside + count)
        self.slot = self.inner.slot.copy()
        self.slot[beside] = inside + np.arange(count)
        self.inner.data = self.data[:inside]
        self._tail, self._at = self.data[inside:], (rows[beside], columns[beside])
        self._shape = (size, size)

    def factor(self) -> None:
        self.inner.factor()

    def definite(self) -> bool:
        return self.inner.definite()

    def solve(self, rhs: Array) -> Array:
        return self.inner.solve(rhs)

    def edge(self) -> sp.csr_matrix:
        """(size, size): the driven rows and columns of the tangent as last assembled."""
        return sp.csr_matrix((self._tail, self._at), shape=self._shape)


class Pull:
    """A set of unknowns that moves together by one amount, and the gauge that it has to open.

    Parameters
    ----------
    direction : (3 n,) displacement of every driven unknown for one mm of pull, zero elsewhere.
    gauge : its two nodes.
    """

    def __init__(
        self,
        membrane: Membrane,
        tangent: DrivenTangent,
        direction: Array,
        gauge: NDArray[np.intp],
    ) -> None:
        self.membrane, self.tangent = membrane, tangent
        self.direction, self.gauge = direction, gauge
        lower, upper = membrane.reference[gauge]
        self.gauge_length = float(np.linalg.norm(upper - lower))

    def elongation(self, u: Array) -> tuple[float, Array]:
        """Elongation of the gauge (mm) at u (n, 3), and its derivative (3 n,)."""
        lower, upper = (self.membrane.reference + u)[self.gauge]
        length = float(np.linalg.norm(upper - lower))
        slope = np.zeros(u.shape)
        slope[self.gauge[1]] = (upper - lower) / length
        slope[self.gauge[0]] = -slope[self.gauge[1]]
        return length - self.gauge_length, slope.reshape(-1)

    def response(self) -> Array:
        """(3 n,) displacement per mm of pull, for the tangent as last assembled and factorised."""
        free = self.membrane.free
        w = self.direction.copy()
        w[free] = -self.tangent.solve((self.tangent.edge() @ self.direction)[free])
        return w

    def equilibrium(self, u: Array, elongation: float) -> Array | None:
        """Equilibrium (n, 3) in which the gauge has this elongation, from u; None if not found.

        Newton on the pull: between two equilibria the whole strip follows its tangent, so that
        the second one is near.
        """
        m = self.membrane
        for _ in range(MOST_CORRECTIONS):
            found = m.equilibrium(u, 0.0)
            if found is None:
                return None
            now, slope = self.elongation(found)
            gap = elongation - now
            if abs(gap) <= GAUGE_TOLERANCE * self.gauge_length:
                return found
            m.factor()
            w = self.response()
            opens = float(slope @ w)
            move = gap / opens if opens > 0 else np.inf
            if abs(move) * np.abs(w).max() > m.step_limit:
                return None
            u = found + move * w.reshape(u.shape)
        return None
