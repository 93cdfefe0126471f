"""Residual and consistent tangent of the membrane and their derivatives, compiled.

Total Lagrangian: with base vectors F1, F2 (images of the unit warp and fill vectors) the virtual
strains are B_n = a_n A0 + d_n A1, a_n and d_n the derivatives of shape function n. So the tangent
of a node pair is a_n (a_m K00 + d_m K01) + d_n (a_m K10 + d_m K11), four 3 x 3 blocks a Gauss
point: `assemble`. Direct differentiation through the strain path, for every parameter b: K du/db =
-dR/db at fixed displacement (`explicit`; `by_sheet` for parameters of the stress-free shape); after
the solve, `advance` takes strain and stress derivatives to the end of the increment.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...compilation import compiled
from ...errors import InputError
from ...materials.memory import BY_X, ON, RECALLED, remember
from ...materials.pieces import by_pieces
from ...materials.point_law import BEFORE3, CRIMPED, G12, SLOPES, membrane_stress, stress_rate
from ...materials.wrinkles import relaxed_membrane_stress

# mypy does not see through numba; the shapes are in the docstrings.

Array = NDArray[np.float64]
#: Numbers that `explicit` leaves at each point for `advance`: f (6), d strain/dE (9), tangent (9);
#: of a law that remembers, too, derivatives by the strain of the largest ones and own stresses (6).
POINT = 24
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


@compiled(inline="always")
def base_vectors(x, slopes, f):  # type: ignore[no-untyped-def]
    """Write f (2, 3), the images of the unit warp and fill vectors; x (4, 3), slopes (2, 4)."""
    for i in range(2):
        for k in range(3):
            f[i, k] = (
                slopes[i, 0] * x[0, k]
                + slopes[i, 1] * x[1, k]
                + slopes[i, 2] * x[2, k]
                + slopes[i, 3] * x[3, k]
            )


@compiled(inline="always")
def metric(f):  # type: ignore[no-untyped-def]
    """Return m, q, c of the Cauchy-Green components (see materials/point_law.py)."""
    c11 = f[0, 0] ** 2 + f[0, 1] ** 2 + f[0, 2] ** 2
    c22 = f[1, 0] ** 2 + f[1, 1] ** 2 + f[1, 2] ** 2
    c12 = f[0, 0] * f[1, 0] + f[0, 1] * f[1, 1] + f[0, 2] * f[1, 2]
    return 0.5 * (c11 + c22), 0.5 * (c11 - c22), c12


@compiled()
def assemble(  # type: ignore[no-untyped-def]
    position,
    quads,
    values,
    slopes,
    area,
    thickness,
    pressure,
    pieces,
    coupling,
    power,
    h_old,
    s_old,
    h_new,
    s_new,
    slot,
    data,
    residual,
    with_tangent,
    share,
    wrinkle,
):
    """Write internal minus pressure forces at `position`, and the tangent.

    h_*, s_* (elements, 4, 3) log strain and stress before (old) and here (new, written); slot
    (elements, 144) place of each element entry in `data` (-1: held); share : left to wrinkles, and
    wrinkle (elements, 4, 3), the strain of the fabric less that of the surface, is written; None
    for a membrane that does not wrinkle, for which no code of wrinkles is compiled. Returns the
    largest nodal pressure force of an element (N), or -1 without valid stress at a point.
    """
    residual[:] = 0.0
    if with_tangent:
        data[:] = 0.0
    p = np.empty((3, 3))
    law = np.empty((3, 3))
    pull = np.empty((3, 3))
    work = np.empty((3, 3))
    stiff = np.empty((3, 3))
    pk2 = np.empty(3)
    steep = np.empty(SLOPES)
    total = np.empty(3)
    x = np.empty((4, 3))
    f = np.empty((2, 3))
    left = np.empty((3, 12))  # rows: a_m K00 + d_m K01
    right = np.empty((3, 12))
    push = np.empty((3, 12))  # follower pressure
    element = np.empty((12, 12))
    force = np.empty(12)
    k00 = np.empty((3, 3))
    k01 = np.empty((3, 3))
    k10 = np.empty((3, 3))
    k11 = np.empty((3, 3))
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
            if share is not None:
                # Only of a law without a memory, see `closed.prepare`.
                if (
                    relaxed_membrane_stress(
                        m,
                        q,
                        c,
                        pieces,
                        coupling,
                        power,
                        share,
                        h_old[e, g],
                        s_old[e, g],
                        total,
                        h_new[e, g],
                        s_new[e, g],
                        pk2,
                        stiff,
                        p,
                        law,
                        steep,
                        pull,
                        work,
                    )
                    < 0
                ):
                    return -1.0
                for k in range(3):
                    wrinkle[e, g, k] = h_new[e, g, k] - total[k]
            elif not membrane_stress(
                m,
                q,
                c,
                pieces,
                coupling,
                power,
                h_old[e, g],
                s_old[e, g],
                h_new[e, g],
                s_new[e, g],
                pk2,
                stiff,
                p,
                law,
                steep,
                pull,
                work,
            ):
                return -1.0
            wt = area[e, g] * thickness[e]
            wp = area[e, g] * pressure
            nx = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
            ny = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
            nz = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
            s0 = wt * pk2[0]
            s1 = wt * pk2[1]
            s2 = wt * pk2[2]
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
                f0 = f[0, i]
                f1 = f[1, i]
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
                a = dn[0, n]
                d = dn[1, n]
                z0 = wp * (d * f[0, 0] - a * f[1, 0])
                z1 = wp * (d * f[0, 1] - a * f[1, 1])
                z2 = wp * (d * f[0, 2] - a * f[1, 2])
                c0 = 3 * n
                c1 = 3 * n + 1
                c2 = 3 * n + 2
                push[0, c0] = 0.0
                push[0, c1] = z2
                push[0, c2] = -z1
                push[1, c0] = -z2
                push[1, c1] = 0.0
                push[1, c2] = z0
                push[2, c0] = z1
                push[2, c1] = -z0
                push[2, c2] = 0.0
                for i in range(3):
                    for j in range(3):
                        left[i, 3 * n + j] = a * k00[i, j] + d * k01[i, j]
                        right[i, 3 * n + j] = a * k10[i, j] + d * k11[i, j]
            for n in range(4):
                a = dn[0, n]
                d = dn[1, n]
                shape = values[g, n]
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


@dataclass(frozen=True, eq=False)
class ReferenceElements:
    """Shape functions and their derivatives in each facet's material frame.

    values (4 points, 4 nodes); slopes (elements, 4 points, 2, 4) 1/mm; area (elements, 4 points)
    mm^2.
    """

    values: Array
    slopes: Array
    area: Array


def reference_elements(
    points: Array, quads: NDArray[np.intp], warp: Array | None = None, stretch: Array | None = None
) -> ReferenceElements:
    """Evaluate the bilinear shape functions on a flat or faceted surface (n, 2) or (n, 3) mm.

    warp : (m, 3) direction of the yarn in each facet; x unless given. stretch : (m, 4, 2, 2) of the
    yarns beside that surface; none unless given. InputError : a quad inside out.
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
    if stretch is not None:
        slopes = np.linalg.solve(stretch, slopes)
        area = area * np.linalg.det(stretch)
        if not (area > 0).all():
            raise InputError(None, "strain", "turns the stress-free sheet inside out")
    return ReferenceElements(VALUES, np.ascontiguousarray(slopes), area)


