"""What an evaluation says: words for the terminal, result.json, tables and the figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...materials.designers.linear import POINTS, Options
from ...materials.designers.rows import row_of
from ...notes import rows
from ...reports import BiaxialPanel, plot_biaxial
from ...writing import replacing
from .evaluation import BiaxialEvaluation
from .objective import PERCENT

Array = NDArray[np.float64]

#: nu_warp and nu_fill in words.
CONVENTION = (
    "nu_warp: contraction of the warp per strain of the fill when the fill is pulled (nu_xy beside "
    "E_x, x the warp); nu_fill: of the fill when the warp is pulled"
)


def in_words(options: Options) -> str:
    """What was evaluated, in a few words."""
    of = "loads" if options.minimise == "load" else "strains"
    unloaded = "with" if options.unloaded else "without"
    reciprocal = "reciprocal" if options.reciprocal else "free"
    ratios = f", {' and '.join(options.ratios)} only" if options.ratios else ""
    return f"least squares of {of}, {reciprocal}, {unloaded} unloaded yarns{ratios}"


def option_table(found: BiaxialEvaluation) -> pd.DataFrame:
    """A row for each choice: options, constants of both forms, squares of strain.

    Columns E in kN/m, A (direct form) in kN/m, squares in %^2 at `POINTS` points a path.
    """
    named = [("chosen", found.chosen), *(("", one) for one in found.others)]
    named += [(f"{which} cycle", one) for which, one in (("first", found.first),
              ("last", found.last)) if one is not None]  # fmt: skip
    return pd.DataFrame([{"what": what, **row_of(one)} for what, one in named])


def line_table(found: BiaxialEvaluation) -> pd.DataFrame:
    """A row a ratio: cycle, loads and strains of the regression lines, what they leave."""
    table = []
    for path, line in zip(found.paths, found.lines, strict=True):
        table.append(
            {
                "ratio": path.ratio,
                "file": path.table.path.name,
                "cycle": path.cycle.number,
                "cycles": path.cycles,
                "readings": len(path.load),
                "from_kN_per_m": float(path.load[0].max()),
                "to_kN_per_m": float(path.load[-1].max()),
                "warp_load_change_kN_per_m": line.load[0],
                "fill_load_change_kN_per_m": line.load[1],
                "warp_strain_change_percent": PERCENT * line.strain[0],
                "fill_strain_change_percent": PERCENT * line.strain[1],
                "warp_rms_about_line_percent": PERCENT * line.residual[0],
                "fill_rms_about_line_percent": PERCENT * line.residual[1],
                "rms_of_constants_percent": found.chosen.rms[path.ratio],
            }
        )
    return pd.DataFrame(table)


def kept_table(found: BiaxialEvaluation) -> pd.DataFrame:
    """A row a phase of cycles: strain kept before and after it, %."""

    def percent(strain: Array | None) -> Array:
        return np.full(2, np.nan) if strain is None else PERCENT * strain

    table = []
    for kept in found.kept:
        before, after = percent(kept.before), percent(kept.after)
        table.append(
            {
                "file": kept.file,
                "phase": kept.phase,
                "ratio": kept.ratio,
                "cycles": kept.cycles,
                "warp_before_percent": before[0],
                "fill_before_percent": before[1],
                "warp_after_percent": after[0],
                "fill_after_percent": after[1],
                "warp_load_kN_per_m": kept.load[0],
                "fill_load_kN_per_m": kept.load[1],
            }
        )
    return pd.DataFrame(table)


def lines_of(found: BiaxialEvaluation) -> list[str]:
    """For the terminal."""
    c = found.chosen.constants
    said = [
        f"{found.test}: {in_words(found.chosen.options)}; {found.chosen.paths} strain paths of "
        f"ratios {', '.join(line.ratio for line in found.lines)}",
        f"  E warp {c.warp:.4g} kN/m, E fill {c.fill:.4g} kN/m, nu_warp {c.nu_warp:.3g}, nu_fill "
        f"{c.nu_fill:.3g}; S = {found.chosen.squares:.4g} %^2 at {POINTS} points a path",
    ]
    if c.nu_warp * c.nu_fill < 1:
        a = c.stiffness
        said.append(
            f"  direct form: A warp {a[0, 0]:.4g}, A fill {a[1, 1]:.4g}, A warp-fill "
            f"{a[0, 1]:.4g}, A fill-warp {a[1, 0]:.4g} kN/m"
        )
    said.append(f"  {CONVENTION}")
    said.append(f"  over {1 + len(found.others)} choices of what is evaluated:")
    for name, (low, high) in found.spread.items():
        said.append(f"    {name} {low:.4g} to {high:.4g}")
    if found.first is not None and found.last is not None:
        one, two = found.first.constants, found.last.constants
        said.append(
            f"  first cycles: E warp {one.warp:.4g}, E fill {one.fill:.4g} kN/m; last cycles: "
            f"{two.warp:.4g}, {two.fill:.4g} kN/m"
        )
    for kept in reversed(found.kept):
        if kept.after is not None:
            warp, fill = PERCENT * kept.after
            said.append(
                f"  strain kept after {kept.ratio}, the last that comes back to the loads of the "
                f"beginning ({kept.load[0]:.3g} and {kept.load[1]:.3g} kN/m): warp {warp:.3g} %, "
                f"fill {fill:.3g} %"
            )
            break
    return said


def numbers_of(found: BiaxialEvaluation) -> dict[str, Any]:
    """For result.json."""

    def plain(table: pd.DataFrame) -> list[dict[str, Any]]:
        return [
            {str(k): None if isinstance(v, float) and np.isnan(v) else v for k, v in row.items()}
            for row in table.to_dict("records")
        ]

    return {
        "options": in_words(found.chosen.options),
        "convention": CONVENTION,
        "points_a_path": POINTS,
        "constants": plain(option_table(found)),
        "lines": plain(line_table(found)),
        "kept": plain(kept_table(found)),
        "spread": {name: list(ends) for name, ends in found.spread.items()},
        "notes": rows(found.notes),
    }


def write_tables(found: BiaxialEvaluation, folder: Path, prefix: str = "") -> list[Path]:
    """constants.csv, lines.csv, kept.csv and constants.png into a folder; what was written."""
    written = []
    for name, table in (
        ("constants.csv", option_table(found)),
        ("lines.csv", line_table(found)),
        ("kept.csv", kept_table(found)),
    ):
        with replacing(folder / (prefix + name)) as path:
            table.to_csv(path, index=False, float_format="%.9g")
        written.append(folder / (prefix + name))
    panels = []
    for measured in found.paths:
        load = measured.load
        strain = PERCENT * found.chosen.constants.strain(load - load[0])
        larger = load.max(axis=1)
        panels.append(
            BiaxialPanel(
                measured.ratio, larger, PERCENT * measured.since, (("constants", larger, strain),)
            )
        )
    written.append(plot_biaxial(folder / f"{prefix}constants.png", panels))
    return written
