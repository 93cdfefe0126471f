"""`bubblefit study` of a project of bending: refinements, quantities, cases, runs that stop."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.cli.main import main
from bubblefit.cli.study_kinds import KINDS, levels
from bubblefit.errors import InputError
from bubblefit.projects.bend import read_bend
from bubblefit.reports import ConvergencePanel, plot_convergence
from bubblefit.solvers.base import History
from bubblefit.solvers.membrane.solver import MembraneSolver
from bubblefit.studies.bend_convergence import quantities, refined_cylinder
from bubblefit.studies.poisson import by_response
from bubblefit.studies.refinement import rms_between
from click.testing import CliRunner

# Thesis Table 4.2, "solution", GPa.
PROJECT = """
[project]
kind = "bend"
[units]
length = "mm"
pressure = "kPa"
modulus = "GPa"
[cylinder]
thickness = 0.81
element_size = 60.0
deflections = [10.0, 20.0, 30.0, 40.0]
[[cases]]
name = "narrow"
diameter = 150.0
pressure = 140.0
[[cases]]
name = "wide"
diameter = 200.0
pressure = 100.0
[[cards]]
name = "known"
strain_range = [0.2, 0.2, 0.2]
beta = [-7.96788e-3, 7.10747e-1, -1.56912e-1, 2.00439e-2, -1.06241e1, 1.37830e1, -9.31830e-1,
  1.39437e-1, -4.79622e2, 2.12650e2, -2.02028e1, 8.06350e-1]
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    path = tmp_path / "project.toml"
    path.write_text(PROJECT)
    return path


def study(*arguments, cwd: Path, code: int = 0) -> str:
    """Run the command; assert its exit code; return what it printed."""
    with contextlib.chdir(cwd):
        done = CliRunner().invoke(main, ["study", *map(str, arguments)])
    assert done.exit_code == code, done.output
    return done.output


def test_finer_cylinders(project: Path) -> None:
    kind, read = KINDS["bend"], read_bend(project)
    own, finer = (levels(kind, read, "elements", f, 0.5) for f in (3.0, 6.0))
    assert list(own) == ["narrow", "wide"]
    # What lies between seam, collar and supports is a whole number of rows: nearly a half.
    assert finer["narrow"].size == pytest.approx(own["narrow"].size / 2, rel=0.05)
    assert set(np.unique(finer["wide"].model.thickness)) == {0.5, 1.5}


def test_finer_increments_keep_what_is_reported(project: Path) -> None:
    case = read_bend(project).cases[0]
    own, finer = (refined_cylinder(case, 0.81, "increments", f) for f in (1.0, 3.0))
    assert finer.deflections == own.deflections and len(finer.increments) == 12
    assert finer.increments[:3] == pytest.approx([10 / 3, 20 / 3, 10.0])
    assert len(finer.inflation) == 3 * len(own.inflation) and finer.pressure == own.pressure
    np.testing.assert_array_equal(finer.reported, [2, 5, 8, 11])
    level = levels(KINDS["bend"], read_bend(project), "increments", 3.0, 0.81)["narrow"]
    assert level.increments == 42 and level.size == pytest.approx(1 / 42)
    with pytest.raises(InputError, match="--coarser 0"):
        refined_cylinder(case, 0.81, "increments", 0.5)


def test_quantities_of_a_history_made_up(project: Path) -> None:
    """A cylinder that swells by a tenth, then a load that is straight up to a limit and falls."""
    model = refined_cylinder(read_bend(project).cases[0], 0.81, "elements", 1.0)
    model = replace(model, deflections=np.arange(4.0, 241, 4.0), increments=())
    d = np.array([0.0, *model.deflections])
    swollen = 0.1 * model.mesh.points * [1, 1, 0]
    moves = np.repeat(swollen[None], len(d), axis=0)
    load = np.where(d < 120, 3.0 * d, 360.0 - 0.5 * (d - 120))
    history = History(load, moves, np.zeros(3), np.zeros(3), cavity_volume=np.full(len(d), 6.0e7))
    found = quantities(model, history)
    assert found["radius sideways at mid-span, inflated, mm"] == pytest.approx(82.5)
    assert found["volume, inflated, l"] == pytest.approx(60.0)
    assert found["initial stiffness, N/mm"] == pytest.approx(3.0)
    assert found["load at 100 mm, N"] == pytest.approx(300.0)
    assert found["load at 240 mm, N"] == pytest.approx(300.0)
    assert found["load at the limit point, N"] == pytest.approx(360.0)
    assert 110 < found["load at the knee point, N"] / 3.0 < 120
    early = replace(history, load=load[:26], displacement=moves[:26])
    gone = set(found) - set(quantities(model, early))
    assert gone == {
        "load at 240 mm, N", "load at the limit point, N", "load at the knee point, N"
    }  # fmt: skip


