"""Direct differentiation of the membrane by its own stress-free shape, compiled.

A sheet that is raised, or longer, has other shape function slopes and areas, and with the same
displacement other places. That gives the residual and the strains an explicit derivative, which
`explicit` of sensitivity.py, written for the law's numbers, does not have.
"""

from __future__ import annotations

import numpy as np

from ...caching import compiled
from ...materials.point_law import FAST, SLOPES, membrane_stress
from .kernel import base_vectors, metric


@compiled(fastmath=FAST)
def by_sheet(  # type: ignore[no-untyped-def]
    position, quads, values, slopes, area, thickness, pressure, pieces, coupling, power, h_old,
    s_old, surface, slopes_by, area_by, green, rate,
):  # fmt: skip
    """Derivative of the residual at fixed displacement and fixed strain before the increment.

    surface (k, n, 3), slopes_by (k, elements, 4, 2, 4), area_by (k, elements, 4): derivatives of
    the reference places, of the shape functions' slopes and of the area by k parameters; writes
    green (elements, 4, 3, k), of the Green-Lagrange strain (E11, E22, 2 E12), and rate (3 n, k).
    """
    count = len(surface)
    rate[:] = 0.0
    h, s_new, pk2 = np.empty(3), np.empty(3), np.empty(3)
    steep = np.empty(SLOPES)
    p, law, pull = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    work, stiff = np.empty((3, 3)), np.empty((3, 3))
    x, f, f_by = np.empty((4, 3)), np.empty((2, 3)), np.empty((2, 3))
    first, second = np.empty(3), np.empty(3)
    first_by, second_by = np.empty(3), np.empty(3)
    normal, normal_by = np.empty(3), np.empty(3)
    for e in range(quads.shape[0]):
        for n in range(4):
            for k in range(3):
                x[n, k] = position[quads[e, n], k]
        for g in range(4):
            dn = slopes[e, g]
            base_vectors(x, dn, f)
            m, q, c = metric(f)
            membrane_stress(
                m, q, c, pieces, coupling, power, h_old[e, g], s_old[e, g], h, s_new,
                pk2, stiff, p, law, steep, pull, work,
            )  # fmt: skip
            normal[0] = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
            normal[1] = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
            normal[2] = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
            for k in range(3):
                first[k] = pk2[0] * f[0, k] + pk2[2] * f[1, k]
                second[k] = pk2[1] * f[1, k] + pk2[2] * f[0, k]
            for j in range(count):
                dn_by = slopes_by[j, e, g]
                for i in range(2):
                    for k in range(3):
                        total = 0.0
                        for n in range(4):
                            total += dn_by[i, n] * x[n, k] + dn[i, n] * surface[j, quads[e, n], k]
                        f_by[i, k] = total
                e0, e1, e2 = 0.0, 0.0, 0.0
                for k in range(3):
                    e0 += f[0, k] * f_by[0, k]
                    e1 += f[1, k] * f_by[1, k]
                    e2 += f[0, k] * f_by[1, k] + f[1, k] * f_by[0, k]
                green[e, g, 0, j], green[e, g, 1, j], green[e, g, 2, j] = e0, e1, e2
                s0 = stiff[0, 0] * e0 + stiff[0, 1] * e1 + stiff[0, 2] * e2
                s1 = stiff[1, 0] * e0 + stiff[1, 1] * e1 + stiff[1, 2] * e2
                s2 = stiff[2, 0] * e0 + stiff[2, 1] * e1 + stiff[2, 2] * e2
                for k in range(3):
                    first_by[k] = (
                        s0 * f[0, k] + pk2[0] * f_by[0, k] + s2 * f[1, k] + pk2[2] * f_by[1, k]
                    )
                    second_by[k] = (
                        s1 * f[1, k] + pk2[1] * f_by[1, k] + s2 * f[0, k] + pk2[2] * f_by[0, k]
                    )
                    a, b = (k + 1) % 3, (k + 2) % 3
                    normal_by[k] = (
                        f_by[0, a] * f[1, b] - f_by[0, b] * f[1, a]
                        + f[0, a] * f_by[1, b] - f[0, b] * f_by[1, a]
                    )  # fmt: skip
                share, share_by = area[e, g], area_by[j, e, g]
                wall, wall_by = thickness[e] * share, thickness[e] * share_by
                for n in range(4):
                    push = pressure * values[g, n]
                    for k in range(3):
                        rate[3 * quads[e, n] + k, j] += (
                            wall_by * (dn[0, n] * first[k] + dn[1, n] * second[k])
                            + wall * (dn_by[0, n] * first[k] + dn_by[1, n] * second[k])
                            + wall * (dn[0, n] * first_by[k] + dn[1, n] * second_by[k])
                            - push * (share_by * normal[k] + share * normal_by[k])
                        )
