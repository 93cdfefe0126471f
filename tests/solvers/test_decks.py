"""solvers/decks.py: templates, their numbers, errors and identity."""

import re
import shutil

import pytest
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.decks import file_mark, render, templates_mark
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..support.refusals import complaint, refused


def test_deck_keeps_small_numbers():
    assert render("calculix", "bubble.inp.j2", deck_context(constants=[-1.0000803740695e-08] * 9))
    text = render("calculix", "bubble.inp.j2", deck_context(constants=[-1.0000803740695e-108] * 9))
    written = re.search(r"CONSTANTS=9\n(.*?),", text)[1]
    assert len(written) <= 20 and float(written) == pytest.approx(-1.00008e-108, rel=1e-5)


def deck_context(**changes):
    step = {"pressure": 0.3, "first": 1.0, "least": 0.01}
    plain = {
        "title": "", "version": "", "mesh_file": "m", "material": "@M", "constants": [],
        "state_variables": 6, "element": "S4", "thickness": 0.81, "supports": [],
        "force_tolerance": 1e-7, "correction_tolerance": 1e-6, "time_incrementation": "",
        "most_increments": 9, "steps": [step], "rim": [],
    }  # fmt: skip
    return {**plain, **changes}


@pytest.mark.parametrize(
    ("text", "where", "what"),
    [
        ("** deck\n{{ thicknes }}\n", "line 2", "'thicknes' is undefined"),
        ("{% for s in steps %}\n\n{{ s.presure }}\n{% endfor %}", "line 3", "presure"),
        ("a\nb\n{% if %}", "line 3", "Expected an expression"),
        ("{% include 'none.j2' %}", "include", "none.j2"),
        ("x\n{{ thickness / 0 }}", "line 2", "division by zero"),
        ("{{ ''.__class__.__mro__ }}", "line 1", "unsafe"),
    ],
)
def test_template_error_names_template_line_and_variable(tmp_path, text, where, what):
    (tmp_path / "bubble.inp.j2").write_text(text)
    message = str(refused(render, "calculix", "bubble.inp.j2", deck_context(), tmp_path))
    assert str(tmp_path / "bubble.inp.j2") in message
    assert where in message and what in message
    assert "\n" not in message


def test_templates_of_a_user_can_extend_ours(tmp_path):
    (tmp_path / "other.inp.j2").write_text("")
    assert "bubble.inp.j2" in complaint(
        render, "calculix", "bubble.inp.j2", deck_context(), tmp_path
    )
    (tmp_path / "bubble.inp.j2").write_text("** mine\n*INCLUDE, INPUT={{ mesh_file }}\n")
    text = render("calculix", "bubble.inp.j2", deck_context(), tmp_path)
    assert text == "** mine\n*INCLUDE, INPUT=m\n"


# --- identity ---
NO_CCX = "/nowhere/ccx"


@pytest.fixture
def copied_templates(tmp_path):
    folder = tmp_path / "templates"
    (folder / "parts").mkdir(parents=True)
    (folder / "bubble.inp.j2").write_text("{% include 'heading.inp' %}\n*STEP\n")
    (folder / "heading.inp").write_text("*HEADING\n{% include 'parts/more.txt' %}\n")
    (folder / "parts" / "more.txt").write_text("more\n")
    (folder / "notes.txt").write_text("for myself\n")
    return folder


def solvers_with_templates(folder):
    return [CalculixSolver(NO_CCX, templates=folder), MarcSolver(templates=str(folder))]


@pytest.mark.parametrize("edited", ["bubble.inp.j2", "heading.inp", "parts/more.txt"])
def test_template_edited_in_place_changes_the_identity(copied_templates, edited):
    before = [solver.identity for solver in solvers_with_templates(copied_templates)]
    file = copied_templates / edited
    file.write_text(file.read_text() + "** one line more\n")
    after = [solver.identity for solver in solvers_with_templates(copied_templates)]
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_moved_templates_and_other_files_do_not_change_the_identity(copied_templates, tmp_path):
    before = [solver.identity for solver in solvers_with_templates(copied_templates)]
    (copied_templates / "notes.txt").write_text("other words\n")
    (copied_templates / "out").mkdir()
    (copied_templates / "out" / "result.json").write_text("{}")
    assert [solver.identity for solver in solvers_with_templates(copied_templates)] == before
    elsewhere = tmp_path / "else" / "where"
    shutil.move(copied_templates, elsewhere)
    assert [solver.identity for solver in solvers_with_templates(elsewhere)] == before
    # One more template, or another name of one, is another set of them.
    shutil.copy(elsewhere / "notes.txt", elsewhere / "strip.inp.j2")
    assert all(s.identity not in before for s in solvers_with_templates(elsewhere))


def test_broken_and_circular_templates_count_for_the_identity(copied_templates, tmp_path):
    before = templates_mark(copied_templates)
    (copied_templates / "bubble.inp.j2").write_text("{% include ")
    broken = templates_mark(copied_templates)
    (copied_templates / "bubble.inp.j2").write_text("{% include  ")
    assert len({before, broken, templates_mark(copied_templates), templates_mark(None)}) == 4
    (tmp_path / "a.j2").write_text("{% include 'b' %}{% include name %}{% include 'gone' %}")
    (tmp_path / "b").write_text("{% include 'a.j2' %}")
    assert len(templates_mark(tmp_path)) == 64


def test_identity_of_a_solver_counts_settings_that_change_results(tmp_path):
    one = CalculixSolver(NO_CCX)
    other = CalculixSolver(NO_CCX, timeout=1.0, scratch=tmp_path, keep=True, threads=2)
    assert one.identity == other.identity != CalculixSolver(NO_CCX, element="S4").identity
    plain = MembraneSolver().identity
    assert plain == MembraneSolver().identity and plain.startswith("membrane ")
    others = {
        MembraneSolver(tolerance=1e-9).identity,
        MembraneSolver(wrinkle_stiffness=0.01).identity,
        MembraneSolver(bending_stiffness=0.0).identity,
    }
    assert len({plain, *others}) == 4
    one, other = tmp_path / "post.dat", tmp_path / "moved" / "post.dat"
    one.write_text("post\n")
    other.parent.mkdir()
    shutil.copy(one, other)
    marks = [MarcSolver(include={"post": str(file)}).identity for file in (one, other)]
    assert marks[0] == marks[1]
    one.write_text("post again\n")
    assert MarcSolver(include={"post": str(one)}).identity != marks[0]
    assert MarcSolver(version="2023.1").identity != MarcSolver().identity
    assert "cannot be read: No such file" in complaint(file_mark, tmp_path / "none")
