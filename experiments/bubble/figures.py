"""What a bubble test puts on the page of a fit: cuts, heights, the inflated surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...reports import plot_heights, plot_profiles
from ...reports.content import Part
from ..exhibit import Exhibit, Output, Shown
from ..fittable import Findings, FittedTest
from .charts import profile_charts, residual_chart
from .correlation_record import correlation_table
from .findings import objective_of, recorded_of
from .inflated import at_nodes, write_series
from .maps import field_maps
from .objective import displacement_offset
from .recorded_words import clock_pictures, recorded_table
from .registration import registration_picture, registration_table
from .sheet_report import fitted_model, sheet_exhibit, sheet_lines
from .solid import bubble_solid
from .tables import misfit_table, surface_tables, write_surface_table

if TYPE_CHECKING:
    from .prepared import PreparedBubble

Array = NDArray[np.float64]

PROFILES, HEIGHTS, SERIES = "profiles.png", "heights.png", "bubble.pvd"


def exhibit(
    prepared: PreparedBubble, fitted: FittedTest, findings: Findings, out: Output
) -> Exhibit:
    """Write the figures, surfaces.csv and bubble.pvd with its files."""
    files = [
        *write_surface_table(prepared, out),
        (out.name(SERIES), "the inflated bubble pressure by pressure, for ParaView"),
    ]
    left = left_at_nodes(fitted)
    write_series(fitted_model(fitted), fitted.histories[0], fitted.law, out.path(SERIES), left)
    of_sheet = sheet_exhibit(prepared, fitted, out)
    files += [*_pictures(prepared, fitted, out), *of_sheet[1]]
    figures = list(of_sheet[0])
    tables = [misfit_table(prepared, fitted), *surface_tables(prepared)]
    if prepared.registration is not None:
        figures.append(registration_picture(prepared.fields, prepared.test.outline, out))
        tables.insert(0, registration_table(prepared.registration))
    taken = recorded_of(prepared)
    if taken is not None:
        tables.insert(0, recorded_table(taken))
        figures += clock_pictures(taken, out)
    parts: list[Part] = [
        profile_charts(prepared, fitted),
        field_maps(prepared, fitted),
        bubble_solid(prepared, fitted, left),
        residual_chart(prepared, fitted),
    ]
    record = correlation_table(prepared)
    return Exhibit(_facts(prepared, findings), figures, tables, files, parts, record)


def left_at_nodes(fitted: FittedTest) -> list[Array | None]:
    """(nodes, 3) mm a reported pressure, measured less modelled; None where nothing is matched."""
    objective, history = objective_of(fitted), fitted.histories[0]
    nodes = fitted.comparisons[0].model.mesh.points[:, :2]
    left: list[Array | None] = [None] * len(history.displacement)
    differences = objective.differences(history.displacement, fitted.nuisance)
    for number, (target, off) in enumerate(zip(objective.targets, differences, strict=True)):
        frame = number if target.frame is None else target.frame
        left[frame] = at_nodes(nodes, target.at(nodes), -off)
    return left


def _pictures(prepared: PreparedBubble, fitted: FittedTest, out: Output) -> list[Shown]:
    """Cuts and heights against what was measured, as pictures beside the page."""
    test, offset = prepared.test, displacement_offset(fitted.nuisance)
    displacement = fitted.histories[0].displacement
    label = "known solution" if prepared.known is not None else "measured"
    plot_profiles(
        out.path(PROFILES),
        test.pressures,
        fitted.comparisons[0].model.mesh.points,
        displacement + offset,
        measured=[(f.points, f.displacement) for f in prepared.fields],
        measured_label=label,
    )
    objective = objective_of(fitted)
    targets, modelled = objective.targets, objective.modelled(displacement, fitted.nuisance)
    plot_heights(
        out.path(HEIGHTS),
        [t.pressure for t in targets],
        [t.displacement[:, 2] for t in targets],
        [own[:, 2] for own in modelled],
        label,
    )
    return [
        (out.name(PROFILES), f"{test.name}: cuts through the bubble along warp and fill"),
        (out.name(HEIGHTS), f"{test.name}: modelled against measured height"),
    ]


def _facts(prepared: PreparedBubble, findings: Findings) -> list[tuple[str, object]]:
    numbers = findings.numbers
    facts: list[tuple[str, object]] = [("mean |dx| + |dy| + |dz|, mm", numbers["mean_abs_mm"])]
    dropped = numbers["data"]["doubtful_dropped"], numbers["data"]["outside_dropped"]
    if any(dropped):
        facts.append(("points left out", f"{dropped[0]} doubtful, {dropped[1]} beyond the rim"))
    shift, pressure = numbers["nuisance"].values()
    if shift is not None:
        facts.append(("displacement offset, mm", ", ".join(f"{v:.3f}" for v in shift)))
    if pressure is not None:
        facts.append(("pressure offset, kPa", f"{pressure:.3f}"))
    (sheet,) = sheet_lines(numbers["sheet"])
    facts.append(("sheet", sheet.removeprefix("sheet: ")))
    return facts
