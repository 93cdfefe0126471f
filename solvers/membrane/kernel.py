"""Compiled kernels of the membrane: residual force, consistent tangent, and their derivatives.

The formulation is total Lagrangian. The base vectors F1 and F2 are the images of the unit vectors
along warp and fill; a_n and d_n are the derivatives of the shape function of node n along them. The
displacement du_n of a node changes the Green-Lagrange strain (E11, E22, 2 E12) by B_n du_n with
B_n = a_n A0 + d_n A1, where the rows of A0 are F1, 0, F2, and those of A1 are 0, F2, F1. So the
tangent of a pair of nodes n, m is a_n (a_m K00 + d_m K01) + d_n (a_m K10 + d_m K11), with four
3 x 3 blocks K for each Gauss point (`assemble`).

Derivatives are found by direct differentiation along the strain path: K du/db = -dR/db for every
parameter b, with the tangent K and the derivative of the residual R at fixed displacement, from
`explicit_residual_slopes` or, for parameters of the stress-free sheet, from `by_sheet`. Once this
is solved, `advance` updates the derivatives of strain and stress to the end of the increment.

In shapes, m is the number of quads, n that of nodes, and p or k that of parameters.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...compilation import compiled
from ...errors import InputError
from ...materials.memory import BY_X, ON, RECALLED, remember
from ...materials.pieces import (
    CauchyGreen,
    PointResponse,
    PointState,
    modulus_slopes,
    point_response,
)
from ...materials.point_law import BEFORE3, CRIMPED, G12, membrane_stress, stress_rates
from ...materials.wrinkles import FabricIncrement, relaxed_membrane_stress, wrinkle_work

# mypy does not see through numba; the shapes are in the docstrings.

Array = NDArray[np.float64]
#: Count of numbers that `explicit_residual_slopes` stores at each Gauss point for `advance`: base
#: vectors (6), d log strain / d Green-Lagrange strain (9), tangent of the law (9). For a law with a
#: memory they are followed by the derivatives, by the strain, of the largest strains and of the
#: stresses that it remembers (6).
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


class Elements(NamedTuple):
    """Quads in the form that the compiled functions take; see `ReferenceElements`.

    Attributes
    ----------
    quads : (m, 4) array of int
        Node numbers.
    values : (4 points, 4 nodes) array
        Shape functions.
    slopes : (m, 4 points, 2, 4 nodes) array, 1/mm
        Their derivatives along warp and fill.
    area : (m, 4) array, mm^2
        Of each Gauss point.
    thickness : (m,) array, mm
    """

    quads: NDArray[np.intp]
    values: Array
    slopes: Array
    area: Array
    thickness: Array


class State(NamedTuple):
    """Strain and stress at all Gauss points.

    Attributes
    ----------
    strain : (m, 4, law.state) array
        Log strain and what a law with a memory adds to it.
    stress : (m, 4, 3) array, MPa
        Cauchy stress.
    """

    strain: Array
    stress: Array


class System(NamedTuple):
    """Residual and tangent, into which the elements are assembled.

    Attributes
    ----------
    slot : (m, 144) array
        Place in `data` of each entry of an element's tangent, -1 if an unknown of it is held.
    data : array, N/mm
        Entries of the tangent.
    residual : (3 n,) array, N
    """

    slot: NDArray[np.int64]
    data: Array
    residual: Array


class Wrinkling(NamedTuple):
    """Wrinkles of a membrane.

    Attributes
    ----------
    share : float
        Share of the stiffness that is left across wrinkles.
    strain : (m, 4, 3) array
        Strain of the fabric less that of the mean surface; it is written.
    """

    share: float
    strain: Array


class StateSlopes(NamedTuple):
    """Derivatives of a state by p parameters.

    Attributes
    ----------
    strain : (m, 4, law.state, p) array
        At the start of the increment.
    stress : (m, 4, 3, p) array, MPa
        At the start of the increment.
    fixed_stress : (m, 4, 3, p) array, MPa
        At its end, for a fixed displacement; it is written.
    """

    strain: Array
    stress: Array
    fixed_stress: Array


class SheetSlopes(NamedTuple):
    """Derivatives of a stress-free sheet by k parameters.

    Attributes
    ----------
    surface : (n, 3, k) array
        Of the reference positions of the nodes.
    slopes : (m, 4, 2, 4, k) array
        Of the array of this name in `Elements`.
    area : (m, 4, k) array
        Of the array of this name in `Elements`.
    """

    surface: Array
    slopes: Array
    area: Array


@compiled(internal=True)
def node_positions(  # type: ignore[no-untyped-def]
    position,
    quads,
    e,
    x,
):
    """Write into x (4, 3) the positions of the nodes of quad number e."""
    for n in range(4):
        for k in range(3):
            x[n, k] = position[quads[e, n], k]


@compiled(internal=True)
def add_to_nodes(  # type: ignore[no-untyped-def]
    rate,
    quads,
    e,
    local,
):
    """Add the derivatives `local` (12, p) of quad number e to those of all nodes, (3 n, p)."""
    for n in range(4):
        for k in range(3):
            for j in range(local.shape[1]):
                rate[3 * quads[e, n] + k, j] += local[3 * n + k, j]


@compiled(internal=True)
def base_vectors(x, slopes, f):  # type: ignore[no-untyped-def]
    """Write into f (2, 3) the images of the unit vectors along warp and fill.

    Parameters
    ----------
    x : (4, 3) array
        Positions of the nodes.
    slopes : (2, 4) array
        Derivatives of the shape functions.
    """
    for i in range(2):
        for k in range(3):
            f[i, k] = (
                slopes[i, 0] * x[0, k]
                + slopes[i, 1] * x[1, k]
                + slopes[i, 2] * x[2, k]
                + slopes[i, 3] * x[3, k]
            )


@compiled(internal=True)
def metric(f):  # type: ignore[no-untyped-def]
    """Return the right Cauchy-Green tensor of base vectors f (2, 3)."""
    c11 = f[0, 0] ** 2 + f[0, 1] ** 2 + f[0, 2] ** 2
    c22 = f[1, 0] ** 2 + f[1, 1] ** 2 + f[1, 2] ** 2
    c12 = f[0, 0] * f[1, 0] + f[0, 1] * f[1, 1] + f[0, 2] * f[1, 2]
    return CauchyGreen(0.5 * (c11 + c22), 0.5 * (c11 - c22), c12)


@compiled(internal=True)
def area_vector(f):  # type: ignore[no-untyped-def]
    """Return the cross product of base vectors f (2, 3), whose length is the ratio of areas."""
    nx = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
    ny = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
    nz = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
    return nx, ny, nz


@compiled(internal=True)
def _sheet_stress(  # type: ignore[no-untyped-def]
    law,
    green,
    before,
    after,
    wrinkling,
    work,
    e,
    g,
    response,
):
    """Write state and response of Gauss point g of quad e; return whether its stress is valid.

    Parameters
    ----------
    law : CompiledLaw
    green : CauchyGreen
        Its Cauchy-Green tensor.
    before, after
        States of all Gauss points, [quad, point], at the start and the end; `after` is written.
    wrinkling : Wrinkling or None
        Its strain is written.
    work : WrinkleWork
    response : PointResponse
        Written.
    """
    old = PointState(before.strain[e, g], before.stress[e, g])
    new = PointState(after.strain[e, g], after.stress[e, g])
    if wrinkling is None:
        return membrane_stress(law, green, old, new, response)
    # Only of a law without a memory, see `closed.prepare`.
    increment = FabricIncrement(law, old, work.total, new, response.law)
    state = relaxed_membrane_stress(
        increment,
        green,
        wrinkling.share,
        wrinkling.strain[e, g],
        response,
        work,
    )
    return state >= 0


@compiled(internal=True)
def _add_forces(  # type: ignore[no-untyped-def]
    f,
    slopes,
    shape,
    tension,
    wp,
    force,
    largest,
):
    """Add a Gauss point's internal less pressure forces to the nodes' forces.

    Parameters
    ----------
    slopes, shape : (2, 4) and (4,) arrays
        Derivatives (1/mm) and values of the shape functions.
    tension : (3,) array, N mm
        2nd Piola-Kirchhoff stress times volume.
    wp : float, N
        Pressure times area.
    force : (12,) array, N
        Written.

    Returns
    -------
    float, N
        The larger of `largest` and the largest pressure force.
    """
    nx, ny, nz = area_vector(f)
    s0, s1, s2 = tension
    for n in range(4):
        g0 = slopes[0, n] * s0 + slopes[1, n] * s2
        g1 = slopes[1, n] * s1 + slopes[0, n] * s2
        load = wp * shape[n]
        force[3 * n] += g0 * f[0, 0] + g1 * f[1, 0] - load * nx
        force[3 * n + 1] += g0 * f[0, 1] + g1 * f[1, 1] - load * ny
        force[3 * n + 2] += g0 * f[0, 2] + g1 * f[1, 2] - load * nz
        largest = max(largest, load * max(abs(nx), abs(ny), abs(nz)))
    return largest


@compiled(internal=True)
def _write_rows(  # type: ignore[no-untyped-def]
    f,
    slopes,
    stiffness,
    volume,
    tension,
    wp,
    rows,
):
    """Write the sums of a Gauss point over the blocks K, times derivatives of shape functions.

    Parameters
    ----------
    slopes : (2, 4) array, 1/mm
        Derivatives of the shape functions.
    stiffness : (3, 3) array, MPa
        d 2nd Piola-Kirchhoff stress / d Green-Lagrange strain.
    volume : float, mm^3
    tension : (3,) array, N mm
        2nd Piola-Kirchhoff stress times volume.
    wp : float, N
        Pressure times area, of the follower pressure.
    rows : (3, 36) array
        a_m K00 + d_m K01 and a_m K10 + d_m K11 for the four nodes m, and minus the derivative of
        the pressure force, each (3, 4, 3) by direction, node m and its direction. The last has
        zeros on its diagonal, which stay.
    """
    s0, s1, s2 = tension
    for i in range(3):
        f0 = volume * f[0, i]
        f1 = volume * f[1, i]
        # row i of A0^T D and of A1^T D
        u0 = f0 * stiffness[0, 0] + f1 * stiffness[2, 0]
        u1 = f0 * stiffness[0, 1] + f1 * stiffness[2, 1]
        u2 = f0 * stiffness[0, 2] + f1 * stiffness[2, 2]
        v0 = f1 * stiffness[1, 0] + f0 * stiffness[2, 0]
        v1 = f1 * stiffness[1, 1] + f0 * stiffness[2, 1]
        v2 = f1 * stiffness[1, 2] + f0 * stiffness[2, 2]
        for j in range(3):
            k00 = u0 * f[0, j] + u2 * f[1, j]
            k01 = u1 * f[1, j] + u2 * f[0, j]
            k10 = v0 * f[0, j] + v2 * f[1, j]
            k11 = v1 * f[1, j] + v2 * f[0, j]
            if i == j:
                k00 += s0
                k01 += s2
                k10 += s2
                k11 += s1
            for n in range(4):
                a = slopes[0, n]
                d = slopes[1, n]
                rows[0, 12 * i + 3 * n + j] = a * k00 + d * k01
                rows[1, 12 * i + 3 * n + j] = a * k10 + d * k11
    for n in range(4):
        a = wp * slopes[0, n]
        d = wp * slopes[1, n]
        z0 = d * f[0, 0] - a * f[1, 0]
        z1 = d * f[0, 1] - a * f[1, 1]
        z2 = d * f[0, 2] - a * f[1, 2]
        rows[2, 3 * n + 1] = z2
        rows[2, 3 * n + 2] = -z1
        rows[2, 3 * n + 12] = -z2
        rows[2, 3 * n + 14] = z0
        rows[2, 3 * n + 24] = z1
        rows[2, 3 * n + 25] = -z0


@compiled(internal=True)
def _add_tangent(  # type: ignore[no-untyped-def]
    slopes,
    shape,
    rows,
    matrix,
):
    """Add the tangent of a Gauss point to the matrix (4, 36) of its element; rows : (3, 36).

    An inner loop over 36 numbers is what the compiler turns into vector instructions.
    """
    for n in range(4):
        a = slopes[0, n]
        d = slopes[1, n]
        share = shape[n]
        for j in range(36):
            matrix[n, j] += a * rows[0, j] + d * rows[1, j] + share * rows[2, j]


@compiled()
def assemble(  # type: ignore[no-untyped-def]
    position,
    elements,
    pressure,
    law,
    before,
    after,
    system,
    with_tangent,
    wrinkling,
):
    """Write the residual, internal less pressure forces, and the tangent of the membrane.

    Parameters
    ----------
    position : (n, 3) array, mm
    elements : Elements
    pressure : float, MPa
    law : CompiledLaw
    before : State
        At the start of the increment.
    after : State
        At `position`; written.
    system : System
    with_tangent : bool
        Whether the tangent is written, too.
    wrinkling : Wrinkling or None
        None for a membrane that does not wrinkle, for which no code of wrinkles is compiled.

    Returns
    -------
    float, N
        The largest force of the pressure on a node of an element; -1 if the stress of a Gauss point
        is not valid.
    """
    quads, values, all_slopes, area, thickness = elements
    slot, data, residual = system
    residual[:] = 0.0
    if with_tangent:
        data[:] = 0.0
    response = point_response()
    pk2 = response.pk2
    stiffness = response.stiffness
    work = wrinkle_work()
    x = np.empty((4, 3))
    f = np.empty((2, 3))
    matrix = np.empty((4, 36))
    force = np.empty(12)
    rows = np.zeros((3, 36))
    largest = 0.0
    for e in range(quads.shape[0]):
        node_positions(position, quads, e, x)
        force[:] = 0.0
        if with_tangent:
            matrix[:] = 0.0
        for g in range(4):
            slopes = all_slopes[e, g]
            shape = values[g]
            base_vectors(x, slopes, f)
            green = metric(f)
            if not _sheet_stress(
                law,
                green,
                before,
                after,
                wrinkling,
                work,
                e,
                g,
                response,
            ):
                return -1.0
            wt = area[e, g] * thickness[e]
            wp = area[e, g] * pressure
            tension = (wt * pk2[0], wt * pk2[1], wt * pk2[2])
            largest = _add_forces(
                f,
                slopes,
                shape,
                tension,
                wp,
                force,
                largest,
            )
            if with_tangent:
                _write_rows(f, slopes, stiffness, wt, tension, wp, rows)
                _add_tangent(slopes, shape, rows, matrix)
        for n in range(4):
            for k in range(3):
                residual[3 * quads[e, n] + k] += force[3 * n + k]
        if with_tangent:
            for n in range(4):
                for j in range(36):
                    place = slot[e, 36 * n + j]
                    if place >= 0:
                        data[place] += matrix[n, j]
    return largest


@dataclass(frozen=True, eq=False)
class ReferenceElements:
    """Shape functions of quads, and their derivatives along warp and fill.

    Attributes
    ----------
    values : (4 points, 4 nodes) array
    slopes : (elements, 4 points, 2, 4 nodes) array, 1/mm
        Derivatives along warp and fill.
    area : (elements, 4 points) array, mm^2
        Of each Gauss point.
    """

    values: Array
    slopes: Array
    area: Array


def reference_elements(
    points: Array,
    quads: NDArray[np.intp],
    warp: Array | None = None,
    stretch: Array | None = None,
) -> ReferenceElements:
    """Evaluate the bilinear shape functions of quads on the stress-free surface.

    Parameters
    ----------
    points : (n, 2) or (n, 3) array, mm
        Nodes of a flat or faceted surface.
    quads : (m, 4) array of int
    warp : (m, 3) array, optional
        Direction of the warp, which is projected on each quad; x unless given.
    stretch : (m, 4, 2, 2) array, optional
        Stretch at each Gauss point from the surface to the stress-free yarns, in axes along warp
        and fill; the surface itself is free of stress unless given.

    Raises
    ------
    InputError
        If a quad is degenerate or inside out, the warp is normal to one, or the stretch turns one
        inside out.
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
def _take_memory(  # type: ignore[no-untyped-def]
    law,
    coupling,
    h,
    h_old,
    of_law,
    dh_old,
    weights,
    of_moduli,
    record,
):
    """Differentiate the memory of a law, if it has one, and store its part of `record`.

    See `materials.memory.remember` for the arguments.
    """
    if len(coupling) > CRIMPED:
        memory = np.empty(RECALLED)
        for i in range(3):
            remember(
                law,
                i,
                h,
                h_old,
                of_law,
                dh_old,
                weights,
                of_moduli[i],
                memory,
            )
            record[POINT + i] = memory[ON]
            record[POINT + 3 + i] = memory[BY_X]


