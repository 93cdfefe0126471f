"""Runs with cards as they are stored: exactly, each under a mark of all that it depends on."""

import csv
import errno
import json
import os
import tempfile
from dataclasses import fields, replace
from pathlib import Path

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.experiments.cylinder.predicted import CylinderPredicted
from bubblefit.experiments.cylinder.run import run_of
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.cylinder_model import curve_reading, inflated_cylinder
from bubblefit.notes import Note
from bubblefit.project.schema import usual_folder
from bubblefit.runs import running_files
from bubblefit.runs.folder import RESULT, RUN, RunRecords, Store
from bubblefit.runs.predictions import mark_of
from bubblefit.runs.running_files import HISTORY, STARTS, RunningFiles
from bubblefit.runs.starts import EvaluationRecord, StartRecord
from bubblefit.solvers.base import SNAP
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.solvers.registry import solver_named
from bubblefit.storage import writing
from bubblefit.storage.plain_values import json_text
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ..builders.bent_cylinders import FAILS, STOPS, ClosedFormCylinder, ran
from ..support.refusals import complaint, raised

WAY = np.linspace(0.0, 240.0, 61)
KIND = CylinderPredicted()


def law(e1=500.0):
    return HypoelasticLaw.linear(e1, 150.0, 20.0)


def model(symmetry="quarter"):
    way = WAY[1:].tolist()
    return inflated_cylinder(150.0, 0.14, 0.81, 40.0, deflections=way, symmetry=symmetry)


def card(e1=500.0):
    return MaterialCard(law(e1), 0.81)


@pytest.fixture
def folder(tmp_path):
    records = RunRecords(tmp_path)
    records.begin(False, False)
    return records


def test_numbers_that_are_not_known_are_null(tmp_path):
    result = {"a": [np.nan, 1.5], "b": {"c": (np.float64(np.inf), "NaN", None, 2)}, 3: True}
    said = {"a": [None, 1.5], "b": {"c": [None, "NaN", None, 2]}, "3": True}
    Store(tmp_path).finish(result)
    for text in (json_text(result), (tmp_path / RESULT).read_text()):
        assert json.loads(text, parse_constant=pytest.fail) == said


def test_a_run_is_stored_exactly(folder, tmp_path):
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
def test_a_file_whose_writing_was_cut_off_goes(folder, tmp_path, resume):
    folder.write("a" * 64, ran(model(), card()))
    (tmp_path / "runs" / ".aaaa.999999999.npz").write_bytes(b"half")
    folder.begin(resume, not resume)
    assert len(list((tmp_path / "runs").iterdir())) == resume
    assert (folder.read("a" * 64) is not None) == resume


