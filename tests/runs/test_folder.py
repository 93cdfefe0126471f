"""The folder of a run: stored runs with cards, resumption, interrupted writing."""

import errno
import json
import os
from dataclasses import fields, replace
from pathlib import Path

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.experiments.cylinder.measures import run_of
from bubblefit.materials.card import MaterialCard
from bubblefit.notes import Note
from bubblefit.presenting import PAGES
from bubblefit.processes import _THREAD_VARIABLES, limit_blas
from bubblefit.project.schema import usual_folder
from bubblefit.runs import fit_folder
from bubblefit.runs.folder import RESULT, RUN, RunRecords, Store, write_page
from bubblefit.runs.in_use import alone_in_folder
from bubblefit.solvers.base import SNAP
from bubblefit.storage import writing
from bubblefit.storage.writing import json_text
from threadpoolctl import threadpool_info

from ..builders.bent_cylinders import FAILS, STOPS, ClosedFormCylinder, ran
from ..builders.stored_runs import law, model
from ..support.refusals import complaint, raised


def card(e1=500.0):
    return MaterialCard(law(e1), 0.81)


@pytest.fixture
def folder(tmp_path):
    records = RunRecords(tmp_path)
    records.begin(False, False)
    return records


def test_unknown_numbers_are_null_in_json(tmp_path):
    result = {"a": [np.nan, 1.5], "b": {"c": (np.float64(np.inf), "NaN", None, 2)}, 3: True}
    said = {"a": [None, 1.5], "b": {"c": [None, "NaN", None, 2]}, "3": True}
    Store(tmp_path).finish(result)
    for text in (json_text(result), (tmp_path / RESULT).read_text()):
        assert json.loads(text, parse_constant=pytest.fail) == said


def test_run_with_card_is_stored_exactly(folder, tmp_path):
    said = Note(SNAP, "it snapped", "at 3 kPa")
    record = replace(ran(model(), card()), remarks=(said,), from_cache=True)
    mark = "0123456789abcdef" * 4
    folder.write(mark, record)
    # Runs of an earlier version are found by their names.
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["0123456789abcdef0123.npz"]
    again = folder.read(mark)
    for field in fields(record):
        one, other = getattr(again, field.name), getattr(record, field.name)
        if field.name == "arrays":
            assert list(one) == list(other)
            for name in other:
                np.testing.assert_array_equal(one[name], other[name])
        else:
            np.testing.assert_array_equal(one, other)
    assert [(note.kind, note.of) for note in again.remarks] == [(said.kind, said.of)]
    assert folder.read("b" * 64) is None
    raised(OutputError, "--resume", folder.begin, False, False)
    folder.begin(True, False)
    assert folder.read(mark) is not None
    folder.begin(False, True)
    assert folder.read(mark) is None


@pytest.mark.parametrize("resume", [True, False])
def test_half_written_run_is_removed(folder, tmp_path, resume):
    folder.write("a" * 64, ran(model(), card()))
    (tmp_path / "runs" / ".aaaa.999999999.npz").write_bytes(b"half")
    folder.begin(resume, not resume)
    assert len(list((tmp_path / "runs").iterdir())) == resume
    assert (folder.read("a" * 64) is not None) == resume