@compiled(inline="always")
def _add_pressure_slope(  # type: ignore[no-untyped-def]
    f,
    shape,
    area,
    local,
    column,
):
    """Add the derivative of the residual by the pressure to a column of `local` (12, p)."""
    nx, ny, nz = area_vector(f)
    for n in range(4):
        share = area * shape[n]
        local[3 * n, column] -= share * nx
        local[3 * n + 1, column] -= share * ny
        local[3 * n + 2, column] -= share * nz


@compiled(inline="always")
def _keep_point(f, response, record):  # type: ignore[no-untyped-def]
    """Write into `record` (POINT or more,) what `advance` needs of a Gauss point."""
    for k in range(3):
        record[k] = f[0, k]
        record[3 + k] = f[1, k]
        for i in range(3):
            record[6 + 3 * i + k] = response.strain_slope[i, k]
            record[15 + 3 * i + k] = response.law.tangent[i, k]


@compiled(inline="always")
def _add_product(matrix, rates, total):  # type: ignore[no-untyped-def]
    """Add a matrix (3, 3) times derivatives (3 or more, p) of three numbers to total[:3]."""
    for i in range(3):
        by0 = matrix[i, 0]
        by1 = matrix[i, 1]
        by2 = matrix[i, 2]
        for j in range(rates.shape[1]):
            total[i, j] += by0 * rates[0, j] + by1 * rates[1, j] + by2 * rates[2, j]


