"""Workbooks (.xlsx, .xlsm): the sheet with a table of the quantities asked for, as values.

Untrusted: size is limited, formulas give their stored value, macros, links, pictures nothing.
"""

import warnings
import zipfile
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...storage.reading import read_bytes
from ..machine_export import are_directions, find_header, quantity_words, table_from_rows
from ..machine_tables import MachineTable, TableOptions
from ..quantities import MAX_COLUMNS
from ..registry import Format, register_format
from ..tables import Row, Rows, TextTable

#: Bytes of a workbook at most.
LARGEST = 50 * 2**20
#: Bytes of all its parts at most, unpacked.
UNPACKED = 500 * 2**20
#: Cells of a sheet at most.
MOST_CELLS = 5_000_000


def read(path: Path, options: TableOptions) -> MachineTable:
    """Read the table of the sheet that is named, else of the one sheet that has such a table.

    Sheets with such tables that are all named by directions are read as one.
    """
    sheets = _read_sheets(path, options.sheet)
    headers = {name: find_header(rows, options) for name, rows in sheets.items()}
    headers_found = {name: index for name, index in headers.items() if index is not None}
    if len(headers_found) > 1 and are_directions(list(headers_found)):
        tables = {
            name: table_from_rows(path, sheets[name], index, options)
            for name, index in headers_found.items()
        }
        return _joined_directions(path, tables)
    if len(headers_found) != 1:
        listed = ", ".join(map(repr, sheets))
        problem = f"no sheet has a row of names with {quantity_words(options)}; it has: {listed}"
        if headers_found:
            listed = ", ".join(map(repr, headers_found))
            problem = f"several sheets have such a table, {listed}; say sheet"
        raise InputError(path, "", problem)
    ((name, header_index),) = headers_found.items()
    return table_from_rows(path, sheets[name], header_index, options)


def _joined_directions(path: Path, tables: Mapping[str, MachineTable]) -> MachineTable:
    """Return the tables of sheets that are named by directions as one, with a column of these."""
    first, *others = tables.values()
    names = ", ".join(map(repr, tables))
    if "direction" in first.names or any(
        (table.names, table.units) != (first.names, first.units) for table in others
    ):
        raise InputError(path, "", f"the tables of the sheets {names} differ; say sheet")
    columns = [*first.names, "direction"]
    rows = [[*cells, name] for name, table in tables.items() for cells in table.table.rows]
    lines = np.concatenate([table.table.lines for table in tables.values()])
    joined = TextTable(path, columns, rows, lines, first.table.decimal)
    notes = [note for table in tables.values() for note in table.notes]
    notes.append(f"{path.name}: the sheets {names} are those directions")
    return MachineTable(joined, {**first.units, "direction": ""}, first.header, tuple(notes))


def _read_sheets(path: Path, sheet: str | None) -> dict[str, Rows]:
    """Return the rows of each sheet, or of the one of this name; cells as text."""
    from openpyxl import load_workbook

    content = BytesIO(read_bytes(path, LARGEST))
    try:
        parts = zipfile.ZipFile(content).infolist()
        if sum(part.file_size for part in parts) > UNPACKED:
            problem = f"unpacks to more than {UNPACKED // 2**20} MiB; is it the right file?"
            raise InputError(path, "", problem)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and links, which are not read
            book = load_workbook(content, read_only=True, data_only=True, keep_links=False)
            names = [sheet_of_book.title for sheet_of_book in book.worksheets]
            if sheet is not None and sheet not in names:
                listed = ", ".join(map(repr, names))
                problem = f"there is no sheet {sheet!r}; there are: {listed}"
                raise InputError(path, "sheet", problem)
            return {name: _read_rows(path, book[name]) for name in names if sheet in (None, name)}
    except InputError:
        raise
    except Exception as error:  # whatever openpyxl and the parser make of a broken archive
        problem = f"is no workbook that can be read ({type(error).__name__}); save it as CSV"
        raise InputError(path, "", problem) from None


def _read_rows(path: Path, sheet: Any) -> Rows:
    """Return number and cells of each row that is not empty."""
    sheet.reset_dimensions()  # what a file says of its size may be wrong
    rows: Rows = []
    count = 0
    for number, row in enumerate(sheet.iter_rows(max_col=MAX_COLUMNS, values_only=True), start=1):
        count += len(row) + 1
        if count > MOST_CELLS:
            raise InputError(path, "", f"a sheet has more than {MOST_CELLS} cells; save it as CSV")
        cells = ["" if cell is None else str(cell).strip() for cell in row]
        if any(cells):
            rows.append(Row(number, cells))
    return rows


def recognises(path: Path, head: bytes) -> bool:
    """Return whether a file is an archive, and a workbook by its name or its parts."""
    is_named = path.suffix.lower() in (".xlsx", ".xlsm")
    return head.startswith(b"PK\x03\x04") and (is_named or b"xl/" in head)


register_format(Format("xlsx", "machine table", "a sheet of a workbook (Excel)", read, recognises))
