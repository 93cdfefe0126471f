"""The linear evaluation of a biaxial test: designers' constants, their dependence on options.

Residual strain, for which a cutting pattern is compensated, is the strain before a loading, or
after the last one, less that of the first row, under the prestress: known at the same loads only.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ...inference.assessment import UNCERTAIN
from ...lazy_modules import pandas as pd
from ...materials import designers
from ...materials.designers import POINTS, USUAL, ConstantsEvaluation, LinearPath, Options, line_of
from ...notes import Note, note_records
from ..fitted import UNMATCHED
from ..run_records import UNSTABLE
from .prepared import PERCENT
from .test import BiaxialPath, BiaxialTest, Which, evaluated_paths

#: Of a loading's range: how near both loads must be to those of the first row.
BACK = 0.01
#: Change of strain that no instrument resolves: a stiffness from it is none.
SMALLEST_STRAIN = 1e-6
#: Values along warp and fill that are not known.
NEITHER = np.full(2, np.nan)


#: Constants that differ by more between options (largest over smallest) are worth a word.
WIDE = 1.1
#: Constants and their names.
NAMES = {"warp": "E warp", "fill": "E fill", "nu_warp": "nu warp", "nu_fill": "nu fill"}


@dataclass(frozen=True, eq=False)
class BiaxialEvaluation:
    """Elastic constants of one test, by the options chosen and by others that the paths settle.
    first, last : with the first and the last cycle of each ratio, None where these settle none.
    kept : residual strains before the first loading of a phase and after its last; NaN where the
    loads are not those of the first row."""

    test: str
    paths: Sequence[BiaxialPath]
    lines: tuple[LinearPath, ...]
    chosen: ConstantsEvaluation
    others: tuple[ConstantsEvaluation, ...]
    first: ConstantsEvaluation | None
    last: ConstantsEvaluation | None
    kept: pd.DataFrame

    @property
    def notes(self) -> list[Note]:
        """Return notes for a reader of the constants."""
        c = self.chosen.constants
        notes = []
        if not c.stable:
            words = (
                f"nu_warp nu_fill is {c.nu_warp * c.nu_fill:.3g}: a fabric with these constants "
                "has no stable strain; no program takes them"
            )
            notes.append(Note(UNSTABLE, words, self.test))
        for name, values in self.spread.items():
            low, high = values
            if not low > 0 or high / low > WIDE:
                words = (
                    f"{name} lies between {low:.4g} and {high:.4g} by what is evaluated: say which "
                    "options are meant wherever the constants are given"
                )
                notes.append(Note(UNCERTAIN, words, self.test))
        words = f"{self.test} pulls along the yarns only: it says nothing about the shear stiffness"
        return [*notes, Note(UNMATCHED, words)]

    @property
    def spread(self) -> dict[str, tuple[float, float]]:
        """Return the least and largest of each constant over all options."""
        ends = designers.spread_of((self.chosen, *self.others))
        return {NAMES[name]: pair for name, pair in ends.items()}


def evaluate_test(test: BiaxialTest, options: Options = USUAL) -> BiaxialEvaluation:
    """Return the constants of a test by some options, beside those of all others."""
    paths = test.paths
    lines = tuple(line_of(path.ratio, path.load, path.since) for path in paths)
    measured = [line.ratio for line in lines]
    missing = [ratio for ratio in options.ratios if ratio not in measured]
    if missing:
        problem = f"there is no ratio {', '.join(missing)}; the test has: {', '.join(measured)}"
        raise test.place.error("ratios", problem)
    with test.place.naming(field="data"):
        chosen = designers.evaluate(lines, options)
    kept_strains = []
    for table, cycles in zip(test.tables, test.cycles, strict=True):
        away = np.abs(table.load - table.load[0]).max(axis=1)
        threshold = BACK * float(np.ptp(table.load.max(axis=1)))
        for _, phase in groupby(cycles, key=lambda cycle: cycle.phase):
            cycles_of_phase = list(phase)
            last = cycles_of_phase[-1]
            later = [cycle.first for cycle in cycles if cycle.first > last.last]
            stop = (later[0] if later else len(table.load) - 1) + 1
            back = last.last + int(np.argmin(away[last.last : stop]))
            kept_before, kept_after = (
                PERCENT * (table.strain[row] - table.strain[0])
                if away[row] <= threshold
                else NEITHER
                for row in (cycles_of_phase[0].first, back)
            )
            row = {"file": table.path.name, "phase": last.phase, "ratio": last.ratio}
            strains = _by_yarn(
                before_percent=kept_before, after_percent=kept_after, load_kN_per_m=table.load[0]
            )
            kept_strains.append({**row, "cycles": len(cycles_of_phase), **strains})
    alternatives = tuple(designers.evaluate_others(lines, options))
    ends = _of_cycle(test, 1, options), _of_cycle(test, "last", options)
    strain = pd.DataFrame(kept_strains)
    return BiaxialEvaluation(test.name, paths, lines, chosen, alternatives, *ends, strain)


def _of_cycle(test: BiaxialTest, cycle: Which, options: Options) -> ConstantsEvaluation | None:
    """Return the paths of another cycle of the same ratios, without conditioning."""
    section = test.section
    ratios = [path.ratio for path in test.paths]
    paths = evaluated_paths(test.tables, test.cycles, cycle, section.conditioning, ratios)
    with suppress(InputError):
        if section.range is not None:
            paths = [path.between(*section.range) for path in paths]
        return designers.evaluate([line_of(p.ratio, p.load, p.since) for p in paths], options)
    return None


CONVENTION = (
    "nu_warp: contraction of the warp per strain of the fill when the fill is pulled (nu_xy beside "
    "E_x, x the warp); nu_fill: of the fill when the warp is pulled"
)


def in_words(options: Options) -> str:
    """Return a description of what was evaluated."""
    unloaded = "with" if options.unloaded else "without"
    reciprocal = "reciprocal" if options.reciprocal else "free"
    ratios = f", {' and '.join(options.ratios)} only" if options.ratios else ""
    return f"least squares of {options.minimise}s, {reciprocal}, {unloaded} unloaded yarns{ratios}"


def standard_table(evaluation: BiaxialEvaluation) -> pd.DataFrame:
    """Return what a report after EN 17117-1 lists: a row a phase of load cycles, then all together.
    Stiffness: change of a yarn's load over that of its strain along the loading that is evaluated;
    Poisson's ratios of one ratio where the other yarn is unloaded. NaN where it is neither."""
    evaluated = {
        (path.table.path.name, path.cycle.phase): (path, line)
        for path, line in zip(evaluation.paths, evaluation.lines, strict=True)
    }
    table = []
    for k in evaluation.kept.to_dict("records"):
        path, line = evaluated.get((k["file"], k["phase"]), (None, None))
        row: dict[str, object] = {"file": k["file"], "ratio": k["ratio"]}
        row["load_cycles"] = k["cycles"]
        row["cycle_evaluated"] = "" if path is None else str(path.cycle.number)
        ends = path.load[[0, -1]] if path is not None else (NEITHER, NEITHER)
        stiff = NEITHER.copy()
        nu = NEITHER.copy()
        if line is not None:
            for yarn, unloaded in enumerate(line.unloaded):
                if not unloaded and line.strain[yarn] > SMALLEST_STRAIN:
                    stiff[yarn] = line.load[yarn] / line.strain[yarn]
                if unloaded and line.strain[1 - yarn] > SMALLEST_STRAIN:
                    nu[yarn] = -line.strain[yarn] / line.strain[1 - yarn]
        table.append(
            row
            | _by_yarn(
                from_kN_per_m=ends[0],
                to_kN_per_m=ends[1],
                stiffness_kN_per_m=stiff,
                poisson=nu,
                strain_kept_percent=(k["warp_after_percent"], k["fill_after_percent"]),
            )
        )
    c = evaluation.chosen.constants
    count = int(evaluation.kept["cycles"].sum())
    row = {"file": "", "ratio": "all", "load_cycles": count, "cycle_evaluated": ""}
    together = _by_yarn(stiffness_kN_per_m=(c.warp, c.fill), poisson=(c.nu_warp, c.nu_fill))
    return pd.DataFrame([*table, row | together])


