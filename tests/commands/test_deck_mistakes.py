"""Mistakes in a deck of one's own, as `bubblefit check` names them: one line, exit code 2 or 4."""

import sys

import pytest

from ..builders.decks import bar_project, sheet_project
from ..support.commands import in_process


def error_of(path, code):
    """Return the one line of the error of `check`."""
    output = in_process("check", path, cwd=path.parent, code=code).output
    (line,) = [line for line in output.splitlines() if line.startswith("bubblefit: ")]
    assert "Traceback" not in output
    return line


@pytest.mark.parametrize(
    ("file", "old", "new", "code", "words"),
    [
        ("project", 'job.txt.j2"', 'frame.j2"', 2, "deck[0].template: there is no file"),
        ("project", "[0.05, 3.0]", "[3.0, 0.05]", 2, "C10.bounds: expected [least, largest]"),
        ("project", '"C10 + C01', '"C10 + C3', 2, "feasible: 'C10 + C3 > 0.1': 'C3' is undefined"),
        ("project", '"frame.csv"', '"other.csv"', 2, "compare[0].measured: there is no file"),
        ("project", 'column = "force"', 'column = "torce"', 2, "no column of torce"),
        ("project", "[\"PYTHON\"", "[\"no-such-program\"", 2, "program: there is no program"),
        ("project", 'result = "curve.csv"\n', "", 2, "result: expected the name of the file"),
        ("project", "noise = 0.002", "sigma = 0.002", 2, "compare[0].sigma: unknown key"),
        ("project", 'result = "force_N"', 'set = "GRIP"', 2, "compare[0].y: expected one of"),
        ("job", "{{ C01 | number }}", "0.1", 2, "parameters.C01: job.txt.j2 does not have it"),
        ("job", "number }}", "numbr }}", 2, "job.txt.j2: line 1: No filter named 'numbr'"),
        ("job", "{{ C10", "\n{{ C30", 2, "job.txt.j2: line 2: 'C30' is undefined"),
        ("solve", '"curve.csv", "w"', '"c.csv", "w"', 4, "the run wrote no curve.csv"),
        ("solve", "range(81)", "range(40)", 4, "the results go from 0 to 3.9, measured: 0.5 to 6"),
        ("solve", 'print("solved")', "exit(3)", 4, "ended with exit code 3"),
        ("solve", 'print("solved")', "import time; time.sleep(9)", 4, "did not end within 0.4 s"),
        ("solve", "force_N", "F", 4, "column 'force_N': this column is missing"),
    ],
)  # fmt: skip
def test_mistake_is_one_line(tmp_path, monkeypatch, file, old, new, code, words):
    names = {"project": "project.toml", "job": "job.txt.j2", "solve": "solve.py"}
    seconds = 0.4 if "sleep" in new else 60
    timeout = [("[deck.parameters]", f"timeout = {seconds}\n[deck.parameters]")]
    path = bar_project(tmp_path, monkeypatch, timeout)
    text = (tmp_path / names[file]).read_text()
    old = old.replace("PYTHON", sys.executable)
    assert old in text
    (tmp_path / names[file]).write_text(text.replace(old, new))
    assert words in error_of(path, code)


@pytest.mark.parametrize(
    ("file", "old", "new", "code", "words"),
    [
        ("sets.inp", "SHEET,", "PLATE,", 4, "there is no node set 'SHEET'; there are: PLATE"),
        ("project.toml", "[1.0, 2.0]", "[1.0]", 2, "a time of the analysis for each of 2 frames"),
        ("project.toml", "[1.0, 2.0]", "[1.0, 9.0]", 4, "results go from 0 to 2, measured: 1 to 9"),
        ("solve.py", 'Name="displacement"', 'Name="stress"', 4, "hold no displacement at these"),
        ("solve.py", "</VTKFile>", "", 4, "no usable results in out-*.vtu"),
    ],
)
def test_mistake_about_fields_is_one_line(tmp_path, monkeypatch, file, old, new, code, words):
    path = sheet_project(tmp_path, monkeypatch)
    text = (tmp_path / file).read_text()
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new))
    assert words in error_of(path, code)
