"""Drawing without a browser, in forked processes, too."""

import multiprocessing
import os
import signal
import threading

import pytest
from bubblefit.errors import OutputError
from bubblefit.reports import vega
from bubblefit.reports.charts import Chart, Charts, line
from bubblefit.reports.converter import Converter, background, convert

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


def test_picture_is_drawn_beside_the_page_and_there_when_it_ends(tmp_path, monkeypatch):
    may_draw = threading.Event()

    def draw(kind, spec):
        assert may_draw.wait(60)
        return convert(kind, spec)

    monkeypatch.setattr(vega, "convert", draw)
    path = tmp_path / "c.svg"
    with background.during_page():
        vega.save(path, Charts("c", [CHART], "a line"))
        assert not path.exists() and path in background.files  # the page goes on, and lists it
        with background.during_page():  # that of a fit within that of a study
            pass
        assert not path.exists()
        may_draw.set()
        background.wait()
        assert path.exists()
    vega.save(path.with_suffix(".png"), Charts("c", [CHART], "a line"))
    assert path.with_suffix(".png").exists()  # outside of a page at once


def test_failed_picture_fails_the_page(tmp_path, monkeypatch):
    monkeypatch.setattr(vega, "convert", lambda kind, spec: b"")
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"c\.svg"), background.during_page():
        vega.save(tmp_path / "file" / "c.svg", Charts("c", [CHART], "a line"))


def test_failed_page_ends_without_its_pictures(tmp_path, monkeypatch):
    may_draw = threading.Event()
    monkeypatch.setattr(vega, "convert", lambda kind, spec: may_draw.wait(60) and b"drawn")
    with pytest.raises(ZeroDivisionError), background.during_page():
        for number in range(9):
            vega.save(tmp_path / f"{number}.svg", Charts("c", [CHART], "a line"))
        threading.Timer(0.1, may_draw.set).start()
        _ = 1 / 0
    assert len(list(tmp_path.iterdir())) < 9


def test_threads_draw_at_once_in_processes_of_their_own():
    converter = Converter()
    own = convert("svg", SPEC)
    drawings = []
    threads = [
        threading.Thread(target=lambda: drawings.append(converter("svg", SPEC))) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert drawings == [own] * 4


def test_prepared_process_draws_and_outlives_an_interrupt_of_the_terminal():
    converter = Converter()
    converter.prepare()
    converter.prepare()
    programs = list(converter._idle)
    assert 1 <= len(programs) <= 2
    own = converter("svg", SPEC)
    for program in programs:
        os.kill(program.pid, signal.SIGINT)  # as the terminal does with all processes
    assert converter("svg", SPEC) == own
    assert converter._idle == programs
