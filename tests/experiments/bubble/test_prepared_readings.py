"""experiments/bubble/prepared_readings.py: comparisons with readings, and doubts about them."""

import warnings
from dataclasses import replace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.experiments.bubble.prepared_readings import PreparedReadings
from bubblefit.experiments.doubts import UNKNOWN, Expected
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.gauges import LAW, PRESSURES, THICKNESS, gauge_heights
from ...builders.projects import fit_setup

PLACES = [[0.0, 0.0], [50.0, 0.0], [0.0, 50.0]]
FABRIC = bf.Fabric("", THICKNESS)
BOUNDS = {"E1": [20.0, 3000.0], "E2": [20.0, 3000.0], "G12": [1.0, 300.0]}
CONSTANT = bf.Law("constant", bounds=BOUNDS)


def gauged(heights, places=PLACES, **keys):
    shared = {"radius": 100.0, "elements": 108, "symmetry": "quarter", "noise": 0.05}
    return bf.Bubble.heights(PRESSURES, heights, places=places, **{**shared, **keys})


def prepared_of(bubble):
    setup = fit_setup(bf.Project.of(bubble, fabric=FABRIC, law=CONSTANT))
    (prepared,) = setup.tests
    return prepared


@pytest.fixture(scope="module")
def heights():
    return gauge_heights(PLACES).T


def test_finer_models_read_the_same_readings(heights):
    prepared = prepared_of(gauged(heights, elements=48))
    assert isinstance(prepared, PreparedReadings)
    coarse = prepared.comparisons(MembraneSolver, Weighting())[0]
    fine = prepared.finer(MembraneSolver, Weighting(), 2.0)[0]
    assert len(fine.model.mesh.quads) > 2 * len(coarse.model.mesh.quads)
    errors = [
        np.abs(c.objective.residual(c.solver.run(c.model, LAW)) * c.objective.scale).max()
        for c in (coarse, fine)
    ]
    assert errors[1] < 0.5 * errors[0] < 0.5


def test_masks_leave_out_readings(heights):
    prepared = prepared_of(gauged(heights))
    mask = np.zeros(3 * len(PRESSURES), dtype=bool)
    mask[len(PRESSURES) :: 2] = True
    (comparison,) = prepared.comparisons(MembraneSolver, Weighting(), {"bubble": mask})
    assert comparison.objective.sizes == (3, 3)
    assert not prepared.comparisons(MembraneSolver, Weighting(), {"bubble": ~mask & mask})


def test_three_gauges_tell_warp_from_fill(heights):
    noise = 0.05 * np.random.default_rng(4).standard_normal(heights.shape)
    fit = bf.fit(gauged(heights + noise, elements=48), law=CONSTANT, fabric=FABRIC, starts=1)
    residuals = fit.residuals()
    curves = fit.curves()
    assert [label.split(" at ")[0] for label in curves] == ["bubble height"] * 3
    for curve in curves.values():
        assert len(curve) == len(PRESSURES) and curve["pressure_kPa"].is_monotonic_increasing
    assert pd.concat(curves)["measured"].tolist() == residuals["measured"].tolist()
    sure = fit.best.certainty
    for name, modulus in (("E1", 700.0), ("E2", 300.0)):
        band = sure.moduli[name]
        assert band.lower[0] < modulus < band.upper[0] < 1.4 * band.lower[0]