@compiled()
def explicit(  # type: ignore[no-untyped-def]
    position,
    quads,
    values,
    slopes,
    area,
    thickness,
    pieces,
    coupling,
    power,
    h_old,
    s_old,
    rows,
    by_coupling,
    push,
    dh_old,
    ds_old,
    ds_new,
    point,
    rate,
):
    """Write the derivative of the residual at fixed displacement.

    rows (3, P, 4, np), by_coupling (3, np) of `law_slopes`; push the number of the parameter that
    is a pressure, or -1; dh_old, ds_old (elements, 4, 3, np) at the start of the increment. Writes
    ds_new (the part at fixed displacement), point (elements, 4, POINT) and rate (3 n, np).
    """
    nu = coupling[0]
    count = by_coupling.shape[1]
    rate[:] = 0.0
    memory = np.empty(RECALLED)
    h = np.empty(h_old.shape[2])
    s_new = np.empty(3)
    pk2 = np.empty(3)
    weights = np.empty((pieces.shape[1], 4))
    steep = np.empty(SLOPES)
    p = np.empty((3, 3))
    law = np.empty((3, 3))
    pull = np.empty((3, 3))
    work = np.empty((3, 3))
    stiff = np.empty((3, 3))
    x = np.empty((4, 3))
    f = np.empty((2, 3))
    own = np.empty((3, count))  # explicit derivatives of (E1, E2, G12) by each parameter
    t0 = np.empty(count)
    t1 = np.empty(count)
    t2 = np.empty(count)
    local = np.empty((12, count))
    for e in range(quads.shape[0]):
        for n in range(4):
            for k in range(3):
                x[n, k] = position[quads[e, n], k]
        local[:] = 0.0
        for g in range(4):
            dn = slopes[e, g]
            base_vectors(x, dn, f)
            m, q, c = metric(f)
            membrane_stress(
                m,
                q,
                c,
                pieces,
                coupling,
                power,
                h_old[e, g],
                s_old[e, g],
                h,
                s_new,
                pk2,
                stiff,
                p,
                law,
                steep,
                pull,
                work,
            )
            for i in range(3):
                first, stop = by_pieces(pieces, i, h[i], h_old[e, g, i], weights)
                row = own[i]
                row[:] = 0.0
                for k in range(first, stop):
                    w0 = weights[k, 0]
                    w1 = weights[k, 1]
                    w2 = weights[k, 2]
                    w3 = weights[k, 3]
                    third, second, first_power, constant = rows[i, k]
                    for j in range(count):
                        row[j] += (
                            w0 * third[j] + w1 * second[j] + w2 * first_power[j] + w3 * constant[j]
                        )
            if len(coupling) > CRIMPED:
                for i in range(3):
                    remember(
                        pieces,
                        coupling,
                        i,
                        h,
                        h_old[e, g],
                        rows,
                        by_coupling,
                        dh_old[e, g],
                        weights,
                        own[i],
                        memory,
                    )
                    point[e, g, POINT + i] = memory[ON]
                    point[e, g, POINT + 3 + i] = memory[BY_X]
            dh2 = h[2] - h_old[e, g, 2]
            wt = area[e, g] * thickness[e]
            for i in range(3):
                for k in range(3):
                    pull[i, k] *= wt
            old = dh_old[e, g]
            before = ds_old[e, g]
            after = ds_new[e, g]
            for j in range(count):
                stress_rate(steep, nu, own, by_coupling, j, old, before, after)
                shear = own[2, j] + old[2, j] * steep[BEFORE3]
                a0 = after[0, j]
                a1 = after[1, j]
                a2 = before[2, j] + shear * dh2 - steep[G12] * old[2, j]
                after[2, j] = a2
                t0[j] = pull[0, 0] * a0 + pull[0, 1] * a1 + pull[0, 2] * a2
                t1[j] = pull[1, 0] * a0 + pull[1, 1] * a1 + pull[1, 2] * a2
                t2[j] = pull[2, 0] * a0 + pull[2, 1] * a1 + pull[2, 2] * a2
            for n in range(4):
                for k in range(3):
                    b0 = dn[0, n] * f[0, k]
                    b1 = dn[1, n] * f[1, k]
                    b2 = dn[0, n] * f[1, k] + dn[1, n] * f[0, k]
                    for j in range(count):
                        local[3 * n + k, j] += b0 * t0[j] + b1 * t1[j] + b2 * t2[j]
            if push >= 0:
                nx = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
                ny = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
                nz = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
                for n in range(4):
                    share = area[e, g] * values[g, n]
                    local[3 * n, push] -= share * nx
                    local[3 * n + 1, push] -= share * ny
                    local[3 * n + 2, push] -= share * nz
            record = point[e, g]
            for k in range(3):
                record[k] = f[0, k]
                record[3 + k] = f[1, k]
                for i in range(3):
                    record[6 + 3 * i + k] = p[i, k]
                    record[15 + 3 * i + k] = law[i, k]
        for n in range(4):
            for k in range(3):
                for j in range(count):
                    rate[3 * quads[e, n] + k, j] += local[3 * n + k, j]


