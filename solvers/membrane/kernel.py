"""Residual and consistent tangent of the membrane, compiled.

Total Lagrangian: with base vectors F1, F2 (images of the unit warp and fill vectors) the virtual
strains are B_n = a_n A0 + d_n A1, a_n and d_n being the derivatives of shape function n, and
A0, A1 (3 strains x 3 directions) built from F1 and F2. So the tangent of a node pair is
a_n (a_m K00 + d_m K01) + d_n (a_m K10 + d_m K11), with four 3 x 3 blocks a Gauss point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...files import compiled
from ...materials.point_law import FAST, SLOPES, membrane_stress
from ...materials.wrinkles import relaxed_membrane_stress

# mypy does not see through numba; the shapes are in the docstrings.


@compiled(fastmath=FAST, inline="always")
def base_vectors(x, slopes, f):  # type: ignore[no-untyped-def]
    """f (2, 3): images of the unit warp and fill vectors; x (4, 3), slopes (2, 4)."""
    for i in range(2):
        for k in range(3):
            f[i, k] = (
                slopes[i, 0] * x[0, k]
                + slopes[i, 1] * x[1, k]
                + slopes[i, 2] * x[2, k]
                + slopes[i, 3] * x[3, k]
            )


@compiled(fastmath=FAST, inline="always")
def metric(f):  # type: ignore[no-untyped-def]
    """m, q, c of the Cauchy-Green components (see materials/point_law.py)."""
    c11 = f[0, 0] ** 2 + f[0, 1] ** 2 + f[0, 2] ** 2
    c22 = f[1, 0] ** 2 + f[1, 1] ** 2 + f[1, 2] ** 2
    c12 = f[0, 0] * f[1, 0] + f[0, 1] * f[1, 1] + f[0, 2] * f[1, 2]
    return 0.5 * (c11 + c22), 0.5 * (c11 - c22), c12


@compiled(fastmath=FAST)
def assemble(  # type: ignore[no-untyped-def]
    position, quads, values, slopes, area, thickness, pressure,
    pieces, coupling, power, h_old, s_old, h_new, s_new, slot, data, residual, with_tangent,
    share, wrinkle,
):  # fmt: skip
    """Internal minus pressure forces at `position`, and the tangent.

    position (n, 3) mm; thickness (elements,) mm; h_*, s_* (elements, 4, 3) log strain and stress
    before (old) and at this position (new, written); slot (elements, 144) place of each element
    entry in the sparse `data` (-1: held), written when `with_tangent`; residual (3 n,) written;
    share : of the stiffness, left to wrinkles; below 0 the membrane does not wrinkle, otherwise
    strain and stress are those of the fabric and wrinkle (elements, 4, 3), its strain less that
    of the surface, is written (see materials/wrinkles.py).

    Returns the largest nodal pressure force of an element (N), or -1 when a point has no valid
    stress.
    """
    residual[:] = 0.0
    if with_tangent:
        data[:] = 0.0
    p, law = np.empty((3, 3)), np.empty((3, 3))
    pull, work, stiff = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    pk2, steep, total = np.empty(3), np.empty(SLOPES), np.empty(3)
    x, f = np.empty((4, 3)), np.empty((2, 3))
    left = np.empty((3, 12))  # rows: a_m K00 + d_m K01
    right = np.empty((3, 12))
    push = np.empty((3, 12))  # follower pressure
    element, force = np.empty((12, 12)), np.empty(12)
    k00, k01 = np.empty((3, 3)), np.empty((3, 3))
    k10, k11 = np.empty((3, 3)), np.empty((3, 3))
    largest = 0.0
    for e in range(quads.shape[0]):
        for n in range(4):
            for k in range(3):
                x[n, k] = position[quads[e, n], k]
        force[:] = 0.0
        if with_tangent:
            element[:] = 0.0
        for g in range(4):
            dn = slopes[e, g]
            base_vectors(x, dn, f)
            m, q, c = metric(f)
            if share >= 0.0:
                if relaxed_membrane_stress(
                    m, q, c, pieces, coupling, power, share, h_old[e, g], s_old[e, g], total,
                    h_new[e, g], s_new[e, g], pk2, stiff, p, law, steep, pull, work,
                ) < 0:  # fmt: skip
                    return -1.0
                for k in range(3):
                    wrinkle[e, g, k] = h_new[e, g, k] - total[k]
            elif not membrane_stress(
                m, q, c, pieces, coupling, power, h_old[e, g], s_old[e, g], h_new[e, g],
                s_new[e, g], pk2, stiff, p, law, steep, pull, work,
            ):  # fmt: skip
                return -1.0
            wt = area[e, g] * thickness[e]
            wp = area[e, g] * pressure
            nx = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
            ny = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
            nz = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
            s0, s1, s2 = wt * pk2[0], wt * pk2[1], wt * pk2[2]
            for n in range(4):
                g0 = dn[0, n] * s0 + dn[1, n] * s2
                g1 = dn[1, n] * s1 + dn[0, n] * s2
                load = wp * values[g, n]
                force[3 * n] += g0 * f[0, 0] + g1 * f[1, 0] - load * nx
                force[3 * n + 1] += g0 * f[0, 1] + g1 * f[1, 1] - load * ny
                force[3 * n + 2] += g0 * f[0, 2] + g1 * f[1, 2] - load * nz
                largest = max(largest, load * max(abs(nx), abs(ny), abs(nz)))
            if not with_tangent:
                continue
            for i in range(3):
                for j in range(3):
                    stiff[i, j] *= wt
            for i in range(3):
                f0, f1 = f[0, i], f[1, i]
                # row i of A0^T D and of A1^T D
                u0 = f0 * stiff[0, 0] + f1 * stiff[2, 0]
                u1 = f0 * stiff[0, 1] + f1 * stiff[2, 1]
                u2 = f0 * stiff[0, 2] + f1 * stiff[2, 2]
                v0 = f1 * stiff[1, 0] + f0 * stiff[2, 0]
                v1 = f1 * stiff[1, 1] + f0 * stiff[2, 1]
                v2 = f1 * stiff[1, 2] + f0 * stiff[2, 2]
                for j in range(3):
                    k00[i, j] = u0 * f[0, j] + u2 * f[1, j]
                    k01[i, j] = u1 * f[1, j] + u2 * f[0, j]
                    k10[i, j] = v0 * f[0, j] + v2 * f[1, j]
                    k11[i, j] = v1 * f[1, j] + v2 * f[0, j]
                k00[i, i] += s0
                k01[i, i] += s2
                k10[i, i] += s2
                k11[i, i] += s1
            for n in range(4):
                a, d = dn[0, n], dn[1, n]
                z0 = wp * (d * f[0, 0] - a * f[1, 0])
                z1 = wp * (d * f[0, 1] - a * f[1, 1])
                z2 = wp * (d * f[0, 2] - a * f[1, 2])
                c0, c1, c2 = 3 * n, 3 * n + 1, 3 * n + 2
                push[0, c0], push[0, c1], push[0, c2] = 0.0, z2, -z1
                push[1, c0], push[1, c1], push[1, c2] = -z2, 0.0, z0
                push[2, c0], push[2, c1], push[2, c2] = z1, -z0, 0.0
                for i in range(3):
                    for j in range(3):
                        left[i, 3 * n + j] = a * k00[i, j] + d * k01[i, j]
                        right[i, 3 * n + j] = a * k10[i, j] + d * k11[i, j]
            for n in range(4):
                a, d, shape = dn[0, n], dn[1, n], values[g, n]
                for i in range(3):
                    for j in range(12):
                        element[3 * n + i, j] += (
                            a * left[i, j] + d * right[i, j] + shape * push[i, j]
                        )
        for n in range(4):
            for k in range(3):
                residual[3 * quads[e, n] + k] += force[3 * n + k]
        if with_tangent:
            for i in range(12):
                for j in range(12):
                    place = slot[e, 12 * i + j]
                    if place >= 0:
                        data[place] += element[i, j]
    return largest


Array = NDArray[np.float64]

_G = 1.0 / np.sqrt(3.0)
#: 2 x 2 Gauss points of the square; all weights are one.
GAUSS_POINTS = np.array([[-_G, -_G], [_G, -_G], [_G, _G], [-_G, _G]])
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
#: Bilinear shape functions (point, node) and their derivatives (point, 2, node) on the square.
VALUES = 0.25 * np.prod(1.0 + GAUSS_POINTS[:, None, :] * _CORNERS[None], axis=2)
NATURAL = 0.25 * np.stack(
    [
        _CORNERS[:, 0] * (1.0 + GAUSS_POINTS[:, None, 1] * _CORNERS[:, 1]),
        _CORNERS[:, 1] * (1.0 + GAUSS_POINTS[:, None, 0] * _CORNERS[:, 0]),
    ],
    axis=1,
)


@dataclass(frozen=True, eq=False)
class ReferenceElements:
    """Shape functions and their derivatives in each facet's material frame.

    values (4 points, 4 nodes); slopes (elements, 4 points, 2, 4) d N/d (warp, fill) in 1/mm;
    area (elements, 4 points) mm^2 of reference surface at each Gauss point.
    """

    values: Array
    slopes: Array
    area: Array


def reference_elements(
    points: Array, quads: NDArray[np.intp], warp: Array | None = None
) -> ReferenceElements:
    """Evaluate the bilinear shape functions on a flat or faceted surface.

    Parameters
    ----------
    points : (n, 2) or (n, 3) mm. quads : (m, 4).
    warp : (m, 3) direction of the warp yarn in each facet; x unless given.

    Raises
    ------
    InputError : a quad that is inside out, or a warp direction normal to its facet.
    """
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    base = np.einsum("pan,mnk->mpak", NATURAL, points[quads])
    normal = np.cross(base[:, :, 0], base[:, :, 1])
    area = np.linalg.norm(normal, axis=2)
    centre = normal.sum(axis=1)
    if (area <= 0).any() or (np.einsum("mpk,mk->mp", normal, centre) <= 0).any():
        bad = int(np.argmin(np.einsum("mpk,mk->mp", normal, centre).min(axis=1)))
        raise InputError(None, f"element {bad}", "is degenerate or inside out; mend the mesh")
    unit = normal / area[:, :, None]
    yarn = np.broadcast_to([1.0, 0.0, 0.0], (len(quads), 3)) if warp is None else warp
    along = yarn[:, None, :] - np.einsum("mk,mpk->mp", yarn, unit)[:, :, None] * unit
    length = np.linalg.norm(along, axis=2, keepdims=True)
    if (length < 1e-6).any():
        raise InputError(None, "warp", "the warp direction is normal to a facet")
    along /= length
    frame = np.stack([along, np.cross(unit, along)], axis=2)  # (m, p, 2, 3)
    jacobian = np.einsum("mpak,mpbk->mpab", base, frame)
    slopes = np.einsum("mpab,pan->mpbn", np.linalg.inv(jacobian).transpose(0, 1, 3, 2), NATURAL)
    return ReferenceElements(VALUES, np.ascontiguousarray(slopes), area)