def test_doubts_of_heights(heights):
    prepared = prepared_of(gauged(heights[:1], places=None))
    expected = UNKNOWN

    def doubt_names(**changes):
        series = replace(prepared.readings.series[0], **changes)
        readings = replace(prepared.readings, series=(series,))
        changed = PreparedReadings(replace(prepared.test, data=readings))
        return [doubt.name for doubt in changed.doubts(expected)]

    apex = prepared.readings.series[0].value
    assert doubt_names() == []
    assert doubt_names(value=apex / 1000) == ["height-unit"]
    assert doubt_names(value=25.4 * apex) == ["height-unit"]
    assert doubt_names(value=5 * apex) == ["radius"]
    assert doubt_names(value=-apex) == ["height-falls"]
    directions, _ = np.linalg.qr(np.vander(PRESSURES, 3, increasing=True))
    rising = directions[:, 1] * np.sign(directions[-1, 1])
    for correlation, doubt in ((-0.45, False), (-0.55, True)):
        across = np.sqrt(1.0 - correlation**2) * directions[:, 2]
        value = 20.0 + correlation * rising + across
        assert ("height-falls" in doubt_names(value=value)) is doubt
    assert doubt_names(value=1e3 * np.array(PRESSURES), pressure=apex) == ["radius", "exchanged"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        single = {"positions": np.zeros((1, 2)), "specimens": np.zeros(1, dtype=int)}
        pressure = np.array(PRESSURES[:1])
        assert doubt_names(value=apex[:1], pressure=pressure, **single) == []


@pytest.mark.parametrize(("offset", "doubt"), [(0.0, []), (0.3, []), (3.0, ["not-zeroed"])])
def test_gauge_that_was_not_zeroed_is_doubted(heights, offset, doubt):
    """It reads as much without pressure; what it reads after the inflation tells nothing."""
    pressures = [0.0, 0.0, *PRESSURES, 0.0]
    read = np.array([[0.0, 0.0, *heights[0], 5.0]]) + offset
    keys = {"radius": 100.0, "elements": 48, "symmetry": "quarter", "noise": 0.05}
    for nuisance in ({}, {"height_offset": 5.0}):
        bubble = bf.Bubble.heights(pressures, read, nuisance=nuisance, **keys)
        names = [found.name for found in prepared_of(bubble).doubts(UNKNOWN)]
        assert names == (doubt if not nuisance else [])


@pytest.mark.parametrize(("order", "left_out"), [("rising", 0), ("release", 3), ("shuffled", 5)])
def test_readings_of_a_release_that_are_left_out_are_counted(heights, order, left_out):
    rows = np.arange(len(PRESSURES))
    rows = {"rising": rows, "release": [*rows, 4, 2, 0], "shuffled": [3, 0, 2, 5, 1, 4]}[order]
    pressures = [0.0, *np.array(PRESSURES)[rows]]
    read = [[0.0, *heights[0][rows]]]
    keys = {"radius": 100.0, "elements": 48, "symmetry": "quarter", "noise": 0.05}
    doubts = prepared_of(bf.Bubble.heights(pressures, read, **keys)).doubts(UNKNOWN)
    assert [doubt.name for doubt in doubts] == ["left-out"] * (left_out > 0)
    assert not left_out or doubts[0].text.startswith(f"{left_out} readings under pressure are left")
    second = [0.0, *PRESSURES, 0.0, *PRESSURES]
    read = [[0.0, *heights[0], 0.0, *heights[0]]]
    bubble = bf.Bubble.heights(second, read, inflation=2, **keys)
    assert not prepared_of(bubble).doubts(UNKNOWN)


@pytest.mark.parametrize(
    ("strain", "curvature", "sure"),
    [
        (1.0, 1.0, None), (100.0, 1.0, True), (0.01, 1.0, True), (1.0, 0.5, False),
        (1.0, 2.0, False), (1.0, 1e-3, True), (0.0, 1.0, True), (1.4, 1.0, None),
    ],
)  # fmt: skip
def test_strains_of_the_apex_go_with_its_curvature(heights, strain, curvature, sure):
    prepared = prepared_of(gauged(heights[:1], places=None))
    (series,) = prepared.readings.series
    of_strain = replace(series, quantity="strain", value=strain * 2 / 3 * (series.value / 100) ** 2)
    value = curvature * 2 * series.value / 100**2
    readings = replace(
        prepared.readings, series=(of_strain, replace(series, quantity="curvature", value=value))
    )
    changed = PreparedReadings(replace(prepared.test, data=readings))
    doubts = changed.doubts(UNKNOWN)
    assert [(doubt.name, doubt.sure) for doubt in doubts] == [("strain-rise", sure)] * (
        sure is not None
    )


@pytest.mark.parametrize(("offset", "names"), [(0.0, []), (1.0, []), (12.5, ["not-zeroed"])])
def test_heights_that_end_above_the_rim_are_doubted(heights, offset, names):
    prepared = prepared_of(gauged(heights + offset))
    assert [doubt.name for doubt in prepared.doubts(UNKNOWN)] == names
    prepared = prepared_of(gauged(heights + offset, nuisance={"height_offset": 20.0}))
    assert not prepared.doubts(UNKNOWN)


@pytest.mark.parametrize(("air", "is_doubted"), [(0.0, False), (0.1013, True), (0.3, False)])
def test_absolute_pressures_are_doubted(heights, air, is_doubted):
    keys = {"radius": 100.0, "elements": 48, "symmetry": "quarter", "noise": 0.05}
    bubble = bf.Bubble.heights(np.array(PRESSURES) + air, heights[:1], **keys)
    doubts = prepared_of(bubble).doubts(UNKNOWN)
    assert [doubt.name for doubt in doubts] == ["pressure-unit"] * is_doubted
    assert not is_doubted or "about the air's: is it absolute" in doubts[0].text


@pytest.mark.parametrize(
    ("radius", "places", "changes", "names"),
    [
        (100.0, PLACES, {}, []), (200.0, PLACES, {}, ["radius", "pressure-unit"]),
        (51.0, PLACES, {}, ["radius", "pressure-unit"]),
        (100.0, [[0.0, 0.0], [10.0, 0.0], [0.0, 10.0]], {}, []),
        (100.0, PLACES, {"places": [[0.0, 0.0], [90.0, 0.0], [0.0, 90.0]]}, ["radius"]),
        # Bar under a heading of kPa, and a height in cm.
        (100.0, PLACES, {"pressures": 0.01}, ["pressure-unit"]),
        (100.0, PLACES, {"heights": 0.1}, ["pressure-unit"]),
        (200.0, None, {}, ["pressure-unit"]), (100.0, None, {}, []),
    ],
)  # fmt: skip
def test_radius_and_units_of_gauges_are_judged(radius, places, changes, names):
    heights = gauge_heights(places or [[0.0, 0.0]]).T * changes.get("heights", 1.0)
    pressures = np.array(PRESSURES) * changes.get("pressures", 1.0)
    keys = {"radius": radius, "elements": 48, "symmetry": "quarter", "noise": 0.05}
    places = changes.get("places", places)
    prepared = prepared_of(bf.Bubble.heights(pressures, heights, places=places, **keys))
    bounds = {"E1": (500.0, 1000.0), "E2": (200.0, 1000.0)}
    doubts = prepared.doubts(Expected(bounds))
    assert [doubt.name for doubt in doubts] == names
    assert [doubt.sure for doubt in doubts] == [name == "pressure-unit" for name in names]


def test_heights_of_the_centre_give_a_modulus_in_closed_form(heights):
    estimate = prepared_of(gauged(heights)).closed_form(LAW)
    assert len(estimate.modulus) == len(PRESSURES)
    # The balanced sheet of these moduli has 458 MPa, the closed form is within 13 % of it.
    assert np.median(estimate.modulus) == pytest.approx(458.0, rel=0.13)
    assert prepared_of(gauged(heights[1:2], places=[[50.0, 0.0]])).closed_form(LAW) is None


def test_sheet_and_gauges_have_priors_of_their_noise(heights):
    sheet = {"modes": 1, "prior": 0.4}
    keys = {"pressure_offset": True, "height_offset": 0.2, "height_scale": 0.05}
    prepared = prepared_of(gauged(heights[:1], places=None, sheet=sheet, nuisance=keys))
    (comparison,) = prepared.comparisons(MembraneSolver, Weighting())
    priors = {n.name: n.prior for n in comparison.nuisance}
    assert priors == {
        "pressure_offset": None,
        "z0_1": 0.4,
        "height_offset_1": 0.2,
        "height_scale": pytest.approx(5.0),
    }
    scale = comparison.objective.scale[0]
    assert comparison.nuisance[1].weight == pytest.approx(0.05 / scale)


def test_places_may_be_points_of_the_sheet(heights):
    for is_moving in (False, True):
        series = prepared_of(gauged(heights, moves_with_sheet=is_moving)).readings.series
        assert {s.moves_with_sheet for s in series} == {is_moving}
