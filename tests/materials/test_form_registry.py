"""Forms of the moduli by name: ours, those of plug-ins, and what is wrong with them in one line."""

from __future__ import annotations

import pytest
from bubblefit.errors import PlugInFailure
from bubblefit.materials.forms.base import Form
from bubblefit.materials.forms.registry import form_named, form_names, form_settings

from ..complaints import complaint
from ..plug_ins import install

ENDS = (0.1, 0.2, 0.5)
WORKING = """
from dataclasses import dataclass, replace
from bubblefit.materials.forms.polynomial import LINEAR
from bubblefit.materials.forms.registry import Offer

def make(name, settings, strain_range):
    {body}

THING = Offer("acme", make, ("knee",))
"""


def test_ours_are_there_and_say_their_settings():
    ours = ("constant", "linear", "quadratic", "cubic", "load-ratio", "spline", "trilinear")
    assert form_names()[: len(ours)] == ours
    assert form_settings("cubic") == () and form_settings("spline") == ("knots",)
    assert form_settings("nothere") == ()
    assert isinstance(form_named("cubic", {}, ENDS), Form)
    message = complaint(form_named, "cubik", {}, ENDS)
    assert message.startswith("form: no form is called 'cubik'; did you mean 'cubic'? known: con")
    assert "a cubic law has no knots" in complaint(form_named, "cubic", {"knots": 3}, ENDS)


def test_a_plug_ins_form_is_one_of_them(packages):
    install(packages, "acme", WORKING.format(body="return LINEAR"))
    assert "acme" in form_names() and form_settings("acme") == ("knee",)
    assert form_named("acme", {"knee": 0.1}, ENDS).size == 12
    assert "a acme law has no knots" in complaint(form_named, "acme", {"knots": 1}, ENDS)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("raise RuntimeError('no licence')", "cannot be imported (RuntimeError: no licence)"),
        ("THING = 3", "is no form: acme_acme:THING has no name, make, settings"),
        (WORKING.format(body="pass").replace('"acme"', '"else"'), "calls its form 'else'; both"),
        (WORKING.format(body="return settings['k']"), "fails when it is made (KeyError: 'k')"),
        (WORKING.format(body="return 3"), "gives no form: int has no describe, free, from_values"),
    ],
)
def test_a_broken_form_is_one_line_and_breaks_no_other(packages, text, words):
    install(packages, "acme", text)
    with pytest.raises(PlugInFailure) as failure:
        form_named("acme", {}, ENDS)
    message = str(failure.value)
    assert message.startswith(f"the plug-in 'acme' of acme-things 2.5 {words}")
    assert message.endswith("; repair or uninstall it") and "\n" not in message
    assert form_named("cubic", {}, ENDS).name == "cubic"


def test_a_plug_in_does_not_replace_one_of_ours(packages):
    install(packages, "cubic", "raise RuntimeError")
    assert form_named("cubic", {}, ENDS).name == "cubic"
    assert form_names().count("cubic") == 1