@compiled()
def advance(quads, slopes, point, du, dh, ds):  # type: ignore[no-untyped-def]
    """Add the part of the displacement derivatives du (3 n, np) to dh and ds (in place)."""
    count = du.shape[1]
    e0 = np.empty(count)
    e1 = np.empty(count)
    e2 = np.empty(count)
    for e in range(quads.shape[0]):
        for g in range(4):
            record = point[e, g]
            dn = slopes[e, g]
            e0[:] = 0.0
            e1[:] = 0.0
            e2[:] = 0.0
            for n in range(4):
                for k in range(3):
                    b0 = dn[0, n] * record[k]
                    b1 = dn[1, n] * record[3 + k]
                    b2 = dn[0, n] * record[3 + k] + dn[1, n] * record[k]
                    row = du[3 * quads[e, n] + k]
                    for j in range(count):
                        e0[j] += b0 * row[j]
                        e1[j] += b1 * row[j]
                        e2[j] += b2 * row[j]
            strain = dh[e, g]
            stress = ds[e, g]
            for j in range(count):
                a0 = record[6] * e0[j] + record[7] * e1[j] + record[8] * e2[j]
                a1 = record[9] * e0[j] + record[10] * e1[j] + record[11] * e2[j]
                a2 = record[12] * e0[j] + record[13] * e1[j] + record[14] * e2[j]
                strain[0, j] = a0
                strain[1, j] = a1
                strain[2, j] = a2
                stress[0, j] += record[15] * a0 + record[16] * a1 + record[17] * a2
                stress[1, j] += record[18] * a0 + record[19] * a1 + record[20] * a2
                stress[2, j] += record[21] * a0 + record[22] * a1 + record[23] * a2
            for i in range(3, strain.shape[0]):
                for j in range(count):
                    strain[i, j] += record[POINT + i - 3] * strain[i % 3, j]


