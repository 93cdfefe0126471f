"""Workbooks (.xlsx, .xlsm): the sheet with a table of the quantities asked for, as values.

Untrusted: size is limited, formulas give their stored value, macros, links, pictures nothing.
"""

import warnings
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...files import content_of
from ..cells import Row, Rows
from ..machine_export import find_header, quantity_words, table_from_rows
from ..machine_tables import MachineTable, TableOptions
from ..quantities import MAX_COLUMNS
from ..registry import Format, register_format

#: Bytes of a workbook, and of all its parts unpacked; cells of a sheet.
LARGEST, UNPACKED, MOST_CELLS = 50 * 2**20, 500 * 2**20, 5_000_000


def read(path: Path, options: TableOptions) -> MachineTable:
    """Read the table of the sheet that is named, else of the one sheet that has such a table."""
    sheets = _sheets(path, options.sheet)
    heads = {name: find_header(rows, options) for name, rows in sheets.items()}
    able = [name for name, index in heads.items() if index is not None]
    if len(able) != 1:
        required = quantity_words(options)
        listed = ", ".join(map(repr, sheets))
        problem = f"no sheet has a row of names with {required}; it has: {listed}"
        if able:
            problem = f"several sheets have such a table, {', '.join(map(repr, able))}; say sheet"
        raise InputError(path, "", problem)
    return table_from_rows(path, sheets[able[0]], heads[able[0]] or 0, options)


def _sheets(path: Path, wanted: str | None) -> dict[str, Rows]:
    """Return the rows of each sheet, or of the one that is wanted; cells as text."""
    from openpyxl import load_workbook

    content = BytesIO(content_of(path, LARGEST))
    try:
        parts = zipfile.ZipFile(content).infolist()
        if sum(part.file_size for part in parts) > UNPACKED:
            problem = f"unpacks to more than {UNPACKED // 2**20} MiB; is it the right file?"
            raise InputError(path, "", problem)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and links, which are not read
            book = load_workbook(content, read_only=True, data_only=True, keep_links=False)
            names = [sheet.title for sheet in book.worksheets]
            if wanted is not None and wanted not in names:
                problem = f"there is no sheet {wanted!r}; there are: {', '.join(map(repr, names))}"
                raise InputError(path, "sheet", problem)
            return {name: _rows(path, book[name]) for name in names if wanted in (None, name)}
    except InputError:
        raise
    except Exception as error:  # whatever openpyxl and the parser make of a broken archive
        problem = f"is no workbook that can be read ({type(error).__name__}); save it as CSV"
        raise InputError(path, "", problem) from None


def _rows(path: Path, sheet: Any) -> Rows:
    """Return number and cells of each row that is not empty."""
    sheet.reset_dimensions()  # what a file says of its size may be wrong
    found: Rows = []
    cells = 0
    for number, row in enumerate(sheet.iter_rows(max_col=MAX_COLUMNS, values_only=True), start=1):
        cells += len(row) + 1
        if cells > MOST_CELLS:
            raise InputError(path, "", f"a sheet has more than {MOST_CELLS} cells; save it as CSV")
        text = ["" if cell is None else str(cell).strip() for cell in row]
        if any(text):
            found.append(Row(number, text))
    return found


def recognises(path: Path, head: bytes) -> bool:
    """Return whether a file is an archive, and a workbook by its name or its parts."""
    named = path.suffix.lower() in (".xlsx", ".xlsm")
    return head.startswith(b"PK\x03\x04") and (named or b"xl/" in head)


register_format(Format("xlsx", "machine table", "a sheet of a workbook (Excel)", read, recognises))
