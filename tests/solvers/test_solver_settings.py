"""Settings of solvers, and their identity."""

import json
import shutil
from pathlib import Path

import pytest
from bubblefit.solvers.base import Solver
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.decks import file_mark, templates_mark
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import (
    SOLVERS,
    command_line,
    overridden,
    solver_named,
    solver_sections,
    solver_settings,
)

from ..support.refusals import complaint

# --- solver settings ---
PROJECT = Path("/somewhere/project.toml")


def test_settings_of_our_solvers():
    found = solver_settings(PROJECT, {})
    assert set(found) == set(SOLVERS) == {"calculix", "marc", "membrane"}
    assert found["membrane"] == {
        "wall": "band", "wrinkle_stiffness": None, "bending_stiffness": None
    }  # fmt: skip
    assert found["calculix"]["element"] == "S8R" and found["calculix"]["ccx"] is None
    assert all(isinstance(solver_named(name, **o), Solver) for name, o in found.items())
    tables = {"calculix": {"ccx": "bin/ccx", "templates": "mine", "scratch": "~/runs"}}
    found = solver_settings(PROJECT, tables)["calculix"]
    assert found["ccx"] == Path("/somewhere/bin/ccx")
    assert found["templates"] == Path("/somewhere/mine")
    assert found["scratch"] == Path.home() / "runs"
    tables = {"calculix": {"ccx": "ccx_2.21"}}
    assert solver_settings(PROJECT, tables)["calculix"]["ccx"] == "ccx_2.21"
    for name, section in solver_sections().items():
        schema = section.model_json_schema()
        assert schema["additionalProperties"] is False, name
        assert set(schema["properties"]) == set(section.model_fields)
        json.dumps(schema)


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"calculix": {"elemint": "S4"}}, "solver.calculix.elemint: unknown key; did you mean"),
        ({"calculix": {"element": "S3"}}, "solver.calculix.element: expected 'S8R' or 'S4'"),
        ({"calculix": 3}, "solver.calculix: expected"),
        ({"membrane": {"wrinkle_stiffness": 2.0}}, "solver.membrane.wrinkle_stiffness: expected"),
        ({"membrane": {"wall": "soft"}}, "solver.membrane.wall: expected 'band', 'tension field'"),
        ({"marc": {"threads": "2"}}, "solver.marc.threads: expected"),
        ({"calculiks": {}}, "solver.calculiks: no solver of this name is installed; there are: "),
    ],
)
def test_a_wrong_table_is_one_line_with_file_and_key(tables, words):
    assert complaint(solver_settings, PROJECT, tables).startswith(f"{PROJECT}: {words}")


def test_the_command_line_takes_the_place_of_a_setting(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    named = {one.name: one for one in command_line()}
    assert list(named) == ["ccx", "templates", "element", "marc"]
    assert named["element"].what == "Shell element: S8R or S4 (calculix), 139, 75 or 18 (marc)."
    options = solver_settings(PROJECT, {"calculix": {"element": "S4", "threads": 3}})["calculix"]
    given = {"ccx": None, "marc": None, "element": "S8R"}
    settings = ("timeout=60", "scratch=runs", 'ccx = "my ccx"')
    assert overridden("calculix", options, given, settings) == {
        **options, "element": "S8R", "timeout": 60.0, "scratch": tmp_path / "runs", "ccx": "my ccx"
    }  # fmt: skip
    assert overridden("acme", {"a": 1}, {"ccx": None}, ("b=[1, 2]", "c=text")) == {
        "a": 1, "b": [1, 2], "c": "text"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "given", "settings", "words"),
    [
        ("membrane", {"ccx": "ccx"}, (), "--ccx: means nothing to the solver 'membrane'"),
        ("marc", {"ccx": "ccx"}, (), "--ccx: means nothing to the solver 'marc'"),
        ("calculix", {}, ("threads",), "--solver-option: expected KEY=VALUE, got 'threads'"),
        ("calculix", {}, ("threads=0",), "--solver-option threads: expected greater than or"),
        ("calculix", {}, ("thread=1",), "--solver-option thread: unknown key; did you mean"),
    ],
)
def test_what_the_command_line_cannot_say(name, given, settings, words):
    options = solver_settings(PROJECT, {})[name]
    assert complaint(overridden, name, options, given, settings).startswith(words)


# --- identity ---
NO_CCX = "/nowhere/ccx"


@pytest.fixture
def templates(tmp_path):
    folder = tmp_path / "templates"
    (folder / "parts").mkdir(parents=True)
    (folder / "bubble.inp.j2").write_text("{% include 'heading.inp' %}\n*STEP\n")
    (folder / "heading.inp").write_text("*HEADING\n{% include 'parts/more.txt' %}\n")
    (folder / "parts" / "more.txt").write_text("more\n")
    (folder / "notes.txt").write_text("for myself\n")
    return folder


def solvers(folder):
    return [CalculixSolver(NO_CCX, templates=folder), MarcSolver(templates=str(folder))]


@pytest.mark.parametrize("edited", ["bubble.inp.j2", "heading.inp", "parts/more.txt"])
def test_a_template_edited_in_place_changes_the_identity(templates, edited):
    before = [solver.identity for solver in solvers(templates)]
    file = templates / edited
    file.write_text(file.read_text() + "** one line more\n")
    after = [solver.identity for solver in solvers(templates)]
    assert all(one != other for one, other in zip(before, after, strict=True))


def test_moving_the_folder_or_what_is_no_template_does_not(templates, tmp_path):
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


def test_broken_and_circular_templates_count(templates, tmp_path):
    before = templates_mark(templates)
    (templates / "bubble.inp.j2").write_text("{% include ")
    broken = templates_mark(templates)
    (templates / "bubble.inp.j2").write_text("{% include  ")
    assert len({before, broken, templates_mark(templates), templates_mark(None)}) == 4
    (tmp_path / "a.j2").write_text("{% include 'b' %}{% include name %}{% include 'gone' %}")
    (tmp_path / "b").write_text("{% include 'a.j2' %}")
    assert len(templates_mark(tmp_path)) == 64


def test_what_counts_for_the_identity(tmp_path):
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
