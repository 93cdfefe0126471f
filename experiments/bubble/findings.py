"""What a fit means for a bubble test: how far it is off, what the offsets took, what was left
out.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

from ...identification.assessment import moduli_error
from ...materials.forms.base import COMPONENTS
from ...notes import Note, NoteKind
from ..fittable import Findings, FittedTest
from .objective import FieldObjective, displacement_offset
from .point_files import PointFiles
from .recorded import RecordedFrames
from .recorded_words import recorded_lines, recorded_numbers
from .registration import registration_line, registration_numbers
from .sheet_report import sheet_lines, sheet_numbers, sheet_warnings

if TYPE_CHECKING:
    from .prepared import PreparedBubble

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
    from ...reports import percent

    return percent(value)
