"""Direct differentiation of the membrane through its strain path, compiled.

For every parameter b:  K du/db = -dR/db at fixed displacement, where dR/db carries the explicit
dependence on b and the derivatives of the strain and stress at the start of the increment. After
the solve, strain and stress derivatives are advanced to the end of the increment.
"""

from __future__ import annotations

import numpy as np

from ...caching import compiled
from ...materials.point_law import (
    BEFORE1,
    BEFORE2,
    BEFORE3,
    BY1,
    BY2,
    D11,
    D11_E1,
    D11_E2,
    D11_NU,
    D12,
    D22,
    D22_E1,
    D22_E2,
    D22_NU,
    FAST,
    G12,
    RATIO1,
    RATIO2,
    SLOPES,
    TURN1,
    TURN2,
    membrane_stress,
)
from ...materials.point_moduli import by_pieces
from .kernel import base_vectors, metric

#: What `explicit` leaves at each point for `advance`: f (6), d strain/dE (9), law tangent (9).
POINT = 24


@compiled(fastmath=FAST)
def explicit(  # type: ignore[no-untyped-def]
    position, quads, values, slopes, area, thickness, pieces, coupling, power,
    h_old, s_old, rows, by_coupling, push, dh_old, ds_old, ds_new, point, rate,
):  # fmt: skip
    """Derivative of the residual at fixed displacement.

    rows (3, P, 4, np) derivatives of the pieces' coefficients by the parameters, by_coupling
    (3, np) those of what couples warp and fill, push the number of the parameter that is a
    pressure, or -1; dh_old, ds_old (elements, 4, 3, np) derivatives at the start of the increment;
    writes ds_new (same shape; the part at fixed displacement), point (elements, 4, POINT) and
    rate (3 n, np).
    """
    nu, by_nu, count = coupling[0], by_coupling[0], by_coupling.shape[1]
    rate[:] = 0.0
    h, s_new, pk2 = np.empty(3), np.empty(3), np.empty(3)
    weights, steep = np.empty((pieces.shape[1], 4)), np.empty(SLOPES)
    p, law, pull = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    work, stiff = np.empty((3, 3)), np.empty((3, 3))
    x, f = np.empty((4, 3)), np.empty((2, 3))
    own = np.empty((3, count))  # explicit derivatives of (E1, E2, G12) by each parameter
    t0, t1, t2 = np.empty(count), np.empty(count), np.empty(count)
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
                m, q, c, pieces, coupling, power, h_old[e, g], s_old[e, g], h, s_new,
                pk2, stiff, p, law, steep, pull, work,
            )  # fmt: skip
            for i in range(3):
                first, stop = by_pieces(pieces, i, h[i], h_old[e, g, i], weights)
                row = own[i]
                row[:] = 0.0
                for k in range(first, stop):
                    w0, w1, w2, w3 = weights[k, 0], weights[k, 1], weights[k, 2], weights[k, 3]
                    third, second, first_power, constant = rows[i, k]
                    for j in range(count):
                        row[j] += (
                            w0 * third[j] + w1 * second[j] + w2 * first_power[j] + w3 * constant[j]
                        )
            dh0, dh1, dh2 = h[0] - h_old[e, g, 0], h[1] - h_old[e, g, 1], h[2] - h_old[e, g, 2]
            wt = area[e, g] * thickness[e]
            for i in range(3):
                for k in range(3):
                    pull[i, k] *= wt
            old, before = dh_old[e, g], ds_old[e, g]
            after = ds_new[e, g]
            for j in range(count):
                o0, o1, o2 = old[0, j], old[1, j], old[2, j]
                warp = own[0, j] + o0 * steep[BEFORE1] + by_coupling[1, j] * steep[RATIO1]
                fill = own[1, j] + o1 * steep[BEFORE2] + by_coupling[2, j] * steep[RATIO2]
                shear = own[2, j] + o2 * steep[BEFORE3]
                d11 = steep[D11_E1] * warp + steep[D11_E2] * fill + by_nu[j] * steep[D11_NU]
                d22 = steep[D22_E1] * warp + steep[D22_E2] * fill + by_nu[j] * steep[D22_NU]
                d12 = nu * d22 + by_nu[j] * steep[D22]
                a0 = before[0, j] + d11 * dh0 + d12 * dh1 - steep[D11] * o0 - steep[D12] * o1
                a1 = before[1, j] + d12 * dh0 + d22 * dh1 - steep[D12] * o0 - steep[D22] * o1
                a2 = before[2, j] + shear * dh2 - steep[G12] * o2
                turn = steep[BY1] * (a0 + before[0, j]) + steep[BY2] * (a1 + before[1, j])
                a0 += turn * steep[TURN1]
                a1 += turn * steep[TURN2]
                after[0, j], after[1, j], after[2, j] = a0, a1, a2
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
                record[k], record[3 + k] = f[0, k], f[1, k]
                for i in range(3):
                    record[6 + 3 * i + k], record[15 + 3 * i + k] = p[i, k], law[i, k]
        for n in range(4):
            for k in range(3):
                for j in range(count):
                    rate[3 * quads[e, n] + k, j] += local[3 * n + k, j]


@compiled(fastmath=FAST)
def advance(quads, slopes, point, du, dh, ds):  # type: ignore[no-untyped-def]
    """Add what the displacement derivatives du (3 n, np) bring to dh and ds (in place)."""
    count = du.shape[1]
    e0, e1, e2 = np.empty(count), np.empty(count), np.empty(count)
    for e in range(quads.shape[0]):
        for g in range(4):
            record, dn = point[e, g], slopes[e, g]
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
            strain, stress = dh[e, g], ds[e, g]
            for j in range(count):
                a0 = record[6] * e0[j] + record[7] * e1[j] + record[8] * e2[j]
                a1 = record[9] * e0[j] + record[10] * e1[j] + record[11] * e2[j]
                a2 = record[12] * e0[j] + record[13] * e1[j] + record[14] * e2[j]
                strain[0, j], strain[1, j], strain[2, j] = a0, a1, a2
                stress[0, j] += record[15] * a0 + record[16] * a1 + record[17] * a2
                stress[1, j] += record[18] * a0 + record[19] * a1 + record[20] * a2
                stress[2, j] += record[21] * a0 + record[22] * a1 + record[23] * a2
