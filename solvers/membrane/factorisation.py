"""Storage and factorisation of the tangent matrix.

Small matrices are factorised by LAPACK's banded LU in reverse Cuthill-McKee order, which is faster
for them (benchmarks/bench_cost.py growth), and large ones by SuperLU. Both take unsymmetric
matrices, as the tangent is not symmetric.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
NEAR = 1e-9  # tolerance for nodes in the plane of an end, as a share of the length
#: Relative residual of the linear equations up to which GMRES solves a step of Newton's iteration.
STEP_TOLERANCE = 1e-3
#: Number of GMRES iterations within which this has to be reached.
MAX_ROUNDS = 14
#: Count of stored numbers up to which a band is faster than SuperLU for a disk (benchmarks/).
LARGEST_BAND = 1_000_000
#: Factor by which this count is larger for a tube.
TUBE_FACTOR = 8


def swept(quads: Numbers, points: Array) -> list[Numbers]:
    """Return two orders (n,) of the nodes of a tube, which sweep it from its two ends.

    The nodes are numbered ring by ring along the longest of the axes x, y, z. points : (n, 3) mm.
    """
    axis = int(np.ptp(points, axis=0).argmax())
    along = points[:, axis]
    tolerance = NEAR * float(np.ptp(along))
    rows = np.repeat(quads, 4, axis=1).ravel()
    columns = np.tile(quads, (1, 4)).ravel()
    graph = scipy.sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(points),) * 2)
    ends = (np.flatnonzero(np.abs(along - at) <= tolerance) for at in (along.min(), along.max()))
    return [_from(graph, end) for end in ends]


def _from(graph: scipy.sparse.csr_matrix, end: Numbers) -> Numbers:
    """Return the order of a breadth-first search in the graph of the nodes from those of an end.

    The end's own nodes are ordered so that neighbours follow each other.
    """
    first = end[
        scipy.sparse.csgraph.reverse_cuthill_mckee(graph[end][:, end].tocsr(), symmetric_mode=True)
    ]
    degree = np.diff(graph.indptr)
    is_numbered = np.zeros(graph.shape[0], dtype=bool)
    is_numbered[first] = True
    order = first.tolist()
    at = 0
    while at < len(order):
        neighbours = graph.indices[graph.indptr[order[at]] : graph.indptr[order[at] + 1]]
        fresh = neighbours[~is_numbered[neighbours]]
        fresh = fresh[np.argsort(degree[fresh], kind="stable")]
        is_numbered[fresh] = True
        order += fresh.tolist()
        at += 1
    # Parts connected to no end come last, with a band of their own.
    return np.concatenate([order, np.flatnonzero(~is_numbered)]).astype(np.intp)


class SingularTangent(Exception):
    """The tangent cannot be factorised at the present state."""


class Tangent(Protocol):
    data: Array
    slot: NDArray[np.int64]

    def factor(self) -> None:
        """Factorise `data`; SingularTangent on failure."""

    def definite(self) -> bool:
        """Return whether the symmetric part of `data` is positive definite: stability.

        Then every small motion away takes work (Hill, J. Mech. Phys. Solids 6 (1958) 236). The
        hypoelastic tangent differs from it by 1 to 5 %, its least eigenvalue by a few tenths of a
        per cent.
        """

    def solve(self, rhs: Array) -> Array:
        """Solve for free degrees of freedom, rhs (free,) or (free, k)."""

    def times(self, columns: Array) -> Array:
        """Return `data` times columns (free, k)."""

    def step(self, rhs: Array, new: bool) -> Array:
        """Solve for a step of Newton's iteration, rhs (free,), `data` factorised if it is new."""
        if new:
            self.factor()
        return self.solve(rhs)


