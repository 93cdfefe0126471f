"""What is seen of a biaxial test before a fit: its cycles, and which of them are evaluated."""

from __future__ import annotations

from ...reports import BiaxialPanel, Table, plot_biaxial
from ..exhibit import Exhibit, Output
from .objective import PERCENT
from .test import BiaxialTest

PATHS = "biaxial.png"


def exhibit(test: BiaxialTest, out: Output) -> Exhibit:
    """Write the paths that are evaluated; a table of all cycles."""
    panels = [
        BiaxialPanel(path.ratio, path.load.max(axis=1), PERCENT * path.since)
        for path in test.data.paths
    ]
    plot_biaxial(out.path(PATHS), panels)
    used = {(id(path.table), path.cycle.count) for path in test.data.paths}
    rows: list[list[object]] = []
    for read, cycles in zip(test.data.tables, test.data.cycles, strict=True):
        for cycle in cycles:
            kept = PERCENT * (read.strain[cycle.first] - read.strain[0])
            rows.append(
                [
                    read.path.name, cycle.count, cycle.ratio, cycle.number,
                    *read.load[cycle.last].tolist(), *kept.tolist(),
                    "yes" if (id(read), cycle.count) in used else "",
                ]
            )  # fmt: skip
    header = [
        "file", "cycle", "ratio", "of its ratio", "top load warp, kN/m", "fill, kN/m",
        "strain kept before it, warp, %", "fill, %", "evaluated",
    ]  # fmt: skip
    table = Table("Cycles as read", header, rows, text=(0, 2, 8))
    figures = [(out.name(PATHS), "the loading of each ratio that is evaluated")]
    return Exhibit(figures=figures, tables=[table])
