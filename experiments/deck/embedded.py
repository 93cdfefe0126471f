"""A model of ours in place of a user's deck: it leads the fit by its exact derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import SolverFailure
from ...materials.law import HypoelasticLaw
from ...meshes.strip_models import UniaxialModel
from ...solvers.base import Array, DifferentiatingSolver, History, SolverCheck
from .model import DeckModel
from .results import DeckReader, QuantityReading, Reading

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
