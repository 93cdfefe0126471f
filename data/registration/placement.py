"""Where the test's coordinates lie in the camera's, and frames moved from one into the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..frames import Frame

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Placement:
    """A right-handed frame: `origin` (3,) mm and unit `axes` (3, 3), rows x, y, z, in the camera's.

    Raises
    ------
    ValueError : axes that are not orthonormal and right-handed.
    """

    origin: Array
    axes: Array

    def __post_init__(self) -> None:
        square = np.allclose(self.axes @ self.axes.T, np.eye(3), atol=1e-9)
        if not square or np.linalg.det(self.axes) < 0:
            raise ValueError("expected right-handed, orthonormal axes")

    @classmethod
    def unmoved(cls) -> Placement:
        """The camera's own frame."""
        return cls(np.zeros(3), np.eye(3))

    def places(self, points: Array) -> Array:
        """Points (..., 3) of the camera's frame in the test's."""
        return np.asarray((points - self.origin) @ self.axes.T)

    def directions(self, vectors: Array) -> Array:
        """Vectors (..., 3) of the camera's frame in the test's."""
        return np.asarray(vectors @ self.axes.T)

    def applied(self, frame: Frame) -> Frame:
        """The frame in the test's coordinates."""
        return replace(
            frame,
            points=self.places(frame.points),
            displacement=self.directions(frame.displacement),
        )

    def after(self, first: Placement) -> Placement:
        """The one placement that is `first` and then this."""
        return Placement(first.origin + self.origin @ first.axes, self.axes @ first.axes)

    @property
    def tilt(self) -> float:
        """Angle between the two z axes, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.axes[2, 2], -1.0, 1.0))))


def turned(angle: float) -> Placement:
    """The same plane and origin, x turned by `angle` degrees from x towards y."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return Placement(np.zeros(3), np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))


def shifted(x: float, y: float, z: float = 0.0) -> Placement:
    """The same axes, the origin moved."""
    return Placement(np.array([x, y, z], dtype=float), np.eye(3))


def all_applied(placement: Placement, frames: Sequence[Frame]) -> tuple[Frame, ...]:
    """Every frame in the test's coordinates."""
    return tuple(placement.applied(frame) for frame in frames)
