"""The inflated circular membrane (thesis chapter 4) as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..meshes.mesh import Mesh

#: Pinned rim; symmetry lines where the mesh has them.
RIM_AND_SYMMETRY: Mapping[str, tuple[int, ...]] = {
    "rim": (0, 1, 2),
    "symmetry_x": (0,),
    "symmetry_y": (1,),
}


@dataclass(frozen=True, eq=False)
class BubbleModel:
    """A membrane that starts flat and is inflated by follower pressure.

    Parameters
    ----------
    mesh : mm; warp is x, fill is y.
    thickness : mm, in the reference state.
    pressures : MPa, strictly increasing: the frames to report.
    increments : MPa, strictly increasing, containing every pressure: the steps over which the
        hypoelastic law is integrated; the pressures unless given. They hardly matter to the
        result (benchmarks/bench_increments.py).
    supports : degrees of freedom held at zero, by node set.

    Raises
    ------
    InputError : pressures that do not increase, increments without one of the pressures, a
        support on a set that the mesh does not have (symmetry sets excepted).
    """

    mesh: Mesh
    thickness: float
    pressures: Sequence[float]
    increments: Sequence[float] = ()
    supports: Mapping[str, tuple[int, ...]] = field(default_factory=lambda: RIM_AND_SYMMETRY)

    def __post_init__(self) -> None:
        steps = np.array(self.increments if len(self.increments) else self.pressures, float)
        wanted = np.array(self.pressures, float)
        for name, values in (("pressures", wanted), ("increments", steps)):
            if not len(values) or not (np.diff(values, prepend=0.0) > 0).all():
                raise InputError(None, name, f"expected positive, increasing, got {values} MPa")
        near = np.abs(steps[:, None] - wanted).min(axis=0) if len(steps) else wanted
        if (near > 1e-9 * wanted).any():
            raise InputError(None, "increments", "must contain every reported pressure")
        if not self.thickness > 0:
            raise InputError(None, "thickness", f"expected > 0 mm, got {self.thickness}")
        if "rim" in self.supports and "rim" not in self.mesh.node_sets:
            raise InputError(None, "mesh", "has no node set 'rim' to pin")
        object.__setattr__(self, "pressures", tuple(wanted.tolist()))
        object.__setattr__(self, "increments", tuple(steps.tolist()))

    def with_pressure_offset(self, offset: float) -> BubbleModel:
        """The same model with `offset` (MPa) added to every pressure and increment.

        Raises
        ------
        InputError : the first increment would not be positive.
        """
        return replace(
            self,
            pressures=[p + offset for p in self.pressures],
            increments=[p + offset for p in self.increments],
        )

    @property
    def reported(self) -> NDArray[np.intp]:
        """Index of each reported pressure in `increments`, (frames,)."""
        steps = np.array(self.increments)
        return np.array([int(np.argmin(np.abs(steps - p))) for p in self.pressures])

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Held degrees of freedom, 3 * node + direction, sorted."""
        dofs = [
            3 * self.mesh.node_sets[name] + direction
            for name, directions in self.supports.items()
            if name in self.mesh.node_sets
            for direction in directions
        ]
        return np.unique(np.concatenate(dofs)).astype(np.intp)


def default_increments(pressures: Sequence[float]) -> tuple[float, ...]:
    """The pressures, with small first steps so that no step is more than about 3 times the last.

    22, 59, 97 ... kPa becomes 6, 22, 40, 59, 97 ... The two more are not for accuracy: from a flat
    sheet Newton reaches a high first pressure in as many iterations as two lower ones: 20 starts
    of the known-solution example cost the same with either.
    """
    first = pressures[0]
    steps = [first * 6.0 / 22.0, *pressures]
    if len(pressures) > 1 and pressures[1] > 1.5 * first:
        steps.append(first + (pressures[1] - first) * 18.0 / 37.0)
    return tuple(sorted(steps))