def tangent_for(
    quads: NDArray[np.intp],
    size: int,
    free: NDArray[np.intp],
    points: Array | None = None,
) -> Tangent:
    """Return storage for the tangent of a mesh, banded or sparse by its size.

    Parameters
    ----------
    quads : (m, 4) array of int
    size : int
        Count of all unknowns, 3 for each node.
    free : (f,) array of int
        Unknowns that are not held.
    points : (n, 3) array, mm, optional
        Nodes of a tube, for which numbering from end to end is tried, too.
    """
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    place = np.full(size, -1, dtype=np.int64)
    place[free] = np.arange(len(free))
    rows = place[np.repeat(dofs, 12, axis=1)]
    columns = place[np.tile(dofs, (1, 12))]
    is_free = (rows >= 0) & (columns >= 0)
    pattern = scipy.sparse.csr_matrix(
        (np.ones(int(is_free.sum())), (rows[is_free], columns[is_free])), shape=(len(free),) * 2
    )
    orders = [scipy.sparse.csgraph.reverse_cuthill_mckee(pattern, symmetric_mode=True)]
    for nodes in [] if points is None else swept(quads, points):
        unknowns = place[(3 * nodes[:, None] + np.arange(3)).ravel()]
        orders.append(unknowns[unknowns >= 0])
    ranks = [np.argsort(order) for order in orders]
    widths = [int(np.abs(rank[rows[is_free]] - rank[columns[is_free]]).max()) for rank in ranks]
    width = min(widths)
    rank = ranks[int(np.argmin(widths))]
    if (3 * width + 1) * len(free) <= LARGEST_BAND * (1 if points is None else TUBE_FACTOR):
        return BandedTangent(rank, rows, columns, is_free, width)
    return SparseTangent(rows, columns, is_free, len(free))


class BandedTangent(Tangent):
    """A tangent that is stored as a band of renumbered unknowns, for LAPACK's gbtrf and gbtrs.

    rank : new number of each free unknown. width : of the band on either side of the diagonal.
    rows, columns : (m, 144) free unknowns of each element entry. is_free : whether both are free.
    """

    def __init__(
        self,
        rank: NDArray[np.int64],
        rows: NDArray[np.int64],
        columns: NDArray[np.int64],
        is_free: NDArray[np.bool_],
        width: int,
    ) -> None:
        self.width = width
        self.size = len(rank)
        self.depth = 3 * width + 1  # gbtrf wants `width` more rows for its pivoting
        self.data = np.zeros(self.depth * self.size)
        self.slot = np.full(rows.shape, -1, dtype=np.int64)
        i = rank[rows[is_free]]
        j = rank[columns[is_free]]
        self.slot[is_free] = j * self.depth + 2 * width + i - j
        self.rank = rank
        self.order = np.argsort(rank)

    def factor(self) -> None:
        band = self.data.reshape((self.depth, self.size), order="F")
        self.lu, self.pivots, info = scipy.linalg.lapack.dgbtrf(band, self.width, self.width)
        if info != 0:
            raise SingularTangent

    def definite(self) -> bool:
        band = self.data.reshape((self.depth, self.size), order="F")
        lower = np.array(band[2 * self.width :], order="F")
        for k in range(1, self.width + 1):
            lower[k, : self.size - k] += band[2 * self.width - k, k:]
            lower[k] *= 0.5
        return bool(scipy.linalg.lapack.dpbtrf(lower, lower=1, overwrite_ab=1)[1] == 0)

    def solve(self, rhs: Array) -> Array:
        ordered = np.asfortranarray(rhs[self.order])
        x, _ = scipy.linalg.lapack.dgbtrs(
            self.lu,
            self.width,
            self.width,
            ordered,
            self.pivots,
            overwrite_b=1,
        )
        return np.asarray(x[self.rank])

    def times(self, columns: Array) -> Array:
        place, matrix = self._pattern
        matrix.data[:] = self.data[place]
        return np.asarray((matrix @ columns[self.order])[self.rank])

    @cached_property
    def _pattern(self) -> tuple[Numbers, scipy.sparse.csc_matrix]:
        """Return the places in `data` of the matrix' entries, and a sparse matrix to hold them."""
        place = np.unique(self.slot[self.slot >= 0])
        column, row = np.divmod(place, self.depth)
        starts = np.searchsorted(column, np.arange(self.size + 1))
        csc_parts = np.zeros(len(place)), row - 2 * self.width + column, starts
        return place, scipy.sparse.csc_matrix(csc_parts, (self.size, self.size))