@compiled(internal=True)
def _add_node_forces(a, d, f, force_rate, local):  # type: ignore[no-untyped-def]
    """Add B' times the rates of the stress resultants (3, p) to those of a node's forces (3, p).

    Parameters
    ----------
    a, d : float, 1/mm
        Derivatives of the shape function of the node along warp and fill.
    f : (2, 3) array
        Base vectors.
    """
    f00, f01, f02 = f[0, 0], f[0, 1], f[0, 2]
    f10, f11, f12 = f[1, 0], f[1, 1], f[1, 2]
    for j in range(force_rate.shape[1]):
        along = a * force_rate[0, j] + d * force_rate[2, j]
        across = d * force_rate[1, j] + a * force_rate[2, j]
        local[0, j] += along * f00 + across * f10
        local[1, j] += along * f01 + across * f11
        local[2, j] += along * f02 + across * f12


@compiled(internal=True)
def _add_green_rates(a, d, record, du, green):  # type: ignore[no-untyped-def]
    """Add B times the rates of a node's displacement (3, p) to those of the Green strain (3, p).

    Parameters
    ----------
    a, d : float, 1/mm
        As in `_add_node_forces`.
    record : (POINT or more,) array
        Begins with the base vectors.
    """
    f00, f01, f02 = record[0], record[1], record[2]
    f10, f11, f12 = record[3], record[4], record[5]
    for j in range(du.shape[1]):
        along = f00 * du[0, j] + f01 * du[1, j] + f02 * du[2, j]
        across = f10 * du[0, j] + f11 * du[1, j] + f12 * du[2, j]
        green[0, j] += a * along
        green[1, j] += d * across
        green[2, j] += a * across + d * along


