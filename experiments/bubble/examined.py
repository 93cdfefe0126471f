"""What is seen of a bubble test before a fit: points, heights, equilibrium, axes, maps."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...reports import Table, plot_rises
from ..exhibit import Exhibit, Output, Shown
from .registration import registration_picture, registration_table

if TYPE_CHECKING:
    from .prepared import PreparedBubble

HEIGHTS = "rises.png"


def exhibit(prepared: PreparedBubble, out: Output) -> Exhibit:
    """Write the maps and the rise by pressure."""
    tables = [_frames(prepared)]
    if prepared.registration is not None:
        tables.insert(0, registration_table(prepared.registration))
    if prepared.view.apexes:
        tables.append(_equilibrium(prepared))
    maps = registration_picture(prepared.fields, prepared.test.outline, out)
    return Exhibit(facts=_facts(prepared), figures=[maps, _rises(prepared, out)], tables=tables)


def _facts(prepared: PreparedBubble) -> list[tuple[str, object]]:
    view = prepared.view
    facts: list[tuple[str, object]] = []
    if view.rim is not None:
        rim = view.rim
        facts.append(
            ("the sheet rises about, mm", f"{rim.x:.2f}, {rim.y:.2f} (+- {rim.error:.2g})")
        )
    if view.axes is not None:
        clear = f"+- {view.axes.error:.2g}, {view.axes.clear:.0%} clear"
        facts.append(("axes of symmetry, degrees from x and y", f"{view.axes.off:.2f} ({clear})"))
    return facts


def _frames(prepared: PreparedBubble) -> Table:
    rows: list[list[object]] = []
    for field, rise in zip(prepared.fields, prepared.view.rises, strict=True):
        dropped = ", ".join(f"{count} {why}" for why, count in field.dropped.items()) or "none"
        name = "computed" if field.path is None else field.path.name
        rows.append([1e3 * field.pressure, name, len(field.points), dropped, float(rise)])
    header = ["pressure, kPa", "file", "points", "dropped", "rise about the centre, mm"]
    return Table("Frames", header, rows, text=(1, 3))


def _equilibrium(prepared: PreparedBubble) -> Table:
    thickness = prepared.test.thickness
    rows: list[list[object]] = [
        [
            1e3 * apex.pressure,
            apex.height,
            1e3 * apex.curvature,
            apex.force,
            apex.error,
            apex.force / thickness,
            100 * apex.strain[0],
            100 * apex.strain[1],
        ]
        for apex in prepared.view.apexes
    ]
    header = [
        "pressure, kPa", "apex, mm", "k1 + k2, 1/m", "force, kN/m", "+-", "stress, MPa",
        "strain along warp, %", "along fill, %",
    ]  # fmt: skip
    note = (
        "n1 k1 + n2 k2 = p with n1 = n2, from the measured shape alone; logarithmic strain, stress "
        "over the thickness before the test"
    )
    return Table("Equilibrium of the apex, without a model", header, rows, note)


def _rises(prepared: PreparedBubble, out: Output) -> Shown:
    pressures = [field.pressure for field in prepared.fields]
    plot_rises(out.path(HEIGHTS), pressures, prepared.view.rises)
    return out.name(HEIGHTS), "rise about the centre against pressure"
