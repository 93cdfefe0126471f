"""Nuisance unknowns of a bubble: offsets, shape of the sheet, misalignment of the registration."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...inference.nuisance import Nuisance, prior_weight
from ...meshes.bubble_model import TURN, BubbleModel
from .objective import MISALIGNMENTS, OFFSETS, FieldObjective
from .reading_objective import HEIGHT_SCALE, ReadingObjective
from .sheet import MAX_SIGMAS, sheet_nuisance
from .test import BubbleTest


@dataclass(frozen=True)
class NuisanceBounds:
    """Bounds of the offsets and of the turn of the yarns that are fitted beside the law."""

    displacement: float = 20.0  # mm, largest offset of displacements in either sense
    pressure: float = 50.0  # kPa, largest offset of the pressure
    pressure_share: float = -0.9  # smallest offset over the lowest pressure, which stays positive
    turn: float = 30.0  # degrees, in either sense; further turns come near to swapped moduli


BOUNDS = NuisanceBounds()


def bubble_nuisance(
    test: BubbleTest,
    model: BubbleModel,
    objective: FieldObjective,
    estimates: Mapping[str, float],
) -> tuple[Nuisance, ...]:
    """Return all unknowns of a bubble test that a fit finds beside the law.

    Parameters
    ----------
    test : BubbleTest
    model : BubbleModel
        The model with the measured shape of the sheet and its unknown modes.
    objective : FieldObjective
    estimates : mapping of str to float
        Values at which the unknowns of the registration start, by name.

    Returns
    -------
    tuple of Nuisance
    """
    nuisance: list[Nuisance] = []
    if test.displacement_offset:
        largest = BOUNDS.displacement
        nuisance += [Nuisance(name, -largest, largest, "mm") for name in OFFSETS]
    nuisance += _pressure_nuisance(test)
    nuisance += sheet_nuisance(test.sheet, model, objective.scale)
    nuisance += registration_nuisance(test, objective, estimates)
    return tuple(nuisance)


def _pressure_nuisance(test: BubbleTest) -> list[Nuisance]:
    """Return the unknown offset of the pressure, where the test has one."""
    if not test.pressure_offset:
        return []
    name = "pressure_offset"
    lowest = BOUNDS.pressure_share * 1e3 * min(test.increments)
    return [
        Nuisance(
            name,
            lowest,
            BOUNDS.pressure,
            "kPa",
            model_parameter=name,
            scale=1e-3,
        )
    ]


def reading_nuisance(
    test: BubbleTest, model: BubbleModel, objective: ReadingObjective
) -> tuple[Nuisance, ...]:
    """Return the unknowns of a bubble without a camera beside the law.

    They are offsets of the pressure and of each gauge, a scale of all heights, and the shape of the
    sheet. Priors are weighed against the noise of the readings.

    Parameters
    ----------
    test : BubbleTest
    model : BubbleModel
        The model with the unknown modes of the sheet.
    objective : ReadingObjective
    """
    weight = prior_weight(objective.least_noise, objective.scale, correlated=1)
    nuisance = _pressure_nuisance(test)
    for unknown in sheet_nuisance(test.sheet, model, objective.scale):
        nuisance.append(replace(unknown, weight=weight))
    prior = test.height_offset
    if prior is not None:
        ends = -MAX_SIGMAS * prior, MAX_SIGMAS * prior
        nuisance += [
            Nuisance(name, *ends, "mm", prior=prior, weight=weight)
            for name in objective.height_offsets
        ]
    if test.height_scale is not None:
        prior = 100.0 * test.height_scale
        ends = -MAX_SIGMAS * prior, MAX_SIGMAS * prior
        nuisance.append(Nuisance(HEIGHT_SCALE, *ends, "%", prior=prior, weight=weight))
    return tuple(nuisance)


def registration_nuisance(
    test: BubbleTest, objective: FieldObjective, estimates: Mapping[str, float]
) -> list[Nuisance]:
    """Return the unknowns of the registration: the turn of the yarns, and `MISALIGNMENTS`.

    The turn is a parameter of the model, the others move the data.

    Parameters
    ----------
    test : BubbleTest
    objective : FieldObjective
    estimates : mapping of str to float
        Value at which each unknown starts, by name, if it lies within the bounds.

    Notes
    -----
    Priors are weighed against the noise: the field's symmetry determines the unknowns far better.
    """
    nuisance = list[Nuisance]()
    weight = prior_weight(objective.least_noise, objective.scale)
    for quantity, prior in test.registration.items():
        is_turn = quantity == TURN
        largest = min(MAX_SIGMAS * prior, BOUNDS.turn) if is_turn else MAX_SIGMAS * prior
        for name in (TURN, *MISALIGNMENTS):
            if not name.startswith(quantity):
                continue
            estimate = estimates.get(name, np.inf)
            unknown = Nuisance(
                name,
                -largest,
                largest,
                "mm" if quantity == "shift" else "deg",
                model_parameter=TURN if is_turn else None,
                scale=float(np.pi / 180) if is_turn else 1.0,
                prior=prior,
                weight=weight,
                begin=estimate if abs(estimate) < largest else None,
            )
            nuisance.append(unknown)
    return nuisance
