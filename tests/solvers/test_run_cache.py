"""solvers/run_cache.py: runs that are kept, only for an equal run."""

import hashlib
import io
import json
import logging
import os
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bubblefit.cli.options import with_solver
from bubblefit.errors import SolverFailure
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.strip_models import strip_mesh
from bubblefit.notes import Note
from bubblefit.project.project import read_project
from bubblefit.solvers import registry
from bubblefit.solvers.base import SNAP, History, Solver, SolverCheck
from bubblefit.solvers.run_cache import (
    LIMIT,
    TITLE,
    VARIABLE,
    Damaged,
    RunCache,
    from_bytes,
    run_cache,
    to_bytes,
    with_cache,
)

from ..builders.bars import BarModel
from ..builders.projects import CONSTANT_BUBBLE
from ..support.commands import in_process, in_processes, write_program
from ..support.refusals import raised

KEY = hashlib.sha256(b"a run").hexdigest()


def history(number=1.0, frames=3):
    random = np.random.default_rng(int(number))
    return History(
        load=number + random.standard_normal(frames),
        displacement=random.standard_normal((frames, 5, 3)), strain_min=-random.random(3),
        strain_max=random.random(3),
        reactions={"top": random.standard_normal((frames, 3)), "a b/c": np.zeros((frames, 3))},
        cavity_pressure=random.random(frames), iterations=17, unstable=("132 kPa",),
        remarks=(Note(SNAP, "it snapped — once", "at 3 kPa"),), early="no equilibrium",
    )  # fmt: skip


def assert_same_history(one, other):
    for name in ("load", "displacement", "strain_min", "strain_max", "cavity_pressure"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.reactions.keys() == other.reactions.keys()
    for name in one.reactions:
        np.testing.assert_array_equal(one.reactions[name], other.reactions[name])
    words = ("iterations", "unstable", "remarks", "early", "wrinkled", "cavity_volume", "path")
    for name in words:
        assert getattr(one, name) == getattr(other, name)
    assert [(n.kind, n.of) for n in one.remarks] == [(n.kind, n.of) for n in other.remarks]


@pytest.fixture
def empty_cache(tmp_path):
    return RunCache(tmp_path / "runs")


def test_cached_numbers_come_back_to_the_last_digit(empty_cache):
    class Own(History):
        more: str = ""

    plain = history()
    bad = [
        replace(plain, load=np.array([1.0, np.nan])),
        replace(plain, displacement=np.array([{}, None], dtype=object)),
        Own(plain.load, plain.displacement, plain.strain_min, plain.strain_max),
    ]
    for one in bad:
        empty_cache.write(KEY, one, 1.0)
    assert empty_cache.entries() == []
    kept = history()
    assert empty_cache.read(KEY) is None
    empty_cache.write(KEY, kept, 12.5)
    found = empty_cache.read(KEY)
    assert found is not None and found.from_cache and found.seconds == 12.5
    assert not kept.from_cache
    assert_same_history(found, kept)
    assert empty_cache.read(KEY.replace(KEY[0], "f" if KEY[0] != "f" else "0")) is None


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("how", ["cut", "changed"])
def test_damaged_run_is_dropped_with_a_note(empty_cache, caplog, share, how):
    empty_cache.write(KEY, history(), 1.0)
    (entry,) = empty_cache.entries()
    whole = entry.path.read_bytes()
    at = int(share * (len(whole) - 1))
    changed = whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :]
    entry.path.write_bytes(whole[:at] if how == "cut" else changed)
    with caplog.at_level(logging.WARNING):
        assert empty_cache.read(KEY) is None
    (said,) = caplog.messages
    assert said.startswith(f"{entry.path} is dropped from the cache of runs and run again")
    assert not entry.path.exists()
    empty_cache.write(KEY, history(), 1.0)
    assert empty_cache.read(KEY) is not None


def test_file_of_another_run_or_layout_is_refused(tmp_path):
    mark = tmp_path / "unpickled"

    class Trap:
        def __reduce__(self):
            return os.mkdir, (str(mark),)

    content, trap = io.BytesIO(), np.empty(1, dtype=object)
    trap[0] = Trap()
    np.savez_compressed(content, words=np.array(json.dumps({"key": KEY})), load=trap)
    whole, spoiled = (
        to_bytes(history(), KEY, 1.0),
        [
            TITLE + hashlib.sha256(text).digest() + text
            for text in (content.getvalue(), b"no archive")
        ],
    )
    for given, key, words in (
        (whole, "0" * 64, "of another run"),
        (whole.replace(b"run 1", b"run 2", 1), KEY, "another version"),
        *((one, KEY, "") for one in spoiled),
    ):
        raised(Damaged, words, from_bytes, given, key)
    assert not mark.exists()
    # What a plug-in gives back by mistake is left to those who read it.
    with pytest.raises(TypeError, match="HypoelasticLaw is not a History"):
        to_bytes(HypoelasticLaw.linear(800.0, 400.0, 80.0), KEY, 1.0)


