"""The folder of a running fit: growing files, resumption, and differences that forbid it."""

import csv
import hashlib
import json
import re
import tempfile
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import bubblefit.runs.fit_folder
import bubblefit.solvers.run_cache
import numpy as np
import pytest
from bubblefit.errors import InputError, OutputError
from bubblefit.project.project import read_project, settings_of
from bubblefit.reports.provenance import record_tables
from bubblefit.runs.fit_folder import HISTORY, STARTS, RunningFiles, facts_of
from bubblefit.runs.folder import (
    AS_RUN,
    PROVENANCE,
    RESULT,
    RUN,
    Provenance,
    Store,
    data_rows,
    differences,
    this_run,
    versions,
)
from bubblefit.runs.setup import fingerprints
from bubblefit.runs.starts import EvaluationRecord, StartRecord
from hypothesis import example, given, settings
from hypothesis import strategies as st

from ..builders.projects import constant_strips, fit_setup, project_file
from ..support.refusals import complaint, raised

PROJECT = """
[fabric]
name = "Made up"
thickness = 0.8
[units]
modulus = "MPa"
[law]
form = "trilinear"
nu12 = 0.24
strain_range = [0.1, 0.1, 0.1]
breaks = { warp = [0.03, 0.06], fill = [0.03, 0.06], shear = [0.02, 0.05] }
[law.bounds]
E1 = [20, 2000]
E2 = [20, 1000]
G12 = [1, 200]
[[bubble]]
name = "first"
radius = 100.0
pressures = [50, 150]
elements = 48
[bubble.data.points]
files = ["low.csv", "high.csv"]
flag_column = "bad"
[solver.calculix]
element = "S8R"
templates = "decks"
[fit]
starts = 3
"""


FILES = ("low.csv", "high.csv")


def written(folder, *changes):
    folder.mkdir(exist_ok=True)
    x, y = (a.ravel() for a in np.meshgrid(*[np.linspace(-90, 90, 9)] * 2))
    inside = np.hypot(x, y) < 95
    for file, height in zip(FILES, (9.0, 21.0), strict=True):
        z = height * (1 - (x**2 + y**2) / 1e4)
        rows = zip(x[inside], y[inside], z[inside], strict=True)
        lines = [f"{a:.2f},{b:.2f},{-1e-3 * a:.4f},{-1e-3 * b:.4f},{c:.4f},0" for a, b, c in rows]
        head = ["x [mm],y [mm],dx [mm],dy [mm],dz [mm],bad", "1,2,0,0,300,1"]
        (folder / file).write_text("\n".join([*head, *lines]) + "\n")
    (folder / "decks").mkdir(exist_ok=True)
    (folder / "decks" / "bubble.inp.j2").write_text("** a deck of one's own\n")
    return project_file(folder, PROJECT, *changes)


def begun(folder, setup, resume):
    problem = setup.problem()
    data = data_rows((test.test.name, test) for test in setup.tests)
    facts = facts_of(setup, problem.solver, data)
    Store(folder).begin(fingerprints(setup, problem), resume, False, facts=facts)


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    folder = tmp_path_factory.mktemp("first")
    begun(folder / "out", fit_setup(written(folder / "here")), False)
    return folder / "out"


def refused(first, setup):
    """What differs, as --resume says it; nothing is written over."""
    before = {path: path.read_bytes() for path in first.iterdir()}
    said = complaint(begun, first, setup, True)
    assert {path: path.read_bytes() for path in first.iterdir()} == before
    assert said.startswith(f"{first / RUN}: ")
    found = re.search("of something else: (.*); go on with the same, or use --overwrite$", said)
    return found[1]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("nu12 = 0.24", "nu12 = 0.25", "law.nu12 = 0.24, now 0.25"),
        ("thickness = 0.8", "thickness = 0.9", "fabric.thickness = 0.8, now 0.9"),
        ('modulus = "MPa"', 'modulus = "GPa"', 'units.modulus = "MPa", now "GPa"'),
        ("fill = [0.03, 0.06]", "fill = [0.03, 0.07]", "law.breaks.fill[1] = 0.06, now 0.07"),
        ("elements = 48", "elements = 108", "tests.first.elements = 48, now 108"),
        ("radius = 100", "symmetry = 'quarter'\nradius = 100",
         'tests.first.symmetry = "full", now "quarter"'),
        ("radius = 100", "noise = 0.07\nradius = 100",
         "tests.first.noise = not given, now 0.07"),
        ("starts = 3", "starts = 3\nmax_analyses = 9", "fit.max_analyses = not given, now 9")
    ],
)  # fmt: skip
def test_changed_setting_is_named_on_resumption(first, tmp_path, old, new, words):
    assert refused(first, fit_setup(written(tmp_path, (old, new)))) == words


