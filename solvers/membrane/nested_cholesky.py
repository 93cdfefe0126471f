"""Cholesky factors of large symmetric matrices of a mesh, by nested dissection.

The quads are halved again and again; unknowns of nodes inside a part are eliminated before those on
its border (George, SIAM J. Numer. Anal. 10 (1973) 345). The unknowns of a part are eliminated
together, in a dense front, by LAPACK (Duff and Reid, ACM Trans. Math. Softw. 9 (1983) 302).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...compilation import compiled

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Floats = NDArray[Any]
#: Count of quads up to which a part is not halved: smaller parts cost calls, larger ones numbers.
LARGEST_PART = 32


class Dissection:
    """Parts of a mesh of quads (m, 4) with nodes at points (n, 3), by halves.

    Lists have an entry for each part, the halves of a part before itself. inner : nodes that are
    eliminated with the part. border : nodes that it shares with others. halves : their numbers.
    """

    def __init__(self, quads: Numbers, points: Array, largest_part: int = LARGEST_PART) -> None:
        self.quads = quads
        self.centres = points[quads].mean(axis=1)
        self.totals = np.bincount(quads.ravel(), minlength=len(points))
        self.largest_part = largest_part
        self.inner: list[Numbers] = []
        self.border: list[Numbers] = []
        self.halves: list[list[int]] = []
        self._divide(np.arange(len(quads)))

    def _divide(self, members: Numbers) -> int:
        """Append the part of some quads after the parts in it; return its number.

        Parameters
        ----------
        members : (m,) array
            Numbers of these quads.
        """
        nodes, counts = np.unique(self.quads[members], return_counts=True)
        is_inner = counts == self.totals[nodes]
        border = nodes[~is_inner]
        halves = []
        if len(members) > self.largest_part:
            offset = self.centres[members] - self.centres[members].mean(axis=0)
            longest = np.linalg.eigh(offset.T @ offset)[1][:, -1]
            ranked = members[np.argsort(offset @ longest, kind="stable")]
            halves = [self._divide(half) for half in np.array_split(ranked, 2)]
            is_inner &= np.isin(nodes, np.concatenate([self.border[half] for half in halves]))
        self.inner.append(nodes[is_inner])
        self.border.append(border)
        self.halves.append(halves)
        return len(self.halves) - 1


class Fronts:
    """Where the entries of a matrix stand in the fronts of its factors.

    Unknowns are numbered in the order of their elimination: front f eliminates those from starts[f]
    to starts[f + 1]. Its columns stand in `numbers` of the factors from panels[f], its `heights[f]`
    rows being the eliminated unknowns, then those of its border, in `border` from borders[f].
    Factorised, they are the inverse of the triangle L of the eliminated unknowns, over M times that
    inverse, where M are the rows below L: then each front is one product in a solution.

    Parameters
    ----------
    dissection : Dissection
        Of the mesh.
    place : (unknowns,) array
        Number of each free unknown, or -1.
    rows, columns : (entries,) array
        Of the matrix of the free unknowns.
    """

    def __init__(
        self,
        dissection: Dissection,
        place: Numbers,
        rows: Numbers,
        columns: Numbers,
    ) -> None:
        inner = [_unknowns(nodes, place) for nodes in dissection.inner]
        self.order = np.concatenate(inner)
        rank = np.argsort(self.order)
        border = [np.sort(rank[_unknowns(nodes, place)]) for nodes in dissection.border]
        widths = np.array([len(unknowns) for unknowns in inner])
        depths = np.array([len(unknowns) for unknowns in border])
        self.starts = np.append(0, np.cumsum(widths))
        self.border = np.concatenate(border)
        self.borders = np.append(0, np.cumsum(depths))
        self.heights = widths + depths
        self.panels = np.append(0, np.cumsum(widths * self.heights))
        front = np.repeat(np.arange(len(inner)), widths)
        self._keys = np.repeat(np.arange(len(inner)), depths) * len(rank) + self.border
        i = rank[rows]
        j = rank[columns]
        self.lower = np.flatnonzero(i >= j)
        i = i[self.lower]
        j = j[self.lower]
        f = front[j]
        local_column = j - self.starts[f]
        self.places = self.panels[f] + local_column * self.heights[f] + self._local_rows(f, i)
        self.updates: list[list[tuple[int, Numbers]]] = []
        for number, halves in enumerate(dissection.halves):
            local_rows = [self._local_rows(np.asarray(number), border[half]) for half in halves]
            self.updates.append(list(zip(halves, local_rows, strict=True)))

    def _local_rows(self, f: Numbers, i: Numbers) -> Numbers:
        """Return the rows in fronts f of the unknowns i."""
        keys = f * len(self.order) + i
        width = self.starts[f + 1] - self.starts[f]
        on_border = np.searchsorted(self._keys, keys) - self.borders[f] + width
        return np.where(i < self.starts[f + 1], i - self.starts[f], on_border)

    def factorised(self, data: Array, number: type = np.float32) -> NestedFactors | None:
        """Return the factors of a symmetric matrix; None if it is not positive definite.

        Parameters
        ----------
        data : array
            Its entries, in the order of `rows` and `columns`.
        number : type
            Type of the factors' numbers.
        """
        potrf, trtri = scipy.linalg.get_lapack_funcs(("potrf", "trtri"), dtype=number)
        syrk, trmm = scipy.linalg.get_blas_funcs(("syrk", "trmm"), dtype=number)
        numbers: Floats = np.zeros(self.panels[-1], dtype=number)
        numbers[self.places] = data[self.lower]
        remainders: list[Floats] = []
        for f, updates in enumerate(self.updates):
            height = int(self.heights[f])
            panel = numbers[self.panels[f] : self.panels[f + 1]].reshape(height, -1, order="F")
            width = panel.shape[1]
            remainder: Floats = np.zeros((height - width,) * 2, dtype=number, order="F")
            for half, local_rows in updates:
                _add_remainder(panel, remainder, remainders[half], local_rows)
                remainders[half] = remainder[:0]
            if width:
                factor, info = potrf(panel[:width], lower=1)
                if info:
                    return None
                inverse, _ = trtri(factor, lower=1)
                panel[:width] = inverse
            if 0 < width < height:
                lower_rows = trmm(1.0, inverse, panel[width:], side=1, lower=1, trans_a=1)
                remainder = syrk(
                    -1.0,
                    lower_rows,
                    1.0,
                    remainder,
                    lower=1,
                    overwrite_c=1,
                )
                panel[width:] = trmm(1.0, inverse, lower_rows, side=1, lower=1)
            remainders.append(remainder)
        return NestedFactors(self, numbers)


def _unknowns(nodes: Numbers, place: Numbers) -> Numbers:
    """Return the numbers of the free unknowns of nodes.

    Parameters
    ----------
    nodes : (n,) array of int
    place : (unknowns,) array of int
        Number of each unknown among the free ones, or -1.
    """
    unknowns = place[(3 * nodes[:, None] + np.arange(3)).ravel()]
    return unknowns[unknowns >= 0]


@dataclass(frozen=True, eq=False)
class NestedFactors:
    """Inverse of a symmetric matrix by Cholesky's factors."""

    fronts: Fronts
    numbers: Floats

    def pivots(self) -> Array:
        """Return the pivots (free,) of the elimination, by unknown."""
        fronts = self.fronts
        f = np.repeat(np.arange(len(fronts.heights)), np.diff(fronts.starts))
        column = np.arange(len(f)) - fronts.starts[f]
        pivots = np.empty(len(f))
        pivots[fronts.order] = self.numbers[fronts.panels[f] + column * (fronts.heights[f] + 1)]
        return 1.0 / pivots**2

    def __call__(self, rhs: Array) -> Array:
        fronts = self.fronts
        ordered = rhs[fronts.order].astype(self.numbers.dtype)
        _solve(
            self.numbers,
            fronts.panels,
            fronts.starts,
            fronts.border,
            fronts.borders,
            ordered,
            np.empty(int(fronts.heights.max()), dtype=self.numbers.dtype),
        )
        x = np.empty(len(rhs))
        x[fronts.order] = ordered
        return x


