"""Tasks on a Dask cluster: the same as here, whoever dies on the way."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import Any

import bubblefit as bf
import cloudpickle
import pytest
from bubblefit.errors import BubblefitError, InputError
from bubblefit.runs import cluster
from bubblefit.runs.executor import Executor, executor_of
from bubblefit.runs.starts import StartRecord
from bubblefit.solvers import licences
from bubblefit.solvers.base import Announcement, announce, hearing
from bubblefit.solvers.process import check, run_process

from .. import counted_program, needs
from ..commands import in_process
from ..complaints import complaint
from ..counted_program import CountedSolver, seen

#: The workers do not have the tests: their functions travel with what they are.
for module in (sys.modules[__name__], counted_program):
    cloudpickle.register_pickle_by_value(module)


NOBODY = "tcp://127.0.0.1:1"


@pytest.fixture(scope="module")
def scheduler():
    """The address of one with two workers."""
    distributed: Any = needs.library("distributed")
    options = {"threads_per_worker": 1, "dashboard_address": ":0", "silence_logs": 50}
    with distributed.LocalCluster(n_workers=2, processes=True, **options) as local:
        yield local.scheduler_address


def tasks(scheduler: str, prepare: Callable[[], Any], count: int, **more: Any) -> list[Any]:
    """What the tasks 0 .. count - 1 tell and give."""
    told = Executor(scheduler=scheduler).run_tasks(prepare, range(count), **more)
    return [record for record in told if record is not None]


def test_a_fit_on_a_cluster_is_the_fit_here(scheduler, together, strips_project, tmp_path):
    fitted = bf.fit(strips_project, scheduler=scheduler, out=tmp_path / "out")
    here = bf.fit(strips_project, jobs=1, out=tmp_path / "here")
    history = [(tmp_path / name / "history.csv").read_bytes() for name in ("out", "here")]
    assert history[0] == history[1]
    assert fitted.objective == here.objective
    assert fitted.law.beta.tolist() == here.law.beta.tolist()


def test_what_a_task_tells_comes_once_and_before_its_end(scheduler):
    def prepare():
        def task(number, tell):
            for k in range(2):
                tell((number, k))
            return number

        return task

    records = tasks(scheduler, prepare, 5)
    assert len(records) == 15
    for number in range(5):
        at = records.index((number, 0))
        assert records[at : at + 3] == [(number, 0), (number, 1), number]


def test_it_is_got_ready_once_a_worker(scheduler):
    def prepare():
        made = [os.getpid(), 0]

        def task(number, tell):
            made[1] += 1
            return list(made)

        return task

    counts: dict[int, list[int]] = {}
    for pid, count in tasks(scheduler, prepare, 8):
        counts.setdefault(pid, []).append(count)
    assert sum(map(len, counts.values())) == 8
    for own in counts.values():
        assert sorted(own) == list(range(1, len(own) + 1))


def test_what_a_worker_announces_is_heard_here(scheduler):
    def prepare():
        return lambda number, tell: announce("waiting", f"run {number}") or time.sleep(0.5) or 1

    heard: list[Announcement] = []
    with hearing(heard.append):
        assert tasks(scheduler, prepare, 1) == [1]
    assert Announcement("waiting", "run 0") in heard


def test_no_more_at_once_than_asked_for(scheduler, tmp_path):
    executor = Executor(1, scheduler)
    folder = tmp_path / "runs"
    list(executor.run_tasks(lambda: solving(CountedSolver(folder)), range(4)))
    assert seen(folder).most == 1


def solving(solver: Any) -> Any:
    return lambda number, tell: solver.run(number, None)


def test_a_worker_that_dies_costs_its_run_only(scheduler, tmp_path):
    def prepare():
        def task(number, tell):
            tell(("begun", number))
            if number == 3 and not (tmp_path / "died").exists():
                (tmp_path / "died").touch()
                os.kill(os.getpid(), signal.SIGKILL)
            return number

        return task

    begun, heard = time.monotonic(), list[Announcement]()
    with hearing(heard.append):
        records = tasks(scheduler, prepare, 8)
    assert time.monotonic() - begun < 10  # it is noticed and reported by then
    assert sorted(r for r in records if isinstance(r, int)) == list(range(8))
    assert sorted(r[1] for r in records if isinstance(r, tuple)) == list(range(8))
    (words,) = [said.words for said in heard if "died" in said.words]
    assert words.startswith("worker tcp://127.0.0.1:")
    assert words.endswith(" died; task 3 of the starts is done again elsewhere")


def test_a_task_that_kills_its_worker_thrice_is_a_failure(scheduler, tmp_path):
    def prepare():
        def task(number, tell):
            if number == 1:
                with (tmp_path / "tries").open("a") as file:
                    file.write("x")
                os._exit(9)
            return number

        return task

    records = tasks(scheduler, prepare, 4, what="runs", lost=lambda n, why: (n, why))
    assert sorted(r for r in records if isinstance(r, int)) == [0, 2, 3]
    ((number, why),) = [r for r in records if isinstance(r, tuple)]
    assert number == 1 and why.startswith("3 workers died of it, the last was tcp://")
    assert (tmp_path / "tries").read_text() == "xxx"


def test_a_start_that_is_given_up_is_run_again_on_going_on(monkeypatch):
    def lose(self, prepare, numbers, what, lost):
        return iter([lost(number, "3 workers died of it") for number in numbers])

    monkeypatch.setattr(Executor, "run_tasks", lambda self, p, n, lost: lose(self, p, n, "", lost))
    options: Any = None
    (record,) = Executor().run_starts(lambda: options, options, 5, [7], "coarse")
    why = "3 workers died of it"
    assert record == StartRecord(
        7, (5, 7), None, why, 0, (), (), 0.0, failure=why, mesh="coarse"
    )  # fmt: skip


def test_an_error_of_a_task_is_an_error_here(scheduler):
    def prepare():
        def task(number, tell):
            raise InputError("mesh.vtu", "quads", "made to fail")

        return task

    with pytest.raises(InputError, match=r"^mesh.vtu: quads: made to fail$") as caught:
        tasks(scheduler, prepare, 2)
    assert caught.value.field == "quads"


def test_a_scheduler_that_goes_is_an_error_soon():
    distributed: Any = needs.library("distributed")
    options = {"n_workers": 1, "processes": False, "dashboard_address": ":0", "silence_logs": 50}
    with distributed.LocalCluster(**options) as local:
        running = Executor(scheduler=local.scheduler_address).run_tasks(
            lambda: lambda number, tell: time.sleep(0.1) or number, range(1000), "parts"
        )
        while next(running) is None:
            pass
        local.close()
        begun = time.monotonic()
        with pytest.raises(BubblefitError, match="does not answer any more; finished parts") as end:
            list(running)
    assert time.monotonic() - begun < 10 and end.value.exit_code == 4


def test_programs_end_when_nobody_wants_their_results(scheduler, tmp_path):
    def prepare():
        def task(number, tell):
            script = f"echo $$ > {tmp_path}/{number}.pid; exec sleep 60"
            run_process(["sh", "-c", script], tmp_path, tmp_path / f"{number}.log")
            return number

        return task

    running = Executor(scheduler=scheduler).run_tasks(prepare, range(2))
    wait_for(lambda: next(running) is None and len(list(tmp_path.glob("*.pid"))) == 2)
    wait_for(lambda: all(path.read_text().strip() for path in tmp_path.glob("*.pid")))
    running.close()
    for path in tmp_path.glob("*.pid"):
        wait_for(lambda path=path: not Path(f"/proc/{path.read_text().strip()}").exists())


def test_a_task_ends_at_its_next_word_when_nobody_wants_it(scheduler, tmp_path):
    def prepare():
        def task(number, tell):
            for _ in range(600):
                (tmp_path / "alive").touch()
                time.sleep(0.05)
                tell("a word")

        return task

    running = Executor(scheduler=scheduler).run_tasks(prepare, [0])
    wait_for(lambda: next(running) is None and (tmp_path / "alive").exists())
    running.close()
    alive = tmp_path / "alive"
    wait_for(lambda: time.time() - alive.stat().st_mtime > 1.0)


def test_a_worker_of_another_version_is_not_used(scheduler, monkeypatch):
    ours = cluster.version()
    others = {
        "bubblefit": (ours[0], "0.1.9", ours[2]),
        "Python": ("3.9.1", *ours[1:]),
        "code": (*ours[:2], "other"),
    }
    words = {"bubblefit": "0.1.9", "Python": "3.9.1", "code": "another code"}
    for what, other in others.items():
        monkeypatch.setattr(cluster, "version", lambda other=other: other)
        heard: list[Announcement] = []
        with hearing(heard.append):
            said = complaint(tasks, scheduler, lambda: None, 3)
        assert said.startswith("--scheduler: worker tcp://127.0.0.1:") and words[what] in said
        assert sum("is not used" in one.words for one in heard) == 2


def test_the_code_counts_by_content(tmp_path, monkeypatch):
    files = {name: tmp_path / name for name in
             ("errors.py", "runs/starts.py", "templates/marc/deck.j2", "tests/test_a.py",
              "docs/make_api.py", "fits/__pycache__/start.pyc")}  # fmt: skip
    for path in (*files.values(), tmp_path / "runs/__init__.py", tmp_path / "tests/__init__.py"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")
    monkeypatch.setattr(cluster, "ROOT", tmp_path)
    counted = {}
    for name, path in files.items():
        before = cluster._code()
        path.write_text("changed")
        counted[name] = cluster._code() != before
    assert counted == {name: k < 3 for k, name in enumerate(files)}
    monkeypatch.undo()
    assert cluster.version()[2] == cluster._code()


def test_a_worker_without_bubblefit_is_not_used(scheduler, monkeypatch):
    class Elsewhere:
        def __reduce__(self):
            return __import__, ("no_such_module",)

    monkeypatch.setattr(cluster, "version", Elsewhere)
    said = complaint(tasks, scheduler, lambda: None, 3)
    assert "it has no bubblefit of this version (" in said


def test_workers_that_come_later_are_waited_for_and_used():
    distributed: Any = needs.library("distributed")
    options = {"processes": False, "dashboard_address": ":0", "silence_logs": 50}
    heard: list[Announcement] = []
    with distributed.LocalCluster(n_workers=0, **options) as local, hearing(heard.append):
        running = Executor(scheduler=local.scheduler_address).run_tasks(
            lambda: lambda number, tell: 10 * number, [1, 2, 3]
        )
        assert next(running) is None
        assert heard[-1].words == "waiting for a worker of the cluster"
        local.scale(1)
        assert sorted(filter(None, running)) == [10, 20, 30]
        assert heard[-1] == Announcement("", heard[0].of)


def test_without_a_scheduler_the_command_ends_at_once(strips_project, tmp_path, monkeypatch):
    begun = time.monotonic()
    arguments = ("fit", strips_project.path, "--out", tmp_path / "out")
    done = in_process(*arguments, "--scheduler", NOBODY, cwd=tmp_path, code=2)
    assert f"--scheduler: no Dask scheduler answers at {NOBODY}" in done.stderr
    assert len(done.stderr.splitlines()) == 1 and not (tmp_path / "out").exists()
    assert time.monotonic() - begun < 15
    monkeypatch.setenv("BUBBLEFIT_SCHEDULER", "nonsense://x")
    done = in_process(*arguments, cwd=tmp_path, code=2)
    assert "no Dask scheduler answers at nonsense://x" in done.stderr


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    said = complaint(check, NOBODY)
    assert said == "--scheduler: Dask is not installed; pip install 'bubblefit[cluster]'"


def test_a_scheduler_counts_licences(scheduler, tmp_path):
    runs = tmp_path / "runs"

    def prepare():
        given = {
            "licences": 1, "licence_folder": str(tmp_path / f"locks-{os.getpid()}"),
            "licence_scheduler": scheduler,
        }  # fmt: skip
        return solving(licences.licensed(CountedSolver(runs, 0.1), "counted", given))

    tasks(scheduler, prepare, 6)
    found = seen(runs)
    assert found.most == 1 and found.ended == {str(n): 1 for n in range(6)}
    assert len(list(tmp_path.glob("locks-*"))) == 2


def test_processes_and_a_cluster_share_licences_also_when_a_worker_dies(scheduler, tmp_path):
    runs, given = tmp_path / "runs", {"licences": 2, "licence_folder": str(tmp_path / "locks")}

    def end_with_program():
        log = runs / "log"
        while not (log.exists() and "begin 0 " in log.read_text()):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGKILL)

    def prepare():
        def task(number, tell):
            dies = number == 0 and not (tmp_path / "died").exists()
            if dies:
                (tmp_path / "died").touch()
                Thread(target=end_with_program).start()
            solver = CountedSolver(runs, 5.0 if dies else 0.05)
            return licences.licensed(solver, "counted", given).run(number, None)

        return task

    here: list[Any] = []
    local = Thread(target=lambda: here.extend(Executor(2).run_tasks(prepare, range(10, 18))))
    local.start()
    there = tasks(scheduler, prepare, 8)
    local.join(60)
    assert sorted(there + [one for one in here if one is not None]) == [*range(8), *range(10, 18)]
    found = seen(runs)
    assert found.most == 2
    assert found.begun == {**found.ended, "0": 2}  # the one that was killed never ended
    assert set(found.ended.values()) == {1} and len(found.ended) == 16


def test_two_numbers_of_licences_are_one_too_many(scheduler, tmp_path):
    def take(count):
        given = licences.licence_settings(
            "acme", {"licences": count, "licence_folder": str(tmp_path)}
        )
        with licences.held("acme", given, scheduler):
            pass

    take(2)
    assert complaint(take, 3).startswith("solver.acme.licences: the cluster counts another number")


def test_no_licence_is_leased_where_nobody_answers(tmp_path, monkeypatch):
    monkeypatch.setattr(licences, "CONNECT_S", 1.0)
    distributed: Any = needs.library("distributed")
    given = licences.licence_settings("acme", {"licences": 1, "licence_folder": str(tmp_path)})
    options = {"n_workers": 0, "dashboard_address": ":0", "silence_logs": 50}
    with distributed.LocalCluster(**options) as local:
        address = local.scheduler_address
        with licences.held("acme", given, address):
            local.close()
    for place in (address, NOBODY):
        with pytest.raises(BubblefitError, match="leases no licence") as caught:
            licences.held("acme", given, place).__enter__()
        assert caught.value.exit_code == 4 and str(caught.value).startswith(place)
    with licences.held("acme", given):
        pass


def test_a_fit_hands_its_scheduler_to_the_solver(strips_project):
    project = strips_project.with_scheduler("tcp://there:1")
    assert executor_of(project).scheduler == project.options_of("marc")["licence_scheduler"]
    assert "licence_scheduler" not in strips_project.options_of("marc")
    assert "licence_scheduler" not in project.solver_options["marc"]


def wait_for(there: Callable[[], object]) -> None:
    end = time.monotonic() + 30
    while not there():
        assert time.monotonic() < end
        time.sleep(0.01)
