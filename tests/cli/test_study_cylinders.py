"""`bubblefit study` of cylinders: tests by name, cards of the project, runs that stop early."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..commands import in_process, one_line, result_in
from ..cylinder_cases import STUDIED_PROJECT
from ..drawings import check_convergence, data, named, shown
from ..places import KNOWN


@pytest.fixture
def project(tmp_path):
    path = tmp_path / "project.toml"
    path.write_text(STUDIED_PROJECT)
    return path


def study(name, *arguments, cwd, code=0):
    return in_process("study", name, "project.toml", *arguments, cwd=cwd, code=code)


def test_increments_of_a_cylinder_converge(project, drawn):
    run = ("mesh", "--card", "known", "--test", "narrow", "--what", "increments", "--levels", 3)
    done = study(*run, "--out", "out", cwd=project.parent)
    result = result_in(project.parent / "out")
    assert list(result["models"]) == ["narrow"] and result["card"] == "known"
    found = result["models"]["narrow"]["quantities"]
    # The mean of a modulus over an increment leaves next to nothing to the increments.
    for quantity in found.values():
        assert abs(quantity["own_error"]) < 2e-6
    coarse, fine = result["models"]["narrow"]["rms_N"]["to_next_finer"]
    assert coarse / fine == pytest.approx(4.0, abs=0.2)  # second order
    # Sideways radius, volume, stiffness, load at 40 mm and RMS: each has its line.
    table = pd.read_csv(project.parent / "out/convergence.csv")
    rms = result["models"]["narrow"]["rms_N"]
    check_convergence(drawn[-1], table, "increments", rms)
    names = {*found, "RMS along the load curve"}
    assert {s.name for s in drawn[-1].charts[0].series[:-2]} == names
    assert "load at 40 mm" in done.stdout


def test_levels_without_a_quantity_are_left_out_of_it(project, monkeypatch, drawn):
    run = MembraneSolver.run

    def tired(self, model, law, *args, **kwargs):
        history = run(self, model, law, *args, **kwargs)
        if len(model.increments) > len(model.deflections):
            return history
        return replace(
            history, load=history.load[:4], displacement=history.displacement[:4],
            remarks=("the run stopped early",),
        )  # fmt: skip

    monkeypatch.setattr(MembraneSolver, "run", tired)
    run = ("mesh", "--card", "known", "--case", "narrow", "--what", "increments", "--levels", 2)
    done = study(*run, "--out", "out", cwd=project.parent)
    found = result_in(project.parent / "out")["models"]["narrow"]
    assert "load at 40 mm, N" not in found["levels"][0]["values"]
    assert found["quantities"]["load at 40 mm, N"]["own_error"] is None
    assert len(found["rms_N"]["to_next_finer"]) == 1
    table = pd.read_csv(project.parent / "out/convergence.csv")
    assert (table.quantity == "load at 40 mm, N").sum() == 1
    # Its name is there, and no point of it.
    assert set(named(drawn[-1].charts[0])["load at 40 mm, N"].y) == {None}
    assert "-" in done.stdout


def test_nu12_of_all_cylinders(project, drawn):
    study("nu12", "--card", "known", "--nu12", 0.4, "--out", "out", cwd=project.parent)
    models = result_in(project.parent / "out")["models"]
    assert list(models) == ["narrow", "wide"]
    for model in models.values():
        assert list(model["responses"]) == ["load at 40 mm, N"]
    for axes, (name, model) in zip(drawn[-1].charts, models.items(), strict=True):
        response = model["responses"]["load at 40 mm, N"]
        wanted = [response["nu12"], response["to_base"]]
        np.testing.assert_allclose(data(axes)[0], wanted, rtol=1e-5)
        assert shown(axes)[::2] == ("nu12", name)
    assert drawn[-1].charts[0].y_label == "load / that at nu12 = 0.24"


def test_mistakes_end_in_one_line(project):
    for options, words in (
        (["--card", "other"], "--card: there is no card (and no file) 'other'"),
        (["--card", "known", "--test", "slim"], "--test: there is no test 'slim'"),
        (["--card", "known", "--coarser", 3], "size: expected at most the radius"),
        (["--card", "known", "--solver", "none"], "fit.solver (or --solver)"),
    ):
        one_line(study("mesh", *options, cwd=project.parent, code=2), words)
        assert not (project.parent / "out").exists()
    project.write_text(KNOWN.read_text())
    done = study("mesh", "--card", "x", "--test", "a", cwd=project.parent, code=2)
    one_line(done, "there is no")
