"""Analysis of a biaxial test on a homogeneously strained patch, for which one point suffices."""

from dataclasses import dataclass, field

import numpy as np

from ...errors import SolverFailure
from ...materials.biaxial_patch import biaxial_response
from ...materials.law import HypoelasticLaw
from ...meshes.mesh import Array
from ...meshes.strip_models import PatchModel
from ..base import History
from .loading import RunRequest
from .membrane import refuse_memory
from .wall import Wall


@dataclass(eq=False)
class Patch:
    """State of a patch: its law, and the strain and stress at the end of the last run.

    It has the attributes of `Membrane` that `MembraneSolver` sets or reads.
    """

    law: HypoelasticLaw
    strain_old: Array = field(default_factory=lambda: np.zeros((1, 1, 3)))
    stress_old: Array = field(default_factory=lambda: np.zeros((1, 1, 3)))
    keep_tangent: bool = False
    iterations: int = 0


def prepare(
    model: PatchModel,
    law: HypoelasticLaw,
    tolerance: float,
    wall: Wall,
) -> Patch:
    """Return the state of a patch; SolverFailure for a law with a memory.

    Parameters
    ----------
    tolerance, wall
        Not used; equilibrium is exact but for rounding.
    """
    refuse_memory(law, "a biaxial patch")
    return Patch(law)


def analyse(patch: Patch, model: PatchModel, request: RunRequest) -> tuple[History, Array]:
    """Return the history of a biaxial test, and the derivatives of its displacements.

    The derivatives are (loads, nodes, 3, parameters). SolverFailure if there is no equilibrium
    under one of the loads.
    """
    response = biaxial_response(patch.law, model.loads, model.thickness, request.parameters)
    if response.reached < len(model.loads):
        warp, fill = model.loads[response.reached]
        raise SolverFailure(
            f"no equilibrium at {warp:.4g} and {fill:.4g} N/mm along warp and fill (load "
            f"{response.reached + 1} of {len(model.loads)}): a modulus is not positive, or the law "
            "softens before it",
            "membrane",
        )
    patch.strain_old[0, 0, :2] = response.strain[-1]
    patch.stress_old[0, 0, :2] = response.stress[-1]
    patch.iterations = len(model.loads)
    stretch = 1.0 + response.elongation
    slope = stretch[:, :, None] * response.slope
    none = np.zeros(1)
    displacement = model.displacements(response.elongation)
    rates = np.zeros((*displacement.shape, len(request.parameters)))
    rates[:, :, :2] = model.mesh.points[None, :, :2, None] * slope[:, None]
    request.report(len(model.loads))
    history = History(
        model.loads.sum(axis=1),
        displacement,
        np.concatenate([response.strain.min(axis=0), none]),
        np.concatenate([response.strain.max(axis=0), none]),
        iterations=patch.iterations,
        unstable=tuple(
            f"{w:.4g} and {f:.4g} N/mm" for w, f in model.loads[~response.stable].tolist()
        ),
    )
    return history, rates