class SlopeWork(NamedTuple):
    """Work arrays of `explicit_residual_slopes` for an element.

    Attributes
    ----------
    after : PointState
        At the end of the increment.
    response : PointResponse
    weights : (P, 4) array
        See `modulus_slopes`.
    x : (4, 3) array, mm
        Positions of the nodes.
    f : (2, 3) array
        Base vectors.
    of_moduli : (3, p) array, MPa
        Explicit derivatives of (E1, E2, G12) by each parameter.
    force_rate : (3, p) array, N mm
        Change of the 2nd Piola-Kirchhoff stress times volume.
    local : (12, p) array, N
        Derivatives of the nodal forces.
    """

    after: PointState
    response: PointResponse
    weights: Array
    x: Array
    f: Array
    of_moduli: Array
    force_rate: Array
    local: Array


@compiled(internal=True)
def _add_residual_slopes(  # type: ignore[no-untyped-def]
    position,
    elements,
    law,
    before,
    of_law,
    of_state,
    pressure_column,
    point,
    rate,
    work,
):
    """Write the derivatives of `explicit_residual_slopes` with its work arrays, a SlopeWork."""
    quads, values, all_slopes, area, thickness = elements
    nu = law.coupling[0]
    by_coupling = of_law.coupling
    count = of_law.coupling.shape[1]
    rate[:] = 0.0
    after, response, weights, x, f, of_moduli, force_rate, local = work
    h = after.strain
    law_slopes = response.law.slopes
    pull = response.pull
    for e in range(quads.shape[0]):
        node_positions(position, quads, e, x)
        local[:] = 0.0
        for g in range(4):
            slopes = all_slopes[e, g]
            base_vectors(x, slopes, f)
            old = PointState(before.strain[e, g], before.stress[e, g])
            membrane_stress(law, metric(f), old, after, response)
            for i in range(3):
                modulus_slopes(
                    law,
                    of_law,
                    i,
                    h[i],
                    old.strain[i],
                    weights,
                    of_moduli[i],
                )
            dh_old = of_state.strain[e, g]
            _take_memory(
                law,
                law.coupling,
                h,
                old.strain,
                of_law,
                dh_old,
                weights,
                of_moduli,
                point[e, g],
            )
            dh2 = h[2] - old.strain[2]
            volume = area[e, g] * thickness[e]
            for i in range(3):
                for k in range(3):
                    pull[i, k] *= volume
            ds_old = of_state.stress[e, g]
            ds_new = of_state.fixed_stress[e, g]
            stress_rates(law_slopes, nu, of_moduli, by_coupling, dh_old, ds_old, ds_new)
            before3 = law_slopes[BEFORE3]
            g12 = law_slopes[G12]
            for j in range(count):
                shear = of_moduli[2, j] + dh_old[2, j] * before3
                ds_new[2, j] = ds_old[2, j] + shear * dh2 - g12 * dh_old[2, j]
            # The change of stress at fixed strain, times `pull` (2nd Piola-Kirchhoff stress by
            # Cauchy stress) and volume; B' of it is the change of the nodal forces.
            force_rate[:] = 0.0
            _add_product(pull, ds_new, force_rate)
            for n in range(4):
                _add_node_forces(
                    slopes[0, n], slopes[1, n], f, force_rate, local[3 * n : 3 * n + 3]
                )
            if pressure_column >= 0:
                _add_pressure_slope(f, values[g], area[e, g], local, pressure_column)
            _keep_point(f, response, point[e, g])
        add_to_nodes(rate, quads, e, local)


