"""Rigid motion of the clamp in a frame, from points beyond the rim, and frames without it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..frames import Frame
from ..outline import Outline
from .directions import in_all_quarters

Array = NDArray[np.float64]

#: Points from this share of the rim's radius on are on the clamp.
BEYOND = 1.03
LEAST = 12


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """How a body moved: place -> turn @ place + shift, mm.

    left : RMS of what is not rigid, mm. points : on which it was found; 0 where it is unknown.
    """

    turn: Array
    shift: Array
    left: float
    points: int

    @property
    def angle(self) -> float:
        """Of the turn, degrees."""
        return float(np.degrees(np.arccos(np.clip((np.trace(self.turn) - 1) / 2, -1.0, 1.0))))


UNKNOWN = RigidMotion(np.eye(3), np.zeros(3), float("nan"), 0)


def clamp_points(points: Array, outline: Outline) -> NDArray[np.bool_]:
    """Which of the points (n, 3), about the rim's centre in its plane, are beyond the rim."""
    return outline.share(points[:, :2]) > BEYOND


def clamp_motion(frame: Frame, clamp: NDArray[np.bool_]) -> RigidMotion:
    """The rigid motion of the points on the clamp; `UNKNOWN` where there are too few all around.

    The turn is the nearest rotation (Kabsch 1976) of the displaced points onto the reference.
    """
    whole = clamp & np.isfinite(frame.displacement).all(axis=1)
    before = frame.points[whole]
    if len(before) < LEAST or not in_all_quarters(before):
        return UNKNOWN
    after = before + frame.displacement[whole]
    middle_before, middle_after = before.mean(axis=0), after.mean(axis=0)
    u, _, v = np.linalg.svd((after - middle_after).T @ (before - middle_before))
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    shift = middle_after - turn @ middle_before
    rest = after - before @ turn.T - shift
    return RigidMotion(turn, shift, float(np.sqrt((rest**2).sum(axis=1).mean())), len(before))


def without(frame: Frame, motion: RigidMotion) -> Frame:
    """The frame as a clamp that did not move would show it."""
    after = frame.points + frame.displacement
    still = (after - motion.shift) @ motion.turn  # the inverse of a rotation is its transpose
    return replace(frame, displacement=still - frame.points)
