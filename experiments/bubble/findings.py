"""Numbers and words on a fitted bubble test: the sheet, the frames taken, the registration."""

from collections import Counter
from typing import Any, cast

import numpy as np

from ...meshes.bubble_model import BubbleModel
from ...meshes.disk import METRIC
from ...notes import Note, NoteKind, Objection
from ...readers.clock_offset import ClockOffset
from ...solvers.base import Array
from ...wording import distinct_numbers
from ..fitted import FittedTest
from .objective import FieldObjective
from .prepared import PreparedBubble
from .recorded_frames import RecordedFrames
from .registration import CameraRegistration
from .section import DIRECTIONS

INVERSE_CRIME = NoteKind("inverse crime", weight=4)
SURFACES = NoteKind(
    "unfaithful surfaces",
    weight=10,
    objection=Objection("polynomial surfaces bias the moduli", "match the bubble by points"),
)
FLAT_SHEET = NoteKind(
    "sheet taken for flat",
    weight=19,
    objection=Objection(
        "the sheet of a real bubble is taken for flat, so that its moduli are not to be believed",
        "take the measured surface of the sheet, or fit its modes ([bubble.sheet])",
        unusable=True,
    ),
)
NOT_BELIEVED = (
    "the moduli of this test are not to be believed: the sheet is taken for flat and taut in the "
    "reference picture, as a real one is not, which has moved E1 by a factor of up to eight; let "
    "[bubble.sheet] take the measured surface, look for modes, or take out a constant field"
)
#: Below this degree polynomial surfaces follow a bubble so badly that the moduli are biased.
FAITHFUL = 6
CRIME = (
    "the data were computed by the very model that is fitted to them (same mesh, same increments, "
    "same solver): an inverse crime, so that the errors are smaller than any test could make them"
)


def objective_of(fitted: FittedTest) -> FieldObjective:
    """Return the objective of the test's one comparison."""
    (comparison,) = fitted.comparisons
    assert isinstance(comparison.objective, FieldObjective)
    return comparison.objective


def fitted_model(fitted: FittedTest) -> BubbleModel:
    """Return the model with its parameters as the fit found them."""
    (comparison,) = fitted.comparisons
    return cast(BubbleModel, comparison.model_at(fitted.nuisance))


def sheet_numbers(prepared: PreparedBubble, fitted: FittedTest) -> dict[str, Any]:
    """Return the entries of result.json on the sheet; lengths mm, slack %."""
    sheet = prepared.test.sheet
    model = fitted_model(fitted)
    heights = model.mesh.points[:, 2]
    surface = prepared.sheet.surface
    moved = model.rim_motion
    taken = None
    if sheet.constant:
        rms = np.sqrt(np.mean(constant_field(fitted)[1] ** 2, axis=0))
        taken = {DIRECTIONS[k]: float(rms[k]) for k in sheet.constant}
    since = None if sheet.since is None else 1e3 * prepared.test.pressures[sheet.since]
    on = {
        "measured surface": sheet.measured,
        "modes": sheet.modes,
        "slack": sheet.slack,
        "metric": sheet.metric,
        "measured rim": sheet.moving_rim,
        "constant field": sheet.constant,
        "loaded reference frame": sheet.since is not None,
    }
    return {
        "used": [words for words, used in on.items() if used],
        "surface_mm": {"least": float(heights.min()), "largest": float(heights.max())},
        "measured_rms_mm": None if surface is None else float(surface.rms[0]),
        "modes_mm": {name: fitted.nuisance[name] for name in model.modes},
        "slack_percent": [100 * s for s in model.slack] if sheet.slack else None,
        "metric_percent": {name: fitted.nuisance[name] for name in model.strains},
        "rim_motion_mm": None if moved is None else float(np.linalg.norm(moved, axis=2).max()),
        "constant_field_rms_mm": taken,
        "from_pressure_kPa": since,
    }


def sheet_lines(numbers: dict[str, Any]) -> list[str]:
    """Return the line of the terminal on what the fit used of the sheet, each with its size."""
    words = []
    surface = numbers["surface_mm"]
    measured = numbers["measured_rms_mm"]
    if measured is not None:
        words.append(f"measured surface (followed to {measured:.2g} mm RMS)")
    if numbers["modes_mm"]:
        words.append(f"{len(numbers['modes_mm'])} modes of the surface")
    if words:
        words.append(f"z0 from {surface['least']:.2f} to {surface['largest']:.2f} mm")
    if numbers["slack_percent"] is not None:
        warp, fill = numbers["slack_percent"]
        words.append(f"slack {warp:.3f} % in warp, {fill:.3f} % in fill")
    if metric := numbers["metric_percent"]:
        means = ", ".join(f"{metric[f'metric_{of}_1']:.3f} % in {of}" for of in METRIC)
        words.append(f"metric of {len(metric)} unknowns: {means} at the centre")
    if numbers["rim_motion_mm"] is not None:
        words.append(f"rim as measured, up to {numbers['rim_motion_mm']:.2f} mm")
    if numbers["constant_field_rms_mm"] is not None:
        sizes = numbers["constant_field_rms_mm"].items()
        taken = ", ".join(f"{name} {size:.2f} mm RMS" for name, size in sizes)
        words.append(f"constant field taken out: {taken}")
    if numbers["from_pressure_kPa"] is not None:
        words.append(f"displacements counted from {numbers['from_pressure_kPa']:.4g} kPa")
    return ["sheet: " + ("; ".join(words) or "flat and taut, its rim fixed")]


