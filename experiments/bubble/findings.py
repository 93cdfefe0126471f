"""What a fit means for a bubble test: how far it is off, what the offsets took, what was left
out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...inference.assessment import moduli_error
from ...materials.forms.base import COMPONENTS
from ...meshes.bubble_model import BubbleModel
from ...meshes.disk import Outline
from ...notes import Note, NoteKind
from ...readers.fields import DisplacementField
from ...readers.pressure_log import ClockOffset
from ...reports.bubbles import clock_charts, disk_charts, registration_charts
from ...reports.content import Table
from ...reports.vega import save
from ...writing import replacing
from ..kinds import Findings, FittedTest, Output, Shown
from .objective import FieldObjective, displacement_offset
from .point_files import PointFiles, RecordedFrames
from .registration import Registration
from .section import DIRECTIONS

if TYPE_CHECKING:
    from .prepared import PreparedBubble
    from .test import BubbleTest

Array = NDArray[np.float64]

PICTURE, TABLE = "reference_surface.png", "reference_surface.csv"
CONSTANT_PICTURE, CONSTANT_TABLE = "constant_field.png", "constant_field.csv"
NOT_BELIEVED = (
    "the moduli of this test are not to be believed: the sheet is taken for flat and taut in the "
    "reference picture, as a real one is not, which has moved E1 by a factor of up to eight; let "
    "[bubble.sheet] take the measured surface, look for modes, or take out a constant field"
)


def fitted_model(fitted: FittedTest) -> BubbleModel:
    """The model with its parameters as the fit found them."""
    (comparison,) = fitted.comparisons
    model: BubbleModel = comparison.model
    own = [n for n in comparison.nuisance if n.model_parameter is not None]
    values = {str(n.model_parameter): n.scale * fitted.nuisance[n.name] for n in own}
    return model.with_parameters(values)


def sheet_numbers(prepared: PreparedBubble, fitted: FittedTest) -> dict[str, Any]:
    """For result.json; lengths mm, slack %."""
    sheet, model = prepared.test.sheet, fitted_model(fitted)
    heights, surface = model.mesh.points[:, 2], prepared.sheet.surface
    moved = model.rim_motion
    numbers: dict[str, Any] = {
        "used": _used(prepared),
        "surface_mm": {"least": float(heights.min()), "largest": float(heights.max())},
        "measured_rms_mm": None if surface is None else float(surface.rms[0]),
        "modes_mm": {name: fitted.nuisance[name] for name in model.modes},
        "slack_percent": [100 * s for s in model.slack] if sheet.slack else None,
        "rim_motion_mm": None if moved is None else float(np.linalg.norm(moved, axis=2).max()),
        "constant_field_rms_mm": None,
        "from_pressure_kPa": None,
    }
    if sheet.constant:
        field = _constant(fitted)[1]
        rms = np.sqrt(np.mean(field**2, axis=0))
        numbers["constant_field_rms_mm"] = {DIRECTIONS[k]: float(rms[k]) for k in sheet.constant}
    if sheet.since is not None:
        numbers["from_pressure_kPa"] = 1e3 * prepared.test.pressures[sheet.since]
    return numbers


def sheet_lines(numbers: dict[str, Any]) -> list[str]:
    """For the terminal: which of them the fit used, each with its size."""
    words = []
    surface = numbers["surface_mm"]
    if numbers["measured_rms_mm"] is not None:
        words.append(f"measured surface (followed to {numbers['measured_rms_mm']:.2g} mm RMS)")
    if numbers["modes_mm"]:
        words.append(f"{len(numbers['modes_mm'])} modes of the surface")
    if words:
        words.append(f"z0 from {surface['least']:.2f} to {surface['largest']:.2f} mm")
    if numbers["slack_percent"] is not None:
        warp, fill = numbers["slack_percent"]
        words.append(f"slack {warp:.3f} % in warp, {fill:.3f} % in fill")
    if numbers["rim_motion_mm"] is not None:
        words.append(f"rim as measured, up to {numbers['rim_motion_mm']:.2f} mm")
    if numbers["constant_field_rms_mm"] is not None:
        sizes = numbers["constant_field_rms_mm"].items()
        taken = ", ".join(f"{name} {size:.2f} mm RMS" for name, size in sizes)
        words.append(f"constant field taken out: {taken}")
    if numbers["from_pressure_kPa"] is not None:
        words.append(f"displacements counted from {numbers['from_pressure_kPa']:.4g} kPa")
    return ["sheet: " + ("; ".join(words) if words else "flat and taut, its rim fixed")]


def sheet_warnings(prepared: PreparedBubble) -> list[Note]:
    """A real test of which nothing is known of the sheet's shape."""
    if prepared.known is not None or prepared.test.sheet.known:
        return []
    return [Note(NoteKind.FLAT_SHEET, NOT_BELIEVED)]


