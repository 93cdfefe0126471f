"""Results of a fitted bubble test in numbers and words: its sheet, frames and registration."""

from collections import Counter
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from ...meshes.bubble_model import BubbleModel
from ...meshes.disk import METRIC
from ...notes import Note, NoteKind, Objection
from ...readers.clock_offset import ClockOffset
from ...solvers.base import Array
from ...wording import distinct_numbers
from ..base import FittedTest
from .frame_doubts import SMALLEST_SLACK
from .objective import FieldObjective
from .prepared import PreparedBubble
from .recorded_frames import RecordedFrames
from .registration import CameraRegistration
from .section import DIRECTIONS, SheetSettings

INVERSE_CRIME = NoteKind("inverse crime", weight=4)
SURFACES = NoteKind(
    "unfaithful surfaces",
    weight=10,
    objection=Objection(
        "polynomial surfaces bias the moduli",
        'compare the bubble at its points: by = "points" in [bubble.match]',
    ),
)
FLAT_SHEET = NoteKind(
    "sheet taken for flat",
    weight=19,
    objection=Objection(
        "the sheet of a real bubble is taken for flat, so that its moduli are not to be believed",
        "give the surface of the sheet measured before the test, or fit its shape ([bubble.sheet])",
        unusable=True,
    ),
)
NEGATIVE_SLACK = NoteKind(
    "negative slack",
    weight=15,
    objection=Objection(
        "the sheet comes out shorter than flat, so that the reference picture may be one under "
        "pressure",
        "compare the fit with one that counts from a frame of known pressure (from_pressure), or "
        "with a pretension",
    ),
)
NOT_BELIEVED = (
    "the moduli of this test are not to be believed: the sheet is taken for flat and taut in the "
    "reference picture, as a real one is not, which has moved E1 by a factor of up to eight; let "
    "[bubble.sheet] take the measured surface, look for modes, or take out a constant field"
)
CRIME = (
    "the data were computed by the very model that is fitted to them (same mesh, same increments, "
    "same solver): an inverse crime, so that the errors are smaller than any test could make them"
)


def objective_of(fitted: FittedTest) -> FieldObjective:
    """Return the objective of the test's one comparison."""
    (comparison,) = fitted.comparisons
    assert isinstance(comparison.objective, FieldObjective)
    return comparison.objective


def fitted_model(fitted: FittedTest, nuisance: Mapping[str, float] | None = None) -> BubbleModel:
    """Return the model of the test's one comparison, with the parameters that the fit found.

    `nuisance` are other values of the nuisance unknowns than those of the histories.
    """
    (comparison,) = fitted.comparisons
    return cast(BubbleModel, comparison.model_at(nuisance or fitted.nuisance))


def sheet_numbers(prepared: PreparedBubble, fitted: FittedTest) -> dict[str, Any]:
    """Return the entries of result.json on the sheet; lengths mm, slack %.

    The surface and the motion of the rim are those of the model, which are drawn.
    """
    sheet = prepared.test.sheet
    heights = fitted_model(fitted).mesh.points[:, 2]
    nuisance = fitted.reported_nuisance
    model = fitted_model(fitted, nuisance)
    surface = prepared.sheet.surface
    reference_pressure = None
    if sheet.reference_frame is not None:
        reference_pressure = 1e3 * prepared.test.pressures[sheet.reference_frame]
    motion = None
    if model.rim_motion is not None:
        motion = float(np.linalg.norm(model.rim_motion, axis=2).max())
    return {
        "used": _used_of_sheet(sheet),
        "surface_mm": {"least": float(heights.min()), "largest": float(heights.max())},
        "measured_rms_mm": None if surface is None else float(surface.rms[0]),
        "modes_mm": {name: nuisance[name] for name in model.modes},
        "slack_percent": [100 * slack for slack in model.slack] if sheet.slack else None,
        "tension_N_per_mm": list(model.tension) if sheet.clamped_under_tension else None,
        "metric_percent": {name: nuisance[name] for name in model.strains},
        "rim_motion_mm": motion,
        "constant_field_rms_mm": _constant_field_rms(sheet, fitted),
        "from_pressure_kPa": reference_pressure,
    }


def _used_of_sheet(sheet: SheetSettings) -> list[str]:
    """Return, in words, which measurements or unknowns of the sheet the fit used."""
    uses = {
        "measured surface": sheet.measured,
        "modes": sheet.modes,
        "slack": sheet.slack,
        "tension": sheet.clamped_under_tension,
        "metric": sheet.metric,
        "measured rim": sheet.moving_rim,
        "constant field": sheet.constant,
        "loaded reference frame": sheet.reference_frame is not None,
    }
    return [words for words, is_used in uses.items() if is_used]


