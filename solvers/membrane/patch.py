"""A patch in a biaxial test: one point of the law instead of a mesh, with exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.biaxial_response import biaxial_response
from ...materials.law import HypoelasticLaw
from ...models.patch import PatchModel
from ..base import History
from .march import Asked, Done
from .wall import Wall

Array = NDArray[np.float64]


@dataclass(eq=False)
class Patch:
    """What the solver keeps of a patch from run to run: its law, and where the last run ended."""

    law: HypoelasticLaw
    strain_old: Array = field(default_factory=lambda: np.zeros((1, 1, 3)))
    stress_old: Array = field(default_factory=lambda: np.zeros((1, 1, 3)))
    keep_tangent: bool = False
    iterations: int = 0


def prepare(model: PatchModel, law: HypoelasticLaw, tolerance: float, wall: Wall) -> Patch:
    """There is nothing to prepare; equilibrium holds to rounding, whatever the tolerance."""
    return Patch(law)


def analyse(patch: Patch, model: PatchModel, asked: Asked) -> tuple[History, Array]:
    """History, and the derivatives of the displacements by the parameters at every load.

    Raises
    ------
    SolverFailure : the law has no strain for a load.
    """
    found = biaxial_response(patch.law, model.loads, model.thickness, asked.parameters)
    if found.reached < len(model.loads):
        warp, fill = model.loads[found.reached]
        raise SolverFailure(
            f"no equilibrium at {warp:.4g} and {fill:.4g} N/mm along warp and fill (load "
            f"{found.reached + 1} of {len(model.loads)}): a modulus is not positive, or the law "
            "softens before it",
            "membrane",
        )
    patch.strain_old[0, 0, :2], patch.stress_old[0, 0, :2] = found.strain[-1], found.stress[-1]
    patch.iterations = len(model.loads)
    stretch = 1.0 + found.elongation
    slope = stretch[:, :, None] * found.slope
    none = np.zeros(1)
    moved = model.displacements(found.elongation)
    rates = np.zeros((*moved.shape, len(asked.parameters)))
    rates[:, :, :2] = model.mesh.points[None, :, :2, None] * slope[:, None]
    if asked.tell is not None:
        asked.tell(Done(float(len(model.loads))))
    history = History(
        model.loads.sum(axis=1),
        moved,
        np.concatenate([found.strain.min(axis=0), none]),
        np.concatenate([found.strain.max(axis=0), none]),
        iterations=patch.iterations,
        unstable=tuple(f"{w:.4g} and {f:.4g} N/mm" for w, f in model.loads[~found.stable].tolist()),
    )
    return history, rates