def sheet_exhibit(
    prepared: PreparedBubble, fitted: FittedTest, out: Output
) -> tuple[list[Shown], list[Shown]]:
    """Figures and files of the surface and of a constant field, where there are any."""
    figures, files = [], []
    sheet, edge = prepared.test.sheet, prepared.test.outline.edge()
    if sheet.measured or sheet.modes:
        points = fitted_model(fitted).mesh.points
        _write(out, TABLE, {"x_mm": points[:, 0], "y_mm": points[:, 1], "z0_mm": points[:, 2]})
        heights = [("z0, mm", points[:, :2], points[:, 2])]
        save(out.path(PICTURE), disk_charts(heights, edge))
        how = " and ".join(w for w in _used(prepared) if w in ("measured surface", "modes"))
        words = "surface of the sheet in the reference picture"
        figures.append((out.name(PICTURE), f"{prepared.test.name}: {words} ({how})"))
        files.append((out.name(TABLE), f"{words}, node by node"))
    if sheet.constant:
        places, field = _constant(fitted)
        own = [(f"{DIRECTIONS[k]}, mm", places, field[:, k]) for k in sheet.constant]
        columns = {f"{DIRECTIONS[k]}_mm": field[:, k] for k in sheet.constant}
        _write(out, CONSTANT_TABLE, {"x_mm": places[:, 0], "y_mm": places[:, 1], **columns})
        save(out.path(CONSTANT_PICTURE), disk_charts(own, edge))
        words = "measured less modelled, as far as it is the same at all pressures"
        figures.append((out.name(CONSTANT_PICTURE), f"Taken out of the fit: {words}"))
        files.append((out.name(CONSTANT_TABLE), f"{words}, point by point"))
    return figures, files


def _used(prepared: PreparedBubble) -> list[str]:
    sheet = prepared.test.sheet
    return [
        words
        for words, on in (
            ("measured surface", sheet.measured),
            ("modes", sheet.modes),
            ("slack", sheet.slack),
            ("measured rim", sheet.moving_rim),
            ("constant field", sheet.constant),
            ("loaded reference frame", sheet.since is not None),
        )
        if on
    ]


def _constant(fitted: FittedTest) -> tuple[Array, Array]:
    """Places (n, 2) mm and the field (n, 3) mm that was taken out there."""
    (comparison,) = fitted.comparisons
    objective = comparison.objective
    assert isinstance(objective, FieldObjective)
    field = objective.constant_field(fitted.histories[0].displacement, fitted.nuisance)
    places = np.zeros((len(field), 2))
    for target in objective.targets:
        places[target.places] = target.at(comparison.model.mesh.points[:, :2])
    return places, field


def _write(out: Output, name: str, columns: dict[str, Array]) -> None:
    with replacing(out.path(name)) as path:
        pd.DataFrame(columns).to_csv(path, index=False, float_format="%.6g")


PICTURE_RECORDED_WORDS = "clock.png"


def recorded_numbers(taken: RecordedFrames) -> dict[str, Any]:
    """For result.json: pressures in kPa, the clocks' offset in s."""
    asked, doubt = taken.asked, taken.doubt
    numbers: dict[str, Any] = {
        "from": taken.source,
        "frames": taken.count,
        "left_out": dict(taken.left_out),
        "taken": [
            {
                "frame": name,
                "pressure_kPa": 1e3 * float(taken.pressure[i]),
                **({} if asked is None else {"asked_kPa": 1e3 * float(asked[i])}),
                **({} if doubt is None else {"uncertain_kPa": 1e3 * float(doubt[i])}),
            }
            for i, name in enumerate(taken.names)
        ],
    }
    clock = taken.clock
    if clock is not None:
        numbers["clock"] = {
            "offset_s": clock.offset,
            "between_s": [clock.lower, clock.upper],
            "misfit": clock.misfit,
            "how": "given" if clock.misfit is None else "found by the apex heights",
        }
    return numbers


def recorded_lines(taken: RecordedFrames) -> list[str]:
    """For the terminal."""
    left_out = "".join(f", {count} {why}" for why, count in taken.left_out.items())
    lines = [
        f"pressures from {taken.source}: {len(taken.names)} of {taken.count} frames taken{left_out}"
    ]
    if taken.asked is not None:
        off = np.abs(taken.pressure - taken.asked)
        worst = int(np.argmax(off))
        lines[0] += (
            f"; farthest from the pressure asked for: {1e3 * taken.pressure[worst]:.4g} in place of"
            f" {1e3 * taken.asked[worst]:.4g} kPa"
        )
    if taken.clock is not None:
        lines.append(_clock_words(taken.clock))
    return lines