def test_a_run_that_stops_early_is_compared_up_to_there() -> None:
    x = np.array([1.0, 2.0, 3.0])
    assert rms_between((x, 2 * x), (x[:2], 2 * x[:2])) == pytest.approx(0.0, abs=1e-15)
    found = by_response([0.1, 0.2], [{"a": 1.0}, {"a": 2.0, "b": 1.0}], {"a": 2.0, "b": 4.0})
    assert found["b"].to_base == pytest.approx([np.nan, 0.25], nan_ok=True)


def test_increments_of_a_case_converge(project: Path) -> None:
    done = study("mesh", "project.toml", "--card", "known", "--case", "narrow", "--what",
                 "increments", "--levels", 3, "--out", "out", cwd=project.parent)  # fmt: skip
    result = json.loads((project.parent / "out/result.json").read_text())
    assert list(result["models"]) == ["narrow"] and result["card"] == "known"
    found = result["models"]["narrow"]["quantities"]
    for name in ("radius sideways at mid-span, inflated, mm", "volume, inflated, l"):
        assert found[name]["order"] == pytest.approx(2.0, abs=0.1)
    # Sideways radius, volume, stiffness, load at 40 mm and RMS: each has its line.
    assert (project.parent / "out/convergence.png").stat().st_size > 10_000
    # Nodes that come into contact on the way leave the load no clean order.
    assert abs(found["load at 40 mm, N"]["own_error"]) < 2e-3
    assert len(result["models"]["narrow"]["rms_N"]["to_next_finer"]) == 2
    assert "load at 40 mm" in done


def test_levels_without_a_quantity_are_left_out_of_it(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = MembraneSolver.run

    def tired(self: MembraneSolver, model, law, *args, **kwargs) -> History:
        history = run(self, model, law, *args, **kwargs)
        if len(model.increments) > len(model.deflections):
            return history
        return replace(
            history, load=history.load[:4], displacement=history.displacement[:4],
            remarks=("the run stopped early",),
        )  # fmt: skip

    monkeypatch.setattr(MembraneSolver, "run", tired)
    done = study("mesh", "project.toml", "--card", "known", "--case", "narrow", "--what",
                 "increments", "--levels", 2, "--out", "out", cwd=project.parent)  # fmt: skip
    found = json.loads((project.parent / "out/result.json").read_text())["models"]["narrow"]
    assert "load at 40 mm, N" not in found["levels"][0]["values"]
    assert found["quantities"]["load at 40 mm, N"]["own_error"] is None
    assert len(found["rms_N"]["to_next_finer"]) == 1
    table = pd.read_csv(project.parent / "out/convergence.csv")
    assert (table.quantity == "load at 40 mm, N").sum() == 1
    assert (project.parent / "out/convergence.png").stat().st_size > 10_000
    assert "-" in done


def test_nu12_of_all_cases(project: Path) -> None:
    study("nu12", "project.toml", "--card", "known", "--nu12", 0.4, "--out", "out",
          cwd=project.parent)  # fmt: skip
    models = json.loads((project.parent / "out/result.json").read_text())["models"]
    assert list(models) == ["narrow", "wide"]
    for model in models.values():
        assert list(model["responses"]) == ["load at 40 mm, N"]


@pytest.mark.parametrize(
    "options, words",
    [
        (["--card", "other"], "--card: there is no card (and no file) 'other'"),
        (["--card", "known", "--case", "slim"], "--case: there is no case 'slim'"),
        (["--card", "known", "--coarser", 3], "size: expected at most the radius"),
        (["--card", "known", "--solver", "none"], "run.solver (or --solver)"),
    ],
)
def test_mistakes_end_in_one_line(project: Path, options: list, words: str) -> None:
    done = study("mesh", "project.toml", *options, cwd=project.parent, code=2)
    assert words in done and len(done.splitlines()) == 1
    assert not (project.parent / "out").exists()


def test_other_projects_have_no_cases(tmp_path: Path) -> None:
    example = Path(__file__).resolve().parent.parent / "examples" / "bubble-known-solution"
    (tmp_path / "project.toml").write_text((example / "project.toml").read_text())
    done = study("mesh", "project.toml", "--card", "x", "--case", "a", cwd=tmp_path, code=2)
    assert "--case: only a project of bending has cases" in done


def test_more_quantities_than_colours_are_drawn(tmp_path: Path) -> None:
    names = [*(f"load at {d} mm, N" for d in (40, 100, 240)), *(f"quantity {i}" for i in range(9))]
    panel = ConvergencePanel("case", [2.0, 1.0], {n: [0.1] for n in names}, [10, 40], [0.1, 0.3])
    plot_convergence(tmp_path / "c.png", [panel], "elements")
    assert (tmp_path / "c.png").stat().st_size > 10_000
