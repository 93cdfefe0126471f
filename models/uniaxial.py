"""The uniaxial strip tests (thesis chapter 3.3) as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..meshes.mesh import Mesh
from ..meshes.strip import strip_mesh, yarn_direction
from .parameters import OfThickness

#: Rollers on the top and on the symmetry line; the pulled end is free to get narrower.
ROLLERS: Mapping[str, tuple[int, ...]] = {"top": (1,), "symmetry_x": (0,)}
#: Ends held as in the jaws of the machine.
GRIPS: Mapping[str, tuple[int, ...]] = {"top": (0, 1), "bottom": (0,)}
#: Quads across and along: half a straight strip (Fig. 3.5), the whole bias strip (Fig. 3.6).
QUADS = {"straight": (5, 8), "bias": (10, 30)}
#: Thesis section 3.1: cut strips, and section 3.3: equal increments.
WIDTH, GRIP_DISTANCE, INCREMENTS = 25.0, 75.0, 100


@dataclass(frozen=True, eq=False)
class UniaxialModel(OfThickness):
    """A strip in its plane whose lower end is pulled down until the gauge has a given length.

    The elongation of the gauge is prescribed, as it was measured; the displacement of the pulled
    end that brings it about is part of the answer. Both are the same where the gauge is the
    whole strip.

    Parameters
    ----------
    mesh : mm, in the xy plane, pulled along y; node sets `gauge` (two nodes), `bottom` and those
        in `supports`.
    warp : (3,) direction of the warp yarn. The fill yarn is 90 degrees from it, counter-clockwise.
    thickness : mm, in the reference state.
    elongations : mm of the gauge, strictly increasing: the increments over which the law is
        integrated, every one reported.
    supports : degrees of freedom held at zero, by node set (every node stays in the plane).
    pulled : the node set that moves along -y.
    load_factor : what the reaction is multiplied with: 2 for one half of the width.

    Raises
    ------
    InputError : a node set that is not there, elongations that do not increase, a thickness or
        load factor that is not positive, a pulled set that is also supported along y.
    """

    mesh: Mesh
    warp: NDArray[np.float64]
    thickness: float
    elongations: Sequence[float]
    supports: Mapping[str, tuple[int, ...]]
    pulled: str = "bottom"
    load_factor: float = 1.0

    def __post_init__(self) -> None:
        for name in ("gauge", self.pulled, *self.supports):
            if name not in self.mesh.node_sets:
                raise InputError(None, "mesh", f"has no node set {name!r}")
        if len(self.mesh.node_sets["gauge"]) != 2:
            raise InputError(None, "mesh", "the node set 'gauge' must hold two nodes")
        levels = np.array(self.elongations, float)
        if not len(levels) or not (np.diff(levels, prepend=0.0) > 0).all():
            raise InputError(None, "elongations", f"expected positive, increasing, got {levels} mm")
        for name in ("thickness", "load_factor"):
            if not getattr(self, name) > 0:
                raise InputError(None, name, f"expected > 0, got {getattr(self, name)}")
        if np.isin(self.driven, self.fixed).any():
            raise InputError(None, "supports", f"{self.pulled!r} is pulled along y and held there")
        object.__setattr__(self, "elongations", tuple(levels.tolist()))
        object.__setattr__(self, "warp", np.asarray(self.warp, float))

    @property
    def gauge_length(self) -> float:
        """Distance of the two gauge nodes, mm."""
        lower, upper = self.mesh.points[self.mesh.node_sets["gauge"]]
        return float(np.linalg.norm(upper - lower))

    @property
    def driven(self) -> NDArray[np.intp]:
        """Degrees of freedom that move with the pulled end, 3 * node + direction, sorted."""
        return np.sort(3 * self.mesh.node_sets[self.pulled] + 1).astype(np.intp)

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Degrees of freedom held at zero, sorted: the supports, and all out of the plane."""
        held = [3 * self.mesh.node_sets[n] + k for n, ks in self.supports.items() for k in ks]
        return np.unique(np.concatenate([*held, 3 * np.arange(len(self.mesh.points)) + 2]))


def straight_strip(
    direction: Literal["warp", "fill"],
    gauge_length: float,
    final_length: float,
    thickness: float,
    width: float = WIDTH,
    increments: int = INCREMENTS,
    across: int = QUADS["straight"][0],
    along: int = QUADS["straight"][1],
) -> UniaxialModel:
    """Warp or fill test: one half of the width over the gauge length (Fig. 3.5; 40 quads).

    Parameters
    ----------
    gauge_length, final_length : mm, of the virtual strain gauge (Table 3.1).
    width : mm, of the whole strip; the load is that of the whole strip, too.
    across, along : quads on the half.
    """
    if direction not in ("warp", "fill"):
        raise InputError(None, "direction", f"expected 'warp' or 'fill', got {direction!r}")
    mesh = strip_mesh(width, gauge_length, across, along, symmetry="half")
    levels = _equal(gauge_length, final_length, increments)
    # Fill lies along the pull when warp is a quarter turn clockwise from it.
    warp = yarn_direction(0.0 if direction == "warp" else 90.0)
    return UniaxialModel(mesh, warp, thickness, levels, ROLLERS, load_factor=2.0)


def bias_strip(
    gauge_length: float,
    final_length: float,
    thickness: float,
    width: float = WIDTH,
    length: float = GRIP_DISTANCE,
    angle: float = 45.0,
    increments: int = INCREMENTS,
    across: int = QUADS["bias"][0],
    along: int = QUADS["bias"][1],
) -> UniaxialModel:
    """Bias test: the whole strip between the grips (Fig. 3.6; 300 quads).

    Parameters
    ----------
    gauge_length, final_length : mm, of the virtual strain gauge in the middle (Table 3.1).
    length : mm, between the grips at the start.
    angle : degrees from the pull to the warp yarn.
    """
    mesh = strip_mesh(width, length, across, along, gauge_length)
    levels = _equal(gauge_length, final_length, increments)
    return UniaxialModel(mesh, yarn_direction(angle), thickness, levels, GRIPS)


def refined_quads(strip: Literal["straight", "bias"], factor: float) -> dict[str, int]:
    """The thesis' `across` and `along` of a strip times a factor, to the nearest that can be made.

    A bias strip is whole and has nodes on its middle line: an even number across.
    """
    across, along = (factor * count for count in QUADS[strip])
    if strip == "bias":
        return {"across": max(2, 2 * round(across / 2)), "along": max(3, round(along))}
    return {"across": max(1, round(across)), "along": max(1, round(along))}


def _equal(gauge_length: float, final_length: float, increments: int) -> tuple[float, ...]:
    if not final_length > gauge_length:
        raise InputError(
            None, "final_length", f"expected more than {gauge_length} mm, got {final_length}"
        )
    if increments != int(increments) or increments < 1:
        raise InputError(None, "increments", f"expected a whole number, got {increments!r}")
    return tuple(np.linspace(0.0, final_length - gauge_length, int(increments) + 1)[1:].tolist())
