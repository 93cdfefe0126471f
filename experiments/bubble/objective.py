"""Residuals of a bubble test (Eqs 4.5-4.8).

A residual block is one displacement direction at one pressure: (model - measured) / (largest
measured |value| * sqrt(n)). The norm of a block is e_x/max(P_x) of Eq. 4.8, e is the sum of the
block norms. With plain millimetres the scale is one and e is a sum of RMS errors in mm.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ...errors import InputError
from ...identification.comparison import NoiseIs
from ...solvers.base import History

Array = NDArray[np.float64]


#: Nuisance of a measured field: a rigid displacement, mm.
OFFSETS = ("offset_x", "offset_y", "offset_z")
#: mm, noise of a displacement by a good image correlation.
CORRELATION = 0.05


def displacement_offset(nuisance: Mapping[str, float]) -> Array:
    """(3,) mm; zero where it is no unknown."""
    return np.array([nuisance.get(name, 0.0) for name in OFFSETS])


@dataclass(frozen=True, eq=False)
class FieldTarget:
    """What the displacement field should be at one pressure.

    displacement (n, 3) mm at n places; `sample` (n, nodes) takes model nodes to these places
    (None: the places are the nodes). places : (n,) their numbers, by which the same place is known
    in other targets; needed for a field that is constant. frame : of the model's history, the
    target's own number unless given; since : the frame from which the displacement is counted,
    None for the reference state. at_rest : (n, 2) mm, where the places are before the test; needed
    for what neighbours have in common.
    """

    pressure: float
    displacement: Array
    sample: sp.csr_matrix | None = None
    places: NDArray[np.intp] | None = None
    frame: int | None = None
    since: int | None = None
    at_rest: Array | None = None

    def at(self, nodal: Array) -> Array:
        """Model displacement (nodes, ...) at the places, (n, ...)."""
        if self.sample is None:
            return nodal
        return np.asarray(self.sample @ nodal.reshape(len(nodal), -1)).reshape(-1, *nodal.shape[1:])

    def of(self, frames: Array, number: int) -> Array:
        """The same of frames (frames, nodes, ...), as target `number` of its objective."""
        here = frames[number if self.frame is None else self.frame]
        return self.at(here if self.since is None else here - frames[self.since])


class FieldObjective:
    """Residual blocks for displacement fields at several pressures, x, y, z at each.

    Parameters
    ----------
    targets : one a reported pressure, in the order of the model's frames.
    normalise : "e" (Eq. 4.8) or "mm".
    weight : of every block in e.
    noise : mm, of one measured displacement, to reckon with at least; that of a good image
        correlation unless given.
    constant : directions (0 to 2) in which a field that is the same at all pressures is projected
        out: at every place the weighted mean over the pressures of model less measured is zero.

    Raises
    ------
    InputError : a direction without any displacement cannot be normalised by it.
    """

    #: What the residuals are in after `scale`.
    unit = "mm"

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
        self.targets, self.constant = tuple(targets), tuple(constant)
        self.scales = []
        for target in self.targets:
            largest = np.abs(target.displacement).max(axis=0)
            if normalise == "e" and not (largest > 0).all():
                axis = "xyz"[int(np.argmin(largest))]
                raise InputError(
                    None,
                    f"data at {target.pressure * 1e3:g} kPa",
                    f"d{axis} is zero everywhere: nothing to match (is a column mapped wrongly?)",
                )
            count = np.sqrt(len(target.displacement))
            self.scales.append(count / weight * (largest if normalise == "e" else np.ones(3)))
        self.sizes = tuple(len(t.displacement) for t in self.targets for _ in "xyz")

    @property
    def scale(self) -> Array:
        """(m,): millimetres in one unit of each residual."""
        return np.repeat(np.concatenate(self.scales), self.sizes)

    @property
    def data(self) -> tuple[Array, ...]:
        """Everything measured that the residual depends on."""
        places = [t.sample.data for t in self.targets if t.sample is not None]
        return (*(t.displacement for t in self.targets), *places)

    @property
    def places(self) -> tuple[Array, ...]:
        """(n, 2) mm at rest of every block's values; empty where they are not known."""
        known = [target.at_rest for target in self.targets if target.at_rest is not None]
        if len(known) < len(self.targets):
            return ()
        return tuple(places for places in known for _ in "xyz")

    def of_points(self, values: Array) -> Array:
        """(m,) for each residual, of values for each place of the targets, frame by frame."""
        ends = np.cumsum([len(target.displacement) for target in self.targets])[:-1]
        return np.concatenate([np.tile(own, 3) for own in np.split(values, ends)])

    def shifted(self, here: History, there: History) -> FieldObjective:
        """The objective of a model that moves as `here` where this one moves as `there`."""
        other = copy.copy(self)
        by = here.displacement - there.displacement
        other.targets = tuple(
            replace(target, displacement=target.displacement - target.of(by, k))
            for k, target in enumerate(self.targets)
        )
        return other

    def residual(self, history: History, nuisance: Mapping[str, float] | None = None) -> Array:
        """Blocks laid end to end, (m,); offset_x, offset_y, offset_z (mm) are added to the model's
        displacement."""
        parts = self.differences(history.displacement, nuisance)
        return np.concatenate(
            [(d / s).T.reshape(-1) for d, s in zip(parts, self.scales, strict=True)]
        )

    def modelled(
        self, displacement: Array, nuisance: Mapping[str, float] | None = None
    ) -> list[Array]:
        """(n, 3) mm of each target, from the model's (frames, nodes, 3): offset included."""
        shift = displacement_offset(nuisance or {})
        return [target.of(displacement, k) + shift for k, target in enumerate(self.targets)]

    def differences(
        self, displacement: Array, nuisance: Mapping[str, float] | None = None
    ) -> list[Array]:
        """Model less measured (n, 3) mm of each target, without a constant field."""
        modelled = self.modelled(displacement, nuisance)
        return self._varying(
            [m - t.displacement for m, t in zip(modelled, self.targets, strict=True)]
        )

    def constant_field(
        self, displacement: Array, nuisance: Mapping[str, float] | None = None
    ) -> Array:
        """(places, 3) mm, measured less model as far as it is the same at all pressures."""
        modelled = self.modelled(displacement, nuisance)
        return -self._mean(
            [m - t.displacement for m, t in zip(modelled, self.targets, strict=True)]
        )

    def _varying(self, parts: list[Array]) -> list[Array]:
        """Values (n, 3, ...) of each target less their mean over the pressures, place by place."""
        if not self.constant:
            return parts
        mean = self._mean(parts)
        return [part - mean[t.places] for part, t in zip(parts, self.targets, strict=True)]

    def _mean(self, parts: list[Array]) -> Array:
        """(places, 3, ...), weighted as the squares of the residuals are; zero if not constant."""
        numbers = [t.places for t in self.targets if t.places is not None]
        count = 1 + max(int(own.max()) for own in numbers)
        total, weights = np.zeros((count, *parts[0].shape[1:])), np.zeros((count, 3))
        for own, part, scale in zip(numbers, parts, self.scales, strict=True):
            weight = scale**-2.0
            # Unbuffered: a file may have a place twice.
            np.add.at(total, own, part * weight.reshape(3, *[1] * (part.ndim - 2)))
            np.add.at(weights, own, weight)
        weights[weights == 0] = 1.0
        mean = total / weights.reshape(*weights.shape, *[1] * (total.ndim - 2))
        for axis in set(range(3)) - set(self.constant):
            mean[:, axis] = 0.0
        return np.asarray(mean)

    def jacobian(self, history: History, slope: Array) -> Array:
        """(m, parameters) from d displacement (frames, nodes, 3, parameters)."""
        count = slope.shape[-1]
        parts = self._varying([target.of(slope, k) for k, target in enumerate(self.targets)])
        return np.concatenate(
            [
                (part / scale[:, None]).transpose(1, 0, 2).reshape(-1, count)
                for part, scale in zip(parts, self.scales, strict=True)
            ]
        )

    def nuisance_columns(self, names: Sequence[str]) -> Array:
        """(m, names): slope of the residual by offset_x, offset_y, offset_z (mm)."""
        unknown = [name for name in names if name not in OFFSETS]
        if unknown:
            raise InputError(None, "nuisance", f"a field knows no {', '.join(unknown)}")
        columns = [
            np.kron(np.diag(1.0 / scale), np.ones((len(target.displacement), 1)))
            for target, scale in zip(self.targets, self.scales, strict=True)
        ]
        return np.concatenate(columns)[:, [OFFSETS.index(name) for name in names]]

    def mean_absolute(
        self, displacement: Array, nuisance: Mapping[str, float] | None = None
    ) -> float:
        """Mean over all places and pressures of |dx| + |dy| + |dz| differences, mm."""
        parts = self.differences(displacement, nuisance)
        return float(np.concatenate([np.abs(d).sum(axis=1) for d in parts]).mean())
