"""Forward analyses with cards: runs, their results, and what a study looks at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError, SolverFailure
from ..materials.card import MaterialCard
from ..solvers.base import Array, History
from .output import Shown


@dataclass(frozen=True, eq=False)
class CardRun:
    """One card on one part of a test: the model that was run, and how it ended."""

    model: Any
    outcome: History | SolverFailure


#: Cards by name, and their runs by card and part of a test.
Cards = Mapping[str, MaterialCard]
Runs = Mapping[tuple[str, str], CardRun]


@dataclass(frozen=True, eq=False)
class Simulation:
    """The results of forward analyses: numbers for result.json, lines for the terminal, figures."""

    numbers: dict[str, Any]
    lines: Sequence[str] = ()
    figures: Sequence[Shown] = ()


@dataclass(frozen=True, eq=False)
class Studied:
    """The quantities of a study with a card: under refinement, or with another nu12.

    Parameters
    ----------
    steps : callable
        Returns the load levels of a model.
    quantities : callable
        Returns those of interest in a study of the mesh, by name.
    responses : callable
        Returns those of a study of nu12, by name.
    response : str
        What these are, in words.
    curve : callable, optional
        Returns (x, y) along which levels are compared.
    """

    steps: Callable[[Any], Sequence[float]]
    quantities: Callable[[Any, History], Mapping[str, float]]
    responses: Callable[[Any, History], Mapping[str, float]]
    response: str
    curve: Callable[[Any, History], tuple[Array, Array]] | None = None


def divided(steps: Sequence[float], factor: float, owner: str) -> list[float]:
    """Return load steps above 0, each divided by a factor; InputError if it is no whole number."""
    if factor != int(factor):
        problem = f"the {owner}'s steps are divided, never joined: use --coarser 0"
        raise InputError(None, "increments", problem)
    parts = [np.linspace(a, b, int(factor) + 1)[1:] for a, b in pairwise((0.0, *steps))]
    return [float(value) for part in parts for value in part]