@compiled()
def _add_remainder(  # type: ignore[no-untyped-def]
    panel,
    remainder,
    update,
    local_rows,
):
    """Add what the elimination of a half left, lower triangle, to a front; local_rows : its rows.

    panel, remainder : columns of the front that are eliminated in it, and the others.
    """
    width = panel.shape[1]
    count = local_rows.shape[0]
    for j in range(count):
        column = local_rows[j]
        if column < width:
            for i in range(j, count):
                panel[local_rows[i], column] += update[i, j]
        else:
            for i in range(j, count):
                remainder[local_rows[i] - width, column - width] += update[i, j]


@compiled()
def _solve(  # type: ignore[no-untyped-def]
    numbers,
    panels,
    starts,
    border,
    borders,
    x,
    work,
):
    """Overwrite x (free,) by the solution.

    Parameters
    ----------
    work
        Scratch. See `Fronts` for the other arrays.
    """
    count = starts.shape[0] - 1
    for f in range(count):
        panel = numbers[panels[f] : panels[f + 1]]
        inner = x[starts[f] : starts[f + 1]]
        outer = border[borders[f] : borders[f + 1]]
        width = inner.shape[0]
        if width == 0:
            continue
        column = work[: width + outer.shape[0]]
        np.dot(inner, panel.reshape(width, -1), column)
        inner[:] = column[:width]
        for k in range(outer.shape[0]):
            x[outer[k]] -= column[width + k]
    for f in range(count - 1, -1, -1):
        panel = numbers[panels[f] : panels[f + 1]]
        inner = x[starts[f] : starts[f + 1]]
        outer = border[borders[f] : borders[f + 1]]
        width = inner.shape[0]
        if width == 0:
            continue
        column = work[: width + outer.shape[0]]
        column[:width] = inner
        for k in range(outer.shape[0]):
            column[width + k] = -x[outer[k]]
        np.dot(panel.reshape(width, -1), column, inner)
