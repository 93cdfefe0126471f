"""experiments/deck/__init__.py: mistakes in a project, a line each; readings of several files."""

import sys

import numpy as np
import pytest
from bubblefit.inference.search import fit_from
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.project.project import read_project
from bubblefit.solvers.marc.analyses import strip_deck
from bubblefit.solvers.marc.settings import MarcSettings

from ..builders.decks import HEAD, bar, bar_project, write_curve
from ..builders.marc_runs import marc  # noqa: F401
from ..builders.projects import fit_setup
from ..support.refusals import complaint


def test_parameters_are_shared_unknowns_that_starts_draw(tmp_path, monkeypatch):
    test = bar(tmp_path, monkeypatch).tests["bar"]
    first, second = test.parameters
    assert (first.name, first.unit, first.lower, first.upper) == ("C10", "MPa", 0.05, 3.0)
    assert first.shared and first.drawn and first.start == (0.05 * 3.0) ** 0.5
    assert second.start == 0.5
    assert test.reads_files and len(test.data_files()) == 1


def test_settings_tell_another_template(tmp_path, monkeypatch):
    test = bar(tmp_path, monkeypatch).tests["bar"]
    settings = test.settings()
    (tmp_path / "solve.py").write_text("# another\n")
    assert test.settings()["files"] != settings["files"]
    assert test.settings()["section"] == settings["section"]


def test_comparisons_have_names_of_their_own(tmp_path, monkeypatch):
    path = bar_project(tmp_path, monkeypatch)
    text = path.read_text()
    path.write_text(text + text[text.index("[[deck.compare]]") :])
    message = complaint(read_project, path)
    assert "deck[0].compare[1].name: 'force' is there twice; name one of them" in message


def test_comparison_of_weight_zero_is_left_out(tmp_path, monkeypatch):
    path = bar_project(tmp_path, monkeypatch)
    text = path.read_text()
    compare = text[text.index("[[deck.compare]]") :]
    path.write_text(f'{text}\n{compare}\nname = "again"\nweight = 0\n')
    assert [*read_project(path).tests["bar"].matched] == ["force"]


MARC = """
[solver.marc]
executable = "PROGRAM"
[[deck]]
name = "strip"
program = "marc"
template = "strip.dat.j2"
[deck.parameters]
FACTOR = { bounds = [0.5, 2.0], start = 1.0 }
[[deck.compare]]
measured = "frame.csv"
x = { column = "travel", set = "bottom", displacement = "y", scale = -1 }
y = { column = "force", set = "bottom", reaction = "y", scale = -2 }
noise = 0.01
"""


def test_deck_of_marc_runs_in_the_stand_in(tmp_path, monkeypatch, marc):  # noqa: F811
    monkeypatch.setenv("BUBBLEFIT_PROGRAMS_FROM", str(tmp_path))
    model = straight_strip("warp", 20.0, 21.0, 0.8, increments=4, across=1, along=2)
    law = HypoelasticLaw.linear(300.0, 200.0, 10.0)
    text = strip_deck(model, law, MarcSettings(increments=4), np.array(model.elongations))
    multipliers = f"{1:20.12E}" * 2 + f"{0.24:20.12E}"
    assert text.count(multipliers) == 1
    factor = "{{ [FACTOR, FACTOR, 0.24] | e20 }}"
    (tmp_path / "strip.dat.j2").write_text(text.replace(multipliers, factor))
    forces = marc.solver(increments=4).run(model, law).load
    rows = zip(model.elongations, forces, strict=True)
    table = "\n".join(f"{u:.8g},{f:.8g}" for u, f in rows)
    (tmp_path / "frame.csv").write_text(f"travel [mm],force [N]\n{table}\n")
    path = tmp_path / "project.toml"
    path.write_text(HEAD + MARC.replace("PROGRAM", str(marc.program)))
    setup = fit_setup(read_project(path))
    problem = setup.problem()
    point = problem.evaluate(np.array([1.0]), True)
    assert point is not None, problem.failure
    assert point.histories[0].load == pytest.approx(forces, rel=1e-5)
    optimum = fit_from(problem, np.array([1.6]), setup.options)
    assert optimum.best.unknowns == pytest.approx([1.0], abs=1e-4)
    assert len(marc.runs) < 12


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
        ("noise = 0.002", "weight = 0", "compare: expected a weight above 0: nothing would be"),
        ('result = "travel_mm"', "time = 1.0", "compare[0]: a table has no times and no nodes"),
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


def test_unit_in_a_heading_counts_beside_a_column_of_the_results(tmp_path, monkeypatch):
    (plain,) = bar(tmp_path, monkeypatch).tests["bar"].matched.values()
    path = tmp_path / "frame.csv"
    heading, *rows = path.read_text().splitlines()
    assert plain.unit == "N" and "force" in heading
    for unit, factor in (("kN", 1e3), ("N", 1.0)):
        path.write_text("\n".join([heading.replace("[N]", f"[{unit}]"), *rows]) + "\n")
        (compared,) = read_project(tmp_path / "project.toml").tests["bar"].matched.values()
        assert compared.load == pytest.approx(factor * plain.load)
    path.write_text("\n".join([heading.replace("[N]", "[MPa]"), *rows]) + "\n")
    assert "the file says 'MPa', the project 'N'" in complaint(
        read_project, tmp_path / "project.toml"
    )


def test_readings_of_several_specimens_are_one_curve(tmp_path, monkeypatch):
    write_curve(tmp_path / "second.csv", noise=0.01)
    change = [('measured = "frame.csv"', 'measured = ["frame.csv", "second.csv"]')]
    (compared,) = bar(tmp_path, monkeypatch, change).tests["bar"].matched.values()
    assert compared.name == "force" and compared.unit == "N" and compared.section.noise == 0.002
    assert [file.used_count for file in compared.data] == [12, 12]
    assert not np.array_equal(compared.load[:12], compared.load[12:])
