"""The whole beam of a run that meshed a part of it, and where the bodies are."""

from __future__ import annotations

import numpy as np
import pytest
from bubblefit.experiments.cylinder.beam import bodies_of, whole_beam
from bubblefit.experiments.cylinder.record import BendingRun, run_of
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strain import surface_strain
from bubblefit.meshes.volume import enclosed_volume
from bubblefit.models.bending import inflated_cylinder
from bubblefit.models.cylinder import CylinderModel

from ...cylinder_cases import ran

WAY = np.linspace(0.0, 240.0, 61)


def model(symmetry: str = "quarter") -> CylinderModel:
    way = WAY[1:].tolist()
    return inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)


def run(m: CylinderModel) -> BendingRun:
    ended = run_of(ran(m, MaterialCard(HypoelasticLaw.linear(500.0, 150.0, 20.0), 0.81)))
    assert ended is not None
    return ended


def test_a_quarter_makes_the_whole_beam() -> None:
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


def test_bodies_touch_the_inflated_beam() -> None:
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
