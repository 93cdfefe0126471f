"""Drawing without a browser, in forked processes, too."""

import multiprocessing

from bubblefit.reports import vega
from bubblefit.reports.charts import Chart, Charts, line
from bubblefit.reports.converter import convert

CHART = Chart("t", "x, mm", "y, mm", [line("a", [0, 1], [0, 1])], "a line")
SPEC = vega.picture(Charts("c", [CHART], "a line"))


def test_same_specification_gives_the_same_file():
    assert convert("svg", SPEC) == convert("svg", SPEC)
    assert convert("png", SPEC) == convert("png", SPEC)


def test_forked_process_draws():
    """The thread that draws is not copied by a fork: a call in the copy would wait for ever."""
    own = convert("svg", SPEC)
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    child = context.Process(target=lambda: there.send(convert("svg", SPEC)))
    child.start()
    try:
        assert here.poll(60) and here.recv() == own
    finally:
        child.kill()
        child.join()
