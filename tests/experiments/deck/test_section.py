"""experiments/deck/section.py: mistakes in a project, one line each that names the key."""

import sys

import pytest
from bubblefit.project.project import read_project

from ...builders.decks import bar_project
from ...support.refusals import complaint


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[0.05, 3.0]", "[3.0, 0.05]", "deck[0].parameters.C10.bounds: expected [least, largest]"),
        ('unit = "MPa" }', "start = 9 }", "deck[0].parameters.C10.start: expected a start from"),
        ("C01 = {", "E1 = {", "deck[0].parameters.E1: expected a name of letters and digits"),
        ('"C10 + C01', '"C10 + C02', "deck[0].parameters.feasible: 'C10 + C02 > 0.1': 'C02' is"),
        ('job.txt.j2"', 'other.j2"', "deck[0].template: there is no file"),
        ('"frame.csv"', '"other.csv"', "deck[0].compare[0].measured: there is no file"),
        (
            '"travel", result',
            '"trave", result',
            "no column of trave in the header row",
        ),
        ('result = "force_N", ', "", "compare[0].y: expected one of displacement, reaction, time"),
        ('result = "force_N"', 'reaction = "z"', "compare[0].y: expected a node set (set), or a"),
        ("noise = 0.002", "nois = 0.002", "compare[0].nois: unknown key; did you mean 'noise'"),
        ('"solve.py"', "", "program: there is no program nothing; name another"),
    ],
)
def test_mistake_is_one_line(tmp_path, monkeypatch, old, new, words):
    path = bar_project(tmp_path, monkeypatch, [(old, new)])
    if "there is no program" in words:
        path.write_text(path.read_text().replace(sys.executable, "nothing"))
    assert words in complaint(read_project, path)


def test_program_needs_the_permission_of_the_site(tmp_path, monkeypatch):
    path = bar_project(tmp_path, monkeypatch)
    monkeypatch.delenv("BUBBLEFIT_PROGRAMS_FROM")
    message = complaint(read_project, path)
    assert "deck[0].program: says what is run" in message and "BUBBLEFIT_PROGRAMS_FROM=" in message
