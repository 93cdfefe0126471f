"""Progress of long calls: a bar in notebooks, lines elsewhere."""

import sys
from types import SimpleNamespace

import pytest
from bubblefit.runs import progress as module
from bubblefit.runs.predictions import RunEvent
from bubblefit.runs.progress import ProgressBar, listener
from bubblefit.runs.simulation import Step
from bubblefit.runs.starts import EvaluationRecord, Stage, StartRecord


class Shell:
    """The part of IPython that a bar needs; what was displayed, in order."""

    def __init__(self, kernel):
        self.seen = []
        shell = SimpleNamespace(kernel=1) if kernel else SimpleNamespace()
        self.get_ipython = lambda: shell
        self.display = self

    def __call__(self, *arguments, **named):
        raise AssertionError

    def show(self, shown, raw, display_id=False):
        assert raw
        self.seen.append((display_id, shown))
        return SimpleNamespace(update=lambda shown, raw: self.seen.append((False, shown)))


@pytest.fixture
def shell(monkeypatch):
    def install(kernel):
        one = Shell(kernel)
        one.display = SimpleNamespace(display=one.show)
        monkeypatch.setitem(sys.modules, "IPython", one)
        monkeypatch.setattr(module, "BAR_INTERVAL_S", 0.0)
        monkeypatch.setattr(module, "LINE_INTERVAL_S", 0.0)
        return one

    return install


START = StartRecord(0, (1, 0), 0.5, "converged", 3, (), (), 0.1)


EVENTS = [
    ((2, 5, "E1 at 0.1"), "2 of 5, E1 at 0.1"), ((3, 5, ""), "3 of 5, E1 at 0.1"),
    (("all tests",), "all tests"), ((Stage("starts", 2),), "0 of 2 starts, all tests"),
    ((EvaluationRecord(0, 1, 0.5, "", (), ()),), "start 0 at 0.5, 1 analysis"),
    ((START,), "1 of 2 starts, all tests, best 0.5, 1 analysis"), ((None,), "1 of 2 starts"),
    ((Step("bar", 2, 3, 0.0, 4),), "0 of 4 increments, analysis 2 of 3, bar"),
    ((RunEvent(None, 4, 4),), "4 of 4 increments"),
]  # fmt: skip


def test_bar_follows_every_study(shell):
    seen, bar = shell(True).seen, listener(None)
    assert isinstance(bar, ProgressBar)
    for event, words in EVENTS:
        bar(*event)
        first, shown = seen[-1]
        assert words in shown["text/plain"]
        assert f"value={bar.done:g} max={max(bar.total, 1)}>" in shown["text/html"]
        assert first == (len(seen) == 1)  # then in place
    bar("<b>")
    assert "<b>" not in seen[-1][1]["text/html"]


def test_progress_goes_to_callback_bar_or_lines_as_requested(shell, capsys):
    def callback(*event):
        pass

    notebook = shell(True)
    assert listener(callback) is callback
    listener(False)(1, 2, "x")
    assert not notebook.seen
    shell(False)
    listener(None)(1, 2, "x")
    assert capsys.readouterr().err == ""
    listener(True)(1, 2, "x")
    assert capsys.readouterr().err.startswith("1 of 2, x")
