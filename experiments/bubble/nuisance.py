"""What a fit of a bubble finds beside the law: offsets, the sheet, the registration."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...inference.comparison import Nuisance
from ...meshes.bubble_model import TURN, BubbleModel
from .objective import MISALIGNMENTS, OFFSETS, FieldObjective
from .sheet import MAX_SIGMAS, prior_weight, sheet_nuisance
from .test import BubbleTest


@dataclass(frozen=True)
class NuisanceBounds:
    """Bounds of what is fitted beside the law: offsets, and what a registration leaves open."""

    displacement: float = 20.0  # mm, either way
    pressure: float = 50.0  # kPa, upwards
    pressure_share: float = -0.9  # of the lowest pressure, downwards: it stays positive
    turn: float = 30.0  # degrees: beyond, a sheet of swapped moduli comes near


BOUNDS = NuisanceBounds()


def bubble_nuisance(
    test: BubbleTest,
    model: BubbleModel,
    objective: FieldObjective,
    estimates: Mapping[str, float],
) -> tuple[Nuisance, ...]:
    """Return all that a fit of a test finds beside the law.

    Parameters
    ----------
    test : BubbleTest
    model : BubbleModel
        Of the sheet as it was.
    objective : FieldObjective
    estimates : mapping
        Where a fit of the registration begins, by name.
    """
    nuisance: list[Nuisance] = []
    if test.displacement_offset:
        ends = -BOUNDS.displacement, BOUNDS.displacement
        nuisance += [Nuisance(name, *ends, "mm", None, 1.0) for name in OFFSETS]
    if test.pressure_offset:
        lowest = BOUNDS.pressure_share * 1e3 * min(test.increments)
        ends = lowest, BOUNDS.pressure
        nuisance.append(Nuisance("pressure_offset", *ends, "kPa", "pressure_offset", 1e-3))
    nuisance += sheet_nuisance(test.sheet, model, objective.scale)
    nuisance += registration_nuisance(test, objective, estimates)
    return tuple(nuisance)


def registration_nuisance(
    test: BubbleTest, objective: FieldObjective, estimates: Mapping[str, float]
) -> list[Nuisance]:
    """Return the unknowns of the registration: the yarns' angle, which is the model's, and places.

    Parameters
    ----------
    test : BubbleTest
    objective : FieldObjective
    estimates : mapping
        Where a fit of each begins, by name, if within its bounds.

    Notes
    -----
    Their priors weigh as the noise does: the field's symmetry tells far more.
    """
    nuisance = list[Nuisance]()
    weight = prior_weight(objective.least_noise, objective.scale)
    for quantity, prior in test.registration.items():
        largest = MAX_SIGMAS * prior
        unit = "mm" if quantity == "shift" else "deg"
        of_model: tuple[str | None, float] = (None, 1.0)
        if quantity == TURN:
            largest = min(largest, BOUNDS.turn)
            of_model = (TURN, float(np.pi / 180))
        for name in (TURN, *MISALIGNMENTS):
            if name.startswith(quantity):
                unknown = Nuisance(name, -largest, largest, unit, *of_model, prior, weight)
                estimate = estimates.get(name, np.inf)
                is_within = abs(estimate) < largest
                nuisance.append(replace(unknown, begin=estimate) if is_within else unknown)
    return nuisance
