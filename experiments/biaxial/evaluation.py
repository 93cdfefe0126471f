"""Evaluate a biaxial test linearly: elastic constants for design, and how options change them.

Residual strain, for which a cutting pattern is compensated, is the strain before or after the
cycles of a phase less that of the file's first row, under the prestress. It is given only where the
loads are those of the first row.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...errors import InputError
from ...inference.reported import UNCERTAIN
from ...lazy_modules import pandas as pd
from ...materials import designers
from ...materials.designers import USUAL, ConstantsEvaluation, LinearPath, Options, line_of
from ...notes import Note, State, Verdict
from ...readers.biaxial import BiaxialTable
from ..fitted import UNMATCHED
from ..measured import PERCENT
from ..run_records import UNSTABLE
from .paths import BiaxialPath, CycleChoice, LoadCycle, evaluated_paths, phases_of
from .test import BiaxialTest

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
        where the loads are not those of the file's first row.
    """

    test: str
    paths: Sequence[BiaxialPath]
    lines: tuple[LinearPath, ...]
    chosen: ConstantsEvaluation
    alternatives: tuple[ConstantsEvaluation, ...]
    first_cycle: ConstantsEvaluation | None
    last_cycle: ConstantsEvaluation | None
    residual_strains: pd.DataFrame

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
    for table, cycles in zip(test.tables, test.cycles, strict=True):
        residual_strains += _residual_strains(table, cycles)
    return BiaxialEvaluation(
        test=test.name,
        paths=paths,
        lines=lines,
        chosen=chosen,
        alternatives=tuple(designers.evaluate_others(lines, options)),
        first_cycle=_of_cycle(test, 1, options),
        last_cycle=_of_cycle(test, "last", options),
        residual_strains=pd.DataFrame(residual_strains),
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
