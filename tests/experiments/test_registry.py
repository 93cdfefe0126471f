"""Kinds of test by name: folders of ours, those of plug-ins, and what is wrong with them."""

from __future__ import annotations

import logging

import pytest
from bubblefit.errors import PlugInFailure
from bubblefit.experiments import registry
from bubblefit.experiments.registry import NEEDED, kind_named, kinds

from ..complaints import complaint
from ..plug_ins import install

KIND = """
class Kind:
    name, title, section, fitted = "acme", "an acme test", None, True
    predicted = studied = read = simulate = None

THING = Kind()
"""


def test_ours_are_the_folders_fitted_ones_first():
    assert list(kinds())[:4] == ["biaxial", "bubble", "strips", "cylinder"]
    for name, kind in kinds().items():
        assert kind.name == name and all(hasattr(kind, attribute) for attribute in NEEDED)
        assert kind_named(name) is kind
    assert "'bubbel' is not one of: biaxial, bubble, cylinder, strips" in complaint(
        kind_named, "bubbel"
    )


def test_a_plug_ins_kind_is_one_of_them(packages):
    install(packages, "acme", KIND, group="bubblefit.tests")
    assert kinds()["acme"].title == kind_named("acme").title == "an acme test"


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("acme", "raise RuntimeError('no licence')", "cannot be imported (RuntimeError: no lic"),
        ("acme", "THING = 3", "is no kind of test: acme_acme:THING has no name, title, section"),
        ("other", KIND, "calls its kind of test 'acme'; both must have one name"),
    ],
)
def test_a_broken_kind_is_one_line_and_breaks_no_other(packages, caplog, name, text, words):
    install(packages, name, text, group="bubblefit.tests")
    registry._warn.cache_clear()
    with caplog.at_level(logging.WARNING, logger="bubblefit"):
        assert name not in kinds() and "bubble" in kinds()
    line = f"the plug-in {name!r} of acme-things 2.5 {words}"
    assert caplog.text.count(line) == 1
    with pytest.raises(PlugInFailure) as failure:
        kind_named(name)
    assert str(failure.value).startswith(line)


def test_a_plug_in_does_not_replace_one_of_ours(packages):
    install(packages, "bubble", "raise RuntimeError", group="bubblefit.tests")
    assert kinds()["bubble"].title.startswith("a bubble")
