"""Tasks by processes or a cluster: a start that is given up, a scheduler for the solver."""

from bubblefit.runs.executor import Executor, executor_of
from bubblefit.runs.starts import StartRecord


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