def warnings_of(prepared: PreparedBubble) -> list[Note]:
    """Warn of a real test of whose sheet nothing is known, of data computed by the fitted model,
    and of surfaces too coarse to follow a bubble."""
    test = prepared.test
    known = prepared.known is not None or prepared.test.sheet.known
    notes = [] if known else [Note(FLAT_SHEET, NOT_BELIEVED)]
    notes += [Note(INVERSE_CRIME, CRIME)] if prepared.by_this_model else []
    if test.match_by == "surfaces" and test.match_degree < FAITHFUL:
        words = (
            f"polynomial surfaces of degree {test.match_degree} do not follow an inflated disk "
            "closely and bias the moduli, also without noise; matching by points does not"
        )
        notes.append(Note(SURFACES, words))
    return notes


def constant_field(fitted: FittedTest) -> tuple[Array, Array]:
    """Return places (n, 2) mm and the field (n, 3) mm that was taken out there."""
    objective = objective_of(fitted)
    nodes = fitted.comparisons[0].model.mesh.points[:, :2]
    field = objective.constant_field(fitted.histories[0].displacement, fitted.nuisance)
    places = np.zeros((len(field), 2))
    for target in objective.targets:
        places[target.place_numbers] = target.at(nodes)
    return places, field


def recorded_numbers(taken: RecordedFrames) -> dict[str, Any]:
    """Return the entries of result.json on the frames: pressures in kPa, the offset in s."""
    kilos = {
        "pressure_kPa": taken.pressure,
        "asked_kPa": taken.requested,
        "uncertain_kPa": taken.doubt,
    }
    known = {name: own for name, own in kilos.items() if own is not None}
    numbers: dict[str, Any] = {
        "from": taken.source,
        "frames": taken.count,
        "left_out": dict(taken.left_out),
        "taken": [
            {"frame": frame, **{name: 1e3 * float(own[i]) for name, own in known.items()}}
            for i, frame in enumerate(taken.names)
        ],
    }
    clock = taken.clock
    if clock is not None:
        how = "given" if clock.misfit is None else "found by the apex heights"
        numbers["clock"] = {"offset_s": clock.offset, "between_s": [clock.lower, clock.upper]}
        numbers["clock"] |= {"misfit": clock.misfit, "how": how}
    return numbers


def recorded_lines(taken: RecordedFrames) -> list[str]:
    """Return the lines of the terminal on the frames taken."""
    left_out = "".join(f", {count} {why}" for why, count in taken.left_out.items())
    count = f"{len(taken.names)} of {taken.count} frames taken{left_out}"
    lines = [f"pressures from {taken.source}: {count}"]
    if taken.requested is not None:
        worst = int(np.argmax(np.abs(taken.pressure - taken.requested)))
        found, asked = distinct_numbers(
            1e3 * taken.pressure[worst], 1e3 * taken.requested[worst], 4
        )
        if found != asked:
            lines[0] += f"; farthest from the pressure asked for: {found} in place of {asked} kPa"
    lines += [] if taken.inflations is None else [taken.inflations.line]
    return lines if taken.clock is None else [*lines, clock_words(taken.clock)]


def clock_words(clock: ClockOffset) -> str:
    """Describe how far the clocks are apart, and how sure that is."""
    ahead = f"clock of the log less that of the frames: {clock.offset:.2f} s"
    if clock.misfit is None:
        return f"{ahead}, given"
    return (
        f"{ahead}, found by the apex heights, which rise with the pressure: between"
        f" {clock.lower:.2f} and {clock.upper:.2f} s the misfit ({clock.misfit:.2g} of the variance"
        f" at best) is at most doubled; pressures uncertain by {1e3 * np.nanmean(clock.doubt):.2g}"
        " kPa on average"
    )


def registration_numbers(found: CameraRegistration) -> dict[str, Any]:
    """Return the entries of result.json on the registration."""
    seen = [m for m in found.motions if m.points]
    warp = found.warp
    rim = found.rim
    return {
        "origin_mm": found.placement.origin.tolist(),
        "axes": found.placement.axes.tolist(),
        "plane": {"of": found.plane_of, "deviation_mm": found.flatness},
        "tilt_degrees": found.placement.tilt,
        "centre": "given" if rim is None else {"error_mm": rim.error},
        "warp_degrees": found.warp_angle,
        "warp": "given" if warp is None else {"error_degrees": warp.error, "clear": warp.clear},
        "clamp_motion": {
            "removed": bool(seen) and found.options.remove_clamp_motion,
            "shift_mm": [float(np.linalg.norm(m.shift)) for m in seen],
            "turn_degrees": [m.angle for m in seen],
        },
    }


def registration_line(found: CameraRegistration) -> str:
    """Return the line of the terminal on the registration."""
    x, y, z = found.placement.origin
    how = "given" if found.warp is None else f"+- {found.warp.error:.1g}"
    return (
        f"registration: centre {x:.2f}, {y:.2f}, {z:.2f} mm, tilt {found.placement.tilt:.2f}, warp "
        f"{found.warp_angle:.2f} degrees ({how})"
    )


def read_numbers(prepared: PreparedBubble) -> dict[str, Any]:
    """Return the entries of result.json on the columns read and the rows dropped, by why."""
    source = prepared.fields[0].source
    dropped = Counter[str]()
    for field in prepared.fields:
        dropped.update(field.dropped)
    read = {"format": source.format, "columns": dict(source.columns), "units": dict(source.units)}
    return {"dropped": dict(dropped), **({"read": read} if source.format else {})}
