"""A format of test machines: channels by name and unit, then numbers separated by blanks.

RIGLOG 1
channel Extension mm
channel Force kN
0.000 0.0000
0.100 0.0213
"""

from pathlib import Path

import numpy as np
from bubblefit.errors import InputError
from bubblefit.readers.machine_tables import MachineTable, TableOptions
from bubblefit.readers.registry import Format
from bubblefit.readers.tables import TextTable, read_lines

FIRST = "RIGLOG 1"


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins as such a file does."""
    return head.startswith(FIRST.encode())


def read(path: Path, options: TableOptions) -> MachineTable:
    """The table; bubblefit finds its quantities and units by itself. InputError names the line."""
    lines = read_lines(path, comment="")
    channels = [(n, text.split()) for n, text in lines if text.startswith("channel ")]
    if not channels or any(len(words) != 3 for _, words in channels):
        raise InputError(path, "", "expected lines 'channel NAME UNIT'")
    names = [words[1] for _, words in channels]
    header = channels[-1][0]
    rows = [(n, text.split()) for n, text in lines if n > header]
    for n, cells in rows:
        if len(cells) != len(names):
            problem = f"expected {len(names)} numbers, found {len(cells)}"
            raise InputError(path, f"line {n}", problem)
    line_numbers = np.array([n for n, _ in rows])
    units = {words[1]: words[2] for _, words in channels}
    table = TextTable(path, names, [cells for _, cells in rows], line_numbers)
    return MachineTable(table, units, header)


RIGLOG = Format("riglog", "machine table", "log files of the rig", read, recognises)
