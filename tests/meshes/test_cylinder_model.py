"""meshes/cylinder_model.py: the model of the inflated cylinder, its gas, supports and contacts."""

from dataclasses import replace

import numpy as np
import pytest
from bubblefit.meshes.closed_surfaces import enclosed_volume
from bubblefit.meshes.cylinder_model import (
    Collar,
    Gas,
    RigidSupports,
    inflated_cylinder,
    usual_collar,
)

from ..support.refusals import complaint, refused


def test_closed_gas_keeps_its_mass():
    gas, full = Gas(), 5.3e7
    closed = gas.closed_in(0.14, full)
    for volume in (0.9 * full, full, 1.2 * full):
        gauge, step = closed.pressure(volume), 1e-5 * volume
        assert (gauge + gas.ambient) * volume == pytest.approx(0.241 * full, rel=1e-14)
        ahead, behind = (closed.pressure(volume + s) for s in (step, -step))
        assert -closed.stiffness(volume) == pytest.approx((ahead - behind) / (2 * step), rel=1e-8)
    # Thesis Fig. 6.11: 140.0 to 141.1 kPa, so the volume fell to 0.9955.
    assert closed.pressure(0.99546 * full) == pytest.approx(0.1411, abs=2e-5)


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_cylinder_of_the_thesis_has_its_mesh_volume_and_contacts(symmetry):
    model = inflated_cylinder(150.0, 0.14, 0.81, 30.0, symmetry=symmetry)
    assert model.copies == (4 if symmetry == "quarter" else 1)
    assert model.pressure == 0.14
    assert model.deflections[-1] == 240.0 and len(model.deflections) == 60
    assert model.increments == model.deflections
    assert model.supports == RigidSupports(2000.0, 100.0)
    seam = np.isin(np.arange(len(model.mesh.quads)), model.mesh.element_sets["seam"])
    np.testing.assert_array_equal(model.thickness, np.where(seam, 3 * 0.81, 0.81))
    assert len(model.mesh.node_sets["mid_span"]) == {4: 21, 1: 40}[model.copies]
    # Forty corners around, those at the seam closer together, and yet the circle's area.
    volume = model.copies * enclosed_volume(model.mesh.points, model.mesh.quads)
    assert volume == pytest.approx(np.pi * 75.0**2 * 3000, rel=1e-12)
    assert model.diameter == pytest.approx(150.0, rel=1e-12)
    wider = model.mesh.points * [1.1, 1.1, 1.0] + [0.0, 40.0, 0.0]
    assert model.diameter_at(wider) == pytest.approx(165.0, rel=1e-12)
    finer = replace(model, deflections=[10.0, 40.0], increments=[5.0, 10.0, 20.0, 40.0])
    np.testing.assert_array_equal(finer.reported, [1, 3])
    assert model.collar == usual_collar(150.0) == usual_collar(200.0) == Collar(240.0, 145.0)
    assert usual_collar(250.0) == Collar(295.0, 147.0)
    assert "inner_diameter" in complaint(usual_collar, 300.0)


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_supports_stop_rigid_motions_only(symmetry):
    model = inflated_cylinder(150.0, 0.14, 0.81, 60.0, symmetry=symmetry)
    p = model.mesh.points
    motions = [np.eye(3)[k] + np.zeros_like(p) for k in range(3)]
    motions += [np.cross(np.eye(3)[k], p) for k in range(3)]
    rigid = np.stack([m.ravel() for m in motions], axis=1)
    rigid /= np.linalg.norm(rigid, axis=0)
    bottom = 3 * model.mesh.node_sets["support_bottom"] + 1
    fixed = model.mesh.unknowns(model.guides)
    assert np.linalg.matrix_rank(rigid[np.union1d(fixed, bottom)], tol=1e-6) == 6
    free = rigid[fixed]
    assert np.linalg.matrix_rank(free, tol=1e-6) == 5
    assert np.abs(free[:, 1]).max() == 0


def cylinder(**change):
    values = {"diameter": 150.0, "pressure": 0.14, "thickness": 0.81, "size": 60.0} | change
    return inflated_cylinder(**values)


def changed(**change):
    return replace(cylinder(), **change)


@pytest.mark.parametrize(
    ("make", "change", "field"),
    [
        (cylinder, {"size": 100.0}, "size"),
        (cylinder, {"diameter": 260.0}, "collar"),
        (cylinder, {"collar": Collar(140.0, 145.0)}, "collar.inner_diameter"),
        (cylinder, {"collar": Collar(240.0, 1950.0)}, "collar.length"),
        (cylinder, {"supports": RigidSupports(3200.0)}, "supports.span"),
        (cylinder, {"supports": RigidSupports(2950.0)}, "supports.span"),
        *((cylinder, {"deflections": d}, "deflections") for d in ([20.0, 10.0], [], [np.inf])),
        (changed, {"inflation": [0.1, 0.1]}, "inflation"),
        (changed, {"increments": [1.0, 3.0]}, "increments"),
        (changed, {"supports": RigidSupports(1800.0)}, "supports.span"),
        (Collar, {"inner_diameter": 240.0, "length": 15.0}, "collar.fillet"),
    ],
)  # fmt: skip
def test_bad_cylinder_names_its_field(make, change, field):
    assert refused(make, **change).field == field