def recorded_table(taken: RecordedFrames) -> Table:
    """The frames taken, and at which pressures they were recorded."""
    columns = ["frame", "pressure, kPa"]
    cells: list[list[object]] = [
        [n, 1e3 * p] for n, p in zip(taken.names, taken.pressure.tolist(), strict=True)
    ]
    if taken.asked is not None:
        columns += ["asked for, kPa", "farther by, kPa"]
        for row, p, a in zip(cells, taken.pressure, taken.asked, strict=True):
            row += [1e3 * float(a), 1e3 * float(p - a)]
    if taken.doubt is not None and taken.clock is not None and taken.clock.misfit is not None:
        columns.append("uncertain by the clocks, +- kPa")
        for row, d in zip(cells, taken.doubt, strict=True):
            row.append(1e3 * float(d))
    left_out = "".join(f"; {count} {why}" for why, count in taken.left_out.items())
    note = f"pressures from {taken.source}; {len(cells)} of {taken.count} frames{left_out}"
    if taken.clock is not None:
        note += ". " + _clock_words(taken.clock)
    return Table("Frames taken", columns, cells, note)


def clock_pictures(taken: RecordedFrames, out: Output) -> list[Shown]:
    """Pressures of the log beside the heights of all frames; none without a log."""
    clock = taken.clock
    if clock is None:
        return []
    times = clock.times + clock.offset
    charts = clock_charts(times, clock.pressure, clock.heights, taken.pressure)
    save(out.path(PICTURE_RECORDED_WORDS), charts)
    return [
        (
            out.name(PICTURE_RECORDED_WORDS),
            "pressures of the log and heights of the frames, by one clock",
        )
    ]


def _clock_words(clock: ClockOffset) -> str:
    ahead = f"clock of the log less that of the frames: {clock.offset:.2f} s"
    if clock.misfit is None:
        return f"{ahead}, given"
    return (
        f"{ahead}, found by the apex heights, which rise with the pressure: between"
        f" {clock.lower:.2f} and {clock.upper:.2f} s the misfit ({clock.misfit:.2g} of the variance"
        f" at best) is at most doubled; pressures uncertain by {1e3 * np.nanmean(clock.doubt):.2g}"
        " kPa on average"
    )


PICTURE_REGISTRATION = "registration.png"

#: What each choice of the plane means.
PLANES = {
    "clamp": "through the points beyond the rim",
    "edge": "through the edge of the sheet",
    "camera": "the camera's own x and y",
}


def registration_numbers(found: Registration) -> dict[str, Any]:
    """For result.json."""
    seen = [m for m in found.motions if m.points]
    warp, rim, given = found.warp, found.rim, found.options
    return {
        "origin_mm": found.placement.origin.tolist(),
        "axes": found.placement.axes.tolist(),
        "plane": {"of": found.plane_of, "deviation_mm": found.flatness},
        "tilt_degrees": found.placement.tilt,
        "centre": "given" if rim is None else {"error_mm": rim.error},
        "warp_degrees": found.warp_angle,
        "warp": "given" if warp is None else {"error_degrees": warp.error, "clear": warp.clear},
        "clamp_motion": {
            "removed": bool(seen) and given.remove_clamp_motion,
            "shift_mm": [float(np.linalg.norm(m.shift)) for m in seen],
            "turn_degrees": [m.angle for m in seen],
        },
    }


def registration_table(found: Registration) -> Table:
    """What was found and what was given, step by step."""
    x, y, z = found.placement.origin
    rim, warp = found.rim, found.warp
    plane = f"tilted by {found.placement.tilt:.2f} degrees"
    how = PLANES[found.plane_of]
    if found.plane_of != "camera":
        how += f", which deviate by {found.flatness:.2g} mm"
    rows: list[list[object]] = [
        ["plane of the rim", plane, how],
        [
            "centre of the rim, mm",
            f"{x:.2f}, {y:.2f}, {z:.2f}",
            "given" if rim is None else f"found where the sheet does not rise, +- {rim.error:.2g}",
        ],
        [
            "warp, degrees from the camera's x",
            f"{found.warp_angle:.2f}",
            "given" if warp is None else _warp_words(found),
        ],
        ["motion of the clamp", *_motion_words(found)],
    ]
    note = "lengths and directions in the camera's coordinates"
    return Table("Registration", ["step", "value", "how"], rows, note)


