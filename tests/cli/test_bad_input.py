"""Bad input of every kind is one line that says what is wrong and what to do, with exit code 2."""

import codecs
import signal
import subprocess
import sys
from pathlib import Path

import bubblefit as bf
import pytest
from bubblefit.cli.terminal import resumable
from bubblefit.errors import BubblefitError, InputError, OutputError
from bubblefit.experiments.registry import kind_names
from bubblefit.meshes import mesh as meshes

from ..builders.projects import CONSTANT_STRIPS, constant_strips, known_bubble, replaced_once
from ..support.commands import in_process, one_line, wait_for
from ..support.refusals import raised

CARD = ("--card", "out/material.toml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A project of strips and its fit in out/; a folder named like a file of data."""
    folder = tmp_path_factory.mktemp("bad")
    constant_strips(folder)
    in_process("fit", "project.toml", "--out", "out", "--starts", 1, "--jobs", 1, cwd=folder)
    (folder / "folder.csv").mkdir()
    (folder / "file").write_text("text\n")
    return folder


@pytest.fixture(scope="module")
def fit(folder):
    return bf.fit(bf.read_project(folder / "project.toml"), tests=["two"], starts=1, jobs=1)


def refused(folder, words, *arguments):
    """Assert that a command ends with one line of these words and code 2, and writes nothing."""
    before = sorted(folder.rglob("*"))
    done = in_process(*arguments, cwd=folder, code=2)
    one_line(done, *words)
    assert done.stderr.startswith("bubblefit: ") and done.stdout == ""
    assert sorted(folder.rglob("*")) == before


def project(folder, *changes, text=CONSTANT_STRIPS):
    (folder / "other.toml").write_text(replaced_once(text, *changes))
    return "other.toml"


@pytest.mark.parametrize("command", ["check", "estimate"])
def test_byte_order_mark_is_skipped(folder, command):
    text = (folder / "project.toml").read_bytes()
    (folder / "marked.toml").write_bytes(codecs.BOM_UTF8 + text)
    in_process(command, "marked.toml", cwd=folder)
    card = folder / "out" / "material.toml"
    (folder / "marked-card.toml").write_bytes(codecs.BOM_UTF8 + card.read_bytes())
    assert bf.read_card(folder / "marked-card.toml").law.beta == pytest.approx(
        bf.read_card(card).law.beta
    )


def test_unknown_form_is_named_before_keys_that_depend_on_it(folder):
    form = ('form = "constant"', 'form = "mine"')
    for changes in ([form], [form, ("strain_range = [0.12, 0.14, 0.1]\n", "")]):
        name = project(folder, *changes)
        for command in ("fit", "check", "estimate"):
            refused(folder, ("law.form: no form is called 'mine'", "known: "), command, name)


@pytest.mark.parametrize("name", [".", "..", "folder.csv", "folder.csv/"])
def test_folder_is_no_file_of_data(folder, name):
    file = project(folder, ('"one.csv"', f'"{name}"'))
    words = ("other.toml: strips[0].data.files[0]: ", " is a folder; name a file in it")
    refused(folder, words, "check", file)
    raised(InputError, "is a folder", bf.read, folder / name)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", "folder.csv"), ("export", "folder.csv", "--format", "constants"),
        ("cycles", "folder.csv"), ("profile", "project.toml", "--card", "folder.csv"),
        ("simulate", "test", "project.toml", "--card", "folder.csv"),
        ("simulate", "bend", "--diameter", 150, "--pressure", 140, *CARD,
         "--measured", "folder.csv"),
        ("gauge", "folder.csv", "--lower", 0, 0, "--upper", 0, 9, "--out", "g.csv"),
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_option_that_takes_a_file_refuses_a_folder(folder, arguments):
    refused(folder, ("folder.csv", "is a folder"), *arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("report", "one.csv"), "one.csv: is a file; name the output folder of a run"),
        (("report", "out", "one.csv"), "one.csv: is a file; name the output folder of a run"),
        (("report", "none"), "none: there is no such folder"),
        (("fit", "project.toml", "--out", "file"), "file is a file; name a folder"),
        (("check", "project.toml", "--out", "file/deep"), "file is a file; name a folder"),
        (("fit", "project.toml", "--data", "file"), "file"),
        (("init", "file"), "file"),
    ],
)
def test_option_that_takes_a_folder_refuses_a_file(folder, arguments, words):
    refused(folder, (words,), *arguments)