@compiled()
def by_sheet(  # type: ignore[no-untyped-def]
    position,
    quads,
    values,
    slopes,
    area,
    thickness,
    pressure,
    pieces,
    coupling,
    power,
    h_old,
    s_old,
    surface,
    slopes_by,
    area_by,
    green,
    rate,
):
    """Write the derivative of the residual at fixed displacement and fixed strain at the start.

    surface (n, 3, k), slopes_by (elements, 4, 2, 4, k), area_by (elements, 4, k): derivatives by k
    parameters; writes green (elements, 4, 3, k), of (E11, E22, 2 E12), and rate (3 n, k).
    """
    count = surface.shape[2]
    rate[:] = 0.0
    h = np.empty(h_old.shape[2])
    s_new = np.empty(3)
    pk2 = np.empty(3)
    steep = np.empty(SLOPES)
    p = np.empty((3, 3))
    law = np.empty((3, 3))
    pull = np.empty((3, 3))
    work = np.empty((3, 3))
    stiff = np.empty((3, 3))
    x = np.empty((4, 3))
    f = np.empty((2, 3))
    f_by = np.empty((2, 3, count))
    force = np.empty((2, 3))
    force_by = np.empty((2, 3, count))
    normal = np.empty(3)
    normal_by = np.empty((3, count))
    pk2_by = np.empty((3, count))
    local = np.empty((12, count))
    for e in range(quads.shape[0]):
        for n in range(4):
            for k in range(3):
                x[n, k] = position[quads[e, n], k]
        local[:] = 0.0
        for g in range(4):
            dn = slopes[e, g]
            dn_by = slopes_by[e, g]
            base_vectors(x, dn, f)
            m, q, c = metric(f)
            membrane_stress(
                m,
                q,
                c,
                pieces,
                coupling,
                power,
                h_old[e, g],
                s_old[e, g],
                h,
                s_new,
                pk2,
                stiff,
                p,
                law,
                steep,
                pull,
                work,
            )
            f_by[:] = 0.0
            for n in range(4):
                for k in range(3):
                    by = surface[quads[e, n], k]
                    for i in range(2):
                        for j in range(count):
                            f_by[i, k, j] += dn_by[i, n, j] * x[n, k] + dn[i, n] * by[j]
            own = green[e, g]
            own[:] = 0.0
            for k in range(3):
                for j in range(count):
                    own[0, j] += f[0, k] * f_by[0, k, j]
                    own[1, j] += f[1, k] * f_by[1, k, j]
                    own[2, j] += f[0, k] * f_by[1, k, j] + f[1, k] * f_by[0, k, j]
            for i in range(3):
                d0 = stiff[i, 0]
                d1 = stiff[i, 1]
                d2 = stiff[i, 2]
                for j in range(count):
                    pk2_by[i, j] = d0 * own[0, j] + d1 * own[1, j] + d2 * own[2, j]
            for i in range(2):
                for k in range(3):
                    # Along f[i] the stress pk2[i], along the other one the shear.
                    force[i, k] = pk2[i] * f[i, k] + pk2[2] * f[1 - i, k]
                    for j in range(count):
                        force_by[i, k, j] = (
                            pk2_by[i, j] * f[i, k]
                            + pk2[i] * f_by[i, k, j]
                            + pk2_by[2, j] * f[1 - i, k]
                            + pk2[2] * f_by[1 - i, k, j]
                        )
            for k in range(3):
                a = (k + 1) % 3
                b = (k + 2) % 3
                normal[k] = f[0, a] * f[1, b] - f[0, b] * f[1, a]
                for j in range(count):
                    normal_by[k, j] = (
                        f_by[0, a, j] * f[1, b]
                        - f_by[0, b, j] * f[1, a]
                        + f[0, a] * f_by[1, b, j]
                        - f[0, b] * f_by[1, a, j]
                    )
            share = area[e, g]
            share_by = area_by[e, g]
            wall = thickness[e] * share
            for n in range(4):
                d0 = wall * dn[0, n]
                d1 = wall * dn[1, n]
                push = pressure * values[g, n]
                for k in range(3):
                    f0 = wall * force[0, k]
                    f1 = wall * force[1, k]
                    by_area = (d0 * force[0, k] + d1 * force[1, k]) / share - push * normal[k]
                    for j in range(count):
                        local[3 * n + k, j] += (
                            by_area * share_by[j]
                            - push * share * normal_by[k, j]
                            + dn_by[0, n, j] * f0
                            + dn_by[1, n, j] * f1
                            + d0 * force_by[0, k, j]
                            + d1 * force_by[1, k, j]
                        )
        for n in range(4):
            for k in range(3):
                for j in range(count):
                    rate[3 * quads[e, n] + k, j] += local[3 * n + k, j]