class SparseTangent(Tangent):
    """A tangent that is stored as a sparse matrix, for SuperLU with a symmetric-pattern ordering.

    For 20,000 quads a factorisation takes 0.7 s, a solution 0.02 s and a product 0.003 s.
    Therefore steps of Newton's iteration are solved by GMRES with the last factorisation, which may
    be that of the symmetric part, as its preconditioner, as long as few iterations suffice. It
    preconditions from the right, so that the residual itself is what becomes small.
    """

    def __init__(
        self,
        rows: NDArray[np.int64],
        columns: NDArray[np.int64],
        is_free: NDArray[np.bool_],
        size: int,
    ) -> None:
        keys, position = np.unique(columns[is_free] * size + rows[is_free], return_inverse=True)
        self.slot = np.full(rows.shape, -1, dtype=np.int64)
        self.slot[is_free] = position
        pointer = np.searchsorted(keys // size, np.arange(size + 1)).astype(np.int32)
        index = (keys % size).astype(np.int32)
        self.data = np.zeros(len(keys))
        self.near: Any = None
        self.matrix = scipy.sparse.csc_matrix((self.data, index, pointer), shape=(size, size))

    def factor(self) -> None:
        self.matrix.data[:] = self.data
        self.lu = self.near = self._factors(self.matrix)

    def step(self, rhs: Array, new: bool) -> Array:
        self.matrix.data[:] = self.data
        if (factor := self.near) is not None:
            nearly_one = scipy.sparse.linalg.LinearOperator(
                self.matrix.shape, lambda x: self.matrix @ factor.solve(x)
            )
            x, exit_code = scipy.sparse.linalg.gmres(
                nearly_one, rhs, rtol=STEP_TOLERANCE, restart=MAX_ROUNDS, maxiter=1
            )
            if exit_code == 0:
                return np.asarray(factor.solve(x))
        return super().step(rhs, True)

    def definite(self) -> bool:
        self.matrix.data[:] = self.data
        try:
            lu = self._factors((0.5 * (self.matrix + self.matrix.T)).tocsc())
        except SingularTangent:
            return False
        self.near = lu
        # Without row exchanges the signs of the pivots are those of the eigenvalues (Sylvester).
        straight = np.array_equal(lu.perm_r, lu.perm_c)
        return bool(straight and (lu.U.diagonal() > 0).all())

    @staticmethod
    def _factors(matrix: scipy.sparse.csc_matrix) -> Any:
        try:
            symmetric = {"SymmetricMode": True}
            return scipy.sparse.linalg.splu(
                matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.001, options=symmetric
            )
        except RuntimeError as error:
            raise SingularTangent from error

    def solve(self, rhs: Array) -> Array:
        return np.asarray(self.lu.solve(rhs))

    def times(self, columns: Array) -> Array:
        self.matrix.data[:] = self.data
        return np.asarray(self.matrix @ columns)


class AroundTangent(Tangent):
    """A tangent that extends another one, `inner`; by itself it passes everything on to that."""

    def __init__(self, inner: Tangent) -> None:
        self.inner = inner
        self.data = inner.data
        self.slot = inner.slot

    def factor(self) -> None:
        self.inner.factor()

    def definite(self) -> bool:
        return self.inner.definite()

    def solve(self, rhs: Array) -> Array:
        return self.inner.solve(rhs)

    def times(self, columns: Array) -> Array:
        return self.inner.times(columns)


class BorderedTangent(AroundTangent):
    """A tangent plus the matrix c v v' of rank one, solved by Sherman and Morrison's formula.

    It couples all unknowns: for a gas, v = dV/du is the derivative of the volume V and c = -dp/dV,
    where p is the pressure. stiffness : c; 0 for none. border : v, (free,).
    """

    def __init__(self, inner: Tangent) -> None:
        super().__init__(inner)
        self.stiffness = 0.0
        self.border = np.empty(0)

    def factor(self) -> None:
        self.inner.factor()
        self.answer = self.inner.solve(self.border) if self.stiffness else self.border

    def solve(self, rhs: Array) -> Array:
        x = self.inner.solve(rhs)
        if not self.stiffness:
            return x
        share = self.stiffness / (1.0 + self.stiffness * float(self.border @ self.answer))
        across = np.tensordot(self.border, x, axes=1)
        return np.asarray(x - share * np.multiply.outer(self.answer, across))

    def times(self, columns: Array) -> Array:
        added = self.stiffness * np.outer(self.border, self.border @ columns)
        return np.asarray(self.inner.times(columns) + added)
