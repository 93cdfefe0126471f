"""What the code itself never does: shells, pickles, evaluated text. Beside ruff's rules `S`."""

import ast
import time
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.experiments.data_files import Output
from bubblefit.materials.card import MaterialCard, read_card, write_card
from bubblefit.project.project import read_project
from bubblefit.readers.sections import PRESSURE_UNITS
from bubblefit.readers.values_in_files import number_in_name
from bubblefit.reports.charts import Chart, Charts, Series
from bubblefit.reports.content import Download, Facts, Listing, PageSection, Report, Table, Words
from bubblefit.reports.html import write_report
from bubblefit.solvers.decks import render
from bubblefit.solvers.export_formats import FORMATS
from bubblefit.solvers.registry import solver_settings
from bubblefit.solvers.settings import PROGRAMS_FROM

from .builders.plug_ins import install_plug_in
from .builders.projects import project_file
from .support.paths import EXAMPLES, ROOT
from .support.refusals import complaint, complaint_with

ROOMS = ("tests", "benchmarks", "out", "build")


SOURCES = sorted(
    path
    for path in ROOT.rglob("*.py")
    if path.relative_to(ROOT).parts[0] not in ROOMS
    and not any(part.startswith(".") for part in path.relative_to(ROOT).parts)
)


MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "marshal", "shelve", "yaml", "tarfile"}


CALLS = {
    "eval", "exec", "compile", "os.system", "os.popen", "np.loadtxt", "np.genfromtxt",
    "numpy.load", "pd.eval", "pd.read_pickle", "shutil.unpack_archive", "loadmat",
    "subprocess.getoutput", "jinja2.Environment", "SandboxedEnvironment", "tempfile.mktemp",
}  # fmt: skip


def faults(source):
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            named = [a.name for a in node.names]
            named += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [f"imports {n}" for n in named if n.partition(".")[0] in MODULES]
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        given = {k.arg: ast.unparse(k.value) for k in node.keywords}
        if name in CALLS or name.endswith(".extractall"):
            found.append(f"calls {name}")
        if name == "np.load" and given.get("allow_pickle") != "False":
            found.append("np.load without allow_pickle=False")
        if given.get("shell", "False") != "False" or given.get("allow_pickle") == "True":
            found.append(f"{name} with a shell or a pickle")
    return found


#: numpy's own reader of an example's own program, and of lines that are in memory, so that no file
#: is opened or unpacked (re.compile is no compile); and what our own processes send each other, by
#: a pipe, by shared memory or through Dask (docs/reference/security.md).
ALLOWED = {
    "examples/solver-adapter/bubblefit_homogeneous.py": ["calls np.loadtxt"],
    "processes.py": ["imports pickle"],
    "readers/text_frames.py": ["calls np.loadtxt"],
    "runs/executor.py": ["imports cloudpickle"],
    "runs/process_pool.py": ["imports cloudpickle"],
}


def test_code_has_no_shell_no_pickle_and_no_evaluated_text():
    assert len(SOURCES) > 150
    found = {str(path.relative_to(ROOT)): faults(path.read_text()) for path in SOURCES}
    assert {path: what for path, what in found.items() if what} == ALLOWED


def test_shells_pickles_and_evaluated_text_are_noticed():
    for source in (
        "import pickle", "from pickle import loads", "import yaml.loader", "eval('1')",
        "np.load(path)", "np.load(path, allow_pickle=True)", "run('ls', shell=True)",
        "archive.extractall()", "jinja2.Environment()",
    ):  # fmt: skip
        assert faults(source)
    text = (ROOT / "pyproject.toml").read_text()
    line = next(line for line in text.splitlines() if line.startswith("select = "))
    assert '"S"' in line  # ruff looks for the rest


HOSTILE = "a\nb\x00<script>alert(1)</script>\n*INCLUDE, INPUT=/etc/passwd\n include /etc/passwd"


STARTED = [
    ("marc", "executable", "/tmp/evil"), ("marc", "executable", "evil"),
    ("marc", "arguments", ["-u", "evil.f"]), ("marc", "environment", {"LD_PRELOAD": "evil.so"}),
    ("marc", "modules", ["evil"]), ("calculix", "ccx", "./evil"),
]  # fmt: skip