def key(number):
    return hashlib.sha256(str(number).encode()).hexdigest()


def fill_cache(cache, count):
    for number in range(count):
        cache.write(key(number), history(number), 1.0)
    for number in range(count):
        (path,) = cache.folder.glob(f"*/{key(number)}.run")
        os.utime(path, (1e9 + number, 1e9 + number))
    return max(entry.size for entry in cache.entries())


def cached_keys(cache, count):
    names = {entry.path.stem for entry in cache.entries()}
    return [number for number in range(count) if key(number) in names]


def test_least_recently_used_run_is_dropped_first(empty_cache):
    size = fill_cache(empty_cache, 5)
    assert empty_cache.read(key(0)) is not None  # used now
    assert len(empty_cache.prune(2 * size)) == 3 and cached_keys(empty_cache, 5) == [0, 4]
    # What was cut off a day ago is swept.
    old, fresh = (
        empty_cache.entries()[0].path.parent / f".{name}.part" for name in ("old", "fresh")
    )
    for path in (old, fresh):
        path.write_bytes(b"cut")
    os.utime(old, (1e9, 1e9))
    assert empty_cache.prune(older=3600.0) and cached_keys(empty_cache, 5) == [0]
    assert not old.exists() and fresh.exists()
    assert empty_cache.prune(0) and empty_cache.entries() == []


def test_cache_never_exceeds_its_limit(empty_cache):
    assert empty_cache.limit == LIMIT
    empty_cache.write(key(99), history(99), 1.0)
    size = empty_cache.entries()[0].size
    empty_cache.set_limit(6 * size)
    assert RunCache(empty_cache.folder).limit == 6 * size
    for number in range(12):
        empty_cache.write(key(number), history(number), 1.0)
        assert sum(entry.size for entry in empty_cache.entries()) <= 6 * size
        time.sleep(0.002)  # the clock of a file system
    left = cached_keys(empty_cache, 12)
    assert 11 in left and 0 not in left and len(left) >= 4


def write_many(folder, seed):
    cache = RunCache(folder)
    for number in np.random.default_rng(seed).permutation(20):
        cache.write(key(int(number)), history(int(number)), 1.0)
        found = cache.read(key(int(number)))
        assert found is not None
        assert_same_history(found, history(int(number)))


def test_processes_may_write_at_once(empty_cache, caplog):
    in_processes(4, partial(write_many, empty_cache.folder))
    assert cached_keys(empty_cache, 20) == list(range(20)) and not list(
        empty_cache.folder.glob("*/.*")
    )


def test_unwritable_folder_is_noted_once(empty_cache, tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("no folder")
    blocked = RunCache(tmp_path / "file" / "runs")
    with caplog.at_level(logging.WARNING):
        for number in range(3):
            blocked.write(key(number), history(), 1.0)
            assert blocked.read(key(number)) is None
    (said,) = [m for m in caplog.messages if "runs cannot be kept there" in m]
    assert said.startswith(f"{tmp_path / 'file' / 'runs'}: ")

    def full(source, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("bubblefit.solvers.run_cache.os.replace", full)
    empty_cache.write(KEY, history(), 1.0)
    assert "No space left" in caplog.text
    assert [path for path in empty_cache.folder.rglob("*") if path.is_file()] == []


def test_folder_and_limit_come_from_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "c"))
    assert run_cache().folder == tmp_path / "c" / "runs"
    assert run_cache(False) is None
    assert run_cache(tmp_path / "own").folder == tmp_path / "own"
    assert run_cache() is run_cache()
    monkeypatch.setenv(VARIABLE, str(tmp_path / "e"))
    assert run_cache(tmp_path / "own").folder == tmp_path / "e"
    assert run_cache(False) is None
    monkeypatch.setenv(VARIABLE, "off")
    assert run_cache() is None and run_cache(tmp_path / "own") is None
    monkeypatch.setenv(VARIABLE, "off")
    done = in_process("cache", cwd=tmp_path, code=2)
    assert "BUBBLEFIT_RUNS: is 'off': no runs are kept, name a folder instead" in done.output


LAW = HypoelasticLaw.linear(800.0, 400.0, 80.0)
MODEL = BarModel(strip_mesh(20.0, 40.0, 2, 4), 0.5, 4)


class CountingSolver:
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


