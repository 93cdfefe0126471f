"""What a solver's results depend on: templates and files by what is in them, not by their path."""

import shutil
from pathlib import Path

import pytest
from bubblefit.errors import InputError
from bubblefit.solvers.base import Solver
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.decks import file_mark, templates_mark
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane.solver import MembraneSolver

NO_CCX = "/nowhere/ccx"


@pytest.fixture
def templates(tmp_path: Path) -> Path:
    folder = tmp_path / "templates"
    (folder / "parts").mkdir(parents=True)
    (folder / "bubble.inp.j2").write_text("{% include 'heading.inp' %}\n*STEP\n")
    (folder / "heading.inp").write_text("*HEADING\n{% include 'parts/more.txt' %}\n")
    (folder / "parts" / "more.txt").write_text("more\n")
    (folder / "notes.txt").write_text("for myself\n")
    return folder


def solvers(folder: Path) -> list[Solver]:
    return [CalculixSolver(NO_CCX, templates=folder), MarcSolver(templates=str(folder))]


@pytest.mark.parametrize("edited", ["bubble.inp.j2", "heading.inp", "parts/more.txt"])
def test_a_template_edited_in_place_changes_the_identity(templates: Path, edited: str) -> None:
    before = [solver.identity for solver in solvers(templates)]
    file = templates / edited
    file.write_text(file.read_text() + "** one line more\n")
    after = [solver.identity for solver in solvers(templates)]
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_moving_the_folder_or_what_is_no_template_does_not(templates: Path, tmp_path: Path) -> None:
    before = [solver.identity for solver in solvers(templates)]
    (templates / "notes.txt").write_text("other words\n")
    (templates / "out").mkdir()
    (templates / "out" / "result.json").write_text("{}")
    assert [solver.identity for solver in solvers(templates)] == before
    elsewhere = tmp_path / "else" / "where"
    shutil.move(templates, elsewhere)
    assert [solver.identity for solver in solvers(elsewhere)] == before
    # One more template, or another name of one, is another set of them.
    shutil.copy(elsewhere / "notes.txt", elsewhere / "strip.inp.j2")
    assert all(s.identity not in before for s in solvers(elsewhere))


def test_a_template_that_cannot_be_parsed_still_counts(templates: Path) -> None:
    before = templates_mark(templates)
    (templates / "bubble.inp.j2").write_text("{% include ")
    broken = templates_mark(templates)
    (templates / "bubble.inp.j2").write_text("{% include  ")
    assert len({before, broken, templates_mark(templates), templates_mark(None)}) == 4


def test_templates_that_include_each_other_end(tmp_path: Path) -> None:
    (tmp_path / "a.j2").write_text("{% include 'b' %}{% include name %}{% include 'gone' %}")
    (tmp_path / "b").write_text("{% include 'a.j2' %}")
    assert len(templates_mark(tmp_path)) == 64


def test_what_changes_no_result_is_not_in_it(tmp_path: Path) -> None:
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


def test_blocks_of_a_site_count_by_content(tmp_path: Path) -> None:
    one, other = tmp_path / "post.dat", tmp_path / "moved" / "post.dat"
    one.write_text("post\n")
    other.parent.mkdir()
    shutil.copy(one, other)
    marks = [MarcSolver(include={"post": str(file)}).identity for file in (one, other)]
    assert marks[0] == marks[1]
    one.write_text("post again\n")
    assert MarcSolver(include={"post": str(one)}).identity != marks[0]
    assert MarcSolver(version="2023.1").identity != MarcSolver().identity


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read: No such file"):
        file_mark(tmp_path / "none")
