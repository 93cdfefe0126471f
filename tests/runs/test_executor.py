"""runs/executor.py: tasks of processes and of a Dask cluster, whose workers die or come late."""

import os
import signal
import sys
import time
from pathlib import Path
from threading import Thread

import bubblefit as bf
import cloudpickle
import pytest
from bubblefit.errors import BubblefitError, InputError, SolverFailure
from bubblefit.runs import executor
from bubblefit.runs.executor import Executor, executor_of
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers import licences
from bubblefit.solvers.base import Announcement, hearing
from bubblefit.solvers.process import check, run_process

from ..builders import counted_program
from ..builders.counted_program import CountedSolver, counted_copies
from ..builders.decks import bar
from ..support import needs
from ..support.commands import in_process, wait_for
from ..support.refusals import complaint, raised


def test_start_that_was_given_up_is_run_again_on_resumption(monkeypatch):
    why = "3 workers died of it"
    lose = lambda self, prepare, numbers, on_lost: iter([on_lost(n, why) for n in numbers])  # noqa: E731
    monkeypatch.setattr(Executor, "run_tasks", lose)
    (record,) = Executor().run_starts(lambda: None, None, 5, [7], "coarse")
    lost = StartRecord(7, (5, 7), None, why, 0, (), (), 0.0, failure=why, mesh="coarse")
    assert record == lost


def test_scheduler_of_fit_reaches_solver(strips_project):
    project = strips_project.with_scheduler("tcp://there:1")
    assert executor_of(project).scheduler == project.options_of("marc")["licence_scheduler"]
    assert "licence_scheduler" not in strips_project.options_of("marc")
    assert "licence_scheduler" not in project.solver_options["marc"]


#: The workers do not have the tests: their functions travel with what they are.
for module in (sys.modules[__name__], counted_program):
    cloudpickle.register_pickle_by_value(module)


NOBODY = "tcp://127.0.0.1:1"


def local_cluster(**options):
    distributed = needs.library("distributed")
    return distributed.LocalCluster(dashboard_address=":0", silence_logs=50, **options)


@pytest.fixture(scope="module")
def scheduler():
    with local_cluster(n_workers=2, processes=True, threads_per_worker=1) as local:
        yield local.scheduler_address


def tasks(scheduler, prepare, count, **more):
    told = Executor(scheduler=scheduler).run_tasks(prepare, range(count), **more)
    return [record for record in told if record is not None]


def always(task):
    return lambda: task


def test_fit_on_a_cluster_equals_fit_here(scheduler, strips_fit, strips_project, tmp_path):
    fitted = bf.fit(strips_project, scheduler=scheduler)
    assert fitted.objective == strips_fit.objective
    assert fitted.law.beta.tolist() == strips_fit.law.beta.tolist()
    table, here = (fit.starts().drop(columns="seconds") for fit in (fitted, strips_fit))
    assert table.to_csv() == here.to_csv()


def test_deck_is_fitted_on_a_cluster_as_here(scheduler, tmp_path, monkeypatch):
    monkeypatch.setenv("BUBBLEFIT_RUNS", str(tmp_path / "runs"))
    deck = bar(tmp_path, monkeypatch, noise=0.002)
    fitted, local = bf.fit(deck, scheduler=scheduler), bf.fit(deck, jobs=1)
    assert fitted.parameters == local.parameters and fitted.parameters["C10"]["band"]


def test_jobs_limit_simultaneous_tasks_of_cluster(scheduler, tmp_path):
    executor = Executor(1, scheduler)
    folder = tmp_path / "runs"
    list(executor.run_tasks(lambda: solving(CountedSolver(folder)), range(4)))
    assert counted_copies(folder).most == 1


def solving(solver):
    return lambda number, tell: solver.run(number, None)


def test_death_of_a_worker_costs_its_run_only(scheduler, tmp_path):
    def task(number, tell):
        tell(("begun", number))
        if number == 3 and not (tmp_path / "died").exists():
            (tmp_path / "died").touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return number

    begun, heard = time.monotonic(), list[Announcement]()
    with hearing(heard.append):
        records = tasks(scheduler, always(task), 8)
    assert time.monotonic() - begun < 10  # it is noticed and reported by then
    assert sorted(r for r in records if isinstance(r, int)) == list(range(8))
    assert sorted(r[1] for r in records if isinstance(r, tuple)) == list(range(8))
    (words,) = [said.words for said in heard if "died" in said.words]
    assert words.startswith("worker tcp://127.0.0.1:") and "task 3 of the starts" in words


