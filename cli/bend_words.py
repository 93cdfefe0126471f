"""The lines that `bubblefit bend` prints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..studies.bend_measures import PLACES


def bend_lines(result: Mapping[str, Any]) -> list[str]:
    """The table for the terminal, then the statements that do not hold, or not in all cases."""
    runs = result["runs"]
    compared = any(r.get("error") for r in runs)
    wide = max(len(r["case"]) for r in runs), max(len(r["card"]) for r in runs)
    head = f"{'case':<{wide[0]}}  {'card':<{wide[1]}}   N/mm   buckles at"
    head += "".join(f"{f'{p:g} mm':>9}" for p in PLACES) + ("   error" if compared else "")
    lines = [head]
    for run in runs:
        start = f"{run['case']:<{wide[0]}}  {run['card']:<{wide[1]}}"
        if "stiffness_N_per_mm" not in run:
            lines.append(f"{start}  {run['ended']}")
            continue
        point = run["buckling"]
        place = "-"
        if point["load_N"] is not None:
            place = f"{point['load_N']:.0f} N {point['deflection_mm']:.0f} mm"
        stiff = run["stiffness_N_per_mm"]
        text = f"{start} {'-' if stiff is None else f'{stiff:.2f}':>6} {place:>13}"
        for load in run["load_N"].values():
            text += "        -" if load is None else f"{load:>7.0f} N"
        if compared:
            error = run["error"]
            text += "       -" if error is None else f"{100 * error['relative']:>6.1f} %"
        if run["ended"] != "finished":
            text += f"  {run['ended']}"
        lines.append(text)
    checked = [s for s in result["statements"] if s["verdict"] != "not checked"]
    if checked:
        holds = sum(s["verdict"] == "holds" for s in checked)
        lines.append(f"statements of the thesis: {holds} of {len(checked)} checked hold")
        lines += [
            f"  {s['verdict']}: {s['thesis']}: {s['found']}"
            for s in checked
            if s["verdict"] != "holds"
        ]
    return lines