def test_equal_run_is_taken_from_the_cache(empty_cache):
    solver, heard = CountingSolver(), []
    run = solver.run
    solver.run = lambda model, law, **given: heard.append(given) or run(model, law)
    once = with_cache(solver, empty_cache, {"element": 4})
    assert isinstance(once, Solver) and once.name == "counting" and once.external
    assert once.identity == "counting 1" and once.check().version == "1"
    first, second = once.run(MODEL, LAW, Path("here"), 5.0), once.run(MODEL, LAW)
    assert solver.runs == 1 and (first.load, second.load) == (1.0, 1.0)
    assert (first.from_cache, second.from_cache) == (False, True)
    # Where and how long it may run reaches the solver and changes no result.
    assert heard == [{"scratch": Path("here"), "timeout": 5.0}]
    # Another process, another machine: a new solver, the same folder.
    other = CountingSolver()
    third = with_cache(other, RunCache(empty_cache.folder), {"element": 4}).run(MODEL, LAW)
    assert other.runs == 0 and third.load == 1.0


mesh = strip_mesh(20.0, 40.0, 2, 4)
moved = replace(mesh, points=mesh.points + 1e-12)
OTHER_RUNS = {
    "moduli": (MODEL, HypoelasticLaw.linear(np.nextafter(800.0, 900.0), 400.0, 80.0)),
    "nu12": (MODEL, replace(LAW, nu12=0.25)),
    "thickness change": (MODEL, replace(LAW, thickness_change="incompressible")),
    "strain range": (MODEL, replace(LAW, strain_range=np.ones(3))),
    "mesh": (replace(MODEL, mesh=moved), LAW),
    "supports": (replace(MODEL, mesh=replace(mesh, node_sets={})), LAW),
    "thickness": (replace(MODEL, thickness=0.6), LAW),
    "loads": (replace(MODEL, increments=5), LAW),
}


@pytest.mark.parametrize("what", OTHER_RUNS)
def test_other_law_or_model_is_another_run(empty_cache, what):
    solver = CountingSolver()
    once = with_cache(solver, empty_cache, {})
    once.run(MODEL, LAW)
    assert not once.run(*OTHER_RUNS[what]).from_cache and solver.runs == 2


def test_other_solver_is_another_run(empty_cache, tmp_path):
    one = write_program(tmp_path / "a" / "solve", "#!/bin/sh\ntrue\n")
    moved = write_program(tmp_path / "b" / "elsewhere", "#!/bin/sh\ntrue\n")
    changed = write_program(tmp_path / "c" / "solve", "#!/bin/sh\nfalse\n")

    def runs(options=(), module=None, **given):
        solver = CountingSolver(given.pop("programs", (one,)))
        for name, value in given.items():
            setattr(solver, name, value)
        with_cache(solver, empty_cache, dict(options)).run(MODEL, LAW)
        return solver.runs

    assert runs() == 1 and runs() == 0
    assert runs(programs=(moved,)) == 0
    assert runs(programs=(changed,)) == 1
    assert runs(identity="counting 2") == 1
    assert runs(name="other") == 1
    assert runs({"element": 4}) == 1
    one.write_text("#!/bin/sh\nexit 3\n")  # in place
    assert runs() == 1


def test_failed_and_uncountable_runs_are_not_cached(empty_cache):
    solver = CountingSolver()
    once = with_cache(solver, empty_cache, {})
    strange = SimpleNamespace(mesh=mesh)
    once.run(strange, LAW)
    once.run(strange, LAW)
    assert solver.runs == 2 and empty_cache.entries() == []
    solver = CountingSolver(fails=1)
    once = with_cache(solver, empty_cache, {})
    raised(SolverFailure, "no licence", once.run, MODEL, LAW)
    assert empty_cache.entries() == []
    assert once.run(MODEL, LAW).load == 2.0 and once.run(MODEL, LAW).from_cache


def test_settings_that_change_results_change_the_key():
    assert registry.counted(
        "calculix", {"element": "S4", "timeout": 7.0, "scratch": Path("x"), "ccx": "y"}
    ) == {"element": "S4"}
    found = registry.counted(
        "marc", {"element": 75, "licence_wait": 3.0, "timeout": 9.0, "threads": 2}
    )
    assert found == {"element": 75, "threads": 2}
    cache = RunCache(Path("n"))
    assert "run" in vars(registry.solver_named("calculix", cache))
    for solver in (
        registry.solver_named("calculix"),
        registry.solver_named("calculix", cache, keep=True),
        registry.solver_named("marc", cache, keep=True),
    ):
        assert "run" not in vars(solver)


def test_run_cache_can_be_turned_off(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "usual"))
    path = tmp_path / "project.toml"
    path.write_text(CONSTANT_BUBBLE + "[fit]\nstarts = 1\n")
    project = read_project(path)
    assert project.run_cache.folder == tmp_path / "usual" / "runs"
    given = {"solver": "calculix", "cache": True}
    assert with_solver(project, given).run_cache is project.run_cache
    assert with_solver(project, {**given, "cache": False}).run_cache is None
    path.write_text(CONSTANT_BUBBLE + '[fit]\ncache = "kept"\n')
    assert read_project(path).run_cache.folder == tmp_path / "kept"
    path.write_text(CONSTANT_BUBBLE + "[fit]\ncache = false\n")
    assert read_project(path).run_cache is None
