"""Presenter of biaxial tests: strains over load at each load ratio, and elastic constants."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ...errors import SolverFailure
from ...experiments.base import UNMATCHED, Findings, FittedTest
from ...experiments.biaxial import BiaxialKind, BiaxialTest
from ...experiments.biaxial.evaluation import (
    CONVENTION,
    NAMES,
    STANDARD,
    BiaxialEvaluation,
    in_words,
    tables_of,
)
from ...experiments.biaxial.prepared import PathObjective, PreparedBiaxial
from ...experiments.data_files import READING, Output
from ...experiments.forward import Cards, Runs, Simulation, by_strain, strains_of
from ...experiments.measured import PERCENT, FittedPart, compared
from ...lazy_modules import pandas as pd
from ...materials.designers import row_of
from ...meshes.strip_models import elongations
from ...notes import Note
from ...presenting import KINDS
from ...solvers.base import Array
from ..charts import Charts
from ..content import Exhibit, Table
from ..presenter import PagePresenter
from ..strips import YARNS, ratio_chart
from ..vega import save, saved

#: Descriptions of the tables that `bubblefit biaxial` writes, by name of the file.
CONTENT = {
    "constants": "constants by every choice, of first and last cycles",
    STANDARD: "ratios, load cycles, stiffness and strain kept, after EN 17117-1",
    "lines": "regression lines of every ratio",
    "kept": "strain kept before and after each ratio",
}


def misfit_table(paths: Sequence[FittedPart]) -> Table:
    """Return a table of the RMS errors of strain, with one row for each load ratio."""
    rows = [
        [
            path.ratio,
            *rms,
            f"{path.cycle.number} of {path.cycle_count}",
            len(path.load) - PathObjective.first_row,
            *path.larger[[0, -1]],
            *(PERCENT * path.residual),
        ]
        for path, rms in ((p.data, p.rms) for p in paths)
    ]
    header = [
        "ratio",
        "RMS error warp, %",
        "RMS error fill, %",
        "cycle",
        "points matched",
        "from load, kN/m",
        "to load, kN/m",
        "strain kept before it, warp, %",
        "fill, %",
    ]
    note = (
        "RMS error: root mean square of modelled less measured strain since the beginning of the "
        "loading; loads: the larger of both"
    )
    return Table("Misfit by ratio", header, rows, note, text=(0, 3))


def _columns(values: Array, name: str) -> dict[str, Array]:
    """Return the columns of values (n, 2) along the yarns by name."""
    return {f"{yarn}_{name}": values[:, k] for k, yarn in enumerate(YARNS)}


def simulate(
    test: BiaxialTest, cards: Cards, runs: Runs, out: Output, within_range: bool = False
) -> Simulation:
    """Write paths.csv and paths.png of analyses with cards; return the RMS errors by card.

    With `within_range` each curve is shown only up to the end of the card's valid range.
    """
    numbers: dict[str, Any] = {name: {"ratios": {}} for name in cards}
    tables = []
    panels = []
    lines = []
    errors: dict[str, float] = {}
    for path in test.paths:
        curves = []
        for name, card in cards.items():
            outcome = runs[name, path.ratio].outcome
            ratios = numbers[name]["ratios"]
            if isinstance(outcome, SolverFailure):
                ratios[path.ratio] = {"failed": outcome.reason}
                lines.append(f"{name}: ratio {path.ratio} failed: {outcome.reason}")
                continue
            strains = elongations(outcome.displacement)
            is_beyond = (np.log1p(strains) > card.law.strain_range[:2] * (1 + 1e-6)).any(axis=1)
            count = np.argmax(is_beyond) if within_range and is_beyond.any() else len(strains)
            larger = path.larger[:count]
            strain = PERCENT * (strains - strains[0])[:count]
            columns = _columns(path.load[:count], "load_kN_per_m")
            columns |= _columns(strain, "strain_percent")
            tables.append(pd.DataFrame({"card": name, "ratio": path.ratio, **columns}))
            warp = None
            fill = None
            end = 0.0
            if count:
                curves.append((name, larger, strain))
                end = larger[-1]
            off = (strain - PERCENT * path.strain_change[:count])[PathObjective.first_row :]
            if len(off):
                warp, fill = np.sqrt(np.mean(off**2, axis=0)).tolist()
                relative = max(warp, fill) / (PERCENT * np.abs(path.strain_change).max())
                errors[name] = max(relative, errors.get(name, 0.0))
                lines.append(
                    f"{name}: ratio {path.ratio}: RMS of strain {warp:.3g} % along warp, "
                    f"{fill:.3g} % along fill, to {end:.3g} kN/m"
                )
            ratios[path.ratio] = {
                "rms_warp_percent": warp,
                "rms_fill_percent": fill,
                "shown_to_kN_per_m": end,
                "strain_reached": by_strain(strains_of(outcome)),
            }
        panels.append(ratio_chart(path.ratio, path.larger, PERCENT * path.strain_change, curves))
    if tables:
        out.write("paths.csv", pd.concat(tables))
    charts = Charts("ratios", panels, "Strain over the larger load")
    save(out.path("paths.png"), charts)
    return Simulation({"cards": numbers}, lines, [charts], errors)


def findings(prepared: PreparedBiaxial, fitted: FittedTest) -> Findings:
    """Return what the best fit means for the test: RMS errors, warnings, words."""
    paths = prepared.fitted_parts(fitted)
    numbers = {}
    for p in paths:
        warp, fill = p.rms.tolist()
        numbers[p.data.ratio] = {
            "rms_warp_percent": warp,
            "rms_fill_percent": fill,
            "matched": len(p.data.load) - PathObjective.first_row,
            "cycle": p.data.cycle.number,
            "cycles": p.data.cycle_count,
            "end_load_warp_kN_per_m": p.data.load[-1, 0],
            "end_load_fill_kN_per_m": p.data.load[-1, 1],
            "residual_warp_percent": 100 * p.data.residual[0],
            "residual_fill_percent": 100 * p.data.residual[1],
        }
    errors = ", ".join(f"{p.data.ratio} {p.rms[0]:.3g} / {p.rms[1]:.3g}" for p in paths)
    summary = f"RMS errors of strain along warp / fill in %: {errors}"
    words = (
        f"{prepared.test.name} pulls along the yarns only: it says nothing of G12, which rests on "
        "other tests or stays where its fit began"
    )
    reader_notes = dict.fromkeys(
        note for table in prepared.test.tables for note in table.source.notes
    )
    notes = Note(UNMATCHED, words), *(Note(READING, words) for words in reader_notes)
    return Findings({"ratios": numbers}, notes, (summary,), summary, summary)


def fitted_paths(prepared: PreparedBiaxial, fitted: FittedTest) -> Charts:
    """Return charts of strain over load, measured and modelled, one for each load ratio."""
    panels = []
    for p in prepared.fitted_parts(fitted):
        curve = ("model", p.data.larger, PERCENT * p.objective.modelled(p.history))
        strain = PERCENT * p.objective.strain
        panels.append(ratio_chart(p.data.ratio, p.data.larger, strain, (curve,)))
    caption = "Strain over the larger load: measured and modelled"
    return Charts(f"{prepared.test.name} ratios", panels, caption)


def show(prepared: PreparedBiaxial, fitted: FittedTest, findings: Findings, out: Output) -> Exhibit:
    """Write paths.csv and the figure of the ratios; return them and a table of the misfit."""
    paths = prepared.fitted_parts(fitted)
    parts = []
    for p in paths:
        columns = _columns(p.data.load, "load_kN_per_m")
        columns |= _columns(PERCENT * p.objective.strain, "strain_percent")
        columns |= _columns(PERCENT * p.objective.modelled(p.history), "model_percent")
        parts.append(pd.DataFrame({"ratio": p.data.ratio, **columns}))
    charts = fitted_paths(prepared, fitted)
    facts = [("ratios matched", ", ".join(p.data.ratio for p in paths))]
    files = [
        out.write(
            "paths.csv", pd.concat(parts), "loads and strains of every ratio, measured and modelled"
        ),
        saved(out, "paths.png", charts, "picture of the ratios"),
    ]
    return Exhibit(facts=facts, tables=[misfit_table(paths)], files=files, parts=[charts])


def examine(prepared: PreparedBiaxial, out: Output) -> Exhibit:
    """Draw the loadings that are evaluated; return them and a table of all cycles as read."""
    test = prepared.test
    panels = [ratio_chart(p.ratio, p.larger, PERCENT * p.strain_change) for p in test.paths]
    charts = Charts("ratios", panels, "")
    used = {(id(path.table), path.cycle.number_in_file) for path in test.paths}
    rows = []
    for read, cycles in zip(test.tables, test.cycles, strict=True):
        for cycle in cycles:
            kept_strain = PERCENT * (read.strain[cycle.first] - read.strain[0])
            mark = "yes" if (id(read), cycle.number_in_file) in used else ""
            rows.append(
                [
                    read.name,
                    cycle.number_in_file,
                    cycle.ratio,
                    cycle.number,
                    *read.load[cycle.last],
                    *kept_strain,
                    mark,
                ]
            )
    header = [
        "file",
        "cycle",
        "ratio",
        "of its ratio",
        "top load warp, kN/m",
        "fill, kN/m",
        "strain kept before it, warp, %",
        "fill, %",
        "evaluated",
    ]
    table = Table("Cycles as read", header, rows, text=(0, 2, 8))
    words = "the loading of each ratio that is evaluated"
    figures = [saved(out, "biaxial.png", charts, words)]
    return Exhibit(figures=figures, tables=[table])


def residuals(prepared: PreparedBiaxial, fitted: FittedTest) -> pd.DataFrame:
    """Return a table of every matched strain, %, measured and modelled, with its loads."""
    parts = []
    for p in prepared.fitted_parts(fitted):
        measured = PERCENT * p.objective.strain
        modelled = PERCENT * p.objective.modelled(p.history)
        loads = _columns(p.data.load[1:], "load_kN_per_m")
        for k, yarn in enumerate(YARNS):
            values = measured[1:, k], modelled[1:, k]
            where = {"part": p.data.ratio, **loads}
            parts.append(compared(f"{yarn}_strain", *values, "%", **where))
    return pd.concat(parts, ignore_index=True)


#: Headings of the columns of the table according to EN 17117-1.
STANDARD_HEADER = (
    "file",
    "ratio",
    "load cycles",
    "cycle evaluated",
    "from, warp, kN/m",
    "fill, kN/m",
    "to, warp, kN/m",
    "fill, kN/m",
    "stiffness, warp, kN/m",
    "fill, kN/m",
    "Poisson's ratio nu_warp",
    "nu_fill",
    "strain kept, warp, %",
    "fill, %",
)


def constants_table(evaluation: BiaxialEvaluation) -> Table:
    """Return a table of the elastic constants with their ranges.

    Each constant stands beside its least and largest value over all choices of what is evaluated,
    and its values from the first and from the last cycles.
    """
    chosen = row_of(evaluation.chosen)
    named = {
        name: name.removesuffix("_kN_per_m").replace("_", " ").replace("nu ", "nu_")
        for name in chosen
        if name.startswith(("E_", "nu_", "A_"))
    }
    choices = pd.DataFrame([chosen, *map(row_of, evaluation.alternatives)])
    ends = [
        None if of_cycle is None else row_of(of_cycle)
        for of_cycle in (evaluation.first_cycle, evaluation.last_cycle)
    ]
    rows = [
        [
            words,
            "kN/m" if key.endswith("_m") else "–",
            chosen[key],
            choices[key].min(),
            choices[key].max(),
            *(end and end[key] for end in ends),
        ]
        for key, words in named.items()
    ]
    header = [
        "constant",
        "unit",
        "value",
        "least of all choices",
        "largest",
        "of first cycles",
        "of last cycles",
    ]
    note = (
        f"Evaluated: {in_words(evaluation.chosen.options)}, {evaluation.chosen.paths} strain "
        f"paths; the ends are over {1 + len(evaluation.alternatives)} choices of what is "
        f"evaluated. E and nu: inverse form, A: direct form. {CONVENTION}. "
        "A biaxial test says nothing of the shear stiffness."
    )
    return Table("Constants per width", header, rows, note, text=(1,))


def show_constants(evaluation: BiaxialEvaluation, out: Output) -> Exhibit:
    """Write the tables of an evaluation as CSV, and constants.png; return them for the page."""
    tables = tables_of(evaluation)
    files = [out.write(f"{name}.csv", table, CONTENT[name]) for name, table in tables.items()]
    panels = []
    for measured in evaluation.paths:
        load = measured.load
        strain = PERCENT * evaluation.chosen.constants.strain(load - load[0])
        curves = (("constants", measured.larger, strain),)
        measured_curve = PERCENT * measured.strain_change
        panels.append(ratio_chart(measured.ratio, measured.larger, measured_curve, curves))
    caption = "Strain over the larger load: measured, and by the constants"
    charts = Charts(f"{evaluation.test} constants", panels, caption)
    files.append(saved(out, "constants.png", charts, "picture of the ratios"))
    note = (
        "Stiffness: change of a yarn's load over that of its strain, along the cycle evaluated; "
        "its Poisson's ratio where it is unloaded. Strain kept: after the load cycles, at the "
        "loads of the first row. Last row: the constants that serve all ratios."
    )
    rows = tables[STANDARD].to_numpy().tolist()
    standard = Table("Report after EN 17117-1", STANDARD_HEADER, rows, note, text=(1, 3))
    rows = [
        [
            in_words(alternative.options),
            alternative.paths,
            *(getattr(alternative.constants, n) for n in NAMES),
            alternative.squares,
        ]
        for alternative in (evaluation.chosen, *evaluation.alternatives)
    ]
    header = ["what", "paths", "E warp, kN/m", "E fill, kN/m", "nu_warp", "nu_fill", "squares, %²"]
    choice = Table("Every choice", header, rows, "The first is the one chosen.")
    return Exhibit(
        tables=[constants_table(evaluation), standard], files=files, parts=[charts], record=[choice]
    )


class BiaxialPresenter(PagePresenter):
    """Presenter of biaxial tests."""

    findings = staticmethod(findings)
    residuals = staticmethod(residuals)
    simulate = staticmethod(simulate)
    show = staticmethod(show)
    examine = staticmethod(examine)
    charts = MappingProxyType({"loads": fitted_paths})


KINDS.register(BiaxialKind, BiaxialPresenter())
