"""experiments/bubble/planning.py: bubbles proposed as next tests."""

from pathlib import Path

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.base import Planning, Precision, Weighting
from bubblefit.experiments.bubble.planning import CANDIDATES, USUAL, candidates
from bubblefit.experiments.sections import Fabric, Place
from bubblefit.inference.linear import information_of
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup, known_bubble

PLACE = Place(Path("p.toml"), "bubble", Fabric("made", 0.8))
BOUNDS = {"E1": [20.0, 3000.0], "E2": [20.0, 3000.0], "G12": [1.0, 300.0]}
LAW = HypoelasticLaw.linear(400.0, 250.0, 12.0, 0.2)


def planning_of(noise=None, ends=(0.1, 0.08, 0.2)):
    law = HypoelasticLaw(LAW.beta, LAW.nu12, ends, form=LAW.form)
    return Planning(PLACE, (), {}, law, MembraneSolver, noise)


def test_usual_bubble_higher_and_elliptic_ones_are_proposed():
    proposed = candidates(planning_of())
    names = [candidate.name for candidate in proposed]
    assert names[0] == "bubble" and names[1].startswith("bubble to ")
    angles = [f"bubble, elliptic rim at {angle:g} degrees" for angle in CANDIDATES.angles]
    assert names[2:] == angles and {candidate.noise_is for candidate in proposed} == {"assumed"}


def test_usual_bubble_is_strained_about_as_far_as_planned():
    prepared = candidates(planning_of())[0].make()
    assert [field.pressure for field in prepared.fields] == list(prepared.test.pressures)
    ratios = np.array(prepared.test.pressures) / prepared.test.pressures[-1]
    assert tuple(ratios) == pytest.approx(USUAL.levels)
    model = prepared.test.model()
    strain = MembraneSolver().run(model, planning_of().law).strain_max[:2].max()
    assert 0.5 < strain / (USUAL.strain_share * 0.08) < 2.0


def test_data_are_the_displacements_of_the_law_at_the_nodes():
    prepared = candidates(planning_of())[0].make()
    model = prepared.test.model()
    history = MembraneSolver().run(model, planning_of().law)
    heights = [field.displacement[:, 2].max() for field in prepared.fields]
    np.testing.assert_allclose(heights, history.displacement[:, :, 2].max(axis=1), rtol=1e-6)


def test_higher_bubble_has_further_pressures():
    usual, higher = (candidate.make().test for candidate in candidates(planning_of())[:2])
    highest = usual.pressures[-1]
    expected = (*usual.pressures, *(factor * highest for factor in CANDIDATES.higher))
    assert higher.pressures == pytest.approx(expected)


def test_elliptic_bubble_keeps_its_major_axis_and_is_strained_alike():
    proposed = candidates(planning_of())
    usual, elliptic = proposed[0].make(), proposed[2].make()
    outline = elliptic.test.outline
    assert (outline.major, outline.minor) == pytest.approx(
        (USUAL.radius, CANDIDATES.slenderness * USUAL.radius)
    )
    strains = [
        MembraneSolver().run(prepared.test.model(), planning_of().law).strain_max[:2].max()
        for prepared in (usual, elliptic)
    ]
    assert strains[1] == pytest.approx(strains[0], rel=0.5)


def test_given_noise_is_that_of_as_many_independent_values():
    candidate = candidates(planning_of(noise=0.02))[0]
    test = candidate.make().test
    nodes = len(test.model().mesh.points)
    assert test.noise == pytest.approx(0.02 * np.sqrt(nodes / USUAL.points))
    assert candidate.noise_is == "given"


def test_bubble_of_the_project_is_proposed_again(tmp_path):
    (present,) = fit_setup(known_bubble(tmp_path)).tests
    name = present.test.name
    precision = {name: Precision(0.03, 4.0, 100)}
    planning = Planning(PLACE, (present,), precision, planning_of().law, MembraneSolver)
    again = candidates(planning)[0]
    assert (again.name, again.noise_is) == ("the same bubble again", f"that of {name}")
    assert again.make().test.pressures == present.test.pressures


def test_beside_a_gauge_further_gauges_and_an_ellipse_tell_warp_from_fill():
    """By the information of each: E1 and E2 trade in all readings of the apex of a circle."""
    bubble = bf.Bubble.heights(
        (0.02, 0.1), (10.0, 20.0), radius=100.0, elements=12, symmetry="quarter", noise=0.05
    )
    project = bf.Project.of(bubble, fabric=PLACE.fabric, law=bf.Law("constant", bounds=BOUNDS))
    setup = fit_setup(project)
    unknowns = setup.problem().unknowns
    planning = Planning(PLACE, setup.tests, {}, HypoelasticLaw.linear(700, 300, 15), MembraneSolver)
    trade = {}
    for candidate in candidates(planning):
        if "45" not in candidate.name:
            (comparison,) = candidate.make().comparisons(MembraneSolver, Weighting(relative=False))
            values = np.linalg.eigvalsh(information_of(comparison, planning.law, unknowns)[0])
            trade[candidate.name] = values[-1] / values[-2]
    circle = trade.pop("the same readings again")
    assert [*trade] == [
        "gauges at the apex and 50 mm along the warp",
        "gauges at the apex and 50 mm along the fill",
        "gauges at the apex and 50 mm along warp and fill",
        "elliptic rim at 0 degrees, gauge at its apex",
        "elliptic rim at 90 degrees, gauge at its apex",
    ]
    assert max(trade.values()) < 0.2 * circle
