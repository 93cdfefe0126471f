"""The tables of bent cylinders: rows of runs, curves, what was measured, and for the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from ...data.bending_scatter import scatter
from ...notes import marks
from ..predicted import PredictedRun
from .measures import BendingMeasures
from .record import BendingRun
from .test import CylinderTest

CURVE = ("deflection_mm", "load_N", "gauge_pressure_kPa", "volume_mm3", "wrinkled_share")
MEASURED = ("test", "deflection_mm", "mean_N", "standard_deviation_N", "repetitions")


def columns_of(m: BendingMeasures | None, places: Sequence[str]) -> Mapping[str, object]:
    """A row of the table of runs; None where a run does not tell, or failed."""
    error = None if m is None else m.error
    row: dict[str, object] = {"stiffness_N_per_mm": m and m.stiffness}
    for name in ("knee", "limit", "wrinkles"):
        point = (getattr(m, name) if m else None) or (None, None)
        row |= {f"{name}_mm": point[0], f"{name}_N": point[1]}
    row |= {f"load_at_{p.replace(' ', '_')}_N": m and m.loads[p] for p in places}
    body = m.body_strain if m else (None, None)
    return row | {
        "inflation_warp_strain": body[0],
        "inflation_fill_strain": body[1],
        "pressure_rise_kPa": m and m.pressure_rise,
        "rms_N": error and error.rms,
        "rms_relative": error and error.relative,
        "mean_error_N": error and error.mean,
        "compared": error and error.compared,
        "reached_mm": m and m.reached,
    }


def curve_of(run: BendingRun | None) -> pd.DataFrame:
    """A run frame by frame; no rows where it failed."""
    if run is None:
        return pd.DataFrame({name: np.empty(0) for name in CURVE})
    share = run.wrinkled if len(run.wrinkled) else np.full(len(run.load), np.nan)
    values = (run.deflection, run.load, 1e3 * run.pressure, run.volume, share)
    return pd.DataFrame(dict(zip(CURVE, values, strict=True)))


def measured_table(tests: Sequence[CylinderTest]) -> pd.DataFrame:
    """Mean and scatter of the repetitions on a grid, of the tests that were measured."""
    parts = []
    for test in tests:
        if test.measured:
            s = scatter(test.measured)
            values = ([test.name] * len(s.mean), s.deflection, s.mean, s.deviation, s.count)
            parts.append(pd.DataFrame(dict(zip(MEASURED, values, strict=True))))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(MEASURED))


def place_names(tests: Sequence[CylinderTest]) -> list[str]:
    """Where loads are listed, of all tests, each once."""
    return list(dict.fromkeys(name for test in tests for name in test.reading.places))


def load_words(load: float | None, sigma: float | None, unit: str = "") -> str:
    """A load (N), with one standard deviation where it is known."""
    if load is None:
        return "-"
    return f"{load:.0f}{unit}" if sigma is None else f"{load:.0f} ± {sigma:.2g}{unit}"


def terminal_table(
    runs: Sequence[PredictedRun],
    measures: Mapping[int, BendingMeasures],
    ended: Sequence[str],
    sigma: Mapping[int, Mapping[str, float | None]] | None = None,
) -> list[str]:
    """Stiffness, buckling, loads and errors, run by run; sigma : of the loads, N, by number."""
    spreads = sigma or {}
    places = place_names([run.test for run in runs])
    widths = [max(len(p), 13 if spreads else 7) + 2 for p in places]
    compared = any(m.error is not None for m in measures.values())
    count = 3 if any(run.wall for run in runs) else 2
    rows = [("test", "card", "wall"), *((run.test.name, run.card, run.wall) for run in runs)]
    names = [row[:count] for row in rows]
    wide = [max(map(len, column)) for column in zip(*names, strict=True)]
    starts = ["  ".join(f"{n:<{w}}" for n, w in zip(row, wide, strict=True)) for row in names]
    head = f"{starts.pop(0)}   N/mm   buckles at"
    head += "".join(f"{p:>{w}}" for p, w in zip(places, widths, strict=True))
    lines = [head + ("   error" if compared else "")]
    for i, run in enumerate(runs):
        start, m = starts[i], measures.get(i)
        if m is None:
            lines.append(f"{start}  {ended[i]}")
            continue
        at = f"{m.buckling[1]:.0f} N {m.buckling[0]:.0f} mm" if m.buckling else "-"
        text = f"{start} {'-' if m.stiffness is None else f'{m.stiffness:.2f}':>6} {at:>13}"
        for place, width in zip(places, widths, strict=True):
            load = m.loads.get(place)
            text += f"{load_words(load, spreads.get(i, {}).get(place), ' N'):>{width}}"
        if compared:
            text += f"{'-' if m.error is None else f'{100 * m.error.relative:.1f} %':>8}"
        words = [ended[i]] if run.record.early else []
        if marked := marks(run.notes):
            words.append(f"[{', '.join(marked)}]")
        lines.append("  ".join([text, *words]))
    return lines
