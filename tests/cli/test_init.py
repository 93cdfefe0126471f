"""`bubblefit init` and `bubblefit schema`: examples, projects for own tests, the schema beside."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Container
from pathlib import Path

import jsonschema
import pytest
from bubblefit.cli.start import KINDS
from bubblefit.experiments.bubble.registration import RegistrationOptions
from bubblefit.project.project import read_project
from bubblefit.project.schema import SHIPPED, parse, project_schema
from click.testing import CliRunner

from ..commands import in_process, one_line
from ..places import EXAMPLES, ROOT

FIRST = "#:schema ../../templates/project/project.schema.json\n"
PROJECTS = [
    path
    for path in sorted(EXAMPLES.glob("*/*.toml"))
    if "[fabric]" in path.read_text() and path.parent.name != "plug-in"
]


@pytest.fixture(scope="module")
def schema() -> jsonschema.Draft202012Validator:
    content = json.loads(SHIPPED.read_text())
    jsonschema.Draft202012Validator.check_schema(content)
    return jsonschema.Draft202012Validator(content)


def test_the_command_writes_it(tmp_path: Path) -> None:
    printed = in_process("schema", cwd=tmp_path).stdout
    assert json.loads(printed) == project_schema()
    in_process("schema", "--out", "s.json", cwd=tmp_path)
    assert (tmp_path / "s.json").read_text() == printed


@pytest.mark.parametrize("path", PROJECTS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_examples_are_valid_and_name_it(path: Path, schema) -> None:
    text = path.read_text()
    assert text.startswith(FIRST) and (path.parent / FIRST.split()[1]).resolve() == SHIPPED
    schema.validate(tomllib.loads(text))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("radius = 100.0", "radios = 100.0"),
        ("radius = 100.0", 'radius = "100"'),
        ("radius = 100.0", "radius = -1.0"),
        ('modulus = "GPa"', 'modulus = "psi"'),
        ("[fabric]\n", "[fabrics]\n"),
        ("[fit]\n", '[solver.calculix]\nelement = "T6"\n[fit]\n'),
        ("[fit]\n", "[defaults.bubble]\nradios = 1.0\n[fit]\n"),
        ("[fit]\n", "[defaults.balloon]\nradius = 1.0\n[fit]\n"),
    ],
)
def test_it_finds_what_bubblefit_finds(old: str, new: str, schema) -> None:
    text = (EXAMPLES / "bubble-known-solution" / "project.toml").read_text()
    assert old in text
    assert not schema.is_valid(tomllib.loads(text.replace(old, new, 1)))


def test_what_a_kind_has_in_common_may_stand_once(schema) -> None:
    schema.validate(
        {
            "fabric": {"thickness": 1},
            "defaults": {"cylinder": {"diameter": 150}},
            "cylinder": [{"pressure": 90}, {"pressure": 110, "gas": {"ambient": 100}}],
            "solver": {"membrane": {"wrinkle_stiffness": 0.001}, "of a plug-in": {"any": 1}},
        }
    )


@pytest.mark.parametrize("example", list(KINDS))
def test_an_example_brings_the_schema(example: str, tmp_path: Path) -> None:
    in_process("init", "mine", "--example", example, cwd=tmp_path)
    for path in (tmp_path / "mine").glob("*.toml"):
        assert path.read_text().startswith("#:schema project.schema.json\n")
    assert (tmp_path / "mine" / SHIPPED.name).read_text() == SHIPPED.read_text()


# For own tests


def own(*options: object, cwd: Path, code: int = 0):
    return in_process("init", "mine", "--own", *options, cwd=cwd, code=code)


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
def test_own_tests(options: list, tests: list[str], tmp_path: Path, schema) -> None:
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


def uncommented(lines: list[str], wanted: Container[int]) -> str:
    return "\n".join(
        line[2:] if COMMENTED.match(line) and number in wanted else line
        for number, line in enumerate(lines)
    )


def test_what_is_commented_may_be_wanted(tmp_path: Path, schema) -> None:
    """Every commented key with its section, one at a time and all together."""
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
        parse(path)
        schema.validate(tomllib.loads(path.read_text()))


def test_registration_and_pressures_of_own_tests(tmp_path: Path) -> None:
    """The blocks as they stand, without what is said in their place."""
    own("--bubble", 1, cwd=tmp_path)
    path = tmp_path / "mine" / "project.toml"
    lines = path.read_text().splitlines()
    first = lines.index("# [bubble.data.points.registration]")
    last = lines.index("", first)
    marks = next(n for n in range(first, last) if "warp_points" in lines[n])
    path.write_text(uncommented(lines, {*range(first, last)} - {marks}))
    found = read_project(path, need_data=False).tests["bubble"].data.registration
    assert found == RegistrationOptions(centre=(0.0, 0.0, 0.0), warp=0.0)


def test_numbers_of_own_tests(tmp_path: Path) -> None:
    own("--bubble", 1, "--radius", 90, "--pressures", "10,25.5,60", "--cylinder", 1,
        "--diameter", 200, "--pressure", 80, cwd=tmp_path)  # fmt: skip
    tests = read_project(tmp_path / "mine" / "project.toml", need_data=False).tests
    assert tests["bubble"].radius == 90.0
    assert tests["bubble"].pressures == pytest.approx((0.010, 0.0255, 0.060))
    assert tests["cylinder"].models()["cylinder"].pressure == pytest.approx(0.08)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "--own: name at least one test: --biaxial, --bubble, --strips, --cylinder"),
        (["--bubble", 1, "--form", "quartic"], "--form: 'quartic' is not one of: constant"),
        (["--bubble", 1, "--pressures", "1,b"], "--pressures: expected numbers"),
        (["--bubble", 1, "--pressures", "2,1"], "pressures must increase"),
        (["--bubble", 1, "--radius", -1], "radius: expected greater than 0"),
        (["--bubble", 1, "--example", "known"], "give one of them, not both"),
    ],
)
def test_own_mistakes_end_in_one_line(options: list, words: str, tmp_path: Path) -> None:
    one_line(own(*options, cwd=tmp_path, code=2), words)
    assert not (tmp_path / "mine" / "project.toml").exists()


def test_nothing_is_written_over(tmp_path: Path) -> None:
    own("--bubble", 1, cwd=tmp_path)
    one_line(own("--bubble", 1, cwd=tmp_path, code=2), "is already there")
    one_line(in_process("init", "other", "--radius", 3, cwd=tmp_path, code=2), "without --own")


def test_questions_on_a_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bubblefit.cli import start as init

    monkeypatch.setattr(init, "on_a_terminal", lambda: True)
    answers = "Sail\n0.7\n1\n120\n10,20\n1\n0\n1\n150\n90\nspline\n"
    done = CliRunner().invoke(init.init_command, [str(tmp_path / "mine"), "--own"], input=answers)
    assert done.exit_code == 0, done.output
    project = read_project(tmp_path / "mine" / "project.toml", need_data=False)
    assert list(project.tests) == ["bubble", "strips", "cylinder"]
    assert (project.fabric.name, project.law.form) == ("Sail", "spline")


def test_the_schema_is_part_of_the_package() -> None:
    assert SHIPPED.is_relative_to(ROOT / "templates")
