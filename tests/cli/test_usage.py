"""What was mistyped, help and its examples, completion, --verbose."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest
from bubblefit.cli.main import main
from bubblefit.cli.terminal import HEAD, LOGGER
from click.testing import CliRunner

from .. import needs
from ..commands import every_command, in_process
from ..places import ROOT
from ..projects import with_form


def run(*arguments):
    return CliRunner().invoke(main, arguments)


@pytest.mark.parametrize(
    ("typed", "said"),
    [
        ("bubbel", "bubbel: no such command; did you mean 'bubble'? (bubblefit --help "),
        ("zzz", "zzz: no such command (bubblefit --help "),
        ("study mash", "mash: no such command; did you mean 'mesh'? (bubblefit study --help "),
        ("dic spheer", "spheer: no such command; did you mean 'sphere'? (bubblefit dic --help "),
        ("fit a.toml --strats 3", "--strats: no such option of bubblefit fit; did you mean"
         " '--starts'? (bubblefit fit --help "),
        ("--verbos", "--verbos: no such option of bubblefit; did you mean '--verbose'?"),
        ("fit a.toml --starts 0", "--starts: 0 is not in the range x>=1 (bubblefit fit --help "),
        ("fit a.toml --starts", "--starts: requires an argument"),
        ("fit", "PROJECT: is missing (bubblefit fit --help "),
        ("simulate bubble a.toml", "--card: is missing (bubblefit simulate bubble --help "),
        ("fit a.toml b.toml", "got unexpected extra argument (b.toml) (bubblefit fit --help "),
        ("simulate bend --diameter wide", "--diameter: 'wide' is not a valid float"),
        ("fit none.toml", "none.toml: "),
    ],
)  # fmt: skip
def test_what_was_mistyped_is_one_line_as_any_bad_input(typed, said):
    done = run(*typed.split())
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith(f"bubblefit: {said}") and done.stderr.count("\n") == 1


EVERY = {"": main, **{" ".join(path): command for path, command in every_command(main)}}
ALIASES = {"simulate strips": "simulate uniaxial"}


@pytest.mark.parametrize("name", EVERY)
def test_the_help_of_every_command_has_examples_that_can_be_typed(name):
    """Each is of this command, and click can parse it: options, choices, numbers, arguments."""
    shown = run(*name.split(), "--help").stdout
    typed = EVERY[name].epilog.partition(f"{HEAD}\n")[2]
    lines = [line.strip() for line in typed.splitlines() if line.strip()]
    assert lines and HEAD in shown
    for line in lines:
        assert f"    {line}\n" in shown, "click has wrapped it"
        assert line.startswith(f"bubblefit {ALIASES.get(name, name)}".rstrip()), line
        parse(line)


def parse(line):
    """Raises click's own error where the line cannot be."""
    command = main
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


def test_an_example_that_is_wrong_is_found():
    for line in ("bubblefit fit a --starts x", "bubblefit nothing", "bubblefit fit"):
        with pytest.raises((click.ClickException, AssertionError)):
            parse(line)


def test_bash_completes():
    """By the very line that the documents say."""
    bash = needs.program("bash", package="bash")
    documented = 'eval "$(_BUBBLEFIT_COMPLETE=bash_source bubblefit)"'
    assert documented in (ROOT / "docs/how-to/terminal.md").read_text()
    script = f"""{documented}
COMP_WORDS=(bubblefit export a.toml --format gs); COMP_CWORD=4
_bubblefit_completion bubblefit; echo "${{COMPREPLY[@]}}"
COMPREPLY=(); COMP_WORDS=(bubblefit bi); COMP_CWORD=1
_bubblefit_completion bubblefit; echo "${{COMPREPLY[@]}}"
"""
    own = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [bash, "-c", script], capture_output=True, text=True, env={**os.environ, "PATH": own}
    )
    assert done.stdout.split() == ["gsa", "biaxial"], done.stderr


def test_verbose_tells_every_analysis_start_and_time(tmp_path, monkeypatch):
    """After the command's name as before it; on stderr, so that stdout stays for results."""
    monkeypatch.setattr(LOGGER, "level", LOGGER.level)
    monkeypatch.setattr(LOGGER, "handlers", list(LOGGER.handlers))
    project = with_form(tmp_path, 'form = "constant"')
    arguments = ("fit", project, "--out", "out", "--starts", 1, "--jobs", 1, "--verbose")
    done = in_process(*arguments, cwd=tmp_path)
    rows = (tmp_path / "out/history.csv").read_text().splitlines()[1:]
    for number, row in enumerate(rows, 1):
        value = row.split(",")[4]
        said = f"objective {float(value):.6g}, ok" if value else "failed, no equilibrium at "
        assert f" start 0, analysis {number} by membrane: {said}" in done.stderr
    assert " start 0 ended: " in done.stderr and f"; {len(rows)} analyses in " in done.stderr
    for part in ("tests and their data", "all starts", "card, tables and figures in out"):
        assert f" {part}" in done.stderr
    assert "start 0, analysis" not in done.stdout
    # All notes, where there would be one and a count.
    assert done.stdout.count("note: ") >= 2 and "further note" not in done.stdout
    assert " analysis " not in in_process("doctor", cwd=tmp_path).stderr


def test_a_new_interpreter_says_what_this_one_says(tmp_path):
    """Exit code, stdout and stderr of `in_process` are those of the real command."""
    runs = ((("init", "mine"), 0), (("init", "mine"), 2), (("fit", "bad.toml"), 2))
    for arguments, code in ((("--version",), 0), *runs):
        here, new = tmp_path / "here", tmp_path / "new"
        for folder in (here, new):
            folder.mkdir(exist_ok=True)
            (folder / "bad.toml").write_text("[fabric]\nthikness = 1\n")
        module = "bubblefit" if code else "bubblefit.cli"
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments], cwd=new, capture_output=True, text=True
        )
        same = in_process(*arguments, cwd=here, code=code)
        assert (done.returncode, done.stdout, done.stderr) == (code, same.stdout, same.stderr)
