"""[solver.NAME] of a project, and what the command line says instead."""

import importlib
import json
import sys
from pathlib import Path

import pytest
from bubblefit.errors import SolverFailure
from bubblefit.solvers.bars import diagnose
from bubblefit.solvers.base import Solver
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import (
    SOLVERS,
    command_line,
    overridden,
    solver_named,
    solver_names,
    solver_sections,
    solver_settings,
    usable_solver,
)

from ..complaints import complaint

PROJECT = Path("/somewhere/project.toml")


def test_without_tables_every_solver_of_ours_has_its_defaults() -> None:
    found = solver_settings(PROJECT, {})
    assert set(found) == set(SOLVERS) == {"calculix", "marc", "membrane"}
    assert found["membrane"] == {
        "wall": "band", "wrinkle_stiffness": None, "bending_stiffness": None
    }  # fmt: skip
    assert found["calculix"]["element"] == "S8R" and found["calculix"]["ccx"] is None
    assert all(isinstance(solver_named(name, **o), Solver) for name, o in found.items())


def test_paths_are_beside_the_project_and_bare_names_on_the_path() -> None:
    tables = {"calculix": {"ccx": "bin/ccx", "templates": "mine", "scratch": "~/runs"}}
    found = solver_settings(PROJECT, tables)["calculix"]
    assert found["ccx"] == Path("/somewhere/bin/ccx")
    assert found["templates"] == Path("/somewhere/mine")
    assert found["scratch"] == Path.home() / "runs"
    tables = {"calculix": {"ccx": "ccx_2.21"}}
    assert solver_settings(PROJECT, tables)["calculix"]["ccx"] == "ccx_2.21"


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
def test_a_wrong_table_is_one_line_with_file_and_key(tables, words) -> None:
    assert complaint(solver_settings, PROJECT, tables).startswith(f"{PROJECT}: {words}")


def test_a_json_schema_can_be_made_of_every_section() -> None:
    for name, section in solver_sections().items():
        schema = section.model_json_schema()
        assert schema["additionalProperties"] is False, name
        assert set(schema["properties"]) == set(section.model_fields)
        json.dumps(schema)


def test_a_usable_solver_names_the_file_and_the_key() -> None:
    assert isinstance(usable_solver("membrane", {"bending_stiffness": 0.5}), MembraneSolver)
    words = complaint(usable_solver, "nothing", {}, PROJECT, "run.solver")
    assert words.startswith(f"{PROJECT}: run.solver (or --solver): 'nothing' is not one of: calc")
    with pytest.raises(SolverFailure, match="no-such-marc"):
        usable_solver("marc", {"executable": "no-such-marc"})


def test_the_command_line_has_each_option_once() -> None:
    options = {one.name: one for one in command_line()}
    assert list(options) == ["ccx", "templates", "element", "marc"]
    assert options["element"].what == "Shell element: S8R or S4 (calculix), 139, 75 or 18 (marc)."


def test_the_command_line_takes_the_place_of_a_setting(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    options = solver_settings(PROJECT, {"calculix": {"element": "S4", "threads": 3}})["calculix"]
    given = {"ccx": None, "marc": None, "element": "S8R"}
    settings = ("timeout=60", "scratch=runs", 'ccx = "my ccx"')
    found = overridden("calculix", options, given, settings)
    assert found == {
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
def test_what_the_command_line_cannot_say(name, given, settings, words) -> None:
    options = solver_settings(PROJECT, {})[name]
    assert complaint(overridden, name, options, given, settings).startswith(words)


# A solver in the tree: one folder, one line

FOLDER = {
    "__init__.py": "",
    "settings.py": """
from bubblefit.solvers.settings import Offer
from bubblefit.solvers.settings import Override, SolverSettings

class AcmeSettings(SolverSettings):
    paths = ("deck",)
    programs = ("acme",)
    overrides = (
        Override("acme", "The ACME to run.", metavar="PATH", look="An ACME to look at."),
        Override("element", "Shell element", "A1 or A2"),
    )
    acme: str = "acme"
    deck: str | None = None
    element: str = "A1"

OFFER = Offer("acme", __package__, "AcmeSolver", AcmeSettings)
""",
    "solver.py": """
from bubblefit.solvers.base import SolverCheck

class AcmeSolver:
    name, external, progress, identity = "acme", True, None, "acme 1"
    def __init__(self, acme="acme", deck=None, element="A1"):
        self.given = acme, deck, element
    def run(self, model, law, scratch=None, timeout=None): ...
    def check(self): return SolverCheck("acme", True, "1", True)
""",
    "diagnosis.py": """
from bubblefit.solvers.base import Diagnosis

def diagnose(named=None):
    return [Diagnosis("acme", "1", named, "named", named is not None, None, True)]
""",
}


@pytest.fixture
def acme(tmp_path, monkeypatch):
    folder = tmp_path / "acme_in_the_tree"
    folder.mkdir()
    for name, text in FOLDER.items():
        (folder / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    offer = importlib.import_module("acme_in_the_tree.settings").OFFER
    monkeypatch.setitem(SOLVERS, "acme", offer)
    yield
    for name in [name for name in sys.modules if name.startswith("acme_in_the_tree")]:
        del sys.modules[name]


def test_a_folder_and_a_line_make_a_solver_of_ours(acme, monkeypatch) -> None:
    options = solver_settings(PROJECT, {"acme": {"deck": "d.inp", "acme": "bin/acme"}})["acme"]
    assert options["deck"] == Path("/somewhere/d.inp")
    options = overridden("acme", options, {"element": "A2", "ccx": None}, ("acme=other",))
    solver = usable_solver("acme", options, PROJECT)
    assert solver.given == ("other", Path("/somewhere/d.inp"), "A2")
    said = {one.name: one.what for one in command_line()}
    assert said["acme"] == "The ACME to run."
    assert said["element"].endswith("139, 75 or 18 (marc), A1 or A2 (acme).")
    assert "acme" in solver_names() and "acme" in solver_sections()
    for ours in ("calculix", "marc"):
        monkeypatch.setattr(f"bubblefit.solvers.{ours}.diagnosis.diagnose", lambda named: [])
    assert [one.name for one in diagnose()] == ["membrane", "acme"]
    (found,) = [one for one in diagnose(acme="/opt/acme") if one.name == "acme"]
    assert found.expected and found.path == "/opt/acme"
