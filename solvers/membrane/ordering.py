"""Orders of the unknowns that keep the tangent's band narrow."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import reverse_cuthill_mckee

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

NEAR = 1e-9  # of the length


def swept(quads: Numbers, points: Array) -> list[Numbers]:
    """Orders of the nodes (n,), swept from either end of the longest axis.

    Cuthill and McKee start at one node, so that on a tube their fronts lie askew and are up to
    twice as long as a ring; started at all nodes of an end they are the rings.
    """
    axis = int(np.ptp(points, axis=0).argmax())
    along = points[:, axis]
    near = NEAR * float(np.ptp(along))
    rows, columns = np.repeat(quads, 4, axis=1).ravel(), np.tile(quads, (1, 4)).ravel()
    graph = sp.csr_matrix((np.ones(len(rows)), (rows, columns)), shape=(len(points),) * 2)
    ends = (np.flatnonzero(np.abs(along - at) <= near) for at in (along.min(), along.max()))
    return [_from(graph, end) for end in ends]


def _from(graph: sp.csr_matrix, end: Numbers) -> Numbers:
    """Breadth first from the nodes of an end, which follow one another along it."""
    first = end[reverse_cuthill_mckee(graph[end][:, end].tocsr(), symmetric_mode=True)]
    degree, seen = np.diff(graph.indptr), np.zeros(graph.shape[0], dtype=bool)
    seen[first] = True
    order, at = first.tolist(), 0
    while at < len(order):
        beside = graph.indices[graph.indptr[order[at]] : graph.indptr[order[at] + 1]]
        fresh = beside[~seen[beside]]
        fresh = fresh[np.argsort(degree[fresh], kind="stable")]
        seen[fresh] = True
        order += fresh.tolist()
        at += 1
    # What hangs together with no end comes last; it has a band of its own.
    return np.concatenate([order, np.flatnonzero(~seen)]).astype(np.intp)
