"""`python -m bubblefit`: the command where none is on the PATH."""

import subprocess
import sys

from ..commands import in_process


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