def registration_line(found: Registration) -> str:
    """One line for the terminal."""
    x, y, z = found.placement.origin
    how = "given" if found.warp is None else f"+- {found.warp.error:.1g}"
    return (
        f"registration: centre {x:.2f}, {y:.2f}, {z:.2f} mm, tilt {found.placement.tilt:.2f}, warp "
        f"{found.warp_angle:.2f} degrees ({how})"
    )


def _warp_words(found: Registration) -> str:
    assert found.warp is not None
    if found.warp.clear is None:
        return f"found by the turn of the elliptic rim, +- {found.warp.error:.2g}"
    stiff = "stiffer" if found.options.warp_is_stiff else "softer"
    return (
        f"found by symmetry ({found.warp.clear:.0%} clear), +- {found.warp.error:.2g}; the "
        f"{stiff} of the two axes"
    )


def _motion_words(found: Registration) -> tuple[str, str]:
    seen = [m for m in found.motions if m.points]
    if not seen:
        return "not known", "no points beyond the rim all around"
    shift = max(float(np.linalg.norm(m.shift)) for m in seen)
    turn = max(m.angle for m in seen)
    removed = "removed" if found.options.remove_clamp_motion else "left in"
    return f"{shift:.3g} mm, {turn:.2g} degrees at most", removed


def registration_picture(
    fields: Sequence[DisplacementField], outline: Outline, out: Output
) -> Shown:
    """Maps of the reference height, where it was measured, and of the highest rise."""
    last = fields[-1]
    maps = [(f"rise at {1e3 * last.pressure:.4g} kPa, mm", last.displacement[:, 2])]
    if last.z is not None:
        maps.insert(0, ("reference height z, mm", last.z))
    save(out.path(PICTURE_REGISTRATION), registration_charts(last.points, maps, outline.edge()))
    return out.name(
        PICTURE_REGISTRATION
    ), "measured points in the test's coordinates, the rim, warp and fill"


#: Below this degree polynomial surfaces follow a bubble so badly that the moduli are biased.
FAITHFUL = 6
CRIME = (
    "the data were computed by the very model that is fitted to them (same mesh, same increments, "
    "same solver): an inverse crime, so that the errors are smaller than any test could make them"
)


def objective_of(fitted: FittedTest) -> FieldObjective:
    """The objective of the test's one comparison."""
    (comparison,) = fitted.comparisons
    assert isinstance(comparison.objective, FieldObjective)
    return comparison.objective


def findings_of(prepared: PreparedBubble, fitted: FittedTest) -> Findings:
    """Numbers for result.json, warnings, and words for terminal, card and page."""
    test, objective = prepared.test, objective_of(fitted)
    offset = displacement_offset(fitted.nuisance)
    mean = objective.mean_absolute(fitted.histories[0].displacement, fitted.nuisance)
    numbers: dict[str, Any] = {
        "mean_abs_mm": mean,
        "nuisance": {
            "displacement_offset_mm": offset.tolist() if test.displacement_offset else None,
            "pressure_offset_kPa": fitted.nuisance.get("pressure_offset"),
        },
        "data": {
            "matched_by": test.match_by,
            "places": [len(t.displacement) for t in objective.targets],
            "doubtful_dropped": prepared.dropped,
            **_as_read(prepared),
            "outside_dropped": prepared.outside,
        },
    }
    taken = recorded_of(prepared)
    if taken is not None:
        numbers["data"]["pressures"] = recorded_numbers(taken)
    numbers["sheet"] = sheet_numbers(prepared, fitted)
    if prepared.surfaces:
        numbers["surface_r_squared"] = [s.r_squared.tolist() for s in prepared.surfaces]
    lines = [f"mean |dx|+|dy|+|dz|: {mean:.3g} mm"]
    lines += [] if taken is None else recorded_lines(taken)
    notes = dict.fromkeys(note for field in prepared.fields for note in field.source.notes)
    lines += [f"data: {note}" for note in notes]
    if prepared.known is not None:
        errors = moduli_error(fitted.law, prepared.known, fitted.reached)
        numbers["moduli_error"] = errors
        ends = {name: float(fitted.reached[c]) for name, c in COMPONENTS.items()}
        numbers["moduli_error_range"] = {name: [0.0, end] for name, end in ends.items()}
        said = ", ".join(
            f"{name} {_percent(errors[name])} (strain 0 to {end:.3g})" for name, end in ends.items()
        )
        lines.append(f"largest error of the moduli over the strain reached: {said}")
    if prepared.registration is not None:
        numbers["registration"] = registration_numbers(prepared.registration)
        lines.append(registration_line(prepared.registration))
    lines += sheet_lines(numbers["sheet"])
    lines += _offset_words(prepared, fitted)
    return Findings(
        numbers,
        (*sheet_warnings(prepared), *_warnings(prepared)),
        tuple(lines),
        f"mean |dx|+|dy|+|dz| {mean:.4g} mm",
        f"mean |dx| + |dy| + |dz| = {mean:.3g} mm",
    )


