"""Drawing without a browser, in forked processes, too."""

import multiprocessing

from bubblefit.reports import vega
from bubblefit.reports.charts import Chart, Charts, line


def test_forked_process_draws():
    """The thread that draws is not copied by a fork: a call in the copy would wait for ever."""
    chart = Chart("t", "x, mm", "y, mm", [line("a", [0, 1], [0, 1])], "a line")
    charts = Charts("c", [chart], "a line")
    own = vega.rendered(charts, ".svg")
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    child = context.Process(target=lambda: there.send(vega.rendered(charts, ".svg")))
    child.start()
    try:
        assert here.poll(60) and here.recv() == own
    finally:
        child.kill()
        child.join()