def test_task_that_kills_three_workers_is_a_failure(scheduler, tmp_path):
    def task(number, tell):
        if number == 1:
            with (tmp_path / "tries").open("a") as file:
                file.write("x")
            os._exit(9)
        return number

    records = tasks(scheduler, always(task), 4, name="runs", on_lost=lambda n, why: (n, why))
    assert sorted(r for r in records if isinstance(r, int)) == [0, 2, 3]
    ((number, why),) = [r for r in records if isinstance(r, tuple)]
    assert number == 1 and why.startswith("3 workers died of it, the last was tcp://")
    assert (tmp_path / "tries").read_text() == "xxx"


@pytest.mark.parametrize("where", ["here", "on a cluster"])
def test_errors_arrive_whole_from_workers(request, where):
    def task(number, tell):
        if number:
            raise InputError("mesh.vtu", "quads", "made to fail")
        raise SolverFailure("no licence", "marc", 3004, "last line", Path("/tmp/scratch"))

    scheduler = None if where == "here" else request.getfixturevalue("scheduler")
    for number, kind in enumerate((SolverFailure, InputError)):
        caught = raised(kind, "", list, Executor(2, scheduler).run_tasks(lambda: task, [number]))
        if number:
            assert str(caught) == "mesh.vtu: quads: made to fail"
            assert caught.field == "quads"
        else:
            assert caught.exit_number == 3004
            assert caught.scratch == Path("/tmp/scratch")


def test_lost_scheduler_is_an_error_soon():
    with local_cluster(n_workers=1, processes=False) as local:
        running = Executor(scheduler=local.scheduler_address).run_tasks(
            lambda: lambda number, tell: time.sleep(0.1) or number, range(1000), "parts"
        )
        while next(running) is None:
            pass
        local.close()
        begun = time.monotonic()
        end = raised(BubblefitError, "does not answer any more; finished parts", list, running)
    assert time.monotonic() - begun < 10 and end.exit_code == 4


def test_programs_and_tasks_end_when_results_are_not_read(scheduler, tmp_path):
    def task(number, tell):
        if number:
            script = f"echo $$ > {tmp_path}/pid; exec sleep 60"
            run_process(["sh", "-c", script], tmp_path, tmp_path / "log")
        for _ in range(600):
            (tmp_path / "alive").touch()
            time.sleep(0.05)
            tell("a word")

    running = Executor(scheduler=scheduler).run_tasks(always(task), range(2))
    pid, alive = tmp_path / "pid", tmp_path / "alive"
    wait_for(lambda: next(running) is None and pid.exists() and alive.exists())
    wait_for(lambda: pid.read_text().strip())
    running.close()
    wait_for(lambda: not Path(f"/proc/{pid.read_text().strip()}").exists())
    wait_for(lambda: time.time() - alive.stat().st_mtime > 1.0)


def test_worker_of_another_version_is_not_used(scheduler, monkeypatch):
    class Elsewhere:
        def __reduce__(self):
            return __import__, ("no_such_module",)

    ours = executor.version()
    for words, other in (
        ("another code", (*ours[:2], "other")), ("it has no bubblefit of this", Elsewhere()),
    ):  # fmt: skip
        monkeypatch.setattr(executor, "version", lambda other=other: other)
        heard = []
        with hearing(heard.append):
            said = complaint(tasks, scheduler, lambda: None, 3)
        assert said.startswith("--scheduler: worker tcp://127.0.0.1:") and words in said
        assert sum("is not used" in one.words for one in heard) == 2


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (("3.12.1", "1.0", "a"), ""),
        (("3.11.9", "1.0", "a"), "Python 3.11.9, here it is 3.12.1"),
        (("3.12.1", "0.9", "b"), "bubblefit 0.9, here it is 1.0, another code of bubblefit"),
        (ImportError("none\nat all"), "no bubblefit of this version (ImportError: none"),
    ],
)
def test_versions_of_a_worker_are_told_beside_those_here(answer, words):
    assert executor.differences(answer, ("3.12.1", "1.0", "a")) == words


