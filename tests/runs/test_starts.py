"""One start, with a problem made up: what is counted, told, and said of its end."""

import time
from dataclasses import replace
from io import StringIO
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments.base import Weighting
from bubblefit.inference.assessment import Certainty
from bubblefit.inference.mesh_limit import limit_of, residual_of
from bubblefit.inference.optimum import ANALYSES_USED_UP
from bubblefit.inference.reported import ReportedModulus
from bubblefit.materials.card import read_card
from bubblefit.materials.exports.base import band_table
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.positivity import is_positive
from bubblefit.notes import gravest_notes
from bubblefit.project.schema import FitSection
from bubblefit.runs import certainty as mesh_error
from bubblefit.runs import multistart
from bubblefit.runs import starts as room
from bubblefit.runs.answers import answers
from bubblefit.runs.certainty import (
    LARGEST_CORRECTION,
    MESH,
    TAKEN_OUT,
    TOO_LARGE,
    UNKNOWN,
    notes_of_mesh,
    with_certainty,
)
from bubblefit.runs.multistart import (
    MultiStart,
    continuation_task,
    distinct_optima,
    moduli_difference,
    records_of_group,
)
from bubblefit.runs.setup import coarse_problem, prepare_fit
from bubblefit.runs.starts import EvaluationRecord, StartRecord, run_start

from ..builders.projects import CONSTANT_BUBBLE, project_file
from ..support.paths import KNOWN


class Problem:
    """Two coefficients and an offset; the solver that counts is another program."""

    def __init__(self, name, external, surrogate=None):
        self.solver = SimpleNamespace(name=name, external=external)
        self.surrogate, self.watch, self.failure = surrogate, None, ""
        self.unknowns = SimpleNamespace(size=2, to_coefficients=np.diag([10.0, 100.0]))
        self.resets, self.cached = 0, 0

    def reset(self):
        self.resets += 1


Y = np.array([0.5, 0.25, -3.0])
OPTIMUM = SimpleNamespace(
    value=0.75, status="converged", failure="", coefficients=np.array([5.0, 25.0]),
    best=SimpleNamespace(unknowns=Y, histories=("a short one", "a long one")),
)  # fmt: skip


def started(monkeypatch, problem, optimum):
    def fit_from(problem, begun, options):
        assert (begun, options) == ("at start 4 of 7", "options")
        for value in (0.9, 0.8):
            problem.surrogate.watch(Y, value, "ok", "membrane")
        for value, status in ((None, "no licence"), (0.75, "ok"), (0.75, "ok")):
            problem.watch(Y, value, status, "calculix")
        return optimum

    strains = {"a short one": [0.1, 0.3, 0.0], "a long one": [0.2, 0.1, 0.0]}
    monkeypatch.setattr(room, "strains_of", strains.__getitem__)
    monkeypatch.setattr(room, "feasible_start", lambda p, s, n: f"at start {n} of {s}")
    monkeypatch.setattr(room, "fit_from", fit_from)
    told = []
    options = "options"
    return run_start(problem, options, 7, 4, told.append), told


@pytest.fixture
def problem():
    return Problem("calculix", True, Problem("membrane", False))


def test_what_is_told_and_counted(monkeypatch, problem):
    begun = time.perf_counter()
    record, told = started(monkeypatch, problem, OPTIMUM)
    assert 0 <= record.wall_s <= time.perf_counter() - begun
    assert told == [
        EvaluationRecord(4, number, value, status, (5.0, 25.0), (-3.0,), solver)
        for number, (value, status, solver) in enumerate(
            [(0.9, "ok", "membrane"), (0.8, "ok", "membrane"), (None, "no licence", "calculix"),
             (0.75, "ok", "calculix"), (0.75, "ok", "calculix")], 1,
        )
    ]  # fmt: skip
    assert record == StartRecord(
        4, (7, 4), 0.75, "converged", 5, (0.5, 0.25, -3.0), (5.0, 25.0), record.wall_s, 3, "",
        (0.2, 0.3, 0.0),
    )  # fmt: skip
    assert problem.resets == 1
    assert problem.watch is None and problem.surrogate.watch is None


