"""Evaluate a biaxial test linearly: elastic constants for design, and how options change them.

Residual strain, for which a cutting pattern is compensated, is the strain before or after the
cycles of a phase less that of the file's first row, under the prestress. It is given only where the
loads are those of the first row. Results are tables, numbers for JSON and lines for the terminal.

References
----------
EN 17117-1, Rubber or plastics coated fabrics: mechanical test methods under biaxial stress states.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...errors import InputError
from ...inference.reported import UNCERTAIN
from ...lazy_modules import pandas as pd
from ...materials import designers
from ...materials.designers import POINTS, USUAL, ConstantsEvaluation, LinearPath, Options, line_of
from ...notes import Note, State, Verdict, note_records
from ...readers.machine_tables import BiaxialTable
from ..base import UNMATCHED
from ..forward import UNSTABLE
from ..measured import PERCENT
from . import BiaxialTest
from .paths import BiaxialPath, CycleChoice, LoadCycle, evaluated_paths, phases_of

#: Unknown values along warp and fill, (2,) NaN.
NEITHER = np.full(2, np.nan)
#: Largest over smallest value of a constant among the options, above which a note is given.
WIDE_SPREAD = 1.1
#: Names of the constants in tables, by field of the constants.
NAMES = {"warp": "E warp", "fill": "E fill", "nu_warp": "nu_warp", "nu_fill": "nu_fill"}


@dataclass(frozen=True, eq=False)
class BiaxialEvaluation:
    """Elastic constants of one test, evaluated with the options chosen and with the other options.

    Attributes
    ----------
    test : str
        Name of the test.
    paths : sequence of BiaxialPath
        Loading branches that are evaluated.
    lines : tuple of LinearPath
        Straight lines through strains over loads, one for each path.
    chosen : ConstantsEvaluation
        Constants by the options that were chosen.
    alternatives : tuple of ConstantsEvaluation
        Constants by the other options, where the paths determine them.
    first_cycle, last_cycle : ConstantsEvaluation or None
        Constants from the first and from the last cycle of each ratio; None where the cycles do not
        determine them.
    residual_strains : DataFrame
        A row for each phase: residual strains (%) before its first loading and after its last, NaN
        where the loads are not those of the file's first row. Columns are file, phase, ratio,
        cycles, warp_before_percent, warp_after_percent, warp_load_kN_per_m (of the first row), and
        the same of the fill.
    tables : sequence of BiaxialTable
        The table of each of these rows.
    """

    test: str
    paths: Sequence[BiaxialPath]
    lines: tuple[LinearPath, ...]
    chosen: ConstantsEvaluation
    alternatives: tuple[ConstantsEvaluation, ...]
    first_cycle: ConstantsEvaluation | None
    last_cycle: ConstantsEvaluation | None
    residual_strains: pd.DataFrame
    tables: Sequence[BiaxialTable]

    @property
    def notes(self) -> list[Note]:
        """Return notes on the constants: instability, dependence on options, unknown shear."""
        c = self.chosen.constants
        notes = []
        if not c.stable:
            words = (
                f"nu_warp nu_fill is {c.nu_warp * c.nu_fill:.3g}: a fabric with these constants "
                "has no stable strain; no program takes them"
            )
            notes.append(Note(UNSTABLE, words, self.test))
        for name, (low, high) in self.spread.items():
            if not low > 0 or high / low > WIDE_SPREAD:
                words = (
                    f"{name} lies between {low:.4g} and {high:.4g} by what is evaluated: say which "
                    "options are meant wherever the constants are given"
                )
                notes.append(Note(UNCERTAIN, words, self.test))
        words = f"{self.test} pulls along the yarns only: it says nothing about the shear stiffness"
        return [*notes, Note(UNMATCHED, words)]

    @property
    def verdict(self) -> Verdict:
        """Return the constants, and whether they depend on what is evaluated."""
        constants = self.chosen.constants
        words = []
        for yarn, value in (("warp", constants.warp), ("fill", constants.fill)):
            low, high = self.spread[f"E {yarn}"]
            ends = f"({low:.4g} to {high:.4g} by what is evaluated)"
            words.append(f"E {yarn} is {value:.4g} kN/m {ends}")
        kinds = {note.kind for note in self.notes}
        reasons = tuple(str(note) for note in self.notes if note.kind in (UNSTABLE, UNCERTAIN))
        state: State = "usable within limits" if UNCERTAIN in kinds else "usable"
        return Verdict(
            "not to be used" if UNSTABLE in kinds else state,
            f"{', '.join(words)}, nu_warp {constants.nu_warp:.3g}, nu_fill {constants.nu_fill:.3g}",
            reasons,
            unknown="the shear stiffness: the test pulls along the yarns only",
            next_step=""
            if state == "usable"
            else "fit a law, which leaves no such choice: bubblefit fit",
        )

    @property
    def spread(self) -> dict[str, tuple[float, float]]:
        """Return the smallest and largest value of each constant over all options, by its name."""
        ends = designers.spread_of((self.chosen, *self.alternatives))
        return {NAMES[name]: pair for name, pair in ends.items()}


def evaluate_test(test: BiaxialTest, options: Options = USUAL) -> BiaxialEvaluation:
    """Evaluate the elastic constants of a test with the given options and with all others.

    Parameters
    ----------
    test : BiaxialTest
        Test with its data.
    options : Options
        What is minimised, which ratios count, and whether Poisson's ratios are reciprocal.

    Raises
    ------
    InputError
        A ratio of the options is not in the test, or the paths do not determine the constants.
    """
    paths = test.paths
    lines = tuple(line_of(path.ratio, path.load, path.strain_change) for path in paths)
    measured = [line.ratio for line in lines]
    missing = [ratio for ratio in options.ratios if ratio not in measured]
    if missing:
        problem = f"there is no ratio {', '.join(missing)}; the test has: {', '.join(measured)}"
        raise test.place.error("ratios", problem)
    with test.place.errors_name(field="data"):
        chosen = designers.evaluate(lines, options)
    residual_strains = []
    tables: list[BiaxialTable] = []
    for table, cycles in zip(test.tables, test.cycles, strict=True):
        rows = _residual_strains(table, cycles)
        residual_strains += rows
        tables += [table] * len(rows)
    return BiaxialEvaluation(
        test=test.name,
        paths=paths,
        lines=lines,
        chosen=chosen,
        alternatives=tuple(designers.evaluate_others(lines, options)),
        first_cycle=_of_cycle(test, 1, options),
        last_cycle=_of_cycle(test, "last", options),
        residual_strains=pd.DataFrame(residual_strains),
        tables=tuple(tables),
    )


def _residual_strains(
    table: BiaxialTable, cycles: Sequence[LoadCycle], *, load_tolerance: float = 0.01
) -> list[dict[str, object]]:
    """Return a row of residual strains for each phase of a file.

    `load_tolerance` is the largest difference of either load from that of the first row, as a share
    of the range of the larger load over the file.
    """
    load_change = np.abs(table.load - table.load[0]).max(axis=1)
    largest_change = load_tolerance * float(np.ptp(table.load.max(axis=1)))

    def residual_strain(row: int) -> ArrayLike:
        """Return strain (2,) % less that of the first row; NaN unless the loads are the same."""
        if not load_change[row] <= largest_change:
            return NEITHER
        return PERCENT * (table.strain[row] - table.strain[0])

    phases = []
    for cycles_of_phase in phases_of(cycles):
        last = cycles_of_phase[-1]
        later = [cycle.first for cycle in cycles if cycle.first > last.last]
        stop = (later[0] if later else len(table.load) - 1) + 1
        unloaded_row = last.last + int(np.argmin(load_change[last.last : stop]))
        strains = by_yarn(
            before_percent=residual_strain(cycles_of_phase[0].first),
            after_percent=residual_strain(unloaded_row),
            load_kN_per_m=table.load[0],
        )
        row: dict[str, object] = {"file": table.name, "phase": last.phase, "ratio": last.ratio}
        phases.append({**row, "cycles": len(cycles_of_phase), **strains})
    return phases


def _of_cycle(
    test: BiaxialTest, cycle: CycleChoice, options: Options
) -> ConstantsEvaluation | None:
    """Return the constants from another cycle of the same ratios; None if undetermined."""
    section = test.section
    ratios = [path.ratio for path in test.paths]
    paths = evaluated_paths(test.tables, test.cycles, cycle, section.conditioning, ratios)
    with suppress(InputError):
        if section.range is not None:
            paths = [path.between(*section.range) for path in paths]
        lines = [line_of(path.ratio, path.load, path.strain_change) for path in paths]
        return designers.evaluate(lines, options)
    return None


def by_yarn(**pairs: ArrayLike) -> dict[str, float]:
    """Return pairs (warp, fill) of values as columns: pair `x` becomes `warp_x` and `fill_x`."""
    return {
        f"{yarn}_{name}": float(value)
        for name, pair in pairs.items()
        for yarn, value in zip(("warp", "fill"), np.asarray(pair), strict=True)
    }


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
        (id(path.table), path.cycle.phase): (path, line)
        for path, line in zip(evaluation.paths, evaluation.lines, strict=True)
    }
    table = []
    phases = evaluation.residual_strains.to_dict("records")
    # Files of one name may lie in several folders.
    for measured, phase in zip(evaluation.tables, phases, strict=True):
        path, line = evaluated.get((id(measured), phase["phase"]), (None, None))
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