@compiled()
def explicit_residual_slopes(  # type: ignore[no-untyped-def]
    position,
    elements,
    law,
    before,
    of_law,
    of_state,
    pressure_column,
    point,
    rate,
):
    """Write the derivatives of the residual by p parameters at fixed displacement.

    The parameters are those of the law, the pressure and the thickness.

    Parameters
    ----------
    position : (n, 3) array, mm
    elements : Elements
    law : CompiledLaw
    before : State
        At the start of the increment.
    of_law : LawSlopes
        Derivatives of the law by the parameters.
    of_state : StateSlopes
        Derivatives of the state by the parameters; its `fixed_stress` is written.
    pressure_column : int
        Index of the parameter that is added to the pressure, or -1.
    point : (m, 4, POINT or more) array
        What `advance` needs; written.
    rate : (3 n, p) array
        The derivatives; written.
    """
    count = of_law.coupling.shape[1]
    work = SlopeWork(
        PointState(np.empty(before.strain.shape[2]), np.empty(3)),
        point_response(),
        np.empty((law.pieces.shape[1], 4)),
        np.empty((4, 3)),
        np.empty((2, 3)),
        np.empty((3, count)),
        np.empty((3, count)),
        np.empty((12, count)),
    )
    _add_residual_slopes(
        position,
        elements,
        law,
        before,
        of_law,
        of_state,
        pressure_column,
        point,
        rate,
        work,
    )


