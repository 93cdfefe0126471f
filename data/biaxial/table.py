"""One file of a biaxial test: loads per width and strains along both yarns, row by row."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..column_names import PAIRS, STRAIN_UNITS, WIDTH_LOAD_UNITS
from ..frames import FrameSource
from ..machine_tables import TableOptions, column_of, measured, read_machine_table, source_of
from .ratios import plain_ratio

Array = NDArray[np.float64]
LoadUnit = Literal["kN/m", "N/mm", "N/m", "N/cm", "N/50mm"]
StrainUnit = Literal["%", "‰", "mm/mm"]

#: What a table has to hold, and by which key of a project its column is named.
QUANTITIES: Mapping[str, str] = {name.replace(" ", "_"): name for name in PAIRS}


@dataclass(frozen=True, eq=False)
class BiaxialTable:
    """The rows of a file in their order.

    load : (n, 2) N/mm (kN/m) along warp and fill. strain : (n, 2) change of length over the length
    at the beginning. ratio : (n,) names of load ratios, None where the file has none. lines : (n,)
    in the file. source : what of it was read.
    """

    path: Path
    load: Array
    strain: Array
    ratio: tuple[str, ...] | None
    lines: NDArray[np.intp]
    source: FrameSource


def read_biaxial_table(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    load_unit: LoadUnit | None = None,
    strain_unit: StrainUnit | None = None,
    decimal: Literal[".", ","] | None = None,
    comment: str = "#",
    format: str | None = None,
) -> BiaxialTable:
    """Read a table; names, units, separator and decimal mark are found as for load curves.

    Parameters
    ----------
    columns : the file's own names of `warp_load`, `fill_load`, `warp_strain`, `fill_strain` and
        `ratio`, where they are not found by meaning (n_w, eps_f, "Strain fill (%)" are).
    load_unit, strain_unit : needed where the file names none.

    Raises
    ------
    InputError : naming file, line and the columns there are: nothing or several things found for
        a quantity, no unit or a different one, cells that are not finite numbers, no such ratio.
    """
    path, named = Path(path), dict(columns or {})
    unknown = [name for name in named if name not in (*QUANTITIES, "ratio")]
    if unknown:
        problem = f"unknown quantity {unknown[0]!r}; expected {', '.join((*QUANTITIES, 'ratio'))}"
        raise InputError(None, "columns", problem)
    asked = {QUANTITIES.get(name, name): column for name, column in named.items()}
    wanted = tuple(QUANTITIES.values())
    options = TableOptions(asked, wanted, comment, decimal)
    found = read_machine_table(path, options, format)
    column = {name: column_of(found, name, asked, wanted) for name in (*wanted, "ratio")}
    load, strain = (
        np.column_stack([measured(found, column[f"{yarn} {kind}"], kind, units, unit)
                         for yarn in ("warp", "fill")])
        for kind, units, unit in (
            ("load", WIDTH_LOAD_UNITS, load_unit), ("strain", STRAIN_UNITS, strain_unit),
        )
    )  # fmt: skip
    units_asked = {name: load_unit if name.endswith("load") else strain_unit for name in wanted}
    source = source_of(found, column, units_asked, format, found.notes)
    ratio = None
    if column["ratio"]:
        cells, lines = found.table.text(column["ratio"]), found.table.lines
        ratio = tuple(
            _ratio(path, f"line {line}, column {column['ratio']!r}", cell)
            for line, cell in zip(lines, cells, strict=True)
        )
    return BiaxialTable(path, load, strain, ratio, found.table.lines, source)


def _ratio(path: Path, at: str, cell: str) -> str:
    try:
        return plain_ratio(cell)
    except InputError as error:
        raise InputError(path, at, error.problem) from None
