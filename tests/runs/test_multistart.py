"""Starts coarse to fine: groups of one optimum, interruption, agreement of starts."""

from dataclasses import replace
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.base import Weighting
from bubblefit.runs import multistart
from bubblefit.runs.multistart import (
    MultiStart,
    agreement,
    continuation_task,
    distinct_optima,
    moduli_difference,
    records_of_group,
)
from bubblefit.runs.setup import coarse_problem, prepare_fit
from bubblefit.runs.starts import StartRecord

from ..builders.projects import CONSTANT_BUBBLE, project_file
from ..support.paths import KNOWN


def record(number, objective, beta):
    return StartRecord(
        number, (1, number), objective, "converged", 9, beta, beta, 1.0, reached=(0.1, 0.1, 0.1)
    )


def test_agreement_counts_starts_of_best_optimum(known):
    problem, project = known.problem(), known.project
    one, other = (tuple(size * np.ones(problem.unknowns.count)) for size in (1.0, 1.2))
    records = [record(0, 0.1, one), record(1, 0.2, other), record(2, 0.2, other)]
    assert "only one of 3" in agreement(problem, records, project)
    assert "2 of 3" in agreement(problem, [*records[1:], record(0, 0.3, one)], project)
    # Moduli that nothing determines may differ.
    assert "all 2" in agreement(problem, [record(0, 0.1, one), record(1, 0.1, other)], project)
    assert agreement(problem, records[:1], project) == ""
    shared = [*records, replace(records[1], number=3, same_as=1)]
    shared[0] = record(0, 0.3, one)
    said = "3 of 4 starts end in the best of 2 distinct optima; 1 of all 4 are compared"
    assert agreement(problem, shared, project).startswith(said)


STARTS = 3