@pytest.mark.parametrize(
    "arguments",
    [
        ("fit", "project.toml", "--out", "/proc/x"), ("check", "project.toml", "--out", "/proc/x"),
        ("plan", "project.toml", *CARD, "--out", "/proc/x"), ("schema", "--out", "/proc/x"),
        ("simulate", "test", "project.toml", *CARD, "--out", "/proc/x/y"), ("init", "/proc/x"),
        ("report", "out", "--out", "/proc/x.html"), ("cycles", "one.csv", "--out", "/proc/x"),
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_place_where_nothing_can_be_written_is_refused(folder, arguments):
    done = in_process(*arguments, cwd=folder, code=2)
    one_line(done, "/proc/x", "cannot be written: ", "; choose another ")
    assert "free space" not in done.stderr


@pytest.mark.parametrize("kind", kind_names())
def test_single_brackets_of_a_test_are_named(folder, kind):
    name = project(folder, text=f"[fabric]\nthickness = 0.8\n[{kind}]\nname = 'a'\n")
    words = f"other.toml: {kind}: there can be several of these tables; write [[{kind}]] for "
    refused(folder, (words,), "check", name)
    twice = f"[fabric]\nthickness = 0.8\n[{kind}]\nname = 'a'\n[{kind}]\nname = 'b'\n"
    name = project(folder, text=twice)
    refused(folder, (f"several tables of one name are written [[{kind}]]",), "check", name)


@pytest.mark.parametrize("table", ["fabric", "law", "fit", "units", "law.bounds", "strips.data"])
def test_double_brackets_of_a_single_table_are_named(folder, table):
    name = project(folder, (f"[{table}]", f"[[{table}]]"))
    refused(folder, (f"only; write [{table}] for [[{table}]]",), "check", name)


def test_no_test_at_all_is_no_choice(folder, fit):
    read = bf.read_project(folder / "project.toml")
    calls = [lambda c=c: c(read, tests=[]) for c in (bf.fit, bf.check, bf.estimate, bf.compare)]
    calls += [lambda: bf.validate(read, tests=()), lambda: bf.refine(read, fit.card, tests=[])]
    for call in calls:
        error = raised(InputError, "tests: names no test; leave it out to take all of them", call)
        assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("words", "call"),
    [
        ("unit: expected one of 'GPa', 'MPa', 'Pa', got 'psi'",
         lambda fit, to: fit.card.write(to / "c.toml", unit="psi")),
        ("path: expected Path | str, got 3", lambda fit, to: fit.card.write(3)),
        ("folder: expected Path | str, got None", lambda fit, to: fit.report(None)),
        ("count: expected int of 0 or more, got -1", lambda fit, to: fit.draw_laws(-1)),
        ("count: expected int of 0 or more, got True", lambda fit, to: fit.draw_laws(True)),
        ("count: expected int of 0 or more, got 1.5", lambda fit, to: fit.draw_laws(1.5)),
        ("seed: expected int of 0 or more, got -1", lambda fit, to: fit.draw_laws(2, seed=-1)),
        ("starts: expected int of 1 or more, got True",
         lambda fit, to: bf.fit(fit.project, starts=True)),
        ("starts: expected int of 1 or more, got 0", lambda fit, to: bf.fit(fit.project, starts=0)),
        ("jobs: expected int of 1 or more, got True",
         lambda fit, to: bf.fit(fit.project, jobs=True)),
        ("seed: expected int of 0 or more, got -1", lambda fit, to: bf.fit(fit.project, seed=-1)),
        ("samples: expected int of 2 or more, got 1",
         lambda fit, to: bf.bootstrap(fit.project, "specimens", 1)),
        ("samples: expected int of 0 or more, got -1",
         lambda fit, to: bf.predict(fit.project, samples=-1)),
        ("folds: expected int of 2 or more, got 1",
         lambda fit, to: bf.compare(fit.project, folds=1)),
        ("starts: expected int of 1 or more, got -2",
         lambda fit, to: bf.validate(fit.project, starts=-2)),
        ("specimens: expected int of 1 or more, got 0",
         lambda fit, to: bf.plan(fit.project, specimens=0)),
        ("levels: expected int of 2 or more, got 1",
         lambda fit, to: bf.refine(fit.project, levels=1)),
        ("coarser: expected int of 0 or more, got -1",
         lambda fit, to: bf.refine(fit.project, coarser=-1)),
    ],
)  # fmt: skip
def test_argument_of_python_is_checked(words, call, fit, tmp_path):
    error = raised(InputError, None, call, fit, tmp_path)
    assert str(error) == words
    assert list(tmp_path.iterdir()) == []


def test_report_into_a_file_is_refused(fit, tmp_path):
    file = tmp_path / "a file"
    file.write_text("text")
    error = raised(OutputError, None, fit.report, file)
    assert str(error) == f"{file}: is a file; name a folder for the results"
    assert file.read_text() == "text"


def test_mesh_beyond_the_memory_is_refused_with_an_estimate(tmp_path, monkeypatch):
    known_bubble(tmp_path, ("elements = 48", "elements = 4_000_000"))

    class Memory:
        available = 8e9

    monkeypatch.setattr(meshes.psutil, "virtual_memory", Memory, raising=False)
    words = ("project.toml: bubble[0].elements: an analysis of 1000000 quads takes about 30 GB",
             "8 GB are free; take fewer")  # fmt: skip
    for command in (("fit",), ("check",)):
        refused(tmp_path, words, *command, "project.toml")
    error = raised(InputError, "elements", meshes.check_memory, 10**6, "elements")
    assert "8 GB are free" in str(error)
    meshes.check_memory(200_000, "elements")


# Streams and interruptions, of real processes


def command(*arguments, **options):
    typed = [sys.executable, "-m", "bubblefit.cli", *arguments]
    return subprocess.Popen(typed, text=True, stderr=subprocess.PIPE, **options)


@pytest.mark.parametrize(
    "arguments", [("--help",), ("--version",), ("schema",), ("docs", "changelog"), ("verify", "-h")]
)
def test_full_stdout_has_an_exit_code_and_a_line(arguments):
    with open("/dev/full", "w") as full:
        running = command(*arguments, stdout=full)
        _, stderr = running.communicate(timeout=120)
    words = "bubblefit: standard output cannot be written: No space left on device; free space or"
    assert running.returncode == BubblefitError.exit_code == 2
    assert stderr.startswith(words) and stderr.count("\n") == 1


def test_results_are_kept_where_stdout_is_full(folder):
    with open("/dev/full", "w") as full:
        running = command(
            "check", "project.toml", "--out", "full", "--quiet", stdout=full, cwd=folder
        )
        _, stderr = running.communicate(timeout=120)
    assert running.returncode == 2 and "standard output cannot be written" in stderr
    assert (folder / "full" / "report.html").exists()


def test_closed_stdout_and_gone_readers_have_an_exit_code(folder):
    typed = f"{sys.executable} -m bubblefit.cli docs project-file"
    closed = subprocess.run(
        ["sh", "-c", f"{typed} >&-"], capture_output=True, text=True, timeout=120
    )
    assert (closed.returncode, closed.stderr) == (
        2, "bubblefit: standard output is closed; redirect it into a file, or to /dev/null\n"
    )  # fmt: skip
    gone = command("docs", "project-file", stdout=subprocess.PIPE)
    gone.stdout.close()
    assert gone.stderr.read() == "" and gone.wait(120) == 141
    # Errors keep their code where nobody can read them.
    for arguments in ("fit none.toml", "fit none.toml --bad"):
        silent = f"{sys.executable} -m bubblefit.cli {arguments} 2>/dev/full"
        assert subprocess.run(["sh", "-c", silent], cwd=folder, timeout=120).returncode == 2


@pytest.mark.parametrize("library", ["numpy/_core", "scipy"])
def test_interruption_while_imported_is_one_line(folder, library):
    """Our imports are under way, of which those of numpy and scipy take longest."""
    running = command("fit", "project.toml", "--out", "int", "--quiet", cwd=folder,
                      stdout=subprocess.DEVNULL)  # fmt: skip
    opened = Path(f"/proc/{running.pid}/maps")
    wait_for(lambda: library in opened.read_text(), 120)
    running.send_signal(signal.SIGINT)
    _, stderr = running.communicate(timeout=60)
    assert (running.returncode, stderr) == (130, "bubblefit: interrupted\n")
    assert not (folder / "int").exists()


@pytest.mark.parametrize("kept", ["run.json", "analyses", ""])
def test_interruption_names_what_is_kept_only_where_something_is(kept, tmp_path, capsys):
    (tmp_path / kept).mkdir(exist_ok=True)
    with pytest.raises(KeyboardInterrupt), resumable(tmp_path):
        raise KeyboardInterrupt
    words = f"interrupted; go on with --resume (kept in {tmp_path})\n"
    assert capsys.readouterr().err == (words if kept else "")
