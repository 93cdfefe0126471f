"""solvers/settings.py: settings of solvers in project, site file and command line."""

import json
from pathlib import Path

import pytest
from bubblefit.solvers import registry
from bubblefit.solvers.base import Solver
from bubblefit.solvers.registry import (
    SOLVERS,
    command_line,
    counted,
    overridden,
    solver_named,
    solver_sections,
    solver_settings,
)
from bubblefit.solvers.settings import LicenceSettings, licence_settings, split

from ..builders.plug_ins import install_plug_in
from ..support.refusals import complaint

# --- solver settings ---
PROJECT = Path("/somewhere/project.toml")


def test_defaults_and_units_of_solver_settings():
    found = solver_settings(PROJECT, {})
    assert set(found) == set(SOLVERS) == {"calculix", "command", "marc", "membrane"}
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
def test_wrong_solver_table_is_one_line_with_file_and_key(tables, words):
    assert complaint(solver_settings, PROJECT, tables).startswith(f"{PROJECT}: {words}")


def test_command_line_overrides_solver_settings(tmp_path, monkeypatch):
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
def test_wrong_solver_option_of_the_command_line_is_refused(name, given, settings, words):
    options = solver_settings(PROJECT, {})[name]
    assert complaint(overridden, name, options, given, settings).startswith(words)


LICENCE_PROJECT = Path("/somewhere/project.toml")


def test_settings_of_external_solvers_default_to_the_site_file(tmp_path, monkeypatch):
    waits = [
        LicenceSettings(**g).wait
        for g in ({}, {"licences": 3}, {"licences": 3, "licence_wait": 0.0})
    ]
    assert waits == [0, 600, 0]
    site = tmp_path / "site.toml"
    site.write_text('licences = 3\nlicence_retry = 2.0\nlicence_folder = "locks"\n')
    monkeypatch.setattr(registry, "licensed", lambda _, name, given: licence_settings(name, given))
    found = solver_named("marc", marc=site, licences=5)
    assert (found.licences, found.licence_retry) == (5, 2.0)
    assert found.licence_folder == str(tmp_path / "locks")


ACME = """
class THING:
    name, external, progress, identity = "acme", True, None, "acme 1"
    def __init__(self, acmes=0): pass
    def run(self, model, law, scratch=None, timeout=None): pass
    def check(self): pass
"""


def test_external_solvers_have_the_keys_of_licences(packages):
    install_plug_in(packages, "acme", ACME, group="bubblefit.solvers")
    keys = {"licences": 4, "licence_folder": "locks", "licence_denied": ["no seat"]}
    tables = {"marc": keys, "calculix": keys, "acme": {**keys, "acmes": 1}}
    found = solver_settings(LICENCE_PROJECT, tables)
    for name in tables:
        solver = solver_named(name, **found[name])
        assert "run" in vars(solver), name
        given = licence_settings(name, split(found[name])[0])
        assert (given.licences, given.wait) == (4, 600)
        assert given.licence_folder == "/somewhere/locks"
        assert given.licence_denied == ["no seat"]
        # Who answers as a scheduler runs code here: no project names one.
        for key, value in {"licences": 0, "licence_wait": -1.0, "licence_denied": "text",
                           "licence_scheduler": "tcp://x:1"}.items():  # fmt: skip
            said = complaint(solver_settings, LICENCE_PROJECT, {name: {key: value}})
            assert said.startswith(f"{LICENCE_PROJECT}: solver.{name}.{key}: "), said
    assert found["acme"]["acmes"] == 1
    assert counted("acme", found["acme"]) == {"acmes": 1}  # licences change no result
