"""Bubble tests that a plan proposes: the same again, to higher pressure, with elliptic rims.

Beside tests without cameras these are further gauges, and an elliptic rim with a gauge at its apex.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...meshes.bubble_model import default_increments
from ...meshes.disk import Outline
from ...readers.fields import DisplacementField
from ...solvers.base import Array
from ..base import Candidate, Planning, Precision
from . import BubbleTest, KnownSolution
from .field_shape import folded
from .objective import CORRELATION
from .prepared import PreparedBubble
from .prepared_readings import PreparedReadings
from .readings import UNITS, GaugeReadings, ReadingSeries
from .section import SheetSettings
from .sheet import FLAT, with_sheet


@dataclass(frozen=True)
class CandidateBubbles:
    """The variants of a bubble test that a plan proposes."""

    higher: tuple[float, ...] = (1.25, 1.5)  # pressures of further frames / highest of the test
    slenderness: float = 0.5  # minor / major semi-axis of an elliptic rim
    angles: tuple[float, ...] = (0.0, 45.0, 90.0)  # degrees, from the warp to the major semi-axis
    gauge: float = 0.5  # distance of further gauges from the apex / radius


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
    gauged = [test for test in planning.present if isinstance(test, PreparedReadings)]
    if gauged and not bubbles:
        return _gauge_candidates(gauged[0], planning)
    test, precision = _template(bubbles, planning)
    test = _as_it_would_be_made(test)
    tests = {"the same bubble again" if bubbles else "bubble": test}
    further = tuple(factor * test.pressures[-1] for factor in CANDIDATES.higher)
    tests[f"bubble to {1e3 * further[-1]:.4g} kPa"] = replace(
        test, pressures=(*test.pressures, *further), increments=(*test.increments, *further)
    )
    for angle in CANDIDATES.angles:
        tests[f"bubble, elliptic rim at {angle:g} degrees"] = _elliptic(test, angle)
    noise_is = planning.noise_is(bubbles[0] if bubbles else None)
    return [
        Candidate(name, partial(_computed, variant, precision, planning), noise_is)
        for name, variant in tests.items()
    ]


def _template(
    bubbles: Sequence[PreparedBubble], planning: Planning
) -> tuple[BubbleTest, Precision]:
    """Return the test that candidates vary, and the precision of its data."""
    if bubbles:
        test = bubbles[0].test
        precision = planning.precision[test.name]
    else:
        test = _usual_test(planning)
        precision = Precision(CORRELATION, 1.0, USUAL.points)
    if planning.noise is None:
        return test, precision
    return test, replace(precision, noise=planning.noise)


def _gauge_candidates(prepared: PreparedReadings, planning: Planning) -> list[Candidate]:
    """Return candidates beside readings: these again, gauges off the apex, an elliptic rim."""
    test = _as_it_would_be_made(prepared.test)
    noise = planning.noise or test.noise or UNITS["height"].noise
    test = replace(test, noise=noise)
    pressure = np.sort(prepared.readings.series[0].pressure)
    distance = CANDIDATES.gauge * test.outline.radius
    apex = (0.0, 0.0)
    places = {"warp": (distance, 0.0), "fill": (0.0, distance)}
    tests = {"the same readings again": test}
    for yarn, place in places.items():
        name = f"gauges at the apex and {distance:g} mm along the {yarn}"
        tests[name] = _with_gauges(test, pressure, (apex, place))
    name = f"gauges at the apex and {distance:g} mm along warp and fill"
    tests[name] = _with_gauges(test, pressure, (apex, *places.values()))
    for angle in CANDIDATES.angles:
        rim = _elliptic(test, angle)
        scaled = pressure * rim.pressures[-1] / test.pressures[-1]
        name = f"elliptic rim at {angle:g} degrees, gauge at its apex"
        tests[name] = _with_gauges(rim, scaled, (apex,))
    return [
        Candidate(name, partial(PreparedReadings, variant), planning.noise_is())
        for name, variant in tests.items()
    ]


def _with_gauges(
    test: BubbleTest, pressure: Array, places: Sequence[tuple[float, float]]
) -> BubbleTest:
    """Return the test with gauges at places (mm); no information depends on their readings.

    Parameters
    ----------
    pressure : (n,) array, MPa
        At which each gauge is read.
    """
    count = len(pressure)
    series = [
        ReadingSeries(
            quantity="height",
            label=f"height at ({x:g}, {y:g}) mm",
            pressure=pressure,
            value=np.full(count, test.outline.radius),
            positions=np.tile((x, y), (count, 1)),
            specimens=np.zeros(count, dtype=np.intp),
        )
        for x, y in places
    ]
    return replace(test, data=GaugeReadings(tuple(series)))


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
        for pressure, displacement in zip(test.pressures, history.displacement, strict=True)
    )
    if test.symmetry == "quarter":
        fields = tuple(folded(field) for field in fields)
    return PreparedBubble(test, fields, (), law, by_this_model=True)


def _elliptic(test: BubbleTest, angle: float) -> BubbleTest:
    """Return the test with an elliptic rim of the same major semi-axis, strained about as much.

    A shallow dome of height h on semi-axes a and b with membrane forces N1 and N2 needs a pressure
    proportional to h (N1/a^2 + N2/b^2). At equal strain, h is proportional to the minor semi-axis
    b.

    Parameters
    ----------
    angle : float, degrees
        From the warp to the major semi-axis.
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
        displacement_offset=False,  # computed data have no offset that a fit could look for
        pressure_offset=False,
        sheet=SheetSettings(),
    )
