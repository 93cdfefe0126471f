"""Storage and factorisation of the tangent matrix.

Small matrices are factorised by LAPACK's banded LU in reverse Cuthill-McKee order, which is faster
for them (benchmarks/bench_cost.py growth), and large ones by SuperLU. Both take unsymmetric
matrices, as the tangent is not symmetric. Steps of Newton's iteration need no more than Cholesky's
factors of its symmetric part, in single precision.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from .nested_cholesky import Dissection, Fronts

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
PLANE_TOLERANCE = 1e-9  # tolerance for nodes in the plane of an end, as a share of the length
#: Relative residual of the linear equations up to which a step of Newton's iteration is solved.
STEP_TOLERANCE = 1e-3
#: Count of stored numbers up to which a band is faster than SuperLU for a disk (benchmarks/).
LARGEST_BAND = 1_000_000
#: Factor by which this count is larger for a tube.
TUBE_FACTOR = 12


def swept(quads: Numbers, points: Array) -> list[Numbers]:
    """Return two orders (n,) of the nodes of a tube, which sweep it from its two ends.

    The nodes are numbered ring by ring along the longest of the axes x, y, z.

    Parameters
    ----------
    quads : (m, 4) array
        Array of int.
    points : (n, 3) array, mm
    """
    axis = int(np.ptp(points, axis=0).argmax())
    along = points[:, axis]
    tolerance = PLANE_TOLERANCE * float(np.ptp(along))
    rows = np.repeat(quads, 4, axis=1).ravel()
    columns = np.tile(quads, (1, 4)).ravel()
    shape = len(points), len(points)
    graph = scipy.sparse.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=shape)
    ends = (np.flatnonzero(np.abs(along - at) <= tolerance) for at in (along.min(), along.max()))
    return [_from(graph, end) for end in ends]


def _from(graph: scipy.sparse.csr_matrix, end: Numbers) -> Numbers:
    """Return the order of a breadth-first search in the graph of the nodes from those of an end.

    The end's own nodes are ordered so that neighbours follow each other.
    """
    first = end[
        scipy.sparse.csgraph.reverse_cuthill_mckee(graph[end][:, end].tocsr(), symmetric_mode=True)
    ]
    neighbours = graph.tolil().rows
    is_numbered = np.zeros(graph.shape[0], dtype=bool)
    is_numbered[first] = True
    order = first.tolist()
    for node in order:  # which grows meanwhile
        fresh = [neighbour for neighbour in neighbours[node] if not is_numbered[neighbour]]
        fresh.sort(key=lambda neighbour: len(neighbours[neighbour]))
        is_numbered[fresh] = True
        order += fresh
    # Parts connected to no end come last, with a band of their own.
    return np.concatenate([order, np.flatnonzero(~is_numbered)]).astype(np.intp)


class SingularTangent(Exception):
    """The tangent cannot be factorised at the present state."""


#: Returns the approximate solution (free,) of the linear equations for a right-hand side (free,).
NearInverse = Callable[[Array], Array]


def near_step(
    tangent: Tangent,
    rhs: Array,
    is_changed: bool,
    max_rounds: int = 8,
    tolerance: float = STEP_TOLERANCE,
) -> Array:
    """Solve for a step of Newton's iteration, with a past factorisation as long as it is near.

    Parameters
    ----------
    tangent : Tangent
    rhs : (free,) array
    is_changed : bool
        Whether the tangent has changed so much that a past factorisation is of no use.
    max_rounds : int
        Number of iterations within which a past factorisation has to lead to the step; one costs a
        tenth of a Cholesky factorisation.
    tolerance : float
        Relative residual of the linear equations up to which the step is solved.

    Returns
    -------
    (free,) array

    Raises
    ------
    SingularTangent
        If the tangent cannot be factorised.
    """
    x = None if is_changed else by_near_inverse(tangent, rhs, tolerance, max_rounds)
    if x is None:
        tangent.renew()
        x = by_near_inverse(tangent, rhs, tolerance, max_rounds)
    if x is None:
        tangent.factor()
        x = tangent.solve(rhs)
    return x


def by_near_inverse(
    tangent: Tangent, rhs: Array, tolerance: float, max_rounds: int = 8
) -> Array | None:
    """Return the solution (free,) with the near inverse, or None if it takes too many iterations.

    Generalised conjugate residuals (Eisenstat et al., SIAM J. Numer. Anal. 20 (1983) 345), which
    are as small as those of GMRES; the inverse need not be linear nor exact.

    Parameters
    ----------
    rhs : (free,) array
        Right side of the equations.
    tolerance : float
        Relative residual of the solution.
    """
    inverse = tangent.near_inverse()
    if inverse is None:
        return None
    goal = tolerance * float(np.linalg.norm(rhs))
    x = np.zeros_like(rhs)
    residual = rhs.copy()
    directions: list[tuple[Array, Array]] = []
    for _ in range(max_rounds):
        direction = inverse(residual)
        image = tangent.times(direction[:, None])[:, 0]
        for past_direction, past_image in directions:
            share = float(past_image @ image)
            image -= share * past_image
            direction -= share * past_direction
        size = float(np.linalg.norm(image))
        if not 0 < size < np.inf:
            return None
        image /= size
        direction /= size
        directions.append((direction, image))
        share = float(image @ residual)
        x += share * direction
        residual -= share * image
        if float(np.linalg.norm(residual)) <= goal:
            return x
    return None


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

    def renew(self) -> None:
        """Factorise what is near `data` and cheaper; SingularTangent on failure."""
        self.factor()

    def renew_definite(self) -> bool:
        """Factorise the symmetric part of `data` if it is positive definite; return whether."""
        return False

    def near_inverse(self) -> NearInverse | None:
        """Return what solves nearly for free unknowns (free,), by a past factorisation."""
        return None

    def step(self, rhs: Array, new: bool) -> Array:
        """Solve for a step of Newton's iteration, rhs (free,), `data` factorised if it is new."""
        if new:
            self.factor()
        return self.solve(rhs)