def test_runs_from_the_cache_and_of_our_own_are_counted_apart(monkeypatch, problem):
    problem.cached = 2
    record, _ = started(monkeypatch, problem, OPTIMUM)
    assert (record.external_runs, record.cached_runs, record.analyses) == (1, 2, 5)
    assert StartRecord.read(record.text) == record
    own = Problem("calculix", False, Problem("membrane", False))
    assert started(monkeypatch, own, OPTIMUM)[0].external_runs == 0


@pytest.mark.parametrize(
    ("own", "leads", "why"),
    [
        ("no licence", "tired", "no licence"),
        ("", "tired", "tired"),
        ("", "", "the first analysis failed"),
    ],
)
def test_no_optimum(monkeypatch, problem, own, leads, why):
    problem.failure, problem.surrogate.failure = own, leads
    record, told = started(monkeypatch, problem, None)
    assert record == StartRecord(
        4, (7, 4), None, f"calculix failed: {why}", 5, (), (), record.wall_s, 3, why
    )
    assert len(told) == 5
    cut = SimpleNamespace(**{**vars(OPTIMUM), "failure": "killed", "status": "killed"})
    record, _ = started(monkeypatch, problem, cut)
    assert (record.objective, record.status, record.failure) == (0.75, "killed", "killed")


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


def test_one_start_of_an_optimum_goes_on_to_the_full_mesh(fitted):
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
def test_interrupted_in_either_stage_it_ends_the_same(fitted, folder, tmp_path, mesh, analyses):
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


def test_it_is_the_optimum_of_the_full_way(fitted, tmp_path):
    full = bf.fit(fitted.project.with_fit(coarse_to_fine=False, starts=1))
    assert full.objective < 1e-6
    assert moduli_difference(fitted.problem, full.best.ranked[0], fitted.best.ranked[0]) < 1e-3
    assert full.stages == "" and full.coarse_to_fine is None
    assert full.result["coarse_to_fine"] is None and "same_as" not in full.result["starts"][0]
    # Without a coarser mesh every start runs on the full one.
    fit = bf.fit(project(tmp_path, ("elements = 192", "elements = 48")).with_fit(starts=1))
    assert fit.coarse_to_fine is None and [r.mesh for r in fit.best.records] == ["full"]
    assert fit.stages == "no test has a coarser mesh: every start ran on the full one"


def test_the_same_data_on_larger_quads(fitted):
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


def test_optima_are_told_apart_by_moduli_and_by_what_they_leave(fitted):
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


