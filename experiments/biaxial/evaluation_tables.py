"""Write the evaluation of a biaxial test as tables, numbers for JSON and lines for the terminal.

References
----------
EN 17117-1, Rubber or plastics coated fabrics: mechanical test methods under biaxial stress states.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...lazy_modules import pandas as pd
from ...materials import designers
from ...materials.designers import POINTS, LinearPath, Options
from ...notes import note_records
from ..measured import PERCENT
from .evaluation import NEITHER, BiaxialEvaluation, by_yarn

CONVENTION = (
    "nu_warp: contraction of the warp per strain of the fill when the fill is pulled (nu_xy beside "
    "E_x, x the warp); nu_fill: of the fill when the warp is pulled"
)


def in_words(options: Options) -> str:
    """Return a description of the options: what is minimised and which paths count."""
    unloaded = "with" if options.unloaded else "without"
    reciprocal = "reciprocal" if options.reciprocal else "free"
    ratios = f", {' and '.join(options.ratios)} only" if options.ratios else ""
    return f"least squares of {options.minimise}s, {reciprocal}, {unloaded} unloaded yarns{ratios}"


def standard_table(evaluation: BiaxialEvaluation) -> pd.DataFrame:
    """Return the table of a report after EN 17117-1: a row for each phase, and one for the test.

    A stiffness is the change of a yarn's load over the change of its strain along the evaluated
    loading. Poisson's ratio in the column of a yarn is given where that yarn is unloaded: its
    contraction over the strain of the other. Both are NaN elsewhere. The last row, "all", has the
    constants evaluated from all paths.

    References
    ----------
    EN 17117-1.
    """
    evaluated = {
        (path.table.name, path.cycle.phase): (path, line)
        for path, line in zip(evaluation.paths, evaluation.lines, strict=True)
    }
    table = []
    for phase in evaluation.residual_strains.to_dict("records"):
        path, line = evaluated.get((phase["file"], phase["phase"]), (None, None))
        stiffness, poisson = _constants_of_path(line)
        ends = (NEITHER, NEITHER) if path is None else path.load[[0, -1]]
        row: dict[str, object] = {
            "file": phase["file"],
            "ratio": phase["ratio"],
            "load_cycles": phase["cycles"],
            "cycle_evaluated": "" if path is None else str(path.cycle.number),
        }
        row |= by_yarn(
            from_kN_per_m=ends[0],
            to_kN_per_m=ends[1],
            stiffness_kN_per_m=stiffness,
            poisson=poisson,
            strain_kept_percent=(phase["warp_after_percent"], phase["fill_after_percent"]),
        )
        table.append(row)
    c = evaluation.chosen.constants
    count = int(evaluation.residual_strains["cycles"].sum())
    total = {"file": "", "ratio": "all", "load_cycles": count, "cycle_evaluated": ""}
    constants = by_yarn(stiffness_kN_per_m=(c.warp, c.fill), poisson=(c.nu_warp, c.nu_fill))
    return pd.DataFrame([*table, total | constants])


def _constants_of_path(
    line: LinearPath | None, *, smallest_strain: float = 1e-6
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return stiffnesses (2,) kN/m and Poisson's ratios (2,) along warp and fill of one loading.

    A loaded yarn has a stiffness, an unloaded one Poisson's ratio: its contraction over the strain
    of the loaded yarn (of `materials.designers`, nu_w is that of the warp by the fill).

    Strain changes up to `smallest_strain`, which no instrument resolves, give NaN.
    """
    stiffness = NEITHER.copy()
    poisson = NEITHER.copy()
    if line is None:
        return stiffness, poisson
    for yarn, is_unloaded in enumerate(line.unloaded):
        strain = line.strain[yarn]
        strain_of_loaded = line.strain[1 - yarn]
        if not is_unloaded and strain > smallest_strain:
            stiffness[yarn] = line.load[yarn] / strain
        if is_unloaded and strain_of_loaded > smallest_strain:
            poisson[yarn] = -strain / strain_of_loaded
    return stiffness, poisson


#: Name, and file name without ending, of the table after EN 17117-1.
STANDARD = "en-17117"


def tables_of(evaluation: BiaxialEvaluation) -> dict[str, pd.DataFrame]:
    """Return all tables of an evaluation by name.

    In "constants", E are stiffnesses and A those of the direct form, both in kN/m; squares are
    sums of squared strain errors, %^2.
    """
    return {
        "constants": _constants_table(evaluation),
        STANDARD: standard_table(evaluation),
        "lines": _lines_table(evaluation),
        "kept": evaluation.residual_strains,
    }