def test_damaged_file_is_no_run(folder, tmp_path):
    folder.write("a" * 64, ran(model(), card()))
    (path,) = (tmp_path / "runs").glob("*.npz")
    content = path.read_bytes()
    for damaged in (content[: len(content) // 2], b"not an archive", b""):
        path.write_bytes(damaged)
        assert folder.read("a" * 64) is None
    for words in (np.array([{"seconds": 1}], dtype=object), np.array("{}")):
        np.savez(path, words=words)
        assert folder.read("a" * 64) is None


def test_failed_and_stopped_runs_are_stored(folder):
    class Silent(ClosedFormCylinder):
        def run(self, *arguments, **named):
            return replace(super().run(*arguments, **named), early="")

    failed = ran(model(), card(FAILS))
    assert failed.failure == "made to fail" and not failed.arrays and run_of(failed) is None
    folder.write("a" * 64, failed)  # it gets another chance
    assert folder.read("a" * 64) is None
    stopped = run_of(ran(model(), card(STOPS)))
    assert stopped is not None and stopped.deflection[-1] == 120.0
    silent = ran(model(), card(STOPS), Silent())
    assert silent.failure == "the results end at 120 of 240 mm, and do not say why"
    assert not silent.early and not silent.arrays


class Killed(BaseException):
    """In place of a signal that nobody can catch: nothing of ours handles it."""


ENDS = {
    "kill": Killed,
    "full disk": lambda: OSError(errno.ENOSPC, "No space left on device"),
    "broken disk": lambda: OSError(errno.EIO, "Input/output error"),
}


def counted(patch, last, end):
    """What is written, in order; in place of number `last` comes the end."""
    written = []
    replace, append = writing.os.replace, fit_folder._append

    def note(what):
        written.append(what)
        if len(written) == last:
            raise end()

    def replacing(source, target):
        note(Path(target).name)
        replace(source, target)

    def appending(stream, text):
        if len(written) + 1 == last:  # half of a line may be there
            append(stream, text[: len(text) // 2])
        note("a line")
        append(stream, text)

    patch.setattr(writing.os, "replace", replacing)
    patch.setattr(fit_folder, "_append", appending)
    return written


def test_kill_at_any_write_is_resumed_to_the_same_end(strips_project, tmp_path):
    def fitted(out, **options):
        """All that may be compared: moduli, starts but their seconds, and every analysis."""
        fit = bf.fit(strips_project, ["one"], out=out, jobs=1, **options)
        starts = fit.starts().drop(columns="seconds")
        return fit.moduli().to_csv(), starts.to_csv(), (out / "history.csv").read_text()

    with pytest.MonkeyPatch.context() as patch:
        written = counted(patch, 0, Killed)
        whole = fitted(tmp_path / "whole")
    assert written[:2] == ["run.json", "as-run.toml"] and written[-1] == "history.csv"
    # Every file, and some of the lines.
    lines = [n for n, what in enumerate(written, 1) if what == "a line"]
    chosen = [n for n, what in enumerate(written, 1) if what != "a line"]
    chosen += [lines[len(lines) // 2], lines[-1]]
    for turn, number in enumerate(sorted(chosen)):
        name = list(ENDS)[turn % len(ENDS)]
        out = tmp_path / f"{number} {name}"
        with pytest.MonkeyPatch.context() as patch:
            counted(patch, number, ENDS[name])
            ended = raised(Killed if name == "kill" else OutputError, "", fitted, out)
        if name != "kill":
            assert "cannot be written" in str(ended)
        assert fitted(out, resume=Store(out).used) == whole, (number, name)
        assert not [path for path in out.rglob(".*") if path.is_file()]


def test_missing_parents_of_folder_are_made(tmp_path):
    store = Store(tmp_path / "a" / "b" / "c")
    assert not store.begin({"law": "1"}, False, False) and store.used
    content = {"parts": {"law": "1"}, "facts": {}}
    assert (store.path / RUN).read_text() == json.dumps(content, indent=1) + "\n"
    # A folder that is there and holds nothing of this is as good.
    (tmp_path / "notes.txt").write_text("mine")
    assert not Store(tmp_path).begin({}, False, False)


@pytest.mark.parametrize("name", [RUN, RESULT])
def test_result_or_run_file_marks_a_used_folder(tmp_path, name):
    (tmp_path / name).write_text("{}")
    store = Store(tmp_path)
    assert store.used
    raised(OutputError, "already holds results", store.begin, {}, False, False)
    assert (tmp_path / name).read_text() == "{}"
    assert not store.begin({}, False, True)
    for file, folder in (("project.toml", "fabric"), ("linear.toml", "fabric-linear")):
        assert usual_folder(tmp_path / "fabric" / file) == Path("out") / folder


def test_differences_are_named_without_facts(tmp_path):
    store = Store(tmp_path)
    store.begin({"law": "1", "data": "2", "solver": "3"}, False, False)
    assert store.begin({"law": "1", "data": "2", "solver": "3"}, True, False)
    said = complaint(store.begin, {"law": "9", "data": "9", "solver": "3"}, True, False)
    assert said.startswith(f"{tmp_path / RUN}: parts: ") and "another data and law;" in said
    # Parts that only one of the two knows differ, too.
    for parts in ({"law": "1", "data": "2"}, {"law": "1", "data": "2", "solver": "3", "x": "4"}):
        raised(InputError, r"another (solver|x);", store.begin, parts, True, False)


def test_resumption_keeps_stored_runs(tmp_path):
    store = Store(tmp_path)
    store.begin({}, False, False)
    before = (tmp_path / RUN).read_text()
    store.finish({"a": 1})
    assert (tmp_path / RESULT).read_text() == '{\n "a": 1\n}\n'
    (tmp_path / "starts").write_text("kept")
    assert store.begin({}, True, False, ("starts",))
    assert (tmp_path / "starts").exists() and not (tmp_path / RESULT).exists()
    assert (tmp_path / RUN).read_text() == before
    store.begin({}, False, True, ("starts",))
    assert not (tmp_path / "starts").exists()


def test_unfinished_files_of_a_killed_process_are_removed(tmp_path):
    gone, ours = ".result.999999999.json", f".moduli.{os.getpid()}.csv"
    for name in (gone, ours, ".hidden", ".a.b", "notes.999999999.txt"):
        (tmp_path / name).write_text("half")
    Store(tmp_path).begin({}, False, False)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == sorted([RUN, ours, ".hidden", ".a.b", "notes.999999999.txt"])


def test_long_work_and_pages_have_one_thread_of_blas(tmp_path, monkeypatch):
    """Strains for the maps of a page took a second longer, as threads waited for each other."""
    for name in _THREAD_VARIABLES:
        monkeypatch.delenv(name, raising=False)

    def threads(*_):
        return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

    monkeypatch.setattr(PAGES, "of", lambda result: threads)
    with limit_blas(2):
        assert threads() == {2}
        assert write_page(None, tmp_path) == alone_in_folder(threads)() == {1}
