"""experiments/bubble/nuisance.py: turn, tilt and shift of the registration as unknowns."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup
from ...support.refusals import complaint

TRUE = {"E1": 600.0, "E2": 300.0, "G12": 14.0}
PRESSURES = (0.03, 0.09, 0.15, 0.2)
LAW = bf.Law("constant", bounds={"E1": [100, 2000], "E2": [50, 1500], "G12": [1, 100]})
YARNS_TURN, TILT, ASIDE, NOISE = 8.0, 2.0, (1.5, -0.8), 0.01


def fields_of_tilted_camera():
    """Return points and displacements of a disk whose yarns are turned, as a camera askew sees."""
    mesh = disk_mesh(100.0, 300)
    model = BubbleModel(mesh, 0.81, PRESSURES).with_parameters({"turn": np.radians(YARNS_TURN)})
    moved = MembraneSolver().run(model, HypoelasticLaw.linear(*TRUE.values())).displacement
    c, s = np.cos(np.radians(TILT)), np.sin(np.radians(TILT))
    seen = moved @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    seen = seen + NOISE * np.random.default_rng(4).standard_normal(seen.shape)
    inside = np.hypot(*mesh.points[:, :2].T) < 96
    return mesh.points[inside] + (*ASIDE, 0.0), seen[:, inside]


def fit_of_camera_fields(**nuisance):
    points, seen = fields_of_tilted_camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, elements=300, objective="mm", noise=NOISE,
        nuisance=nuisance,
    )  # fmt: skip
    trusted = ["off-centre", "turned", "tilted", "radius", "camera-frame"]
    fabric = bf.Fabric("turned", 0.81)
    return bf.fit([bubble], LAW, fabric=fabric, starts=3, jobs=1, trust=trusted, mesh_error="told")


def test_turn_tilt_and_shift_are_fitted_with_sigma():
    found = fit_of_camera_fields(registration="fitted")
    table = found.coefficients().set_index("unknown")
    known = {"turn": YARNS_TURN, "tilt_x": TILT, "tilt_y": 0.0}
    known |= {"shift_x": -ASIDE[0], "shift_y": -ASIDE[1]}
    for name, value in known.items():
        assert table.value[name] == pytest.approx(value, abs=0.1), name
        assert abs(table.value[name] - value) < 4 * table.sigma[name] + 0.01, name
    for name, value in TRUE.items():
        assert found.law.modulus(name, 0.0) == pytest.approx(
            value, rel=0.1 if name == "G12" else 0.01
        )


def test_fitted_registration_begins_at_symmetry_of_the_fields():
    points, seen = fields_of_tilted_camera()
    bubble = bf.Bubble(points, seen, PRESSURES, radius=100.0, elements=300, noise=NOISE,
                       nuisance={"registration": "fitted"})  # fmt: skip
    setup = fit_setup(bf.Project.of([bubble], LAW, fabric=bf.Fabric("turned", 0.81)))
    unknowns = setup.problem().unknowns
    begin = dict(zip(unknowns.nuisance.names, unknowns.nuisance.begin, strict=True))
    assert begin["turn"] == pytest.approx(YARNS_TURN, abs=1.5)
    assert begin["tilt_x"] == pytest.approx(TILT, abs=0.3) and abs(begin["tilt_y"]) < 0.3
    assert begin["shift_x"] == pytest.approx(-ASIDE[0], abs=0.5)
    assert begin["shift_y"] == pytest.approx(-ASIDE[1], abs=0.5)
    assert not unknowns.nuisance.start.any()


def test_fitted_turn_of_a_quarter_is_refused():
    points, seen = fields_of_tilted_camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, symmetry="quarter", nuisance={"turn": 5.0}
    )
    assert "nuisance.turn" in complaint(bf.fit, [bubble], LAW, fabric=bf.Fabric("turned", 0.81))