def _constant_field_rms(sheet: SheetSettings, fitted: FittedTest) -> dict[str, float] | None:
    """Return the RMS (mm) of the constant field that was taken out, by direction."""
    if not sheet.constant:
        return None
    rms = np.sqrt(np.mean(constant_field(fitted)[1] ** 2, axis=0))
    return {DIRECTIONS[k]: float(rms[k]) for k in sheet.constant}


def sheet_lines(numbers: dict[str, Any]) -> list[str]:
    """Return the line of the terminal on what the fit used of the sheet, with amounts.

    Parameters
    ----------
    numbers : mapping of str to object
        Those of `sheet_numbers`.
    """
    words = [*_shape_words(numbers), *_reference_words(numbers)]
    return ["sheet: " + ("; ".join(words) or "flat and taut, its rim fixed")]


def _shape_words(numbers: dict[str, Any]) -> list[str]:
    """Return words on the shape and the strain of the sheet before the test."""
    words = []
    measured_rms = numbers["measured_rms_mm"]
    if measured_rms is not None:
        words.append(f"measured surface (followed to {measured_rms:.2g} mm RMS)")
    if numbers["modes_mm"]:
        words.append(f"{len(numbers['modes_mm'])} modes of the surface")
    if words:
        surface = numbers["surface_mm"]
        words.append(f"z0 from {surface['least']:.2f} to {surface['largest']:.2f} mm")
    if numbers["slack_percent"] is not None:
        warp, fill = numbers["slack_percent"]
        words.append(f"slack {warp:.3f} % in warp, {fill:.3f} % in fill")
    if numbers["tension_N_per_mm"] is not None:
        warp, fill = numbers["tension_N_per_mm"]
        words.append(f"clamped under {warp:.3g} N/mm in warp, {fill:.3g} N/mm in fill")
    metric = numbers["metric_percent"]
    if metric:
        means = ", ".join(f"{metric[f'metric_{of}_1']:.3f} % in {of}" for of in METRIC)
        words.append(f"metric of {len(metric)} unknowns: {means} at the centre")
    return words


def _reference_words(numbers: dict[str, Any]) -> list[str]:
    """Return words on the rim and on the state from which displacements are counted."""
    words = []
    if numbers["rim_motion_mm"] is not None:
        words.append(f"rim as measured, up to {numbers['rim_motion_mm']:.2f} mm")
    if numbers["constant_field_rms_mm"] is not None:
        sizes = numbers["constant_field_rms_mm"].items()
        fields = ", ".join(f"{name} {size:.2f} mm RMS" for name, size in sizes)
        words.append(f"constant field taken out: {fields}")
    if numbers["from_pressure_kPa"] is not None:
        words.append(f"displacements counted from {numbers['from_pressure_kPa']:.4g} kPa")
    return words


def warnings_of(prepared: PreparedBubble, *, faithful_degree: int = 6) -> list[Note]:
    """Return warnings of data from which moduli are not to be believed.

    These are a real test of whose sheet nothing is known, data computed by the fitted model, and
    surfaces too coarse to follow a bubble.

    Parameters
    ----------
    prepared : PreparedBubble
    faithful_degree : int
        Polynomial surfaces of a lower degree follow a bubble so badly that the moduli are biased.
    """
    test = prepared.test
    notes = []
    if prepared.known is None and not test.sheet.allows_for_shape:
        notes.append(Note(FLAT_SHEET, NOT_BELIEVED))
    if prepared.by_this_model:
        notes.append(Note(INVERSE_CRIME, CRIME))
    if test.match_by == "surfaces" and test.match_degree < faithful_degree:
        words = (
            f"polynomial surfaces of degree {test.match_degree} do not follow an inflated disk "
            "closely and bias the moduli, also without noise; matching by points does not"
        )
        notes.append(Note(SURFACES, words))
    return notes


def notes_of_slack(numbers: dict[str, Any]) -> list[Note]:
    """Return a note on a slack so far below zero that no sheet at rest has it.

    numbers : those of `sheet_numbers`
    """
    slack = numbers["slack_percent"]
    if slack is None or min(slack) > SMALLEST_SLACK:
        return []
    warp, fill = slack
    words = (
        f"the slack is {warp:.2f} % in warp and {fill:.2f} % in fill: below zero the sheet is "
        "stretched in the reference picture, by a pretension of the clamp or by a pressure, and "
        "the moduli depend on which"
    )
    return [Note(NEGATIVE_SLACK, words)]


def constant_field(fitted: FittedTest) -> tuple[Array, Array]:
    """Return the field that is the same at all pressures and was taken out of the data.

    Return the places (n, 2), mm, and the displacements (n, 3), mm, there.
    """
    objective = objective_of(fitted)
    nodes = fitted.comparisons[0].model.mesh.points[:, :2]
    field = objective.constant_field(fitted.histories[0].displacement, fitted.nuisance)
    places = np.zeros((len(field), 2))
    for target in objective.targets:
        places[target.place_numbers] = target.at_places(nodes)
    return places, field


