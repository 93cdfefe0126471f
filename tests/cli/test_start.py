"""The commands `init` and `schema`: projects they write, questions they ask."""

import json
import re
import tomllib
from types import SimpleNamespace

import jsonschema
import numpy as np
import pytest
from bubblefit.cli import start
from bubblefit.cli.start import KINDS, SHIPPED
from bubblefit.project.project import read_project
from bubblefit.project.schema import project_schema, read_content, validated
from click.testing import CliRunner

from ..builders.projects import known_bubble
from ..support.commands import in_process
from ..support.paths import ROOT


@pytest.fixture(scope="module")
def schema():
    content = json.loads(SHIPPED.read_text())
    jsonschema.Draft202012Validator.check_schema(content)
    return jsonschema.Draft202012Validator(content)


def test_schema_command_writes_the_schema(tmp_path):
    assert SHIPPED.is_relative_to(ROOT / "templates")
    printed = in_process("schema", cwd=tmp_path).stdout
    assert json.loads(printed) == project_schema()
    in_process("schema", "--out", "s.json", cwd=tmp_path)
    assert (tmp_path / "s.json").read_text() == printed


def test_every_example_comes_with_the_schema(tmp_path):
    for example in KINDS:
        folder = tmp_path / example
        in_process("init", example, "--example", example, cwd=tmp_path)
        for path in folder.glob("*.toml"):
            assert path.read_text().startswith("#:schema project.schema.json\n")
        assert (folder / SHIPPED.name).read_text() == SHIPPED.read_text()
    assert len(read_project(tmp_path / "bend" / "project.toml").tests) == 9


def test_pressures_of_frames_are_written_as_a_project_takes_them():
    """Two frames of a hold are one pressure, and small pressures are not rounded to each other."""
    assert start._loaded_pressures([0.0, 0.1014, 0.10142, 0.2]) == [101.4, 200.0]
    assert start._loaded_pressures([0.00012, 0.00031, 0.0005]) == [0.12, 0.31, 0.5]
    many = start._loaded_pressures(np.linspace(0.0, 0.3, 40))
    assert len(many) == 12 and many[-1] == 300.0 and (np.diff(many) > 0).all()


def own(*options, cwd, code=0):
    return in_process("init", "mine", "--own", *options, cwd=cwd, code=code)


def test_pressures_of_a_draft_are_those_of_the_bubble_of_that_number(tmp_path, monkeypatch):
    project = read_project(known_bubble(tmp_path))
    readable = SimpleNamespace(tests={"bubble 2": project.tests["bubble"]})
    monkeypatch.setattr(start, "_read_draft", lambda text, problems: readable)
    monkeypatch.setattr(start, "_law_for_data", lambda project: {})
    monkeypatch.setattr(start, "_project_text", lambda tests, settings: "")
    bubbles = [{"kind": "bubble"}, {"kind": "bubble"}]
    start._text_for_data(bubbles, {}, [], tmp_path)
    assert "recorded" not in bubbles[0] and max(bubbles[1]["recorded"]) == 300.0


@pytest.mark.parametrize(
    ("options", "tests"),
    [
        (["--bubble", 1], ["bubble"]),
        (["--strips", 1, "--form", "spline"], ["strips"]),
        (["--cylinder", 1], ["cylinder"]),
        (["--biaxial", 2], ["biaxial 1", "biaxial 2"]),
        (["--bubble", 2, "--strips", 2, "--cylinder", 2, "--form", "trilinear"],
         ["bubble 1", "bubble 2", "strips 1", "strips 2", "cylinder 1", "cylinder 2"]),
    ],
)  # fmt: skip
def test_init_writes_own_tests(options, tests, tmp_path, schema):
    own(*options, "--name", 'A "blue" one', "--thickness", 0.6, cwd=tmp_path)
    path = tmp_path / "mine" / "project.toml"
    project = read_project(path, need_data=False)
    assert list(project.tests) == tests
    assert project.fabric.name == 'A "blue" one' and project.fabric.thickness == 0.6
    text = path.read_text()
    schema.validate(tomllib.loads(text))
    for test in project.tests.values():
        # The loads of a biaxial test are its data, which are not there yet.
        assert bool(test.models()) == (test.kind != "biaxial")
    # Moduli are bounded, not coefficients: that serves every form.
    assert ("E1 = [" in text) == any("cylinder" not in name for name in tests)
    longest = max(map(len, text.splitlines()))
    assert longest <= 120, longest


#: A key or a section that may be wanted: the rest of its line is TOML, too.
COMMENTED = re.compile(r"# (\[[\w.]+\]|\[\[\w+\]\]|\w+ = .*)")


def uncommented(lines, wanted):
    return "\n".join(
        line[2:] if COMMENTED.match(line) and number in wanted else line
        for number, line in enumerate(lines)
    )


def test_commented_keys_of_a_new_project_are_valid(tmp_path, schema):
    own("--bubble", 1, "--strips", 1, "--cylinder", 1, cwd=tmp_path)
    path = tmp_path / "mine" / "project.toml"
    lines = path.read_text().splitlines()
    numbers = [n for n, line in enumerate(lines) if COMMENTED.match(line)]
    keys = {lines[n][2:].split(" =")[0] for n in numbers}
    assert {"[bubble.data.points.registration]", "warp", "warp_points", "format"} <= keys
    assert {"[bubble.sheet]", "surface", "modes", "[bubble.data.points.pressure]"} <= keys
    headers = [n for n in numbers if lines[n][2] == "["]
    one_by_one = [{n, max((h for h in headers if h <= n), default=n)} for n in numbers]
    for wanted in [*one_by_one, set(numbers)]:
        path.write_text(uncommented(lines, wanted))
        validated(read_content(path), path)
        schema.validate(tomllib.loads(path.read_text()))


def test_init_asks_questions_on_a_terminal(tmp_path, monkeypatch):
    monkeypatch.setattr(start, "on_a_terminal", lambda: True)
    answers = "Sail\n0.7\n1\n120\n10,20\n1\n0\n1\n150\n90\nspline\n"
    run = [str(tmp_path / "mine"), "--own"]
    done = CliRunner().invoke(start.init_command, run, input=answers)
    assert done.exit_code == 0, done.output
    project = read_project(tmp_path / "mine" / "project.toml", need_data=False)
    assert list(project.tests) == ["bubble", "strips", "cylinder"]
    assert (project.fabric.name, project.law.form) == ("Sail", "spline")
