"""The whole beam of a run that meshed a part of it, and where the bodies are."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.cylinder.predicted import BendingRun, run_of
from bubblefit.experiments.cylinder.report import Beam, bodies_of, whole_beam
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import CylinderModel, inflated_cylinder
from bubblefit.meshes.mesh import enclosed_volume, surface_strain

from ...cylinder_cases import ran

WAY = np.linspace(0.0, 240.0, 61)


def model(symmetry: str = "quarter") -> CylinderModel:
    way = WAY[1:].tolist()
    return inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)


def run(m: CylinderModel) -> BendingRun:
    ended = run_of(ran(m, MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.81)))
    assert ended is not None
    return ended


def test_a_quarter_makes_the_whole_beam():
    whole, quarter = run(model("full")), run(model())
    beam, same = whole_beam(model(), quarter), whole_beam(model("full"), whole)
    for one, other in ((beam.bent, same.bent), (beam.inflated, same.inflated)):
        a, b = (np.round(m.mesh.points + u, 6) + 0.0 for m, u in ((beam, one), (same, other)))
        np.testing.assert_allclose(np.unique(a, axis=0), np.unique(b, axis=0), atol=1e-5)
    assert len(beam.mesh.quads) == len(same.mesh.quads)
    at = beam.mesh.points + beam.bent
    assert enclosed_volume(at, beam.mesh.quads) == pytest.approx(
        enclosed_volume(same.mesh.points + same.bent, same.mesh.quads)
    )
    for b in (beam, same):
        strain = surface_strain(b.mesh, b.inflated)
        assert strain[: len(model().mesh.quads)] == pytest.approx(
            surface_strain(model().mesh, quarter.inflated), abs=1e-12
        )


def test_bodies_touch_the_inflated_beam():
    m = model()
    beam = whole_beam(m, run(m))
    bodies = bodies_of(m, beam, 30.0)
    at = beam.mesh.points + beam.inflated
    assert bodies.support_radius == 50.0 and bodies.collar_radius == 120.0
    for z, y in bodies.supports:
        gap = np.hypot(at[:, 2] - z, at[:, 1] - y).min() - 50.0
        assert gap == pytest.approx(0.0, abs=1e-6)
    inside = np.abs(at[:, 2]) <= 72.5
    reach = np.hypot(at[inside, 0], at[inside, 1] - bodies.collar_height - 30.0).max()
    assert reach == pytest.approx(120.0)


@pytest.mark.parametrize(
    ("points", "height", "top"),
    [
        # In a collar of 100 mm in radius a point 60 mm aside is touched 80 mm above the middle.
        ([[0.0, 20.0, 0.0], [60.0, 30.0, 0.0]], 10.0, -50.0),
        # As long as the collar, and no longer; as wide as its inside, less nothing.
        ([[0.0, 90.0, 20.1], [0.0, 95.0, -20.1], [0.0, 20.0, 20.0]], 10.0, -80.0),
        ([[-99.0, 20.0, 0.0], [100.0, 500.0, 0.0]], 10.0, 20.0 - np.sqrt(199.0)),
        # On a support of 50 mm in radius 30 mm beside its middle, on either side.
        ([[0.0, 20.0, 0.0], [0.0, -5.0, 170.0]], -45.0, -80.0),
        ([[0.0, 20.0, 0.0], [0.0, -5.0, -230.0]], -45.0, -80.0),
        ([[0.0, 20.0, 0.0], [0.0, -99.0, 250.0]], 10.0, -80.0),
    ],
)
def test_bodies_touch_where_the_beam_is_nearest(points: Any, height: float, top: float):
    """Beside a node that stands on a support 60 mm high."""
    rest = np.array([*points, [0.0, 60.0, 200.0]])
    made: Any = SimpleNamespace(
        supports=SimpleNamespace(diameter=100.0, span=400.0),
        collar=SimpleNamespace(inner_diameter=200.0, length=40.0),
    )
    mesh: Any = SimpleNamespace(points=rest - [0.0, 7.0, 0.0])
    moved = np.tile([0.0, 7.0, 0.0], (len(rest), 1))
    found = bodies_of(made, Beam(mesh, moved, moved), 12.0)
    assert found.supports == ((-200.0, pytest.approx(height)), (200.0, pytest.approx(height)))
    assert (found.support_radius, found.collar_radius, found.collar_length) == (50.0, 100.0, 40.0)
    assert found.collar_height == pytest.approx(top - 12.0)