def _constants_table(evaluation: BiaxialEvaluation) -> pd.DataFrame:
    """Return the constants, a row for each choice of options and cycles."""
    rows = [{"what": "chosen", **designers.row_of(evaluation.chosen)}]
    rows += [{"what": "", **designers.row_of(choice)} for choice in evaluation.alternatives]
    by_cycle = {"first cycle": evaluation.first_cycle, "last cycle": evaluation.last_cycle}
    for name, of_cycle in by_cycle.items():
        if of_cycle is not None:
            rows.append({"what": name, **designers.row_of(of_cycle)})
    return pd.DataFrame(rows)


def _lines_table(evaluation: BiaxialEvaluation) -> pd.DataFrame:
    """Return a row for each evaluated loading, and the straight line fitted to it."""
    rows = []
    for path, line in zip(evaluation.paths, evaluation.lines, strict=True):
        row = {
            "ratio": path.ratio,
            "file": path.table.name,
            "cycle": path.cycle.number,
            "cycles": path.cycle_count,
            "readings": len(path.load),
            "from_kN_per_m": float(path.larger[0]),
            "to_kN_per_m": float(path.larger[-1]),
        }
        row |= by_yarn(
            load_change_kN_per_m=line.load,
            strain_change_percent=PERCENT * np.asarray(line.strain),
            rms_about_line_percent=PERCENT * np.asarray(line.residual),
        )
        rows.append(row | {"rms_of_constants_percent": evaluation.chosen.rms[path.ratio]})
    return pd.DataFrame(rows)


def lines_of(evaluation: BiaxialEvaluation) -> list[str]:
    """Return the results as lines for the terminal."""
    c = evaluation.chosen.constants
    lines = [
        f"{evaluation.test}: {in_words(evaluation.chosen.options)};",
        f"  {evaluation.chosen.paths} strain paths of ratios "
        f"{', '.join(line.ratio for line in evaluation.lines)}",
        f"  E warp {c.warp:.4g} kN/m, E fill {c.fill:.4g} kN/m, nu_warp {c.nu_warp:.3g}, nu_fill "
        f"{c.nu_fill:.3g}; S = {evaluation.chosen.squares:.4g} %^2 at {POINTS} points a path",
    ]
    if c.nu_warp * c.nu_fill < 1:
        a = c.stiffness
        lines.append(
            f"  direct form: A warp {a[0, 0]:.4g}, A fill {a[1, 1]:.4g}, A warp-fill "
            f"{a[0, 1]:.4g}, A fill-warp {a[1, 0]:.4g} kN/m"
        )
    lines.append(f"  {CONVENTION}")
    lines.append(f"  over {1 + len(evaluation.alternatives)} choices of what is evaluated:")
    for name, (low, high) in evaluation.spread.items():
        lines.append(f"    {name} {low:.4g} to {high:.4g}")
    if evaluation.first_cycle is not None and evaluation.last_cycle is not None:
        first = evaluation.first_cycle.constants
        last = evaluation.last_cycle.constants
        lines.append(
            f"  first cycles: E warp {first.warp:.4g}, E fill {first.fill:.4g} kN/m; last cycles: "
            f"{last.warp:.4g}, {last.fill:.4g} kN/m"
        )
    comes_back = evaluation.residual_strains.dropna(subset="warp_after_percent")
    for phase in comes_back.to_dict("records")[-1:]:
        words = (
            "  strain kept after {ratio}, the last that comes back to the loads of the beginning "
            "({warp_load_kN_per_m:.3g} and {fill_load_kN_per_m:.3g} kN/m): warp "
            "{warp_after_percent:.3g} %, fill {fill_after_percent:.3g} %"
        )
        lines.append(words.format_map(phase))
    return lines


def numbers_of(evaluation: BiaxialEvaluation) -> dict[str, Any]:
    """Return the results for result.json."""
    plain = {
        name: table.astype(object).where(table.notna(), None).to_dict("records")
        for name, table in tables_of(evaluation).items()
    }
    return {
        "options": in_words(evaluation.chosen.options),
        "convention": CONVENTION,
        "points_a_path": POINTS,
        **plain,
        "spread": {name: list(ends) for name, ends in evaluation.spread.items()},
        "verdict": evaluation.verdict.numbers,
        "notes": note_records(evaluation.notes),
    }