def project(folder, *changes):
    """A quarter bubble of 48 quads, 12 on the coarse mesh, its data of its own model."""
    finer = ("elements = 32", "elements = 192")
    path = project_file(
        folder, f"{CONSTANT_BUBBLE}\n[fit]\ncoarse_to_fine = true\n", finer, *changes
    )
    return bf.read_project(path).with_fit(starts=STARTS, jobs=1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("stages")


@pytest.fixture(scope="module")
def fitted(folder):
    fit = bf.fit(project(folder), out=folder / "out")
    fit.report(folder / "out")
    return fit


def test_one_start_per_optimum_continues_on_full_mesh(fitted):
    first, *others = fitted.best.records
    assert [r.number for r in (first, *others)] == list(range(STARTS))
    assert first.same_as is None and [r.same_as for r in others] == [0] * (STARTS - 1)
    for record in fitted.best.records:
        assert record.objective == fitted.objective < 1e-6 < 1e-2 < record.coarse_objective
        assert record.coarse_analyses > 3
    # From so near an optimum few analyses are left.
    assert 1 < first.analyses - first.coarse_analyses < 8
    assert all(r.analyses == r.coarse_analyses for r in others)
    assert [r.status for r in others] == ["as start 0"] * (STARTS - 1)
    assert len(fitted.laws) == 1
    assert fitted.agreement == (
        "all 3 starts end in the same optimum; 2 of all 3 are compared on the coarse mesh only"
    )
    assert "quads; " in fitted.stages and "; 1 of them, one of each distinct" in fitted.stages
    assert max(fitted.result["moduli_error"].values()) < 1e-3


def when_it_is(mesh, analyses):
    seen = []

    def tell(event):
        if getattr(event, "analysis", None) is not None and event.mesh == mesh:
            seen.append(event)
            if len(seen) == analyses:
                raise KeyboardInterrupt

    return tell


@pytest.mark.parametrize("mesh, analyses", [("coarse", 18), ("full", 2)])
def test_fit_interrupted_in_either_stage_resumes_to_same_end(
    fitted, folder, tmp_path, mesh, analyses
):
    with pytest.raises(KeyboardInterrupt):
        bf.fit(fitted.project, out=tmp_path / "out", progress=when_it_is(mesh, analyses))
    assert not (tmp_path / "out" / "result.json").exists()
    told = []
    again = bf.fit(fitted.project, out=tmp_path / "out", resume=True, progress=told.append)
    ended = [e.analyses for e in told if isinstance(e, StartRecord) and e.mesh == "coarse"]
    ran = [e for e in told if getattr(e, "mesh", "") == "coarse" and hasattr(e, "analysis")]
    assert sorted(ended) == sorted(r.coarse_analyses for r in fitted.best.records)
    assert len(ran) < sum(ended)  # what had ended was not run again
    assert (tmp_path / "out" / "history.csv").read_text() == (
        folder / "out" / "history.csv"
    ).read_text()
    for key in ("starts", "coarse_to_fine", "beta", "objective"):
        assert again.result[key] == fitted.result[key]


def test_coarse_to_fine_ends_in_optimum_of_full_mesh(fitted, tmp_path):
    full = bf.fit(fitted.project.with_fit(coarse_to_fine=False, starts=1))
    assert full.objective < 1e-6
    assert moduli_difference(fitted.problem, full.best.ranked[0], fitted.best.ranked[0]) < 1e-3
    assert full.stages == "" and full.coarse_to_fine is None
    assert full.result["coarse_to_fine"] is None and "same_as" not in full.result["starts"][0]
    # Without a coarser mesh every start runs on the full one.
    fit = bf.fit(project(tmp_path, ("elements = 192", "elements = 48")).with_fit(starts=1))
    assert fit.coarse_to_fine is None and [r.mesh for r in fit.best.records] == ["full"]
    assert fit.stages == "no test has a coarser mesh: every start ran on the full one"


def test_coarse_problem_has_same_data_on_larger_quads(fitted):
    setup = fitted.setup
    coarse, full = coarse_problem(setup), setup.problem()
    (few,), (many,) = coarse.comparisons, full.comparisons
    assert (len(few.model.mesh.quads), len(many.model.mesh.quads)) == (12, 48)
    assert few.model.increments == many.model.increments
    with pytest.raises(InputError, match="12 quads are too few for a disk"):
        setup.tests[0].finer(lambda name=None: None, Weighting(), 0.25)
    point = coarse.evaluate(full.unknowns.at(fitted.law.beta[list(full.unknowns.free)]), True)
    assert point is not None and point.jacobian.shape == (len(full.scale), 3)
    assert 1e-3 < np.abs(point.residual * full.scale).max() < 2.0  # mm, of an apex of 20 mm
    # One quad is as coarse as it can be.
    biaxial = bf.read_project(KNOWN.parents[1] / "biaxial-computed" / "project.toml")
    assert coarse_problem(prepare_fit(biaxial, biaxial.chosen(None, fitted=True))) is None


def ended(fit, number, value, moduli=(80.0, 400.0, 800.0)):
    unknowns = tuple(fit.problem.unknowns.at(np.array(moduli)).tolist())
    return StartRecord(
        number, (1, number), value, "", 5, () if value is None else unknowns, (), 0.1,
        reached=(0.05, 0.05, 0.05), mesh="coarse",
    )  # fmt: skip


def numbers(groups):
    return [[record.number for record in group] for group in groups]


def test_optima_differ_by_moduli_and_by_objective(fitted):
    records = [
        ended(fitted, 4, 0.2005, (81.5, 400.0, 800.0)),  # G12 1.9 % off: the same
        ended(fitted, 1, 0.2, (80.0, 400.0, 800.0)),
        ended(fitted, 2, 0.2, (80.0, 409.0, 800.0)),  # E2 2.25 % off
        ended(fitted, 3, 0.203, (80.0, 400.0, 800.0)),  # leaves 1.5 % more
        ended(fitted, 5, None),
        ended(fitted, 6, None),
    ]
    assert numbers(distinct_optima(fitted.problem, records, 1e-7)) == [[1, 4], [2], [3], [5], [6]]
    # Below the tolerance nothing that is left tells them apart.
    fine = [ended(fitted, 0, 1e-9), ended(fitted, 1, 9e-8)]
    assert numbers(distinct_optima(fitted.problem, fine, 1e-7)) == [[0, 1]]
    assert numbers(distinct_optima(fitted.problem, fine, 1e-8)) == [[0], [1]]
    # Moduli are compared up to what either optimum reached.
    a, b = ended(fitted, 0, 0.1), ended(fitted, 1, 0.1, (80.0, 400.0, 816.0))
    assert moduli_difference(fitted.problem, b, a) == pytest.approx(0.02)


def test_optima_without_a_law_differ_by_shares_of_their_bounds():
    bounds = np.array([1.0, -10.0]), np.array([3.0, 10.0])
    unknowns = SimpleNamespace(size=0, nuisance=SimpleNamespace(bounds=bounds))
    a, b = (SimpleNamespace(unknowns=values) for values in ((1.5, 4.0), (1.6, 1.0)))
    assert moduli_difference(SimpleNamespace(unknowns=unknowns), a, b) == pytest.approx(3 / 20)


def test_next_start_of_group_continues_where_first_fails(fitted, monkeypatch):
    begun = []

    def run_start(problem, options, seed, number, tell, coarse):
        begun.append((number, coarse.number))
        return replace(coarse, mesh="full", objective=None if number < fails else 0.0)

    monkeypatch.setattr(multistart, "run_start", run_start)
    group = [ended(fitted, n, 0.2) for n in (3, 5, 8)]
    for fails, tried in ((0, [3]), (4, [3, 5]), (99, [3, 5, 8])):
        begun.clear()
        told = []
        last = continuation_task(fitted.setup, [group])(0, told.append)
        assert begun == [(n, n) for n in tried]
        full = {r.number: r for r in (*told, last)}
        assert sorted(full) == tried
        own = records_of_group(group, full)
        assert [r.number for r in own] == [3, 5, 8]
        if fails == 99:
            assert [r.objective for r in own] == [None] * 3
        else:
            assert [r.same_as for r in own] == [None] * len(tried) + [tried[-1]] * (3 - len(tried))
            assert own[-1].objective == 0.0 and own[-1].coarse_objective == 0.2


@pytest.mark.parametrize(
    "wanted, starts, begun, meshes",
    [
        (None, 9, None, ["full"]),
        (None, 10, None, ["coarse", "optima"]),
        (False, 10, None, ["full"]),
        (True, 2, None, ["coarse", "optima"]),
        # A folder goes on as it began.
        (None, 10, "full", ["full"]),
        (None, 3, "coarse", ["coarse", "optima"]),
    ],
)
def test_many_starts_run_coarse_to_fine_by_default(
    fitted, monkeypatch, wanted, starts, begun, meshes
):
    ran = []

    class Runs:
        def run_starts(self, build, options, seed, missing, mesh):
            ran.append(mesh)
            return [replace(ended(fitted, n, 0.2), mesh=mesh) for n in missing]

        def run_tasks(self, prepare, numbers, what, lost):
            ran.append(what)
            return [replace(ended(fitted, n, 0.1), mesh="full") for n in numbers]

    monkeypatch.setattr(multistart, "executor_of", lambda project: Runs())
    settings = fitted.project.fit.model_copy(update={"coarse_to_fine": wanted, "starts": starts})
    setup = replace(fitted.setup, project=replace(fitted.project, fit=settings))
    done = [replace(ended(fitted, 0, 0.2), mesh=begun)] if begun else []
    records = MultiStart(setup, done, lambda _: None, lambda _: None).run()
    assert ran == meshes
    assert [r.number for r in records] == list(range(starts))
    full = meshes == ["full"]
    assert [r.same_as for r in records] == [None, *[None if full else 0] * (starts - 1)]
    assert {r.objective for r in records} == {0.2 if full else 0.1}