def test_a_damaged_file_is_no_run(folder, tmp_path):
    folder.write("a" * 64, ran(model(), card()))
    (path,) = (tmp_path / "runs").glob("*.npz")
    content = path.read_bytes()
    for damaged in (content[: len(content) // 2], b"not an archive", b""):
        path.write_bytes(damaged)
        assert folder.read("a" * 64) is None
    for words in (np.array([{"seconds": 1}], dtype=object), np.array("{}")):
        np.savez(path, words=words)
        assert folder.read("a" * 64) is None


def test_runs_that_fail_or_stop_early(folder):
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


def test_the_mark_is_of_everything_that_matters():
    m = model()

    class Other(ClosedFormCylinder):
        name = "calculix"

        def __init__(self):
            self.identity = "calculix 2.21"

    usual, formula = law(), ClosedFormCylinder()

    def mark(m=m, law=usual, solver=formula):
        return mark_of(KIND, m, law, solver)

    others = {
        mark(law=law(501.0)), mark(law=replace(usual, nu12=0.3)),
        mark(law=replace(usual, thickness_change="incompressible")),
        mark(m=replace(m, thickness=2 * m.thickness)),
        mark(m=replace(m, deflections=m.deflections[:-1], increments=())),
        mark(m=replace(m, inflation=(0.1, 0.14))),
        mark(m=replace(m, collar=replace(m.collar, fillet=3.0))),
        mark(m=replace(m, gas=replace(m.gas, ambient=0.09))), mark(m=model("full")),
        mark(solver=Other()), mark(solver=ClosedFormCylinder(accuracy=2)),
    }  # fmt: skip
    assert mark() not in others and len(others) == 11
    # Where a curve is read changes no result, and the same model is the same made again.
    assert mark() == mark(m=replace(m, reading=curve_reading(150.0, [5.0]))) == mark(m=model())


def test_a_strain_range_that_cuts_nothing_else_is_part_of_it():
    cubic = HypoelasticLaw([0, 0, 1, 20, 0, 0, 1, 150, 0, 0, 1, 500], 0.24, [0.2, 0.2, 0.2])
    ends = [[0.2, 0.2, 0.2], [0.2, 0.2, 0.1], [0.1, 0.2, 0.2]]
    laws = [replace(cubic, strain_range=np.array(e)) for e in ends]
    assert len({mark_of(KIND, model(), law, ClosedFormCylinder()) for law in laws}) == 3


def test_the_solver_s_options_are_part_of_it(tmp_path):
    def mark(**options):
        return mark_of(KIND, model(), law(), solver_named("membrane", **options))

    assert mark() == mark()
    assert mark(wrinkle_stiffness=0.002) != mark()
    # What a cylinder is predicted with unless told otherwise has one mark, however it is asked for.
    assert mark(wall="tension field") == mark() != mark(wall="stiff")
    (tmp_path / "cylinder.inp.j2").write_text("*HEADING")
    options = ({}, {"threads": 2}, {"templates": tmp_path})
    words = [CalculixSolver(ccx="ccx", **o).identity for o in options]
    assert words[0] == words[1] != words[2]
    (tmp_path / "cylinder.inp.j2").write_text("*HEADING\nanother")
    assert CalculixSolver(ccx="ccx", templates=tmp_path).identity not in words


COLUMNS = ["beta_3_GPa", "beta_7_GPa", "beta_11_GPa"]
SCALE = [1000.0] * 3


def evaluation(start, analysis, value=0.5):
    return EvaluationRecord(start, analysis, value, "ok", (12.0, 250.0, 1e3 / 3), ())


def finished(number):
    return StartRecord(
        number, (1, number), 0.1, "converged", 7, (0.1, 1 / 3), (12.0, 250.0, 400.0), 1.5
    )


class Folder(RunningFiles):
    def __init__(self, path):
        super().__init__(Store(path), COLUMNS, SCALE)


def begin(folder, resume=False, overwrite=False):
    going_on = folder.store.begin({"law": "a"}, resume, overwrite, (STARTS, HISTORY))
    return {record.number: record for record in folder.begin(going_on)}


def test_a_start_that_the_solvers_failure_ended_is_run_again(tmp_path):
    folder = Folder(tmp_path)
    begin(folder)
    cut = replace(finished(1), status="calculix failed: killed", failure="killed")
    for record in (evaluation(0, 1), finished(0), evaluation(1, 1), cut):
        folder.add(record)
    folder.finish()
    assert list(begin(Folder(tmp_path), resume=True)) == [0]
    assert [row["start"] for row in rows(tmp_path)] == ["0"]


def test_a_start_that_began_again_has_its_rows_once(tmp_path):
    folder = Folder(tmp_path)
    begin(folder)
    first = [evaluation(1, 1), evaluation(0, 1), evaluation(1, 2)]
    again = [evaluation(1, 1, 0.25), evaluation(1, 2, 0.125), evaluation(1, 3, 0.0625)]
    for record in (*first, *again, finished(1), finished(0)):
        folder.add(record)
    folder.finish()
    told = [(row["start"], row["analysis"], float(row["objective"])) for row in rows(tmp_path)]
    assert told == [("0", "1", 0.5), ("1", "1", 0.25), ("1", "2", 0.125), ("1", "3", 0.0625)]


@pytest.mark.parametrize("resume", [False, True])
def test_page_and_card_of_an_earlier_result_go(tmp_path, resume):
    begin(Folder(tmp_path))
    for name in (RESULT, "report.html", "material.toml", "notes.txt"):
        (tmp_path / name).write_text("of the first fit")
    begin(Folder(tmp_path), resume, not resume)
    kept = {path.name for path in tmp_path.iterdir()}
    assert "notes.txt" in kept and not kept & {RESULT, "report.html", "material.toml"}


def study(path):
    """Starts 0 and 1 finished, start 2 under way: then the process is killed."""
    folder = Folder(path)
    assert begin(folder) == {}
    for start in (1, 0, 2):
        for analysis in (1, 2):
            folder.add(evaluation(start, analysis))
        if start < 2:
            folder.add(finished(start))
    return folder


def rows(path):
    with open(path / HISTORY, encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_rows_are_on_disk_before_anything_is_closed(tmp_path):
    folder = study(tmp_path)
    order = [("1", "1"), ("1", "2"), ("0", "1"), ("0", "2"), ("2", "1"), ("2", "2")]
    assert [(r["start"], r["analysis"]) for r in rows(tmp_path)] == order
    first = rows(tmp_path)[0]
    assert float(first["beta_11_GPa"]) == 1 / 3  # to the last bit
    assert float(first["objective"]) == 0.5 and first["status"] == "ok"
    lines = (tmp_path / STARTS).read_text().splitlines()
    assert [StartRecord.read(line) for line in lines] == [finished(1), finished(0)]
    assert not (tmp_path / RESULT).exists()
    folder.add(EvaluationRecord(3, 1, None, 'said, "no"', (1.0, 2.0, 3.0), ()))
    assert (rows(tmp_path)[-1]["objective"], rows(tmp_path)[-1]["status"]) == ("", 'said, "no"')


@given(
    st.one_of(st.none(), st.floats(0, 1e9)),
    st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=12),
    st.text(max_size=20),
)
def test_start_records_survive_json(value, unknowns, status):
    record = StartRecord(3, (1, 3), value, status, 9, tuple(unknowns), tuple(unknowns), 0.1)
    assert StartRecord.read(record.text) == record


def test_resume_keeps_finished_starts_and_drops_the_unfinished(tmp_path):
    study(tmp_path)
    folder = Folder(tmp_path)
    assert begin(folder, resume=True) == {0: finished(0), 1: finished(1)}
    assert {r["start"] for r in rows(tmp_path)} == {"0", "1"}
    folder.add(evaluation(2, 1))
    folder.add(finished(2))
    folder.finish()
    assert [r["start"] for r in rows(tmp_path)] == ["0", "0", "1", "1", "2"]
    assert begin(Folder(tmp_path), resume=True).keys() == {0, 1, 2}


@given(st.integers(0, 10_000), st.integers(0, 10_000))
@example(-2, -2)  # without its end of line a record is still whole
@settings(max_examples=60, deadline=None)
def test_cut_anywhere_resume_works_or_says_why(first, second):
    with tempfile.TemporaryDirectory() as name:
        path = Path(name)
        study(path).close()
        for file, cut in ((STARTS, first), (HISTORY, second)):
            content = (path / file).read_bytes()
            (path / file).write_bytes(content[: cut % (len(content) + 1)])
        folder = Folder(path)
        done = begin(folder, resume=True)
        folder.close()
        assert all(record == finished(number) for number, record in done.items())
        assert first != -2 or done.keys() == {0, 1}
        assert {r["start"] for r in rows(path)} <= {str(number) for number in done}
        assert all(np.isfinite(float(row["beta_11_GPa"])) for row in rows(path))


def test_a_damaged_middle_line_or_fingerprint_is_an_error(tmp_path):
    study(tmp_path)
    lines = (tmp_path / STARTS).read_text().splitlines()
    (tmp_path / STARTS).write_text(lines[0][:20] + "\n" + lines[1] + "\n")
    raised(InputError, r"starts.jsonl: line 1: .*--overwrite", begin, Folder(tmp_path), resume=True)
    for content in (b"", b"{", b"[]", b"{}", b"3", b"\xff\xfe", b'{"x": 1}'):
        (tmp_path / RUN).write_bytes(content)
        raised(InputError, r"run.json", begin, Folder(tmp_path), resume=True)


def test_resume_where_nothing_is_begins_afresh_and_says_so(tmp_path, caplog):
    for name, left in (("new", []), ("empty", [STARTS]), ("early", [RUN])):
        place = tmp_path / name
        if left != []:  # what a job left that was killed early
            begin(Folder(place))
            for file in {STARTS, HISTORY, RUN} - {*left}:
                (place / file).unlink()
        caplog.clear()
        assert begin(Folder(place), resume=True) == {}
        assert len(caplog.records) == (RUN not in left)
        assert {file.name for file in place.iterdir()} == {STARTS, HISTORY, RUN}
    for name in (STARTS, HISTORY):  # bytes that are no text
        study(tmp_path / name).close()
        with open(tmp_path / name / name, "ab") as stream:
            stream.write(b"\x00\xff\xfe")
        assert begin(Folder(tmp_path / name), resume=True).keys() == {0, 1}


def test_a_folder_that_takes_no_files(tmp_path):
    (tmp_path / "file").write_text("")
    read_only = [Path("/proc/self/out")] if Path("/proc/self").is_dir() else []
    for path in (tmp_path / "file" / "out", tmp_path / "file", *read_only):
        caught = raised(OutputError, "--out", begin, Folder(path))
        assert caught.exit_code == 2 and "\n" not in str(caught)


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
    replace, append = writing.os.replace, running_files._append

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
    patch.setattr(running_files, "_append", appending)
    return written


def test_whichever_write_is_the_last_the_end_is_the_same(strips_project, tmp_path):
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


def test_a_folder_far_below_is_made(tmp_path):
    store = Store(tmp_path / "a" / "b" / "c")
    assert not store.begin({"law": "1"}, False, False) and store.used
    content = {"parts": {"law": "1"}, "facts": {}}
    assert (store.path / RUN).read_text() == json.dumps(content, indent=1) + "\n"
    # A folder that is there and holds nothing of this is as good.
    (tmp_path / "notes.txt").write_text("mine")
    assert not Store(tmp_path).begin({}, False, False)


@pytest.mark.parametrize("name", [RUN, RESULT])
def test_each_of_the_two_files_says_that_a_folder_is_used(tmp_path, name):
    (tmp_path / name).write_text("{}")
    store = Store(tmp_path)
    assert store.used
    raised(OutputError, "already holds results", store.begin, {}, False, False)
    assert (tmp_path / name).read_text() == "{}"
    assert not store.begin({}, False, True)
    for file, folder in (("project.toml", "fabric"), ("linear.toml", "fabric-linear")):
        assert usual_folder(tmp_path / "fabric" / file) == Path("out") / folder


def test_what_differs_is_named_without_facts(tmp_path):
    store = Store(tmp_path)
    store.begin({"law": "1", "data": "2", "solver": "3"}, False, False)
    assert store.begin({"law": "1", "data": "2", "solver": "3"}, True, False)
    said = complaint(store.begin, {"law": "9", "data": "9", "solver": "3"}, True, False)
    assert said.startswith(f"{tmp_path / RUN}: parts: ") and "another data and law;" in said
    # Parts that only one of the two knows differ, too.
    for parts in ({"law": "1", "data": "2"}, {"law": "1", "data": "2", "solver": "3", "x": "4"}):
        raised(InputError, r"another (solver|x);", store.begin, parts, True, False)


def test_what_is_gone_on_with_is_kept(tmp_path):
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


def test_what_a_killed_process_had_begun_to_write_goes(tmp_path):
    gone, ours = ".result.999999999.json", f".moduli.{os.getpid()}.csv"
    for name in (gone, ours, ".hidden", ".a.b", "notes.999999999.txt"):
        (tmp_path / name).write_text("half")
    Store(tmp_path).begin({}, False, False)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert left == sorted([RUN, ours, ".hidden", ".a.b", "notes.999999999.txt"])
