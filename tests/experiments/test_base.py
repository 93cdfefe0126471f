"""experiments/base.py: defaults, precision of data, and strains to which tests are planned."""

from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.experiments.base import LARGEST_STRAIN, Plannable, Planning, Precision, with_defaults
from bubblefit.experiments.registry import kind_named
from bubblefit.experiments.sections import Scales

from ..builders.plug_ins import install_plug_in
from .cases import KIND


def test_plug_in_kind_without_base_class_has_the_defaults(packages):
    install_plug_in(packages, "acme", KIND, group="bubblefit.tests")
    kind = kind_named("acme")
    assert (kind.doubts, kind.folder_key, kind.with_units({"name": "a"}, Scales())) == (
        (), "", {"name": "a"}
    )  # fmt: skip
    test = with_defaults(SimpleNamespace(name="a", state="conditioned"))
    assert (test.state, test.pace, test.reads_files) == ("conditioned", None, False)
    assert (test.data_notes, test.data_files(), test.own_card) == ((), (), None)


@pytest.mark.parametrize(
    ("correlated", "values", "noise"), [(1.0, 100, 0.05), (4.0, 100, 0.1), (4.0, 25, 0.05)]
)
def test_noise_of_independent_values_has_the_precision_of_the_block(correlated, values, noise):
    precision = Precision(0.05, correlated, 100)
    assert precision.for_values(values) == pytest.approx(noise)
    # The mean of all values is as precise either way.
    of_mean = 0.05 * np.sqrt(correlated / 100)
    assert precision.for_values(values) / np.sqrt(values) == pytest.approx(of_mean)


def test_planned_strains_end_with_the_law_or_its_largest_strain():
    law = SimpleNamespace(strain_range=np.array([0.1, np.inf, 0.5]))
    planning = Planning(None, (), {}, law, None)
    assert planning.ends.tolist() == [0.1, LARGEST_STRAIN, LARGEST_STRAIN]


def test_kind_is_plannable_if_it_offers_candidates():
    assert isinstance(SimpleNamespace(candidates=lambda planning: ()), Plannable)
    assert not isinstance(SimpleNamespace(), Plannable)
