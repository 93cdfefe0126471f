"""The registration as unknowns of a fit: yarns that are turned, a plane that is tilted, a shift."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...complaints import complaint

TRUE = {"E1": 600.0, "E2": 300.0, "G12": 14.0}
PRESSURES = (0.03, 0.09, 0.15, 0.2)
LAW = bf.Law("constant", bounds={"E1": [100, 2000], "E2": [50, 1500], "G12": [1, 100]})
TURN, TILT, SHIFT, NOISE = 8.0, 2.0, (1.5, -0.8), 0.01


def camera():
    """Return points and displacements of a disk whose yarns are turned, as a camera askew sees."""
    mesh = disk_mesh(100.0, 300)
    model = BubbleModel(mesh, 0.81, PRESSURES).with_parameters({"turn": np.radians(TURN)})
    moved = MembraneSolver().run(model, HypoelasticLaw.linear(*TRUE.values())).displacement
    c, s = np.cos(np.radians(TILT)), np.sin(np.radians(TILT))
    seen = moved @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    seen = seen + NOISE * np.random.default_rng(4).standard_normal(seen.shape)
    inside = np.hypot(*mesh.points[:, :2].T) < 96
    return mesh.points[inside] + (*SHIFT, 0.0), seen[:, inside]


def fitted(**nuisance):
    points, seen = camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, elements=300, objective="mm", noise=NOISE,
        nuisance=nuisance,
    )  # fmt: skip
    trusted = ["off-centre", "turned", "tilted", "radius", "camera-frame"]
    fabric = bf.Fabric("turned", 0.81)
    return bf.fit([bubble], LAW, fabric=fabric, starts=3, jobs=1, trust=trusted, mesh_error="told")


def test_turn_tilt_and_shift_are_found_with_their_sigma():
    found = fitted(registration="fitted")
    table = found.coefficients().set_index("unknown")
    known = {"turn": TURN, "tilt_x": TILT, "tilt_y": 0.0}
    known |= {"shift_x": -SHIFT[0], "shift_y": -SHIFT[1]}
    for name, value in known.items():
        assert table.value[name] == pytest.approx(value, abs=0.1), name
        assert abs(table.value[name] - value) < 4 * table.sigma[name] + 0.01, name
    for name, value in TRUE.items():
        assert found.law.modulus(name, 0.0) == pytest.approx(
            value, rel=0.1 if name == "G12" else 0.01
        )


def test_a_fit_begins_where_the_fields_are_symmetric_and_rise():
    points, seen = camera()
    bubble = bf.Bubble(points, seen, PRESSURES, radius=100.0, elements=300, noise=NOISE,
                       nuisance={"registration": "fitted"})  # fmt: skip
    project = bf.Project.of([bubble], LAW, fabric=bf.Fabric("turned", 0.81))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    unknowns = setup.problem().unknowns
    begin = dict(zip(unknowns.nuisance.names, unknowns.nuisance.begin, strict=True))
    assert begin["turn"] == pytest.approx(TURN, abs=1.5)
    assert begin["tilt_x"] == pytest.approx(TILT, abs=0.3) and abs(begin["tilt_y"]) < 0.3
    assert begin["shift_x"] == pytest.approx(-SHIFT[0], abs=0.5)
    assert begin["shift_y"] == pytest.approx(-SHIFT[1], abs=0.5)
    assert not unknowns.nuisance.start.any()


def test_a_quarter_cannot_be_turned():
    points, seen = camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, symmetry="quarter", nuisance={"turn": 5.0}
    )
    assert "nuisance.turn" in complaint(bf.fit, [bubble], LAW, fabric=bf.Fabric("turned", 0.81))
