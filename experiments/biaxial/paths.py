"""Cycles of a biaxial test and their loadings.

A cycle begins where the larger load turns from falling to rising. Small turns are noise or a hold.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from ...errors import InputError
from ...materials.designers import RATIOS
from ...readers.biaxial import BiaxialTable
from ...readers.histories import turns
from ...solvers.base import Array
from .ratios import nearest_ratio


@dataclass(frozen=True)
class LoadCycle:
    """One cycle of a biaxial test.

    Attributes
    ----------
    ratio : str
    phase : int
        Of consecutive cycles of its ratio, from 1.
    number, count : int
        From 1, in its phase and of all.
    first, last : int
        Rows where the loading begins and is highest.
    """

    ratio: str
    phase: int
    number: int
    count: int
    first: int
    last: int


def find_cycles(load: Array, labels: Sequence[str] | None = None) -> list[LoadCycle]:
    """Find the cycles in the loads of a file.

    Parameters
    ----------
    load : (n, 2) array
        Along warp and fill.
    labels : (n,) sequence of str or None
        Ratio of each row; else it is that of the highest loads of a cycle.
    """
    load = np.asarray(load)
    larger = load.max(axis=1)
    changes = []
    if labels is not None:
        changes = [row for row in range(1, len(labels)) if labels[row] != labels[row - 1]]
    cycles: list[LoadCycle] = []
    for start, stop in pairwise([0, *changes, len(larger)]):
        label = labels[start] if labels is not None and stop > start else None
        for first, last in _loadings(larger[start:stop]):
            first_row = start + first
            last_row = start + last
            # A prestress has no ratio of its own: what is below it does not count.
            lowest = load[first_row]
            ratio = label or nearest_ratio(load[last_row] - np.minimum(lowest, lowest.min()))
            phase, number = _place_in_phases(ratio, cycles)
            cycles.append(LoadCycle(ratio, phase, number, len(cycles) + 1, first_row, last_row))
    return cycles


def _place_in_phases(ratio: str, cycles: Sequence[LoadCycle]) -> tuple[int, int]:
    """Return phase and number of the next cycle of a ratio."""
    if not cycles:
        return 1, 1
    previous = cycles[-1]
    if previous.ratio == ratio:
        return previous.phase, previous.number + 1
    return previous.phase + 1, 1


def _loadings(
    load: Array, *, smallest_turn: float = 0.2, hold: float = 0.01
) -> list[tuple[int, int]]:
    """Return first and last row of every loading in loads (n,).

    Parameters
    ----------
    load : (n,) array
    smallest_turn : float
        Of the range of loads of a phase: a smaller turn is none.
    hold : float
        Of a cycle's range: how far from its lowest and highest load the loading begins and ends, so
        that holds at the prestress and at the top, in which the fabric creeps, are no part of it.
    """
    rows = turns(load, 0.0, 0.0, smallest_turn)
    loadings = []
    for low, high in zip(rows[::2], rows[1::2], strict=False):
        margin = hold * (load[high] - load[low])
        rising = load[low : high + 1]
        first = low + int(np.flatnonzero(rising <= load[low] + margin)[-1])
        last = first + int(np.flatnonzero(load[first : high + 1] >= load[high] - margin)[0])
        loadings.append((first, last))
    return loadings


#: Which cycle of a ratio is evaluated: the last of its phase, or by number from 1.
CycleChoice = int | Literal["last"]


@dataclass(frozen=True, eq=False)
class BiaxialPath:
    """The loading of one cycle.

    Attributes
    ----------
    table : BiaxialTable
        The readings it is of.
    cycle : LoadCycle
    cycles : int
        Number of cycles of its phase.
    load : (n, 2) array, N/mm
        Along warp and fill.
    strain : (n, 2) array
        Since the file's beginning.
    """

    table: BiaxialTable
    cycle: LoadCycle
    cycles: int
    load: Array
    strain: Array

    @property
    def larger(self) -> Array:
        """Return the larger load of every row, (n,) N/mm."""
        return np.asarray(self.load.max(axis=1))

    @property
    def ratio(self) -> str:
        return self.cycle.ratio

    @property
    def residual(self) -> Array:
        """Return (2,) strain at the beginning of the loading."""
        return np.asarray(self.strain[0] - self.table.strain[0])

    @property
    def since(self) -> Array:
        """Return (n, 2) strain since the beginning of the loading."""
        return np.asarray(self.strain - self.strain[0])

    def between(self, lowest: float, highest: float) -> BiaxialPath:
        """Return the rows whose larger load (N/mm) lies between two."""
        larger = self.larger
        keep = (larger >= lowest * (1 - 1e-9)) & (larger <= highest * (1 + 1e-9))
        if keep.sum() < 2:
            problem = (
                f"fewer than two rows of ratio {self.ratio} lie between {lowest:g} and "
                f"{highest:g} kN/m; its loading goes from {larger.min():.4g} to {larger.max():.4g}"
            )
            raise InputError(self.table.path, self.table.argument, problem)
        return replace(self, load=self.load[keep], strain=self.strain[keep])

    def thinned(self, max_rows: int) -> BiaxialPath:
        """Return at most so many rows, evenly spread over the larger load, both ends among them."""
        if len(self.load) <= max_rows:
            return self
        larger = np.maximum.accumulate(self.larger)
        levels = np.linspace(larger[0], larger[-1], max_rows)
        rows = np.unique(np.clip(np.searchsorted(larger, levels), 0, len(larger) - 1))
        rows[-1] = len(larger) - 1
        return replace(self, load=self.load[rows], strain=self.strain[rows])


def evaluated_paths(
    tables: Sequence[BiaxialTable],
    cycles: Sequence[Sequence[LoadCycle]],
    choice: CycleChoice = "last",
    conditioning: int = 0,
    ratios: Collection[str] | None = None,
) -> list[BiaxialPath]:
    """Return the loading of one cycle of each ratio.

    Of a ratio that comes several times, the first phase after the conditioning counts.

    Parameters
    ----------
    tables : sequence of BiaxialTable
    cycles : sequence of sequences of LoadCycle
        Of each table.
    choice : int or "last"
        Which cycle of each ratio.
    conditioning : int
        Number of cycles at the beginning of each file.
    ratios : collection of str or None
        Those that are evaluated; all unless given.

    Returns
    -------
    list of BiaxialPath
        In the order of `RATIOS`, then by name.

    Raises
    ------
    InputError
        A ratio is not there, or has no such cycle.
    """
    paths: dict[str, BiaxialPath] = {}
    for table, cycles_of_table in zip(tables, cycles, strict=True):
        for phase in _phases(cycles_of_table[conditioning:]):
            ratio = phase[0].ratio
            is_evaluated = ratios is None or ratio in ratios
            if is_evaluated and ratio not in paths:
                paths[ratio] = _path_of_phase(table, phase, choice)
    missing = [ratio for ratio in ratios or () if ratio not in paths]
    if missing or not paths:
        problem = f"no cycle of ratio {', '.join(missing) or 'any'} after the conditioning"
        argument = tables[0].argument.partition("[")[0]
        measured = f"the ratios there: {_measured_ratios(cycles)}"
        raise InputError(tables[0].path, argument, f"{problem}; {measured}")
    order = {ratio: k for k, ratio in enumerate(RATIOS)}
    return sorted(paths.values(), key=lambda path: (order.get(path.ratio, len(order)), path.ratio))


def _measured_ratios(cycles: Sequence[Sequence[LoadCycle]]) -> str:
    """Return the ratios of all cycles, each once."""
    ratios = [cycle.ratio for cycles_of_table in cycles for cycle in cycles_of_table]
    return ", ".join(dict.fromkeys(ratios))


def _phases(cycles: Sequence[LoadCycle]) -> Collection[list[LoadCycle]]:
    """Return the cycles phase by phase."""
    phases: dict[int, list[LoadCycle]] = {}
    for cycle in cycles:
        phases.setdefault(cycle.phase, []).append(cycle)
    return phases.values()


def _path_of_phase(
    table: BiaxialTable, phase: Sequence[LoadCycle], choice: CycleChoice
) -> BiaxialPath:
    """Return the loading of one cycle of a phase; InputError if there are fewer cycles."""
    count = len(phase)
    if choice != "last" and choice > count:
        problem = f"ratio {phase[0].ratio} has {count} cycles, number {choice} is asked for"
        raise InputError(table.path, table.argument, problem)
    cycle = phase[-1] if choice == "last" else phase[choice - 1]
    rows = slice(cycle.first, cycle.last + 1)
    return BiaxialPath(table, cycle, count, table.load[rows], table.strain[rows])