def element_slopes(
    points: Array,
    quads: NDArray[np.intp],
    ways: Array,
    yarn: Array,
    yarn_by: Array,
    stretch: Array,
    stretch_by: Array,
) -> tuple[Array, Array]:
    """Return derivatives of `reference_elements`, (elements, 4, 2, 4, k) and (elements, 4, k).

    ways (k, n, 3) : directions of the points. yarn (3,), the warp of all facets, and yarn_by (k, 3)
    its own derivatives; so stretch (elements, 4, 2, 2).
    """
    yarn_by = yarn_by[:, None, None]
    base = NATURAL @ points[quads][:, None]
    base_by = NATURAL @ ways[:, quads][:, :, None]
    normal = np.cross(base[:, :, 0], base[:, :, 1])
    normal_by = np.cross(base_by[..., 0, :], base[:, :, 1])
    normal_by += np.cross(base[:, :, 0], base_by[..., 1, :])
    unit, unit_by, area, area_by = _normalised(normal, normal_by)
    # Along the yarn: its direction less the part along the normal.
    across = unit @ yarn[:, None]
    across_by = unit_by @ yarn[:, None]
    across_by += (unit * yarn_by).sum(axis=-1, keepdims=True)
    along = yarn - across * unit
    along, along_by, _, _ = _normalised(along, yarn_by - across_by * unit - across * unit_by)
    frame = np.stack([along, np.cross(unit, along)], axis=-1)
    frame_by = np.stack([along_by, np.cross(unit_by, along) + np.cross(unit, along_by)], axis=-1)
    inverse = np.linalg.inv(base @ frame)
    slopes_by = -inverse @ (base_by @ frame + base @ frame_by) @ (inverse @ NATURAL)
    # The yarns' own stretch S takes slopes to S^-1 slopes and areas to det(S) area.
    back = np.linalg.inv(stretch)
    whole = np.linalg.det(stretch)
    slopes_by = back @ (slopes_by - stretch_by @ back @ inverse @ NATURAL)
    area_by = whole * (area_by + area * np.trace(back @ stretch_by, axis1=-2, axis2=-1))
    slopes_by = np.moveaxis(slopes_by, 0, -1)
    area_by = np.moveaxis(area_by, 0, -1)
    return np.ascontiguousarray(slopes_by), np.ascontiguousarray(area_by)


def _normalised(vector: Array, by: Array) -> tuple[Array, Array, Array, Array]:
    """Return unit vectors (..., 3) and lengths (...), each followed by its derivative."""
    length = np.linalg.norm(vector, axis=-1)
    unit = vector / length[..., None]
    length_by = np.einsum("...k,...k->...", unit, by)
    return unit, (by - length_by[..., None] * unit) / length[..., None], length, length_by
