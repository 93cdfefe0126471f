"""Write the table of runs of bent cylinders for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ...notes import marks_of
from ..predicted import PredictedRun
from .measures import BendingMeasures

Sigmas = Mapping[str, float | None]


def describe_load(load: float | None, sigma: float | None, unit: str = "") -> str:
    """Return a load (N) in words, with one standard deviation (N) where it is known."""
    if load is None:
        return "-"
    return f"{load:.0f}{unit}" if sigma is None else f"{load:.0f} ± {sigma:.2g}{unit}"


def describe_runs(
    runs: Sequence[PredictedRun],
    places: Sequence[str],
    measures: Mapping[int, BendingMeasures],
    sigmas: Mapping[int, Sigmas],
    ends: Sequence[str],
    has_spreads: bool,
) -> list[str]:
    """Return the lines of a table: stiffness, knee, limit point, loads and error of each run.

    Parameters
    ----------
    runs : sequence of PredictedRun
    places : sequence of str
        Names of the places at which loads are listed.
    measures : mapping of int to BendingMeasures
        Evaluation of the runs that did not fail, by their index in `runs`.
    sigmas : mapping of int to mapping of str to float or None
        Standard deviations of the loads, N, by the same index and by place.
    ends : sequence of str
        How each run ended.
    has_spreads : bool
        Whether any load has a standard deviation.
    """
    header, *names = _padded_names(runs)
    points = {i: (m.describe(m.knee), m.describe(m.limit)) for i, m in measures.items()}
    point_columns = list(zip(("knee", "limit point"), *points.values(), strict=False))
    point_widths = [max(map(len, column)) + 2 for column in point_columns]
    load_widths = [max(len(place), 13 if has_spreads else 7) + 2 for place in places]
    has_errors = any(m.error is not None for m in measures.values())

    header += "   N/mm" + _right_aligned((column[0] for column in point_columns), point_widths)
    header += _right_aligned(places, load_widths) + ("   error" if has_errors else "")
    lines = [header]
    for i, run in enumerate(runs):
        if i not in measures:
            lines.append(f"{names[i]}  {ends[i]}")
            continue
        m = measures[i]
        loads = [describe_load(m.loads.get(p), sigmas[i].get(p), " N") for p in places]
        stiffness = "-" if m.stiffness is None else f"{m.stiffness:.2f}"
        line = f"{names[i]} {stiffness:>6}"
        line += _right_aligned(points[i], point_widths) + _right_aligned(loads, load_widths)
        if has_errors:
            line += f"{_describe_error(m):>8}"
        lines.append("  ".join([line, *_remarks(run, ends[i])]))
    return lines


def _remarks(run: PredictedRun, end: str) -> list[str]:
    """Return how a run ended, where that was early, and the kinds of its marked notes."""
    remarks = [end] if run.record.early else []
    marked = marks_of(run.notes)
    return [*remarks, f"[{', '.join(marked)}]"] if marked else remarks


def _describe_error(measures: BendingMeasures) -> str:
    """Return the RMS error over the largest measured load; "-" without measured loads."""
    return "-" if measures.error is None else f"{100 * measures.error.relative:.1f} %"


def _padded_names(runs: Sequence[PredictedRun]) -> list[str]:
    """Return the header, then test, card and wall of each run, in columns."""
    count = 3 if any(run.wall for run in runs) else 2
    rows = [("test", "card", "wall"), *((run.test.name, run.card, run.wall) for run in runs)]
    rows_shown = [row[:count] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows_shown, strict=True)]
    return [
        "  ".join(f"{name:<{width}}" for name, width in zip(row, widths, strict=True))
        for row in rows_shown
    ]


def _right_aligned(cells: Iterable[str], widths: Sequence[int]) -> str:
    """Return cells as one line, each at the right end of its column."""
    return "".join(f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
