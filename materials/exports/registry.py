"""The formats that need the card alone: one line each.

A format that carries a solver's own files is with the solver: `solvers/registry.py` has them all.
"""

from __future__ import annotations

from . import abaqus as abaqus_fabric
from . import abaqus as abaqus_umat
from . import csv_tables
from . import designers as constants_table
from . import designers as data_sheets
from . import ls_dyna as ls_dyna_mat34
from . import marc as marc_hypela2
from . import marc as marc_nlelast
from . import radioss as radioss_law58
from .base import Format

FORMATS: tuple[Format, ...] = (
    marc_nlelast.FORMAT_MARC_NLELAST,
    marc_hypela2.FORMAT,
    abaqus_umat.FORMAT_ABAQUS_UMAT,
    abaqus_fabric.FORMAT,
    ls_dyna_mat34.FORMAT,
    radioss_law58.FORMAT,
    constants_table.FORMAT,
    *data_sheets.FORMATS,
    csv_tables.FORMAT,
)