@pytest.mark.parametrize(("solver", "key", "value"), STARTED)
def test_project_names_programs_only_where_allowed(monkeypatch, tmp_path, solver, key, value):
    path, table = tmp_path / "home" / "project.toml", {solver: {key: value}}
    monkeypatch.delenv(PROGRAMS_FROM)
    option = {"marc": "--marc", "calculix": "--ccx"}[solver]
    words = [f"{path}: solver.{solver}.{key}: says what is run", option, f"={path.parent} lets"]
    complaint_with(words, solver_settings, path, table)
    monkeypatch.setenv(PROGRAMS_FROM, str(tmp_path / "hom"))
    complaint(solver_settings, path, table)
    monkeypatch.setenv(PROGRAMS_FROM, f"/nowhere:{tmp_path / 'home'}")
    assert solver_settings(path, table)[solver][key] is not None
    complaint(solver_settings, tmp_path / "home" / ".." / "project.toml", table)


def test_program_of_a_solver_on_the_path_may_be_named(monkeypatch, tmp_path):
    monkeypatch.delenv(PROGRAMS_FROM)
    path = tmp_path / "project.toml"
    for name in ("ccx_2.20", "ccx"):
        assert solver_settings(path, {"calculix": {"ccx": name}})["calculix"]["ccx"] == name
        complaint(solver_settings, path, {"calculix": {"ccx": f"{name}/../evil"}})
    own = {"marc": {"executable": "run_marc2023"}}
    assert solver_settings(path, own)["marc"]["executable"] == "run_marc2023"
    # A link to a project is where the file is.
    real, home = tmp_path / "real", tmp_path / "home"
    real.mkdir(), home.mkdir()
    (real / "project.toml").write_text("")
    (home / "project.toml").symlink_to(real / "project.toml")
    monkeypatch.setenv(PROGRAMS_FROM, str(home))
    complaint(solver_settings, home / "project.toml", {"calculix": {"ccx": "./evil"}})


def test_plug_in_declares_options_that_are_programs(monkeypatch, packages, tmp_path):
    code = "class THING:\n    started = ('program',)\n    def __init__(self, **options): ...\n"
    install_plug_in(packages, "bars", code, group="bubblefit.solvers")
    monkeypatch.delenv(PROGRAMS_FROM)
    path = tmp_path / "project.toml"
    assert solver_settings(path, {"bars": {"n": 2}})["bars"] == {"n": 2}
    words = ["solver.bars.program: says what is run"]
    complaint_with(words, solver_settings, path, {"bars": {"program": "evil"}})


def deck(folder, text, **context):
    (folder / "a.j2").write_text(text)
    return render("calculix", "a.j2", context, folder)


REACHES = [
    "{{ ''.__class__.__mro__[1].__subclasses__() }}", "{{ self.__init__.__globals__ }}",
    "{{ cycler.__init__.__globals__.os.popen('id') }}", "{{ '{0.__class__}'.format(1) }}",
    "{{ ('{0.' ~ '__class__}') | format(1) | attr('__class__') ~ x.append.__self__ }}",
    "{{ x | attr('__class__') | attr('__init__') }}", "{{ x.append(1) }}",
    "{% set _ = x.clear() %}", "{{ d.update({'a': 2}) }}", "{% include '/etc/passwd' %}",
    "{% include '../secret' %}", "{% include '../../../../../etc/passwd' %}",
    "{% import 'os' as os %}",
]  # fmt: skip


@pytest.mark.parametrize("text", REACHES)
def test_template_reaches_only_its_values(tmp_path, text):
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "t").mkdir()
    x, d = [1], {"a": 1}
    complaint(deck, tmp_path / "t", text, x=x, d=d)
    assert x == [1] and d == {"a": 1}


LEAVES = [
    "*INCLUDE, INPUT=/etc/passwd", " * include , input = ../../secret",
    "*INCLUDE,\n INPUT=/etc/passwd", "*RESTART, READ,\nFILE=a/b", "*MATERIAL, NAME=@/tmp/evil_F",
    "include /etc/passwd", "INCLUDE ../secret", 'Include "~/secret"', "include ..\\secret",
]  # fmt: skip


@pytest.mark.parametrize("text", LEAVES)
def test_line_of_deck_that_names_a_file_elsewhere_is_refused(tmp_path, text):
    complaint_with(["a.j2: line ", "names a file elsewhere"], deck, tmp_path, f"** deck\n{text}\n")
    # Not by a value either.
    complaint_with(["names a file elsewhere"], deck, tmp_path, "{{ name }}", name=f"a\n{text}")


