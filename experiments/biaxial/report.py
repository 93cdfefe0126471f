"""What a biaxial test puts on the page of a fit, and the files that it writes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from ...materials.law import HypoelasticLaw
from ...notes import Note, NoteKind
from ...reports.content import Table
from ...reports.strips import BiaxialPanel, biaxial_charts
from ...reports.vega import save
from ...writing import replacing
from ..kinds import Exhibit, Findings, Output
from .objective import PERCENT
from .prepared import FittedPath
from .test import BiaxialTest

YARNS = ("warp", "fill")


def misfit_table(paths: Sequence[FittedPath]) -> Table:
    """Misfit ratio by ratio."""
    rows: list[list[object]] = [
        [
            p.path.ratio, *p.rms, f"{p.path.cycle.number} of {p.path.cycles}", len(p.path.load),
            float(p.path.load[0].max()), float(p.path.load[-1].max()),
            *(PERCENT * p.path.residual).tolist(),
        ]
        for p in paths
    ]  # fmt: skip
    header = [
        "ratio", "RMS error warp, %", "RMS error fill, %", "cycle", "points matched",
        "from load, kN/m", "to load, kN/m", "strain kept before it, warp, %", "fill, %",
    ]  # fmt: skip
    note = (
        "RMS error: root mean square of modelled less measured strain since the beginning of the "
        "loading; loads: the larger of both"
    )
    return Table("Misfit by ratio", header, rows, note, text=(0, 3))


def path_table(paths: Sequence[FittedPath]) -> pd.DataFrame:
    """Loads and strains of every ratio, measured and modelled, since the beginning of the path."""
    parts = []
    for p in paths:
        measured, modelled = PERCENT * p.objective.strain, PERCENT * p.objective.modelled(p.history)
        parts.append(
            pd.DataFrame(
                {
                    "ratio": p.path.ratio,
                    "warp_load_kN_per_m": p.path.load[:, 0],
                    "fill_load_kN_per_m": p.path.load[:, 1],
                    "warp_strain_percent": measured[:, 0],
                    "fill_strain_percent": measured[:, 1],
                    "warp_model_percent": modelled[:, 0],
                    "fill_model_percent": modelled[:, 1],
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def residual_table(paths: Sequence[FittedPath]) -> pd.DataFrame:
    """Every matched strain: part, loads, quantity, measured, modelled, difference, unit."""
    parts = []
    for p in paths:
        measured, modelled = PERCENT * p.objective.strain, PERCENT * p.objective.modelled(p.history)
        for k, yarn in enumerate(YARNS):
            parts.append(
                pd.DataFrame(
                    {
                        "part": p.path.ratio,
                        "warp_load_kN_per_m": p.path.load[1:, 0],
                        "fill_load_kN_per_m": p.path.load[1:, 1],
                        "quantity": f"{yarn}_strain",
                        "measured": measured[1:, k],
                        "modelled": modelled[1:, k],
                        "difference": (modelled - measured)[1:, k],
                        "unit": "%",
                    }
                )
            )
    return pd.concat(parts, ignore_index=True)


CAPTION = "Strain over the larger load: measured and modelled"


def exhibit(
    test: BiaxialTest, paths: Sequence[FittedPath], law: HypoelasticLaw, out: Output
) -> Exhibit:
    """Write paths.csv and the picture of the ratios."""
    with replacing(out.path("paths.csv")) as path:
        path_table(paths).to_csv(path, index=False, float_format="%.9g")
    panels = [
        BiaxialPanel(
            p.path.ratio,
            p.path.load.max(axis=1),
            PERCENT * p.objective.strain,
            (("model", p.path.load.max(axis=1), PERCENT * p.objective.modelled(p.history)),),
        )
        for p in paths
    ]
    charts = biaxial_charts(f"{test.name} ratios", panels, CAPTION)
    save(out.path("paths.png"), charts)
    return Exhibit(
        facts=[("ratios matched", ", ".join(p.path.ratio for p in paths))],
        tables=[misfit_table(paths)],
        files=[
            (out.name("paths.csv"), "loads and strains of every ratio, measured and modelled"),
            (out.name("paths.png"), "picture of the ratios"),
        ],
        parts=[charts],
    )


def findings_of(test: BiaxialTest, paths: Sequence[FittedPath]) -> Findings:
    """Numbers and words of the best fit."""
    errors = ", ".join(f"{p.path.ratio} {p.rms[0]:.3g} / {p.rms[1]:.3g}" for p in paths)
    summary = f"RMS errors of strain along warp / fill in %: {errors}"
    return Findings(
        numbers={"ratios": {p.path.ratio: _numbers(p) for p in paths}},
        warnings=tuple(_warnings(test)),
        lines=(summary,),
        quality=summary,
        summary=summary,
    )


def _numbers(fitted: FittedPath) -> dict[str, Any]:
    path = fitted.path
    return {
        "rms_warp_percent": fitted.rms[0],
        "rms_fill_percent": fitted.rms[1],
        "matched": len(path.load),
        "cycle": path.cycle.number,
        "cycles": path.cycles,
        "end_load_warp_kN_per_m": float(path.load[-1, 0]),
        "end_load_fill_kN_per_m": float(path.load[-1, 1]),
        "residual_warp_percent": 100 * float(path.residual[0]),
        "residual_fill_percent": 100 * float(path.residual[1]),
    }


def _warnings(test: BiaxialTest) -> list[Note]:
    """What the data leave open before any fit."""
    words = (
        f"{test.name} pulls along the yarns only: it says nothing of G12, which rests on other "
        "tests or stays where its fit began"
    )
    notes = [Note(NoteKind.UNMATCHED, words)]
    said = dict.fromkeys(note for table in test.data.tables for note in table.source.notes)
    return notes + [Note(NoteKind.READING, words) for words in said]


PATHS = "biaxial.png"


def exhibit_examined(test: BiaxialTest, out: Output) -> Exhibit:
    """Write the paths that are evaluated; a table of all cycles."""
    panels = [
        BiaxialPanel(path.ratio, path.load.max(axis=1), PERCENT * path.since)
        for path in test.data.paths
    ]
    save(out.path(PATHS), biaxial_charts("ratios", panels))
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
