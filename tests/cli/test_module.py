"""`python -m bubblefit`: the command where none is on the PATH."""

import subprocess
import sys

from ..commands import bubblefit


def test_the_package_runs_as_a_module():
    done = subprocess.run(
        [sys.executable, "-m", "bubblefit", "--version"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("bubblefit, version ")


def test_a_new_interpreter_says_what_a_copy_of_this_one_says(tmp_path):
    """Exit code, stdout and stderr of `bubblefit` in the tests are those of the real command."""
    for arguments, code in ((("init", "mine"), 0), (("init", "mine"), 2), (("fit", "bad.toml"), 2)):
        copy, new = tmp_path / "copy", tmp_path / "new"
        for folder in (copy, new):
            folder.mkdir(exist_ok=True)
            (folder / "bad.toml").write_text("[fabric]\nthikness = 1\n")
        done = subprocess.run(
            [sys.executable, "-m", "bubblefit.cli", *arguments],
            cwd=new, capture_output=True, text=True,
        )  # fmt: skip
        same = bubblefit(*arguments, cwd=copy, code=code)
        assert (done.returncode, done.stdout, done.stderr) == (code, same.stdout, same.stderr)
