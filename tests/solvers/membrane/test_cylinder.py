"""solvers/membrane/cylinder.py: a cylinder as a closed membrane between posts and a rigid ring."""

import numpy as np
import pytest
from bubblefit.solvers.membrane.cylinder import closed_membrane_of


def test_quarter_of_a_cylinder_has_the_post_on_its_side_and_the_ring(short_tube_model):
    model = short_tube_model
    assert "symmetry_z" in model.mesh.node_sets
    bending = closed_membrane_of(model).bending
    (post,) = bending.supports
    (ring,) = bending.collars
    assert post.centre == (0.0, 0.0, pytest.approx(0.5 * model.supports.span))
    assert post.radius == pytest.approx(0.5 * model.supports.diameter)
    assert ring.radius == pytest.approx(0.5 * model.collar.inner_diameter)
    assert ring.centre[2] == pytest.approx(0.5 * model.collar.spacing)
    assert bending.released == "support_bottom"
    np.testing.assert_array_equal(bending.reported, model.reported)
    np.testing.assert_array_equal(bending.displacements, model.increments)
