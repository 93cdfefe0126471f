"""Bubble tests that a plan proposes: the same again, to higher pressure, with elliptic rims."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...meshes.bubble_model import default_increments
from ...meshes.outline import Outline
from ...readers.fields import DisplacementField
from ..planning import Candidate, Planning, Precision
from .objective import CORRELATION
from .prepared import PreparedBubble
from .section import SheetSettings
from .sheet import FLAT, with_sheet
from .symmetry import folded
from .test import BubbleTest, KnownSolution


@dataclass(frozen=True)
class CandidateBubbles:
    """The variants of a bubble test that a plan proposes."""

    higher: tuple[float, ...] = (1.25, 1.5)  # pressures of further frames / highest of the test
    slenderness: float = 0.5  # minor / major semi-axis of an elliptic rim
    angles: tuple[float, ...] = (0.0, 45.0, 90.0)  # degrees, from the warp to the major semi-axis


@dataclass(frozen=True)
class UsualBubble:
    """The bubble that is proposed where the project has none."""

    radius: float = 100.0  # mm
    elements: int = 432  # quads of the full disk
    points: int = 400  # number of measured points of a frame
    levels: tuple[float, ...] = (0.1, 0.25, 0.45, 0.7, 1.0)  # pressures / highest pressure
    strain_share: float = 0.7  # strain at the highest pressure / largest strain worth testing


CANDIDATES = CandidateBubbles()
USUAL = UsualBubble()


def candidates(planning: Planning) -> Sequence[Candidate]:
    """Return candidates: variants of the project's first bubble, or of a usual one without any."""
    bubbles = [test for test in planning.present if isinstance(test, PreparedBubble)]
    if bubbles:
        test = bubbles[0].test
        noise_is = f"that of {test.name}"
        precision = planning.precision[test.name]
    else:
        test = _usual_test(planning)
        noise_is = "assumed"
        precision = Precision(CORRELATION, 1.0, USUAL.points)
    if planning.noise is not None:
        precision = replace(precision, noise=planning.noise)
        noise_is = "given"
    test = _as_it_would_be_made(test)
    tests = {"the same bubble again" if bubbles else "bubble": test}
    further = tuple(factor * test.pressures[-1] for factor in CANDIDATES.higher)
    tests[f"bubble to {1e3 * further[-1]:.4g} kPa"] = replace(
        test, pressures=(*test.pressures, *further), increments=(*test.increments, *further)
    )
    for angle in CANDIDATES.angles:
        tests[f"bubble, elliptic rim at {angle:g} degrees"] = _elliptic(test, angle)
    return [
        Candidate(name, partial(_computed, variant, precision, planning), noise_is)
        for name, variant in tests.items()
    ]


def _as_it_would_be_made(test: BubbleTest) -> BubbleTest:
    """Return the test as a new one: one inflation, points matched in mm, nothing measured yet.

    The rim is at rest, and the surface of the sheet is not measured.
    """
    if test.rising < len(test.pressures):
        pressures = test.pressures[: test.rising]
        test = replace(test, pressures=pressures, increments=default_increments(pressures))
    sheet = replace(test.sheet, measured=False, moving_rim=False)
    return replace(test, match_by="points", objective="mm", sheet=sheet)


def _computed(test: BubbleTest, precision: Precision, planning: Planning) -> PreparedBubble:
    """Return the prepared test whose data are the law's displacements at the model's nodes."""
    law = planning.law
    model = with_sheet(test.model(), test.sheet, test.outline, FLAT)
    history = planning.make_solver().run(model, law)
    nodes = model.mesh.points[:, :2]
    test = replace(test, noise=precision.for_values(len(nodes)))
    fields = tuple(
        DisplacementField(pressure, nodes, displacement)
        for pressure, displacement in zip(
            test.pressures, np.asarray(history.displacement), strict=True
        )
    )
    if test.symmetry == "quarter":
        fields = tuple(folded(field) for field in fields)
    return PreparedBubble(test, fields, (), law, by_this_model=True)


def _elliptic(test: BubbleTest, angle: float) -> BubbleTest:
    """Return the test with an elliptic rim of the same major semi-axis, strained about as much.

    A shallow dome of height h on semi-axes a and b with membrane forces N1 and N2 needs a pressure
    proportional to h (N1/a^2 + N2/b^2). At equal strain, h is proportional to the minor semi-axis
    b. angle : from the warp to the major semi-axis, degrees.
    """
    rim = Outline(test.outline.major, CANDIDATES.slenderness * test.outline.major, angle)
    curvature = rim.minor * (rim.major**-2 + rim.minor**-2)
    factor = curvature * test.outline.radius / 2.0
    return replace(
        test,
        outline=rim,
        symmetry=test.symmetry if rim.doubly_symmetric else "full",
        pressures=tuple(factor * pressure for pressure in test.pressures),
        increments=tuple(factor * pressure for pressure in test.increments),
    )


def _usual_test(planning: Planning) -> BubbleTest:
    """Return a circular test, to a pressure that strains the sheet as far as the law is known."""
    law = planning.law
    radius = USUAL.radius
    # A shallow cap of height h and radius R: strain 2/3 (h/R)^2, curvature 2 h/R^2 in both
    # directions; the membrane force follows from the mean modulus.
    strain = USUAL.strain_share * float(min(planning.ends[:2]))
    strains = np.linspace(0.0, strain, 21)
    modulus = np.mean([law.modulus(name, strains).mean() for name in ("E1", "E2")])
    tension = float(modulus) * strain * planning.place.fabric.thickness / (1.0 - law.nu12)
    highest = 4.0 * radius * float(np.sqrt(1.5 * strain)) * tension / radius**2
    pressures = tuple(level * highest for level in USUAL.levels)
    increments = default_increments(pressures)
    elements = USUAL.elements
    return BubbleTest(
        name="bubble",
        place=planning.place,
        weight=1.0,
        outline=Outline.circle(radius),
        elements=elements,
        symmetry="quarter",
        generator="blocks",
        pressures=pressures,
        increments=increments,
        data=KnownSolution(law.beta, law.form.name, elements, increments, "quarter"),
        match_by="points",
        match_degree=4,
        objective="mm",
        displacement_offset=False,
        pressure_offset=False,
        sheet=SheetSettings(),
    )
