"""Residuals of a bubble test.

A block is one displacement direction at one pressure: (model - measured) / (largest measured
|value| * sqrt(n)). Its norm is e_x / max(P_x), e is the sum of the norms. With plain millimetres
the scale is one and e is a sum of RMS errors in mm.

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
from .causes import slopes_by_cause
from .smooth_field import SmoothField, tilt_rotation
from .targets import FieldTarget

Unknowns = Mapping[str, float]
#: Nuisance of a measured field: a rigid displacement, mm.
OFFSETS = ("offset_x", "offset_y", "offset_z")
#: What a registration leaves open: a tilt of the plane about x and y (degrees), and how far the
#: true places lie along x and y from those that are given (mm).
MISALIGNMENTS = ("tilt_x", "tilt_y", "shift_x", "shift_y")
#: mm, noise of a displacement by a good image correlation.
CORRELATION = 0.05


def amounts_of(names: Sequence[str], nuisance: Unknowns | None) -> Array:
    """Return the amounts of `OFFSETS` or `MISALIGNMENTS`; zero where one is no unknown."""
    return np.array([(nuisance or {}).get(name, 0.0) for name in names])


class FieldObjective(Objective):
    """Residual blocks for displacement fields at several pressures, x, y, z at each.

    Parameters
    ----------
    targets : sequence of FieldTarget
        One a reported pressure, in the order of the model's frames.
    normalise : {"e", "mm"}
        Whether residuals are relative to the largest measured value of each block, or in mm.
    weight : float
        Of every block in e.
    noise : float, mm, or None
        Of one displacement, at least.
    constant : sequence of int
        Directions (0 to 2) in which at every place the weighted mean over the pressures of model
        less measured is projected out.

    Raises
    ------
    InputError
        A direction has no displacement to normalise by.
    """

    unit = "mm"
    columns = 3

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
        """Return the arrays on which residuals depend beside the model."""
        samples = [target.sample.data for target in self.targets if target.sample is not None]
        return (*(target.displacement for target in self.targets), *samples)

    @property
    def measured(self) -> Array:
        """Return the measured displacements as the residuals are arranged, (m,) mm."""
        return np.concatenate([target.displacement.T.reshape(-1) for target in self.targets])

    @property
    def positions(self) -> tuple[Array, ...]:
        """Return (n, 2) mm at rest of every block's values; empty where they are not known."""
        positions: list[Array] = []
        for target in self.targets:
            if target.positions is None:
                return ()
            positions += [target.positions] * 3
        return tuple(positions)

    def of_points(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return (m,) for each residual, of values for each place, frame by frame."""
        ends = np.cumsum([len(target.displacement) for target in self.targets])[:-1]
        return np.concatenate([np.tile(of_frame, 3) for of_frame in np.split(values, ends)])

    def shifted(self, external: History, surrogate: History) -> FieldObjective:
        """Return the objective of a surrogate that stands for an external solver."""
        objective = copy.copy(self)
        difference = external.displacement - surrogate.displacement
        objective.targets = tuple(
            replace(target, displacement=target.displacement - target.of(difference, k))
            for k, target in enumerate(self.targets)
        )
        return objective

    def residual(self, history: History, nuisance: Unknowns | None = None) -> Array:
        """Return the blocks laid end to end, (m,); the model is moved by the offsets."""
        differences = self.differences(history.displacement, nuisance)
        blocks = [
            (difference / scale).T.reshape(-1)
            for difference, scale in zip(differences, self.scales, strict=True)
        ]
        return np.concatenate(blocks)

    def modelled(self, displacement: Array, nuisance: Unknowns | None = None) -> list[Array]:
        """Return (n, 3) mm of each target from the model's (frames, nodes, 3), offset included."""
        offset = amounts_of(OFFSETS, nuisance)
        modelled = [target.of(displacement, k) + offset for k, target in enumerate(self.targets)]
        amounts = amounts_of(MISALIGNMENTS, nuisance)
        if not amounts.any():
            return modelled
        changes = self._registration_changes(amounts)
        return [field + change for field, change in zip(modelled, changes, strict=True)]

    def _registration_changes(self, amounts: Array) -> list[Array]:
        """Return (n, 3) mm that amounts (4,) of `MISALIGNMENTS` add to model less measured.

        The measured field is turned into the model's frame. Where the model is read at a given
        place it moves less than at the true one by what the measured field grows up to there.
        """
        rotation, _ = tilt_rotation(amounts[:2])
        changes = []
        for target, smooth in zip(self.targets, self._smooth_fields, strict=True):
            growth = smooth.growth(amounts[2:])
            changes.append((growth - target.displacement) @ rotation + target.displacement)
        return changes

    def _registration_slopes(self, amounts: Array) -> list[Array]:
        """Return derivatives (n, 3, 4) mm of `_registration_changes` by the amounts."""
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
        """Return a smooth field through each measured one whose positions are known."""
        return [
            SmoothField.through(target.positions, target.displacement)
            for target in self.targets
            if target.positions is not None
        ]

    def differences(self, displacement: Array, nuisance: Unknowns | None = None) -> list[Array]:
        """Return model less measured (n, 3) mm of each target, without a constant field."""
        return self._without_mean(self._full_differences(displacement, nuisance))

    def constant_field(self, displacement: Array, nuisance: Unknowns | None = None) -> Array:
        """Return (places, 3) mm, measured less model as far as it is the same at all pressures."""
        return -self._mean(self._full_differences(displacement, nuisance))

    def _full_differences(self, displacement: Array, nuisance: Unknowns | None) -> list[Array]:
        """Return model less measured (n, 3) mm of each target."""
        modelled = self.modelled(displacement, nuisance)
        return [
            field - target.displacement
            for field, target in zip(modelled, self.targets, strict=True)
        ]

    def _without_mean(self, parts: list[Array]) -> list[Array]:
        """Return values (n, 3, ...) of each target less their mean over the pressures by place."""
        if not self.constant:
            return parts
        mean = self._mean(parts)
        return [
            part - mean[target.place_numbers]
            for part, target in zip(parts, self.targets, strict=True)
        ]

    def _mean(self, parts: list[Array]) -> Array:
        """Return (places, 3, ...), weighted as the squared residuals; zero if not constant."""
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
        return np.asarray(mean)

    def jacobian(self, history: History, slope: Array) -> Array:
        """Return (m, k) of slopes (frames, nodes, 3, k) mm of the model's displacement."""
        return self._columns([target.of(slope, k) for k, target in enumerate(self.targets)])

    def _columns(self, parts: list[Array]) -> Array:
        """Return (m, k) of changes (n, 3, k) of the model's displacement of each target."""
        blocks = [
            (part / scale[:, None]).swapaxes(0, 1).reshape(-1, part.shape[-1])
            for part, scale in zip(self._without_mean(parts), self.scales, strict=True)
        ]
        return np.concatenate(blocks)

    def causes(self, history: History) -> dict[str, Array]:
        """Return (m, k) a cause, by its words, slopes of the residual by its amounts."""
        if not self.positions:
            return {}
        slopes = slopes_by_cause(self.targets, history.displacement)
        return {cause: self._columns(parts) for cause, parts in slopes.items()}

    def nuisance_columns(self, names: Sequence[str], nuisance: Unknowns) -> Array:
        """Return (m, names), the slope of the residual by `OFFSETS` (mm) and `MISALIGNMENTS`."""
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
        return self._columns(parts)[:, [order.index(name) for name in names]]

    def mean_absolute(self, displacement: Array, nuisance: Unknowns | None = None) -> float:
        """Return the mean of |dx| + |dy| + |dz| differences over all places and pressures, mm."""
        parts = self.differences(displacement, nuisance)
        sums = [np.abs(part).sum(axis=1) for part in parts]
        return float(np.concatenate(sums).mean())


def _scale_of(target: FieldTarget, normalise: Literal["e", "mm"], weight: float) -> Array:
    """Return mm (3,) in one unit of the residuals of a target, in each direction."""
    count = np.sqrt(len(target.displacement))
    if normalise == "mm":
        return np.asarray(count / weight * np.ones(3))
    largest = np.abs(target.displacement).max(axis=0)
    if not (largest > 0).all():
        zero = f"d{'xyz'[int(np.argmin(largest))]} is zero everywhere"
        problem = f"{zero}: nothing to match (is a column mapped wrongly?)"
        raise InputError(None, f"data at {target.pressure * 1e3:g} kPa", problem)
    return np.asarray(count / weight * largest)