def tangent_for(
    quads: NDArray[np.intp],
    points: Array,
    free: NDArray[np.intp],
    is_tube: bool = False,
) -> Tangent:
    """Return storage for the tangent of a mesh, banded or sparse by its size.

    Parameters
    ----------
    quads : (m, 4) array of int
    points : (n, 3) array, mm
        Nodes.
    free : (f,) array of int
        Unknowns that are not held.
    is_tube : bool
        Whether numbering from end to end is tried, too.
    """
    dofs = (3 * quads[:, :, None] + np.arange(3)).reshape(len(quads), 12)
    place = np.full(points.size, -1, dtype=np.int64)
    place[free] = np.arange(len(free))
    rows = place[np.repeat(dofs, 12, axis=1)]
    columns = place[np.tile(dofs, (1, 12))]
    is_free = (rows >= 0) & (columns >= 0)
    largest_band = LARGEST_BAND * (TUBE_FACTOR if is_tube else 1)
    # In any order, the twelve unknowns of a quad make a band of eleven diagonals or more.
    if (3 * 11 + 1) * len(free) > largest_band:
        return SparseTangent(rows, columns, is_free, Dissection(quads, points), place)
    places = rows[is_free], columns[is_free]
    pattern = scipy.sparse.csr_matrix((np.ones(len(places[0])), places), shape=(len(free),) * 2)
    orders = [scipy.sparse.csgraph.reverse_cuthill_mckee(pattern, symmetric_mode=True)]
    orders.append(np.arange(len(free)))  # that of a strip goes row by row, in half the width
    for nodes in swept(quads, points) if is_tube else []:
        unknowns = place[(3 * nodes[:, None] + np.arange(3)).ravel()]
        orders.append(unknowns[unknowns >= 0])
    ranks = [np.argsort(order) for order in orders]
    i, j = pattern.nonzero()
    widths = [int(np.abs(rank[i] - rank[j]).max()) for rank in ranks]
    width = min(widths)
    if (3 * width + 1) * len(free) <= largest_band:
        return BandedTangent(rows, columns, is_free, ranks[int(np.argmin(widths))])
    return SparseTangent(rows, columns, is_free, Dissection(quads, points), place)


