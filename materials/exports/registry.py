"""The formats that need the card alone: one line each.

A format that carries a solver's own files is with the solver: `solvers/exports.py` has them all.
"""

from __future__ import annotations

from . import (
    abaqus_fabric,
    abaqus_umat,
    constants_table,
    csv_tables,
    data_sheets,
    ls_dyna_mat34,
    marc_hypela2,
    marc_nlelast,
    radioss_law58,
)
from .formats import Format

FORMATS: tuple[Format, ...] = (
    marc_nlelast.FORMAT,
    marc_hypela2.FORMAT,
    abaqus_umat.FORMAT,
    abaqus_fabric.FORMAT,
    ls_dyna_mat34.FORMAT,
    radioss_law58.FORMAT,
    constants_table.FORMAT,
    *data_sheets.FORMATS,
    csv_tables.FORMAT,
)
