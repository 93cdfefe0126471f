"""Fixtures of the tests of the membrane."""

import pytest
from bubblefit.meshes.cylinder_model import inflated_cylinder


@pytest.fixture(scope="module")
def short_tube_model():
    return inflated_cylinder(150.0, 0.14, 0.81, 75.0, deflections=[2.0])
