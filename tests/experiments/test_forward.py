"""experiments/forward.py: load levels of studies, each step divided into equal parts."""

import pytest
from bubblefit.experiments.forward import divided

from ..support.refusals import complaint


def test_steps_are_divided_into_equal_parts_from_zero():
    assert divided([0.2, 0.8], 3, "bubble") == pytest.approx([0.2 / 3, 0.4 / 3, 0.2, 0.4, 0.6, 0.8])


def test_factor_of_one_leaves_the_steps():
    assert divided([0.1, 0.4], 1, "bubble") == [0.1, 0.4]


def test_steps_are_never_joined():
    refused = complaint(divided, [0.2, 0.8], 0.5, "cylinder")
    assert "the cylinder's steps are divided, never joined" in refused
