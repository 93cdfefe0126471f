"""Strip tests that could be made next: along the yarns, and at angles to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...meshes.strip_models import GRIP_DISTANCE, WIDTH
from ...readers.curves import DIRECTIONS, LoadCurve
from ..kinds import Candidate, Planning
from .data import Strip
from .prepared import PLACES, PreparedStrips, loads_to_match
from .test import StripsTest

#: Degrees from the pull to the warp yarn, of strips across the yarns.
ANGLES = (30.0, 45.0, 60.0)
#: Where the project has no strips: mm of the gauge, increments and values of a curve, specimens.
GAUGE, INCREMENTS, SPECIMENS = 20.0, 20, 3
#: Of the largest load: scatter of specimens where none is known. That of the published strips is
#: 2, 6 and 4 % (examples/uniaxial-valmex7318/curves.csv).
SCATTER = 0.04


@dataclass(frozen=True)
class Pull:
    """A strip that could be pulled: its direction (warp, fill, bias) and its angle in degrees."""

    direction: str
    angle: float

    @property
    def name(self) -> str:
        """Return a readable name."""
        if self.direction != "bias":
            return f"{self.direction} strip"
        return f"strip at {self.angle:g} degrees"


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return each direction by itself, after the project's first strips or usual ones."""
    own = [test for test in planning.present if isinstance(test, PreparedStrips)]
    template = own[0] if own else None
    angles = dict.fromkeys([*ANGLES, *([template.test.bias_angle] if template else [])])
    pulls = [Pull("warp", 0.0), Pull("fill", 90.0), *(Pull("bias", a) for a in sorted(angles))]
    noise_is = "assumed" if template is None else f"that of {template.test.name}"
    if planning.noise is not None:
        noise_is = "given"
    return [
        Candidate(pull.name, partial(_made, pull, template, planning), noise_is, SPECIMENS)
        for pull in pulls
    ]


def _made(pull: Pull, template: PreparedStrips | None, planning: Planning) -> PreparedStrips:
    """Return the strip with the loads that the law gives, one value an increment.

    It is as long as the project's own, else pulled up to the end of the known law.
    """
    own = None if template is None else template.test
    strip = None if own is None else own.strips.get(pull.direction)
    gauge = GAUGE if strip is None else strip.gauge_length
    final = gauge * math.exp(_strain(pull, planning))
    if own is not None and strip is not None:
        alike = pull.direction != "bias" or pull.angle == own.bias_angle
        final = strip.final_length if alike else final
    strip = Strip(pull.direction, gauge, final)
    test = StripsTest(
        name=pull.name,
        place=planning.place,
        weight=1.0,
        width=WIDTH if own is None else own.width,
        grip_distance=GRIP_DISTANCE if own is None else own.grip_distance,
        bias_angle=pull.angle if pull.direction == "bias" else 45.0,
        increments=INCREMENTS,
        strips={pull.direction: strip},
        match_by="points",
        weights=dict.fromkeys(DIRECTIONS, 1.0),
        objective="N",
    )
    (model,) = test.models().values()
    load = np.asarray(planning.make_solver().run(model, planning.law).load)
    noise = _noise(pull, template, planning, len(load), float(np.abs(load).max()))
    curve = LoadCurve(pull.direction, "computed", np.array(model.elongations), load, None)
    done = replace(strip, curves=(curve,))
    return PreparedStrips(replace(test, strips={pull.direction: done}, noise=noise))


def _strain(pull: Pull, planning: Planning) -> float:
    """Return the logarithmic strain of the gauge where a yarn, or the shear, is at its end.

    A strip across the yarns keeps its area: shear 2 sin(2 angle) e, the nearer yarn cos(2 angle) e.
    """
    warp, fill, shear = planning.ends.tolist()
    if pull.direction != "bias":
        return float(warp if pull.direction == "warp" else fill)
    turn = math.radians(2 * pull.angle)
    along, end = math.cos(turn), warp if pull.angle < 45 else fill
    most = shear / (2 * math.sin(turn))
    return float(min(most, end / abs(along))) if abs(along) > 1e-9 else float(most)


def _noise(
    pull: Pull, template: PreparedStrips | None, planning: Planning, values: int, largest: float
) -> float:
    """Return the noise (N) of independent loads: of the own direction, the others, or usual."""
    if planning.noise is not None:
        return planning.noise
    if template is None:
        return SCATTER * largest * math.sqrt(values / PLACES)
    test, own = template.test, {}
    for d in test.matched:  # the precision of one specimen
        known = planning.precision[template.part(d)]
        specimens = len(test.strips[d].curves) or test.specimens or 1
        if test.match_by != "points":  # one curve of all of them: one says so much less
            known = replace(known, alike=known.alike * specimens)
        else:
            known = replace(known, values=max(1, known.values // specimens))
        own[d] = known.at(values)
    if pull.direction in own:
        return own[pull.direction]
    models = test.models()
    loads = {d: loads_to_match(test, test.strips[d], models[d])[1] for d in own}
    return max(noise / float(np.abs(loads[d]).max()) for d, noise in own.items()) * largest
