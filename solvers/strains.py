"""Strains of a surface from the displacements that a solver reports."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..meshes.mesh import Mesh
from ..meshes.strain import log_strain_of
from .membrane.element import reference_elements

Array = NDArray[np.float64]


def log_strain(mesh: Mesh, displacements: Array, warp: Array | None = None) -> Array:
    """(frames, quads, 4, 3) log strain (eps1, eps2, gamma12) at the quads' Gauss points.

    displacements : (frames, nodes, 3) mm. warp : (3,) direction of the warp; x unless given.
    """
    points, quads = np.asarray(mesh.points, float), np.asarray(mesh.quads)
    yarn = None if warp is None else np.broadcast_to(warp, (len(quads), 3))
    slopes = reference_elements(points, quads, yarn).slopes
    frames = []
    for displacement in displacements:
        gradient = np.einsum("mpin,mnk->mpki", slopes, (points + displacement)[quads])
        frames.append(log_strain_of(gradient))
    return np.array(frames)


def extremes(strain: Array) -> tuple[Array, Array]:
    """Least and largest of each of the last axis' components, the unstrained start included."""
    flat = strain.reshape(-1, strain.shape[-1])
    return np.minimum(flat.min(axis=0), 0.0), np.maximum(flat.max(axis=0), 0.0)
