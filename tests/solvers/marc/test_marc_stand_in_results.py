"""Through deck, stand-in and .t19 come the membrane's results, to six digits."""

from itertools import pairwise

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import bias_strip, straight_strip
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...fortran_build import BETA, LAWS
from ...marc_stand_in_runs import marc

__all__ = ["marc"]

#: Half a unit in the last of six digits.
ROUNDING = 5.1e-6
LAW = HypoelasticLaw(BETA, strain_range=np.full(3, 0.13))
PRESSURES = (0.006, 0.022, 0.059, 0.097)


def bubble(pressures=PRESSURES, increments=()):
    return BubbleModel(disk_mesh(100.0, 48, "quarter"), 0.81, pressures, increments)


def same(found, expected, reactions=True):
    u = expected.displacement
    # Small components are those of large ones minus others, at the solver's own tolerance.
    np.testing.assert_allclose(found.displacement, u, rtol=ROUNDING, atol=1e-9)
    np.testing.assert_allclose(found.load, expected.load, rtol=2 * ROUNDING)
    for name in expected.reactions if reactions else ():
        largest = np.abs(expected.reactions[name]).max()
        difference = np.abs(found.reactions[name] - expected.reactions[name]).max()
        assert difference <= 2 * ROUNDING * max(largest, np.abs(expected.load).max()), name


@pytest.mark.parametrize(
    ("law", "settings"),
    [
        (LAW, {}),
        (LAW, {"law": "hypela2", "element": 18, "options": "older", "threads": 2}),
        (LAWS["tri-linear"], {}),
        (LAWS["incompressible"], {"law": "hypela2", "element": 75}),
        (LAWS["spline"], {}),
        (LAWS["spline"], {"law": "hypela2"}),
    ],
    ids=["nlelast", "hypela2", "tri-linear", "incompressible", "spline", "spline hypela2"],
)
def test_bubble(marc, law, settings):
    found = marc.solver(**settings).run(bubble(), law)
    same(found, MembraneSolver().run(bubble(), law))
    assert marc.runs == ["job none"]


def test_marc_cuts_the_increments_of_a_bubble(marc):
    found = marc.solver(increments=12).run(bubble(), LAW)
    ends = np.array([0.0, *PRESSURES])
    finer = np.concatenate([a + (b - a) * np.arange(1, 4) / 3 for a, b in pairwise(ends)])
    expected = MembraneSolver().run(bubble(PRESSURES, finer), LAW)
    same(found, expected)
    # Mean moduli make little of the increments; still thirty times what `same` lets pass.
    coarse = MembraneSolver().run(bubble(), LAW)
    assert np.abs(coarse.displacement - expected.displacement).max() > 1e-4


@pytest.mark.parametrize(
    ("model", "settings"),
    [
        (straight_strip("warp", 50, 58, 0.81, increments=10), {"law": "hypela2"}),
        (straight_strip("fill", 50, 62, 0.81, increments=10), {}),
        # Grips beyond the gauge: pulled as far as the membrane says.
        (bias_strip(25, 30, 0.81, increments=8, across=4, along=12), {}),
        (bias_strip(25, 30, 0.81, increments=8, across=4, along=12), {"law": "hypela2"}),
    ],
    ids=["warp", "fill", "bias", "bias hypela2"],
)
def test_strip(marc, model, settings):
    found = marc.solver(**settings).run(model, LAW)
    # The bias strip is interpolated to the model's elongations, see docs/reference/marc-deck.md.
    expected = MembraneSolver().run(model, LAW)
    u = expected.displacement
    np.testing.assert_allclose(found.displacement, u, rtol=2 * ROUNDING, atol=1e-6)
    np.testing.assert_allclose(found.load, expected.load, rtol=2 * ROUNDING)


def test_cylinder(marc):
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, deflections=(1.0, 2.5, 5.0))
    # The stand-in's membrane carries compression.
    expected = MembraneSolver(wall="stiff").run(model, LAW)
    found = marc.solver().run(model, LAW)
    assert len(marc.runs) == 2  # inflation alone, and bending
    np.testing.assert_allclose(
        found.displacement[0], expected.displacement[0], rtol=ROUNDING, atol=1e-8
    )
    # Where the collar touches is known from the first job, to six digits of some 25 mm.
    place = ROUNDING * 25.0
    np.testing.assert_allclose(found.displacement, expected.displacement, rtol=ROUNDING, atol=place)
    steep = np.diff(expected.load, prepend=0.0)[1:] / np.diff([0.0, *model.deflections])
    assert (np.abs(found.load - expected.load)[1:] < place * steep + 1e-5 * expected.load[1:]).all()
    np.testing.assert_allclose(found.cavity_pressure, expected.cavity_pressure, rtol=2 * ROUNDING)
    np.testing.assert_allclose(found.cavity_volume, expected.cavity_volume, rtol=2 * ROUNDING)


def test_ends_of_a_cylinder(marc):
    """The second job is the bending: only one that stops early is reported, so far."""
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, deflections=(1.0, 2.0, 3.0, 4.0))
    marc.told("3015@2")
    found = marc.solver().run(model, LAW)
    assert len(found.load) == 3  # inflated, 1 and 2 mm
    assert any("time step could not get smaller" in remark for remark in found.remarks)
    assert found.early.startswith("the run stopped early; the last increment is at 2 mm")
    assert "time step could not get smaller" in found.early
    # What another end wrote before it was spoiled is not reported.
    for run, fault in ((4, "inside out"), (6, "killed"), (8, "early"), (10, "truncated")):
        marc.told(f"{fault}@{run}")
        with pytest.raises(SolverFailure) as failed:
            marc.solver().run(model, LAW)
        assert len(marc.runs) == run and failed.value.scratch.is_dir()