def test_changed_noise_of_strips_is_named_on_resumption(tmp_path):
    def setup(noise):
        change = ("[[strips]]", f"[[strips]]\nnoise = {noise}")
        return fit_setup(constant_strips(tmp_path, change))

    begun(tmp_path / "out", setup(0.7), False)
    assert refused(tmp_path / "out", setup(70)) == "tests.one.noise = 0.7, now 70.0"


def test_changed_data_file_is_named_on_resumption(first, tmp_path):
    path = written(tmp_path)
    was = hashlib.sha256((tmp_path / "high.csv").read_bytes()).hexdigest()[:12]
    text = (tmp_path / "high.csv").read_text()
    (tmp_path / "high.csv").write_text(text.replace(",21.0000,", ",21.0001,"))
    now = hashlib.sha256((tmp_path / "high.csv").read_bytes()).hexdigest()[:12]
    said = f'"high.csv, sha256 {was}", now "high.csv, sha256 {now}"'
    assert refused(first, fit_setup(path)) == f"data files.first[1] = {said}"
    # A remark, another name of the fabric, or more starts change no result.
    path = written(tmp_path, ("starts = 3", "starts = 5\njobs = 1"), ('"Made up"', '"Another"'))
    with (tmp_path / "low.csv").open("a") as stream:
        stream.write("# a remark\n")
    begun(first, fit_setup(path), True)


def test_every_difference_is_named_on_resumption(first, tmp_path):
    path = written(tmp_path, ("nu12 = 0.24", "nu12 = 0.3"), ('"high.csv"]', '"other.csv"]'))
    text = (tmp_path / "high.csv").read_text()
    (tmp_path / "other.csv").write_text(text.replace("300,1", "301,1"))
    said = refused(first, fit_setup(path))
    assert said.startswith("law.nu12 = 0.24, now 0.3; ")
    assert 'tests.first.data.points.files[1] = "high.csv", now "other.csv"' in said
    assert 'data files.first[1] = "high.csv, sha256 ' in said and said.count(";") == 2


def test_other_version_is_named_on_resumption(first, tmp_path, monkeypatch):
    setup = fit_setup(written(tmp_path))
    for module in (bubblefit.solvers.run_cache, bubblefit.runs.fit_folder):
        monkeypatch.setattr(module, "__version__", "9.1")
    (words,) = [w for w in refused(first, setup).split("; ") if "bubblefit" in w]
    assert words == f'version of bubblefit = "{bubblefit.__version__}", now "9.1"'


def test_other_solver_is_named_on_resumption(first, tmp_path):
    project = read_project(written(tmp_path)).with_solver(
        "membrane", {}, ["wrinkle_stiffness=0.01"]
    )
    said = refused(first, fit_setup(project))
    assert said.startswith("solver.wall = ") and "now " in said and ";" not in said


def test_other_ccx_is_named_on_resumption(ccx, tmp_path):
    def setup(*changes):
        path = written(tmp_path, *changes)
        return fit_setup(read_project(path).with_solver("calculix", {"ccx": str(ccx.path)}))

    begun(tmp_path / "out", setup(), False)
    begun(tmp_path / "out", setup(), True)
    said = refused(tmp_path / "out", setup(('"S8R"', '"S4"')))
    assert said == 'solver.element = "S8R", now "S4"'
    other = setup()
    (tmp_path / "decks" / "bubble.inp.j2").write_text("** another\n")
    said = refused(tmp_path / "out", other)
    assert re.fullmatch(r"solver.templates = sha256 \w{12}, now sha256 \w{12}", said)
    said = refused(tmp_path / "out", fit_setup(written(tmp_path)))
    assert said.startswith('solver.name = "calculix", now "membrane"; ')