def _by_yarn(**pairs: ArrayLike) -> dict[str, float]:
    """Return pairs (warp, fill) by their names, each with its yarn's before it."""
    return {
        f"{yarn}_{name}": float(value)
        for name, pair in pairs.items()
        for yarn, value in zip(("warp", "fill"), np.asarray(pair), strict=True)
    }


#: File of the table after EN 17117-1.
STANDARD = "en-17117"


def tables_of(evaluation: BiaxialEvaluation) -> dict[str, pd.DataFrame]:
    """Return all tables by name: constants E, A (direct form), kN/m; squares of strain, %^2."""
    named = [
        ("chosen", evaluation.chosen),
        *(("", alternative) for alternative in evaluation.others),
    ]
    ends = {"first cycle": evaluation.first, "last cycle": evaluation.last}
    named += [
        (cycle, alternative) for cycle, alternative in ends.items() if alternative is not None
    ]
    options = [{"what": name, **designers.row_of(alternative)} for name, alternative in named]
    table = []
    for path, line in zip(evaluation.paths, evaluation.lines, strict=True):
        row = {
            "ratio": path.ratio,
            "file": path.table.path.name,
            "cycle": path.cycle.number,
            "cycles": path.cycles,
            "readings": len(path.load),
            "from_kN_per_m": float(path.larger[0]),
            "to_kN_per_m": float(path.larger[-1]),
        }
        row |= _by_yarn(
            load_change_kN_per_m=line.load,
            strain_change_percent=PERCENT * np.asarray(line.strain),
            rms_about_line_percent=PERCENT * np.asarray(line.residual),
        )
        table.append(row | {"rms_of_constants_percent": evaluation.chosen.rms[path.ratio]})
    return {
        "constants": pd.DataFrame(options),
        STANDARD: standard_table(evaluation),
        "lines": pd.DataFrame(table),
        "kept": evaluation.kept,
    }


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
    lines.append(f"  over {1 + len(evaluation.others)} choices of what is evaluated:")
    for name, (low, high) in evaluation.spread.items():
        lines.append(f"    {name} {low:.4g} to {high:.4g}")
    if evaluation.first is not None and evaluation.last is not None:
        of_first = evaluation.first.constants
        two = evaluation.last.constants
        lines.append(
            f"  first cycles: E warp {of_first.warp:.4g}, E fill {of_first.fill:.4g} kN/m; "
            f"last cycles: {two.warp:.4g}, {two.fill:.4g} kN/m"
        )
    back = evaluation.kept.dropna(subset="warp_after_percent").to_dict("records")
    return lines + [
        "  strain kept after {ratio}, the last that comes back to the loads of the beginning "
        "({warp_load_kN_per_m:.3g} and {fill_load_kN_per_m:.3g} kN/m): warp "
        "{warp_after_percent:.3g} %, fill {fill_after_percent:.3g} %".format_map(last)
        for last in back[-1:]
    ]


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
        "notes": note_records(evaluation.notes),
    }
