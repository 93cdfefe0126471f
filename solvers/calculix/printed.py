"""Tables that CalculiX prints for `*NODE PRINT` into its .dat file."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..result_files import ResultFrame, ResultMesh

_TABLE = re.compile(
    r"^ *(displacements|forces) \(.*\) for set \S+ and time +(\S+)\n\s*?\n"
    r"((?: +\d+(?: +\S+){3}\n)+)",
    re.MULTILINE,
)


class PrintedFile:
    """Displacements and forces of the node sets that a .dat file has; nodes have no places there.

    Attributes
    ----------
    mesh : ResultMesh
        Numbers of the nodes; their points are no numbers.
    """

    def __init__(self, path: Path) -> None:
        tables = [
            (float(time), quantity, np.array([row.split() for row in rows.splitlines()], float))
            for quantity, time, rows in _TABLE.findall(path.read_text(encoding="latin-1"))
        ]
        nodes = [np.empty(0), *(table[:, 0] for _, _, table in tables)]
        numbers = np.unique(np.concatenate(nodes)).astype(int)
        self.mesh = ResultMesh(numbers, np.full((len(numbers), 3), np.nan), ())
        fields: dict[float, dict[str, np.ndarray]] = {}
        for time, quantity, table in tables:
            absent = np.full((len(numbers), 3), np.nan)
            field = fields.setdefault(time, {}).setdefault(quantity, absent)
            field[np.searchsorted(numbers, table[:, 0])] = table[:, 1:]
        self._frames = [ResultFrame(time, fields=fields[time]) for time in sorted(fields)]

    def frames(self) -> Iterator[ResultFrame]:
        """Yield what was printed at each time."""
        return iter(self._frames)