def test_deck_may_name_files_of_the_run_folder(tmp_path):
    text = "** a/b = ../c\n*INCLUDE, INPUT=mesh.inp\n*NODE\n1, 1/2\ninclude cavity.dat\n$ a = /b\n"
    assert deck(tmp_path, text) == text


def test_files_of_tests_stay_in_separate_folders(tmp_path):
    hostile = "../../evil", "/etc/passwd", "a\nb", "-rf", "a" * 300, "ä" * 300, "..", ".", "\0", "~"
    for name in hostile:
        path = Output.of(tmp_path, name, True).path("loads.png")
        assert path.parent == tmp_path and path.name.endswith("-loads.png")
        assert path.name[0] not in "-." and len(path.name.encode()) < 200
        assert "\n" not in path.name
        path.write_text("")
    alike = ["a/b", "a-b", "a:b", "a" * 200, "a" * 201]
    files = [Output.of(tmp_path, name, True).prefix for name in alike]
    assert len(set(files)) == len(alike) and files[1] == "a-b-"
    assert Output.of(tmp_path, "bubble 1", True).prefix == "bubble-1-"


PATTERN = """
[fabric]
thickness = 0.8
[[bubble]]
radius = 100
pressures = [20]
[bubble.data.points]
pattern = "PATTERN"
indices = [1]
"""


def test_pattern_of_names_must_capture_a_number(tmp_path):
    words = ["data.points.pattern: expected a name with {index}"]
    for pattern in (
        "{index.__class__}", "{index:999999999999d}", "{index!r}", "{0}", "{index:{index}}", "{",
    ):  # fmt: skip
        path = project_file(tmp_path, PATTERN, ("PATTERN", pattern))
        complaint_with(words, read_project, path)
    (tmp_path / "t_{07}.csv").write_text("")
    project_file(tmp_path, PATTERN, ("PATTERN", "t_{{{index:02d}}}.csv"), ("[1]", "[7]"))
    assert "there is no file" not in str(read_project(path).tests["bubble"])


def test_endless_pattern_is_given_up(monkeypatch):
    monkeypatch.setattr("bubblefit.readers.values_in_files.SEARCH_SECONDS", 0.3)
    begun = time.monotonic()
    path = Path("a" * 60 + "!kPa")
    said = complaint(number_in_name, path, PRESSURE_UNITS, "(a+)+$", "kPa", "from_name")
    assert "from_name: the pattern '(a+)+$' takes too long" in said
    assert time.monotonic() - begun < 20
    pattern = r"^\w+?_(\d+(?:[.,]\d+)?)kPa"
    assert number_in_name(
        Path("step_35,5kPa.csv"), PRESSURE_UNITS, pattern, "kPa"
    ) == pytest.approx(0.0355)


def test_text_of_card_cannot_add_lines_to_an_export(tmp_path):
    project = read_project(EXAMPLES / "bend-valmex7318" / "project.toml")
    plain = next(iter(project.cards.values())).card
    card = MaterialCard(plain.law, plain.thickness, HOSTILE, HOSTILE)
    write_card(card, tmp_path / "card.toml")
    for name, kind in FORMATS.items():
        try:
            made = kind.export(read_card(tmp_path / "card.toml"))
        except InputError:
            continue
        for text in made.files.values():
            for line in text.splitlines():
                assert not line.lstrip().lower().startswith(("*include", "include")), name
                assert "\0" not in line


def test_page_escapes_all_texts(tmp_path):
    quoted = '"><img src=x onerror=alert(1)>'
    curve = Series(HOSTILE, [0.0, 1.0], [0.0, 1.0])
    parts = [
        Table(HOSTILE, [HOSTILE], [[HOSTILE], [np.float64(1)]], HOSTILE),
        Words([HOSTILE, quoted], warning=True), Facts([(HOSTILE, quoted)], quoted),
        Download(quoted, HOSTILE, HOSTILE), Listing(HOSTILE),
        Charts(HOSTILE, [Chart(quoted, HOSTILE, quoted, [curve])], HOSTILE),
    ]  # fmt: skip
    report = Report(
        quoted, HOSTILE, facts=[(HOSTILE, quoted)], warnings=[HOSTILE],
        sections=[PageSection(HOSTILE, parts)],
        files=[(quoted, HOSTILE)], versions={HOSTILE: quoted},
    )  # fmt: skip
    page = write_report(tmp_path, report).read_text()
    assert "&lt;script&gt;alert" in page
    for text in ("<script>alert", "<img src=x", "onerror=alert(1)>"):
        assert text not in page
