"""The same fit with CalculiX a second time: no CalculiX runs, and it says so."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.options import with_solver
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.project.project import read_project
from bubblefit.solvers.run_cache import VARIABLE, RunCache

from ...commands import in_process as bubblefit
from ...programs import program
from .test_calculix_bubble import LINEAR, PROJECT

#: What a second fit may say differently: how long it took, and that nothing ran.
TIMES = ("wall_s", "external_runs", "cached_runs")


@pytest.fixture
def counted(ccx, tmp_path):
    """A ccx that writes a line into a file for every analysis, and the file."""
    told = tmp_path / "analyses"
    text = f'#!/bin/sh\ncase "$1" in -i) echo run >> {told} ;; esac\nexec {ccx.path} "$@"\n'
    return program(tmp_path / "bin" / "ccx", text), told


def result_of(folder):
    result = json.loads((folder / "result.json").read_text())
    result["starts"] = [{k: v for k, v in s.items() if k not in TIMES} for s in result["starts"]]
    return result


def test_a_second_identical_fit_runs_no_ccx(counted, tmp_path, monkeypatch):
    ccx, told = counted
    cache = RunCache(tmp_path / "runs")
    monkeypatch.setenv(VARIABLE, str(cache.folder))
    (tmp_path / "project.toml").write_text(PROJECT.replace("elements = 64", "elements = 32"))
    arguments = ("bubble", "project.toml", "--solver", "calculix", "--ccx", ccx, "--quiet")

    bubblefit(*arguments, "--out", "one", cwd=tmp_path)
    first, runs = result_of(tmp_path / "one"), len(told.read_text().splitlines())
    assert first["external_runs"] >= 2 and first["cached_runs"] == 0
    # The known solution is one of them; the best fit once more is in the cache already.
    assert runs == first["external_runs"] + 1 == len(cache.entries())

    done = bubblefit(*arguments, "--out", "two", cwd=tmp_path)
    second = result_of(tmp_path / "two")
    assert len(told.read_text().splitlines()) == runs
    assert (second["external_runs"], second["cached_runs"]) == (0, first["external_runs"])
    assert f"(0 of calculix, {first['external_runs']} from the cache)" in done.stdout
    for name in TIMES:
        first.pop(name), second.pop(name)
    assert first == second
    cards = [(tmp_path / name / "material.toml").read_text() for name in ("one", "two")]
    assert cards[0] == cards[1]
    rows = pd.read_csv(tmp_path / "two" / "history.csv")
    status = rows[rows.solver == "calculix"].status
    assert set(status) == {"ok, from the cache"}
    page = (tmp_path / "two" / "report.html").read_text()
    assert "of them from the cache" in page

    # A damaged one is told, run again, and the fit is the same.
    cache.entries()[0].path.write_bytes(b"bubblefit run 1\ncut")
    done = bubblefit(*arguments, "--out", "three", cwd=tmp_path)
    assert "is dropped from the cache of runs and run again" in done.stderr
    third = result_of(tmp_path / "three")
    assert len(told.read_text().splitlines()) == runs + 1
    for name in TIMES:
        third.pop(name)
    assert third == second


def test_it_can_be_turned_off(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "usual"))
    path = tmp_path / "project.toml"
    path.write_text(PROJECT)
    project = read_project(path)
    assert project.run_cache.folder == tmp_path / "usual" / "runs"
    given = {"solver": "calculix", "cache": True}
    assert with_solver(project, given).run_cache is project.run_cache
    assert with_solver(project, {**given, "cache": False}).run_cache is None
    path.write_text(PROJECT.replace("[fit]", '[fit]\ncache = "kept"'))
    assert read_project(path).run_cache.folder == tmp_path / "kept"
    path.write_text(PROJECT.replace("[fit]", "[fit]\ncache = false"))
    assert read_project(path).run_cache is None


def test_no_cache_runs_every_analysis(counted, tmp_path, monkeypatch):
    ccx, told = counted
    monkeypatch.setenv(VARIABLE, str(tmp_path / "runs"))
    (tmp_path / "project.toml").write_text(PROJECT.replace("elements = 64", "elements = 32"))
    law = replace(LINEAR, strain_range=np.ones(3))
    write_card(MaterialCard(law, 0.81, "test", "linear"), tmp_path / "card.toml")
    arguments = ("simulate", "bubble", "project.toml", "--solver", "calculix", "--ccx", ccx,
                 "--card", "card.toml", "--overwrite", "--out", "out")  # fmt: skip
    for given, runs in (((), 1), ((), 1), (("--no-cache",), 2), ((), 2)):
        bubblefit(*arguments, *given, cwd=tmp_path)
        assert len(told.read_text().splitlines()) == runs
