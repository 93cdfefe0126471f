"""The paths of a biaxial test that are evaluated: of each ratio, the loading of one cycle."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...materials.designers.ratios import RATIOS
from .cycles import Cycle, find_cycles
from .table import BiaxialTable

Array = NDArray[np.float64]
#: Which cycle of a ratio is evaluated: the last of its phase, or by number from 1.
Which = int | Literal["last"]


@dataclass(frozen=True, eq=False)
class BiaxialPath:
    """The loading of one cycle.

    load : (n, 2) N/mm along warp and fill. strain : (n, 2) since the beginning of the file, change
    of length over the length there. residual : (2,) strain at the beginning of the loading, of the
    same beginning. cycles : how many the phase has.
    """

    table: BiaxialTable
    cycle: Cycle
    cycles: int
    load: Array
    strain: Array

    @property
    def ratio(self) -> str:
        """Of the loads."""
        return self.cycle.ratio

    @property
    def residual(self) -> Array:
        """(2,) strain at the beginning of the loading."""
        return np.asarray(self.strain[0] - self.table.strain[0])

    @property
    def since(self) -> Array:
        """(n, 2) strain since the beginning of the loading."""
        return np.asarray(self.strain - self.strain[0])

    def between(self, lowest: float, highest: float) -> BiaxialPath:
        """The rows whose larger load (N/mm) lies between two.

        Raises
        ------
        InputError : fewer than two of them.
        """
        larger = self.load.max(axis=1)
        keep = (larger >= lowest * (1 - 1e-9)) & (larger <= highest * (1 + 1e-9))
        if keep.sum() < 2:
            problem = (
                f"fewer than two rows of ratio {self.ratio} lie between {lowest:g} and "
                f"{highest:g} kN/m; its loading goes from {larger.min():.4g} to {larger.max():.4g}"
            )
            raise InputError(self.table.path, "", problem)
        return replace(self, load=self.load[keep], strain=self.strain[keep])

    def thinned(self, most: int) -> BiaxialPath:
        """At most so many rows, evenly spread over the larger load, both ends among them."""
        if len(self.load) <= most:
            return self
        larger = np.maximum.accumulate(self.load.max(axis=1))
        wanted = np.linspace(larger[0], larger[-1], most)
        rows = np.unique(np.clip(np.searchsorted(larger, wanted), 0, len(larger) - 1))
        rows[-1] = len(larger) - 1
        return replace(self, load=self.load[rows], strain=self.strain[rows])


def cycles_of(tables: Sequence[BiaxialTable], named: Sequence[str | None]) -> list[list[Cycle]]:
    """The cycles of each file; named : the ratio that a file is listed for, None for none.

    Raises
    ------
    InputError : a file without a cycle.
    """
    found = []
    for table, name in zip(tables, named, strict=True):
        labels = [name] * len(table.load) if name is not None else table.ratio
        cycles = find_cycles(table.load, labels)
        if not cycles:
            raise InputError(table.path, "", "no loading: the loads do not rise anywhere")
        found.append(cycles)
    return found


def evaluated_paths(
    tables: Sequence[BiaxialTable],
    cycles: Sequence[Sequence[Cycle]],
    which: Which = "last",
    conditioning: int = 0,
    ratios: Collection[str] | None = None,
) -> list[BiaxialPath]:
    """Of each ratio the loading of one cycle, in the order of `RATIOS`, then by name.

    Of a ratio that comes several times, the first time after the conditioning counts.

    Parameters
    ----------
    which : of the cycles of a ratio. conditioning : cycles at the beginning of each file that
        count for nothing. ratios : those that are wanted; all unless given.

    Raises
    ------
    InputError : a ratio that is wanted and is not there, or has not so many cycles.
    """
    found: dict[str, BiaxialPath] = {}
    for table, own in zip(tables, cycles, strict=True):
        phases: dict[int, list[Cycle]] = {}
        for cycle in own[conditioning:]:
            phases.setdefault(cycle.phase, []).append(cycle)
        for same in phases.values():
            ratio = same[0].ratio
            if ratio in found or (ratios is not None and ratio not in ratios):
                continue
            if which != "last" and which > len(same):
                problem = f"ratio {ratio} has {len(same)} cycles, number {which} is asked for"
                raise InputError(table.path, "", problem)
            chosen = same[-1] if which == "last" else same[which - 1]
            rows = chosen.rows
            found[ratio] = BiaxialPath(
                table, chosen, len(same), table.load[rows], table.strain[rows]
            )
    missing = [ratio for ratio in ratios or () if ratio not in found]
    if missing or not found:
        there = ", ".join(dict.fromkeys(c.ratio for own in cycles for c in own))
        problem = f"no cycle of ratio {', '.join(missing) or 'any'} after the conditioning"
        raise InputError(tables[0].path, "", f"{problem}; the ratios there: {there}")
    order = {ratio: k for k, ratio in enumerate(RATIOS)}
    return sorted(found.values(), key=lambda p: (order.get(p.ratio, len(order)), p.ratio))