def recorded(setup, command=None):
    project, tests = setup.project, [(t.test.name, t) for t in setup.tests]
    settings = settings_of(project, [name for name, _ in tests])
    rows = data_rows(tests)
    return Provenance(project.path, project.written.text, settings, rows, {}, [this_run(command)])


def test_project_as_run_has_options_of_command(tmp_path):
    path = written(tmp_path / "here")
    (tmp_path / "measured").mkdir()
    for name in FILES:
        (tmp_path / "here" / name).rename(tmp_path / "measured" / name)
    project = read_project(path, tmp_path / "measured").with_fit(seed=9, method="slsqp", jobs=1)
    project = project.with_solver("membrane", {}, ["wrinkle_stiffness=0.01"])
    setup = fit_setup(project)
    recorded(setup).write(tmp_path / "out")
    again = read_project(tmp_path / "out" / AS_RUN)
    theirs = fit_setup(again)
    assert again.fit == project.fit
    assert fingerprints(theirs, theirs.problem()) == fingerprints(setup, setup.problem())
    # Of the solver that runs, with paths in full.
    ((name, options),) = settings_of(project.with_fit(solver="calculix"), [])["solver"].items()
    assert name == "calculix" and options["templates"] == str(tmp_path / "here" / "decks")
    assert options["element"] == "S8R"


def test_project_as_run_has_only_tests_of_run(tmp_path):
    twice = PROJECT[PROJECT.index("[[bubble]]") : PROJECT.index("[solver")]
    path = written(tmp_path, ("[solver.", twice.replace('"first"', '"second"') + "[solver."))
    (section,) = settings_of(read_project(path), ["second"])["bubble"]
    assert section["name"] == "second"


def test_record_lists_data_files_with_checksums(tmp_path):
    low, high = data_rows([("first", fit_setup(written(tmp_path)).tests[0])])
    assert (low["test"], low["name"], high["name"]) == ("first", *FILES)
    assert low["file"] == str(tmp_path / "low.csv")
    assert low["sha256"] == hashlib.sha256((tmp_path / "low.csv").read_bytes()).hexdigest()
    assert low["format"] == "csv" and low["columns"]["dz"] == "dz [mm]"
    assert low["units"] == dict.fromkeys(("x", "y", "dx", "dy", "dz"), "mm")
    rows = len((tmp_path / "low.csv").read_text().splitlines()) - 1
    assert low["rows_used"] == rows - 1 and low["rows_dropped"] == {"flagged as doubtful": 1}


def test_record_says_when_where_and_with_what(tmp_path):
    setup, command = fit_setup(written(tmp_path, ("[law]", "# g/m²\n[law]"))), ["bubblefit", "fit"]
    record = recorded(setup, command)
    record.write(tmp_path / "out")
    text = (tmp_path / "out" / PROVENANCE).read_text(encoding="utf-8")
    said = json.loads(text)
    # For people, too: a value a line, and every letter as it is.
    assert text == json.dumps(said, indent=1, ensure_ascii=False) + "\n" and "m²" in text
    assert said["project"]["text"] == (tmp_path / "project.toml").read_text()
    digest = hashlib.sha256((tmp_path / "project.toml").read_bytes()).hexdigest()
    assert said["project"]["sha256"] == digest
    assert said["project"]["as_run"] == (tmp_path / "out" / AS_RUN).read_text()
    (run,) = said["runs"]
    assert run["command_line"] == command
    begun = datetime.fromisoformat(run["date"])
    assert begun.tzinfo is not None and abs((datetime.now(begun.tzinfo) - begun).seconds) < 600
    assert run["machine"]["name"] and run["versions"] == versions()
    assert versions()["bubblefit"] == bubblefit.__version__
    # Going on adds a run; a damaged record does not end it.
    after = record.after(tmp_path / "out")
    assert [r["date"] for r in after.runs] == [run["date"]] * 2
    (tmp_path / "out" / PROVENANCE).write_text("{")
    assert record.after(tmp_path / "out") is record
    facts, files = record_tables(record)
    assert ["command", "bubblefit fit"] in [list(row) for row in facts.rows]
    digest = hashlib.sha256((tmp_path / "low.csv").read_bytes()).hexdigest()
    low = list(files.rows[0])
    assert low[:4] == ["first", "low.csv", digest[:12], "csv"] and low[6] == "1 flagged as doubtful"
    assert low[4].startswith("x: x [mm] in mm, y: y [mm] in mm, ")
    (none,) = record_tables(Provenance(tmp_path / "p.toml", None, None, [], {}, [this_run(None)]))
    assert "called from Python" in dict(map(tuple, none.rows))["command"]


