"""The command line as a whole: mistyped words, help with examples, completion."""

import os
import shlex
import subprocess
import sys
import warnings
from pathlib import Path

import click
import pytest
from bubblefit.cli.main import main
from bubblefit.cli.terminal import HEAD
from bubblefit.notes import GRAVE, BubblefitWarning, Note, NoteKind, warn_of
from click.testing import CliRunner

from ..support import needs
from ..support.commands import every_command, in_process
from ..support.paths import ROOT


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
def test_mistyped_word_is_one_line(typed, said):
    done = run(*typed.split())
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith(f"bubblefit: {said}") and done.stderr.count("\n") == 1


EVERY = {"": main, **{" ".join(path): command for path, command in every_command(main)}}


ALIASES = {"simulate strips": "simulate uniaxial"}


@pytest.mark.parametrize("name", EVERY)
def test_help_of_every_command_has_valid_examples(name):
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


def test_bash_completes_commands_and_options():
    bash = needs.program("bash", package="bash")
    documented = 'eval "$(_BUBBLEFIT_COMPLETE=bash_source bubblefit)"'
    assert documented in (ROOT / "docs/how-to/terminal.md").read_text()
    script = f"""{documented}
COMP_WORDS=(bubblefit export a.toml --format gs); COMP_CWORD=4
_bubblefit_completion bubblefit; echo "${{COMPREPLY[@]}}"
"""
    own = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [bash, "-c", script], capture_output=True, text=True, env={**os.environ, "PATH": own}
    )
    assert done.stdout.split() == ["gsa"], done.stderr


def test_real_command_prints_what_the_test_runner_prints(tmp_path):
    """Exit code, stdout and stderr of `in_process` are those of the real command."""
    (tmp_path / "bad.toml").write_text("[fabric]\nthikness = 1\n")
    for arguments, code in ((("cache", "--folder", "runs"), 0), (("fit", "bad.toml"), 2)):
        module = "bubblefit" if code else "bubblefit.cli"
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments], cwd=tmp_path, capture_output=True, text=True
        )
        same = in_process(*arguments, cwd=tmp_path, code=code)
        assert (done.returncode, done.stdout, done.stderr) == (code, same.stdout, same.stderr)


def test_command_prints_notes_and_no_warning_of_python(monkeypatch):
    def invoke(group, ctx):
        warn_of([Note(NoteKind("grave", weight=GRAVE), "not to be believed")], 1)
        return 0

    monkeypatch.setattr(click.Group, "invoke", invoke)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        done = CliRunner().invoke(main, ["doctor"])
        invoke(main, None)
    assert done.exit_code == 0
    assert [warning.category for warning in caught] == [BubblefitWarning]
