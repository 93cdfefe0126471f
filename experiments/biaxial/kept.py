"""Strain that a fabric keeps of a biaxial test: what a cutting pattern is compensated for.

It is by how much the strain at the beginning of a loading, or after the last one, differs from that
of the file's first row, where the test was under its prestress. It is told only where both loads
are what they were there: a fabric under other loads has other strains, and keeps nothing by that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...data.biaxial.cycles import Cycle
from ...data.biaxial.table import BiaxialTable
from .reading import BiaxialData

Array = NDArray[np.float64]
#: Of a loading's range: how near both loads must be to those of the first row.
BACK = 0.01


@dataclass(frozen=True, eq=False)
class KeptStrain:
    """Of one phase of cycles, (2,) along warp and fill, as shares.

    before : at the beginning of its first loading; after : when the loads are back after its last
    one. None where they are not what they were in the first row. load : (2,) kN/m, of that row.
    """

    file: str
    ratio: str
    phase: int
    cycles: int
    before: Array | None
    after: Array | None
    load: Array


def kept_strains(data: BiaxialData) -> tuple[KeptStrain, ...]:
    """Phase by phase in the order of the files."""
    return tuple(
        _kept(table, same, cycles)
        for table, cycles in zip(data.tables, data.cycles, strict=True)
        for same in _phases(cycles)
    )


def _phases(cycles: Sequence[Cycle]) -> list[list[Cycle]]:
    found: dict[int, list[Cycle]] = {}
    for cycle in cycles:
        found.setdefault(cycle.phase, []).append(cycle)
    return list(found.values())


def _kept(table: BiaxialTable, same: Sequence[Cycle], cycles: Sequence[Cycle]) -> KeptStrain:
    first, last = same[0], same[-1]
    later = [cycle.first for cycle in cycles if cycle.first > last.last]
    stop = (later[0] if later else len(table.load) - 1) + 1
    away = np.abs(table.load - table.load[0]).max(axis=1)
    least = BACK * float(np.ptp(table.load.max(axis=1)))

    def kept(row: int) -> Array | None:
        return table.strain[row] - table.strain[0] if away[row] <= least else None

    back = last.last + int(np.argmin(away[last.last : stop]))
    return KeptStrain(
        table.path.name,
        last.ratio,
        last.phase,
        len(same),
        kept(first.first),
        kept(back),
        table.load[0],
    )