def recorded_of(prepared: PreparedBubble) -> RecordedFrames | None:
    """By which pressures its frames were taken; None where the project names them all."""
    data = prepared.test.data
    return data.recorded if isinstance(data, PointFiles) else None


def _as_read(prepared: PreparedBubble) -> dict[str, Any]:
    """Which columns of the files were read, and how many rows were dropped, by why."""
    source, dropped = prepared.fields[0].source, Counter[str]()
    for field in prepared.fields:
        dropped.update(field.dropped)
    read = {"format": source.format, "columns": dict(source.columns), "units": dict(source.units)}
    return {"dropped": dict(dropped), **({"read": read} if source.format else {})}


def _offset_words(prepared: PreparedBubble, fitted: FittedTest) -> list[str]:
    units = {n.name: n.unit for c in fitted.comparisons for n in c.nuisance if n.prior is None}
    if not units:
        return []
    said = ", ".join(f"{name} {fitted.nuisance[name]:.3f} {unit}" for name, unit in units.items())
    return [f"nuisance: {said}"]


def _warnings(prepared: PreparedBubble) -> list[Note]:
    test, notes = prepared.test, []
    if prepared.by_this_model:
        notes.append(Note(NoteKind.INVERSE_CRIME, CRIME))
    if test.match_by != "surfaces" or test.match_degree >= FAITHFUL:
        return notes
    words = (
        f"polynomial surfaces of degree {test.match_degree} do not follow an inflated disk closely "
        "and bias the moduli, also without noise; matching by points does not"
    )
    return [*notes, Note(NoteKind.SURFACES, words)]


def _percent(value: float) -> str:
    from ...reports.html import percent

    return percent(value)


NOT_GIVEN = "not given"
TITLE = "Image correlation"
NOTE = (
    "The fields that the good practices guide of the International Digital Image Correlation "
    "Society asks for. What is not given stands in no file that was read: give it in "
    "[bubble.data.points.correlation] before the report leaves the laboratory."
)
#: Of the hardware and the analysis, which exports of image correlation do not hold: what the
#: section's keys are called on the page.
ASKED = {
    "camera": "camera",
    "resolution": "image resolution",
    "lens": "lens and aperture",
    "field_of_view": "field of view",
    "scale": "image scale",
    "stereo": "stereo angle and stand-off",
    "exposure": "exposure and frame rate",
    "pattern": "patterning technique",
    "pattern_size": "pattern feature size",
    "subset": "subset size",
    "step": "step size",
    "strain_window": "strain window and virtual gauge length",
    "matching": "shape function, matching criterion, interpolant",
    "prefilter": "prefilter and data filter",
}


def correlation_table(prepared: PreparedBubble) -> list[Table]:
    """A row a field; nothing where the data were computed."""
    test = prepared.test
    if not isinstance(test.data, PointFiles) or not prepared.fields:
        return []
    given = {**_of_filter(test), **test.data.correlation}
    formats = sorted({f.source.format for f in prepared.fields if f.source.format})
    points = [len(f.points) for f in prepared.fields]
    software = [given.get("software", ""), ", ".join(formats)]
    known: list[list[object]] = [
        ["software and format of the export", "; ".join(filter(None, software)) or NOT_GIVEN],
        ["images evaluated", str(len(prepared.fields))],
        ["points in an image", f"{min(points)} to {max(points)}"],
        ["points left out as doubtful", str(prepared.dropped)],
        ["coordinates", "registered on the rim" if prepared.registration else "as exported"],
        ["noise floor of a displacement", _mm(test.noise) or NOT_GIVEN],
    ]
    if test.match_by == "surfaces":
        known.append(["smoothing", f"polynomial surfaces of degree {test.match_degree}"])
    asked: list[list[object]] = [[name, given.get(key, NOT_GIVEN)] for key, name in ASKED.items()]
    return [Table(f"{TITLE}: {test.name}", ["", ""], [*known, *asked], NOTE, text=(1,))]


def _of_filter(test: BubbleTest) -> dict[str, str]:
    """What the section of the camera's own filter tells, mm."""
    if test.facet is None:
        return {}
    told = {"subset": _mm(test.facet.size), "step": _mm(test.facet.step)}
    return {key: words for key, words in told.items() if words}


def _mm(value: float | None) -> str:
    return "" if value is None else f"{value:.3g} mm"
