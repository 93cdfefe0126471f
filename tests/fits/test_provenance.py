"""What results came from: the project as run, data files, command; and what differs, in words."""

from __future__ import annotations

import hashlib
import json
import re
from datetime import datetime
from pathlib import Path
from typing import Any

import bubblefit.fits.facts
import bubblefit.solvers.run_cache
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.project.project import Project, project_text, read_project, settings_of
from bubblefit.runs.folder import AS_RUN, PROVENANCE, RUN, Store, differences
from bubblefit.runs.record import Record, data_rows, facts_of, solver_facts, this_run
from bubblefit.runs.setup import FitSetup, fingerprints, prepare_fit
from bubblefit.solvers.calculix.executable import Executable
from bubblefit.solvers.decks import in_words

from ..places import EXAMPLES
from ..projects import project_file

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


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    """A bubble of two measured frames, and the project of it, changed by replacing text."""
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


def prepared(project: Project) -> FitSetup:
    return prepare_fit(project, project.chosen(None, fitted=True))  # type: ignore[arg-type]


def begun(folder: Path, setup: FitSetup, resume: bool) -> None:
    """The folder of a fit, as a fit begins it."""
    problem = setup.problem()
    data = data_rows((test.test.name, test) for test in setup.tests)
    facts = facts_of(setup, problem.solver, data)
    Store(folder).begin(fingerprints(setup, problem), resume, False, facts=facts)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output folder of the project as it stands."""
    folder = tmp_path_factory.mktemp("first")
    begun(folder / "out", prepared(read_project(written(folder / "here"))), False)
    return folder / "out"


def refused(first: Path, setup: FitSetup) -> str:
    """What differs, as --resume says it; nothing is written over."""
    before = {path: path.read_bytes() for path in first.iterdir()}
    with pytest.raises(InputError) as caught:
        begun(first, setup, True)
    assert {path: path.read_bytes() for path in first.iterdir()} == before
    said = str(caught.value)
    assert "\n" not in said and said.startswith(f"{first / RUN}: ")
    found = re.search("of something else: (.*); go on with the same, or use --overwrite$", said)
    assert found is not None, said
    return found[1]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("nu12 = 0.24", "nu12 = 0.25", "law.nu12 = 0.24, now 0.25"),
        ("thickness = 0.8", "thickness = 0.9", "fabric.thickness = 0.8, now 0.9"),
        ("[0.1, 0.1, 0.1]", "[0.1, 0.1, 0.12]", "law.strain_range[2] = 0.1, now 0.12"),
        ("fill = [0.03, 0.06]", "fill = [0.03, 0.07]", "law.breaks.fill[1] = 0.06, now 0.07"),
        ("E2 = [20, 1000]", "E2 = [30, 1000]", "law.bounds.E2[0] = 20.0, now 30.0"),
        ("elements = 48", "elements = 108", "first.elements = 48, now 108"),
        ("[50, 150]", "[50, 160]", "first.pressures[1] = 150.0, now 160.0"),
        ("radius = 100", "symmetry = 'quarter'\nradius = 100",
         'first.symmetry = "full", now "quarter"'),
        ("radius = 100", "weight = 2.0\nradius = 100", "first.weight = 1.0, now 2.0"),
        ("starts = 3", "starts = 3\nseed = 2", "fit.seed = 1, now 2"),
        ("starts = 3", "starts = 3\nmax_analyses = 9", "fit.max_analyses = not given, now 9"),
        ('form = "trilinear"\nnu12 = 0.24', 'form = "trilinear"\nnu12 = 0.25',
         "law.nu12 = 0.24, now 0.25"),
    ],
)  # fmt: skip
def test_what_is_set_otherwise_is_named(
    first: Path, tmp_path: Path, old: str, new: str, words: str
) -> None:
    assert refused(first, prepared(read_project(written(tmp_path, (old, new))))) == words


def test_the_data_file_that_was_touched_is_named(first: Path, tmp_path: Path) -> None:
    path = written(tmp_path)
    was = hashlib.sha256((tmp_path / "high.csv").read_bytes()).hexdigest()
    text = (tmp_path / "high.csv").read_text()
    assert text.count(",21.0000,") == 1
    (tmp_path / "high.csv").write_text(text.replace(",21.0000,", ",21.0001,"))
    now = hashlib.sha256((tmp_path / "high.csv").read_bytes()).hexdigest()
    said = f"data file high.csv of 'first' (sha256 {was[:12]}, now {now[:12]})"
    assert refused(first, prepared(read_project(path))) == said


def test_everything_that_differs_is_named(first: Path, tmp_path: Path) -> None:
    path = written(tmp_path, ("nu12 = 0.24", "nu12 = 0.3"), ('"high.csv"]', '"other.csv"]'))
    text = (tmp_path / "high.csv").read_text()
    (tmp_path / "other.csv").write_text(text.replace("300,1", "301,1"))
    said = refused(first, prepared(read_project(path)))
    assert said.startswith("law.nu12 = 0.24, now 0.3; ")
    assert 'first.data.points.files[1] = "high.csv", now "other.csv"' in said
    assert "data file of 'first', by sha256: high.csv (" in said and said.count(";") == 2


def test_another_version_is_named(
    first: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup = prepared(read_project(written(tmp_path)))
    for module in (bubblefit.solvers.run_cache, bubblefit.fits.facts):
        monkeypatch.setattr(module, "__version__", "9.1")
    (words,) = [w for w in refused(first, setup).split("; ") if "bubblefit" in w]
    assert words == f'version of bubblefit = "{bubblefit.__version__}", now "9.1"'


def test_the_solver_is_named(first: Path, tmp_path: Path) -> None:
    project = read_project(written(tmp_path)).with_solver(
        "membrane", {}, ["wrinkle_stiffness=0.01"]
    )
    said = refused(first, prepared(project))
    assert said.startswith("the solver membrane: wall = ") and "now " in said and ";" not in said


def test_what_calculix_runs_with_is_named(ccx: Executable, tmp_path: Path) -> None:
    def setup(*changes: tuple[str, str]) -> FitSetup:
        path = written(tmp_path, *changes)
        return prepared(read_project(path).with_solver("calculix", {"ccx": str(ccx.path)}))

    begun(tmp_path / "out", setup(), False)
    begun(tmp_path / "out", setup(), True)
    said = refused(tmp_path / "out", setup(('"S8R"', '"S4"')))
    assert said == 'the solver calculix: element = "S8R", now "S4"'
    other = setup()
    (tmp_path / "decks" / "bubble.inp.j2").write_text("** another\n")
    said = refused(tmp_path / "out", other)
    assert re.fullmatch(r"the solver calculix: templates = sha256 \w{12}, now sha256 \w{12}", said)
    said = refused(tmp_path / "out", prepared(read_project(written(tmp_path))))
    assert said == 'the solver = "calculix", now "membrane"'


def test_what_changes_no_result_is_gone_on_with(first: Path, tmp_path: Path) -> None:
    """Another place, another name, more starts, a remark in a file: the same fit."""
    path = written(
        tmp_path, ("starts = 3", "starts = 5\njobs = 1"), ('"Made up"', '"Another name"')
    )
    with (tmp_path / "low.csv").open("a") as stream:
        stream.write("# a remark\n")
    begun(first, prepared(read_project(path)), True)


@pytest.mark.parametrize("known", [{}, {"version": "0.1"}])
def test_what_cannot_be_told_in_words_is_still_refused(
    first: Path, tmp_path: Path, known: dict[str, str]
) -> None:
    """A folder of an older version has digests only."""
    store = Store(tmp_path)
    store.begin({"law": "a"}, False, False, facts=known)
    with pytest.raises(InputError, match="are of another law; go on with"):
        store.begin({"law": "b"}, True, False, facts=known)


def test_differences_of_tests_and_long_values() -> None:
    before: dict[str, Any] = {"tests": {"a": {"k": list(range(40))}, "b": {"n": 1}}}
    now: dict[str, Any] = {"tests": {"a": {"k": list(range(1, 41))}, "c": {}}}
    tests, values = differences(before, now)
    assert tests == "the tests: a, b, now a, c"
    assert values.startswith("a.k = [0, 1, 2") and "..., now [1, 2, 3" in values
    assert len(values) < 160
    files = [{"name": "x", "sha256": "0" * 64}]
    words = differences({"tests": {"a": {}}, "files": {"a": files}}, {"tests": {"a": {}}})
    assert words == ["1 data files of 'a', now 0"]
    assert differences({}, {}) == []


def test_a_solver_of_any_words_has_facts() -> None:
    words = in_words("own", "3.1", element=4, templates="")
    assert solver_facts("own", words) == {
        "name": "own", "version": "own 3.1", "element": "4", "templates": "",
    }  # fmt: skip
    assert solver_facts("bar", "anything at all")["version"] == "anything at all"


# The project as it was run

OWN = [
    path
    for path in sorted(EXAMPLES.glob("*/*.toml"))
    if "[fabric]" in path.read_text() and path.parent.name != "plug-in"
]


@pytest.mark.parametrize("path", OWN, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_every_example_can_be_run_again_as_it_was(path: Path, tmp_path: Path) -> None:
    project = read_project(path, need_data=False).with_fit(starts=7, seed=3, method="slsqp")
    (tmp_path / "elsewhere.toml").write_text(project_text(settings_of(project, [*project.tests])))
    again = read_project(tmp_path / "elsewhere.toml", need_data=False)
    assert again.fit == project.fit and again.law == project.law
    assert again.fabric == project.fabric and again.scales == project.scales
    assert again.solver_options[project.fit.solver] == project.solver_options[project.fit.solver]
    assert list(again.tests) == list(project.tests)
    for name, test in project.tests.items():
        assert again.tests[name].settings() == test.settings()
        assert again.tests[name].weight == test.weight


def recorded(setup: FitSetup, command: list[str] | None = None) -> Record:
    project, tests = setup.project, [(t.test.name, t) for t in setup.tests]
    assert project.written is not None
    settings = settings_of(project, [name for name, _ in tests])
    rows = data_rows(tests)
    return Record(project.path, project.written.text, settings, rows, {}, [this_run(command)])


def test_options_of_the_command_are_in_the_project_as_run(tmp_path: Path) -> None:
    """Its digests are those of the run, from another folder, with nothing said beside the file."""
    path = written(tmp_path / "here")
    (tmp_path / "measured").mkdir()
    for name in FILES:
        (tmp_path / "here" / name).rename(tmp_path / "measured" / name)
    project = read_project(path, tmp_path / "measured").with_fit(seed=9, method="slsqp", jobs=1)
    project = project.with_solver("membrane", {}, ["wrinkle_stiffness=0.01"])
    setup = prepared(project)
    recorded(setup).write(tmp_path / "out")
    again = read_project(tmp_path / "out" / AS_RUN)
    theirs = prepared(again)
    assert again.fit == project.fit
    assert fingerprints(theirs, theirs.problem()) == fingerprints(setup, setup.problem())


def test_only_the_tests_of_the_run_are_in_it(tmp_path: Path) -> None:
    twice = PROJECT[PROJECT.index("[[bubble]]") : PROJECT.index("[solver")]
    path = written(tmp_path, ("[solver.", twice.replace('"first"', '"second"') + "[solver."))
    settings = settings_of(read_project(path), ["second"])
    assert [section["name"] for section in settings["bubble"]] == ["second"]


# The record


def test_the_record_of_data_files(tmp_path: Path) -> None:
    low, high = data_rows([("first", prepared(read_project(written(tmp_path))).tests[0])])
    assert (low["test"], low["name"], high["name"]) == ("first", *FILES)
    assert low["file"] == str(tmp_path / "low.csv")
    assert low["sha256"] == hashlib.sha256((tmp_path / "low.csv").read_bytes()).hexdigest()
    assert low["format"] == "csv" and low["columns"]["dz"] == "dz [mm]"
    assert low["units"] == dict.fromkeys(("x", "y", "dx", "dy", "dz"), "mm")
    rows = len((tmp_path / "low.csv").read_text().splitlines()) - 1
    assert low["rows_used"] == rows - 1 and low["rows_dropped"] == {"flagged as doubtful": 1}


def test_the_record_of_load_curves(tmp_path: Path) -> None:
    text = (EXAMPLES / "uniaxial-valmex7318" / "project.toml").read_text()
    table = "[strips.warp]\ngauge_length = 20.0\nfinal_length = 22.0\n[strips.data]"
    path = project_file(
        tmp_path,
        text,
        ('polynomials = "curves.csv"', 'files = { warp = ["a.csv"] }\nfolder = "lab"'),
        ('match = "polynomial"', 'match = "points"'),
        ("[strips.data]", table),
        ("# strain_range = [0.153, 0.232, 0.883]", "strain_range = [0.2, 0.2, 0.2]"),
    )
    (tmp_path / "lab").mkdir()
    rows = "".join(f"{0.25 * k:.2f};{0.01 * k}\n" for k in range(-1, 11))
    (tmp_path / "lab" / "a.csv").write_text(f"Gauge elongation [mm];Load [kN]\n{rows}")
    (row,) = data_rows([("strips", prepared(read_project(path)).tests[0])])
    assert row["format"] == "text" and row["units"] == {"elongation": "mm", "load": "kN"}
    assert row["columns"] == {"elongation": "Gauge elongation [mm]", "load": "Load [kN]"}
    assert row["rows_used"] == 9
    assert row["rows_dropped"] == {"elongation below zero": 1, "beyond the final length": 2}


def test_a_kind_without_files_has_none() -> None:
    assert data_rows([("any", object())]) == []


def test_the_record_says_when_where_and_with_what(tmp_path: Path) -> None:
    setup = prepared(read_project(written(tmp_path, ("[law]", "# g/m²\n[law]"))))
    record = recorded(setup, ["bubblefit", "fit", "project.toml", "--starts", "3"])
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
    assert run["command_line"] == ["bubblefit", "fit", "project.toml", "--starts", "3"]
    begun = datetime.fromisoformat(run["date"])
    assert begun.tzinfo is not None and abs((datetime.now(begun.tzinfo) - begun).seconds) < 600
    assert run["machine"]["name"] and run["versions"]["bubblefit"] == bubblefit.__version__
    # Going on adds a run; a damaged record does not end it.
    after = record.after(tmp_path / "out")
    assert [r["date"] for r in after.runs] == [run["date"]] * 2
    (tmp_path / "out" / PROVENANCE).write_text("{")
    assert record.after(tmp_path / "out") is record


def test_the_record_on_the_page(tmp_path: Path) -> None:
    setup = prepared(read_project(written(tmp_path)))
    facts, files = recorded(setup, ["bubblefit", "fit", "p.toml"]).tables()
    assert facts.title == "The record"
    assert ["command", "bubblefit fit p.toml"] in [list(row) for row in facts.rows]
    digest = hashlib.sha256((tmp_path / "low.csv").read_bytes()).hexdigest()
    columns = "x: x [mm] in mm, y: y [mm] in mm, "
    low = list(files.rows[0])
    assert low[:4] == ["first", "low.csv", digest[:12], "csv"] and low[4].startswith(columns)
    assert low[6] == "1 flagged as doubtful"
    solver = solver_facts("calculix", "calculix 2.20; element=S8R; templates=")
    (none,) = Record(tmp_path / "p.toml", None, None, [], solver, [this_run(None)]).tables()
    said = dict(map(tuple, none.rows))
    assert said["solver"] == "calculix 2.20; element = S8R"
    assert said["command"] == "none: called from Python" and "computed" in said["data files"]


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
def test_values_that_differ(before: Any, now: Any, words: list[str]) -> None:
    assert differences({"tests": {"a": {"k": before}}}, {"tests": {"a": {"k": now}}}) == words


def test_files_that_differ() -> None:
    def facts(*files: tuple[str, str]) -> dict[str, Any]:
        rows = [{"name": name, "sha256": 64 * mark} for name, mark in files]
        return {"tests": {"a": {}}, "files": {"a": rows}}

    one, two, three = 12 * "1", 12 * "2", 12 * "3"
    before, now = (
        facts(("x", "1"), ("y", "2"), ("z", "3")),
        facts(("x", "2"), ("w", "3"), ("v", "3")),
    )
    assert differences(before, now) == [
        f"data file x of 'a' (sha256 {one}, now {two})",
        f"data file of 'a', by sha256: y ({two}), now w ({three})",
    ]
