"""Propose strip tests, one direction at a time, as candidates of a test plan.

They are like the first strips of the project, if it has any.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...meshes.strip_models import GRIP_DISTANCE, WIDTH
from ...readers.curves import DIRECTIONS, LoadCurve
from ..planning import Candidate, Planning
from .data import Strip
from .load_objective import PLACES_OF_SPECIMEN
from .prepared import PreparedStrips, loads_to_match
from .test import StripsTest


@dataclass(frozen=True)
class CandidateStrips:
    """Strips that a plan proposes."""

    angles: tuple[float, ...] = (30.0, 45.0, 60.0)  # degrees from pull to warp of bias strips
    gauge_length: float = 20.0  # mm, if the project has no strips
    increments: int = 20  # number of increments of the model and of loads of a curve
    specimens: int = 3
    scatter: float = 0.04  # of the largest load if unknown; published strips have 2, 6 and 4 %


CANDIDATES = CandidateStrips()


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return a candidate test for each direction, like the project's first strips or usual ones."""
    template = next((test for test in planning.present if isinstance(test, PreparedStrips)), None)
    angles = {*CANDIDATES.angles}
    if template is not None:
        angles.add(template.test.bias_angle)
    pulls = {"warp strip": ("warp", 45.0), "fill strip": ("fill", 45.0)}
    pulls |= {f"strip at {angle:g} degrees": ("bias", angle) for angle in sorted(angles)}
    return [
        Candidate(
            name,
            partial(
                _computed,
                name,
                direction,
                angle,
                template,
                planning,
            ),
            planning.noise_is(template),
            CANDIDATES.specimens,
        )
        for name, (direction, angle) in pulls.items()
    ]


def _computed(
    name: str,
    direction: str,
    angle: float,
    template: PreparedStrips | None,
    planning: Planning,
) -> PreparedStrips:
    """Return a strip test with the loads that the current law predicts, one for each increment.

    The strip has the final length of the project's strip, or else is pulled to the end of the law's
    range of strain. `angle` is in degrees, from the pull to the warp of a bias strip.
    """
    strip = _strip_like(template, direction, angle, planning)
    test = StripsTest(
        name=name,
        place=planning.place,
        weight=1.0,
        width=WIDTH if template is None else template.test.width,
        grip_distance=GRIP_DISTANCE if template is None else template.test.grip_distance,
        bias_angle=angle,
        increments=CANDIDATES.increments,
        strips={direction: strip},
        match_by="points",
        weights=dict.fromkeys(DIRECTIONS, 1.0),
        objective="N",
        side_by_side=1 if template is None else template.test.side_by_side,
    )
    (model,) = test.models().values()
    load = planning.make_solver().run(model, planning.law).load
    noise = _noise(direction, template, planning, len(load), float(np.abs(load).max()))
    curve = LoadCurve(direction, "computed", np.array(model.elongations), load, None)
    computed = replace(strip, curves=(curve,))
    return PreparedStrips(replace(test, strips={direction: computed}, noise=noise))


def _strip_like(
    template: PreparedStrips | None,
    direction: str,
    angle: float,
    planning: Planning,
) -> Strip:
    """Return a strip without data, with the lengths of the project's strip where it has one."""
    strip = None if template is None else template.test.strips.get(direction)
    gauge_length = CANDIDATES.gauge_length if strip is None else strip.gauge_length
    final_length = gauge_length * math.exp(_end_strain(direction, angle, planning))
    if template is not None and strip is not None:
        has_angle = direction != "bias" or angle == template.test.bias_angle
        final_length = strip.final_length if has_angle else final_length
    return Strip(direction, gauge_length, final_length)


def _end_strain(direction: str, angle: float, planning: Planning) -> float:
    """Return the logarithmic strain of the gauge at which the range of the law ends.

    A bias strip keeps its area: at strain e its shear is 2 sin(2 angle) e, and the strain of the
    yarn closer to the pull is cos(2 angle) e. The one that is first at the end of its range counts.
    """
    warp, fill, shear = planning.ends.tolist()
    if direction != "bias":
        return float(warp if direction == "warp" else fill)
    double_angle = math.radians(2 * angle)
    strain_of_yarn = math.cos(double_angle)
    by_shear = shear / (2 * math.sin(double_angle))
    if abs(strain_of_yarn) <= 1e-9:
        return float(by_shear)
    by_yarn = (warp if angle < 45 else fill) / abs(strain_of_yarn)
    return float(min(by_shear, by_yarn))


def _noise(
    direction: str,
    template: PreparedStrips | None,
    planning: Planning,
    values: int,
    largest: float,
) -> float:
    """Return the noise (N) that each of so many loads has if all their errors are independent.

    It is that of the project's strips of the same direction, or else of its other directions, or
    else a usual one. `values` is the number of loads, `largest` the largest load (N).
    """
    if planning.noise is not None:
        return planning.noise
    if template is None:
        return CANDIDATES.scatter * largest * math.sqrt(values / PLACES_OF_SPECIMEN)
    test = template.test
    by_direction = {
        matched: _noise_of_specimen(matched, template, planning, values) for matched in test.matched
    }
    if direction in by_direction:
        return by_direction[direction]
    models = test.models()
    relative = []
    for matched, noise in by_direction.items():
        _, load = loads_to_match(test, test.strips[matched], models[matched])
        relative.append(noise / float(np.abs(load).max()))
    return max(relative) * largest


def _noise_of_specimen(
    direction: str,
    template: PreparedStrips,
    planning: Planning,
    values: int,
) -> float:
    """Return the noise (N) that each of `values` independent loads of one specimen has."""
    test = template.test
    precision = planning.precision[template.part(direction)]
    specimens = len(test.strips[direction].curves) or test.specimen_count or 1
    if test.match_by == "points":
        precision = replace(precision, value_count=max(1, precision.value_count // specimens))
    else:  # one curve of all of them: one specimen says so much less
        precision = replace(precision, correlated_count=precision.correlated_count * specimens)
    return precision.for_values(values)
