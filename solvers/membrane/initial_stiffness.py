"""Moduli at zero strain, and laws that the membrane does not take."""

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw


def initial_moduli(law: HypoelasticLaw) -> tuple[float, float, float]:
    """Return E1, E2, G12 at zero strain, MPa; SolverFailure unless all are positive."""
    e1, e2, g12 = (float(modulus(0.0)) for modulus in (law.E1, law.E2, law.G12))
    if not min(e1, e2, g12) > 0:
        raise SolverFailure(
            "no equilibrium at all: E1, E2, G12 at zero strain are "
            f"{e1:.3g}, {e2:.3g}, {g12:.3g} MPa and must be positive"
        )
    return e1, e2, g12


def initial_stiffness(law: HypoelasticLaw) -> NDArray[np.float64]:
    """Return the plane stress stiffness (3, 3) at zero strain, MPa; fails as `initial_moduli`."""
    initial_moduli(law)
    none = np.zeros(3)
    _, tangent = law.increment(none, none, none)
    return tangent[0]


def refuse_memory(law: HypoelasticLaw, description: str) -> None:
    """Raise SolverFailure for a law with a memory, which `description` does not take."""
    if law.memory is not None:
        losses = "unloading, permanent set and hysteresis are lost"
        raise SolverFailure(
            f"{description} takes no law with a memory ({losses}): use the card without it"
        )
