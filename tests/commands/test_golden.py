"""Terminal output that no other test compares, and what holds for all of tests/golden/."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from bubblefit.cli.main import main

from ..audit import audit
from ..builders.projects import constant_strips
from ..support.commands import every_command, in_process
from ..support.disturbed_folders import DISTURBANCES, disturb_unit, disturbed
from ..support.golden import FOLDER, differences, normalised
from ..support.rounding import disturb_data

CARD = ("--card", "out/material.toml")


TWO = (*CARD, "--test", "two", "--quiet")


#: By the name of the file: what is typed, in the folder of a fit of constant strips.
COMMANDS = {
    "help": ("--help",),
    "profile": ("profile", "project.toml", "--modulus", "E1=0", *TWO),
    "bootstrap": (
        "bootstrap", "project.toml", "--over", "specimens", "--samples", 3, "--jobs", 1, *TWO
    ),
    "plan": ("plan", "project.toml", "--rank", "E1", *TWO),
    "estimate": ("estimate", "project.toml", "--test", "two"),
    "validate": ("validate", "project.toml", *TWO),
    "simulate-test": ("simulate", "test", "project.toml", *CARD, "--test", "two"),
    "export": ("export", "out/material.toml", "--format", "constants"),
    "report": ("report", "out"),
    "verify": ("verify", "--subject", "bars"),
    "cache": ("cache", "--folder", "runs"),
    "docs": ("docs", "changelog", "--path"),
    "schema": ("schema", "--out", "s.json"),
    "init": ("init", "mine"),
    "init-own": ("init", "own", "--own", "--bubble", 1, "--thickness", 0.8),
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("golden")
    constant_strips(folder)
    in_process("fit", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1, cwd=folder)
    return folder


@pytest.mark.parametrize("name", COMMANDS)
def test_command_prints_its_golden_file(name, folder, golden):
    golden(name, in_process(*COMMANDS[name], cwd=folder).stdout, folder)


def test_disturbed_data_print_the_same_golden_files(tmp_path, monkeypatch):
    """Numbers that rounding can move are not held to more digits than it leaves."""
    disturb_data(monkeypatch, 1e-12, seed=2)
    folder = tmp_path / "golden0"
    folder.mkdir()
    constant_strips(folder)
    in_process("fit", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1, cwd=folder)
    for name in ("profile", "estimate", "plan", "bootstrap", "validate", "simulate-test"):
        printed = normalised(in_process(*COMMANDS[name], cwd=folder).stdout, folder)
        assert differences(printed, (FOLDER / f"{name}.txt").read_text()) == []


def test_doctor_lists_the_embedded_solver(golden, tmp_path):
    golden("doctor", in_process("doctor", cwd=tmp_path).stdout.splitlines()[0], tmp_path)


@pytest.mark.parametrize("seed", range(12))
def test_auditor_finds_a_fault_put_in_by_hand(seed, folder, tmp_path):
    faults = (*DISTURBANCES, disturb_unit)
    out = tmp_path / "out"
    fault = disturbed(folder / "out", out, faults[seed % 6], np.random.default_rng(seed))
    assert audit(out, base=folder).findings, fault


def test_auditor_imports_nothing_of_bubblefit():
    for path in (Path(__file__).parents[1] / "audit").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert node.level < 2, path
                names = [node.module or ""]
            assert not any(name.startswith("bubblefit") for name in names), path


def test_every_command_has_a_golden_file():
    names = {"-".join(path) for path, _ in every_command(main)}
    groups = {"simulate", "simulate-strips", "study", "dic"}  # strips: another name of uniaxial
    assert names - groups <= {path.stem for path in FOLDER.iterdir()}


def test_only_lines_of_tables_are_wider_than_a_terminal():
    for path in FOLDER.iterdir():
        lines = path.read_text().splitlines()
        wide = [line for line in lines if len(line) > 80 and not re.search(r"\S  +\S", line)]
        assert wide == [], path.name
