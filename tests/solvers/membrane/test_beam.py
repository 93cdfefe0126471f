"""solvers/membrane/beam.py: the beam of an inflated tube, statics and closed forms."""

import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.beam_model import BeamModel, BraidedWall, PlainWall, TubeCrossSection
from bubblefit.meshes.cylinder_model import Cord, axial_table
from bubblefit.solvers.membrane.solver import MembraneSolver

from .cases import beam_history

RADIUS, PRESSURE, SPAN, SHEAR_SPAN = 170.0, 0.1, 3200.0, 1100.0
SPACING = SPAN - 2 * SHEAR_SPAN
PLAIN = PlainWall(400.0, 300.0, 60.0, 0.2, wrinkles=False)
BRAID = BraidedWall(65.0, 2000.0, 2.0, 9.6, 3.33)
CORD = axial_table(800e3)
ONE_UP = (0.0, 120.0, 240.0)
TWO_UP = (60.0, 180.0, 300.0)
LAW = HypoelasticLaw.linear(1.0, 1.0, 1.0)


def tube_section(wall=BRAID, angles=ONE_UP, table=CORD, **more):
    return TubeCrossSection(RADIUS, PRESSURE, wall, [Cord(a, table, **more) for a in angles])


def braided_beam(**more):
    return BeamModel(tube_section(), SPAN, more.pop("deflections", [10.0, 60.0]), SPACING, **more)


@pytest.mark.parametrize(
    ("axial", "angles", "factor"),
    [(400.0, (), np.pi), (1e-4, ONE_UP, 27 / (4 * np.pi)), (1e-4, TWO_UP, 27 / (4 * np.pi)),
     (1e-4, (45.0, 135.0, 225.0, 315.0), 8 / np.pi)],
)  # fmt: skip
def test_small_deflections_are_those_of_timoshenko(axial, angles, factor):
    """Shear of a wall alone, and of cords alone that carry the bending of a wall without any."""
    wall = PlainWall(axial, axial, 60.0, 0.2, wrinkles=False)
    model = BeamModel(tube_section(wall, angles), SPAN, [0.01], SPACING)
    _, x, _ = beam_history(model, 0.01)
    stiff = wall.axial * np.pi * RADIUS**3 + 0.5 * len(angles) * 800e3 * RADIUS**2
    shear = factor * RADIUS * 60.0 + np.pi * PRESSURE * RADIUS**2
    assert model.section.shear == pytest.approx(shear, rel=1e-6)
    each = 0.5 / shear * SHEAR_SPAN + SHEAR_SPAN * (3 * SPAN**2 - 4 * SHEAR_SPAN**2) / 48 / stiff
    assert x[-1] == pytest.approx(0.01 / each, rel=1e-4)


def test_weight_bends_and_shears_a_beam():
    wall = PLAIN
    stiff = wall.axial * np.pi * RADIUS**3
    shear = np.pi * RADIUS * (60.0 + PRESSURE * RADIUS)
    heavy = BeamModel(tube_section(wall, ()), SPAN, [0.01], SPACING, weight=1e-4)
    _, _, rest = beam_history(heavy, 0.01)
    sag = 1e-4 * SPAN**2 * (5 * SPAN**2 / 384 / stiff + 1 / 8 / shear)
    assert -rest[1] == pytest.approx(sag, rel=1e-3)


@pytest.mark.parametrize("below", [0.0, 355.6])
def test_moments_and_reactions_balance_on_the_bent_beam(below):
    model = braided_beam(roller_below=below)
    beam, x, _ = beam_history(model, 80.0)
    q, reaction, load = x[:-2].reshape(-1, 3), x[-2], x[-1]
    assert reaction == pytest.approx(-0.5 * load)
    beam.residual(x, None)
    _, moment, _ = model.section.resultants(*beam.strains)
    along = beam.s + q[:, 0]
    roller = along[-1] + below * np.sin(q[-1, 2])
    middle = 0.5 * (along[1:] + along[:-1])
    outside = 0.5 * (beam.s[1:] + beam.s[:-1]) > 0.5 * SPACING
    wanted = 0.5 * load * (roller - middle[outside])
    assert moment[outside] == pytest.approx(wanted, rel=2e-3)
    assert q[-1, 1] - below * np.cos(q[-1, 2]) == pytest.approx(-below, abs=1e-7)
    axial, _, _ = model.section.resultants(*beam.strains)
    assert np.abs(axial).max() < 0.1 * load


def test_brackets_take_two_or_three_per_cent_of_the_load():
    loads = [MembraneSolver().run(braided_beam(roller_below=h, deflections=[100.0]), LAW).load[-1]
             for h in (0.0, 355.6)]  # fmt: skip
    assert 0.96 < loads[1] / loads[0] < 0.985


def test_tangent_of_a_beam_is_the_derivative_of_its_residual():
    beam, x, _ = beam_history(braided_beam(roller_below=300.0, weight=0.1), 40.0)
    way = np.random.default_rng(3).standard_normal(x.size) * 1e-3
    step = 1e-4
    ends = [beam.residual(x + sign * step * way, 40.0)[0] for sign in (1, -1)]
    wanted = (ends[0] - ends[1]) / (2 * step)
    found = beam.residual(x, 40.0)[1] @ way
    assert np.abs(found - wanted).max() < 1e-6 * np.abs(wanted).max()


def test_beam_loads_converge_with_the_square_of_the_elements():
    def load(size):
        model = BeamModel(tube_section(PLAIN, ()), SPAN, [80.0], SPACING, size=size)
        return MembraneSolver(1e-11).run(model, LAW).load[-1]

    coarse, middle, fine = (load(size) for size in (100.0, 50.0, 25.0))
    assert 3.5 < (coarse - middle) / (middle - fine) < 4.5
    assert abs(middle / fine - 1) < 2e-3


def test_straps_friction_and_frames_of_a_beam():
    history = MembraneSolver().run(braided_beam(friction=50.0, deflections=[20.0, 40.0]), LAW)
    plain = MembraneSolver().run(braided_beam(deflections=[20.0, 40.0]), LAW)
    assert history.load - plain.load == pytest.approx([0.0, 50.0, 50.0], abs=1e-6)
    wide = MembraneSolver().run(braided_beam(load_width=150.0, deflections=[20.0, 40.0]), LAW)
    assert 0.98 < wide.load[-1] / plain.load[-1] < 1.02 and wide.load[-1] != plain.load[-1]
    middle = plain.displacement[:, braided_beam().mesh.node_sets["mid_span"], 1]
    assert middle.mean(axis=1) == pytest.approx([0.0, -20.0, -40.0], abs=1e-6)
    assert plain.reactions["supports"][:, 1] == pytest.approx(plain.load, abs=1e-6)
    assert plain.cavity_pressure == pytest.approx([PRESSURE] * 3)
