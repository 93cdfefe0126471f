"""Forward analyses of tests with material cards: runs, how they ended, and what studies compare.

A study repeats analyses, on finer meshes or with another Poisson's ratio nu12, and compares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, SolverFailure
from ..light_dataclasses import dataclass
from ..materials.card import MaterialCard, thickness_difference
from ..notes import Note, NoteKind, Objection, as_note
from ..solvers.base import Array, History, instability
from ..wording import distinct_numbers

if TYPE_CHECKING:
    pass


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
    count = int(factor) + 1
    parts = [np.linspace(a, b, count)[1:] for a, b in pairwise((0.0, *steps))]
    return [float(value) for part in parts for value in part]


BEYOND_CARD = NoteKind("beyond card range", mark=1)
# Below GRAVE: the fit stands, with the modulus held at the end of its range.
BEYOND_LAW = NoteKind("beyond law.strain_range", weight=8)
#: Strain components by name, in the order (eps1, eps2, gamma12).
STRAINS = ("warp", "fill", "shear")


def strains_of(history: History) -> Array:
    """Return the largest strains (3,) of an analysis: in warp, in fill, and in shear (absolute)."""
    shear = max(abs(history.strain_min[2]), abs(history.strain_max[2]))
    return np.array([history.strain_max[0], history.strain_max[1], shear])


def by_strain(values: Sequence[float] | Array) -> dict[str, float]:
    """Return three values (warp, fill, shear) by the names of their strain components."""
    return dict(zip(STRAINS, np.asarray(values, dtype=float).tolist(), strict=True))


#: Texts of notes on a strain beyond the range: of a card that was run, of a law that was fitted.
BEYOND_CARD_WORDS = "{} strain {} % is beyond the card's valid range of {} %: modulus held there"
BEYOND_LAW_WORDS = (
    "{} strain reached {} %, beyond law.strain_range of {} %: the modulus was held at its end "
    "value there; a wider range would let it vary"
)


def notes_beyond(
    reached: Array,
    ends: Array,
    kind: NoteKind = BEYOND_CARD,
    words: str = BEYOND_CARD_WORDS,
) -> list[Note]:
    """Note each strain that lies beyond the end of its range.

    Parameters
    ----------
    reached : (3,) array
        Largest strains in warp, fill and shear.
    ends : (3,) array
        Ends of their ranges.
    kind : NoteKind
        Kind of the notes.
    words : str
        Text of a note, with fields {} for the name of the strain, the strain and the end in %.
    """
    rounding = 1 + 1e-6
    return [
        Note(kind, words.format(name, *distinct_numbers(100 * strain, 100 * end)))
        for name, strain, end in zip(STRAINS, reached, ends, strict=True)
        if strain > end * rounding
    ]


UNSTABLE = NoteKind(
    "unstable",
    weight=12.5,
    mark=3,
    objection=Objection(
        "equilibria of the model are unstable",
        "fit again without the loads that the warnings call unstable",
    ),
)
THICKNESS = NoteKind("other thickness")


@dataclass(frozen=True, eq=False)
class RunRecord:
    """The outcome of an analysis of one test with one card, as it is stored.

    Parameters
    ----------
    seconds : float
        Wall-clock time that the analysis took when it was made.
    failure : str
        Why there is no result, "" where there is one.
    early : str
        The solver's reason for an end before the last frame, "" otherwise.
    strain : (3,) array, optional
        Largest strains (eps1, eps2, gamma12).
    arrays : mapping of str to array
        The arrays of the history that the kind of test keeps.
    iterations : int
        Number of iterations of the solver.
    unstable : tuple of str, optional
        Loads (in words) at which the equilibrium is unstable; None where that is not known.
    remarks : tuple of Note
        Notes of the solver.
    from_cache : bool
        Whether the result of an earlier, cached analysis was taken.
    """

    seconds: float
    failure: str = ""
    early: str = ""
    strain: Array | None = None
    arrays: Mapping[str, Array] = field(default_factory=dict)
    iterations: int = 0
    unstable: tuple[str, ...] | None = None
    remarks: tuple[Note, ...] = ()
    from_cache: bool = False


def unstable_words(unstable: Sequence[str] | None) -> list[Note]:
    """Note that equilibria at these loads (in words) are unstable; without loads, nothing."""
    words = instability(unstable)
    return [Note(UNSTABLE, f"{words}: the model would not stay there")] if words else []


def other_thickness(card: MaterialCard, thickness: float) -> list[Note]:
    """Note that the thickness of a card that was run differs from the fabric's, if it does.

    Parameters
    ----------
    thickness : float, mm
        Of the fabric.
    """
    words = thickness_difference(card, thickness)
    run = f"{words}; it was run with the card's thickness"
    return [] if words is None else [Note(THICKNESS, run)]


def notes_of(run: History | RunRecord, card: MaterialCard) -> list[Note]:
    """Return all notes on an analysis with a card: remarks, strains beyond its range, instability.

    Parameters
    ----------
    run
        Its history or its record.
    """
    strain = strains_of(run) if isinstance(run, History) else run.strain
    reached = [] if strain is None else notes_beyond(strain, card.law.strain_range)
    return [*map(as_note, run.remarks), *reached, *unstable_words(run.unstable)]
