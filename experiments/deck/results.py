"""Results of a deck: a table that the program writes, or CalculiX' values at nodes (.frd).

A reading is a quantity over another one at measured values of that. It knows where something was
measured, not what: runs are cached by readings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, SolverFailure
from ...readers.tables import read_table
from ...solvers.base import Array, History
from ...solvers.calculix.frd import FrdFile
from ...solvers.decks import JOB

#: Names of the quantities of nodes in .frd, and the digits of its numbers.
FIELDS = {"displacement": "DISP", "reaction": "FORC"}
FRD_DIGITS = 6
DOUBLE_DIGITS = 15
#: How far a measured value may lie beyond the last result, as a share of the results' range.
BEYOND_END = 1e-6
_SET = re.compile(r"\*(?:NSET|NODE)\b.*NSET *= *\"?([^,\s\"]+)", re.IGNORECASE)


@dataclass(eq=False)
class Results:
    """The results in the folder of a run; `table` is the name of their table, if they have one."""

    folder: Path
    table: str

    @cached_property
    def frd(self) -> FrdFile:
        """Return the result file of CalculiX."""
        return FrdFile(self.folder / f"{JOB}.frd")

    @cached_property
    def sets(self) -> dict[str, list[int]]:
        """Return the numbers of the nodes of every set, by its name in capitals."""
        sets: dict[str, list[int]] = {}
        for path in sorted(self.folder.glob("*.in[cp]")):
            text = re.sub(r"^\*\*.*\n", "", path.read_text(encoding="latin-1"), flags=re.MULTILINE)
            for block in text.split("\n*"):
                head, *lines = f"*{block.lstrip('*')}".splitlines()
                name = _SET.match(head)
                if name:
                    sets[name[1].upper()] = _members(head.upper(), lines, sets)
        return sets


def _members(head: str, lines: Sequence[str], sets: Mapping[str, list[int]]) -> list[int]:
    """Return the nodes of a set: a list with sets in it, ranges, or the first numbers of nodes."""
    members: list[int] = []
    for line in lines:
        words = line.replace(",", " ").upper().split()
        numbers = [int(word) for word in words if word.isdigit()]
        if head.startswith("*NODE"):
            numbers = numbers[:1]
        elif "GENERATE" in head:
            numbers = [*range(numbers[0], numbers[1] + 1, *numbers[2:3])]
        members += numbers
        members += [node for word in words for node in sets.get(word, [])]
    return members


@dataclass(frozen=True)
class Probe:
    """A number of a deck's results over time.

    Attributes
    ----------
    quantity : str
        "displacement" (the mean of a set), "reaction" (its sum), "time", or "result" (a column).
    place : str or tuple of 3 floats
        Node set, place (mm) whose nearest node is taken, or name of the column.
    component : int
        Axis of a displacement or a reaction, from 0.
    scale : float
        Factor of the number, as 4 of the force on a quarter model.
    """

    quantity: str
    place: str | tuple[float, ...] = ""
    component: int = 0
    scale: float = 1.0

    def series(self, results: Results) -> tuple[Array, Array, float]:
        """Return times and numbers (frames,), and the size of the last digit."""
        if self.quantity == "time":
            times = np.array([0.0, *(frame.time for frame in results.frd.frames())])
            return times, self.scale * times, 0.0
        if self.quantity == "result":
            return self._column(results)
        nodes = self._nodes(results)
        frame_times = [0.0]  # at rest
        numbers = [0.0]
        largest = 0.0
        for frame in results.frd.frames():
            rows = frame.fields.get(FIELDS[self.quantity])
            if rows is None or not np.isfinite(rows[nodes]).all():
                problem = f"the results hold no {self.quantity} at {self.place}"
                raise SolverFailure(f"{problem}: {FIELDS[self.quantity]} in *NODE FILE asks for it")
            values = rows[nodes, self.component]
            largest = max(largest, float(np.abs(rows[nodes]).max()))
            frame_times.append(frame.time)
            numbers.append(values.sum() if self.quantity == "reaction" else values.mean())
        # Equal forces of a set err alike.
        count = len(nodes) if self.quantity == "reaction" else 1
        digit = abs(self.scale) * count * last_digit(largest, FRD_DIGITS)
        return np.array(frame_times), self.scale * np.array(numbers), digit

    def _column(self, results: Results) -> tuple[Array, Array, float]:
        """Return the rows of a column of the table as `series` does."""
        path = results.folder / results.table
        if not path.is_file():
            raise SolverFailure(f"the run wrote no {results.table}")
        table = read_table(path)
        values = self.scale * table.numbers(str(self.place))
        text = table.text(str(self.place)).str.replace(r"[eE].*|\D|^[-0.]+", "", regex=True)
        digits = min(int(text.str.len().max()), DOUBLE_DIGITS)
        rounding = last_digit(float(np.abs(values).max()), digits)
        return np.arange(len(values), dtype=float), values, rounding

    def _nodes(self, results: Results) -> NDArray[np.intp]:
        """Return the rows of the nodes in the results; SolverFailure where there are none."""
        mesh = results.frd.mesh
        if not isinstance(self.place, str):
            distance = np.linalg.norm(mesh.points - np.array(self.place), axis=1)
            return np.array([distance.argmin()])
        nodes = np.flatnonzero(np.isin(mesh.numbers, results.sets.get(self.place.upper(), [])))
        if not len(nodes):
            names = ", ".join(results.sets) or "none"
            raise SolverFailure(f"there is no node set {self.place!r}; there are: {names}")
        return nodes


@dataclass(frozen=True, eq=False)
class Reading:
    """A quantity over another one, at measured values (n,) of that."""

    x: Probe
    y: Probe
    at: Array

    def values(self, results: Results) -> tuple[Array, float]:
        """Return the values of y where x is as measured; SolverFailure where x does not get."""
        times, y, rounding = self.y.series(results)
        x_times, x, _ = self.x.series(results)
        x = np.interp(times, x_times, x)
        rise = np.sign(x[-1] - x[0])
        if not rise or (np.diff(rise * x) < 0).any():
            raise SolverFailure(f"{self.x.quantity} {self.x.place} does not grow steadily")
        room = BEYOND_END * abs(x[-1] - x[0])
        low, high = self.at.min(), self.at.max()
        if high > x.max() + room or low < x.min() - room:
            span = f"{x[0]:.6g} to {x[-1]:.6g}"
            raise SolverFailure(f"the results go from {span}, measured: {low:.6g} to {high:.6g}")
        return np.interp(rise * self.at, rise * x, y), rounding


@dataclass(frozen=True, eq=False)
class DeckReader:
    """Reads all that is compared of a deck's results, one reading after the other."""

    readings: tuple[Reading, ...]
    table: str = ""

    @property
    def rows(self) -> list[slice]:
        """Return the place of the values of each reading among all."""
        ends = np.cumsum([0, *(len(reading.at) for reading in self.readings)]).tolist()
        return [slice(*ends[k : k + 2]) for k in range(len(self.readings))]

    def read(self, folder: Path) -> History:
        """Return the values as loads, with the size of their last digits; SolverFailure."""
        results = Results(folder, self.table)
        try:
            parts = [reading.values(results) for reading in self.readings]
        except (InputError, ValueError, IndexError, OSError) as error:
            raise SolverFailure(f"no usable results: {error}") from None
        none = np.zeros(3)
        load = np.concatenate([values for values, _ in parts])
        rounding = np.concatenate([np.full(len(values), digit) for values, digit in parts])
        return History(load, np.zeros((1, 1, 3)), none, none, load_rounding=rounding)


def last_digit(largest: float, digits: int) -> float:
    """Return the size of the last of so many digits of the largest value."""
    return float(10.0 ** (np.floor(np.log10(largest)) + 1 - digits)) if largest > 0 else 0.0