def test_the_next_of_a_group_is_tried_where_the_first_fails(fitted, monkeypatch):
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
def test_many_starts_run_coarse_to_fine_unless_told(
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


#: Quads of the fit's disk; of a mesh so fine beside it that it is the limit.
COARSE, FINE = 192, 7200


def known(elements):
    project = bf.read_project(KNOWN).with_fit(starts=1)
    (test,) = project.tests.values()
    case = replace(test, elements=COARSE, data=replace(test.data, elements=elements))
    project = project.with_fit(mesh_error="told")
    return bf.fit(replace(project, tests={test.name: case}))


@pytest.fixture(scope="module")
def off():
    return known(FINE)


@pytest.fixture(scope="module")
def own():
    return known(COARSE)


def errors(fitted):
    """By modulus: how far the truth is off the fit along its strains, and how far it is said to."""
    sure, (test,) = fitted.best.certainty, fitted.setup.tests
    return [
        (test.known.modulus(name, strain) / fitted.law.modulus(name, strain) - 1.0, sure.mesh[name])
        for name, strain in sure.strain.items()
    ]


def test_the_estimate_is_the_error(off):
    for true, said in errors(off):
        largest = np.abs(true).max()
        assert largest > 0.07
        assert np.abs((1 + said) / (1 + true) - 1).max() < largest / 3


def test_data_of_the_same_model_have_no_mesh_error(own):
    for true, said in errors(own):
        assert np.abs(true).max() < 1e-3
        assert np.abs(said).max() < 1e-3
    best = replace(own.best.differentiated, residual=0 * own.best.differentiated.residual)
    limit = limit_of(own.problem, best, best.residual, 2.0)
    assert not limit.step.any() and not limit.residual.any()


def test_a_mesh_that_moves_a_modulus_more_than_the_noise_is_told():
    strain = dict.fromkeys(COMPONENTS, np.array([0.0, 0.05, 0.1]))
    sigma = {"E1": [0.02, 0.03, 0.03], "E2": [0.001] * 3, "G12": [0.5] * 3}
    mesh = {"E1": [0.01, -0.044, 0.031], "E2": [0.009] * 3, "G12": [-0.4] * 3}
    sigma, mesh = ({n: np.array(v) for n, v in of.items()} for of in (sigma, mesh))

    def with_mesh(changes, taken_out=False):
        """A certainty whose noise has the sigmas above, beside an error of the mesh."""
        sure = Certainty(None, {}, sigma, (), changes, None, None, taken_out)
        moduli = {
            name: ReportedModulus(strain[name], *[np.ones(3)] * 3, np.hypot(own, left), *[no] * 2)
            for (name, own), left in zip(sigma.items(), sure.of_mesh.values(), strict=True)
        }
        return replace(sure, moduli=moduli)

    no = np.zeros(3, dtype=bool)
    told = with_mesh(mesh)
    for name, own in sigma.items():
        assert told.noise_sigma[name] == pytest.approx(own)
    (note,) = notes_of_mesh(told)
    assert note.kind is MESH
    assert "E1" in note and "-4.4 %" in note and "5 % of" in note and "(3 %)" in note
    # Of what is taken out a tenth may be left, of the modulus that is reported.
    assert not notes_of_mesh(with_mesh(mesh, True))
    large = {**mesh, "E1": np.array([0.0, 0.5, 1.0])}
    (note,) = notes_of_mesh(with_mesh(large, True))
    assert (note.kind, note.kind.weight) == (MESH, 16) and "+100 %" in note and "(3 %)" in note


class Unable:
    """A test of a kind that has nothing finer."""


def test_where_it_cannot_be_known(off, monkeypatch):
    plain = replace(off.best, certainty=None)

    def again(**changes):
        return with_certainty(replace(off.setup, **changes), off.problem, plain)

    assert again(tests=(Unable(),)).certainty.mesh is None
    # An error that is not known is not taken out.
    settings = off.project.fit.model_copy(update={"mesh_error": "taken out"})
    best = again(tests=(Unable(),), project=replace(off.project, fit=settings))
    assert best.law is off.best.law and not best.certainty.taken_out
    assert "not taken out" in best.certainty.undetermined[-1]
    monkeypatch.setattr(type(off.problem.solver), "external", True)
    assert again().certainty.mesh is None
    monkeypatch.undo()
    for error in (SolverFailure("no equilibrium", "membrane"), InputError(None, "elements", "no")):
        monkeypatch.setattr(mesh_error, "residual_of", lambda *_, e=error: (_ for _ in ()).throw(e))
        sure = again().certainty
        assert sure.mesh is None and sure.noise_sigma == sure.sigma
        assert sure.undetermined[-1].kind is UNKNOWN
        assert str(sure.undetermined[-1]).startswith("the error of the mesh is not known: ")


def test_what_the_mesh_leaves_is_no_noise(off):
    before = off.misfits["bubble"].rms
    assert before > 0.02
    assert off.best.certainty.noise.level["bubble"] == 0.05  # the least, whatever is left
    problem, best = off.problem, off.best.differentiated
    (test,) = off.setup.tests
    finer = test.finer(off.setup.make_solver, Weighting(), 2.0)
    limit = limit_of(problem, best, residual_of(problem, finer, best, off.law), 2.0)
    assert float(np.sqrt(np.mean((limit.residual * problem.scale) ** 2))) < 0.5 * before
    with pytest.raises(SolverFailure, match="does not give what was matched"):
        residual_of(problem, problem.comparisons * 2, best, off.law)


def corrected(fitted):
    """Return the fit as it is by default: what the mesh moves is taken out."""
    setup = replace(
        fitted.setup, project=fitted.project.with_fit(mesh_error=FitSection().mesh_error)
    )
    plain = replace(fitted.best, certainty=None)
    return replace(fitted, setup=setup, best=with_certainty(setup, fitted.problem, plain))


def with_mesh_error(fitted, monkeypatch, error):
    """Return the fit, corrected by default, as if a finer mesh gave another residual."""
    monkeypatch.setattr(mesh_error, "residual_of", lambda _p, _f, best, _l: best.residual + error)
    return corrected(fitted)


def assert_possible(fitted, folder):
    """Every modulus, sigma and band of a fit, of its card and of its draws is possible."""
    table = fitted.moduli()
    least = table["modulus"].map(fitted.problem.unknowns.bounds.smallest)
    assert (table["MPa"] >= least - 1e-6 * table["MPa"].abs()).all()
    assert (table["lower_MPa"] >= 0.0).all() and (table["upper_MPa"] >= table["MPa"]).all()
    assert (table[["sigma_relative", "noise_relative"]] >= 0.0).all(axis=None)
    assert (table["mesh_relative"] > -1.0).all()
    assert all(answer.sigma >= 0.0 < answer.value for answer in answers(fitted.best, 1.0))
    fitted.card.write(folder / "card.toml")
    card = read_card(folder / "card.toml")
    for law in [*fitted.laws, *fitted.draw_laws(20), *card.certainty.laws(card.law, 5, ROUND)]:
        assert is_positive(replace(law, strain_range=fitted.best.valid))


ROUND = np.random.default_rng(0)


def test_a_correction_beyond_the_linear_step_is_not_taken(off, monkeypatch, tmp_path):
    plain = off.best.differentiated.residual
    (test,) = off.setup.tests
    finer = test.finer(off.setup.make_solver, Weighting(), 2.0)
    error = mesh_error.residual_of(off.problem, finer, off.best.differentiated, off.law) - plain
    fitted = with_mesh_error(off, monkeypatch, 30.0 * error)
    sure = fitted.best.certainty
    # The law is that of the mesh, and its band reaches to that of finer meshes, within the bounds.
    assert fitted.law is off.law and not sure.taken_out and sure.fine is not None
    assert off.problem.unknowns.keeps_bounds(sure.fine.best)
    assert max(np.abs(change).max() for change in sure.mesh.values()) > LARGEST_CORRECTION
    for name, strain in sure.strain.items():
        limit = fitted.law.modulus(name, strain) * (1.0 + sure.mesh[name])
        lower, upper = sure.moduli[name].band
        assert (lower <= fitted.law.modulus(name, strain)).all()
        assert ((lower <= 1.05 * limit) & (0.95 * limit <= upper)).all()
    assert_possible(fitted, tmp_path)

    first = gravest_notes(fitted.notes)[0]
    assert first.kind is TOO_LARGE and "a linear step is not valid" in first
    assert not [note for note in fitted.notes if note.kind in (MESH, TAKEN_OUT)]
    verdict = fitted.verdict
    assert verdict.state == "not to be used"
    assert verdict.reasons[0] == "the error of the mesh is too large to be taken out"
    assert verdict.next_step == "fit on a finer mesh (more elements)"
    unfinished = replace(
        fitted.best,
        ranked=[replace(record, status=ANALYSES_USED_UP) for record in fitted.best.ranked],
    )
    verdict = replace(fitted, best=unfinished).verdict
    assert verdict.reasons[:2] == (
        "the fit has not converged", "the error of the mesh is too large to be taken out"
    )  # fmt: skip
    assert verdict.next_step.startswith("raise fit.max_analyses")


@pytest.mark.parametrize("seed", range(12))
def test_no_error_of_a_mesh_makes_a_modulus_impossible(off, monkeypatch, tmp_path, seed):
    random = np.random.default_rng(seed)
    plain = off.best.differentiated.residual
    size = 10.0 ** random.uniform(-2.0, 3.0) * np.abs(plain).mean()
    error = size * random.standard_normal(len(plain))
    assert_possible(with_mesh_error(off, monkeypatch, error), tmp_path)


def test_the_default_is_nearer_to_the_truth_than_its_mesh(off):
    (test,) = off.setup.tests
    for name, (told, out) in {"E1": (0.07, 0.02), "E2": (0.07, 0.02), "G12": (0.2, 0.07)}.items():
        strain = off.best.certainty.strain[name]
        true = test.known.modulus(name, strain)
        for fitted, least, most in ((off, told, 1.0), (corrected(off), 0.0, out)):
            wrong = np.abs(fitted.law.modulus(name, strain) / true - 1.0).max()
            assert least < wrong < most, name


def test_what_is_taken_out_lies_well_within_its_band(off):
    """Value and band weigh the data alike, whatever the noise beside what is left."""
    fitted = corrected(off)
    sure = fitted.best.certainty
    sigma = np.sqrt(np.diag(sure.fine.covariance))
    assert (np.abs(sure.fine.centre - sure.fine.best) < 0.06 * sigma).all()
    for name, strain in sure.strain.items():
        value = fitted.law.modulus(name, strain)
        low, high = sure.moduli[name].band
        room = np.minimum(value - low, high - value) / (high - low)
        assert room.min() > 0.3, name


@pytest.mark.parametrize("change", [lambda fitted: fitted, corrected], ids=["told", "taken out"])
def test_one_band_in_every_place(off, change, tmp_path):
    """Card and export, moduli.csv and terminal: the same ends, and the value between them."""
    fitted = change(off)
    table, told = fitted.moduli(), answers(fitted.best, fitted.thickness)
    fitted.card.write(tmp_path / "card.toml")
    card = read_card(tmp_path / "card.toml")
    beside = pd.read_csv(StringIO(band_table(card)), comment="#")
    for name in COMPONENTS:
        mine, export = (t[t["modulus"] == name] for t in (table, beside))
        for rows in (mine, export):
            assert (rows["lower_MPa"] <= rows["MPa"]).all()
            assert (rows["MPa"] <= rows["upper_MPa"]).all()
        for end in ("lower_MPa", "upper_MPa"):
            again = np.interp(export["log_strain"], mine["strain"], mine[end])
            assert export[end].to_numpy() == pytest.approx(again, rel=2e-3)
        for one in (one for one in told if one.modulus == name):
            assert one.band[0] <= one.value <= one.band[1]
            ends = [float(end[0]) for end in card.certainty.band(card.law, name, [one.strain])]
            assert ends == pytest.approx(one.band, rel=1e-5)


def test_the_error_is_taken_out(off):
    fitted = off
    again = corrected(fitted)
    best, plain = again.best, replace(fitted.best, certainty=None)
    told, sure = fitted.best.certainty, best.certainty
    assert sure.taken_out and not told.taken_out
    assert best.point is plain.point and best.point.value == fitted.objective
    a, c = fitted.problem.unknowns.inequalities
    assert (a @ sure.fine.best >= c - 1e-9).all()
    for name, strain in sure.strain.items():
        moved = best.law.modulus(name, strain) / fitted.law.modulus(name, strain) - 1.0
        assert moved == pytest.approx(told.mesh[name], abs=1e-12)
        # What may be left is a tenth of it; the band is about the card.
        left = 0.1 * sure.mesh[name] / (1.0 + sure.mesh[name])
        linear = np.hypot(sure.linear_sigma[name], left)
        share = sure.linear_sigma[name] / linear
        assert sure.noise_sigma[name] == pytest.approx(sure.sigma[name] * share)
        for which, law in ((sure, best.law), (told, fitted.law)):
            lower, upper = which.moduli[name].band
            own = law.modulus(name, strain)
            assert (lower <= own).all() and (own <= upper).all()
        wide, narrow = (np.ptp(which.moduli[name].band, axis=0) for which in (told, sure))
        assert (narrow <= wide * (1 + 1e-9)).all()
    (note,) = [n for n in sure.undetermined if n.kind is TAKEN_OUT]
    assert "is taken out of the moduli (E1 " in note
    assert not [n for n in sure.undetermined if n.kind is MESH]
    assert again.card.source.endswith(", error of the mesh taken out")
    assert again.law is best.law and again.laws[0] is best.law
    rows = again.moduli().query("modulus == 'E1'")
    assert rows["upper_MPa"].to_numpy() == pytest.approx(sure.moduli["E1"].upper, rel=1e-9)
