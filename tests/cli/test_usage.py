"""What was mistyped, help and its examples, completion, --verbose."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from bubblefit.cli.main import COMMANDS, main
from bubblefit.cli.terminal import HEAD, every_command, examples_in
from click.testing import CliRunner, Result

from .. import needs
from ..commands import in_process
from ..projects import small


def run(*arguments: str) -> Result:
    return CliRunner().invoke(main, arguments)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("bubbel", "bubbel: no such command; did you mean 'bubble'? (bubblefit --help lists every"
         " command)"),
        ("zzz", "zzz: no such command (bubblefit --help lists every command)"),
        ("study mash", "mash: no such command; did you mean 'mesh'? (bubblefit study --help lists"
         " every command)"),
        ("dic spheer", "spheer: no such command; did you mean 'sphere'? (bubblefit dic --help lists"
         " every command)"),
        ("fit a.toml --strats 3", "--strats: no such option of bubblefit fit; did you mean"
         " '--starts'? (bubblefit fit --help tells what it takes)"),
        ("--verbos", "--verbos: no such option of bubblefit; did you mean '--verbose'?"
         " (bubblefit --help tells what it takes)"),
        ("fit a.toml --starts 0", "--starts: 0 is not in the range x>=1 (bubblefit fit --help tells"
         " what it takes)"),
        ("fit a.toml --starts", "--starts: requires an argument"),
        ("fit", "PROJECT: is missing (bubblefit fit --help tells what it takes)"),
        ("simulate bubble a.toml", "--card: is missing (bubblefit simulate bubble --help tells what"
         " it takes)"),
        ("fit a.toml b.toml", "got unexpected extra argument (b.toml) (bubblefit fit --help tells"
         " what it takes)"),
        ("simulate bend --diameter wide", "--diameter: 'wide' is not a valid float"
         " (bubblefit simulate bend --help tells what it takes)"),
    ],
)  # fmt: skip
def test_what_was_mistyped_is_one_line_as_any_bad_input(typed: str, said: str) -> None:
    done = run(*typed.split())
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr == f"bubblefit: {said}\n"


def test_a_bad_project_is_said_in_the_same_form(tmp_path: Path) -> None:
    done = run("fit", str(tmp_path / "none.toml"))
    assert done.exit_code == 2 and done.stderr.startswith(f"bubblefit: {tmp_path}/none.toml: ")
    assert len(done.stderr.splitlines()) == 1


EVERY = {"": main, **{" ".join(path): command for path, command in every_command(main)}}
ALIASES = {"simulate strips": "simulate uniaxial"}


def test_every_command_is_walked() -> None:
    assert {*COMMANDS, "study mesh", "simulate bend", "dic sphere"} <= EVERY.keys()


@pytest.mark.parametrize("name", EVERY)
def test_the_help_of_every_command_has_examples_that_can_be_typed(name: str) -> None:
    """Each is of this command, and click can parse it: options, choices, numbers, arguments."""
    shown = run(*name.split(), "--help").stdout
    lines = examples_in(EVERY[name].epilog)
    assert lines and HEAD in shown
    own = ALIASES.get(name, name)
    for line in lines:
        assert f"    {line}\n" in shown, "click has wrapped it"
        assert line.startswith(f"bubblefit {own}".rstrip()), line
        parse(line)


def parse(line: str) -> None:
    """Raises click's own error where the line cannot be."""
    command: click.Command = main
    ctx, words = None, shlex.split(line)[1:]
    while True:
        if words[-1:] == ["--help"]:
            return
        ctx = command.make_context(command.name, [*words], parent=ctx)
        if not isinstance(command, click.Group):
            return
        name, *words = [*ctx._protected_args, *ctx.args]
        found = command.get_command(ctx, name)
        assert found is not None, line
        command = found


@pytest.mark.parametrize(
    "line", ["bubblefit fit a --starts x", "bubblefit nothing", "bubblefit fit"]
)
def test_an_example_that_is_wrong_is_found(line: str) -> None:
    with pytest.raises((click.ClickException, AssertionError)):
        parse(line)


@pytest.mark.parametrize(
    ("line", "offered"),
    [("bubblefit bi", "biaxial"), ("bubblefit export a.toml --format gs", "gsa")],
)
def test_bash_completes(line: str, offered: str) -> None:
    """By the very line that the documents say."""
    bash = shutil.which("bash")
    if bash is None:
        needs.missing("there is no bash")
    documented = 'eval "$(_BUBBLEFIT_COMPLETE=bash_source bubblefit)"'
    assert documented in (Path(__file__).parents[2] / "docs/how-to/terminal.md").read_text()
    words = line.split()
    script = f"""{documented}
COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}
_bubblefit_completion bubblefit; echo "${{COMPREPLY[@]}}"
"""
    own = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [bash, "-c", script], capture_output=True, text=True, env={**os.environ, "PATH": own}
    )
    assert done.stdout.split() == [offered], done.stderr


@pytest.fixture
def told(tmp_path: Path) -> Iterator[Path]:
    """A project, and the loggers as they were afterwards."""
    from bubblefit.cli.terminal import LOGGER, Stderr

    before = LOGGER.level, list(LOGGER.handlers)
    yield small(tmp_path)
    LOGGER.setLevel(before[0])
    LOGGER.handlers[:] = [h for h in before[1] if not isinstance(h, Stderr)]


def test_verbose_tells_every_analysis_start_and_time(told: Path, tmp_path: Path) -> None:
    """After the command's name as before it; on stderr, so that stdout stays for results."""
    arguments = ("fit", told, "--out", "out", "--starts", 1, "--jobs", 1, "--verbose")
    done = in_process(*arguments, cwd=tmp_path)
    rows = (tmp_path / "out/history.csv").read_text().splitlines()[1:]
    for number, row in enumerate(rows, 1):
        value = row.split(",")[4]
        said = f"objective {float(value):.6g}, ok" if value else "failed, no equilibrium at "
        assert f" start 0, analysis {number} by membrane: {said}" in done.stderr
    assert " start 0 ended: " in done.stderr and f"; {len(rows)} analyses in " in done.stderr
    for part in (
        "tests and their data made ready",
        "all starts",
        "card, tables and figures in out",
    ):
        assert f" {part}: " in done.stderr
    assert "start 0, analysis" not in done.stdout
    # All notes, where there would be one and a count.
    assert done.stdout.count("note: ") == 2 and "further note" not in done.stdout
    quiet = in_process("doctor", cwd=tmp_path)
    assert " analysis " not in quiet.stderr