@compiled(internal=True)
def _advance(  # type: ignore[no-untyped-def]
    quads,
    slopes,
    point,
    du,
    of_sheet,
    columns,
    dh,
    ds,
    green,
):
    """Update as `advance`; `green` (3, p) is written with derivatives of the Green strain."""
    count = du.shape[1]
    for e in range(quads.shape[0]):
        for g in range(4):
            record = point[e, g]
            dn = slopes[e, g]
            green[:] = 0.0
            for n in range(4):
                node = 3 * quads[e, n]
                _add_green_rates(dn[0, n], dn[1, n], record, du[node : node + 3], green)
            for k in range(len(columns)):
                for i in range(3):
                    green[i, columns[k]] += of_sheet[e, g, i, k]
            strain = dh[e, g]
            stress = ds[e, g]
            strain[:3] = 0.0
            _add_product(record[6:15].reshape(3, 3), green, strain)
            _add_product(record[15:24].reshape(3, 3), strain, stress)
            for i in range(3, strain.shape[0]):
                for j in range(count):
                    strain[i, j] += record[POINT + i - 3] * strain[i % 3, j]


@compiled()
def advance(  # type: ignore[no-untyped-def]
    quads,
    slopes,
    point,
    du,
    of_sheet,
    columns,
    dh,
    ds,
):
    """Update the derivatives of strain and stress by the derivatives of the displacement.

    Parameters
    ----------
    quads : (m, 4) array of int
    slopes : (m, 4, 2, 4) array, 1/mm
        See `Elements`.
    point : (m, 4, POINT or more) array
        As `explicit_residual_slopes` wrote it.
    du : (3 n, p) array
        Derivatives of the displacement.
    of_sheet : (m, 4, 3, k) array
        Derivatives of the Green-Lagrange strain by parameters of the sheet at fixed displacement.
    columns : (k,) array of int
        Indices of these among the parameters.
    dh : (m, 4, law.state, p) array
        Derivatives of the strain, of which those of the log strain are overwritten.
    ds : (m, 4, 3, p) array
        Derivatives of the stress at fixed displacement; the part of du is added.
    """
    green = np.empty((3, du.shape[1]))
    _advance(quads, slopes, point, du, of_sheet, columns, dh, ds, green)


