"""The loader of plug-ins, for all groups: names without imports, faults in one line each."""

import shutil
import sys

import pytest
from bubblefit.errors import PlugInFailure
from bubblefit.files import names_with, plug_in_named, plug_ins

from .plug_ins import install

GROUPS = ("bubblefit.laws", "bubblefit.tests", "bubblefit.readers", "bubblefit.solvers")


@pytest.mark.parametrize("group", GROUPS)
def test_a_plug_in_is_listed_without_importing_it_and_imported_when_asked_for(packages, group):
    before = names_with(group, ["ours"])
    install(packages, "saturating", "THING = {'a': 1}", group=group)
    assert names_with(group, ["ours"]) == (*before[:1], *sorted({*before[1:], "saturating"}))
    assert "acme_saturating" not in sys.modules
    plug_in = plug_in_named(group, "saturating")
    assert plug_in.distribution == "acme-things 2.5"
    assert plug_in.load("table", ("keys", "values")) == {"a": 1}
    assert all(plug_in_named(other, "saturating") is None for other in GROUPS if other != group)


BROKEN = {
    "missing": ("", "cannot be imported (ModuleNotFoundError: No module named 'acme_missing')"),
    "failing": ("raise RuntimeError('no licence file\\nand more')",
                "cannot be imported (RuntimeError: no licence file)"),
    "leaving": ("import sys\nsys.exit(1)", "cannot be imported (SystemExit: 1)"),
    "nothing": ("x = 1", "cannot be imported (AttributeError"),
    "number": ("THING = 3", "is no form: acme_number:THING has no pieces, labels"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_plug_in_is_one_line_with_its_distribution(packages, name):
    text, words = BROKEN[name]
    install(packages, name, text)
    with pytest.raises(PlugInFailure) as failure:
        plug_in_named("bubblefit.laws", name).load("form", ("real", "pieces", "labels"))
    message = str(failure.value)
    assert message.startswith(f"the plug-in {name!r} of acme-things 2.5 {words}")
    assert message.endswith("; repair or uninstall it") and "\n" not in message
    assert name in names_with("bubblefit.laws", ())  # it is still listed, and nothing else breaks


def test_two_distributions_of_one_name(packages):
    install(packages, "acme", "THING = 1")
    install(packages, "acme", "THING = 2", "other-things", "acme_other")
    with pytest.raises(
        PlugInFailure, match=r"acme: is offered by acme-things 2\.5 and other-things 2\.5; uninst"
    ):
        plug_in_named("bubblefit.laws", "acme")
    assert [one.name for one in plug_ins("bubblefit.laws")].count("acme") == 2
    assert names_with("bubblefit.laws", ()).count("acme") == 1


def test_the_same_one_listed_twice_is_one(packages, tmp_path, monkeypatch):
    install(packages, "acme", "THING = 1")
    shutil.copytree(packages, tmp_path / "again")
    monkeypatch.syspath_prepend(str(tmp_path / "again"))
    assert plug_in_named("bubblefit.laws", "acme").load() == 1


def test_one_of_our_names_adds_none(packages):
    install(packages, "cubic", "raise RuntimeError")
    assert names_with("bubblefit.laws", ["linear", "cubic"])[:2] == ("linear", "cubic")
    assert names_with("bubblefit.laws", ["linear", "cubic"]).count("cubic") == 1