@pytest.mark.parametrize(
    ("before", "now", "words"),
    [
        # Of a list up to three values are named one by one.
        ([1, 2, 3, 4], [0, 2, 0, 0],
         ["a.k[0] = 1, now 0", "a.k[2] = 3, now 0", "a.k[3] = 4, now 0"]),
        ([1, 2, 3, 4], [0, 0, 0, 0], ["a.k = [1, 2, 3, 4], now [0, 0, 0, 0]"]),
        ([1, 2], [1, 2, 3], ["a.k = [1, 2], now [1, 2, 3]"]),
        # Texts are cut after 60 letters, their quotation marks among them.
        ("x" * 58, "y" * 59, [f'a.k = "{"x" * 58}", now "{"y" * 59}...']),
        ("0" * 64, None, [f"a.k = sha256 {'0' * 12}, now not given"]),
        ("0" * 63, "g" * 64, [f'a.k = "{"0" * 59}..., now "{"g" * 59}...']),
        ({"b": 1, "c": 2}, {"b": 1, "d": 3},
         ["a.k.c = 2, now not given", "a.k.d = not given, now 3"]),
    ],
)  # fmt: skip
def test_differences_of_nested_values_are_listed(before, now, words):
    assert differences({"a": {"k": before}}, {"a": {"k": now}}) == words


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


def test_start_ended_by_solver_failure_is_run_again(tmp_path):
    folder = Folder(tmp_path)
    begin(folder)
    cut = replace(finished(1), status="calculix failed: killed", failure="killed")
    for record in (evaluation(0, 1), finished(0), evaluation(1, 1), cut):
        folder.add(record)
    folder.finish()
    assert list(begin(Folder(tmp_path), resume=True)) == [0]
    assert [row["start"] for row in rows(tmp_path)] == ["0"]


def test_repeated_start_has_its_rows_once(tmp_path):
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
def test_page_and_card_of_earlier_result_are_removed(tmp_path, resume):
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


def test_rows_are_on_disk_before_files_are_closed(tmp_path):
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


def test_resume_keeps_finished_starts_only(tmp_path):
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
def test_history_cut_anywhere_is_resumed_or_refused(first, second):
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


def test_damaged_line_or_fingerprint_is_an_error(tmp_path):
    study(tmp_path)
    lines = (tmp_path / STARTS).read_text().splitlines()
    (tmp_path / STARTS).write_text(lines[0][:20] + "\n" + lines[1] + "\n")
    raised(InputError, r"starts.jsonl: line 1: .*--overwrite", begin, Folder(tmp_path), resume=True)
    for content in (b"", b"{", b"[]", b"{}", b"3", b"\xff\xfe", b'{"x": 1}'):
        (tmp_path / RUN).write_bytes(content)
        raised(InputError, r"run.json", begin, Folder(tmp_path), resume=True)


def test_resume_of_empty_folder_begins_and_says_so(tmp_path, caplog):
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


def test_folder_that_takes_no_files_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    read_only = [Path("/proc/self/out")] if Path("/proc/self").is_dir() else []
    for path in (tmp_path / "file" / "out", tmp_path / "file", *read_only):
        caught = raised(OutputError, "--out", begin, Folder(path))
        assert caught.exit_code == 2 and "\n" not in str(caught)
