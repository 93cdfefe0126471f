"""experiments/deck/prepared.py: fits to a deck of CalculiX and to a command, what is refused."""

import sys

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
import scipy.optimize
from bubblefit.errors import SolverFailure
from bubblefit.experiments.base import Weighting
from bubblefit.inference.search import fit_from
from bubblefit.project.project import read_project

from ...builders.decks import (
    STRETCHES,
    TRUE,
    bar,
    bar_project,
    cube_project,
    force,
    sheet_project,
    write_curve,
)
from ...builders.projects import fit_setup
from ...support.needs import calculix
from ...support.refusals import complaint_with, raised
from .test_solvers import RoundedBar

VALUES = np.array([TRUE["C10"], TRUE["C01"]])


@pytest.fixture
def cube(tmp_path, monkeypatch):
    """Return a setup whose measured forces are those of the deck with the true constants."""
    calculix()
    monkeypatch.setenv("BUBBLEFIT_RUNS", str(tmp_path / "runs"))
    write_curve(tmp_path / "frame.csv")
    project = read_project(cube_project(tmp_path))
    setup = fit_setup(project)
    problem = setup.problem()
    point = problem.evaluate(VALUES, False)
    x = setup.tests[0].test.matched["force"].reading.at
    rows = [f"{u:.12g},{f:.12g}" for u, f in zip(x, point.histories[0].load, strict=True)]
    (tmp_path / "frame.csv").write_text("travel [mm],force [N]\n" + "\n".join(rows) + "\n")
    return fit_setup(read_project(tmp_path / "project.toml"))


def test_constants_are_found_in_the_forces_of_their_own_deck(cube):
    problem = cube.problem()
    optimum = fit_from(problem, np.array([0.6, 0.3]), cube.options)
    assert optimum.best.unknowns == pytest.approx(VALUES, rel=1e-4)
    assert problem.program_runs[0] <= 25
    runs = problem.program_runs[1]
    again = cube.problem()
    fit_from(again, np.array([0.6, 0.3]), cube.options)
    assert again.program_runs[0] == again.program_runs[1] > runs == 0  # all from the cache


@pytest.mark.parametrize("thickness", [None, 0.7, 1.3])
def test_deck_has_the_thickness_of_a_card(tmp_path, monkeypatch, thickness):
    (test,) = read_project(bar_project(tmp_path, monkeypatch)).tests.values()
    of_fabric = test.place.fabric.thickness
    (model,) = test.models(thickness).values()
    assert model.thickness == pytest.approx(of_fabric if thickness is None else thickness)


@pytest.mark.parametrize(("method", "runs"), [("lm", 12), ("slsqp", 60), ("cobyla", 60)])
def test_methods_find_them_within_their_condition(tmp_path, monkeypatch, method, runs):
    setup = fit_setup(bar(tmp_path, monkeypatch).with_fit(method=method, max_analyses=60))
    solver = RoundedBar()
    comparisons = setup.tests[0].comparisons(lambda name: solver, Weighting())
    problem = setup.problem_of(comparisons)
    optimum = fit_from(problem, np.array([0.6, 0.3]), setup.options)
    assert optimum.value < (1e-6 if method == "lm" else 0.1)
    assert solver.runs <= runs


def test_derivatives_for_bands_owe_nothing_to_earlier_points(tmp_path, monkeypatch):
    setup = fit_setup(bar(tmp_path, monkeypatch))

    def problem():
        solver = RoundedBar()
        return setup.problem_of(setup.tests[0].comparisons(lambda name: solver, Weighting()))

    beside = np.array([0.32, 0.07])
    there = np.array([0.3, 0.08])
    fresh = problem().evaluate(there, True, warm=False).jacobian
    learnt = problem()
    learnt.evaluate(beside, True)
    learnt.evaluate(beside + 0.01, True)
    assert not np.array_equal(learnt.evaluate(there, True).jacobian, fresh)  # Broyden's
    learnt.reset()  # as for the optimum
    assert np.array_equal(learnt.evaluate(there, True, warm=False).jacobian, fresh)


def test_check_says_what_moves_what(tmp_path, monkeypatch):
    setup = fit_setup(bar(tmp_path, monkeypatch))
    first, second = setup.tests[0].seen
    assert "a Jacobian by differences takes up to 2 more, and a fit usually 14" in first
    assert "force: 12 values from 0.2469 to 1.693 N at the start, measured 0.1076" in second
    assert second.endswith("C10 0.714, C01 0.151") and "opposite sign" not in second
    path = tmp_path / "frame.csv"
    table = pd.read_csv(path)
    table.iloc[:, 1] *= -1
    table.to_csv(path, index=False)
    second = fit_setup(read_project(tmp_path / "project.toml")).tests[0].seen[1]
    assert "to -0.1076, of the opposite sign: reverse the model's by scale = -1; moved" in second