def test_late_workers_are_waited_for_and_used():
    heard = []
    with local_cluster(n_workers=0, processes=False) as local, hearing(heard.append):
        running = Executor(scheduler=local.scheduler_address).run_tasks(
            lambda: lambda number, tell: 10 * number, [1, 2, 3]
        )
        assert next(running) is None
        assert heard[-1].words == "waiting for a worker of the cluster"
        local.scale(1)
        assert sorted(filter(None, running)) == [10, 20, 30]
        assert heard[-1] == Announcement("", heard[0].of)


def test_command_ends_at_once_without_a_scheduler(strips_project, tmp_path, monkeypatch):
    monkeypatch.setattr("bubblefit.solvers.process.CONNECT_S", 0.5)
    begun = time.monotonic()
    arguments = ("fit", strips_project.path, "--out", tmp_path / "out")
    done = in_process(*arguments, "--scheduler", NOBODY, cwd=tmp_path, code=2)
    assert f"--scheduler: no Dask scheduler answers at {NOBODY}" in done.stderr
    assert len(done.stderr.splitlines()) == 1 and not (tmp_path / "out").exists()
    assert time.monotonic() - begun < 15
    monkeypatch.setenv("BUBBLEFIT_SCHEDULER", "nonsense://x")
    done = in_process(*arguments, cwd=tmp_path, code=2)
    assert "no Dask scheduler answers at nonsense://x" in done.stderr
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert "pip install 'bubblefit[cluster]'" in complaint(check, NOBODY)


def test_scheduler_counts_licences(scheduler, tmp_path):
    runs = tmp_path / "runs"

    def prepare():
        given = {
            "licences": 1, "licence_folder": str(tmp_path / f"locks-{os.getpid()}"),
            "licence_scheduler": scheduler,
        }  # fmt: skip
        return solving(licences.licensed(CountedSolver(runs, 0.1), "counted", given))

    tasks(scheduler, prepare, 6)
    found = counted_copies(runs)
    assert found.most == 1 and found.ended == {str(n): 1 for n in range(6)}
    assert len(list(tmp_path.glob("locks-*"))) == 2


def test_processes_and_cluster_share_licences_even_if_a_worker_dies(scheduler, tmp_path):
    runs, given = tmp_path / "runs", {"licences": 2, "licence_folder": str(tmp_path / "locks")}

    def end_with_program():
        log = runs / "log"
        while not (log.exists() and "begin 0 " in log.read_text()):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGKILL)

    def task(number, tell):
        dies = number == 0 and not (tmp_path / "died").exists()
        if dies:
            (tmp_path / "died").touch()
            Thread(target=end_with_program).start()
        solver = CountedSolver(runs, 5.0 if dies else 0.05)
        return licences.licensed(solver, "counted", given).run(number, None)

    here = []
    local = Thread(target=lambda: here.extend(Executor(2).run_tasks(always(task), range(10, 18))))
    local.start()
    there = tasks(scheduler, always(task), 8)
    local.join(60)
    assert sorted(there + [one for one in here if one is not None]) == [*range(8), *range(10, 18)]
    found = counted_copies(runs)
    assert found.most == 2
    assert found.begun == {**found.ended, "0": 2}  # the one that was killed never ended
    assert set(found.ended.values()) == {1} and len(found.ended) == 16


def test_second_number_of_licences_is_refused(scheduler, tmp_path):
    def take(count):
        given = licences.licence_settings(
            "acme", {"licences": count, "licence_folder": str(tmp_path)}
        )
        with licences.held("acme", given, scheduler):
            pass

    take(2)
    assert complaint(take, 3).startswith("solver.acme.licences: the cluster counts another number")


def test_no_licence_is_leased_without_an_answer(tmp_path, monkeypatch):
    monkeypatch.setattr(licences, "CONNECT_S", 1.0)
    given = licences.licence_settings("acme", {"licences": 1, "licence_folder": str(tmp_path)})
    with local_cluster(n_workers=0) as local:
        address = local.scheduler_address
        with licences.held("acme", given, address):
            local.close()
    for place in (address, NOBODY):
        with pytest.raises(BubblefitError, match="leases no licence") as caught:
            licences.held("acme", given, place).__enter__()
        assert caught.value.exit_code == 4 and str(caught.value).startswith(place)
    with licences.held("acme", given):
        pass
