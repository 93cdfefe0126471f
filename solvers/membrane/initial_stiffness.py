"""Stiffness of a law at zero strain, and refusal of laws that an analysis cannot apply."""

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw


def initial_moduli(law: HypoelasticLaw) -> tuple[float, float, float]:
    """Return the moduli E1, E2, G12 (MPa) at zero strain.

    SolverFailure if one of them is not positive, since then there is no equilibrium.
    """
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
    """Raise SolverFailure if a law has a memory, for an analysis that cannot take it into account.

    Parameters
    ----------
    description : str
        The analysis in words, for the message.
    """
    if law.memory is not None:
        losses = "unloading, permanent set and hysteresis are lost"
        raise SolverFailure(
            f"{description} takes no law with a memory ({losses}): use the card without it"
        )
