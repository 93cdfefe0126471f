"""experiments/registry.py: kinds of test by name, ours and those of plug-ins."""

import logging

import pytest
from bubblefit.errors import PlugInFailure
from bubblefit.experiments import registry
from bubblefit.experiments.registry import NEEDED, kind_named, kinds, presenter_of

from ..builders.plug_ins import install_plug_in
from ..support.refusals import complaint, raised
from .cases import KIND


def test_kinds_are_the_folders_with_fitted_ones_first():
    ours = ["bending", "biaxial", "bubble", "cycles", "deck", "strips", "tube"]
    assert list(kinds())[:7] == ours
    for name, kind in kinds().items():
        assert kind.name == name and all(hasattr(kind, attribute) for attribute in NEEDED[:-1])
        assert callable(presenter_of(name).simulate)
        assert kind_named(name) is kind
    assert (
        "'bubbel' is not one of: bending, biaxial, bubble, cycles, cylinder, deck, strips, tube"
        in complaint(kind_named, "bubbel")
    )


def test_plug_in_kind_is_listed(packages):
    install_plug_in(packages, "acme", KIND, group="bubblefit.tests")
    assert kinds()["acme"].title == kind_named("acme").title == "an acme test"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("acme", "raise RuntimeError('no licence')", "cannot be imported (RuntimeError: no lic"),
        ("acme", "THING = 3", "is no kind of test: acme_acme:THING has no name, title, section"),
        ("other", KIND, "calls its kind of test 'acme'; both must have one name"),
    ],
)
def test_broken_plug_in_kind_is_one_line_and_breaks_no_other(packages, caplog, name, text, words):
    install_plug_in(packages, name, text, group="bubblefit.tests")
    registry.warn_once.cache_clear()
    with caplog.at_level(logging.WARNING, logger="bubblefit"):
        assert name not in kinds() and "bubble" in kinds()
    line = f"the plug-in {name!r} of acme-things 2.5 {words}"
    assert caplog.text.count(line) == 1
    assert str(raised(PlugInFailure, "", kind_named, name)).startswith(line)


def test_plug_in_kind_does_not_replace_ours(packages):
    install_plug_in(packages, "bubble", "raise RuntimeError", group="bubblefit.tests")
    assert kinds()["bubble"].title.startswith("a bubble")
