"""experiments/base.py: defaults of kinds and tests."""

from types import SimpleNamespace

from bubblefit.experiments.base import with_defaults
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
