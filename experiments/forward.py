"""Forward analyses of tests with material cards: runs, their results, quantities of studies.

A study repeats analyses, on finer meshes or with another Poisson's ratio nu12, and compares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError, SolverFailure
from ..light_dataclasses import dataclass
from ..materials.card import MaterialCard
from ..solvers.base import Array, History


@dataclass(frozen=True, eq=False)
class CardRun:
    """The run of one part of a test with one card: the model, and its history or its failure."""

    model: Any
    outcome: History | SolverFailure


#: Cards by name; runs by (name of the card, name of the part of the test).
Cards = Mapping[str, MaterialCard]
Runs = Mapping[tuple[str, str], CardRun]


@dataclass(frozen=True, eq=False)
class Simulation:
    """The results of a test's forward analyses.

    Attributes
    ----------
    numbers : mapping of str to object
        Entries of result.json.
    lines : sequence of str
        Lines for the terminal.
    parts : sequence of object
        Parts of the report page, such as charts and tables.
    errors : mapping of str to float
        Largest RMS error by card, relative to the largest measured value it is compared with.
    """

    numbers: dict[str, Any]
    lines: Sequence[str] = ()
    parts: Sequence[Any] = ()
    errors: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Studied:
    """Describe what a study compares between analyses of a kind of test with a card.

    The callables get a model, and (except `steps`) its history.

    Parameters
    ----------
    steps : callable
        Returns the load levels of a model.
    quantities : callable
        Returns the quantities that a study of the mesh compares, by name.
    responses : callable
        Returns the quantities that a study of Poisson's ratio nu12 compares, by name.
    response : str
        What the values of `responses` are, in words.
    curve : callable, optional
        Returns the x and y values of a curve that a study compares, too.
    """

    steps: Callable[[Any], Sequence[float]]
    quantities: Callable[[Any, History], Mapping[str, float]]
    responses: Callable[[Any, History], Mapping[str, float]]
    response: str
    curve: Callable[[Any, History], tuple[Array, Array]] | None = None


def divided(steps: Sequence[float], factor: float, owner: str) -> list[float]:
    """Return load levels with each step between them (the first from 0) divided into equal parts.

    Parameters
    ----------
    steps : sequence of float
        Load levels, without 0.
    factor : float
        Number of parts of each step.
    owner : str
        What has the steps, for the message.

    Raises
    ------
    InputError
        The factor is no whole number: steps cannot be joined.
    """
    if factor != int(factor):
        problem = f"the {owner}'s steps are divided, never joined: use --coarser 0"
        raise InputError(None, "increments", problem)
    parts = [np.linspace(a, b, int(factor) + 1)[1:] for a, b in pairwise((0.0, *steps))]
    return [float(value) for part in parts for value in part]
