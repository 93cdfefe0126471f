"""An external solver runs the same analysis once, and another one every time."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import strip_mesh
from bubblefit.solvers import registry
from bubblefit.solvers.base import (
    BandedSolver,
    BandEnd,
    DifferentiatingSolver,
    History,
    Solver,
    SolverCheck,
)
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.marc.solver import MarcSolver
from bubblefit.solvers.run_cache import Once, RunCache, with_cache

from ..bars import BarModel
from ..programs import program

LAW = HypoelasticLaw.linear(800.0, 400.0, 80.0)
MODEL = BarModel(strip_mesh(20.0, 40.0, 2, 4), 0.5, 4)


class Counting:
    """A solver as a program outside: counts its runs; its result tells which one it was."""

    name, external, progress, identity = "counting", True, None, "counting 1"

    def __init__(self, programs=(), fails=0):
        self.programs, self.fails, self.runs = programs, fails, 0

    def run(self, model, law, scratch=None, timeout=None):
        self.runs += 1
        if self.runs <= self.fails:
            raise SolverFailure("no licence", self.name)
        zero = np.zeros((1, 4, 3))
        return History(np.array([float(self.runs)]), zero, np.zeros(3), np.zeros(3))

    def check(self):
        return SolverCheck(self.name, True, "1", True)


@pytest.fixture
def cache(tmp_path):
    return RunCache(tmp_path / "runs")


def test_a_second_run_of_the_same_is_no_run(cache):
    solver, heard = Counting(), []
    run = solver.run
    solver.run = lambda model, law, **given: heard.append(given) or run(model, law)
    once = with_cache(solver, cache, {"element": 4})
    assert isinstance(once, Solver) and once.name == "counting" and once.external
    assert once.identity == "counting 1" and once.check().version == "1"
    once.progress = print
    assert solver.progress is print and once.progress is print
    first, second = once.run(MODEL, LAW, Path("here"), 5.0), once.run(MODEL, LAW)
    assert solver.runs == 1 and (first.load, second.load) == (1.0, 1.0)
    assert (first.from_cache, second.from_cache) == (False, True)
    # Where and how long it may run reaches the solver and changes no result.
    assert heard == [{"scratch": Path("here"), "timeout": 5.0}]
    # Another process, another machine: a new solver, the same folder.
    other = Counting()
    third = with_cache(other, RunCache(cache.folder), {"element": 4}).run(MODEL, LAW)
    assert other.runs == 0 and third.load == 1.0


mesh = strip_mesh(20.0, 40.0, 2, 4)
moved = replace(mesh, points=mesh.points + 1e-12)
OTHERS = {
    "moduli": (MODEL, HypoelasticLaw.linear(np.nextafter(800.0, 900.0), 400.0, 80.0)),
    "nu12": (MODEL, replace(LAW, nu12=0.25)),
    "thickness change": (MODEL, replace(LAW, thickness_change="incompressible")),
    "strain range": (MODEL, replace(LAW, strain_range=np.ones(3))),
    "mesh": (replace(MODEL, mesh=moved), LAW),
    "supports": (replace(MODEL, mesh=replace(mesh, node_sets={})), LAW),
    "thickness": (replace(MODEL, thickness=0.6), LAW),
    "loads": (replace(MODEL, increments=5), LAW),
}


@pytest.mark.parametrize("what", OTHERS)
def test_another_law_or_model_is_another_run(cache, what):
    solver = Counting()
    once = with_cache(solver, cache, {})
    once.run(MODEL, LAW)
    assert not once.run(*OTHERS[what]).from_cache and solver.runs == 2


def test_another_solver_is_another_run(cache, tmp_path):
    one = program(tmp_path / "a" / "solve", "#!/bin/sh\ntrue\n")
    moved = program(tmp_path / "b" / "elsewhere", "#!/bin/sh\ntrue\n")
    changed = program(tmp_path / "c" / "solve", "#!/bin/sh\nfalse\n")

    def runs(options=(), module=None, **given):
        solver = Counting(given.pop("programs", (one,)))
        for name, value in given.items():
            setattr(solver, name, value)
        with_cache(solver, cache, dict(options)).run(MODEL, LAW)
        return solver.runs

    assert runs() == 1 and runs() == 0
    assert runs(programs=(moved,)) == 0
    assert runs(programs=(changed,)) == 1
    assert runs(identity="counting 2") == 1
    assert runs(name="other") == 1
    assert runs({"element": 4}) == 1
    one.write_text("#!/bin/sh\nexit 3\n")  # in place
    assert runs() == 1


def test_the_code_of_a_plug_in_counts(packages):
    from importlib import import_module, reload

    from bubblefit.solvers.decks import code_mark

    ours = code_mark(CalculixSolver.__module__)
    assert ours == code_mark(MarcSolver.__module__)
    code_mark.cache_clear()
    assert code_mark(CalculixSolver.__module__) == ours
    path = packages / "acme_cached.py"
    path.write_text("A = 1\n")
    reload(import_module("acme_cached"))
    first = code_mark("acme_cached")
    path.write_text("A = 2\n")
    code_mark.cache_clear()
    assert first != code_mark("acme_cached") and first != ours


def test_runs_that_are_not_kept(cache):
    solver = Counting()
    once = with_cache(solver, cache, {})
    strange = SimpleNamespace(mesh=mesh)
    once.run(strange, LAW)
    once.run(strange, LAW)
    assert solver.runs == 2 and cache.entries() == []
    solver = Counting(fails=1)
    once = with_cache(solver, cache, {})
    with pytest.raises(SolverFailure, match="no licence"):
        once.run(MODEL, LAW)
    assert cache.entries() == []
    assert once.run(MODEL, LAW).load == 2.0 and once.run(MODEL, LAW).from_cache


def test_which_solvers_have_none_and_a_band_stays_one(cache):

    class Sloped(Counting):
        def run_with_sensitivity(self, model, law, parameters=None, guess=None):
            raise AssertionError

    class Here(Counting):
        external = False

    kept = Counting()
    kept.keep = True
    for solver in (Sloped(), Here(), kept):
        assert with_cache(solver, cache, {}) is solver
    assert isinstance(Sloped(), DifferentiatingSolver)
    membrane = registry.solver_named("membrane", cache)
    assert isinstance(membrane, DifferentiatingSolver)

    class Banded(Counting):
        def band(self, model):
            return (BandEnd("stiff", "", {}),)

    assert not isinstance(with_cache(Counting(), cache, {}), BandedSolver)
    banded = with_cache(Banded(), cache, {})
    assert isinstance(banded, BandedSolver) and banded.band(MODEL)[0].name == "stiff"


def options_of(name, **given):
    solver = registry.solver_named(name, RunCache(Path("nowhere")), **given)
    assert isinstance(solver, Once)
    return dict(solver.options)


def test_what_of_our_solvers_settings_counts():
    assert options_of("calculix", element="S4", timeout=7.0, scratch=Path("x"), ccx="y") == {
        "element": "S4"
    }
    found = options_of("marc", element=75, licence_wait=3.0, timeout=9.0, threads=2)
    assert found == {"element": 75, "threads": 2}
    assert registry.solver_named("calculix").__class__ is CalculixSolver
    assert registry.solver_named("calculix", RunCache(Path("n")), keep=True).keep
    assert registry.solver_named("marc", RunCache(Path("n")), keep=True).keep