class BaseSlopes(NamedTuple):
    """Work arrays of `by_sheet` for a Gauss point; names in _by have derivatives by k parameters.

    Attributes
    ----------
    base : (2, 3) array
        Base vectors.
    force : (2, 3) array, MPa
        Stress vectors on sections across them.
    normal : (3,) array
        Area vector.
    pk2_by : (3, k) array, MPa
        Of the 2nd Piola-Kirchhoff stress.
    """

    base: Array
    base_by: Array
    force: Array
    force_by: Array
    normal: Array
    normal_by: Array
    pk2_by: Array


@compiled(internal=True)
def _base_slopes(  # type: ignore[no-untyped-def]
    x,
    nodes,
    slopes,
    slopes_by,
    surface,
    base_by,
):
    """Write into base_by (2, 3, k) the derivatives of the base vectors of a Gauss point.

    Parameters
    ----------
    x, nodes : (4, 3) and (4,) arrays
        Positions (mm) and numbers of its nodes.
    slopes_by : (2, 4, k) array
        Derivatives of `slopes`.
    surface : (n, 3, k) array
        Derivatives of the reference positions of all nodes.
    """
    base_by[:] = 0.0
    for n in range(4):
        for k in range(3):
            by = surface[nodes[n], k]
            for i in range(2):
                for j in range(by.shape[0]):
                    base_by[i, k, j] += slopes_by[i, n, j] * x[n, k] + slopes[i, n] * by[j]


@compiled(internal=True)
def _stress_slopes(stiff, at, strain_by):  # type: ignore[no-untyped-def]
    """Write the derivatives of the Green-Lagrange strain, strain_by (3, k), and at.pk2_by.

    Parameters
    ----------
    stiff : (3, 3) array, MPa
        d 2nd Piola-Kirchhoff stress / d Green-Lagrange strain.
    """
    count = strain_by.shape[1]
    f = at.base
    f_by = at.base_by
    strain_by[:] = 0.0
    for k in range(3):
        for j in range(count):
            strain_by[0, j] += f[0, k] * f_by[0, k, j]
            strain_by[1, j] += f[1, k] * f_by[1, k, j]
            strain_by[2, j] += f[0, k] * f_by[1, k, j] + f[1, k] * f_by[0, k, j]
    for i in range(3):
        d0 = stiff[i, 0]
        d1 = stiff[i, 1]
        d2 = stiff[i, 2]
        for j in range(count):
            at.pk2_by[i, j] = d0 * strain_by[0, j] + d1 * strain_by[1, j] + d2 * strain_by[2, j]


@compiled(internal=True)
def _force_slopes(pk2, at):  # type: ignore[no-untyped-def]
    """Write the stress vectors at.force and their derivatives.

    Parameters
    ----------
    pk2 : (3,) array, MPa
    """
    f = at.base
    f_by = at.base_by
    pk2_by = at.pk2_by
    for i in range(2):
        for k in range(3):
            # Along f[i] the stress pk2[i], along the other one the shear.
            at.force[i, k] = pk2[i] * f[i, k] + pk2[2] * f[1 - i, k]
            for j in range(pk2_by.shape[1]):
                at.force_by[i, k, j] = (
                    pk2_by[i, j] * f[i, k]
                    + pk2[i] * f_by[i, k, j]
                    + pk2_by[2, j] * f[1 - i, k]
                    + pk2[2] * f_by[1 - i, k, j]
                )