def recorded_numbers(recorded: RecordedFrames) -> dict[str, Any]:
    """Return the entries of result.json on the chosen frames: pressures in kPa, clocks in s."""
    numbers: dict[str, Any] = {
        "from": recorded.source,
        "frames": recorded.count,
        "left_out": dict(recorded.left_out),
        "taken": [_frame_numbers(recorded, row) for row in range(len(recorded.names))],
    }
    clock = recorded.clock
    if clock is not None:
        numbers["clock"] = {
            "offset_s": clock.offset,
            "between_s": [clock.lower, clock.upper],
            "misfit": clock.misfit,
            "how": "given" if clock.misfit is None else "found by the apex heights",
        }
    return numbers


def _frame_numbers(recorded: RecordedFrames, row: int) -> dict[str, Any]:
    """Return the name of the chosen frame number `row`, with its known pressures in kPa."""
    pressures = {
        "pressure_kPa": recorded.pressure,
        "asked_kPa": recorded.requested,
        "uncertain_kPa": recorded.pressure_uncertainty,
    }
    numbers: dict[str, Any] = {"frame": recorded.names[row]}
    for name, values in pressures.items():
        if values is not None:
            numbers[name] = 1e3 * float(values[row])
    return numbers


def recorded_lines(recorded: RecordedFrames) -> list[str]:
    """Return the lines of the terminal on the chosen frames and their pressures."""
    left_out = "".join(f", {count} {reason}" for reason, count in recorded.left_out.items())
    count = f"{len(recorded.names)} of {recorded.count} frames taken{left_out}"
    line = f"pressures from {recorded.source}: {count}"
    if recorded.requested is not None:
        farthest = int(np.argmax(np.abs(recorded.pressure - recorded.requested)))
        pressure_words, requested_words = distinct_numbers(
            1e3 * recorded.pressure[farthest], 1e3 * recorded.requested[farthest], 4
        )
        if pressure_words != requested_words:
            difference = f"{pressure_words} in place of {requested_words} kPa"
            line += f"; farthest from the pressure asked for: {difference}"
    lines = [line]
    if recorded.inflations is not None:
        lines.append(recorded.inflations.line)
    if recorded.clock is not None:
        lines.append(clock_words(recorded.clock))
    return lines


def clock_words(clock: ClockOffset) -> str:
    """Describe how far the clocks are apart, and how sure that is."""
    ahead = f"clock of the log less that of the frames: {clock.offset:.2f} s"
    if clock.misfit is None:
        return f"{ahead}, given"
    uncertainty = 1e3 * np.nanmean(clock.pressure_uncertainty)
    return (
        f"{ahead}, found by the apex heights, which rise with the pressure: between"
        f" {clock.lower:.2f} and {clock.upper:.2f} s the misfit ({clock.misfit:.2g} of the variance"
        f" at best) is at most doubled; pressures uncertain by {uncertainty:.2g}"
        " kPa on average"
    )


def registration_numbers(registration: CameraRegistration) -> dict[str, Any]:
    """Return the entries of result.json on the registration."""
    motions = [motion for motion in registration.motions if motion.point_count]
    warp = registration.warp
    rim = registration.rim
    return {
        "origin_mm": registration.placement.origin.tolist(),
        "axes": registration.placement.axes.tolist(),
        "plane": {"of": registration.plane_of, "deviation_mm": registration.flatness},
        "tilt_degrees": registration.placement.tilt,
        "centre": "given" if rim is None else {"error_mm": rim.error},
        "warp_degrees": registration.warp_angle,
        "warp": "given" if warp is None else {"error_degrees": warp.error, "clear": warp.clarity},
        "clamp_motion": {
            "removed": bool(motions) and registration.options.remove_clamp_motion,
            "shift_mm": [float(np.linalg.norm(motion.shift)) for motion in motions],
            "turn_degrees": [motion.angle for motion in motions],
        },
    }


def registration_line(registration: CameraRegistration) -> str:
    """Return the line of the terminal on the registration."""
    placement = registration.placement
    x, y, z = placement.origin
    warp = registration.warp
    certainty = "given" if warp is None else f"+- {warp.error:.1g}"
    return (
        f"registration: centre {x:.2f}, {y:.2f}, {z:.2f} mm, tilt {placement.tilt:.2f}, warp "
        f"{registration.warp_angle:.2f} degrees ({certainty})"
    )


def read_numbers(prepared: PreparedBubble) -> dict[str, Any]:
    """Return the entries of result.json on the columns read, and on rows left out by reason."""
    source = prepared.fields[0].source
    dropped = Counter[str]()
    for field in prepared.fields:
        dropped.update(field.dropped)
    read = {"format": source.format, "columns": dict(source.columns), "units": dict(source.units)}
    return {"dropped": dict(dropped), **({"read": read} if source.format else {})}