@pytest.mark.parametrize(
    ("file", "old", "new", "words"),
    [
        ("job.txt.j2", "{{ C01 | number }}", "0.5", "C01: job.txt.j2 does not have it: {{ C01 }}"),
        ("job.txt.j2", "{{ C01 | number }}", "{{ C01 | nmber }}", "job.txt.j2: line 1: No filter"),
        ("job.txt.j2", "{{ C01", "{{ C2 }} {{ C01", "line 1: 'C2' is undefined; there are: C01"),
    ],
)
def test_template_is_tried_before_a_fit(tmp_path, monkeypatch, file, old, new, words):
    project = bar(tmp_path, monkeypatch)
    text = (tmp_path / file).read_text()
    (tmp_path / file).write_text(text.replace(old, new))
    complaint_with([words], fit_setup, project)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('print("solved")', "import time; time.sleep(9)", "did not end within 0.4 s"),
        ('print("solved")', 'print("no convergence"); exit(3)', "ended with exit code 3"),
        ('"curve.csv", "w"', '"other.csv", "w"', "the run wrote no curve.csv"),
        ("force_N", "load_N", "column 'force_N': this column is missing; the file has: tra"),
        ("range(81)", "range(41)", "the results go from 0 to 4, measured: 0.5 to 6"),
        ("{force:.12g}", "nan", "expected a number, found 'nan'"),
    ],
)
def test_bad_run_is_a_failure_and_never_a_number(tmp_path, monkeypatch, old, new, words):
    seconds = 0.4 if "sleep" in new else 60
    changes = [('result = "curve.csv"', f'result = "curve.csv"\ntimeout = {seconds}')]
    project = bar(tmp_path, monkeypatch, changes)
    script = (tmp_path / "solve.py").read_text()
    assert old in script
    (tmp_path / "solve.py").write_text(script.replace(old, new))
    setup = fit_setup(project)
    failure = raised(SolverFailure, "", lambda: setup.tests[0].seen)
    assert words in failure.line
    problem = setup.problem()
    assert problem.evaluate(VALUES, True) is None and words in problem.failure
    if "exit(3)" in new:
        assert failure.log_tail == "no convergence"


def test_fields_of_dic_are_sampled_between_the_nodes_of_a_set(tmp_path, monkeypatch):
    setup = fit_setup(read_project(sheet_project(tmp_path, monkeypatch)))
    problem = setup.problem()
    objective = problem.comparisons[0].objective
    assert objective.sizes == (40,) * 6 and objective.unit == "mm"
    optimum = fit_from(problem, np.array([0.07, -0.05]), setup.options)
    assert optimum.best.unknowns == pytest.approx([0.02, -0.01], rel=1e-7)


def test_field_beyond_the_set_is_a_failure(tmp_path, monkeypatch):
    path = sheet_project(tmp_path, monkeypatch)
    frame = tmp_path / "field_2.csv"
    frame.write_text(frame.read_text() + "19,1,0,0.1,0.1,0\n")
    setup = fit_setup(read_project(path))
    words = "measured points lie up to 9 mm off the set 'SHEET'"
    raised(SolverFailure, words, lambda: setup.tests[0].seen)


def test_deck_in_python_shares_its_law_with_strips(tmp_path, monkeypatch):
    bar_project(tmp_path, monkeypatch)
    monkeypatch.delenv("BUBBLEFIT_PROGRAMS_FROM")  # who writes Python may name programs
    template = tmp_path / "job.txt.j2"
    template.write_text("{{ C10 }} {{ C01 }} {{ E1(0.02) }}\n")
    script = (tmp_path / "solve.py").read_text()
    for old, new in [("c10, c01", "c10, c01, e1"), ("[:2]", "[:3]"), ("(c10", "e1 / 300 * (c10")]:
        script = script.replace(old, new)
    (tmp_path / "solve.py").write_text(script)
    deck = bf.Deck(
        template,
        {"C10": {"bounds": [0.05, 3.0]}, "C01": {"bounds": [0.0, 1.0], "start": 0.2}},
        [{
            "measured": tmp_path / "frame.csv",
            "x": {"column": "travel", "result": "travel_mm"},
            "y": {"column": "force", "result": "force_N", "unit": "N"},
        }],
        [sys.executable, "solve.py"],
        result="curve.csv",
    )  # fmt: skip
    pull = np.linspace(0.1, 1.0, 8)
    force = 25.0 * 0.8 * 300.0 * np.log1p(pull / 20.0) / (1 + pull / 20.0)
    curves = {"warp": [(pull, force)], "fill": [(pull, 0.7 * force)]}
    strips = bf.Strips(curves, gauge=20.0, width=25.0, match="points", increments=5)
    law = bf.Law("constant", nu12=0.0)
    project = bf.Project.of([deck, strips], law, fabric=bf.Fabric("coated", 0.8))
    problem = fit_setup(project).problem()
    point = problem.evaluate(np.array([1.0, 0.9, 0.3, 0.3, 0.08]), True)
    assert problem.comparisons[0].name == "deck: force"
    of_warp = np.abs(point.jacobian[:, 2])  # by E1
    assert of_warp[:12].max() > 0.1 and of_warp[12:].max() > 0.05
    assert not point.jacobian[12:, 3:].any()


@pytest.mark.filterwarnings("ignore::bubblefit.BubblefitWarning")  # the condition misses the data
@pytest.mark.parametrize(("method", "most_runs"), [("lm", 12), ("slsqp", 30)])
def test_best_constants_lie_on_a_linear_condition_that_forbids_the_truth(
    tmp_path, monkeypatch, method, most_runs
):
    condition = ("C10 + C01 > 0.1", "C10 - 4 * C01 > 0.05")
    once = ("starts = 1", f'starts = 1\nmethod = "{method}"')
    project = bar(tmp_path, monkeypatch, (condition, once))
    fit = bf.fit(project, jobs=1)
    assert fit.result["external_runs"] <= most_runs  # as a condition that is yes or no: 26 and 127
    values = {n: v["value"] for n, v in fit.parameters.items()}
    measured = force(STRETCHES, TRUE["C10"], TRUE["C01"])

    def misfit(c01):
        return np.sum((force(STRETCHES, 0.05 + 4 * c01, c01) - measured) ** 2)

    best = scipy.optimize.minimize_scalar(misfit, bounds=(0.0, 0.2), method="bounded").x
    assert values["C10"] - 4 * values["C01"] == pytest.approx(0.05, abs=1e-4)
    assert values["C01"] == pytest.approx(best, rel=2e-3)
