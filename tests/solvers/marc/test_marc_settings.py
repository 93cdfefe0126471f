"""Where a site says how its Marc runs: project file, site file, environment, command line."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from bubblefit.cli.options import with_solver
from bubblefit.materials.card import MaterialCard, read_card, write_card
from bubblefit.project.project import read_project
from bubblefit.solvers.marc.settings import BLOCKS, MarcSettings, marc_settings
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.solvers.registry import diagnose, solver_named

from ...complaints import complaint
from ...solvers.marc.test_marc_run import LAW, files

EXAMPLE = Path(__file__).parents[3] / "examples" / "bubble-known-solution" / "project.toml"
NOTHING = {"solver": None, "ccx": None, "marc": None, "templates": None, "element": None}


@pytest.fixture(autouse=True)
def no_site(monkeypatch):
    monkeypatch.delenv("BUBBLEFIT_MARC", raising=False)


def project(folder, *tables):
    path = folder / "project.toml"
    text = EXAMPLE.read_text().replace("elements = 800", "elements = 32", 1)
    path.write_text("\n".join([text, *tables]))
    return path


def test_a_site_file_is_below_what_is_given(tmp_path, monkeypatch):
    settings = marc_settings({})
    assert (settings.executable, settings.element, settings.law) == ("run_marc", 139, "nlelast")
    assert settings == MarcSettings() and settings.increments == 100
    (tmp_path / "nl.dat").write_text("mine")
    (tmp_path / "bin").mkdir()
    site = tmp_path / "site.toml"
    site.write_text(
        'executable = "bin/run_marc"\nelement = 75\nthreads = 2\nmodules = ["marc/2023"]\n'
        '[include]\nnlelast = "nl.dat"\n[environment]\nA = "1"\nB = "2"\n'
    )
    monkeypatch.setenv("BUBBLEFIT_MARC", str(site))
    settings = marc_settings({"threads": 4, "element": None, "environment": {"B": "3"}})
    assert settings.executable == str(tmp_path / "bin" / "run_marc")
    assert (settings.element, settings.threads) == (75, 4)
    assert settings.include == {"nlelast": str(tmp_path / "nl.dat")}
    assert settings.environment == {"A": "1", "B": "3"}
    # What is named counts more than the environment.
    other = marc_settings({"executable": "from_a_project"}, "/opt/marc/run_marc")
    assert other.executable == "/opt/marc/run_marc" and other.threads == 1
    monkeypatch.setenv("BUBBLEFIT_MARC", "/opt/marc/run_marc")
    assert marc_settings({}).executable == "/opt/marc/run_marc"
    assert marc_settings({"executable": "mine"}).executable == "mine"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"elemint = 75", "elemint: unknown key; did you mean 'element'"),
        (b"element = 22", "element: expected 139, 75 or 18"),
        (b"element = ", "TOML syntax"),
        (b"threads = 0", "threads"),
        (b'threads = "2"', "threads"),
        (b'modules = ["marc/2023; rm -rf x"]', "modules[0]"),
        (b'options = "new"', "options: expected 'current' or 'older'"),
        (b"timeout = -1", "timeout"),
        (b"[environment]\n\"A B\" = '1'", "environment"),
        (b"\xff\xfe\x00", "UTF-8"),
        (None, "cannot be read"),
    ],
)
def test_mistakes_in_a_site_file_name_it_and_the_key(tmp_path, text, words):
    site = tmp_path / "site.toml"
    if text is not None:
        site.write_bytes(text)
    said = complaint(marc_settings, {}, str(site))
    assert str(site) in said and words in said


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"include": {"nlelst": "x"}}, "there is no block 'nlelst'; there are cavity"),
        ({"include": {"nlelast": "/none"}}, "/none: solver.marc.include.nlelast: there is no"),
        ({"templates": "/none"}, "/none: templates: there is no such folder"),
        ({"element": "S4"}, "solver.marc.element: expected 139, 75 or 18, got 'S4'"),
        ({"what": 1}, "solver.marc.what: unknown key"),
    ],
)
def test_mistakes_elsewhere_are_one_line(given, words):
    assert words in complaint(marc_settings, given)
    assert words in complaint(MarcSolver, **given)


def test_a_project_file_and_the_command_line(tmp_path):
    (tmp_path / "nl.dat").write_text("mine")
    path = project(
        tmp_path,
        "[solver.marc]\nelement = 75\nscratch = 'here'\nexecutable = 'bin/run_marc'",
        "[solver.marc.include]\nnlelast = 'nl.dat'",
    )
    settings = read_project(path, need_data=False)
    solver = solver_named("marc", **settings.solver_options["marc"]).settings
    assert solver.element == 75 and solver.executable == str(tmp_path / "bin" / "run_marc")
    assert solver.include == {"nlelast": str(tmp_path / "nl.dat")}
    assert solver.scratch == str(tmp_path / "here")
    given = {**NOTHING, "solver": "marc", "element": "18", "marc": "/opt/run_marc",
             "templates": tmp_path}  # fmt: skip
    options = with_solver(settings, given).solver_options["marc"]
    solver = solver_named("marc", **options).settings
    assert (solver.element, solver.executable) == (18, "/opt/run_marc")
    assert solver.templates == str(tmp_path)
    # What a project does not say, the site does.
    (tmp_path / "site.toml").write_text("threads = 3\nelement = 139\n")
    options = with_solver(
        settings, {**NOTHING, "solver": "marc", "marc": str(tmp_path / "site.toml")}
    )
    solver = solver_named("marc", **options.solver_options["marc"]).settings
    assert (solver.threads, solver.element) == (3, 75)


def command(*arguments, cwd, code=0, **variables):
    done = subprocess.run(
        [sys.executable, "-m", "bubblefit.cli", *map(str, arguments)],
        cwd=cwd, capture_output=True, text=True, timeout=300, env={**os.environ, **variables},
    )  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    return done


@pytest.fixture
def ready(tmp_path):
    """A project, its card, and a program that leaves what Marc would of simulating it."""
    path = project(tmp_path)
    settings = read_project(path, need_data=False)
    card = tmp_path / "card.toml"
    write_card(MaterialCard(LAW, 0.81, "linear"), card)
    (test,) = settings.tests.values()
    (given,) = test.models().values()
    history = MembraneSolver().run(given, read_card(card).law)
    folder = files(tmp_path / "good", given, history)
    program = tmp_path / "run_marc"
    program.write_text(f"#!/bin/sh\ncp {folder}/job.* .\n")
    program.chmod(0o755)
    return path, card, program, history


def test_simulate_bubble_with_marc(ready, tmp_path):
    path, card, program, history = ready
    simulate = ("simulate", "bubble", path, "--card", card, "--solver", "marc", "--overwrite")
    done = command(*simulate, "--marc", program, "--json", cwd=path.parent)
    result = json.loads(done.stdout)
    assert result["solver"] == "marc"
    apex = history.displacement[:, 0, 2]
    assert np.isclose(np.max(result["apex_mm"]), apex.max(), rtol=1e-5)
    done = command(*simulate, cwd=tmp_path, code=4, PATH="/usr/bin:/bin")
    assert len(done.stderr.strip().splitlines()) == 1 and "run_marc" in done.stderr


def test_doctor_tells_of_a_marc_that_was_named(ready, tmp_path, monkeypatch):
    _, _, program, _ = ready
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    assert [one.name for one in diagnose()][-1] != "marc"
    # It is there, but does not answer the bars.
    site = tmp_path / "site.toml"
    site.write_text('executable = "./run_marc"\nscratch = "scratch"\nversion = "2023.1"\n')
    (found,) = [one for one in diagnose(marc=site) if one.name == "marc"]
    assert found.expected and not found.usable and "ended at time 9 of 100" in found.advice
    assert found.version == "2023.1"
    (found,) = [one for one in diagnose(marc=tmp_path / "none") if one.name == "marc"]
    assert not found.usable and "no such file" in found.advice
    monkeypatch.setenv("BUBBLEFIT_MARC", str(site))
    (found,) = [one for one in diagnose() if one.name == "marc"]
    assert found.origin == "BUBBLEFIT_MARC" and found.path == program


def test_every_setting_and_block_is_documented_and_there():
    root = Path(__file__).parents[3]
    text = (root / "docs" / "how-to" / "marc.md").read_text()
    for name in (*MarcSettings.model_fields, *BLOCKS):
        assert name in text, name
    for name in BLOCKS:
        assert (root / "templates" / "marc" / f"{name}.dat.j2").is_file()