@compiled(internal=True)
def _normal_slopes(at):  # type: ignore[no-untyped-def]
    """Write the area vector at.normal and its derivatives."""
    f = at.base
    f_by = at.base_by
    for k in range(3):
        a = (k + 1) % 3
        b = (k + 2) % 3
        at.normal[k] = f[0, a] * f[1, b] - f[0, b] * f[1, a]
        for j in range(at.normal_by.shape[1]):
            at.normal_by[k, j] = (
                f_by[0, a, j] * f[1, b]
                - f_by[0, b, j] * f[1, a]
                + f[0, a] * f_by[1, b, j]
                - f[0, b] * f_by[1, a, j]
            )


@compiled()
def by_sheet(  # type: ignore[no-untyped-def]
    position,
    elements,
    pressure,
    law,
    before,
    sheet,
    green,
    rate,
):
    """Write the derivatives of the residual by k parameters of the stress-free sheet.

    Displacement, and strain and stress at the start of the increment, are held fixed.

    Parameters
    ----------
    position : (n, 3) array, mm
    elements : Elements
    pressure : float, MPa
    law : CompiledLaw
    before : State
        At the start of the increment.
    sheet : SheetSlopes
    green : (m, 4, 3, k) array
        Derivatives of the Green-Lagrange strain (E11, E22, 2 E12); written.
    rate : (3 n, k) array
        The derivatives; written.
    """
    quads, values, all_slopes, area, thickness = elements
    surface, slopes_by, area_by = sheet
    count = surface.shape[2]
    rate[:] = 0.0
    after = PointState(np.empty(before.strain.shape[2]), np.empty(3))
    response = point_response()
    x = np.empty((4, 3))
    at = BaseSlopes(
        np.empty((2, 3)),
        np.empty((2, 3, count)),
        np.empty((2, 3)),
        np.empty((2, 3, count)),
        np.empty(3),
        np.empty((3, count)),
        np.empty((3, count)),
    )
    normal = at.normal
    force = at.force
    force_by = at.force_by
    normal_by = at.normal_by
    local = np.empty((12, count))
    for e in range(quads.shape[0]):
        node_positions(position, quads, e, x)
        local[:] = 0.0
        for g in range(4):
            dn = all_slopes[e, g]
            dn_by = slopes_by[e, g]
            base_vectors(x, dn, at.base)
            old = PointState(before.strain[e, g], before.stress[e, g])
            membrane_stress(law, metric(at.base), old, after, response)
            _base_slopes(
                x,
                quads[e],
                dn,
                dn_by,
                surface,
                at.base_by,
            )
            _stress_slopes(response.stiffness, at, green[e, g])
            _force_slopes(response.pk2, at)
            _normal_slopes(at)
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
                    by_area = (d0 * force[0, k] + d1 * force[1, k]) / share
                    by_area -= push * normal[k]
                    for j in range(count):
                        local[3 * n + k, j] += (
                            by_area * share_by[j]
                            - push * share * normal_by[k, j]
                            + dn_by[0, n, j] * f0
                            + dn_by[1, n, j] * f1
                            + d0 * force_by[0, k, j]
                            + d1 * force_by[1, k, j]
                        )
        add_to_nodes(rate, quads, e, local)


def element_slopes(
    points: Array,
    quads: NDArray[np.intp],
    ways: Array,
    yarn: Array,
    yarn_by: Array,
    stretch: Array,
    stretch_by: Array,
) -> tuple[Array, Array]:
    """Return the derivatives of what `reference_elements` computes, by k parameters.

    Parameters
    ----------
    points : (n, 3) array, mm
        Nodes of the surface.
    quads : (m, 4) array of int
    ways : (k, n, 3) array
        Derivatives of the points.
    yarn, yarn_by : (3,) and (k, 3) array
        Direction of the warp in all quads, and its derivatives.
    stretch, stretch_by : (m, 4, 2, 2) and (k, m, 4, 2, 2) array
        See `reference_elements`, and its derivatives.

    Returns
    -------
    (m, 4, 2, 4, k) array, (m, 4, k) array
        Derivatives of `slopes` and `area`.
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
    """Return the unit vectors (..., 3) and lengths (...) of vectors, each with its derivative.

    Parameters
    ----------
    vector, by : (..., 3) array
        The vectors and their derivatives by one parameter.
    """
    length = np.linalg.norm(vector, axis=-1)
    unit = vector / length[..., None]
    length_by = np.einsum("...k,...k->...", unit, by)
    return unit, (by - length_by[..., None] * unit) / length[..., None], length, length_by
