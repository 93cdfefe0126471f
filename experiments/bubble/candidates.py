"""Bubble tests that could be made next: the same again, to more pressure, with an elliptic rim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import default_increments
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ..kinds import Candidate, Planning, Precision
from .objective import CORRELATION, folded
from .prepared import PreparedBubble
from .section import Sheet
from .sheet import FLAT, with_sheet
from .test import BubbleTest, KnownSolution

Array = NDArray[np.float64]

#: Of the highest pressure of the project's own test: frames of one to more pressure.
FURTHER = (1.25, 1.5)
#: Minor over major semi-axis of an elliptic rim, and degrees from the warp to the major one.
SLENDER, ANGLES = 0.5, (0.0, 45.0, 90.0)
#: Where the project has no bubble: mm, quads of the full disk, places a frame, and pressures in
#: shares of the highest one.
RADIUS, ELEMENTS, PLACES = 100.0, 432, 400
LEVELS = (0.1, 0.25, 0.45, 0.7, 1.0)
#: Of the strains that the law is known for: what such a bubble is to reach.
REACHED = 0.7


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return variants of the project's first bubble, or of a usual one where there is none."""
    own = [test for test in planning.present if isinstance(test, PreparedBubble)]
    if own:
        first, noise_is = own[0].test, f"that of {own[0].test.name}"
        sight = planning.precision[first.name]
    else:
        first, noise_is = _usual(planning), "assumed"
        sight = Precision(CORRELATION, 1.0, PLACES)
    if planning.noise is not None:
        sight, noise_is = replace(sight, noise=planning.noise), "given"
    first = _as_planned(first)
    tests = {"the same bubble again" if own else "bubble": first}
    top = first.pressures[-1]
    tests[f"bubble to {1e3 * FURTHER[-1] * top:.4g} kPa"] = _to(first, [f * top for f in FURTHER])
    for angle in ANGLES:
        tests[f"bubble, elliptic rim at {angle:g} degrees"] = _elliptic(first, angle)
    return [
        Candidate(name, partial(_made, test, sight, planning), noise_is)
        for name, test in tests.items()
    ]


def _made(test: BubbleTest, sight: Precision, planning: Planning) -> PreparedBubble:
    """Return the test with the law's displacements at the nodes of its model."""
    law = planning.law
    model = with_sheet(test.model(), test.sheet, test.outline, FLAT)
    history = planning.make_solver().run(model, law)
    nodes = model.mesh.points[:, :2]
    test = replace(test, noise=sight.at(len(nodes)))
    fields = tuple(
        DisplacementField(p, nodes, u)
        for p, u in zip(test.pressures, np.asarray(history.displacement), strict=True)
    )
    if test.symmetry == "quarter":
        fields = tuple(folded(field) for field in fields)
    return PreparedBubble(test, fields, (), law, by_this_model=True)


def _as_planned(test: BubbleTest) -> BubbleTest:
    """Return the test as it would be made: matched at points, in millimetres, its rim at rest."""
    sheet = replace(test.sheet, measured=False, moving_rim=False)
    return replace(test, match_by="points", objective="mm", sheet=sheet)


def _to(test: BubbleTest, more: Sequence[float]) -> BubbleTest:
    further = tuple(more)
    return replace(
        test, pressures=(*test.pressures, *further), increments=(*test.increments, *further)
    )


def _elliptic(test: BubbleTest, angle: float) -> BubbleTest:
    """Return the test with a rim as long as its own, at pressures that strain it about as much.

    Of a shallow dome of height h, p = h (N1/a^2 + N2/b^2) up to a factor; alike strained it is h
    that goes with the minor semi-axis b.
    """
    major = test.outline.major
    rim = Outline(major, SLENDER * major, angle)
    radius = test.outline.radius
    curved = rim.minor * (rim.major**-2 + rim.minor**-2)
    times = curved * radius / 2.0
    symmetry = test.symmetry if rim.doubly_symmetric else "full"
    return replace(
        test,
        outline=rim,
        symmetry=symmetry,
        pressures=tuple(times * p for p in test.pressures),
        increments=tuple(times * p for p in test.increments),
    )


def _usual(planning: Planning) -> BubbleTest:
    """Return a circular test, to a pressure that strains the sheet as far as the law is known."""
    law, ends = planning.law, planning.ends
    top = _pressure(law, REACHED * float(min(ends[:2])), planning.place.fabric.thickness)
    pressures = tuple(share * top for share in LEVELS)
    increments = default_increments(pressures)
    return BubbleTest(
        name="bubble",
        place=planning.place,
        weight=1.0,
        outline=Outline.circle(RADIUS),
        elements=ELEMENTS,
        symmetry="quarter",
        generator="blocks",
        pressures=pressures,
        increments=increments,
        data=KnownSolution(law.beta, law.form.name, ELEMENTS, increments, "quarter"),
        match_by="points",
        match_degree=4,
        objective="mm",
        displacement_offset=False,
        pressure_offset=False,
        sheet=Sheet(),
    )


def _pressure(law: HypoelasticLaw, strain: float, thickness: float) -> float:
    """Return MPa at which a shallow cap of the usual radius is strained so far in its middle.

    Strain 2/3 (h/R)^2, curvature 2 h/R^2, tension that of the mean of both moduli.
    """
    along = np.linspace(0.0, strain, 21)
    mean = np.mean([law.modulus(name, along).mean() for name in ("E1", "E2")])
    tension = float(mean) * strain * thickness / (1.0 - law.nu12)
    height = RADIUS * float(np.sqrt(1.5 * strain))
    return 4.0 * height * tension / RADIUS**2
