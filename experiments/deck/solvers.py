"""Solvers of decks that differentiate: by differences of a deck's results, or by a model of ours.

The step of a difference follows from the digits of the results: with values that are rounded by a
share r, the error of a difference is least for steps of about the root of r. A full Jacobian runs
the deck once for each parameter, side by side; between two of them Broyden's update corrects the
last one by what a run shows. A model of ours in place of the deck has exact derivatives and leads
the fit.

References
----------
C. G. Broyden, A class of methods for solving nonlinear simultaneous equations, Math. Comput. 19
(1965) 577.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...materials.law import HypoelasticLaw, law_beside, usual_step
from ...meshes.strip_models import UniaxialModel
from ...processes import share_of_cores
from ...solvers.base import Array, DifferentiatingSolver, History, Solver, SolverCheck
from ...solvers.calculix.library import MATERIAL
from ...solvers.decks import UserDeck
from ...solvers.process import unless
from ...solvers.run_cache import digest_of
from .model import DeckModel
from .results import DeckReader, QuantityReading, Reading

#: A law that decks are run with that do not use any: their runs do not depend on it.
ANY_LAW = HypoelasticLaw.linear(1.0, 1.0, 1.0)
#: Runs that are remembered, by the content of their files.
REMEMBERED = 64


#: Rounding of results whose digits are not known, as a share of the largest.
UNKNOWN_ROUNDING = 1e-15
#: Largest step of a difference, as a share of the range of a parameter.
LARGEST_STEP = 0.1
#: Updates by Broyden between full Jacobians, and share of a change that a Jacobian may be off.
MAX_UPDATES = 6
TRUSTED_ERROR = 0.3


@dataclass(frozen=True, eq=False)
class Slopes:
    """A Jacobian (values, parameters) of scaled parameters, and where it holds.

    Attributes
    ----------
    key : tuple of str
        Names of the parameters.
    parameters : (parameters,) array
        Values over their sizes.
    values : (values,) array
        Of the results.
    updates : int
        Number of Broyden's updates since it was differenced.
    """

    key: tuple[str, ...]
    parameters: Array
    values: Array
    matrix: Array
    updates: int = 0

    def updated(self, parameters: Array, values: Array) -> Slopes | None:
        """Return the Jacobian at a point after Broyden's update; None where it is not trusted.

        Parameters
        ----------
        parameters : (parameters,) array
            Scaled parameters of the point.
        values : (values,) array
            Results at the point.
        """
        step = parameters - self.parameters
        change = values - self.values
        error = change - self.matrix @ step
        is_far = np.linalg.norm(error) > TRUSTED_ERROR * np.linalg.norm(change)
        if not step.any() or is_far or self.updates >= MAX_UPDATES:
            return None
        matrix = self.matrix + np.outer(error, step) / (step @ step)
        return Slopes(self.key, parameters, values, matrix, self.updates + 1)


class DeckSolver:
    """A solver of decks that differentiates: it runs them by another solver.

    Parameters
    ----------
    solver : Solver
        Runs filled decks, from its cache of runs and with its licences.
    side_by_side : int or None
        Largest number of runs at a time; one for each core unless given.
    comparisons : int
        Number of comparisons that ask for derivatives at each point.

    Attributes
    ----------
    runs, cached : int
        Numbers of runs so far, and of those that were taken from the cache.
    """

    external = True

    def __init__(
        self, solver: Solver, side_by_side: int | None = None, comparisons: int = 1
    ) -> None:
        self.solver = solver
        self.side_by_side = side_by_side
        self.comparisons = comparisons
        self.name = solver.name
        self.progress: Any = None
        self.runs = 0
        self.cached = 0
        self._slopes: Slopes | None = None
        self._slopes_by_point: dict[bytes, Slopes] = {}
        self._requests: Counter[bytes] = Counter()
        self._remembered: dict[str, History] = {}

    @property
    def identity(self) -> str:
        return self.solver.identity

    def check(self) -> SolverCheck:
        return self.solver.check()

    def forget(self) -> None:
        """Drop derivatives, so that every start begins alike."""
        self._slopes = None
        self._slopes_by_point.clear()
        self._requests.clear()

    def run(
        self,
        model: DeckModel,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        guess: Array | None = None,
    ) -> History:
        """Run a deck; runs of the same files are made once.

        `scratch`, `timeout` and `guess` are arguments of every solver, which a deck does not use.
        """
        return self._run_files(model.deck(law), law)

    def _run_files(self, deck: UserDeck, law: HypoelasticLaw) -> History:
        """Return the history of a deck's files, remembered from an earlier run of the same files.

        The law is left out of the comparison where the files do not contain the material.
        """
        has_law = any(isinstance(text, str) and MATERIAL in text for text in deck.files.values())
        used_law = law if has_law else ANY_LAW
        key = digest_of(deck, used_law)
        history = self._remembered.get(key)
        if history is None:
            history = self.solver.run(deck, used_law)
            self.runs += 1
            self.cached += history.from_cache
            while len(self._remembered) >= REMEMBERED:
                self._remembered.pop(next(iter(self._remembered)))
            self._remembered[key] = history
        return history

    def run_with_sensitivity(
        self,
        model: DeckModel,
        law: HypoelasticLaw,
        parameters: Sequence[str] | None = None,
        guess: Array | None = None,
    ) -> tuple[History, Array]:
        """Run a deck; return its history with `load_slope` (values, parameters).

        `guess` is an argument of every solver, which a deck does not use.
        """
        names = tuple(parameters or ())
        history = self.run(model, law)
        sizes = np.array([self._size(model, law, name) for name in names])
        values = np.array([_parameter(model, law, name) for name in names]) / sizes
        if self._slopes is None or self._slopes.key != names:
            self.forget()
        point = values.tobytes()
        slopes = self._slopes_by_point.get(point)
        self._requests[point] += 1
        if slopes is None and self._slopes is not None:
            slopes = self._slopes.updated(values, history.load)
        elif slopes is not None and slopes.updates and self._requests[point] > self.comparisons:
            slopes = None  # evaluated twice: the point decides, and bands follow from its slopes
        if slopes is None:
            matrix = self._differences(model, law, names, sizes, history)
            slopes = Slopes(names, values, history.load, matrix)
        self._slopes = self._slopes_by_point[point] = slopes
        slope = slopes.matrix / sizes
        return replace(history, load_slope=slope), np.zeros((1, 1, 3, len(names)))

    def _size(self, model: DeckModel, law: HypoelasticLaw, name: str) -> float:
        """Return the size of a parameter: the width of its bounds, or its usual change."""
        if name in model.bounds:
            lower, upper = model.bounds[name]
            return upper - lower
        return usual_step(law, name, model.thickness, 1.0)

    def _differences(
        self,
        model: DeckModel,
        law: HypoelasticLaw,
        names: Sequence[str],
        sizes: Array,
        history: History,
    ) -> Array:
        """Return the Jacobian (values, parameters) of scaled parameters, by forward differences.

        Parameters
        ----------
        sizes : (parameters,) array
            By which the parameters are scaled.
        history : History
            The run without changes, from which differences are taken.
        """
        load = history.load
        rounding = np.zeros(len(load)) if history.load_rounding is None else history.load_rounding
        share = np.max(rounding) / max(float(np.abs(load).max()), 1e-300)
        step = min(float(np.sqrt(max(share, UNKNOWN_ROUNDING))), LARGEST_STEP)
        deck = model.deck(law)

        def column(name: str, size: float) -> Array:
            shifted, shifted_law, sign = _shifted(model, law, name, step * size)
            shifted_deck = shifted.deck(shifted_law)
            if shifted_deck.files == deck.files:
                return np.zeros(len(load))  # the deck does not have this parameter
            change = self._run_files(shifted_deck, shifted_law).load - load
            return change / (sign * step)

        workers = max(1, min(self.side_by_side or share_of_cores(), len(names)))
        stop = Event()
        with ThreadPoolExecutor(workers) as pool, unless(stop.is_set):
            waiting = [
                pool.submit(copy_context().run, column, name, size)
                for name, size in zip(names, sizes.tolist(), strict=True)
            ]
            try:
                columns = [future.result() for future in waiting]
            finally:
                stop.set()  # after a failure, or an interruption, the others end as well
        return np.column_stack([np.empty((len(load), 0)), *columns])


def _parameter(model: DeckModel, law: HypoelasticLaw, name: str) -> float:
    """Return the value of a parameter of the deck, the thickness, or one of the law."""
    if name in model.values:
        return model.values[name]
    if name == "thickness":
        return model.thickness
    if name.startswith("beta_"):
        return float(law.beta[int(name.removeprefix("beta_"))])
    return law.number(name)


def _shifted(
    model: DeckModel, law: HypoelasticLaw, name: str, step: float
) -> tuple[DeckModel, HypoelasticLaw, float]:
    """Return deck and law with a parameter changed by a step, and the sign of that.

    The step goes down where the upper bound, or the condition on parameters, is in the way.
    """
    if name not in model.values and name != "thickness":
        return model, law_beside(law, name, step), 1.0
    upper = model.bounds.get(name, (-np.inf, np.inf))[1]
    signs = (1.0, -1.0) if model.values.get(name, 0.0) + step <= upper else (-1.0,)
    for sign in signs:
        try:
            return model.with_parameters({name: sign * step}), law, sign
        except InputError as error:
            problem = error.problem
    raise SolverFailure(f"{name} cannot be changed: {problem}")


#: Step of the differences of what is read of results, as a share of the largest displacement.
READING_STEP = 1e-6


@dataclass(frozen=True, eq=False)
class EmbeddedResults:
    """Results of a model of ours, as readings see those of a program.

    Attributes
    ----------
    model : BubbleModel or UniaxialModel
    displacement : (frames, nodes, 3) array, mm
    load : (frames,) array
    frame_times : sequence of float
        Time of the deck's analysis of each frame; in proportion to the load, up to 1, if empty.
    """

    model: Any
    displacement: Array
    load: Array
    frame_times: Sequence[float] = ()

    @property
    def times(self) -> Array:
        """Return the times (1 + frames,) of the results, 0 first."""
        levels = self.model.elongations if self.is_strip else self.load
        times = np.asarray(self.frame_times or np.asarray(levels) / levels[-1], dtype=float)
        if len(times) != len(self.load):
            problem = f"expected surrogate_times for {len(self.load)} loads of the surrogate"
            raise SolverFailure(f"{problem}, got {len(times)}")
        return np.concatenate([[0.0], times])

    @property
    def is_strip(self) -> bool:
        """Return whether it is a strip, of which readings see elongation and load alone."""
        return isinstance(self.model, UniaxialModel)

    @property
    def points(self) -> Array:
        """Return the places (nodes, 3) of the nodes at rest, mm."""
        return np.asarray(self.model.mesh.points)

    def nodes(self, place: str | tuple[float, ...]) -> NDArray[np.intp]:
        """Return the number (1,) of the node nearest to a place, or of all nodes for a set.

        A deck's set is of the whole sheet; a strip counts as one node.
        """
        if self.is_strip:
            return np.zeros(1, dtype=np.intp)
        if isinstance(place, str):
            return np.arange(len(self.points))
        return np.array([np.linalg.norm(self.points - np.array(place), axis=1).argmin()])

    def field(self, quantity: str, nodes: NDArray[np.intp]) -> tuple[Array, float]:
        """Return values (1 + frames, nodes, 3), zero at first, and no rounding."""
        values = self.displacement[:, nodes]
        if self.is_strip:
            curve = self.load if quantity == "reaction" else np.asarray(self.model.elongations)
            values = np.broadcast_to(curve[:, None, None], (len(curve), 1, 3))
        return np.concatenate([np.zeros_like(values[:1]), values]), 0.0


class EmbeddedSolver:
    """Run a model of ours for a deck, and read of it what is read of the deck's results.

    Parameters
    ----------
    solver : DifferentiatingSolver
    model : BubbleModel or UniaxialModel
        With the thickness of the fabric.
    reader : DeckReader
        What is read of the deck.
    frame_times : sequence of float
        See `EmbeddedResults`.
    """

    external = False

    def __init__(
        self,
        solver: DifferentiatingSolver,
        model: Any,
        reader: DeckReader,
        frame_times: Sequence[float],
    ) -> None:
        self.solver = solver
        self.model = model
        self.frame_times = frame_times
        self.name = solver.name
        self.progress: Any = None
        self._readings = [_of_model(reading, model) for reading in reader.readings]

    @property
    def identity(self) -> str:
        return self.solver.identity

    def check(self) -> SolverCheck:
        return self.solver.check()

    def run(
        self,
        model: DeckModel,
        law: HypoelasticLaw,
        scratch: Path | None = None,
        timeout: float | None = None,
        guess: Array | None = None,
    ) -> History:
        """Run the model with the thickness of the deck; its loads are what is read of it."""
        history = self.solver.run(self._thick(model), law, guess=guess)
        return replace(history, load=self._values(history.displacement, history.load))

    def run_with_sensitivity(
        self,
        model: DeckModel,
        law: HypoelasticLaw,
        parameters: Sequence[str] | None = None,
        guess: Array | None = None,
    ) -> tuple[History, Array]:
        """Run the model; return its history with `load_slope` (values, parameters)."""
        history, slope = self.solver.run_with_sensitivity(
            self._thick(model), law, parameters, guess=guess
        )
        load_slope = history.load_slope
        if load_slope is None:  # the loads are prescribed
            load_slope = np.zeros((len(history.load), slope.shape[-1]))
        columns = []
        for by_nodes, by_load in zip(np.moveaxis(slope, -1, 0), load_slope.T, strict=True):
            sizes = [
                np.abs(change).max() / np.abs(values).max()
                for change, values in ((by_nodes, history.displacement), (by_load, history.load))
            ]
            step = READING_STEP / max(*sizes, 1e-300)
            ends = [
                self._values(history.displacement + h * by_nodes, history.load + h * by_load)
                for h in (step, -step)
            ]
            columns.append((ends[0] - ends[1]) / (2 * step))
        values = self._values(history.displacement, history.load)
        return replace(history, load=values, load_slope=np.column_stack(columns)), slope

    def _thick(self, deck: DeckModel) -> Any:
        change = deck.thickness - self.model.thickness
        return self.model.with_parameters({"thickness": change})

    def _values(self, displacement: Array, load: Array) -> Array:
        """Return all that is read of results (values,), reading after reading.

        Parameters
        ----------
        displacement : (frames, nodes, 3) array, mm
        load : (frames,) array
        """
        results = EmbeddedResults(self.model, displacement, load, self.frame_times)
        return np.concatenate([reading.values(results)[0] for reading in self._readings])


def _of_model(reading: Reading, model: Any) -> Reading:
    """Return a reading of a strip of ours without factors: its elongation and load are whole."""
    if not (isinstance(model, UniaxialModel) and isinstance(reading, QuantityReading)):
        return reading
    x, y = (p if p.quantity == "time" else replace(p, scale=1.0) for p in (reading.x, reading.y))
    return replace(reading, x=x, y=y)