class StoredTangent(Tangent):
    """A tangent whose entries are stored column by column.

    Parameters
    ----------
    rows, columns : (m, 144) array
        Free unknowns of each element entry.
    is_free : array of bool
        Whether both are free.
    size : int
        Count of the free unknowns.
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
        csc_parts = np.arange(1.0, len(keys) + 1), index, pointer
        self._matrix = scipy.sparse.csc_matrix(csc_parts, shape=(size, size))
        #: Number of the entry of `data` across the diagonal from each.
        self.transposed = self._matrix.T.tocsc().data.astype(np.intp) - 1
        self.near: NearInverse | None = None

    @property
    def matrix(self) -> scipy.sparse.csc_matrix:
        """Return the tangent as a sparse matrix, whose entries are those of `data`."""
        self._matrix.data = self.data
        return self._matrix

    def times(self, columns: Array) -> Array:
        return self.matrix @ columns

    def near_inverse(self) -> NearInverse | None:
        return self.near


class BandedTangent(StoredTangent):
    """A tangent that is factorised as a band of renumbered unknowns, by LAPACK's gbtrf and gbtrs.

    Parameters
    ----------
    rank : (free,) array of int
        New number of each free unknown.
    """

    def __init__(
        self,
        rows: NDArray[np.int64],
        columns: NDArray[np.int64],
        is_free: NDArray[np.bool_],
        rank: NDArray[np.int64],
    ) -> None:
        super().__init__(rows, columns, is_free, len(rank))
        i = rank[self._matrix.indices]
        j = np.repeat(rank, np.diff(self._matrix.indptr))
        self.width = width = int(np.abs(i - j).max())
        self.size = len(rank)
        self.depth = depth = 3 * width + 1  # gbtrf wants `width` more rows for its pivoting
        self.place = j * depth + 2 * width + i - j
        self.lower = np.flatnonzero(i >= j)
        self.upper = self.transposed[self.lower]
        self.lower_place = (j * width + i)[self.lower]
        self.rank = rank
        self.order = np.argsort(rank)

    def factor(self) -> None:
        self.near = self.exact = self._lu(np.float64)

    def _lu(self, number: type) -> BandedInverse:
        """Return the inverse by factors in numbers of a type; SingularTangent on failure."""
        numbers: Any = np.zeros(self.depth * self.size, dtype=number)
        numbers[self.place] = self.data
        band = numbers.reshape((self.depth, self.size), order="F")
        factorise = scipy.linalg.get_lapack_funcs("gbtrf", dtype=number)
        factors, pivots, info = factorise(band, self.width, self.width, overwrite_ab=1)
        if info != 0:
            self.near = None
            raise SingularTangent
        return BandedInverse(factors, pivots, self.width, self.rank, self.order)

    def renew(self) -> None:
        # The symmetric part takes a fifth of the time, where it is positive definite; otherwise
        # factors in single precision take two thirds.
        if not self.renew_definite():
            self.near = self._lu(np.float32)

    def renew_definite(self) -> bool:
        factor, info = self._symmetric_factor(np.float32)
        if info == 0:
            self.near = SymmetricBand(factor, self.rank, self.order)
        return info == 0

    def definite(self) -> bool:
        return self._symmetric_factor(np.float64)[1] == 0

    def _symmetric_factor(self, number: type) -> tuple[Any, int]:
        """Return Cholesky's factor of the symmetric part as a band, and 0 if it exists.

        Parameters
        ----------
        number : type
            Type of its numbers.
        """
        half: Any = np.zeros((self.width + 1) * self.size, dtype=number)
        half[self.lower_place] = 0.5 * (self.data[self.lower] + self.data[self.upper])
        band = half.reshape((self.width + 1, self.size), order="F")
        factorise = scipy.linalg.get_lapack_funcs("pbtrf", dtype=number)
        factor, info = factorise(band, lower=1, overwrite_ab=1)
        return factor, int(info)

    def solve(self, rhs: Array) -> Array:
        return self.exact(rhs)


@dataclass(frozen=True, eq=False)
class BandedInverse:
    """Inverse of a band by its LU factors.

    Attributes
    ----------
    factors : (3 width + 1, free) array
        As LAPACK's gbtrf stores them.
    pivots : (free,) array of int
    width : int
        Count of the diagonals on each side of the main one.
    rank, order : (free,) array of int
        See `SymmetricBand`.
    """

    factors: NDArray[np.floating[Any]]
    pivots: NDArray[np.int32]
    width: int
    rank: NDArray[np.int64]
    order: NDArray[np.int64]

    def __call__(self, rhs: Array) -> Array:
        """Return the solution for a right-hand side, both (free,) or (free, k)."""
        number = self.factors.dtype
        ordered = np.asfortranarray(rhs[self.order], dtype=number)
        solve = scipy.linalg.get_lapack_funcs("gbtrs", dtype=number)
        x, _ = solve(self.factors, self.width, self.width, ordered, self.pivots, overwrite_b=1)
        return np.asarray(x[self.rank], dtype=float)


@dataclass(frozen=True, eq=False)
class SymmetricBand:
    """Inverse of a symmetric band by Cholesky's factor in single precision.

    Attributes
    ----------
    factor : (width + 1, free) array
        Lower band of the factor of the renumbered matrix.
    rank : (free,) array of int
        New number of each free unknown.
    order : (free,) array of int
        Inverse of `rank`.
    """

    factor: NDArray[np.float32]
    rank: NDArray[np.int64]
    order: NDArray[np.int64]

    def __call__(self, rhs: Array) -> Array:
        """Return the approximate solution (free,) for a right-hand side (free,)."""
        ordered = rhs[self.order].astype(np.float32)
        x, _ = scipy.linalg.lapack.spbtrs(self.factor, ordered, lower=1, overwrite_b=1)
        return np.asarray(x[self.rank], dtype=float)


class SparseTangent(StoredTangent):
    """A tangent that is stored as a sparse matrix, for SuperLU in an order of nested dissection.

    For 20,000 quads SuperLU takes 0.7 s, Cholesky's factorisation of the symmetric part in single
    precision 0.15 s, a solution with it 0.01 s and a product 0.003 s. Therefore steps of Newton's
    iteration are solved with the last one of these as long as few iterations suffice.

    Parameters
    ----------
    dissection : Dissection
        Of the mesh.
    place : (unknowns,) array
        Number of each free unknown, or -1.
    """

    #: Pivots larger than this share of the diagonal are positive for certain in single precision.
    clear_pivot = 1e-3

    def __init__(
        self,
        rows: NDArray[np.int64],
        columns: NDArray[np.int64],
        is_free: NDArray[np.bool_],
        dissection: Dissection,
        place: NDArray[np.int64],
    ) -> None:
        size = int(place.max()) + 1
        super().__init__(rows, columns, is_free, size)
        column = np.repeat(np.arange(size), np.diff(self._matrix.indptr))
        self.fronts = Fronts(dissection, place, self._matrix.indices, column)
        self._order = self.fronts.order
        self._ordered = self._matrix[self._order][:, self._order].tocsc()
        self._ordered.sort_indices()
        self._ordered.data = self._ordered.data.astype(np.intp) - 1

    def factor(self) -> None:
        lu = self._exact_factors(self.data)

        def solve(rhs: Array) -> Array:
            x = np.empty(rhs.shape)
            x[self._order] = lu.solve(rhs[self._order])
            return x

        self.near = self.exact = solve

    def renew(self) -> None:
        if not self.renew_definite():
            self.factor()

    def renew_definite(self) -> bool:
        symmetric = self._symmetric_part()
        # Of the finest meshes, factors in single precision may fail.
        factors = self.fronts.factorised(symmetric) or self.fronts.factorised(symmetric, float)
        self.near = factors or self.near
        return factors is not None

    def step(self, rhs: Array, new: bool) -> Array:
        return near_step(self, rhs, is_changed=False, max_rounds=14)

    def definite(self) -> bool:
        symmetric = self._symmetric_part()
        factors = self.fronts.factorised(symmetric)
        if factors is not None:
            self.near = factors
            if (factors.pivots() / self.matrix.diagonal()).min() > self.clear_pivot:
                return True
        exact_factors = self.fronts.factorised(symmetric, float)
        self.near = factors or exact_factors or self.near
        return exact_factors is not None

    def _symmetric_part(self) -> Array:
        """Return the entries (nonzeros,) of the symmetric part of the tangent."""
        return np.asarray(0.5 * (self.data + self.data[self.transposed]))

    def _exact_factors(self, data: Array) -> Any:
        """Return SuperLU's factors of a matrix, its unknowns reordered.

        Parameters
        ----------
        data : (nonzeros,) array
            Entries of the matrix.
        """
        parts = data[self._ordered.data], self._ordered.indices, self._ordered.indptr
        try:
            return scipy.sparse.linalg.splu(
                scipy.sparse.csc_matrix(parts, shape=self._ordered.shape),
                permc_spec="NATURAL",
                diag_pivot_thresh=0.001,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SingularTangent from error

    def solve(self, rhs: Array) -> Array:
        return self.exact(rhs)


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


@dataclass(frozen=True, eq=False)
class BorderedInverse:
    """Inverse of a matrix plus c v v'.

    Attributes
    ----------
    inner : NearInverse
        Inverse of the matrix.
    answer : (free,) array
        Its product with v.
    share : float
        c over 1 + c v'(answer).
    border : (free,) array
        v.
    """

    inner: NearInverse
    answer: Array
    share: float
    border: Array

    def __call__(self, rhs: Array) -> Array:
        x = self.inner(rhs)
        return x - self.share * float(self.border @ x) * self.answer


class BorderedTangent(AroundTangent):
    """A tangent plus the matrix c v v' of rank one, solved by Sherman and Morrison's formula.

    It couples all unknowns: for a gas, v = dV/du is the derivative of the volume V and c = -dp/dV,
    where p is the pressure.

    Attributes
    ----------
    stiffness : float
        c; 0 for none.
    border : (free,) array
        v.
    """

    def __init__(self, inner: Tangent) -> None:
        super().__init__(inner)
        self.stiffness = 0.0
        self.border = np.empty(0)
        self.near: NearInverse | None = None

    def factor(self) -> None:
        self.inner.factor()
        self.answer = self.inner.solve(self.border) if self.stiffness else self.border
        self.near = self._near_inverse()

    def solve(self, rhs: Array) -> Array:
        x = self.inner.solve(rhs)
        if not self.stiffness:
            return x
        share = self.stiffness / (1.0 + self.stiffness * float(self.border @ self.answer))
        across = np.tensordot(self.border, x, axes=1)
        return x - share * np.multiply.outer(self.answer, across)

    def times(self, columns: Array) -> Array:
        product = self.inner.times(columns)
        if not self.stiffness:
            return product
        return product + self.stiffness * np.outer(self.border, self.border @ columns)

    def renew(self) -> None:
        self.inner.renew()
        self.near = self._near_inverse()

    def renew_definite(self) -> bool:
        is_definite = self.inner.renew_definite()
        if is_definite:
            self.near = self._near_inverse()
        return is_definite

    def step(self, rhs: Array, new: bool) -> Array:
        return near_step(self, rhs, new)

    def near_inverse(self) -> NearInverse | None:
        return self.near

    def _near_inverse(self) -> NearInverse | None:
        """Return the inverse with the present border, by the inverse of the inner tangent."""
        inner = self.inner.near_inverse()
        if inner is None or not self.stiffness:
            return inner
        answer = inner(self.border)
        share = self.stiffness / (1.0 + self.stiffness * float(self.border @ answer))
        return BorderedInverse(inner, answer, share, self.border)
