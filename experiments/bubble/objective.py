"""Residuals of a bubble test: model less measured displacements at several pressures.

A block holds one component of the displacement (x, y or z) at one pressure: the n values of
(model - measured) / (largest measured |value| * sqrt(n)). Its norm is the RMS error of the
component over its largest measured value (e_x / max(P_x) in the thesis), and e is the sum of the
norms. In millimetres ("mm") the largest value is replaced by 1, and e is a sum of RMS errors, mm.

Causes that may explain a misfit are derivatives of the model's field u(x, p) at the position x (mm,
about the centre) and pressure p. Positions that are off by d change it to u(x + d, p). A disk
larger by the factor R has the field R u(x / R, R p). Axes that are turned turn positions and
displacements, a plane that is tilted turns displacements alone.

References
----------
Equations 4.5 to 4.8 of the thesis.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...inference.objective import NoiseIs, Objective
from ...solvers.base import Array, History
from .field_shape import SmoothField, tilt_rotation
from .targets import FieldTarget

Unknowns = Mapping[str, float]
#: Nuisance unknowns of a measured field: a rigid displacement of all its points, mm.
OFFSETS = ("offset_x", "offset_y", "offset_z")
#: Nuisance unknowns that an imperfect registration leaves: the tilt of the plane about x and about
#: y (degrees), and the distances along x and y from the given places to the true ones (mm).
MISALIGNMENTS = ("tilt_x", "tilt_y", "shift_x", "shift_y")
#: Standard deviation (mm) of a displacement measured by a good image correlation.
CORRELATION = 0.05


def amounts_of(names: Sequence[str], nuisance: Unknowns | None) -> Array:
    """Return the values of nuisance unknowns (`OFFSETS` or `MISALIGNMENTS`) by their names.

    One that is missing from `nuisance` is zero.
    """
    return np.array([(nuisance or {}).get(name, 0.0) for name in names])


class FieldObjective(Objective):
    """The residual of displacement fields, in blocks x, y, z at each of several pressures.

    In the methods n is the number of places of a target and m the length of the whole residual.

    Parameters
    ----------
    targets : sequence of FieldTarget
        One for each pressure that is matched, in the order of the model's frames.
    normalise : {"e", "mm"}
        "e" divides residuals by the largest measured value of their block, "mm" does not.
    weight : float
        Weight of every block in the sum e of their norms.
    noise : float, mm, or None
        Smallest standard deviation of one displacement; None for that of a good correlation.
    constant : sequence of int
        Components (0 to 2) whose difference of model and data may have a part that is constant
        over the pressures: at every place the weighted mean of the differences is subtracted.

    Raises
    ------
    InputError
        A component of the displacement is zero everywhere, so that nothing normalises it.
    """

    unit = "mm"
    columns = 3
    quantities = ("dx", "dy", "dz")

    def __init__(
        self,
        targets: Sequence[FieldTarget],
        normalise: Literal["e", "mm"] = "e",
        weight: float = 1.0,
        noise: float | None = None,
        constant: Sequence[int] = (),
    ) -> None:
        self.least_noise = CORRELATION if noise is None else noise
        self.noise_is: NoiseIs = "assumed" if noise is None else "given"
        self.targets = tuple(targets)
        self.constant = tuple(constant)
        self.scales = [_scale_of(target, normalise, weight) for target in self.targets]
        self.sizes = tuple(len(target.displacement) for target in self.targets for _ in "xyz")
        self.scale = np.repeat(np.concatenate(self.scales), self.sizes)

    @property
    def data(self) -> tuple[Array, ...]:
        """Return the arrays on which the residual depends beside the model, to identify it."""
        samples = [target.sample.data for target in self.targets if target.sample is not None]
        return (*(target.displacement for target in self.targets), *samples)

    @property
    def measured(self) -> Array:
        """Return the measured displacements in the order of the residual, (m,) mm."""
        return np.concatenate([target.displacement.T.reshape(-1) for target in self.targets])

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return the positions (n, 2), mm, before the test of the values of each block.

        It is empty where positions are not known.
        """
        positions: list[Array] = []
        for target in self.targets:
            if target.positions is None:
                return ()
            positions += [target.positions] * 3
        return tuple(positions)

    def spread_over_residuals(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values of the places, given target after target, for each residual, (m,)."""
        ends = np.cumsum([len(target.displacement) for target in self.targets])[:-1]
        return np.concatenate([np.tile(of_frame, 3) for of_frame in np.split(values, ends)])

    def shifted(self, external: History, surrogate: History) -> FieldObjective:
        """Return the objective with which a surrogate stands for an external solver.

        The difference of their displacements is subtracted from the data, so that the surrogate
        has the same residuals as the external solver with the law of the two histories.
        """
        objective = copy.copy(self)
        difference = external.displacement - surrogate.displacement
        objective.targets = tuple(
            replace(
                target,
                displacement=target.displacement - target.modelled_displacement(difference, k),
            )
            for k, target in enumerate(self.targets)
        )
        return objective

    def residual(self, history: History, nuisance: Unknowns | None = None) -> Array:
        """Return the residual (m,): all blocks, with nuisance offsets and misalignments applied."""
        differences = self.differences(history.displacement, nuisance)
        blocks = [
            (difference / scale).T.reshape(-1)
            for difference, scale in zip(differences, self.scales, strict=True)
        ]
        return np.concatenate(blocks)

    def modelled(self, displacement: Array, nuisance: Unknowns | None = None) -> list[Array]:
        """Return the model's displacements (n, 3), mm, at the places of each target.

        Nuisance offsets and misalignments are added to them.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        offset = amounts_of(OFFSETS, nuisance)
        modelled = [
            target.modelled_field(displacement, k) + offset for k, target in enumerate(self.targets)
        ]
        amounts = amounts_of(MISALIGNMENTS, nuisance)
        if not amounts.any():
            return modelled
        changes = self._registration_changes(amounts)
        return [field + change for field, change in zip(modelled, changes, strict=True)]

    def _registration_changes(self, amounts: Array) -> list[Array]:
        """Return what misalignments add to the difference of model and data, (n, 3) mm each target.

        The measured displacements are rotated into the model's coordinate system. The model is read
        at the given place instead of the true one; the change of the measured field between the two
        places makes up for it.

        Parameters
        ----------
        amounts : (4,) array
            Values of `MISALIGNMENTS`.
        """
        rotation, _ = tilt_rotation(amounts[:2])
        changes = []
        for target, smooth in zip(self.targets, self._smooth_fields, strict=True):
            growth = smooth.growth(amounts[2:])
            changes.append((growth - target.displacement) @ rotation + target.displacement)
        return changes

    def _registration_slopes(self, amounts: Array) -> list[Array]:
        """Return the derivatives of `_registration_changes` by the four amounts, (n, 3, 4) each."""
        rotation, by_tilts = tilt_rotation(amounts[:2])
        slopes = []
        for target, smooth in zip(self.targets, self._smooth_fields, strict=True):
            growth = smooth.growth(amounts[2:])
            columns = [(growth - target.displacement) @ by_tilt for by_tilt in by_tilts]
            columns += [slope @ rotation for slope in smooth.slopes(amounts[2:])]
            slopes.append(np.stack(columns, axis=-1))
        return slopes

    @cached_property
    def _smooth_fields(self) -> list[SmoothField]:
        """Return a smooth field fitted to the data of each target whose positions are known."""
        return [
            SmoothField.through(target.positions, target.displacement)
            for target in self.targets
            if target.positions is not None
        ]

    def differences(self, displacement: Array, nuisance: Unknowns | None = None) -> list[Array]:
        """Return model less measured displacements (n, 3), mm, of each target.

        The part that is the same at all pressures is subtracted in the components `constant`.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        return self._without_mean(self._full_differences(displacement, nuisance))

    def constant_field(self, displacement: Array, nuisance: Unknowns | None = None) -> Array:
        """Return measured less modelled displacements that are constant over the pressures.

        It is a (places, 3) array in mm by place number, zero in components not in `constant`.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        return -self._mean(self._full_differences(displacement, nuisance))

    def _full_differences(self, displacement: Array, nuisance: Unknowns | None) -> list[Array]:
        """Return model less measured displacements (n, 3), mm, of each target as they are.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        modelled = self.modelled(displacement, nuisance)
        return [
            field - target.displacement
            for field, target in zip(modelled, self.targets, strict=True)
        ]

    def _without_mean(self, parts: list[Array]) -> list[Array]:
        """Return values (n, 3, ...) of each target less the mean over the pressures at each place.

        It is subtracted in the components `constant` only.

        Parameters
        ----------
        parts : list of (n, 3, ...) arrays
            One for each target.
        """
        if not self.constant:
            return parts
        mean = self._mean(parts)
        return [
            part - mean[target.place_numbers]
            for part, target in zip(parts, self.targets, strict=True)
        ]

    def _mean(self, parts: list[Array]) -> Array:
        """Return the mean over the pressures at each place, (places, 3, ...).

        Pressures are weighted as in the squared residuals (1 / scale^2); components that are not in
        `constant` are zero.

        Parameters
        ----------
        parts : (n, 3, ...) array
            One for each target.
        """
        numbers = [t.place_numbers for t in self.targets if t.place_numbers is not None]
        count = 1 + max(int(numbers_of_target.max()) for numbers_of_target in numbers)
        total = np.zeros((count, *parts[0].shape[1:]))
        weights = np.zeros((count, 3))
        for rows, part, scale in zip(numbers, parts, self.scales, strict=True):
            weight = scale**-2.0
            weight_of_part = weight.reshape(3, *[1] * (part.ndim - 2))
            # Unbuffered: a file may have a place twice.
            np.add.at(total, rows, part * weight_of_part)
            np.add.at(weights, rows, weight)
        weights[weights == 0] = 1.0
        mean = total / weights.reshape(*weights.shape, *[1] * (total.ndim - 2))
        mean[:, sorted(set(range(3)) - set(self.constant))] = 0.0
        return mean

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return the derivatives (m, k) of the residual by k parameters.

        Parameters
        ----------
        slope : (frames, nodes, 3, k) array, mm
            Derivatives of the model's displacements.
        """
        return self.columns_of(
            [target.modelled_displacement(slope, k) for k, target in enumerate(self.targets)]
        )

    def columns_of(self, parts: list[Array]) -> Array:
        """Return the changes (m, k) of the residual due to k changes of the model's displacements.

        Parameters
        ----------
        parts : (n, 3, k) array, mm
            The changes at the places of each target.
        """
        blocks = [
            (part / scale[:, None]).swapaxes(0, 1).reshape(-1, part.shape[-1])
            for part, scale in zip(self._without_mean(parts), self.scales, strict=True)
        ]
        return np.concatenate(blocks)

    def causes(self, history: History) -> dict[str, Array]:
        """Return the derivatives (m, k) of the residual by the k amounts of each cause of misfit.

        Keys are the words of the causes. It is empty where positions are not known.
        """
        if not self.positions:
            return {}
        slopes = _slopes_by_cause(self.targets, history.displacement)
        return {cause: self.columns_of(parts) for cause, parts in slopes.items()}

    def nuisance_columns(self, names: Sequence[str], nuisance: Unknowns, history: History) -> Array:
        """Return the derivatives (m, names) of the residual by nuisance unknowns.

        They are some of `OFFSETS` and `MISALIGNMENTS`, in the units of these.

        Parameters
        ----------
        nuisance : Unknowns
            Their values, at which the derivatives are taken, whatever the history.
        """
        order = (*OFFSETS, *MISALIGNMENTS)
        parts = []
        for target in self.targets:
            count = len(target.displacement)
            parts.append(np.tile(np.eye(3), (count, 1, 1)))
        if any(name in MISALIGNMENTS for name in names):
            slopes = self._registration_slopes(amounts_of(MISALIGNMENTS, nuisance))
            parts = [
                np.concatenate([offsets, slope], -1)
                for offsets, slope in zip(parts, slopes, strict=True)
            ]
        return self.columns_of(parts)[:, [order.index(name) for name in names]]

    def mean_absolute(self, displacement: Array, nuisance: Unknowns | None = None) -> float:
        """Return the mean over all places and pressures of the L1 norm of the difference, mm.

        The norm is |dx| + |dy| + |dz| of model less measured displacement.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
            The model's displacements at its nodes.
        """
        parts = self.differences(displacement, nuisance)
        sums = [np.abs(part).sum(axis=1) for part in parts]
        return float(np.concatenate(sums).mean())


def _scale_of(target: FieldTarget, normalise: Literal["e", "mm"], weight: float) -> Array:
    """Return the divisors (3,), mm, that turn differences of a target into residuals."""
    count = np.sqrt(len(target.displacement))
    if normalise == "mm":
        return count / weight * np.ones(3)
    largest = np.abs(target.displacement).max(axis=0)
    if not (largest > 0).all():
        zero = f"d{'xyz'[int(np.argmin(largest))]} is zero everywhere"
        problem = f"{zero}: nothing to match (is a column mapped wrongly?)"
        raise InputError(None, f"data at {target.pressure * 1e3:g} kPa", problem)
    return count / weight * largest


#: A drift has the same shape, as moduli take up a factor of all pressures.
PRESSURES = (
    "pressures off by {:+.2g} kPa (nuisance.pressure_offset), or more and more from frame to frame "
    "(dropped frames, a slow clock: give the frames' times)"
)


def _slopes_by_cause(targets: Sequence[FieldTarget], displacement: Array) -> dict[str, list[Array]]:
    """Return what one unit of each cause adds to the model's field at the places of each target.

    Parameters
    ----------
    targets : sequence of FieldTarget
        Measured fields with known positions, by rising pressure.
    displacement : (frames, nodes, 3) array, mm
        The model's displacements.

    Returns
    -------
    dict
        By cause (its words, in which the amounts are to be filled in): for each target an
        (n, 3, k) array of changes, mm, per unit of each of the k amounts of the cause. Units are
        those of the words. Empty unless there are at least two pressures and they rise.
    """
    pressures = [0.0, *(target.pressure for target in targets)]
    if len(pressures) < 3 or not (np.diff(pressures) > 0).all():
        return {}
    by_log_pressure = _by_log_pressure(targets, displacement)
    slopes: dict[str, list[Array]] = {}
    for k, target in enumerate(targets):
        by_pressure = target.modelled_displacement(by_log_pressure, k) / target.pressure
        of_target = _slopes_of_target(target, target.modelled_field(displacement, k), by_pressure)
        for cause, columns in of_target.items():
            slopes.setdefault(cause, []).append(np.stack(columns, axis=-1))
    if len(targets) > 2:
        for k, target in enumerate(targets):
            cause = (
                "a pressure off by {:+.2g} kPa at "
                f"{1e3 * target.pressure:.4g} kPa alone (a wrong frame)"
            )
            slopes[cause] = [(n == k) * part for n, part in enumerate(slopes[PRESSURES])]
    return slopes


def _by_log_pressure(targets: Sequence[FieldTarget], displacement: Array) -> Array:
    """Return derivatives (frames, nodes, 3), mm, of the model's displacements by ln(p).

    They are finite differences between frames, and ln(p) suits them: a flat sheet rises with a
    power of p.

    Parameters
    ----------
    displacement : (frames, nodes, 3) array, mm
        The model's displacements.
    """
    frames = [k if target.frame is None else target.frame for k, target in enumerate(targets)]
    log_pressures = np.log([target.pressure for target in targets])
    slopes = np.zeros_like(displacement)
    order: Literal[1, 2] = 2 if len(log_pressures) > 2 else 1
    slopes[frames] = np.gradient(displacement[frames], log_pressures, axis=0, edge_order=order)
    return slopes


def _slopes_of_target(target: FieldTarget, u: Array, by_pressure: Array) -> dict[str, list[Array]]:
    """Return the columns (n, 3), one for each amount, of every cause at one target.

    Parameters
    ----------
    u : (n, 3) array, mm
        The model's field at the places.
    by_pressure : (n, 3) array, mm/MPa
        Its derivative by the pressure.
    """
    assert target.positions is not None
    x, y = target.positions.T
    dx, dy, dz = u.T
    zero = np.zeros(len(u))
    by_x, by_y = SmoothField.through(target.positions, u).slopes()
    turned_field = np.stack([-dy, dx, zero], axis=1)
    turned_axes = turned_field + y[:, None] * by_x - x[:, None] * by_y
    larger_disk = u - x[:, None] * by_x - y[:, None] * by_y + target.pressure * by_pressure
    about_x = np.stack([zero, -dz, dy], axis=1)
    about_y = np.stack([dz, zero, -dx], axis=1)
    degree = np.pi / 180
    return {
        "a true radius {:+.1%} away (compare it with the clamp)": [larger_disk],
        "a centre at {:+.2g}, {:+.2g} mm (registration.centre)": [-by_x, -by_y],
        "a tilt of {:+.2g}, {:+.2g} degrees (registration.plane)": [
            degree * about_x,
            degree * about_y,
        ],
        "axes turned by {:+.2g} degrees (registration.warp)": [degree * turned_axes],
        PRESSURES: [-1e-3 * by_pressure],
    }
