"""Read tables of biaxial tests: loads per width and strains along warp and fill."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from ...errors import InputError, check_one_of
from ...readers.biaxial import BiaxialTable
from ...readers.machine_tables import Channel, MachineTable, TableOptions, read_machine_table
from ...readers.quantities import PAIRS
from ...readers.units import LOAD_UNITS, STRAIN_UNITS, WIDTH_LOAD_UNITS, scale_of
from ...solvers.base import Array
from .paths import canonical_ratio

LoadUnit = Literal["kN/m", "N/mm", "N/m", "N/cm", "N/50mm", "N/5cm", "lbf/in", "N", "kN", "lbf"]
StrainUnit = Literal["%", "‰", "mm/mm"]
YARNS = ("warp", "fill")
#: Largest fall of a load from row to row, as a share of the largest, over which tables are paired.
LARGEST_FALL = 0.02
#: Quantities that a table has to hold, by the key with which a project names their column.
QUANTITIES: Mapping[str, str] = {name.replace(" ", "_"): name for name in PAIRS}


def read_biaxial_table(
    path: Path | str,
    *,
    columns: Mapping[str, str] | None = None,
    load_unit: LoadUnit | None = None,
    strain_unit: StrainUnit | None = None,
    width: float | None = None,
    sheet: str | None = None,
    decimal: Literal[".", ","] | None = None,
    comment: str = "#",
    format: str | None = None,
    yarns: Sequence[str] = YARNS,
) -> BiaxialTable:
    """Read the table of a biaxial test.

    Column names, units, separator and decimal mark are found as for load curves.

    Parameters
    ----------
    path : path
    columns : mapping, optional
        Column names in the file, by the keys of `QUANTITIES` and "ratio".
    load_unit, strain_unit : str, optional
        Units where the file names none.
    width : float, mm, optional
        Width of the arms, by which forces are divided; needed where the loads are forces.
    sheet : str, optional
        Sheet of a workbook.
    decimal, comment, format
        Decimal mark, comment sign and file format, see `TableOptions` and `read_machine_table`.
    yarns : sequence of str
        Yarns along which the file has loads and strains; the table has a column for each.

    Raises
    ------
    InputError
        Columns or units are missing, or a cell is not a ratio.
    """
    path = Path(path)
    names = dict(columns or {})
    for name in names:
        check_one_of(name, (*QUANTITIES, "ratio"), "columns")
    quantities = tuple(name for name in QUANTITIES.values() if name.split()[0] in yarns)
    named_columns = {QUANTITIES.get(name, name): column for name, column in names.items()}
    options = TableOptions(named_columns, quantities, comment, decimal, sheet)
    export = read_machine_table(path, options, format)
    column = {name: export.column(name) for name in (*quantities, "ratio")}
    load_units = _load_units(export, column[f"{yarns[0]} load"], load_unit, width)
    load = _along_yarns(export, column, "load", load_units, load_unit)
    strain = _along_yarns(export, column, "strain", STRAIN_UNITS, strain_unit)
    stated_units = {
        name: load_unit if name.endswith("load") else strain_unit for name in quantities
    }
    source = export.source(column, stated_units, export.notes)
    ratio = _ratios_in_column(export, column["ratio"], path)
    return BiaxialTable(
        path,
        load,
        strain,
        ratio,
        export.table.lines,
        source,
        export.times(),
        name=path.name,
    )


def pair_over_load(warp: BiaxialTable, fill: BiaxialTable) -> BiaxialTable:
    """Return one table of two that hold the readings along one yarn each, at other points.

    At a load ratio both loads rise together, so that readings at equal shares of the largest loads
    belong together. The readings are those along the warp; those along the fill are interpolated.

    Parameters
    ----------
    warp, fill : BiaxialTable
        Tables of one loading each, with one column of load and strain.

    Raises
    ------
    InputError
        A load falls: it is not said which reading belongs to which.
    """
    shares = [table.load[:, 0] / table.load.max() for table in (warp, fill)]
    for table, share in zip((warp, fill), shares, strict=True):
        if np.diff(share).min(initial=0.0) < -LARGEST_FALL:
            problem = "the load falls, and the two directions are paired over it: keep one loading"
            raise InputError(table.path, "load", problem)
    warp_share, fill_share = shares
    # Below its first reading the fill is not extrapolated.
    is_paired = warp_share >= fill_share[0]
    share = warp_share[is_paired]
    fill_strain = np.interp(share, np.maximum.accumulate(fill_share), fill.strain[:, 0])
    words = f"{warp.name}: paired with {fill.name} at equal shares of the largest loads"
    return replace(
        warp,
        load=np.column_stack([warp.load[is_paired, 0], share * fill.load.max()]),
        strain=np.column_stack([warp.strain[is_paired, 0], fill_strain]),
        lines=warp.lines[is_paired],
        source=replace(warp.source, notes=(*warp.source.notes, words)),
        time=None,
        partner=fill,
    )


def _load_units(
    export: MachineTable,
    column: str,
    load_unit: str | None,
    width: float | None,
) -> dict[str, float]:
    """Return the size in N/mm of each unit that the load column may have.

    Units of force are among them if the column is a force, divided by the width (mm) of the arms;
    InputError without a width.
    """
    units = dict(WIDTH_LOAD_UNITS)
    unit = export.units[column] or load_unit or ""
    if scale_of(unit, LOAD_UNITS) is not None:
        if width is None:
            problem = f"{unit} is a force; say the width of the arms, [biaxial] width"
            raise export.error(column, problem)
        units |= {force: scale / width for force, scale in LOAD_UNITS.items()}
    return units


def _along_yarns(
    export: MachineTable,
    column: Mapping[str, str],
    quantity: str,
    units: Mapping[str, float],
    unit: str | None,
) -> Array:
    """Return values (n, 2) of a quantity along warp and fill."""
    channel = Channel(unit=unit)
    values = [
        export.values(name, units, channel, f"{quantity}_unit")
        for key, name in column.items()
        if key.endswith(quantity)
    ]
    return np.column_stack(values)


def _ratios_in_column(export: MachineTable, column: str, path: Path) -> tuple[str, ...] | None:
    """Return the ratio of each row; None where there is no such column."""
    if not column:
        return None
    ratios = []
    for line, cell in zip(export.table.lines, export.table.text(column), strict=True):
        try:
            ratios.append(canonical_ratio(cell))
        except InputError as error:
            raise InputError(path, f"line {line}, column {column!r}", error.problem) from None
    return tuple(ratios)
